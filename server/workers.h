// Workers: threads that do jobs for gRPC's own threads, which every other call
// needs, or on behalf of threads that must not wait for gRPC.
//
// Thread-safe.

#ifndef FATHOM_SERVER_WORKERS_H_
#define FATHOM_SERVER_WORKERS_H_

#include <cstddef>
#include <deque>
#include <functional>
#include <thread>
#include <utility>
#include <vector>

#include "base/mutex.h"

namespace fathom::server {

// See file comment.
class Workers {
 public:
  // REQUIRES: threads > 0.
  explicit Workers(size_t threads) {
    for (size_t i = 0; i < threads; ++i) {
      threads_.emplace_back([this] { Run(); });
    }
  }
  // Does what was given, then ends.
  ~Workers() {
    {
      MutexLock lock(mutex_);
      closed_ = true;
      changed_.NotifyAll();
    }
    for (std::thread& thread : threads_) thread.join();
  }
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  size_t size() const { return threads_.size(); }

  // Does `job` on one of the threads, begun in the order given (with one
  // thread: one after the other). Not bounded by itself: each call has at most
  // two jobs waiting, and calls are bounded.
  void Give(std::function<void()> job) {
    MutexLock lock(mutex_);
    jobs_.push_back(std::move(job));
    changed_.NotifyOne();
  }
  // The same where fewer jobs wait than there are threads; else false: nobody
  // would come soon.
  bool Offer(std::function<void()> job) {
    MutexLock lock(mutex_);
    if (jobs_.size() >= threads_.size()) return false;
    jobs_.push_back(std::move(job));
    changed_.NotifyOne();
    return true;
  }

 private:
  void Run() {
    while (true) {
      std::function<void()> job;
      {
        MutexLock lock(mutex_);
        while (jobs_.empty() && !closed_) changed_.Wait(mutex_);
        if (jobs_.empty()) return;
        job = std::move(jobs_.front());
        jobs_.pop_front();
      }
      job();
    }
  }

  Mutex mutex_;
  CondVar changed_;
  std::deque<std::function<void()>> jobs_ FATHOM_GUARDED_BY(mutex_);
  bool closed_ FATHOM_GUARDED_BY(mutex_) = false;
  std::vector<std::thread> threads_;
};

// Counts the calls of one kind that are open at once.
class CallSlots {
 public:
  explicit CallSlots(size_t limit) : limit_(limit) {}

  // False: as many as are allowed are taken.
  bool Take() {
    MutexLock lock(mutex_);
    if (taken_ >= limit_) return false;
    ++taken_;
    return true;
  }
  void GiveBack() {
    MutexLock lock(mutex_);
    --taken_;
  }
  size_t limit() const { return limit_; }

 private:
  const size_t limit_;
  Mutex mutex_;
  size_t taken_ FATHOM_GUARDED_BY(mutex_) = 0;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_WORKERS_H_
