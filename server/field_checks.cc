#include "server/field_checks.h"

#include <cmath>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "server/errors.h"
#include "server/limits.h"

namespace fathom::server {
namespace {

// 2106-01-01T00:00:00Z: `date -ud 2106-01-01 +%s`; the last whole year of
// unsigned 32-bit seconds.
constexpr int64_t kEndOfTimeS = 4'291'747'200;

bool IsIdCharacter(char c, bool allow_colon) {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
         (c >= '0' && c <= '9') || c == '.' || c == '_' || c == '-' ||
         (allow_colon && c == ':');
}

// Out of line: the text of an error is not the hot path.
absl::Status OutOfRange(double value, const NumberRange& range,
                        const FieldPath& path) {
  return InvalidField(
      path.ToString(),
      absl::StrFormat("%g %s is not in %c%g, %g%c", value, range.unit,
                      range.lower == Bound::kClosed ? '[' : '(', range.min,
                      range.max, range.upper == Bound::kClosed ? ']' : ')'),
      range.reason);
}

}  // namespace

absl::Status CheckNumber(double value, const NumberRange& range,
                         const FieldPath& path) {
  const bool above =
      range.lower == Bound::kClosed ? value >= range.min : value > range.min;
  const bool below =
      range.upper == Bound::kClosed ? value <= range.max : value < range.max;
  if (above && below) return absl::OkStatus();
  if (!std::isfinite(value)) {
    return InvalidField(path.ToString(),
                        absl::StrFormat("%g is not a finite number", value),
                        v1::REJECT_REASON_NOT_FINITE);
  }
  return OutOfRange(value, range, path);
}

absl::Status CheckId(std::string_view id, const FieldPath& path,
                     bool allow_colon) {
  if (id.empty()) return Missing(path, "an id");
  if (id.size() > kMaxIdLength) {
    return InvalidField(path.ToString(),
                        absl::StrFormat("is %d characters long, at most %d "
                                        "are allowed",
                                        id.size(), kMaxIdLength));
  }
  for (size_t i = 0; i < id.size(); ++i) {
    if (!IsIdCharacter(id[i], allow_colon)) {
      return InvalidField(
          path.ToString(),
          absl::StrFormat("character %d is not one of [A-Za-z0-9._%s-]", i + 1,
                          allow_colon ? ":" : ""));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckName(std::string_view name, const FieldPath& path) {
  if (name.empty()) return Missing(path, "a name");
  if (name.size() > kMaxNameLength) {
    return InvalidField(
        path.ToString(),
        absl::StrFormat("is %d bytes long, at most %d are allowed", name.size(),
                        kMaxNameLength));
  }
  for (const char c : name) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      return InvalidField(path.ToString(), "holds a control character");
    }
  }
  return absl::OkStatus();
}

absl::Status CheckPositive(uint64_t value, const FieldPath& path) {
  if (value >= 1) return absl::OkStatus();
  return InvalidField(path.ToString(), "is 0 or absent; must be at least 1");
}

absl::Status Missing(const FieldPath& path, std::string_view what) {
  return InvalidField(path.ToString(),
                      absl::StrFormat("is absent; give %s", what));
}

absl::StatusOr<map::GeodeticPoint> CheckPoint(const v1::GeodeticPoint& point,
                                              const FieldPath& path) {
  FATHOM_RETURN_IF_ERROR(CheckNumber(point.latitude_deg(),
                                     {.min = -90, .max = 90, .unit = "deg"},
                                     FieldPath(path, "latitude_deg")));
  FATHOM_RETURN_IF_ERROR(CheckNumber(point.longitude_deg(),
                                     {.min = -180, .max = 180, .unit = "deg"},
                                     FieldPath(path, "longitude_deg")));
  return map::GeodeticPoint{.latitude_deg = point.latitude_deg(),
                            .longitude_deg = point.longitude_deg()};
}

absl::Status CheckDepth(double depth_m, const FieldPath& path) {
  return CheckNumber(depth_m,
                     {.min = kMinDepthM,
                      .max = kMaxDepthM,
                      .unit = "m",
                      .reason = v1::REJECT_REASON_BAD_DEPTH},
                     path);
}

absl::StatusOr<Time> CheckTime(const google::protobuf::Timestamp& time,
                               const FieldPath& path) {
  if (time.seconds() < 0 || time.seconds() >= kEndOfTimeS) {
    return InvalidField(path.ToString(),
                        absl::StrFormat("%d s since 1970 is not in "
                                        "[1970-01-01, 2106-01-01)",
                                        time.seconds()));
  }
  if (time.nanos() < 0 || time.nanos() > 999'999'999) {
    return InvalidField(
        path.ToString(),
        absl::StrFormat("nanos=%d is not in [0, 999999999]", time.nanos()));
  }
  return TimeFromUnixMicros(time.seconds() * 1'000'000 + time.nanos() / 1000);
}

absl::StatusOr<double> CheckVerticalReference(
    const v1::VerticalReference* reference, const FieldPath& path) {
  if (reference == nullptr) return 0.0;
  switch (reference->reference()) {
    case v1::DEPTH_REFERENCE_UNSPECIFIED:
    case v1::DEPTH_REFERENCE_MISSION_DATUM:
      return 0.0;
    case v1::DEPTH_REFERENCE_WATER_SURFACE: {
      const FieldPath level(path, "water_level_m");
      if (!reference->has_water_level_m()) {
        return Missing(level,
                       "the height of the water surface above the mission's "
                       "datum");
      }
      FATHOM_RETURN_IF_ERROR(CheckNumber(
          reference->water_level_m(),
          {.min = -kMaxWaterLevelM, .max = kMaxWaterLevelM, .unit = "m"},
          level));
      return reference->water_level_m();
    }
    default:
      return InvalidField(FieldPath(path, "reference").ToString(),
                          absl::StrFormat("%d is not a known DepthReference",
                                          reference->reference()));
  }
}

}  // namespace fathom::server
