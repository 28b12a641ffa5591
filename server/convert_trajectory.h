// Trajectories and searches from the wire, and their verdicts to it.
//
// Pure functions; thread-safe.

#ifndef FATHOM_SERVER_CONVERT_TRAJECTORY_H_
#define FATHOM_SERVER_CONVERT_TRAJECTORY_H_

#include "absl/status/statusor.h"
#include "base/time.h"
#include "fathom/v1/obstacle_service.pb.h"
#include "map/obstacle_map/find_nearest.h"
#include "map/query/trajectory.h"
#include "server/field_path.h"

namespace fathom::server {

// A trajectory, its depths below the mission's datum. Errors: INVALID_ARGUMENT
// (field path below `path`, with the index of the waypoint);
// RESOURCE_EXHAUSTED past kMaxWaypoints.
absl::StatusOr<map::Trajectory> ConvertTrajectory(
    const v1::Trajectory& trajectory, const FieldPath& path);

// A verdict, without its stamp.
void WriteVerdict(const map::TrajectoryVerdict& verdict,
                  v1::CheckTrajectoryResponse* out);

// A search; `now` where time is absent. Errors: INVALID_ARGUMENT (field path).
absl::StatusOr<map::NearestQuestion> ConvertNearest(
    const v1::FindNearestObstacleRequest& request, Time now);

// What was found, without its stamp.
void WriteNearest(const map::NearestObstacle& nearest,
                  v1::FindNearestObstacleResponse* out);

}  // namespace fathom::server

#endif  // FATHOM_SERVER_CONVERT_TRAJECTORY_H_
