#include "map/global/global_map_view.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "map/global/global_map.h"
#include "tests/map/global/scene.h"
#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

// Seabed of several kinds and sizes of leaf over two layers of tiles.
class ViewTest : public ::testing::Test {
 protected:
  ViewTest() : root_(SquareOf(40960, 10.1)), map_({.root = root_}) {
    RasterBlock chart = FlatRaster(
        {.latitude_deg = 41.6, .longitude_deg = -71.4}, 0.002, 60, 60, 30, 2);
    for (std::size_t i = 0; i < chart.depth_m.size(); ++i) {
      chart.depth_m[i] += static_cast<float>(i % 60) / 10;
      chart.land.push_back(i % 17 == 0);
    }
    map_.ImportRaster(chart).value();
    map_.MergeArea(
        Rectangle(NedFrame(kNarragansett), -700, 900, -300, 800), 10.1,
        [](const GeodeticPoint& p) {
          return Measured(
              static_cast<float>(20 + 3 * std::sin(p.latitude_deg * 4000)),
              0.3f);
        });
    map_.Conglomerate();
    view_ = map_.View();
  }

  RootSquare root_;
  GlobalMap map_;
  GlobalMapView view_;
};

TEST_F(ViewTest, AtAgreesWithTheListOfLeaves) {
  const Leaves leaves = LeavesOf(view_);
  EXPECT_EQ(leaves.size(), view_.leaf_count());
  std::mt19937 random(1);
  std::uniform_real_distribution<double> spread(-0.19, 0.19);
  int known = 0;
  for (int i = 0; i < 20000; ++i) {
    const GeodeticPoint p{.latitude_deg = 41.5 + spread(random),
                          .longitude_deg = -71.3 + spread(random)};
    // Oracle: the cell of each level that holds the point; one is a leaf.
    const Leaf* expected = nullptr;
    int level = 0;
    for (; level <= root_.max_level() && expected == nullptr; ++level) {
      const auto cell = root_.Locate(p, level);
      if (!cell) break;
      const auto it = leaves.find(*cell);
      if (it != leaves.end()) expected = &it->second;
    }
    const auto answer = view_.At(p);
    if (expected == nullptr || !expected->known()) {
      ASSERT_FALSE(answer);
      continue;
    }
    ++known;
    ASSERT_TRUE(answer);
    ASSERT_EQ(answer->depth_m, expected->depth_m);
    ASSERT_EQ(answer->std_m, expected->std_m());
    ASSERT_EQ(answer->kind, ToEvidenceKind(expected->kind()));
    ASSERT_EQ(answer->time_s, expected->time_s);
    ASSERT_FLOAT_EQ(answer->cell_size_m,
                    static_cast<float>(root_.cell_size_m(level - 1)));
    ASSERT_EQ(view_.LeafAt(p)->second, *expected);
  }
  EXPECT_GT(known, 2000);
}

TEST_F(ViewTest, LeavesComeInZOrderAndFillTheSquare) {
  // In lattice cells of level 24 each leaf covers a run; the runs join up.
  std::uint64_t next = 0;
  view_.ForEachLeaf([&](const CellKey& cell, const Leaf&) {
    std::uint64_t z = 0;
    for (int bit = 0; bit < cell.level; ++bit) {
      z |= std::uint64_t{(cell.row >> bit) & 1} << (2 * bit + 1);
      z |= std::uint64_t{(cell.col >> bit) & 1} << (2 * bit);
    }
    const int up = 2 * (24 - cell.level);
    ASSERT_EQ(z << up, next);
    next += std::uint64_t{1} << up;
  });
  EXPECT_EQ(next, std::uint64_t{1} << 48);
}

TEST_F(ViewTest, BoundsHoldEveryLeafBelow) {
  const Leaves leaves = LeavesOf(view_);
  std::mt19937 random(2);
  for (int i = 0; i < 400; ++i) {
    const int level = static_cast<int>(random() % 13);
    // Around the middle, where the leaves are.
    const std::uint32_t half = level == 0 ? 0 : 1u << (level - 1);
    const auto near = [&] {
      const std::uint32_t reach = 1 + half / 4;
      const std::uint32_t at =
          half + static_cast<std::uint32_t>(random()) % (2 * reach);
      return std::min(at > reach ? at - reach : 0, (1u << level) - 1);
    };
    const CellKey cell{.level = static_cast<std::uint8_t>(level),
                       .row = near(),
                       .col = near()};
    float shoalest = std::numeric_limits<float>::infinity();
    float deepest = -shoalest;
    for (const auto& [key, leaf] : leaves) {
      const int common = std::min(key.level, cell.level);
      if (key.row >> (key.level - common) !=
              cell.row >> (cell.level - common) ||
          key.col >> (key.level - common) !=
              cell.col >> (cell.level - common) ||
          !leaf.known()) {
        continue;
      }
      const float residual = DecodeResidualM(leaf.residual_code, 0.5f);
      shoalest = std::min(shoalest, leaf.depth_m - residual);
      deepest = std::max(deepest, leaf.depth_m + residual);
    }
    const auto bounds = view_.Bounds(cell);
    ASSERT_EQ(bounds.has_value(), shoalest <= deepest);
    if (bounds) {
      ASSERT_EQ(bounds->shoalest_m, shoalest);
      ASSERT_EQ(bounds->deepest_m, deepest);
    }
  }
}

TEST_F(ViewTest, PointsOutsideAndNonsenseHaveNoAnswer) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(view_.At({.latitude_deg = 10, .longitude_deg = 10}));
  EXPECT_FALSE(view_.At({.latitude_deg = nan, .longitude_deg = -71.3}));
  EXPECT_FALSE(view_.LeafAt({.latitude_deg = -41.5, .longitude_deg = 108.7}));
}

TEST(GlobalMapViewTest, ADefaultMadeViewKnowsNothing) {
  const GlobalMapView view;
  EXPECT_FALSE(view.At(kNarragansett));
  EXPECT_FALSE(view.Bounds(CellKey{}));
  EXPECT_EQ(view.leaf_count(), 0u);
  EXPECT_EQ(view.memory_bytes(), 0u);
}

TEST(GlobalMapViewTest, AnEmptyMapIsOneUnknownLeaf) {
  GlobalMap map({.root = ThesisSquare()});
  const GlobalMapView view = map.View();
  EXPECT_EQ(view.leaf_count(), 1u);
  EXPECT_EQ(view.known_leaf_count(), 0u);
  EXPECT_FALSE(view.At(kNarragansett));
  EXPECT_FALSE(view.Bounds(CellKey{}));
  const auto leaf = view.LeafAt(kNarragansett);
  ASSERT_TRUE(leaf);
  EXPECT_EQ(leaf->first, CellKey{});
  EXPECT_FALSE(leaf->second.known());
}

TEST(GlobalMapOptionsTest, RefusesWhatMakesNoMap) {
  const auto invalid = [](const char* text) {
    return StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(text));
  };
  const GlobalMapOptions good{.root = ThesisSquare()};
  EXPECT_TRUE(good.Validate().ok());
  EXPECT_THAT(GlobalMapOptions{}.Validate(), invalid("root"));
  EXPECT_THAT((GlobalMapOptions{.root = good.root, .max_cells = 0}.Validate()),
              invalid("max_cells"));
  for (const double bad :
       {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THAT(
        (GlobalMapOptions{.root = good.root, .tolerance_m = bad}.Validate()),
        invalid("tolerance_m"));
  }
}

}  // namespace
}  // namespace fathom::map
