#include "sim_feeder/replay/recording.h"

#include <cpl_vsi.h>

#include <cmath>
#include <filesystem>

#include "absl/strings/str_format.h"

namespace fathom::feeder {
namespace {

// The first bytes, unpacked.
std::string HeadOf(const std::string& path) {
  std::string head(4096, '\0');
  VSILFILE* file = VSIFOpenL(path.c_str(), "rb");
  if (file == nullptr) return {};
  head.resize(VSIFReadL(head.data(), 1, head.size(), file));
  VSIFCloseL(file);
  return head;
}

bool HoldsSentences(const std::string& head) {
  for (std::size_t begin = 0; begin < head.size();) {
    const std::size_t end = std::min(head.find('\n', begin), head.size());
    const char first = head[begin];
    if (first == '$' || first == '!' || first == '\\') return true;
    begin = end + 1;
  }
  return false;
}

}  // namespace

double Order1bStdM(double depth_m) {
  return std::hypot(0.5, 0.013 * depth_m) / 1.96;
}

bool IsDepth(double depth_m) { return depth_m >= -100 && depth_m <= 12'000; }

absl::StatusOr<std::unique_ptr<Recording>> OpenRecording(
    const std::string& path, const RecordingOptions& options) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return absl::NotFoundError(absl::StrFormat("no file %s", path));
  }
  const std::string readable =
      path.ends_with(".gz") ? "/vsigzip/" + path : path;
  std::string format = options.format;
  if (format.empty()) {
    const std::string head = HeadOf(readable);
    if (head.find("\"sensorID\"") != std::string::npos) {
      format = "autoferry";
    } else {
      format = HoldsSentences(head) ? "nmea" : "table";
    }
  }
  if (format == "nmea") return OpenNmeaLog(readable, options);
  if (format == "table") return OpenPointTable(readable, options);
  if (format == "autoferry") return OpenAutoferry(path, options);
  return absl::InvalidArgumentError(absl::StrFormat(
      "format %s is not one of nmea, table, autoferry", format));
}

}  // namespace fathom::feeder
