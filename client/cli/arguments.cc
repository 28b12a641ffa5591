#include "client/cli/arguments.h"

#include <charconv>
#include <cmath>
#include <map>
#include <optional>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/exit_code.h"

namespace fathom::client::cli {
namespace {

absl::Status Bad(const std::string& message) {
  return UsageError(absl::InvalidArgumentError(message));
}

std::string_view Trim(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::optional<double> Number(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() ||
      !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

}  // namespace

double GeoBox::Width() const {
  const double width = east_deg - west_deg;
  return width > 0 ? width : width + 360;
}

std::vector<std::string> SplitList(std::string_view text, char separator) {
  std::vector<std::string> parts;
  std::size_t begin = 0;
  while (true) {
    const std::size_t end = text.find(separator, begin);
    parts.emplace_back(Trim(text.substr(begin, end - begin)));
    if (end == std::string_view::npos) return parts;
    begin = end + 1;
  }
}

absl::StatusOr<double> ParseNumber(std::string_view text) {
  const std::optional<double> value = Number(text);
  if (!value.has_value()) {
    return Bad(absl::StrFormat("\"%s\" is not a number", std::string(text)));
  }
  return *value;
}

absl::StatusOr<v1::GeodeticPoint> ParsePoint(std::string_view text) {
  const std::vector<std::string> parts = SplitList(text, ',');
  const std::optional<double> latitude_deg = Number(parts[0]);
  const std::optional<double> longitude_deg =
      parts.size() == 2 ? Number(parts[1]) : std::nullopt;
  if (!latitude_deg.has_value() || !longitude_deg.has_value()) {
    return Bad(absl::StrFormat(
        "\"%s\": say LAT,LON in degrees, as in 41.6,-71.4", std::string(text)));
  }
  if (std::abs(*latitude_deg) > 90 || std::abs(*longitude_deg) > 180) {
    return Bad(absl::StrFormat(
        "\"%s\": latitude is in [-90, 90] and longitude in [-180, 180]; "
        "latitude comes first",
        std::string(text)));
  }
  v1::GeodeticPoint point;
  point.set_latitude_deg(*latitude_deg);
  point.set_longitude_deg(*longitude_deg);
  return point;
}

absl::StatusOr<Time> ParseMoment(std::string_view text, Time now) {
  static const std::map<std::string_view, double, std::less<>> kUnitSeconds = {
      {"s", 1}, {"min", 60}, {"h", 3600}, {"d", 86'400}};
  if (text == "now") return now;
  if (text.starts_with('+') || text.starts_with('-')) {
    const std::size_t unit_at = text.find_first_not_of("+-.0123456789");
    const std::optional<double> amount = Number(text.substr(0, unit_at));
    const auto unit = kUnitSeconds.find(
        unit_at == std::string_view::npos ? "" : text.substr(unit_at));
    // 1e9 s are 31 years: keeps the sum within Time.
    if (!amount.has_value() || unit == kUnitSeconds.end() ||
        std::abs(*amount * unit->second) > 1e9) {
      return Bad(absl::StrFormat(
          "\"%s\": say an offset to now as in +10min, -30s, +1.5h or -2d",
          std::string(text)));
    }
    return now + Duration(std::llround(*amount * unit->second * 1e6));
  }
  absl::StatusOr<Time> time = ParseTime(text);
  if (!time.ok()) {
    return Bad(absl::StrFormat(
        "\"%s\": say a time as in 2026-01-01T12:00:00Z, now, +10min or -30s",
        std::string(text)));
  }
  return *time;
}

absl::StatusOr<GeoBox> ParseBox(std::string_view text) {
  const std::vector<std::string> parts = SplitList(text, ',');
  std::vector<double> values;
  for (const std::string& part : parts) {
    if (const auto value = Number(part)) values.push_back(*value);
  }
  if (parts.size() != 4 || values.size() != 4) {
    return Bad(absl::StrFormat(
        "\"%s\": say S,W,N,E in degrees, as in 41.2,-71.6,41.9,-71.0",
        std::string(text)));
  }
  const GeoBox box{values[0], values[1], values[2], values[3]};
  if (box.south_deg < -90 || box.north_deg > 90 ||
      box.south_deg >= box.north_deg || std::abs(box.west_deg) > 180 ||
      std::abs(box.east_deg) > 180 || box.west_deg == box.east_deg) {
    return Bad(absl::StrFormat(
        "\"%s\": S,W,N,E needs -90 <= S < N <= 90 and W, E in [-180, 180] "
        "(W > E crosses the antimeridian)",
        std::string(text)));
  }
  return box;
}

}  // namespace fathom::client::cli
