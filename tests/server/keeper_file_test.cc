// The keeper over a real mission file: what a restart finds, and many threads
// at once.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "server/map_keeper.h"
#include "server/mission.h"
#include "tests/server/keeper_fakes.h"
#include "tests/server/keeper_messages.h"
#include "tests/server/open_keeper.h"
#include "tests/server/sample_map.h"
#include "tests/storage/temp_dir.h"
#include "tests/testing/status_matchers.h"

namespace fathom::server {
namespace {

using ::fathom::testing::IsOk;

class KeeperFileTest : public ::testing::Test {
 protected:
  // Something of everything; what it leaves open is in the journal.
  void Fill(MapKeeper& keeper) {
    Awaited<ImportedTile> imported;
    keeper.Import(SampleChart(), /*last=*/true, {}, imported.Done());
    ASSERT_THAT(imported.Await(), IsOk());
    Awaited<Nothing> started;
    keeper.StartActivity(Leg(), started.Done());
    ASSERT_THAT(started.Await(), IsOk());
    auto listener = std::make_shared<FakeListener>();
    for (uint64_t i = 1; i <= 60; ++i) {
      ASSERT_THAT(keeper.Submit(PingMessage(i), listener), IsOk());
      ASSERT_THAT(
          keeper.Submit(FixMessage(i, i % 2 == 0 ? "m0" : "m1"), listener),
          IsOk());
      if (i == 30) {
        Awaited<map::TransferResult> transferred;
        keeper.Transfer(kLeg, transferred.Done());
        ASSERT_THAT(transferred.Await(), IsOk());
      }
    }
    Awaited<Nothing> dropped;
    keeper.DropContact({{{"ais"}, {"m0"}}, kStart + std::chrono::hours(1)},
                       dropped.Done());
    ASSERT_THAT(dropped.Await(), IsOk());
    listener->AwaitDurable(120);
  }

  storage::TempDir dir_;
};

TEST_F(KeeperFileTest, ReopenedMapsAreEqualWithAndWithoutACleanStop) {
  const std::string path = dir_.File("m.fathom");
  const std::string copy = dir_.File("copy.fathom");
  NewMission mission;
  mission.center = map::GeodeticPoint{41.5, -71.4};
  mission.side_m = 20 * 1852.0;
  std::string digest;
  uint64_t revision = 0;
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(auto file,
                                CreateMission(path, mission, kStart));
    Open first = OpenKeeper(std::move(file));
    Fill(*first.keeper);
    digest = first.keeper->View()->Digest();
    revision = first.keeper->View()->revision();
    // What a power cut would leave: checkpoint and journal.
    FATHOM_ASSERT_OK(first.file->SaveCopy(copy));
    FATHOM_ASSERT_OK(first.keeper->Stop());
    FATHOM_ASSERT_OK(first.file->Close());
  }

