#include "server/convert_trajectory.h"

#include <cstddef>
#include <optional>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "server/convert_common.h"
#include "server/convert_query.h"
#include "server/errors.h"
#include "server/field_checks.h"
#include "server/limits.h"

namespace fathom::server {
namespace {

constexpr NumberRange kConfidenceRange = {.min = 0.5,
                                          .max = 1,
                                          .unit = "",
                                          .lower = Bound::kOpen,
                                          .upper = Bound::kOpen};
constexpr NumberRange kClearanceRange = {
    .min = 0, .max = kMaxClearanceM, .unit = "m"};

absl::StatusOr<bool> UnknownIsFree(v1::UnknownTreatment treatment,
                                   const FieldPath& path) {
  switch (treatment) {
    case v1::UNKNOWN_TREATMENT_UNSPECIFIED:
    case v1::UNKNOWN_TREATMENT_OCCUPIED:
      return false;
    case v1::UNKNOWN_TREATMENT_FREE:
      return true;
    default:
      return InvalidField(
          path.ToString(),
          absl::StrFormat("%d is no UnknownTreatment", treatment));
  }
}

template <typename Message>
absl::StatusOr<double> WaterLevelM(const Message& message,
                                   const FieldPath& path) {
  return CheckVerticalReference(message.has_vertical_reference()
                                    ? &message.vertical_reference()
                                    : nullptr,
                                FieldPath(path, "vertical_reference"));
}

absl::StatusOr<map::Waypoint> ConvertWaypoint(const v1::Waypoint& waypoint,
                                              double water_level_m,
                                              const FieldPath& path) {
  map::Waypoint out;
  if (!waypoint.has_position()) {
    return Missing(FieldPath(path, "position"), "where the vehicle will be");
  }
  FATHOM_ASSIGN_OR_RETURN(
      out.position,
      CheckPoint(waypoint.position(), FieldPath(path, "position")));
  out.depth_m = waypoint.depth_m() - water_level_m;
  FATHOM_RETURN_IF_ERROR(CheckDepth(out.depth_m, FieldPath(path, "depth_m")));
  if (!waypoint.has_time()) {
    return Missing(FieldPath(path, "time"), "when the vehicle will be there");
  }
  FATHOM_ASSIGN_OR_RETURN(out.time,
                          CheckTime(waypoint.time(), FieldPath(path, "time")));
  return out;
}

// The waypoint at `path` after the one before it.
absl::Status CheckLeg(const map::Waypoint& before, const map::Waypoint& here,
                      const FieldPath& path) {
  if (here.time <= before.time) {
    return InvalidField(FieldPath(path, "time").ToString(),
                        "is not later than that of the waypoint before");
  }
  const std::optional<double> length_m =
      map::TooLongLegM(before.position, here.position);
  if (!length_m.has_value()) return absl::OkStatus();
  return InvalidField(
      FieldPath(path, "position").ToString(),
      absl::StrFormat("is %.0f m from the waypoint before; a leg may have "
                      "%.0f m: add waypoints between",
                      *length_m, map::kMaxLegM));
}

}  // namespace

absl::StatusOr<map::Trajectory> ConvertTrajectory(
    const v1::Trajectory& trajectory, const FieldPath& path) {
  map::Trajectory out;
  const FieldPath waypoints_path(path, "waypoints");
  const auto count = static_cast<size_t>(trajectory.waypoints_size());
  if (count < 2) {
    return InvalidField(
        waypoints_path.ToString(),
        absl::StrFormat("has %d; a trajectory needs at least 2", count));
  }
  if (count > kMaxWaypoints) {
    return LimitExceeded(waypoints_path.ToString(), count, kMaxWaypoints);
  }
  FATHOM_ASSIGN_OR_RETURN(const double water_level_m,
                          WaterLevelM(trajectory, path));
  FATHOM_RETURN_IF_ERROR(CheckNumber(
      trajectory.radius_m(), {.min = 0, .max = kMaxVehicleRadiusM, .unit = "m"},
      FieldPath(path, "radius_m")));
  FATHOM_RETURN_IF_ERROR(CheckNumber(trajectory.vertical_clearance_m(),
                                     kClearanceRange,
                                     FieldPath(path, "vertical_clearance_m")));
  FATHOM_RETURN_IF_ERROR(
      CheckNumber(trajectory.position_std_m(),
                  {.min = 0, .max = kMaxVehicleStdM, .unit = "m"},
                  FieldPath(path, "position_std_m")));
  FATHOM_RETURN_IF_ERROR(CheckNumber(trajectory.confidence(), kConfidenceRange,
                                     FieldPath(path, "confidence")));
  FATHOM_ASSIGN_OR_RETURN(out.unknown_is_free,
                          UnknownIsFree(trajectory.treat_unknown_as(),
                                        FieldPath(path, "treat_unknown_as")));
  out.radius_m = trajectory.radius_m();
  out.vertical_clearance_m = trajectory.vertical_clearance_m();
  out.position_std_m = trajectory.position_std_m();
  out.confidence = trajectory.confidence();
  out.waypoints.reserve(count);
  for (size_t i = 0; i < count; ++i) {
    const FieldPath here(path, "waypoints", i);
    FATHOM_ASSIGN_OR_RETURN(
        const map::Waypoint waypoint,
        ConvertWaypoint(trajectory.waypoints(static_cast<int>(i)),
                        water_level_m, here));
    if (i > 0) {
      FATHOM_RETURN_IF_ERROR(CheckLeg(out.waypoints.back(), waypoint, here));
    }
    out.waypoints.push_back(waypoint);
  }
  return out;
}

void WriteVerdict(const map::TrajectoryVerdict& verdict,
                  v1::CheckTrajectoryResponse* out) {
  out->set_state(static_cast<v1::ObstacleState>(verdict.state));
  if (verdict.first_conflict.has_value()) {
    const map::Conflict& conflict = *verdict.first_conflict;
    v1::Conflict* first = out->mutable_first_conflict();
    first->set_leg_index(conflict.leg);
    WritePoint(conflict.position, first->mutable_position());
    first->set_depth_m(conflict.depth_m);
    WriteTime(conflict.time, first->mutable_time());
    WriteAnswer(conflict.answer, first->mutable_answer());
  }
  out->mutable_legs()->Reserve(static_cast<int>(verdict.legs.size()));
  for (const map::LegVerdict& leg : verdict.legs) {
    v1::LegVerdict* entry = out->add_legs();
    entry->set_state(static_cast<v1::ObstacleState>(leg.state));
    entry->set_worst_probability(leg.worst_probability);
    if (leg.least_clearance_m.has_value()) {
      entry->set_least_clearance_m(*leg.least_clearance_m);
    }
  }
  for (const map::ContactApproach& approach : verdict.approaches) {
    v1::ContactApproach* entry = out->add_approaches();
    entry->set_contact_id(approach.key.contact.value);
    entry->set_source_id(approach.key.source.value);
    WriteTime(approach.time, entry->mutable_time());
    entry->set_distance_m(approach.distance_m);
    entry->set_probability(approach.probability);
    if (approach.links != nullptr) {
      WriteNames(approach.links->names, entry->mutable_also_known_as());
    }
  }
}

absl::StatusOr<map::NearestQuestion> ConvertNearest(
    const v1::FindNearestObstacleRequest& request, Time now) {
  const FieldPath root;
  map::NearestQuestion question;
  map::ObstacleQuery& query = question.query;
  if (!request.has_position()) {
    return Missing(FieldPath(root, "position"), "the place to search from");
  }
  FATHOM_ASSIGN_OR_RETURN(
      query.position,
      CheckPoint(request.position(), FieldPath(root, "position")));
  FATHOM_ASSIGN_OR_RETURN(const double water_level_m,
                          WaterLevelM(request, root));
  query.depth_m = request.depth_m() - water_level_m;
  FATHOM_RETURN_IF_ERROR(CheckDepth(query.depth_m, FieldPath(root, "depth_m")));
  query.time = now;
  if (request.has_time()) {
    FATHOM_ASSIGN_OR_RETURN(query.time,
                            CheckTime(request.time(), FieldPath(root, "time")));
  }
  FATHOM_RETURN_IF_ERROR(CheckNumber(request.confidence(), kConfidenceRange,
                                     FieldPath(root, "confidence")));
  FATHOM_RETURN_IF_ERROR(CheckNumber(request.vertical_clearance_m(),
                                     kClearanceRange,
                                     FieldPath(root, "vertical_clearance_m")));
  FATHOM_RETURN_IF_ERROR(CheckNumber(request.search_radius_m(),
                                     {.min = 0,
                                      .max = map::kMaxSearchRadiusM,
                                      .unit = "m",
                                      .lower = Bound::kOpen},
                                     FieldPath(root, "search_radius_m")));
  FATHOM_ASSIGN_OR_RETURN(question.unknown_is_free,
                          UnknownIsFree(request.treat_unknown_as(),
                                        FieldPath(root, "treat_unknown_as")));
  query.confidence = request.confidence();
  query.vertical_clearance_m = request.vertical_clearance_m();
  question.search_radius_m = request.search_radius_m();
  return question;
}

void WriteNearest(const map::NearestObstacle& nearest,
                  v1::FindNearestObstacleResponse* out) {
  out->set_found(true);
  WritePoint(nearest.position, out->mutable_position());
  out->set_distance_m(nearest.distance_m);
  out->set_bearing_deg(nearest.bearing_deg);
  WriteAnswer(nearest.answer, out->mutable_answer());
  if (nearest.contact.has_value()) {
    out->set_source_id(nearest.contact->source.value);
    out->set_contact_id(nearest.contact->contact.value);
  }
}

}  // namespace fathom::server
