#include "server/map_keeper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/server/keeper_fakes.h"
#include "tests/server/keeper_messages.h"
#include "tests/server/sample_map.h"
#include "tests/testing/status_matchers.h"

namespace fathom::server {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

// A keeper over a new map with the activity open.
class MapKeeperTest : public ::testing::Test {
 protected:
  explicit MapKeeperTest(KeeperOptions options = {})
      : options_(std::move(options)) {}

  void SetUp() override { Make(); }

  void Make() {
    MapKeeper::Restored restored;
    restored.map = std::make_unique<map::ObstacleMap>(SampleOptions());
    ASSERT_THAT(restored.map->Start(Leg()), IsOk());
    restored.checkpoint = restored.map->View();
    keeper_ =
        std::make_unique<MapKeeper>(std::move(restored), store_, options_);
  }

  void Submit(IngestMessage message, Room expected = Room::kSome) {
    FATHOM_ASSERT_OK_AND_ASSIGN(const Room room,
                                keeper_->Submit(std::move(message), listener_));
    EXPECT_EQ(room, expected);
  }

  KeeperOptions options_;
  FakeStore store_;
  std::shared_ptr<FakeListener> listener_ = std::make_shared<FakeListener>();
  std::unique_ptr<MapKeeper> keeper_;
};

TEST_F(MapKeeperTest, IsVisibleWhenAppliedAndDurableOnlyAfterTheCommit) {
  const uint64_t revision = keeper_->View()->revision();
  store_.Hold();
  for (uint64_t sequence = 1; sequence <= 3; ++sequence) {
    Submit(PingMessage(sequence));
  }
  const auto outcomes = listener_->AwaitApplied(3);
  for (uint64_t i = 0; i < 3; ++i) {
    EXPECT_EQ(outcomes[i].number.sequence, i + 1);
    EXPECT_EQ(outcomes[i].fate, MessageFate::kApplied);
    EXPECT_EQ(outcomes[i].accepted, 11U);
    EXPECT_EQ(outcomes[i].revision, revision + i + 1);
  }
  EXPECT_EQ(keeper_->View()->revision(), revision + 3);
  EXPECT_EQ(listener_->durable(), 0U);
  EXPECT_EQ(keeper_->storage_state().durable_revision, revision);
  store_.Release();
  EXPECT_EQ(listener_->AwaitDurable(3).sequence, 3U);
  EXPECT_EQ(keeper_->storage_state().durable_revision, revision + 3);
  EXPECT_EQ(keeper_->storage_state().journal_records, 3U);
}

TEST_F(MapKeeperTest, AViewOnceTakenNeverChanges) {
  const auto before = keeper_->View();
  const std::string digest = before->Digest();
  for (uint64_t sequence = 1; sequence <= 50; ++sequence) {
    Submit(PingMessage(sequence));
  }
  listener_->AwaitDurable(50);
  EXPECT_EQ(before->Digest(), digest);
  EXPECT_NE(keeper_->View()->Digest(), digest);
}

TEST_F(MapKeeperTest, AResendChangesNothingAndIsAcknowledgedAgain) {
  Submit(PingMessage(1));
  Submit(PingMessage(2));
  listener_->AwaitDurable(2);
  const auto view = keeper_->View();
  Submit(PingMessage(1));
  Submit(PingMessage(2));
  EXPECT_EQ(listener_->AwaitDurable(4).sequence, 2U);
  const auto outcomes = listener_->AwaitApplied(4);
  EXPECT_EQ(outcomes[2].fate, MessageFate::kDuplicate);
  EXPECT_EQ(outcomes[3].fate, MessageFate::kDuplicate);
  EXPECT_EQ(keeper_->View()->revision(), view->revision());
  EXPECT_EQ(keeper_->View()->Digest(), view->Digest());
}

TEST_F(MapKeeperTest, AResendIsNotDurableBeforeItsOriginalIs) {
  store_.Hold();
  Submit(PingMessage(1));
  store_.AwaitAttempts(1);
  Submit(PingMessage(1));
  listener_->AwaitApplied(2);
  EXPECT_EQ(listener_->durable(), 0U);
  store_.Release();
  listener_->AwaitDurable(2);
}

TEST_F(MapKeeperTest, AGapIsToldAndDoesNotStopTheStream) {
  Submit(PingMessage(1));
  Submit(PingMessage(4));
  const auto outcomes = listener_->AwaitApplied(2);
  EXPECT_FALSE(outcomes[0].missing.any());
  EXPECT_EQ(outcomes[1].fate, MessageFate::kApplied);
  EXPECT_EQ(outcomes[1].missing.first, 2U);
  EXPECT_EQ(outcomes[1].missing.last, 3U);
}

TEST_F(MapKeeperTest, ARefusedMessageKeepsItsPlaceInTheOrder) {
  IngestMessage bad = PingMessage(2);
  bad.content = Refusal{.reason = map::RejectReason::kNotFinite,
                        .field = "ping.pose.heading_deg",
                        .description = "nan"};
  IngestMessage homeless = PingMessage(3);
  std::get<map::Ping>(homeless.content).activity = {"leg-9"};
  Submit(PingMessage(1));
  Submit(std::move(bad));
  Submit(std::move(homeless));
  Submit(PingMessage(4));
  const auto outcomes = listener_->AwaitApplied(4);
  EXPECT_EQ(outcomes[1].fate, MessageFate::kRefused);
  EXPECT_EQ(outcomes[1].refusal.field, "ping.pose.heading_deg");
  EXPECT_EQ(outcomes[2].fate, MessageFate::kRefused);
  EXPECT_EQ(outcomes[2].refusal.reason, map::RejectReason::kNoActivity);
  EXPECT_EQ(outcomes[3].fate, MessageFate::kApplied);
  EXPECT_FALSE(outcomes[3].missing.any());
  listener_->AwaitDurable(4);
  size_t journal = 0;
  size_t positions = 0;
  for (const SeenBatch& batch : store_.seen()) {
    journal += batch.journal;
    positions += batch.positions;
  }
  EXPECT_EQ(journal, 2U);
  EXPECT_EQ(positions, 2U);
}

TEST_F(MapKeeperTest, AnOldEpochIsRefused) {
  Submit(PingMessage(1, "auv-1", /*epoch=*/7));
  Submit(PingMessage(1, "auv-1", /*epoch=*/6));
  const auto outcomes = listener_->AwaitApplied(2);
  EXPECT_EQ(outcomes[1].fate, MessageFate::kRefused);
  EXPECT_EQ(outcomes[1].refusal.field, "epoch");
}

TEST_F(MapKeeperTest, EverythingThatWaitsIsOneCommit) {
  store_.Hold();
  Submit(PingMessage(1));
  store_.AwaitAttempts(1);  // Commits the first, alone.
  for (uint64_t sequence = 2; sequence <= 40; ++sequence) {
    Submit(PingMessage(sequence));
  }
  listener_->AwaitApplied(40);
  store_.Release();
  listener_->AwaitDurable(40);
  // The last messages may reach the storage thread just after the release.
  const auto seen = store_.seen();
  EXPECT_EQ(seen[0].journal, 1U);
  EXPECT_LE(seen.size(), 3U);
}

TEST_F(MapKeeperTest, ContactReportsGiveAHistoryAndRefusalsTheirReason) {
  Submit(FixMessage(2, "m1"));
  IngestMessage late = FixMessage(3, "m1");
  std::get<map::ContactReport>(late.content).time =
      kStart - std::chrono::seconds(59);  // 61 s before the first.
  Submit(std::move(late));
  const auto outcomes = listener_->AwaitApplied(2);
  EXPECT_EQ(outcomes[0].fate, MessageFate::kApplied);
  EXPECT_EQ(outcomes[1].fate, MessageFate::kRefused);
  EXPECT_EQ(outcomes[1].refusal.reason, map::RejectReason::kTooLate);
  EXPECT_THAT(outcomes[1].refusal.description, HasSubstr("older"));
  listener_->AwaitDurable(2);
  size_t history = 0;
  for (const SeenBatch& batch : store_.seen()) history += batch.history;
  EXPECT_EQ(history, 1U);
  EXPECT_EQ(keeper_->View()->counters().contact_rejects.count(
                map::RejectReason::kTooLate),
            1U);
}

TEST_F(MapKeeperTest, LateContactReportRewritesTheHistoryBehindIt) {
  Submit(FixMessage(2, "m1"));
  Submit(FixMessage(9, "m1"));
  IngestMessage late = FixMessage(10, "m1");
  std::get<map::ContactReport>(late.content).time =
      kStart + std::chrono::seconds(5);
  Submit(std::move(late));
  const auto outcomes = listener_->AwaitApplied(3);
  EXPECT_EQ(outcomes[2].fate, MessageFate::kApplied);
  listener_->AwaitDurable(3);
  size_t history = 0;
  for (const SeenBatch& batch : store_.seen()) history += batch.history;
  // One each, then the one before the late one, itself and the one after.
  EXPECT_EQ(history, 5U);
}

TEST_F(MapKeeperTest, CommandsTellTheirResultWhenDurable) {
  store_.Hold();
  map::StartActivity second = Leg();
  second.id = {"leg-2"};
  Awaited<Nothing> started;
  keeper_->StartActivity(second, started.Done());
  store_.AwaitAttempts(1);
  EXPECT_EQ(started.times_told(), 0U);
  store_.Release();
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto applied, started.Await());
  EXPECT_EQ(applied.revision, keeper_->View()->revision());
  // Again: the id is used up.
  Awaited<Nothing> again;
  keeper_->StartActivity(second, again.Done());
  EXPECT_THAT(again.Await(), StatusIs(absl::StatusCode::kAlreadyExists));
  Awaited<Nothing> dropped;
  keeper_->DropContact({{{"ais"}, {"m9"}}, kStart}, dropped.Done());
  EXPECT_THAT(dropped.Await(), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(MapKeeperTest, ATransferIsDurableByACheckpoint) {
  Submit(PingMessage(1));
  Awaited<map::TransferResult> transferred;
  keeper_->Transfer(kLeg, transferred.Done());
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto result, transferred.Await());
  EXPECT_GT(result.result.leaves_written, 0U);
  EXPECT_TRUE(store_.seen().back().checkpoint);
  EXPECT_EQ(keeper_->storage_state().journal_records, 0U);
  Awaited<map::TransferResult> completed;
  keeper_->CompleteActivity(kLeg, /*discard=*/false, completed.Done());
  EXPECT_THAT(completed.Await(), IsOk());
  EXPECT_FALSE(keeper_->View()->FindActivity(kLeg)->open());
  Awaited<map::TransferResult> again;
  keeper_->CompleteActivity(kLeg, /*discard=*/false, again.Done());
  EXPECT_THAT(again.Await(), StatusIs(absl::StatusCode::kFailedPrecondition));
}

TEST_F(MapKeeperTest, OnlyTheLastBlockOfAChartWaitsForTheDisk) {
  store_.Hold();
  Awaited<ImportedTile> first;
  keeper_->Import(SampleChart(), /*last=*/false, {}, first.Done());
  EXPECT_THAT(first.Await(), IsOk());
  Awaited<ImportedTile> last;
  keeper_->Import(SampleChart(), /*last=*/true, {}, last.Done());
  store_.AwaitAttempts(1);
  EXPECT_EQ(last.times_told(), 0U);
  store_.Release();
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto applied, last.Await());
  EXPECT_EQ(applied.result.result.cells_with_depth, 100U);
  EXPECT_TRUE(store_.seen().back().checkpoint);
}

