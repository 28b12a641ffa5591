// Under a stream of messages the keeper publishes and commits at a bounded
// rate; who waits for something is never made to wait for company.
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <utility>
#include <vector>

#include "tests/server/keeper_fakes.h"
#include "tests/server/keeper_messages.h"
#include "tests/server/sample_map.h"
#include "tests/testing/status_matchers.h"

namespace fathom::server {
namespace {

using ::fathom::testing::IsOk;

// Longer than any test may run: what waits for it, waits for ever.
constexpr std::chrono::hours kForever{1};

class KeeperPacingTest : public ::testing::Test {
 protected:
  void Make(KeeperOptions options) {
    MapKeeper::Restored restored;
    restored.map = std::make_unique<map::ObstacleMap>(SampleOptions());
    ASSERT_THAT(restored.map->Start(Leg()), IsOk());
    restored.checkpoint = restored.map->View();
    keeper_ = std::make_unique<MapKeeper>(std::move(restored), store_,
                                          std::move(options));
  }
  void Submit(uint64_t sequence) {
    ASSERT_THAT(keeper_->Submit(PingMessage(sequence), listener_).status(),
                IsOk());
  }
  // Two messages that are there together: the keeper is under load.
  void SubmitTwo(uint64_t first) {
    std::vector<IngestMessage> messages;
    messages.push_back(PingMessage(first));
    messages.push_back(PingMessage(first + 1));
    ASSERT_THAT(keeper_->SubmitAll(std::move(messages), listener_), IsOk());
  }

  FakeStore store_;
  std::shared_ptr<FakeListener> listener_ = std::make_shared<FakeListener>();
  std::unique_ptr<MapKeeper> keeper_;
};

TEST_F(KeeperPacingTest, MessagesThatComeOneByOneNeverWait) {
  Make({.view_interval = kForever, .commit_interval = kForever});
  for (uint64_t sequence = 1; sequence <= 5; ++sequence) {
    Submit(sequence);
    listener_->AwaitApplied(sequence);
    listener_->AwaitDurable(sequence);
  }
}

TEST_F(KeeperPacingTest, AMessageBehindABatchWaitsForCompanyUntilACommand) {
  Make({.view_interval = kForever});
  SubmitTwo(1);
  listener_->AwaitDurable(2);
  const uint64_t revision = keeper_->View()->revision();
  Submit(3);
  EXPECT_EQ(listener_->AwaitApplied(2).size(), 2U);
  EXPECT_EQ(keeper_->View()->revision(), revision);
  Awaited<Nothing> checkpoint;
  keeper_->Checkpoint(checkpoint.Done());
  EXPECT_THAT(checkpoint.Await().status(), IsOk());
  EXPECT_EQ(listener_->AwaitApplied(3).back().number.sequence, 3U);
  EXPECT_EQ(keeper_->View()->revision(), revision + 1);
}

TEST_F(KeeperPacingTest, AFullBatchDoesNotWait) {
  Make({.max_messages_per_view = 3, .view_interval = kForever});
  SubmitTwo(1);
  listener_->AwaitApplied(2);
  SubmitTwo(3);
  Submit(5);
  listener_->AwaitApplied(5);
}

TEST_F(KeeperPacingTest, AStreamThatWaitsForRoomIsNotKeptWaiting) {
  Make({.max_pending_ingest = 3,
        .view_interval = kForever,
        .commit_interval = kForever});
  SubmitTwo(1);
  listener_->AwaitDurable(2);
  // Three are the bound: the last is told to wait for room.
  Submit(3);
  Submit(4);
  Submit(5);
  listener_->AwaitDurable(5);
  listener_->AwaitRooms(1);
}

TEST_F(KeeperPacingTest, CommitsUnderLoadTakeWhatHasComeMeanwhile) {
  Make({.commit_interval = kForever});
  SubmitTwo(1);
  listener_->AwaitDurable(2);
  SubmitTwo(3);
  SubmitTwo(5);
  listener_->AwaitApplied(6);
  EXPECT_EQ(listener_->durable(), 2U);
  Awaited<Nothing> checkpoint;
  keeper_->Checkpoint(checkpoint.Done());
  EXPECT_THAT(checkpoint.Await().status(), IsOk());
  EXPECT_EQ(listener_->AwaitDurable(6).sequence, 6U);
}

TEST_F(KeeperPacingTest, StoppingEndsEveryWait) {
  Make({.view_interval = kForever, .commit_interval = kForever});
  SubmitTwo(1);
  listener_->AwaitDurable(2);
  SubmitTwo(3);
  EXPECT_THAT(keeper_->Stop(), IsOk());
  EXPECT_EQ(listener_->AwaitDurable(4).sequence, 4U);
}

}  // namespace
}  // namespace fathom::server
