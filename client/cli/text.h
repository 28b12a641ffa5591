// Values for people: places, depths, sizes, times, names of enumerators.
// Thread-safe.

#ifndef FATHOM_CLIENT_CLI_TEXT_H_
#define FATHOM_CLIENT_CLI_TEXT_H_

#include <google/protobuf/repeated_field.h>

#include <cstdint>
#include <string>

#include "fathom/v1/mission_service.pb.h"
#include "fathom/v1/obstacle_service.pb.h"
#include "fathom/v1/types.pb.h"

namespace fathom::client::cli {

// "41.60000 N, 71.40000 W" (5 decimals are 1 m).
std::string PlaceText(const v1::GeodeticPoint& point);
// "12 s", "3.4 min", "2.0 h", "5.1 d".
std::string SpanText(double seconds);
// "812 B", "1.4 KB", "3.0 MB", "2.1 GB" (powers of 1024).
std::string BytesText(std::uint64_t bytes);
// "1 234 567".
std::string CountText(std::uint64_t count);
// "2026-01-01T12:00:00Z", or "never".
std::string TimeText(const google::protobuf::Timestamp& time);

// The name without its prefix: "FREE", "measured", "vessel", "adaptive".
std::string StateText(v1::ObstacleState state);
std::string KindText(v1::EvidenceKind kind);
std::string ClassText(v1::ContactClass contact_class);
std::string StatusText(v1::ContactStatus status);
std::string EstimatorText(v1::Estimator estimator);
// "12 outside_area, 3 bad_std", or "none".
std::string RejectsText(
    const google::protobuf::RepeatedPtrField<v1::RejectCount>& rejects);

// The enumerators for people, for CLI11's choices: "unknown", "vessel", ...
// False if `text` is none.
bool ClassFromText(const std::string& text, v1::ContactClass* contact_class);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_TEXT_H_
