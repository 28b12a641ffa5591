// Charts through the keeper: each tile of a named import counts once, whatever
// is repeated and wherever a crash cuts.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>

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
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

// Tile `number` of a chart in tiles side by side, each its own depth.
map::RasterBlock Tile(uint64_t number) {
  map::RasterBlock block = SampleChart();
  block.north_west.longitude_deg += 0.01 * static_cast<double>(number - 1);
  block.depth_m.assign(100, 20.0F + 5 * static_cast<float>(number));
  return block;
}

absl::StatusOr<Applied<ImportedTile>> Import(MapKeeper& keeper, uint64_t number,
                                             bool last,
                                             std::string id = "chart-1") {
  Awaited<ImportedTile> told;
  keeper.Import(Tile(number), last,
                {.import_id = std::move(id), .number = number}, told.Done());
  return told.Await();
}

uint64_t Held(MapKeeper& keeper, std::string id = "chart-1") {
  Awaited<uint64_t> told;
  keeper.FindImport(std::move(id), told.Done());
  return told.Await()->result;
}

// Std of the prior in the middle of a tile: 2 m when imported once, 2/sqrt(2)
// when it was counted twice (4.20).
float StdOf(MapKeeper& keeper, uint64_t number) {
  return keeper.View()
      ->SeabedAt({41.505, -71.395 + 0.01 * static_cast<double>(number - 1)})
      ->estimate.std_m;
}

class KeeperImportTest : public ::testing::Test {
 protected:
  Open New() {
    NewMission mission;
    mission.center = map::GeodeticPoint{41.5, -71.4};
    mission.side_m = 20 * 1852.0;
    return OpenKeeper(CreateMission(dir_.File("m.fathom"), mission, kStart));
  }

  // What a crash at this instant would leave.
  Open Crashed(Open& open) {
    const std::string copy = dir_.File("copy.fathom");
    EXPECT_THAT(open.file->SaveCopy(copy), IsOk());
    return OpenKeeper(storage::MissionFile::Open(copy));
  }

  storage::TempDir dir_;
};

TEST_F(KeeperImportTest, ARepeatedTileIsSkipped) {
  Open open = New();
  MapKeeper& keeper = *open.keeper;
  EXPECT_EQ(Held(keeper), 0U);
  ASSERT_THAT(Import(keeper, 1, false), IsOk());
  ASSERT_THAT(Import(keeper, 2, true), IsOk());
  EXPECT_EQ(Held(keeper), 2U);
  const std::string digest = keeper.View()->Digest();
  for (const uint64_t number : {1u, 2u}) {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto again,
                                Import(keeper, number, number == 2));
    EXPECT_TRUE(again.result.skipped);
    EXPECT_EQ(again.result.result.cells_with_depth, 0U);
  }
  EXPECT_EQ(keeper.View()->Digest(), digest);
  EXPECT_NEAR(StdOf(keeper, 1), 2.0F, 0.01F);
  // Under another name it is another chart, and counts.
  ASSERT_THAT(Import(keeper, 1, true, "chart-2"), IsOk());
  EXPECT_NEAR(StdOf(keeper, 1), 1.414F, 0.01F);
}

TEST_F(KeeperImportTest, ATileTooFarAheadIsRefusedWithTheNumberToResumeAt) {
  Open open = New();
  ASSERT_THAT(Import(*open.keeper, 1, false), IsOk());
  EXPECT_THAT(Import(*open.keeper, 3, false),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       HasSubstr("first_tile=2")));
  EXPECT_EQ(Held(*open.keeper), 1U);
}

TEST_F(KeeperImportTest, ACrashBeforeTheCheckpointLeavesNothingOfIt) {
  Open open = New();
  ASSERT_THAT(Import(*open.keeper, 1, false), IsOk());
  Open after = Crashed(open);
  EXPECT_EQ(Held(*after.keeper), 0U);
  EXPECT_EQ(after.keeper->View()->global().known_leaf_count(), 0U);
}

TEST_F(KeeperImportTest, ACrashAfterACheckpointLeavesTilesAndTheirNumber) {
  Open open = New();
  ASSERT_THAT(Import(*open.keeper, 1, false), IsOk());
  ASSERT_THAT(Import(*open.keeper, 2, false), IsOk());
  Awaited<Nothing> saved;
  open.keeper->Checkpoint(saved.Done());
  ASSERT_THAT(saved.Await(), IsOk());
  ASSERT_THAT(Import(*open.keeper, 3, false), IsOk());
  Open after = Crashed(open);
  EXPECT_EQ(Held(*after.keeper), 2U);
  // Resumed, or repeated from the start: the map of one uninterrupted import.
  for (uint64_t number = 1; number <= 4; ++number) {
    ASSERT_THAT(Import(*open.keeper, number, number == 4), IsOk());
    ASSERT_THAT(Import(*after.keeper, number, number == 4), IsOk());
  }
  EXPECT_EQ(Held(*after.keeper), 4U);
  for (uint64_t number = 1; number <= 4; ++number) {
    EXPECT_NEAR(StdOf(*after.keeper, number), 2.0F, 0.01F) << number;
  }
  EXPECT_EQ(after.keeper->View()->global().known_leaf_count(),
            open.keeper->View()->global().known_leaf_count());
}

// A ping over a tile that no checkpoint holds yet reads its prior from it:
// whatever is durable of the ping must then hold the tile too.
TEST_F(KeeperImportTest, APingTakesTheTilesBeneathItToTheDisk) {
  Open open = New();
  Awaited<Nothing> started;
  open.keeper->StartActivity(Leg(), started.Done());
  ASSERT_THAT(started.Await(), IsOk());
  ASSERT_THAT(Import(*open.keeper, 1, false), IsOk());
  auto listener = std::make_shared<FakeListener>();
  ASSERT_THAT(open.keeper->Submit(PingMessage(1), listener), IsOk());
  listener->AwaitDurable(1);
  Open after = Crashed(open);
  EXPECT_EQ(Held(*after.keeper), 1U);
  EXPECT_EQ(after.keeper->View()->Digest(), open.keeper->View()->Digest());
}

}  // namespace
}  // namespace fathom::server
