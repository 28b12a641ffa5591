#include "server/convert_ingest.h"

#include <algorithm>
#include <numbers>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "server/errors.h"
#include "server/field_checks.h"
#include "server/limits.h"

namespace fathom::server {
namespace {

constexpr v1::RejectReason kBadStd = v1::REJECT_REASON_BAD_STD;
constexpr float kRadPerDeg = std::numbers::pi_v<float> / 180.0f;

template <typename Message>
const v1::VerticalReference* ReferenceOf(const Message& message) {
  return message.has_vertical_reference() ? &message.vertical_reference()
                                          : nullptr;
}

// `water_level_m` is what CheckVerticalReference returned.
absl::StatusOr<map::Pose> ConvertPose(const v1::VehiclePose& pose,
                                      double water_level_m,
                                      const FieldPath& path) {
  map::Pose result;
  if (!pose.has_position()) {
    return Missing(FieldPath(path, "position"), "the sonar's position");
  }
  FATHOM_ASSIGN_OR_RETURN(
      result.position,
      CheckPoint(pose.position(), FieldPath(path, "position")));
  FATHOM_RETURN_IF_ERROR(
      CheckDepth(pose.depth_m(), FieldPath(path, "depth_m")));
  result.depth_m = pose.depth_m() - water_level_m;
  FATHOM_RETURN_IF_ERROR(CheckNumber(pose.heading_deg(),
                                     {.min = -360, .max = 360, .unit = "deg"},
                                     FieldPath(path, "heading_deg")));
  result.heading_deg = pose.heading_deg();
  if (pose.has_roll_deg()) {
    FATHOM_RETURN_IF_ERROR(CheckNumber(pose.roll_deg(),
                                       {.min = -180, .max = 180, .unit = "deg"},
                                       FieldPath(path, "roll_deg")));
  }
  if (pose.has_pitch_deg()) {
    FATHOM_RETURN_IF_ERROR(CheckNumber(pose.pitch_deg(),
                                       {.min = -90, .max = 90, .unit = "deg"},
                                       FieldPath(path, "pitch_deg")));
  }
  if (pose.has_position_std_m()) {
    FATHOM_RETURN_IF_ERROR(CheckNumber(
        pose.position_std_m(),
        {.min = 0, .max = kMaxPositionStdM, .unit = "m", .reason = kBadStd},
        FieldPath(path, "position_std_m")));
    result.position_std_m = pose.position_std_m();
  }
  return result;
}

absl::Status CheckLength(int count, int expected, const FieldPath& path) {
  if (count == expected) return absl::OkStatus();
  return InvalidField(
      path.ToString(),
      absl::StrFormat("has %d values where range_m has %d", count, expected));
}

absl::StatusOr<map::RangeBearing> ConvertRangeBearing(
    const v1::RangeBearing& observation, double water_level_m,
    const FieldPath& path) {
  map::RangeBearing result;
  if (!observation.has_pose()) {
    return Missing(FieldPath(path, "pose"), "the sensor's pose");
  }
  FATHOM_ASSIGN_OR_RETURN(
      result.pose,
      ConvertPose(observation.pose(), water_level_m, FieldPath(path, "pose")));
  FATHOM_RETURN_IF_ERROR(
      CheckNumber(observation.range_m(),
                  {.min = 0,
                   .max = map::kMaxContactRangeM,
                   .unit = "m",
                   .lower = Bound::kOpen,
                   .reason = v1::REJECT_REASON_ABOVE_MAX_RANGE},
                  FieldPath(path, "range_m")));
  FATHOM_RETURN_IF_ERROR(CheckNumber(observation.bearing_deg(),
                                     {.min = -360, .max = 360, .unit = "deg"},
                                     FieldPath(path, "bearing_deg")));
  FATHOM_RETURN_IF_ERROR(CheckNumber(observation.range_std_m(),
                                     {.min = 0,
                                      .max = map::kMaxContactStdM,
                                      .unit = "m",
                                      .lower = Bound::kOpen,
                                      .reason = kBadStd},
                                     FieldPath(path, "range_std_m")));
  FATHOM_RETURN_IF_ERROR(CheckNumber(observation.bearing_std_deg(),
                                     {.min = 0,
                                      .max = map::kMaxBearingStdDeg,
                                      .unit = "deg",
                                      .lower = Bound::kOpen,
                                      .reason = kBadStd},
                                     FieldPath(path, "bearing_std_deg")));
  result.range_m = observation.range_m();
  result.bearing_deg = observation.bearing_deg();
  result.range_std_m = observation.range_std_m();
  result.bearing_std_deg = observation.bearing_std_deg();
  return result;
}

absl::StatusOr<map::ContactFix> ConvertFix(const v1::ContactFix& fix,
                                           const FieldPath& path) {
  map::ContactFix result;
  if (!fix.has_position()) {
    return Missing(FieldPath(path, "position"), "the contact's position");
  }
  FATHOM_ASSIGN_OR_RETURN(
      result.position, CheckPoint(fix.position(), FieldPath(path, "position")));
  constexpr NumberRange kVelocity = {.min = -map::kMaxContactSpeedMPerS,
                                     .max = map::kMaxContactSpeedMPerS,
                                     .unit = "m/s"};
  FATHOM_RETURN_IF_ERROR(CheckNumber(fix.velocity_north_m_s(), kVelocity,
                                     FieldPath(path, "velocity_north_m_s")));
  FATHOM_RETURN_IF_ERROR(CheckNumber(fix.velocity_east_m_s(), kVelocity,
                                     FieldPath(path, "velocity_east_m_s")));
  result.velocity_north_m_s = fix.velocity_north_m_s();
  result.velocity_east_m_s = fix.velocity_east_m_s();
  if (fix.has_position_std_m()) {
    FATHOM_RETURN_IF_ERROR(CheckNumber(
        fix.position_std_m(),
        {.min = 0, .max = map::kMaxContactStdM, .unit = "m", .reason = kBadStd},
        FieldPath(path, "position_std_m")));
    result.position_std_m = fix.position_std_m();
  }
  if (fix.has_velocity_std_m_s()) {
    FATHOM_RETURN_IF_ERROR(CheckNumber(fix.velocity_std_m_s(),
                                       {.min = 0,
                                        .max = map::kMaxContactVelocityStdMPerS,
                                        .unit = "m/s",
                                        .reason = kBadStd},
                                       FieldPath(path, "velocity_std_m_s")));
    result.velocity_std_m_s = fix.velocity_std_m_s();
  }
  return result;
}

// The other names of the report's contact.
absl::StatusOr<std::vector<map::ContactKey>> ConvertNames(
    const v1::ContactReport& report, const FieldPath& path) {
  if (report.has_range_bearing() || report.inactive()) {
    return InvalidField(path.ToString(),
                        "beside a range_bearing or inactive: names are linked "
                        "by a fix or by a report that observes nothing");
  }
  const auto count = static_cast<size_t>(report.same_as().names_size());
  if (count > map::kMaxLinkedNames) {
    return LimitExceeded((path.ToString() + ".names").c_str(), count,
                         map::kMaxLinkedNames);
  }
  std::vector<map::ContactKey> names;
  for (size_t i = 0; i < count; ++i) {
    const v1::ContactName& name = report.same_as().names(static_cast<int>(i));
    const FieldPath here(path, "names", i);
    FATHOM_RETURN_IF_ERROR(
        CheckId(name.source_id(), FieldPath(here, "source_id")));
    FATHOM_RETURN_IF_ERROR(CheckId(name.contact_id(),
                                   FieldPath(here, "contact_id"),
                                   /*allow_colon=*/true));
    map::ContactKey key = {.source = {name.source_id()},
                           .contact = {name.contact_id()}};
    if (key == map::ContactKey{.source = {report.source_id()},
                               .contact = {report.contact_id()}} ||
        std::find(names.begin(), names.end(), key) != names.end()) {
      return InvalidField(here.ToString(),
                          "is the report's own name or named twice",
                          v1::REJECT_REASON_BAD_LINK);
    }
    names.push_back(std::move(key));
  }
  return names;
}

// The refusal that a failed conversion means.
Refusal ToRefusal(const absl::Status& status) {
  const std::optional<FieldViolation> violation = ViolationOf(status);
  if (!violation.has_value()) {
    return {map::RejectReason::kInvalidMessage, "",
            std::string(status.message())};
  }
  return {static_cast<map::RejectReason>(violation->reason), violation->path,
          violation->description};
}

}  // namespace

template <typename Message>
absl::Status CheckNumbering(const Message& message, const FieldPath& path) {
  FATHOM_RETURN_IF_ERROR(
      CheckId(message.source_id(), FieldPath(path, "source_id")));
  FATHOM_RETURN_IF_ERROR(
      CheckPositive(message.epoch(), FieldPath(path, "epoch")));
  return CheckPositive(message.sequence(), FieldPath(path, "sequence"));
}

template absl::Status CheckNumbering(const v1::Ping&, const FieldPath&);
template absl::Status CheckNumbering(const v1::ContactReport&,
                                     const FieldPath&);

absl::StatusOr<map::Ping> ConvertPing(const v1::Ping& ping,
                                      const FieldPath& path) {
  map::Ping result;
  FATHOM_RETURN_IF_ERROR(
      CheckId(ping.activity_id(), FieldPath(path, "activity_id")));
  result.activity.value = ping.activity_id();
  if (!ping.has_time()) {
    return Missing(FieldPath(path, "time"), "when the ping was heard");
  }
  FATHOM_ASSIGN_OR_RETURN(result.time,
                          CheckTime(ping.time(), FieldPath(path, "time")));
  FATHOM_ASSIGN_OR_RETURN(
      const double water_level_m,
      CheckVerticalReference(ReferenceOf(ping),
                             FieldPath(path, "vertical_reference")));
  if (!ping.has_pose()) {
    return Missing(FieldPath(path, "pose"), "the sonar's pose");
  }
  FATHOM_ASSIGN_OR_RETURN(result.pose, ConvertPose(ping.pose(), water_level_m,
                                                   FieldPath(path, "pose")));

  const int count = ping.range_m_size();
  if (count == 0) {
    return Missing(FieldPath(path, "range_m"), "at least one measurement");
  }
  if (static_cast<size_t>(count) > kMaxBeamsPerPing) {
    return InvalidField(
        FieldPath(path, "range_m").ToString(),
        absl::StrFormat("has %d values, limits.max_beams_per_ping is %d", count,
                        kMaxBeamsPerPing));
  }
  FATHOM_RETURN_IF_ERROR(CheckLength(ping.bearing_deg_size(), count,
                                     FieldPath(path, "bearing_deg")));
  FATHOM_RETURN_IF_ERROR(
      CheckLength(ping.depth_m_size(), count, FieldPath(path, "depth_m")));
  FATHOM_RETURN_IF_ERROR(
      CheckLength(ping.std_m_size(), count, FieldPath(path, "std_m")));
  result.beams.resize(static_cast<size_t>(count));
  const float* const range_m = ping.range_m().data();
  const float* const bearing_deg = ping.bearing_deg().data();
  const float* const depth_m = ping.depth_m().data();
  const float* const std_m = ping.std_m().data();
  const float level_m = static_cast<float>(water_level_m);
  for (int i = 0; i < count; ++i) {
    result.beams[static_cast<size_t>(i)] = {
        .range_m = range_m[i],
        .bearing_rad = bearing_deg[i] * kRadPerDeg,
        .depth_m = depth_m[i] - level_m,
        .std_m = std_m[i]};
  }
  return result;
}

absl::StatusOr<map::ContactReport> ConvertReport(
    const v1::ContactReport& report, const FieldPath& path) {
  map::ContactReport result;
  result.key.source.value = report.source_id();
  FATHOM_RETURN_IF_ERROR(CheckId(report.contact_id(),
                                 FieldPath(path, "contact_id"),
                                 /*allow_colon=*/true));
  result.key.contact.value = report.contact_id();
  if (report.contact_class() == v1::CONTACT_CLASS_UNSPECIFIED ||
      !v1::ContactClass_IsValid(report.contact_class())) {
    return InvalidField(
        FieldPath(path, "contact_class").ToString(),
        absl::StrFormat("%d is not a class; give CONTACT_CLASS_UNKNOWN if "
                        "nothing better is known",
                        report.contact_class()));
  }
  result.contact_class = static_cast<map::ContactClass>(report.contact_class());
  if (!report.has_time()) {
    return Missing(FieldPath(path, "time"), "when the contact was observed");
  }
  FATHOM_ASSIGN_OR_RETURN(result.time,
                          CheckTime(report.time(), FieldPath(path, "time")));
  FATHOM_ASSIGN_OR_RETURN(
      const double water_level_m,
      CheckVerticalReference(ReferenceOf(report),
                             FieldPath(path, "vertical_reference")));
  result.inactive = report.inactive();
  switch (report.observation_case()) {
    case v1::ContactReport::kRangeBearing: {
      FATHOM_ASSIGN_OR_RETURN(
          result.observation,
          ConvertRangeBearing(report.range_bearing(), water_level_m,
                              FieldPath(path, "range_bearing")));
      break;
    }
    case v1::ContactReport::kFix: {
      FATHOM_ASSIGN_OR_RETURN(result.observation,
                              ConvertFix(report.fix(), FieldPath(path, "fix")));
      break;
    }
    case v1::ContactReport::OBSERVATION_NOT_SET:
      if (report.has_same_as()) {
        result.observation = map::NothingObserved{};
      } else if (!report.inactive()) {
        return Missing(FieldPath(path, "observation"),
                       "range_bearing, fix or same_as, or set inactive");
      }
      break;
  }
  if (report.has_same_as()) {
    FATHOM_ASSIGN_OR_RETURN(result.same_as,
                            ConvertNames(report, FieldPath(path, "same_as")));
  }
  if (report.has_depth_m()) {
    FATHOM_RETURN_IF_ERROR(
        CheckDepth(report.depth_m(), FieldPath(path, "depth_m")));
    result.depth_m = report.depth_m() - water_level_m;
  }
  if (report.has_depth_std_m()) {
    FATHOM_RETURN_IF_ERROR(CheckNumber(report.depth_std_m(),
                                       {.min = 0,
                                        .max = kMaxDepthStdM,
                                        .unit = "m",
                                        .lower = Bound::kOpen,
                                        .reason = kBadStd},
                                       FieldPath(path, "depth_std_m")));
    result.depth_std_m = report.depth_std_m();
  }
  return result;
}

IngestMessage ToIngest(const v1::Ping& ping, const FieldPath& path) {
  IngestMessage message{
      .kind = StreamKind::kPings,
      .source = {ping.source_id()},
      .number = {.epoch = ping.epoch(), .sequence = ping.sequence()},
      .content = Refusal{}};
  absl::StatusOr<map::Ping> converted = ConvertPing(ping, path);
  if (converted.ok()) {
    message.content = *std::move(converted);
  } else {
    message.content = ToRefusal(converted.status());
  }
  return message;
}

IngestMessage ToIngest(const v1::ContactReport& report, const FieldPath& path) {
  IngestMessage message{
      .kind = StreamKind::kContacts,
      .source = {report.source_id()},
      .number = {.epoch = report.epoch(), .sequence = report.sequence()},
      .content = Refusal{}};
  absl::StatusOr<map::ContactReport> converted = ConvertReport(report, path);
  if (converted.ok()) {
    message.content = *std::move(converted);
  } else {
    message.content = ToRefusal(converted.status());
  }
  return message;
}

IngestMessage NotFromTheFuture(IngestMessage message, Time now,
                               const FieldPath& path) {
  const auto* const report = std::get_if<map::ContactReport>(&message.content);
  if (report != nullptr && report->time - now > kMostAhead) {
    message.content = Refusal{
        map::RejectReason::kInvalidMessage, FieldPath(path, "time").ToString(),
        absl::StrFormat("%.0f h ahead of the server's clock, at most "
                        "%d; the unit is seconds since 1970 UTC",
                        ToSeconds(report->time - now) / 3600,
                        kMostAhead.count())};
  }
  return message;
}

absl::StatusOr<std::vector<IngestMessage>> ConvertReports(
    const v1::ReportContactsRequest& request, Time now) {
  const FieldPath root;
  if (request.reports().empty()) {
    return Missing(FieldPath(root, "reports"), "at least one report");
  }
  const auto count = static_cast<size_t>(request.reports_size());
  if (count > kMaxReportsPerRequest) {
    return LimitExceeded("reports", count, kMaxReportsPerRequest);
  }
  std::vector<IngestMessage> messages;
  messages.reserve(count);
  for (size_t i = 0; i < count; ++i) {
    const v1::ContactReport& report = request.reports(static_cast<int>(i));
    const FieldPath path(root, "reports", i);
    FATHOM_RETURN_IF_ERROR(CheckNumbering(report, path));
    IngestMessage message = NotFromTheFuture(ToIngest(report, path), now, path);
    if (const auto* refusal = std::get_if<Refusal>(&message.content)) {
      return InvalidField(refusal->field, refusal->description,
                          static_cast<v1::RejectReason>(refusal->reason));
    }
    messages.push_back(std::move(message));
  }
  return messages;
}

void WriteRejection(uint64_t sequence, const Refusal& refusal,
                    v1::Rejection* out) {
  out->set_sequence(sequence);
  out->set_reason(static_cast<v1::RejectReason>(refusal.reason));
  out->set_field(refusal.field);
  out->set_description(refusal.description);
}

}  // namespace fathom::server
