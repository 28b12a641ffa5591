#include "base/mutex.h"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>
#include <vector>

namespace fathom {
namespace {

// A queue of length one: the smallest class that needs all of the header.
class Slot {
 public:
  void Put(int value) FATHOM_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    while (full_) changed_.Wait(mutex_);
    value_ = value;
    full_ = true;
    changed_.NotifyAll();
  }

  int Take() FATHOM_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    while (!full_) changed_.Wait(mutex_);
    full_ = false;
    changed_.NotifyAll();
    return value_;
  }

 private:
  Mutex mutex_;
  CondVar changed_;
  int value_ FATHOM_GUARDED_BY(mutex_) = 0;
  bool full_ FATHOM_GUARDED_BY(mutex_) = false;
};

TEST(CondVar, HandsEveryValueFromThreadToThread) {
  constexpr int kWriters = 3;
  constexpr int kValues = 500;
  Slot slot;
  std::vector<std::thread> writers;
  for (int w = 0; w < kWriters; ++w) {
    writers.emplace_back([&slot] {
      for (int i = 1; i <= kValues; ++i) slot.Put(i);
    });
  }
  int sum = 0;
  for (int i = 0; i < kWriters * kValues; ++i) sum += slot.Take();
  for (std::thread& writer : writers) writer.join();
  // 3 * (1 + 2 + ... + 500) = 3 * 500 * 501 / 2 = 375 750.
  EXPECT_EQ(sum, 375'750);
}

TEST(CondVar, ATimedWaitThatNobodyEndsSaysSo) {
  Mutex mutex;
  CondVar never;
  MutexLock lock(mutex);
  EXPECT_FALSE(never.WaitUntil(mutex, std::chrono::steady_clock::now()));
  while (never.WaitFor(mutex, std::chrono::nanoseconds(1))) {
    // A wake-up without cause; a real caller would test its condition.
  }
}

}  // namespace
}  // namespace fathom
