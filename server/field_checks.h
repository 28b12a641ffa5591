// Checks of single fields, shared by all converters. Each returns OK or
// InvalidField with the field's path; NaN and infinity are refused by all.
//
// Pure functions; an accepted value costs a few comparisons and no
// allocation.

#ifndef FATHOM_SERVER_FIELD_CHECKS_H_
#define FATHOM_SERVER_FIELD_CHECKS_H_

#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"
#include "fathom/v1/types.pb.h"
#include "google/protobuf/timestamp.pb.h"
#include "map/geodesy/points.h"
#include "server/field_path.h"

namespace fathom::server {

// Whether a bound belongs to the range.
enum class Bound { kClosed, kOpen };

// A range of numbers and the unit that its error states.
struct NumberRange {
  double min = 0;
  double max = 0;
  const char* unit = "";
  Bound lower = Bound::kClosed;
  Bound upper = Bound::kClosed;
  v1::RejectReason reason = v1::REJECT_REASON_INVALID_MESSAGE;
};

// `value` is finite (else NOT_FINITE) and in `range` (else range.reason).
absl::Status CheckNumber(double value, const NumberRange& range,
                         const FieldPath& path);

// 1-64 characters of [A-Za-z0-9._-], with ':' too if `allow_colon`.
absl::Status CheckId(std::string_view id, const FieldPath& path,
                     bool allow_colon = false);

// 1-200 characters of printable UTF-8 (protobuf has checked the encoding).
absl::Status CheckName(std::string_view name, const FieldPath& path);

// A number of at least 1.
absl::Status CheckPositive(uint64_t value, const FieldPath& path);

// `path` must be there.
absl::Status Missing(const FieldPath& path, std::string_view what);

// A place: latitude in [-90, 90], longitude in [-180, 180].
absl::StatusOr<map::GeodeticPoint> CheckPoint(const v1::GeodeticPoint& point,
                                              const FieldPath& path);

// A depth in [-100, 12000] m.
absl::Status CheckDepth(double depth_m, const FieldPath& path);

// A time in [1970-01-01T00:00:00Z, 2106-01-01T00:00:00Z) (the map stores
// 32-bit seconds) with nanos in [0, 999999999]; cut to microseconds.
absl::StatusOr<Time> CheckTime(const google::protobuf::Timestamp& time,
                               const FieldPath& path);

// What is to be taken off a message's depths to refer them to the mission's
// datum: depth below datum = depth below surface - water level above datum.
// 0 for the datum itself. `reference` is null where the field is absent.
absl::StatusOr<double> CheckVerticalReference(
    const v1::VerticalReference* reference, const FieldPath& path);

}  // namespace fathom::server

#endif  // FATHOM_SERVER_FIELD_CHECKS_H_
