// What a leaf costs on disk, whatever the map's max_level is.

#include <gtest/gtest.h>

#include <cstdio>

#include "storage/tile_codec.h"
#include "tests/map/global/scene.h"

namespace fathom::storage {
namespace {

class TileSize : public ::testing::TestWithParam<int> {};

// Rows of SQLite take some bytes more: 12 a tile. With tiles at levels 0, 6, 12
// and 18 whatever the max_level, 7, 13 and 19 took 17 bytes a leaf.
TEST_P(TileSize, ALeafTakesAtMostSixBytesOnDisk) {
  map::GlobalMap map = map::SurveyedMap(GetParam(), 300, 1000);
  const map::GlobalMapView view = map.View();
  std::uint64_t bytes = 0;
  view.ForEachTile([&bytes](const map::Tile& tile) {
    bytes += 12 + EncodeTile(tile.key(), tile.Content()).size();
  });
  const double per_leaf =
      static_cast<double>(bytes) / static_cast<double>(view.leaf_count());
  std::printf("max_level %d: %.2f B a leaf on disk\n", GetParam(), per_leaf);
  EXPECT_LE(per_leaf, 6.0);
}

INSTANTIATE_TEST_SUITE_P(MaxLevels, TileSize,
                         ::testing::Values(5, 6, 7, 13, 19, 24));

}  // namespace
}  // namespace fathom::storage
