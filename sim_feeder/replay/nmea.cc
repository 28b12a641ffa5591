#include "sim_feeder/replay/nmea.h"

#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdint>

#include "absl/status/status.h"

namespace fathom::feeder {
namespace {

constexpr std::size_t kMaxLine = 1024;

std::optional<int> HexByte(std::string_view text) {
  int value = 0;
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), value, 16);
  if (error != std::errc() || end != text.data() + text.size() ||
      text.size() != 2) {
    return std::nullopt;
  }
  return value;
}

std::optional<std::int64_t> Whole(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    return std::nullopt;
  }
  return value;
}

// The exclusive or of all characters.
int Checksum(std::string_view text) {
  int sum = 0;
  for (const char c : text) sum ^= static_cast<unsigned char>(c);
  return sum;
}

// What stands before "*hh" if hh is its checksum.
absl::StatusOr<std::string_view> Checked(std::string_view text) {
  const std::size_t star = text.rfind('*');
  if (star == std::string_view::npos) {
    return absl::InvalidArgumentError("no checksum");
  }
  const std::optional<int> stated = HexByte(text.substr(star + 1, 2));
  if (!stated.has_value() || *stated != Checksum(text.substr(0, star))) {
    return absl::InvalidArgumentError("bad checksum");
  }
  return text.substr(0, star);
}

std::vector<std::string_view> Split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (;;) {
    const std::size_t end = text.find(separator);
    parts.push_back(text.substr(0, end));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

// Fields "k:value" between backslashes, NMEA 4.10.
std::optional<Time> TimeOfTagBlock(std::string_view block) {
  const absl::StatusOr<std::string_view> checked = Checked(block);
  if (!checked.ok()) return std::nullopt;
  for (const std::string_view field : Split(*checked, ',')) {
    if (!field.starts_with("c:")) continue;
    const std::optional<std::int64_t> stamp = Whole(field.substr(2));
    if (!stamp.has_value() || *stamp < 0) return std::nullopt;
    // Ten digits are seconds until the year 2286; more are milliseconds.
    constexpr std::int64_t kLastSecond = 9'999'999'999;
    if (*stamp <= kLastSecond) return Time(std::chrono::seconds(*stamp));
    if (*stamp / 1000 > kLastSecond) return std::nullopt;
    return Time(std::chrono::milliseconds(*stamp));
  }
  return std::nullopt;
}

std::optional<double> Angle(std::string_view field, char positive,
                            char negative, std::string_view hemisphere,
                            double limit_deg) {
  const std::optional<double> value = NmeaNumber(field);
  if (!value.has_value() || hemisphere.size() != 1 || *value < 0) {
    return std::nullopt;
  }
  const double degrees = std::floor(*value / 100);
  const double minutes = *value - 100 * degrees;
  const double angle_deg = degrees + minutes / 60;
  if (minutes >= 60 || angle_deg > limit_deg) return std::nullopt;
  if (hemisphere[0] == positive) return angle_deg;
  if (hemisphere[0] == negative) return -angle_deg;
  return std::nullopt;
}

}  // namespace

bool IsNmeaComment(std::string_view line) {
  const std::size_t first = line.find_first_not_of(" \t\r\n");
  return first == std::string_view::npos || line[first] == '#';
}

absl::StatusOr<NmeaSentence> ParseNmea(std::string_view line) {
  if (line.size() > kMaxLine) {
    return absl::InvalidArgumentError("line too long");
  }
  NmeaSentence sentence;
  if (line.starts_with('\\')) {
    const std::size_t end = line.find('\\', 1);
    if (end == std::string_view::npos) {
      return absl::InvalidArgumentError("not a sentence");
    }
    sentence.tag_time = TimeOfTagBlock(line.substr(1, end - 1));
    line.remove_prefix(end + 1);
  }
  if (!line.starts_with('$') && !line.starts_with('!')) {
    return absl::InvalidArgumentError("not a sentence");
  }
  line.remove_prefix(1);
  const std::size_t star = line.find('*');
  // What loggers add after the checksum is not the sentence's.
  if (star != std::string_view::npos) line = line.substr(0, star + 3);
  const absl::StatusOr<std::string_view> body = Checked(line);
  if (!body.ok()) return body.status();
  sentence.fields = Split(*body, ',');
  sentence.address = sentence.fields.front();
  sentence.fields.erase(sentence.fields.begin());
  if (sentence.address.size() < 3) {
    return absl::InvalidArgumentError("not a sentence");
  }
  return sentence;
}

std::optional<double> NmeaNumber(std::string_view field) {
  double value = 0;
  const auto [end, error] =
      std::from_chars(field.data(), field.data() + field.size(), value,
                      std::chars_format::fixed);
  if (error != std::errc() || end != field.data() + field.size() ||
      !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

std::optional<map::GeodeticPoint> NmeaPlace(std::string_view latitude,
                                            std::string_view north_south,
                                            std::string_view longitude,
                                            std::string_view east_west) {
  const std::optional<double> lat = Angle(latitude, 'N', 'S', north_south, 90);
  const std::optional<double> lon = Angle(longitude, 'E', 'W', east_west, 180);
  if (!lat.has_value() || !lon.has_value()) return std::nullopt;
  return map::GeodeticPoint{.latitude_deg = *lat, .longitude_deg = *lon};
}

std::optional<Duration> NmeaTimeOfDay(std::string_view field) {
  const std::optional<double> value = NmeaNumber(field);
  if (!value.has_value() || field.size() < 6 || *value < 0) return std::nullopt;
  const double hour = std::floor(*value / 10'000);
  const double minute = std::floor((*value - 10'000 * hour) / 100);
  const double second = *value - 10'000 * hour - 100 * minute;
  if (hour >= 24 || minute >= 60 || second >= 60) return std::nullopt;
  return Duration(std::llround(1e6 * (3600 * hour + 60 * minute + second)));
}

std::optional<Time> NmeaDate(std::string_view field) {
  const std::optional<std::int64_t> value = Whole(field);
  if (!value.has_value() || field.size() != 6) return std::nullopt;
  const int year = static_cast<int>(*value % 100);
  const std::chrono::year_month_day date(
      std::chrono::year(year + (year < 70 ? 2000 : 1900)),
      std::chrono::month(static_cast<unsigned>(*value / 100 % 100)),
      std::chrono::day(static_cast<unsigned>(*value / 10'000)));
  if (!date.ok()) return std::nullopt;
  return Time(std::chrono::sys_days(date));
}

}  // namespace fathom::feeder
