// How far one watcher has come: where it begins, what was lost, and when it is
// told that it has everything. Shared by the watches of regions and contacts.
//
// Not thread-safe; each call has its own.

#ifndef FATHOM_SERVER_WATCH_PROGRESS_H_
#define FATHOM_SERVER_WATCH_PROGRESS_H_

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "fathom/v1/obstacle_service.pb.h"
#include "server/change_log.h"
#include "server/convert_common.h"
#include "server/limits.h"

namespace fathom::server {

using SteadyTime = std::chrono::steady_clock::time_point;

// What a watch has done.
enum class WatchStep {
  // A message is to be written.
  kMessage,
  // Nothing to tell until the next Wake.
  kIdle,
  // The same, but it wants to be woken soon.
  kSoon,
};

// What a request says of an earlier watch; 0: there was none.
struct ResumePoint {
  uint64_t revision = 0;
  uint64_t run = 0;
};

// See file comment.
class WatchProgressKeeper {
 public:
  explicit WatchProgressKeeper(ResumePoint resume) : resume_(resume) {}

  // Where reading begins. Of a watch that resumes: its revision, if that is of
  // this run and not ahead of the map; else {}, which is lost.
  ChangeNumber Begin(const ChangeLog& log) {
    begun_ = true;
    told_any_ = true;
    const uint64_t newest = log.view()->revision();
    if (resume_.revision == 0) return ChangeNumber::After(newest);
    if (resume_.run != log.run() || resume_.revision > newest) return {};
    return ChangeNumber::After(resume_.revision);
  }
  bool begun() const { return begun_; }
  bool from_start() const { return resume_.revision == 0; }

  // A message of its own was told: progress follows as soon as all was.
  void Told() { told_any_ = true; }

  // All up to `view` was told. Whether that is to be said now.
  bool Due(const map::ObstacleMapView& view, SteadyTime now) const {
    return told_any_ || (view.revision() > said_revision_ &&
                         now - said_ >= kWatchProgressInterval);
  }
  // Writes it; `view` is that of the message's stamp.
  void Say(const map::ObstacleMapView& view, uint64_t run, SteadyTime now,
           v1::WatchProgress* out) {
    out->set_run_id(run);
    told_any_ = false;
    said_ = now;
    said_revision_ = view.revision();
  }

  // Says that updates were lost.
  template <typename Response>
  void SayLost(const map::ObstacleMapView& view, Response* out) {
    const uint64_t told = std::max(said_revision_, resume_.revision);
    out->mutable_resync()->set_updates_lost(
        view.revision() > told ? view.revision() - told : 0);
    WriteStamp(view, out->mutable_stamp());
    told_any_ = true;
  }

 private:
  ResumePoint resume_;
  bool begun_ = false;
  bool told_any_ = false;
  SteadyTime said_{};
  uint64_t said_revision_ = 0;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_WATCH_PROGRESS_H_
