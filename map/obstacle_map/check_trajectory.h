// "Can I go there?": a timed path against all layers of the map.
//
// A leg is cut into pieces of at most kPieceM. Each piece sweeps a stadium (all
// places within w of it); every cell that it touches is judged:
//   - each cell of an open activity, by what SeabedAt says of its middle;
//   - each leaf of the global map that reaches beyond the activities, or is
//     finer than their cells.
// Tests hold it to brute force, and to a walk of all leaves what is left out:
// tiles of the global map (64 x 64 cells, and all below them) whose shoalest
// depth, greatest std and earliest time show that they cannot change the leg's
// verdict: wide paths over water that deepens. What counts is the deepest
// the vehicle may be while its disc touches the cell. A leaf that an activity
// covers in part counts as a whole where the piece itself leaves the activity.
//
// Cost: about 0.3 us a cell. Pure functions; thread-safe.

#ifndef FATHOM_MAP_OBSTACLE_MAP_CHECK_TRAJECTORY_H_
#define FATHOM_MAP_OBSTACLE_MAP_CHECK_TRAJECTORY_H_

#include <atomic>
#include <cstdint>

#include "absl/status/statusor.h"
#include "map/obstacle_map/obstacle_map_view.h"
#include "map/query/trajectory.h"

namespace fathom::map {

struct TrajectoryCheck {
  // End with the leg of the first conflict.
  bool stop_at_first = false;
  // Cells that may be read. Those of tiles left out do not count; where a
  // contact comes near they are read and do.
  std::uint64_t most_cells = 4'000'000;
  // Leave out parts of the global map that cannot change the verdict; false:
  // read every leaf, to prove it and to measure it.
  bool skip_deep = true;
  // Ends the work soon after it becomes true; null: never.
  const std::atomic<bool>* stop = nullptr;
};

// The verdict. Errors: those of ValidateTrajectory; RESOURCE_EXHAUSTED past
// most_cells; CANCELLED (stop).
absl::StatusOr<TrajectoryVerdict> CheckTrajectory(
    const ObstacleMapView& view, const Trajectory& trajectory,
    const TrajectoryCheck& check = {});

}  // namespace fathom::map

#endif  // FATHOM_MAP_OBSTACLE_MAP_CHECK_TRAJECTORY_H_
