// The keeper over a mission whose global map does not fit its memory: readers
// unpack tiles, the idle mapper packs them again, a restart finds the same.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "server/change_feed.h"
#include "server/limits.h"
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

constexpr uint64_t kBudgetBytes = 200'000;
constexpr int kSide = 400;

// 400 x 400 cells of 11 m, no two alike: some 50 tiles of 25 kB.
map::RasterBlock RoughChart() {
  map::RasterBlock block = SampleChart();
  block.north_west = {41.52, -71.42};
  block.latitude_step_deg = 0.0001;
  block.longitude_step_deg = 0.00013;
  block.rows = kSide;
  block.columns = kSide;
  block.depth_m.resize(kSide * kSide);
  for (int k = 0; k < kSide * kSide; ++k) {
    block.depth_m[static_cast<size_t>(k)] = static_cast<float>(
        30 + 5 * std::sin(0.3 * k) + std::cos(0.01 * (k % 977)));
  }
  return block;
}

map::GeodeticPoint PlaceOn(int row, int column) {
  return {41.52 - 0.0001 * (row + 0.5), -71.42 + 0.00013 * (column + 0.5)};
}

std::vector<float> ReadAll(const map::ObstacleMapView& view) {
  std::vector<float> depths_m;
  for (int row = 0; row < kSide; row += 7) {
    for (int column = 0; column < kSide; column += 7) {
      const auto seabed = view.SeabedAt(PlaceOn(row, column));
      depths_m.push_back(seabed ? seabed->estimate.depth_m : -1);
    }
  }
  return depths_m;
}

class KeeperTilesTest : public ::testing::Test {
 protected:
  Open New(uint64_t budget_bytes) {
    NewMission mission;
    mission.center = map::GeodeticPoint{41.5, -71.4};
    mission.side_m = 20 * 1852.0;
    return OpenKeeper(CreateMission(path_, mission, kStart), budget_bytes);
  }
  Open Reopen(uint64_t budget_bytes) {
    return OpenKeeper(storage::MissionFile::Open(path_), budget_bytes);
  }
  static void Import(MapKeeper& keeper) {
    Awaited<ImportedTile> imported;
    keeper.Import(RoughChart(), /*last=*/true, {}, imported.Done());
    ASSERT_THAT(imported.Await(), IsOk());
  }
  static void Close(Open& open) {
    ASSERT_THAT(open.keeper->Stop(), IsOk());
    open.keeper.reset();
    ASSERT_THAT(open.file->Close(), IsOk());
    open = {};
  }
  // What the tiles take once the keeper has had the time to see to it: nothing
  // is written meanwhile.
  static map::TileUse Settled(const MapKeeper& keeper) {
    const auto deadline =
        std::chrono::steady_clock::now() + std::chrono::seconds(30);
    map::TileUse use;
    do {
      use = keeper.View()->global().tile_use();
      if (use.unpacked_bytes <= kBudgetBytes) break;
      // Waits 5 ms, for no view of a later revision comes.
      (void)keeper.NextView(
          keeper.View()->revision(),
          std::chrono::steady_clock::now() + std::chrono::milliseconds(5));
    } while (std::chrono::steady_clock::now() < deadline);
    return use;
  }

  storage::TempDir dir_;
  const std::string path_ = dir_.File("m.fathom");
};

TEST_F(KeeperTilesTest,
       AnswersAreTheSameBeforeAndAfterARestartAndWithoutABudget) {
  Open open = New(kBudgetBytes);
  Import(*open.keeper);
  const map::TileUse use = open.keeper->View()->global().tile_use();
  EXPECT_EQ(use.budget_bytes, kBudgetBytes);
  EXPECT_GT(use.packed_tiles, 30U);
  EXPECT_GT(use.packed_bytes, 0U);
  const std::vector<float> depths_m = ReadAll(*open.keeper->View());
  EXPECT_GT(*std::min_element(depths_m.begin(), depths_m.end()), 20);
  const std::string digest = open.keeper->View()->Digest();
  Close(open);

  for (const uint64_t budget_bytes :
       {uint64_t{1}, kBudgetBytes, map::TileMemoryOptions::kUnlimited}) {
    Open again = Reopen(budget_bytes);
    const map::TileUse start = again.keeper->View()->global().tile_use();
    EXPECT_LE(start.unpacked_bytes, budget_bytes);
    EXPECT_EQ(start.packed_tiles + start.unpacked_tiles,
              use.packed_tiles + use.unpacked_tiles);
    EXPECT_EQ(start.packed_tiles == 0,
              budget_bytes == map::TileMemoryOptions::kUnlimited);
    EXPECT_EQ(ReadAll(*again.keeper->View()), depths_m);
    EXPECT_EQ(again.keeper->View()->Digest(), digest);
    Close(again);
  }
}

