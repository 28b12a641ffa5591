#include <gtest/gtest.h>

#include <set>

#include "map/global/global_map.h"
#include "tests/map/global/scene.h"

namespace fathom::map {
namespace {

class DiffTilesTest : public ::testing::Test {
 protected:
  DiffTilesTest() : root_(SquareOf(40960, 10.1)), map_({.root = root_}) {}

  void Measure(const CellKey& cell, float depth_m) {
    map_.MergeArea(root_.Corners(cell), 10.1, [&](const GeodeticPoint&) {
      return Measured(depth_m, 0.25f);
    });
  }

  struct Changes {
    std::vector<TileKey> written;
    std::vector<TileKey> gone;
  };
  static Changes Diff(const GlobalMapView& old, const GlobalMapView& now) {
    Changes changes;
    DiffTiles(old, now, [&](const TileKey& key, const Tile* tile) {
      if (tile != nullptr) {
        EXPECT_EQ(tile->key(), key);
        changes.written.push_back(key);
      } else {
        changes.gone.push_back(key);
      }
    });
    return changes;
  }

  RootSquare root_;
  GlobalMap map_;
  const CellKey cell_{.level = 12, .row = 1000, .col = 2000};
  // 1000 / 64 = 15, 2000 / 64 = 31.
  const TileKey below_{.level = 6, .row = 15, .col = 31};
};

TEST_F(DiffTilesTest, NothingChangedNothingVisited) {
  Measure(cell_, 10);
  const GlobalMapView view = map_.View();
  const auto changes = Diff(view, map_.View());
  EXPECT_TRUE(changes.written.empty());
  EXPECT_TRUE(changes.gone.empty());
}

TEST_F(DiffTilesTest, FromNothingEveryTileIsNewParentsFirst) {
  Measure(cell_, 10);
  const auto changes = Diff(GlobalMapView(), map_.View());
  EXPECT_EQ(changes.written, (std::vector<TileKey>{TileKey{}, below_}));
}

TEST_F(DiffTilesTest, AChangeBelowDoesNotRewriteTheParent) {
  Measure(cell_, 10);
  const GlobalMapView before = map_.View();
  Measure(cell_, 11);
  const auto changes = Diff(before, map_.View());
  EXPECT_EQ(changes.written, std::vector<TileKey>{below_});
  EXPECT_TRUE(changes.gone.empty());
}

TEST_F(DiffTilesTest, UntouchedNeighboursAreShared) {
  const CellKey other{.level = 12, .row = 3000, .col = 100};
  Measure(cell_, 10);
  Measure(other, 10);
  const GlobalMapView before = map_.View();
  Measure(other, 12);
  const GlobalMapView after = map_.View();
  EXPECT_EQ(Diff(before, after).written,
            (std::vector<TileKey>{{.level = 6, .row = 46, .col = 1}}));
  EXPECT_EQ(before.root_tile()->children().size(), 2u);
  EXPECT_EQ(before.root_tile()->children()[0],
            after.root_tile()->children()[0]);
}

TEST_F(DiffTilesTest, ATileThatCollapsedIsGone) {
  // All 64 x 64 cells of one tile, one depth.
  const CellKey whole = below_.Root();
  map_.MergeArea(root_.Corners(whole), 10.1,
                 [](const GeodeticPoint&) { return Measured(9, 0.2f); });
  const GlobalMapView before = map_.View();
  EXPECT_EQ(before.known_leaf_count(), 4096u);
  map_.Conglomerate();
  const auto changes = Diff(before, map_.View());
  EXPECT_EQ(changes.written, std::vector<TileKey>{TileKey{}});
  EXPECT_EQ(changes.gone, std::vector<TileKey>{below_});
}

TEST_F(DiffTilesTest, AChartThatMeetsOnlyMeasurementsIsNoChange) {
  Measure(cell_, 10);
  const GlobalMapView before = map_.View();
  ASSERT_TRUE(
      map_.ImportRaster(FlatRaster(root_.Corners(cell_)[1], 1e-6, 4, 4, 3, 1))
          .ok());
  EXPECT_EQ(map_.View().root_tile(), before.root_tile());
}

TEST_F(DiffTilesTest, WritingTheSameValuesAgainIsNoChange) {
  RasterBlock chart = FlatRaster(
      {.latitude_deg = 41.51, .longitude_deg = -71.31}, 0.0005, 40, 40, 20, 1);
  chart.replace = true;
  ASSERT_TRUE(map_.ImportRaster(chart).ok());
  const GlobalMapView before = map_.View();
  const auto again = map_.ImportRaster(chart);
  ASSERT_TRUE(again.ok());
  EXPECT_GT(again->leaves_written, 1000u);
  EXPECT_EQ(map_.View().root_tile(), before.root_tile());
}

TEST_F(DiffTilesTest, ANewTimeAloneIsAChange) {
  // The middle of both is the same; only the time differs.
  const auto survey = [&](std::uint32_t time_s) {
    GlobalMap map({.root = root_});
    map.MergeArea(root_.Corners(cell_), 10.1, [&](const GeodeticPoint&) {
      return Measured(10, 0.25f, time_s);
    });
    return map.View();
  };
  EXPECT_EQ(Diff(survey(100), survey(200)).written,
            std::vector<TileKey>{below_});
  EXPECT_TRUE(Diff(survey(100), survey(100)).written.empty());
}

TEST_F(DiffTilesTest, OldViewsKeepTheirAnswers) {
  Measure(cell_, 10);
  const GlobalMapView before = map_.View();
  Measure(cell_, 20);
  map_.Conglomerate();
  EXPECT_EQ(before.At(root_.Center(cell_))->depth_m, 10.0f);
  EXPECT_EQ(map_.View().At(root_.Center(cell_))->depth_m, 15.0f);
}

}  // namespace
}  // namespace fathom::map
