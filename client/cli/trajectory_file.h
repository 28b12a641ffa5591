// Trajectories from files: CSV, or GeoJSON (RFC 7946).
//
// Thread-safe.

#ifndef FATHOM_CLIENT_CLI_TRAJECTORY_FILE_H_
#define FATHOM_CLIENT_CLI_TRAJECTORY_FILE_H_

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cli/points_file.h"

namespace fathom::client::cli {

// What a file may leave out.
struct TrajectoryDefaults {
  // Of waypoints without a depth.
  std::optional<double> depth_m = std::nullopt;
  // When the vehicle is at the first waypoint, if that has no time.
  Time start = {};
  // Over ground: when it is at the others that have none.
  std::optional<double> speed_m_s = std::nullopt;
  // What "now" means in the file.
  Time now = {};
};

// The waypoints in `text`, each with its time. GeoJSON if it begins with '{':
// one LineString, alone, as a Feature's geometry or in the first Feature of a
// collection; a third coordinate is the height, so minus the depth; times are
// the Feature's property "times" (or "coordTimes"), one a waypoint. Else CSV as
// ReadPoints takes it. Errors: INVALID_ARGUMENT, marked as the file's fault.
absl::StatusOr<std::vector<QuestionPoint>> ParseTrajectory(
    const std::string& text, const TrajectoryDefaults& defaults);
// The same from a path, or from standard input for "-". Also NOT_FOUND.
absl::StatusOr<std::vector<QuestionPoint>> ReadTrajectory(
    const std::string& path, const TrajectoryDefaults& defaults);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_TRAJECTORY_FILE_H_
