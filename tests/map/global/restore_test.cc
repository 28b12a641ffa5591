#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "map/global/global_map.h"
#include "tests/map/global/scene.h"
#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

struct StoredTile {
  TileKey key;
  TileContent content;
};

class Restore : public ::testing::Test {
 protected:
  Restore() : options_{.root = SquareOf(40960, 1.0)}, map_(options_) {
    Survey(map_, 0);
    map_.Conglomerate();
    Survey(map_, 1);  // Some of it not yet conglomerated.
    map_.View().ForEachTile([&](const Tile& tile) {
      stored_.push_back({tile.key(), tile.Content()});
    });
  }

  static void Survey(GlobalMap& map, int round) {
    const NedFrame frame(Direct(kNarragansett, 90.0 * round, 4000.0 * round));
    map.MergeArea(Rectangle(frame, -90, 120, -60, 90), 2.0,
                  [&frame](const GeodeticPoint& p) {
                    const NedPoint ned = frame.ToNed(p);
                    return Measured(
                        static_cast<float>(30 + 2 * std::sin(ned.north_m / 30) +
                                           0.01 * ned.east_m),
                        0.4f);
                  });
  }

  absl::Status RestoreInto(GlobalMap& map) {
    for (const StoredTile& tile : stored_) {
      if (auto status = map.RestoreTile(tile.key, tile.content); !status.ok()) {
        return status;
      }
    }
    return map.FinishRestore();
  }

  GlobalMapOptions options_;
  GlobalMap map_;
  std::vector<StoredTile> stored_;
};

TEST_F(Restore, GivesTheSameLeavesInAnyOrder) {
  ASSERT_GT(stored_.size(), 4u);
  std::reverse(stored_.begin(), stored_.end());
  GlobalMap again(options_);
  ASSERT_THAT(RestoreInto(again), IsOk());
  const GlobalMapView before = map_.View();
  const GlobalMapView after = again.View();
  EXPECT_EQ(LeavesOf(after), LeavesOf(before));
  EXPECT_EQ(after.leaf_count(), before.leaf_count());
  EXPECT_EQ(again.leaf_count(), before.leaf_count());
  EXPECT_EQ(after.memory_bytes(), before.memory_bytes());
  EXPECT_EQ(after.Bounds({})->shoalest_m, before.Bounds({})->shoalest_m);
}

TEST_F(Restore, WhatFollowsIsTheSameToo) {
  GlobalMap again(options_);
  ASSERT_THAT(RestoreInto(again), IsOk());
  for (GlobalMap* map : {&map_, &again}) {
    Survey(*map, 1);
    map->Conglomerate();
    Survey(*map, 2);
    map->Conglomerate();
  }
  EXPECT_EQ(LeavesOf(again.View()), LeavesOf(map_.View()));
}

TEST_F(Restore, NothingStoredIsAnEmptyMap) {
  stored_.clear();
  GlobalMap again(options_);
  ASSERT_THAT(RestoreInto(again), IsOk());
  EXPECT_EQ(again.leaf_count(), 1u);
}

TEST_F(Restore, AMissingTileIsDataLoss) {
  stored_.pop_back();
  GlobalMap again(options_);
  EXPECT_THAT(RestoreInto(again),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("is missing")));
  EXPECT_EQ(again.leaf_count(), 1u);
}

TEST_F(Restore, AMissingRootIsDataLoss) {
  stored_.erase(stored_.begin());
  GlobalMap again(options_);
  EXPECT_THAT(RestoreInto(again),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("root tile")));
}

TEST_F(Restore, AnOrphanIsDataLoss) {
  StoredTile orphan = stored_.back();
  // The square's north-west corner, where nothing was surveyed.
  orphan.key.row = 0;
  orphan.key.col = 0;
  stored_.push_back(orphan);
  GlobalMap again(options_);
  EXPECT_THAT(RestoreInto(again),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("hangs on")));
}

TEST_F(Restore, ATileGivenTwiceIsDataLoss) {
  stored_.push_back(stored_.back());
  GlobalMap again(options_);
  EXPECT_THAT(RestoreInto(again),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("twice")));
}

TEST_F(Restore, ABrokenTileIsDataLoss) {
  stored_.back().content.levels.pop_back();
  GlobalMap again(options_);
  EXPECT_THAT(RestoreInto(again), StatusIs(absl::StatusCode::kDataLoss));
}

}  // namespace
}  // namespace fathom::map
