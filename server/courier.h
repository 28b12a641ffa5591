// Courier: one thread that runs small jobs in order.
//
// gRPC runs whatever callbacks are ready on the thread that starts an
// operation. The keeper's two threads must not be caught up in that, so what
// they have to tell a call - an ack to write, room to read on - is done by
// the courier. Jobs are few (some per group commit) and short.
//
// Thread-safe.

#ifndef FATHOM_SERVER_COURIER_H_
#define FATHOM_SERVER_COURIER_H_

#include <functional>
#include <thread>
#include <utility>
#include <vector>

#include "base/mutex.h"

namespace fathom::server {

// See file comment.
class Courier {
 public:
  Courier() : thread_([this] { Run(); }) {}
  // Runs what was given, then ends.
  ~Courier() {
    {
      MutexLock lock(mutex_);
      closed_ = true;
      changed_.NotifyOne();
    }
    thread_.join();
  }
  Courier(const Courier&) = delete;
  Courier& operator=(const Courier&) = delete;

  // Runs `job` later, behind those given before. Not bounded by itself: each
  // call has at most two jobs waiting.
  void Give(std::function<void()> job) {
    MutexLock lock(mutex_);
    jobs_.push_back(std::move(job));
    changed_.NotifyOne();
  }

 private:
  void Run() {
    std::vector<std::function<void()>> jobs;
    while (true) {
      {
        MutexLock lock(mutex_);
        while (jobs_.empty() && !closed_) changed_.Wait(mutex_);
        if (jobs_.empty()) return;
        jobs.swap(jobs_);
      }
      for (const auto& job : jobs) job();
      jobs.clear();
    }
  }

  Mutex mutex_;
  CondVar changed_;
  std::vector<std::function<void()>> jobs_ FATHOM_GUARDED_BY(mutex_);
  bool closed_ FATHOM_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_COURIER_H_
