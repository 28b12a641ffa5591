// Where tiles hang, and what a leaf costs whatever the map's max_level is.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <vector>

#include "map/global/cell_key.h"
#include "map/global/global_map.h"
#include "tests/map/global/scene.h"

namespace fathom::map {
namespace {

using ::testing::ElementsAre;

// Levels at which the tiles of a map hang, from TileLevelFor.
std::vector<int> Rungs(int max_level) {
  std::vector<int> rungs;
  for (int level = 0; level <= max_level; ++level) {
    const int rung = TileLadder(max_level).TileLevelFor(level);
    if (rungs.empty() || rungs.back() != rung) rungs.push_back(rung);
  }
  return rungs;
}

TEST(TileLadder, EndsAtTheMapsFinestLevel) {
  EXPECT_THAT(Rungs(0), ElementsAre(0));
  EXPECT_THAT(Rungs(5), ElementsAre(0));
  EXPECT_THAT(Rungs(6), ElementsAre(0));
  EXPECT_THAT(Rungs(7), ElementsAre(0, 1));
  EXPECT_THAT(Rungs(13), ElementsAre(0, 1, 7));
  EXPECT_THAT(Rungs(18), ElementsAre(0, 6, 12));
  EXPECT_THAT(Rungs(19), ElementsAre(0, 1, 7, 13));
  EXPECT_THAT(Rungs(24), ElementsAre(0, 6, 12, 18));
}

TEST(TileLadder, EachRungSpansWhatIsLeftToTheNext) {
  for (int max_level = 1; max_level <= kMaxLevel; ++max_level) {
    const TileLadder ladder(max_level);
    int level = 0;
    for (const int rung : Rungs(max_level)) {
      EXPECT_EQ(rung, level) << max_level;
      EXPECT_TRUE(ladder.Has({.level = static_cast<std::uint8_t>(rung)}));
      level += ladder.LevelsOf(rung);
    }
    EXPECT_EQ(level, max_level);
  }
}

TEST(TileLadder, KnowsWhichTilesAMapHas) {
  EXPECT_TRUE(TileLadder(13).Has({.level = 1, .row = 1, .col = 0}));
  EXPECT_FALSE(TileLadder(13).Has({.level = 1, .row = 2, .col = 0}));
  EXPECT_FALSE(TileLadder(13).Has({.level = 6}));
  EXPECT_FALSE(TileLadder(13).Has({.level = 13}));
  EXPECT_FALSE(TileLadder(6).Has({.level = 6}));
}

class TileLadderCost : public ::testing::TestWithParam<int> {};

// A full tile of 4096 leaves of different times costs 9.1 B a leaf; a
// surveyed square cuts tiles at its border and divides coarser leaves about
// it. With tiles at 0/6/12/18 whatever the max_level, 7, 13 and 19 cost 55 B.
TEST_P(TileLadderCost, ALeafStaysSmallAtEveryMaxLevel) {
  const int max_level = GetParam();
  GlobalMap map = SurveyedMap(max_level, 300, 1000);
  const GlobalMapView view = map.View();
  ASSERT_EQ(map.options().root.max_level(), max_level);
  const double bytes = static_cast<double>(view.memory_bytes()) /
                       static_cast<double>(view.leaf_count());
  std::printf("max_level %d: %llu leaves, %llu tiles, %.2f B a leaf in RAM\n",
              max_level, static_cast<unsigned long long>(view.leaf_count()),
              static_cast<unsigned long long>(view.root_tile()->totals().tiles),
              bytes);
  EXPECT_LE(bytes, 12.0);
}

// Every cell is found where it was written.
TEST_P(TileLadderCost, PointsAndBoundsFindWhatWasWritten) {
  const int max_level = GetParam();
  GlobalMap map = SurveyedMap(max_level, 40, 1000);
  const GlobalMapView view = map.View();
  int finest = 0;
  view.ForEachLeaf([&](const CellKey& cell, const Leaf& leaf) {
    const auto found = view.LeafAt(view.root().Center(cell));
    ASSERT_TRUE(found.has_value());
    ASSERT_EQ(found->first, cell);
    ASSERT_EQ(found->second, leaf);
    const auto bounds = view.Bounds(cell);
    ASSERT_EQ(bounds.has_value(), leaf.known());
    if (bounds) {
      ASSERT_EQ(bounds->shoalest_m, leaf.depth_m);
    }
    if (cell.level == max_level && leaf.known()) ++finest;
  });
  // 40 x 40 less what the approximate square cuts or adds at the border.
  const int side = std::min(40, 1 << max_level);
  EXPECT_NEAR(finest, side * side, 4 * side);
}

INSTANTIATE_TEST_SUITE_P(MaxLevels, TileLadderCost,
                         ::testing::Values(5, 6, 7, 13, 19, 24));

}  // namespace
}  // namespace fathom::map
