#include "map/query/trajectory.h"

#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"

namespace fathom::map {
namespace {

constexpr double kMaxRadiusM = 1000;

absl::Status CheckRange(std::string_view field, double value, double high) {
  if (value >= 0 && value <= high) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrFormat("%s=%g must be in [0, %g]", field, value, high));
}

absl::Status CheckWaypoint(const Trajectory& trajectory, std::size_t i) {
  const Waypoint& here = trajectory.waypoints[i];
  const std::string name = absl::StrFormat("waypoints[%u]", i);
  if (const absl::Status valid = ValidateGeodetic(here.position); !valid.ok()) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s.position: %s", name, std::string(valid.message())));
  }
  if (!(here.depth_m >= -100 && here.depth_m <= 12'000)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s.depth_m=%g must be in [-100, 12000]", name, here.depth_m));
  }
  if (i == 0) return absl::OkStatus();
  const Waypoint& before = trajectory.waypoints[i - 1];
  if (here.time <= before.time) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s.time must be after that of the waypoint before", name));
  }
  if (const std::optional<double> leg_m =
          TooLongLegM(before.position, here.position)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s.position is %.0f m from the waypoint before; a leg "
                        "may be %.0f m: put waypoints between",
                        name, *leg_m, kMaxLegM));
  }
  return absl::OkStatus();
}

}  // namespace

std::optional<double> TooLongLegM(const GeodeticPoint& a,
                                  const GeodeticPoint& b) {
  // At most 63 km, and nearly every leg: not worth a geodesic.
  constexpr double kNearDeg = 0.4;
  if (std::fabs(a.latitude_deg - b.latitude_deg) < kNearDeg &&
      std::fabs(a.longitude_deg - b.longitude_deg) < kNearDeg) {
    return std::nullopt;
  }
  const double leg_m = DistanceM(a, b);
  if (leg_m <= kMaxLegM) return std::nullopt;
  return leg_m;
}

double SweptHalfWidthM(const Trajectory& trajectory) {
  return trajectory.radius_m +
         trajectory.position_std_m *
             std::sqrt(-2.0 * std::log(1.0 - trajectory.confidence));
}

absl::Status ValidateTrajectory(const Trajectory& trajectory) {
  if (trajectory.waypoints.size() < 2) {
    return absl::InvalidArgumentError(
        absl::StrFormat("waypoints has %u; a path has at least 2",
                        trajectory.waypoints.size()));
  }
  if (!(trajectory.confidence > 0.5 && trajectory.confidence < 1.0)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "confidence=%g must be in (0.5, 1)", trajectory.confidence));
  }
  FATHOM_RETURN_IF_ERROR(
      CheckRange("radius_m", trajectory.radius_m, kMaxRadiusM));
  FATHOM_RETURN_IF_ERROR(
      CheckRange("position_std_m", trajectory.position_std_m, kMaxRadiusM));
  FATHOM_RETURN_IF_ERROR(CheckRange("vertical_clearance_m",
                                    trajectory.vertical_clearance_m, 12'000));
  for (std::size_t i = 0; i < trajectory.waypoints.size(); ++i) {
    FATHOM_RETURN_IF_ERROR(CheckWaypoint(trajectory, i));
  }
  return absl::OkStatus();
}

}  // namespace fathom::map
