#include "server/revision_gate.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace fathom::server {

RevisionGate::RevisionGate(size_t max_waiters)
    : max_waiters_(max_waiters), thread_([this] { Run(); }) {}

RevisionGate::~RevisionGate() {
  Close();
  thread_.join();
}

bool RevisionGate::Wait(uint64_t revision, Deadline deadline,
                        Callback callback) {
  MutexLock lock(mutex_);
  if (closed_ || waiters_.size() >= max_waiters_) return false;
  waiters_.push_back({.revision = revision,
                      .deadline = deadline,
                      .callback = std::move(callback)});
  changed_.NotifyOne();
  return true;
}

void RevisionGate::Reach(uint64_t revision) {
  MutexLock lock(mutex_);
  reached_ = std::max(reached_, revision);
  if (!waiters_.empty()) changed_.NotifyOne();
}

void RevisionGate::Close() {
  MutexLock lock(mutex_);
  closed_ = true;
  changed_.NotifyOne();
}

void RevisionGate::Run() {
  std::vector<Waiter> ready;
  while (true) {
    uint64_t reached = 0;
    {
      MutexLock lock(mutex_);
      while (ready.empty()) {
        const Deadline now = std::chrono::steady_clock::now();
        reached = reached_;
        const bool closed = closed_;
        const auto first_ready = std::stable_partition(
            waiters_.begin(), waiters_.end(), [=](const Waiter& waiter) {
              return !closed && waiter.revision > reached &&
                     waiter.deadline > now;
            });
        ready.assign(std::make_move_iterator(first_ready),
                     std::make_move_iterator(waiters_.end()));
        waiters_.erase(first_ready, waiters_.end());
        if (!ready.empty()) break;
        if (closed) return;
        if (waiters_.empty()) {
          changed_.Wait(mutex_);
          continue;
        }
        const auto next =
            std::min_element(waiters_.begin(), waiters_.end(),
                             [](const Waiter& a, const Waiter& b) {
                               return a.deadline < b.deadline;
                             });
        changed_.WaitUntil(mutex_, next->deadline);
      }
    }
    for (const Waiter& waiter : ready) {
      waiter.callback(waiter.revision <= reached);
    }
    ready.clear();
  }
}

}  // namespace fathom::server