TEST_F(MapKeeperTest, WaitsForARevisionWithoutAThread) {
  const uint64_t wanted = keeper_->View()->revision() + 1;
  const auto deadline =
      std::chrono::steady_clock::now() + std::chrono::minutes(1);
  std::promise<bool> reached;
  ASSERT_TRUE(keeper_->WaitForRevision(
      wanted, deadline, [&](bool there) { reached.set_value(there); }));
  Submit(PingMessage(1));
  EXPECT_TRUE(reached.get_future().get());
  std::promise<bool> too_late;
  ASSERT_TRUE(
      keeper_->WaitForRevision(wanted + 100, std::chrono::steady_clock::now(),
                               [&](bool there) { too_late.set_value(there); }));
  EXPECT_FALSE(too_late.get_future().get());
}

TEST_F(MapKeeperTest, AFullDiskRefusesIngestKeepsQueriesAndRecovers) {
  store_.Fail(absl::ResourceExhaustedError("no space left"));
  Submit(PingMessage(1));
  listener_->AwaitFaults(1);
  EXPECT_EQ(keeper_->storage_state().fault, "no space left");
  EXPECT_THAT(keeper_->Submit(PingMessage(2), listener_),
              StatusIs(absl::StatusCode::kResourceExhausted));
  Awaited<map::TransferResult> refused;
  keeper_->Transfer(kLeg, refused.Done());
  EXPECT_THAT(refused.Await(), StatusIs(absl::StatusCode::kResourceExhausted));
  // The middle beam of ping 1 hit 53 m north: 53 / 111 068 = 4.772e-4 deg.
  EXPECT_TRUE(
      keeper_->View()
          ->SeabedAt({kMiddle.latitude_deg + 4.772e-4, kMiddle.longitude_deg})
          .has_value());
  EXPECT_EQ(listener_->durable(), 0U);
  store_.Fail(absl::OkStatus());
  EXPECT_EQ(listener_->AwaitDurable(1).sequence, 1U);
  EXPECT_EQ(keeper_->storage_state().fault, "");
  Submit(PingMessage(2));
  EXPECT_EQ(listener_->AwaitDurable(2).sequence, 2U);
  EXPECT_THAT(keeper_->Stop(), IsOk());
}

