// ChangeFeed: shows the map's views to a ChangeLog while anybody watches, and
// wakes those who do.
//
// A thread of its own waits for the next view; the writer of the map only
// notifies it. With nobody watching (for Options::linger) it sleeps and holds
// no view.
//
// Lock order: the feed's before the log's and the keeper's; none is held while
// a watcher is woken. Thread-safe.

#ifndef FATHOM_SERVER_CHANGE_FEED_H_
#define FATHOM_SERVER_CHANGE_FEED_H_

#include <chrono>
#include <memory>
#include <thread>
#include <vector>

#include "base/mutex.h"
#include "server/change_log.h"
#include "server/limits.h"
#include "server/map_keeper.h"

namespace fathom::server {

// One who watches.
class Watcher {
 public:
  virtual ~Watcher() = default;
  // The log has something new, or a second has passed. Must not block.
  virtual void Wake() = 0;
};

struct ChangeFeedOptions {
  ChangeLogOptions log = {};
  std::chrono::milliseconds interval = kWatchInterval;
  std::chrono::milliseconds linger = kWatchLinger;
};

// See file comment.
class ChangeFeed {
 public:
  // `keeper` must outlive it.
  explicit ChangeFeed(const MapKeeper& keeper, ChangeFeedOptions options = {});
  ~ChangeFeed();
  ChangeFeed(const ChangeFeed&) = delete;
  ChangeFeed& operator=(const ChangeFeed&) = delete;

  // `watcher` is woken until it expires. Before this the log must not be read;
  // as long as it has not expired the log follows the map. The log now shows
  // the map as it is: what was acknowledged to a client before it began to
  // watch is behind it.
  void Add(const std::shared_ptr<Watcher>& watcher);

  // Wakes all.
  void WakeAll();
  // Wakes all within some kTick, though nothing may have changed.
  void WakeSoon();

  const ChangeLog& log() const { return log_; }

 private:
  using SteadyTime = std::chrono::steady_clock::time_point;

  void Run();
  // Whether the log is to follow the map.
  bool Wanted(SteadyTime now) FATHOM_REQUIRES(mutex_);

  const MapKeeper& keeper_;
  const ChangeFeedOptions options_;
  ChangeLog log_;

  Mutex mutex_;
  CondVar changed_;
  std::vector<std::weak_ptr<Watcher>> watchers_ FATHOM_GUARDED_BY(mutex_);
  // The log follows the map.
  bool following_ FATHOM_GUARDED_BY(mutex_) = false;
  bool soon_ FATHOM_GUARDED_BY(mutex_) = false;
  bool closed_ FATHOM_GUARDED_BY(mutex_) = false;
  // When the last watcher was seen.
  SteadyTime last_wanted_ FATHOM_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_CHANGE_FEED_H_
