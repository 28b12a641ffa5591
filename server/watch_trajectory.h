// What one WatchTrajectory call is told: the verdict on its path, when it
// changes.
//
// The path is judged anew when the seabed changed in a box about one of its
// legs, or any contact changed. The alert is raised by a conflict and cleared
// with hysteresis.
//
// No gRPC. Not thread-safe; each call has its own.

#ifndef FATHOM_SERVER_WATCH_TRAJECTORY_H_
#define FATHOM_SERVER_WATCH_TRAJECTORY_H_

#include <atomic>
#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "fathom/v1/obstacle_service.pb.h"
#include "map/query/trajectory.h"
#include "server/change_log.h"
#include "server/geo_box.h"
#include "server/limits.h"
#include "server/watch_progress.h"

namespace fathom::server {

// Whether the alert stands behind this verdict, if it stood before or not.
bool AlertStands(const map::TrajectoryVerdict& verdict, double confidence,
                 double hysteresis, bool stood);

// See file comment.
class TrajectoryWatch {
 public:
  using Response = v1::WatchTrajectoryResponse;

  // The log must be followed (ChangeFeed::Add) before Next, and outlive this.
  // `most_cells`: see kMaxWatchCells. Errors: INVALID_ARGUMENT (field path),
  // RESOURCE_EXHAUSTED past kMaxWaypoints.
  static absl::StatusOr<TrajectoryWatch> Create(
      const v1::WatchTrajectoryRequest& request, const ChangeLog& log,
      uint64_t most_cells = kMaxWatchCells);

  // Writes the next message. Errors: RESOURCE_EXHAUSTED past most_cells;
  // CANCELLED soon after `stop` is set.
  absl::StatusOr<WatchStep> Next(SteadyTime now, const std::atomic<bool>& stop,
                                 Response* out);

 private:
  TrajectoryWatch(map::Trajectory trajectory, double hysteresis, bool alert,
                  const ChangeLog& log, uint64_t most_cells);

  // Whether what changed since the last reading may touch the path.
  ChangeLog::ViewPtr ReadLog();
  absl::Status Judge(const map::ObstacleMapView& view,
                     const std::atomic<bool>& stop);

  const ChangeLog* log_;
  map::Trajectory trajectory_;
  double hysteresis_;
  uint64_t most_cells_;
  // About all legs, and about each.
  GeoBox box_;
  std::vector<GeoBox> legs_;

  ChangeNumber seen_areas_;
  ChangeNumber seen_contacts_;
  // The map may have changed on the path since it was judged.
  bool stale_ = true;
  SteadyTime judged_{};
  bool alert_;
  // The last verdict, and whether it was told.
  v1::CheckTrajectoryResponse verdict_;
  bool told_ = false;
  // Its words without the stamp.
  std::string words_;
  std::string told_words_;
  bool told_alert_ = false;
  // When and up to which revision anything was told.
  SteadyTime told_time_{};
  uint64_t told_revision_ = 0;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_WATCH_TRAJECTORY_H_
