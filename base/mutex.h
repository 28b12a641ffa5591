// std::mutex with clang's thread-safety annotations, so that GUARDED_BY is
// checked (`-Wthread-safety`, see tests/run). We do not use absl::Mutex: under
// ThreadSanitizer Debian's build of it reports races that are not there.
//
//   class Journal {
//    ...
//     mutable Mutex mutex_;
//     std::deque<Entry> waiting_ FATHOM_GUARDED_BY(mutex_);
//     CondVar grown_;
//   };
//
//   MutexLock lock(mutex_);
//   while (waiting_.empty()) grown_.Wait(mutex_);
//
// State the order in which locks are taken at the head of the file that takes
// more than one.

#ifndef FATHOM_BASE_MUTEX_H_
#define FATHOM_BASE_MUTEX_H_

#include <chrono>
#include <condition_variable>
#include <mutex>

#if defined(__clang__)
#define FATHOM_THREAD_ATTRIBUTE_(x) __attribute__((x))
#else
#define FATHOM_THREAD_ATTRIBUTE_(x)
#endif

// The member is read and written only with the mutex held.
#define FATHOM_GUARDED_BY(mutex) FATHOM_THREAD_ATTRIBUTE_(guarded_by(mutex))
// What the member points at is.
#define FATHOM_PT_GUARDED_BY(mutex) \
  FATHOM_THREAD_ATTRIBUTE_(pt_guarded_by(mutex))
// The function is called with the mutex held.
#define FATHOM_REQUIRES(...) \
  FATHOM_THREAD_ATTRIBUTE_(requires_capability(__VA_ARGS__))
// The function takes the mutex itself: its caller must not hold it.
#define FATHOM_EXCLUDES(...) \
  FATHOM_THREAD_ATTRIBUTE_(locks_excluded(__VA_ARGS__))

namespace fathom {

// A mutual-exclusion lock; not recursive.
class FATHOM_THREAD_ATTRIBUTE_(capability("mutex")) Mutex {
 public:
  Mutex() = default;
  Mutex(const Mutex&) = delete;
  Mutex& operator=(const Mutex&) = delete;

  void Lock() FATHOM_THREAD_ATTRIBUTE_(acquire_capability()) { mutex_.lock(); }
  void Unlock() FATHOM_THREAD_ATTRIBUTE_(release_capability()) {
    mutex_.unlock();
  }

 private:
  friend class CondVar;
  std::mutex mutex_;
};

// Holds a Mutex for its own lifetime.
class FATHOM_THREAD_ATTRIBUTE_(scoped_lockable) MutexLock {
 public:
  explicit MutexLock(Mutex& mutex)
      FATHOM_THREAD_ATTRIBUTE_(acquire_capability(mutex))
      : mutex_(mutex) {
    mutex_.Lock();
  }
  ~MutexLock() FATHOM_THREAD_ATTRIBUTE_(release_capability()) {
    mutex_.Unlock();
  }
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

 private:
  Mutex& mutex_;
};

// A condition to wait for. Waits may end without cause: call them in a loop
// that tests the condition.
class CondVar {
 public:
  CondVar() = default;
  CondVar(const CondVar&) = delete;
  CondVar& operator=(const CondVar&) = delete;

  // Releases `mutex`, waits for a notification, takes `mutex` again.
  void Wait(Mutex& mutex) FATHOM_REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    condition_.wait(lock);
    lock.release();
  }

  // As Wait, for at most `timeout`. False if the time ran out.
  bool WaitFor(Mutex& mutex, std::chrono::nanoseconds timeout)
      FATHOM_REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    const std::cv_status status = condition_.wait_for(lock, timeout);
    lock.release();
    return status == std::cv_status::no_timeout;
  }

  // As Wait, until `deadline` at the latest. False if the time ran out.
  bool WaitUntil(Mutex& mutex, std::chrono::steady_clock::time_point deadline)
      FATHOM_REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    const std::cv_status status = condition_.wait_until(lock, deadline);
    lock.release();
    return status == std::cv_status::no_timeout;
  }

  void NotifyOne() { condition_.notify_one(); }
  void NotifyAll() { condition_.notify_all(); }

 private:
  std::condition_variable condition_;
};

}  // namespace fathom

#endif  // FATHOM_BASE_MUTEX_H_
