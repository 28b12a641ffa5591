// WatchStream: a call that tells one watcher what changes, for as long as he
// listens. What is told is the matter of `Watch` (watch_region.h,
// watch_contacts.h, watch_trajectory.h):
//
//   using Response = ...;
//   absl::StatusOr<WatchStep> Next(SteadyTime now, const std::atomic<bool>&
//                                  stop, Response* out);
//
// One job at a time: a thread of the kind's own makes a message, gRPC writes
// it, and the next one is made when the reader has room for it. So a slow
// reader holds one message and nobody up.

#ifndef FATHOM_SERVER_WATCH_STREAM_H_
#define FATHOM_SERVER_WATCH_STREAM_H_

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "base/mutex.h"
#include "grpcpp/support/server_callback.h"
#include "server/change_feed.h"
#include "server/errors.h"
#include "server/server_context.h"
#include "server/watch_progress.h"

namespace fathom::server {

// Holds itself until gRPC is done with it.
template <typename Watch>
class WatchStream final
    : public grpc::ServerWriteReactor<typename Watch::Response>,
      public Watcher,
      public std::enable_shared_from_this<WatchStream<Watch>> {
 public:
  // Messages are made by `workers`, which has one thread. REQUIRES: a slot of
  // each of `slots` was taken; they are given back in the end.
  WatchStream(ServerContext& context, Workers& workers, Watch watch,
              std::vector<CallSlots*> slots)
      : context_(context),
        workers_(workers),
        watch_(std::move(watch)),
        slots_(std::move(slots)) {}

  // Must be called, once.
  void Begin() {
    {
      MutexLock lock(mutex_);
      self_ = this->shared_from_this();
    }
    context_.changes.Add(this->shared_from_this());
    Wake();
  }

  void Wake() override {
    {
      MutexLock lock(mutex_);
      again_ = true;
      if (busy_ || self_ == nullptr) return;
      busy_ = true;
    }
    GiveJob();
  }
  void OnWriteDone(bool ok) override {
    if (!ok) gone_ = true;
    GiveJob();
  }
  // May come while a message is made or written.
  void OnCancel() override {
    gone_ = true;
    Wake();
  }
  void OnDone() override {
    for (CallSlots* slots : slots_) slots->GiveBack();
    std::shared_ptr<WatchStream> last;
    MutexLock lock(mutex_);
    last.swap(self_);
  }

 private:
  // REQUIRES: busy_, and no other job or write is under way.
  void GiveJob() {
    workers_.Give([this] { Work(); });
  }

  void Work() {
    bool wake_soon = false;
    while (true) {
      {
        MutexLock lock(mutex_);
        again_ = false;
      }
      absl::Status end;
      if (gone_) {
        end = absl::CancelledError("the client has gone");
      } else if (context_.draining) {
        end = ShuttingDown();
      } else {
        const auto step =
            watch_.Next(std::chrono::steady_clock::now(), gone_, &response_);
        if (step.ok() && *step == WatchStep::kMessage) {
          this->StartWrite(&response_);
          return;
        }
        end = step.status();
        wake_soon = step.ok() && *step == WatchStep::kSoon;
      }
      if (!end.ok()) {
        // busy_ for ever: nothing may follow.
        this->Finish(ToGrpc(end));
        return;
      }
      if (wake_soon) context_.changes.WakeSoon();
      MutexLock lock(mutex_);
      if (again_) continue;
      busy_ = false;
      return;
    }
  }

  ServerContext& context_;
  Workers& workers_;
  // Both: only by the job under way.
  Watch watch_;
  typename Watch::Response response_;
  const std::vector<CallSlots*> slots_;
  std::atomic<bool> gone_{false};

  Mutex mutex_;
  // A job waits or is done, a write is under way, or it has finished.
  bool busy_ FATHOM_GUARDED_BY(mutex_) = false;
  // Woken since the last message was asked for.
  bool again_ FATHOM_GUARDED_BY(mutex_) = false;
  std::shared_ptr<WatchStream> self_ FATHOM_GUARDED_BY(mutex_);
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_WATCH_STREAM_H_