  for (const std::string& reopened : {path, copy}) {
    FATHOM_ASSERT_OK_AND_ASSIGN(auto again,
                                storage::MissionFile::Open(reopened));
    Open open = OpenKeeper(std::move(again));
    EXPECT_EQ(open.keeper->View()->Digest(), digest) << reopened;
    EXPECT_EQ(open.keeper->View()->revision(), revision) << reopened;
    if (reopened == copy) {
      EXPECT_GT(open.keeper->storage_state().journal_records, 0U);
    } else {
      EXPECT_EQ(open.keeper->storage_state().journal_records, 0U);
    }
    // A resend after the restart changes nothing; the next number counts.
    auto listener = std::make_shared<FakeListener>();
    ASSERT_THAT(open.keeper->Submit(PingMessage(60), listener), IsOk());
    ASSERT_THAT(open.keeper->Submit(PingMessage(61), listener), IsOk());
    const auto outcomes = listener->AwaitApplied(2);
    EXPECT_EQ(outcomes[0].fate, MessageFate::kDuplicate);
    EXPECT_EQ(outcomes[1].fate, MessageFate::kApplied);
    EXPECT_FALSE(outcomes[1].missing.any());
    FATHOM_ASSERT_OK(open.keeper->Stop());
    FATHOM_ASSERT_OK(open.file->Close());
  }
}

TEST_F(KeeperFileTest, LinkedNamesSurviveARestartAndHaveOneHistory) {
  const std::string path = dir_.File("m.fathom");
  const std::string copy = dir_.File("copy.fathom");
  NewMission mission;
  mission.center = map::GeodeticPoint{41.5, -71.4};
  mission.side_m = 20 * 1852.0;
  const map::ContactKey track = {{"c4i"}, {"T9"}};
  const map::ContactKey ais = {{"ais"}, {"m0"}};
  // As ais/m0 twice; linked; once more; once as c4i/T9.
  const auto message = [](uint64_t sequence, const map::ContactKey& key) {
    IngestMessage report = FixMessage(sequence, key.contact.value);
    report.source = key.source;
    std::get<map::ContactReport>(report.content).key = key;
    return report;
  };
  std::string digest;
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(auto file,
                                CreateMission(path, mission, kStart));
    Open open = OpenKeeper(std::move(file));
    auto listener = std::make_shared<FakeListener>();
    for (const uint64_t i : {1, 2}) {
      ASSERT_THAT(open.keeper->Submit(message(i, ais), listener), IsOk());
    }
    IngestMessage link = message(3, track);
    link.number.sequence = 1;
    std::get<map::ContactReport>(link.content).same_as = {ais};
    ASSERT_THAT(open.keeper->Submit(std::move(link), listener), IsOk());
    IngestMessage next = message(4, ais);
    next.number.sequence = 3;
    ASSERT_THAT(open.keeper->Submit(std::move(next), listener), IsOk());
    IngestMessage own = message(5, track);
    own.number.sequence = 2;
    ASSERT_THAT(open.keeper->Submit(std::move(own), listener), IsOk());
    listener->AwaitDurable(5);
    digest = open.keeper->View()->Digest();
    FATHOM_ASSERT_OK(open.file->SaveCopy(copy));
    FATHOM_ASSERT_OK(open.keeper->Stop());
    FATHOM_ASSERT_OK(open.file->Close());
  }
  for (const std::string& reopened : {path, copy}) {
    FATHOM_ASSERT_OK_AND_ASSIGN(auto again,
                                storage::MissionFile::Open(reopened));
    Open open = OpenKeeper(std::move(again));
    EXPECT_EQ(open.keeper->View()->Digest(), digest) << reopened;
    const auto answer = open.keeper->View()->Answer(
        {.position = {41.5, -71.4}, .time = kStart + Duration(5'000'000)});
    ASSERT_EQ(answer.contacts.size(), 1u);
    EXPECT_EQ(answer.contacts[0].key, track);
    ASSERT_NE(answer.contacts[0].links, nullptr);
    EXPECT_EQ(answer.contacts[0].links->names,
              std::vector<map::ContactKey>{ais});
    const auto seconds = [&](const map::ContactKey& key) {
      std::vector<std::pair<int64_t, std::string>> rows;
      FATHOM_EXPECT_OK(open.file->ReadContactHistory(
          key, Time::min(), Time::max(), [&](const auto& row) {
            EXPECT_EQ(row.estimate.key, key);
            rows.emplace_back((row.estimate.time - kStart).count() / 1'000'000,
                              row.estimate.linked.empty()
                                  ? ""
                                  : row.estimate.linked[0].contact.value);
            return true;
          }));
      return rows;
    };
    using Rows = std::vector<std::pair<int64_t, std::string>>;
    EXPECT_EQ(seconds(track), (Rows{{3, "m0"}, {4, "m0"}, {5, "m0"}}));
    // At 3 s its own track ended and went on as T9.
    EXPECT_EQ(seconds(ais),
              (Rows{{1, ""}, {2, ""}, {3, "T9"}, {4, "T9"}, {5, "T9"}}));
    FATHOM_ASSERT_OK(open.keeper->Stop());
    FATHOM_ASSERT_OK(open.file->Close());
  }
}

// ---- Many threads (what ThreadSanitizer looks at) ----

TEST_F(KeeperFileTest, ManySourcesAndReadersAtOnce) {
  NewMission mission;
  mission.center = map::GeodeticPoint{41.5, -71.4};
  mission.side_m = 20 * 1852.0;
  FATHOM_ASSERT_OK_AND_ASSIGN(
      auto file, CreateMission(dir_.File("m.fathom"), mission, kStart));
  Open open = OpenKeeper(std::move(file));
  MapKeeper& keeper = *open.keeper;
  Awaited<Nothing> started;
  keeper.StartActivity(Leg(), started.Done());
  ASSERT_THAT(started.Await(), IsOk());

  constexpr uint64_t kPings = 150;
  constexpr int kSources = 3;
  std::atomic<bool> done{false};
  std::vector<std::thread> readers;
  for (int i = 0; i < 2; ++i) {
    readers.emplace_back([&] {
      uint64_t newest = 0;
      while (!done) {
        const auto view = keeper.View();
        EXPECT_GE(view->revision(), newest);
        newest = view->revision();
        const auto answer = view->Answer(
            {.position = {41.5025, -71.397}, .depth_m = 10, .time = kStart});
        EXPECT_LE(answer.probability, 1);
        (void)keeper.storage_state();
      }
    });
  }
  std::vector<std::thread> sources;
  for (int source = 0; source < kSources; ++source) {
    sources.emplace_back([&, source] {
      auto listener = std::make_shared<FakeListener>();
      for (uint64_t sequence = 1; sequence <= kPings; ++sequence) {
        EXPECT_THAT(keeper.Submit(PingMessage(sequence, std::to_string(source)),
                                  listener),
                    IsOk());
      }
      EXPECT_EQ(listener->AwaitDurable(kPings).sequence, kPings);
    });
  }
  std::thread commander([&] {
    for (int i = 0; i < 5; ++i) {
      Awaited<map::TransferResult> transferred;
      keeper.Transfer(kLeg, transferred.Done());
      EXPECT_THAT(transferred.Await(), IsOk());
    }
  });
  for (std::thread& thread : sources) thread.join();
  commander.join();
  done = true;
  for (std::thread& thread : readers) thread.join();
  EXPECT_EQ(keeper.View()->FindActivity(kLeg)->measurements_accepted,
            kPings * kSources * 11);
  FATHOM_EXPECT_OK(keeper.Stop());
}

}  // namespace
}  // namespace fathom::server