TEST_F(MapKeeperTest, StopAppliesAndCommitsWhatWaitsAndThenTakesNothing) {
  store_.Hold();
  for (uint64_t sequence = 1; sequence <= 20; ++sequence) {
    Submit(PingMessage(sequence));
  }
  std::thread stopper([this] { EXPECT_THAT(keeper_->Stop(), IsOk()); });
  store_.AwaitAttempts(1);
  store_.Release();
  stopper.join();
  EXPECT_EQ(listener_->durable(), 20U);
  EXPECT_TRUE(store_.seen().back().checkpoint);
  EXPECT_THAT(keeper_->Submit(PingMessage(21), listener_),
              StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_THAT(keeper_->Stop(), IsOk());
}

TEST_F(MapKeeperTest, StopGivesUpOnADiskThatStaysFull) {
  store_.Fail(absl::ResourceExhaustedError("no space left"));
  Submit(PingMessage(1));
  listener_->AwaitFaults(1);
  EXPECT_THAT(keeper_->Stop(), StatusIs(absl::StatusCode::kResourceExhausted));
  EXPECT_EQ(listener_->durable(), 0U);
}

class FatalTest : public MapKeeperTest {
 protected:
  FatalTest() {
    options_.on_fatal = [this](const absl::Status& status) {
      fatal_.push_back(status);
    };
  }
  std::vector<absl::Status> fatal_;
};

TEST_F(FatalTest, AnIoErrorEndsWritingForGoodAndIsToldOnce) {
  store_.Fail(absl::InternalError("fsync failed"));
  Awaited<map::TransferResult> transferred;
  keeper_->Transfer(kLeg, transferred.Done());
  EXPECT_THAT(transferred.Await(), StatusIs(absl::StatusCode::kInternal));
  store_.Fail(absl::OkStatus());
  EXPECT_THAT(keeper_->Submit(PingMessage(1), listener_),
              StatusIs(absl::StatusCode::kResourceExhausted));
  EXPECT_THAT(keeper_->Stop(), StatusIs(absl::StatusCode::kInternal));
  EXPECT_EQ(fatal_.size(), 1U);
  EXPECT_THAT(store_.seen(), ::testing::IsEmpty());
}

// Nothing was written, so there is no reason to end the program; it used to.
TEST_F(FatalTest, DamageInTheWayOfAWriteRefusesIngestAndKeepsQueries) {
  Submit(PingMessage(1));
  listener_->AwaitDurable(1);
  const uint64_t durable = keeper_->storage_state().durable_revision;
  store_.Fail(absl::DataLossError("page 7; repair it"));
  Awaited<map::TransferResult> transferred;
  keeper_->Transfer(kLeg, transferred.Done());
  EXPECT_THAT(transferred.Await(), StatusIs(absl::StatusCode::kDataLoss));
  EXPECT_EQ(keeper_->storage_state().fault, "page 7; repair it");
  EXPECT_TRUE(keeper_->storage_state().damaged);
  EXPECT_EQ(keeper_->storage_state().durable_revision, durable);
  EXPECT_THAT(keeper_->Submit(PingMessage(2), listener_),
              StatusIs(absl::StatusCode::kDataLoss));
  Awaited<Nothing> refused;
  keeper_->DropContact({{{"ais"}, {"m0"}}, kStart}, refused.Done());
  EXPECT_THAT(refused.Await(), StatusIs(absl::StatusCode::kDataLoss));
  // The middle beam of ping 1, as above.
  EXPECT_TRUE(
      keeper_->View()
          ->SeabedAt({kMiddle.latitude_deg + 4.772e-4, kMiddle.longitude_deg})
          .has_value());
  EXPECT_THAT(keeper_->Stop(), StatusIs(absl::StatusCode::kDataLoss));
  EXPECT_THAT(fatal_, ::testing::IsEmpty());
}

TEST_F(FatalTest, DamageInTheWayOfAWriteEndsStreams) {
  Submit(PingMessage(1));
  listener_->AwaitDurable(1);
  store_.Fail(absl::DataLossError("page 7; repair it"));
  Submit(PingMessage(2));
  listener_->AwaitFaults(1);
  EXPECT_EQ(listener_->durable(), 1U);
  EXPECT_THAT(keeper_->Stop(), StatusIs(absl::StatusCode::kDataLoss));
}

// A checkpoint and what came after it, handed to storage together: the first
// part is on the disk. Its command used to be told the damage of the second.
TEST_F(FatalTest, WhatWasCommittedBeforeTheDamageIsToldDurable) {
  store_.Hold();
  Submit(PingMessage(1));
  store_.AwaitAttempts(1);
  Awaited<map::TransferResult> transferred;
  keeper_->Transfer(kLeg, transferred.Done());
  Submit(PingMessage(2));
  listener_->AwaitApplied(2);
  store_.Fail(absl::DataLossError("page 7; repair it"), 2);
  store_.Release();
  EXPECT_THAT(transferred.Await(), IsOk());
  listener_->AwaitFaults(1);
  EXPECT_EQ(listener_->durable(), 1U);
  EXPECT_TRUE(keeper_->storage_state().damaged);
  EXPECT_THAT(keeper_->Stop(), StatusIs(absl::StatusCode::kDataLoss));
}

class BoundedTest : public MapKeeperTest {
 protected:
  BoundedTest() : MapKeeperTest(Small()) {}
  static KeeperOptions Small() {
    KeeperOptions options;
    options.max_pending_ingest = 4;
    options.max_pending_commands = 2;
    options.journal_max_records = 10;
    options.storage_retry_delay = std::chrono::milliseconds(1);
    return options;
  }
};

// There is room again, and then a page is damaged.
TEST_F(BoundedTest, AFullDiskMayTurnOutToBeDamaged) {
  store_.Fail(absl::ResourceExhaustedError("no space left"));
  Submit(PingMessage(1));
  listener_->AwaitFaults(1);
  EXPECT_FALSE(keeper_->storage_state().damaged);
  store_.Fail(absl::DataLossError("page 7; repair it"));
  while (!keeper_->storage_state().damaged) std::this_thread::yield();
  EXPECT_EQ(keeper_->storage_state().fault, "page 7; repair it");
  EXPECT_THAT(keeper_->Stop(), StatusIs(absl::StatusCode::kDataLoss));
}

TEST_F(BoundedTest, SaysWhenThereIsNoMoreRoomAndWhenThereIsAgain) {
  store_.Hold();
  for (uint64_t sequence = 1; sequence <= 3; ++sequence) {
    Submit(PingMessage(sequence), Room::kSome);
  }
  Submit(PingMessage(4), Room::kNone);
  EXPECT_THAT(keeper_->SubmitAll({FixMessage(1, "m1")}, listener_),
              StatusIs(absl::StatusCode::kAborted));
  EXPECT_EQ(listener_->rooms(), 0U);
  store_.Release();
  listener_->AwaitDurable(4);
  listener_->AwaitRooms(1);
  std::vector<IngestMessage> batch;
  for (uint64_t sequence = 1; sequence <= 4; ++sequence) {
    batch.push_back(FixMessage(sequence, "m1"));
  }
  // As many as the bound are taken at once, one more never.
  std::vector<IngestMessage> too_many = batch;
  too_many.push_back(FixMessage(5, "m1"));
  EXPECT_THAT(keeper_->SubmitAll(too_many, listener_),
              StatusIs(absl::StatusCode::kAborted));
  EXPECT_THAT(keeper_->SubmitAll(batch, listener_), IsOk());
  listener_->AwaitDurable(8);
}

TEST_F(BoundedTest, RefusesACommandTooManyAndServesTheOthers) {
  store_.Hold();
  Awaited<map::TransferResult> first;
  Awaited<map::TransferResult> second;
  Awaited<map::TransferResult> third;
  keeper_->Transfer(kLeg, first.Done());
  keeper_->Transfer(kLeg, second.Done());
  keeper_->Transfer(kLeg, third.Done());
  EXPECT_THAT(third.Await(), StatusIs(absl::StatusCode::kAborted));
  store_.Release();
  EXPECT_THAT(first.Await(), IsOk());
  EXPECT_THAT(second.Await(), IsOk());
}

TEST_F(BoundedTest, MakesACheckpointBeforeTheJournalGrowsTooLong) {
  uint64_t sequence = 0;
  for (int i = 0; i < 25; ++i) {
    Submit(PingMessage(++sequence));
    listener_->AwaitDurable(sequence);
  }
  size_t checkpoints = 0;
  for (const SeenBatch& batch : store_.seen()) checkpoints += batch.checkpoint;
  EXPECT_EQ(checkpoints, 2U);  // After records 10 and 20.
  EXPECT_EQ(keeper_->storage_state().journal_records, 5U);
}

TEST_F(BoundedTest, TwoContactReportsCountAsOneRecordOfTheJournal) {
  for (uint64_t sequence = 1; sequence <= 25; ++sequence) {
    Submit(FixMessage(sequence, "m1"));
    listener_->AwaitDurable(sequence);
  }
  size_t checkpoints = 0;
  for (const SeenBatch& batch : store_.seen()) checkpoints += batch.checkpoint;
  EXPECT_EQ(checkpoints, 1U);  // After 20 reports: 10 records.
  EXPECT_EQ(keeper_->storage_state().journal_records, 5U);
}

}  // namespace
}  // namespace fathom::server