TEST_F(KeeperTilesTest, TheIdleMapperPacksWhatReadersUnpacked) {
  Open open = New(kBudgetBytes);
  Import(*open.keeper);
  const auto revision = open.keeper->View()->revision();
  std::vector<float> depths_m;
  for (int round = 0; round < 3; ++round) {
    const std::vector<float> again_m = ReadAll(*open.keeper->View());
    if (round > 0) {
      EXPECT_EQ(again_m, depths_m);
    }
    depths_m = again_m;
    const map::TileUse use = Settled(*open.keeper);
    EXPECT_LE(use.unpacked_bytes, kBudgetBytes);
    EXPECT_GT(use.packed_tiles, 30U);
  }
  EXPECT_EQ(open.keeper->View()->revision(), revision);
}

// What follows the map holds a view all the time, and the storage thread the
// last checkpoint's.
TEST_F(KeeperTilesTest, WhoFollowsTheMapKeepsNoTileUnpacked) {
  class Sleeper final : public Watcher {
   public:
    void Wake() override {}
  };
  Open open = New(kBudgetBytes);
  Import(*open.keeper);
  ChangeFeed feed(*open.keeper);
  const auto sleeper = std::make_shared<Sleeper>();
  feed.Add(sleeper);
  for (int round = 0; round < 3; ++round) {
    (void)ReadAll(*open.keeper->View());
    EXPECT_LE(Settled(*open.keeper).unpacked_bytes, kBudgetBytes);
  }
}

// Who holds a view keeps every tile that was unpacked since: its answers stay,
// and no more is packed, and so unpacked again, than TileMemory lets wait.
TEST_F(KeeperTilesTest, AViewHeldForLongBoundsWhatIsPacked) {
  constexpr uint64_t kMostRetiredBytes = 16 << 20;
  Open open = New(kBudgetBytes);
  Import(*open.keeper);
  auto held = open.keeper->View();
  const std::vector<float> depths_m = ReadAll(*held);
  const uint64_t all_bytes = held->global().tile_use().unpacked_bytes;
  // Each round another copy of the map waits for the view, until no more may.
  const auto deadline =
      std::chrono::steady_clock::now() + std::chrono::seconds(60);
  uint64_t most_bytes = 0;
  int rounds = 0;
  while (most_bytes <= kMostRetiredBytes &&
         std::chrono::steady_clock::now() < deadline) {
    ++rounds;
    ASSERT_EQ(ReadAll(*held), depths_m);
    (void)open.keeper->NextView(
        held->revision(),
        std::chrono::steady_clock::now() + kTileBudgetInterval);
    most_bytes = std::max(most_bytes, held->global().tile_use().unpacked_bytes);
  }
  EXPECT_GT(rounds, 5);
  EXPECT_GT(most_bytes, kMostRetiredBytes);
  for (int round = 0; round < 5; ++round) {
    ASSERT_EQ(ReadAll(*held), depths_m);
    (void)open.keeper->NextView(
        held->revision(),
        std::chrono::steady_clock::now() + 2 * kTileBudgetInterval);
    // What waited, what the last packing added, and what is at hand.
    EXPECT_LE(held->global().tile_use().unpacked_bytes,
              kMostRetiredBytes + 2 * all_bytes);
  }
  EXPECT_EQ(held->Digest(), open.keeper->View()->Digest());
  held.reset();
  EXPECT_LE(Settled(*open.keeper).unpacked_bytes, kBudgetBytes);
  EXPECT_EQ(ReadAll(*open.keeper->View()), depths_m);
}

TEST_F(KeeperTilesTest, ReadersBesideIngestAndTransfersSeeOneMap) {
  Open open = New(kBudgetBytes);
  Import(*open.keeper);
  const std::vector<float> depths_m = ReadAll(*open.keeper->View());
  Awaited<Nothing> started;
  open.keeper->StartActivity(Leg(), started.Done());
  ASSERT_THAT(started.Await(), IsOk());
  std::atomic<bool> done{false};
  std::atomic<int> wrong{0};
  std::vector<std::thread> readers;
  for (int t = 0; t < 2; ++t) {
    readers.emplace_back([&] {
      do {
        const auto view = open.keeper->View();
        // Far from the survey nothing changes.
        for (int column = 0; column < kSide; column += 7) {
          const auto seabed = view->SeabedAt(PlaceOn(0, column));
          const auto expected = depths_m[static_cast<size_t>(column / 7)];
          if (!seabed || seabed->estimate.depth_m != expected) ++wrong;
        }
      } while (!done);
    });
  }
  auto listener = std::make_shared<FakeListener>();
  for (uint64_t i = 1; i <= 60; ++i) {
    ASSERT_THAT(open.keeper->Submit(PingMessage(i), listener), IsOk());
    if (i % 20 == 0) {
      Awaited<map::TransferResult> transferred;
      open.keeper->Transfer(kLeg, transferred.Done());
      ASSERT_THAT(transferred.Await(), IsOk());
    }
  }
  done = true;
  for (std::thread& reader : readers) reader.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_LE(Settled(*open.keeper).unpacked_bytes, kBudgetBytes);
  const std::string digest = open.keeper->View()->Digest();
  Close(open);
  Open again = Reopen(kBudgetBytes);
  EXPECT_EQ(again.keeper->View()->Digest(), digest);
}

}  // namespace
}  // namespace fathom::server
