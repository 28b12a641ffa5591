// What one WatchRegion call is told: the tiles of its grid that it has not yet
// been told as they are.
//
// There is no queue. A tile that waits is one bit; when its turn comes it is
// made from the newest view, so changes that a slow reader missed coalesce, and
// no view is held for him. Tiles are taken in turn, so that none starves.
//
// No gRPC. Not thread-safe; each call has its own.

#ifndef FATHOM_SERVER_WATCH_REGION_H_
#define FATHOM_SERVER_WATCH_REGION_H_

#include <atomic>
#include <cstdint>

#include "absl/status/statusor.h"
#include "base/clock.h"
#include "fathom/v1/obstacle_service.pb.h"
#include "server/change_log.h"
#include "server/marks.h"
#include "server/region.h"
#include "server/watch_progress.h"

namespace fathom::server {

// See file comment.
class RegionWatch {
 public:
  using Response = v1::WatchRegionResponse;

  // The log must be followed (ChangeFeed::Add) before Next; it and the clock
  // must outlive this. Errors: those of Region::Create.
  static absl::StatusOr<RegionWatch> Create(
      const v1::WatchRegionRequest& request, const ChangeLog& log,
      const Clock& clock);

  // Writes the next message; kIdle: there is none now. Soon after `stop` is
  // set, some message. Errors: those of Region::Open.
  absl::StatusOr<WatchStep> Next(SteadyTime now, const std::atomic<bool>& stop,
                                 Response* out);

 private:
  RegionWatch(Region region, const ChangeLog& log, const Clock& clock,
              ResumePoint resume);

  void Mark(const GeoBox& box);
  void MarkColumns(uint32_t first_row, uint32_t last_row, double west,
                   double east);
  void MarkAll();
  absl::Status WriteTile(const ChangeLog::ViewPtr& view,
                         const std::atomic<bool>& stop, Response* out);

  const ChangeLog* log_;
  const Clock* clock_;
  Region region_;
  uint32_t tile_rows_;
  uint32_t tile_columns_;
  // Tiles to be told, row by row.
  Marks marks_;
  WatchProgressKeeper progress_;
  // What of the log was read.
  ChangeNumber seen_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_WATCH_REGION_H_
