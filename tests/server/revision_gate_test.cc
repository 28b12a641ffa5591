#include "server/revision_gate.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <thread>
#include <vector>

namespace fathom::server {
namespace {

RevisionGate::Deadline Far() {
  return std::chrono::steady_clock::now() + std::chrono::minutes(5);
}

TEST(RevisionGate, OpensAtTheRevisionAndNotBefore) {
  RevisionGate gate(10);
  std::promise<bool> two;
  std::promise<bool> five;
  ASSERT_TRUE(gate.Wait(2, Far(), [&](bool r) { two.set_value(r); }));
  ASSERT_TRUE(gate.Wait(5, Far(), [&](bool r) { five.set_value(r); }));
  gate.Reach(2);
  EXPECT_TRUE(two.get_future().get());
  auto later = five.get_future();
  EXPECT_EQ(later.wait_for(std::chrono::seconds(0)),
            std::future_status::timeout);
  gate.Reach(7);
  EXPECT_TRUE(later.get());
}

TEST(RevisionGate, OneThatIsThereAlreadyIsToldAtOnce) {
  RevisionGate gate(10);
  gate.Reach(9);
  std::promise<bool> told;
  ASSERT_TRUE(gate.Wait(9, Far(), [&](bool r) { told.set_value(r); }));
  EXPECT_TRUE(told.get_future().get());
}

TEST(RevisionGate, TellsWhenTheTimeRunsOut) {
  RevisionGate gate(10);
  std::promise<bool> told;
  ASSERT_TRUE(gate.Wait(
      1, std::chrono::steady_clock::now() + std::chrono::milliseconds(1),
      [&](bool r) { told.set_value(r); }));
  EXPECT_FALSE(told.get_future().get());
}

TEST(RevisionGate, TakesAsManyAsAllowedAndNotOneMore) {
  RevisionGate gate(2);
  std::atomic<int> told{0};
  ASSERT_TRUE(gate.Wait(1, Far(), [&](bool) { told += 1; }));
  ASSERT_TRUE(gate.Wait(1, Far(), [&](bool) { told += 1; }));
  EXPECT_FALSE(gate.Wait(1, Far(), [&](bool) { told += 100; }));
}

TEST(RevisionGate, ClosingTellsAllAndTakesNone) {
  std::atomic<int> refused{0};
  {
    RevisionGate gate(10);
    for (int i = 0; i < 3; ++i) {
      ASSERT_TRUE(gate.Wait(1, Far(), [&](bool r) { refused += r ? 0 : 1; }));
    }
    gate.Close();
    EXPECT_FALSE(gate.Wait(1, Far(), [](bool) {}));
  }
  EXPECT_EQ(refused, 3);
}

TEST(RevisionGate, ManyWaitersAndOneWriter) {
  constexpr int kThreads = 4;
  constexpr uint64_t kRevisions = 200;
  std::atomic<uint64_t> reached{0};
  RevisionGate gate(kThreads * kRevisions + 1);
  {
    std::vector<std::thread> threads;
    for (int i = 0; i < kThreads; ++i) {
      threads.emplace_back([&] {
        for (uint64_t revision = 1; revision <= kRevisions; ++revision) {
          EXPECT_TRUE(
              gate.Wait(revision, Far(), [&](bool r) { reached += r; }));
        }
      });
    }
    for (uint64_t revision = 1; revision <= kRevisions; ++revision) {
      gate.Reach(revision);
    }
    for (std::thread& thread : threads) thread.join();
  }
  std::promise<void> last;
  ASSERT_TRUE(gate.Wait(kRevisions, Far(), [&](bool) { last.set_value(); }));
  last.get_future().get();
  EXPECT_EQ(reached, kThreads * kRevisions);
}

}  // namespace
}  // namespace fathom::server
