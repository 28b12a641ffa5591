// A map with a budget for its tiles beside one without: the same calls give
// the same answers, bit for bit, whatever is packed when.

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <deque>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "map/global/global_map.h"
#include "tests/map/global/plain_codec.h"
#include "tests/map/global/scene.h"

namespace fathom::map {
namespace {

// Some three full tiles, of some thirty.
constexpr std::uint64_t kBudgetBytes = 100'000;

TileMemoryOptions WithBudget(std::uint64_t budget_bytes) {
  return {.budget_bytes = budget_bytes, .codec = PlainCodec::Codec()};
}

// What is not known is a NaN, so bits are compared.
std::array<std::uint32_t, 9> BitsOf(const DepthEstimate& estimate) {
  const auto bits = [](float value) {
    return std::bit_cast<std::uint32_t>(value);
  };
  return {bits(estimate.depth_m),
          bits(estimate.std_m),
          bits(estimate.shoalest_m),
          bits(estimate.variability_m),
          bits(estimate.hazard_m),
          bits(estimate.cell_size_m),
          estimate.time_s,
          estimate.soundings,
          static_cast<std::uint32_t>(estimate.kind)};
}

struct Pair {
  GlobalMapView tight;
  GlobalMapView free;
};

std::vector<std::pair<TileKey, std::optional<TileContent>>> Diff(
    const GlobalMapView& old, const GlobalMapView& now) {
  std::vector<std::pair<TileKey, std::optional<TileContent>>> diff;
  DiffTiles(old, now, [&](const TileKey& key, const Tile* tile) {
    diff.emplace_back(key, tile == nullptr
                               ? std::nullopt
                               : std::optional<TileContent>(tile->Content()));
  });
  return diff;
}

class TileBudget : public ::testing::TestWithParam<std::uint32_t> {
 protected:
  TileBudget()
      : root_(SquareOf(20480, 10.1)),
        frame_(kNarragansett),
        tight_({.root = root_, .memory = WithBudget(kBudgetBytes)}),
        free_({.root = root_}),
        random_(GetParam()) {}

  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  bool Chance(double p) { return std::bernoulli_distribution(p)(random_); }
  GeodeticPoint Place() {
    return frame_.ToGeodetic(Uniform(-9000, 9000), Uniform(-9000, 9000));
  }

  // The same change of both maps.
  void Change() {
    const double north_m = Uniform(-8000, 8000);
    const double east_m = Uniform(-8000, 8000);
    const double half_m = Uniform(100, 1500);
    const double phase = Uniform(0, 6);
    const double slope = Chance(0.5) ? 0.0 : 0.01;
    const auto time_s = static_cast<std::uint32_t>(Uniform(1, 1e6));
    if (Chance(0.3)) {
      RasterBlock block =
          FlatRaster(frame_.ToGeodetic(north_m, east_m), 0.0002, 64, 64,
                     static_cast<float>(20 + 10 * slope), 1.5f);
      for (std::size_t i = 0; i < block.depth_m.size(); ++i) {
        block.depth_m[i] +=
            static_cast<float>(std::sin(phase + 0.1 * static_cast<double>(i)));
      }
      for (GlobalMap* map : {&tight_, &free_}) {
        EXPECT_TRUE(map->ImportRaster(block).ok());
      }
      return;
    }
    for (GlobalMap* map : {&tight_, &free_}) {
      map->MergeArea(Rectangle(frame_, north_m - half_m, north_m + half_m,
                               east_m - half_m, east_m + half_m),
                     10.1, [&](const GeodeticPoint& p) {
                       const NedPoint at = frame_.ToNed(p);
                       DepthEstimate estimate = Measured(
                           static_cast<float>(30 + slope * at.north_m +
                                              std::sin(phase + at.east_m / 50)),
                           0.4f, time_s);
                       if (std::fmod(at.north_m, 97) > 95) {
                         estimate.hazard_m = estimate.depth_m - 3;
                       }
                       return estimate;
                     });
    }
  }

  void ExpectSameAnswers(const Pair& views) {
    for (int i = 0; i < 200; ++i) {
      const GeodeticPoint place = Place();
      DepthEstimate tight;
      DepthEstimate free;
      const bool known = views.free.Read(place, free);
      ASSERT_EQ(views.tight.Read(place, tight), known);
      if (known) {
        ASSERT_EQ(BitsOf(tight), BitsOf(free));
      }
      ASSERT_EQ(views.tight.LeafAt(place), views.free.LeafAt(place));
    }
    for (int i = 0; i < 30; ++i) {
      const int level = std::uniform_int_distribution(0, 11)(random_);
      const auto side = std::uint32_t{1} << level;
      const CellKey cell{.level = static_cast<std::uint8_t>(level),
                         .row = std::uniform_int_distribution<std::uint32_t>(
                             0, side - 1)(random_),
                         .col = std::uniform_int_distribution<std::uint32_t>(
                             0, side - 1)(random_)};
      const auto tight = views.tight.Bounds(cell);
      const auto free = views.free.Bounds(cell);
      ASSERT_EQ(tight.has_value(), free.has_value());
      if (free) {
        ASSERT_EQ(tight->shoalest_m, free->shoalest_m);
        ASSERT_EQ(tight->deepest_m, free->deepest_m);
      }
    }
    const GeodeticPoint middle = Place();
    const auto box = root_.BoxAround(std::array{middle, Direct(middle, 45, 900),
                                                Direct(middle, 90, 900),
                                                Direct(middle, 135, 900)});
    if (box) {
      std::vector<std::pair<CellKey, Leaf>> leaves[2];
      const auto skip = [](const TileTotals& tile) {
        return tile.shoalest_m > 31;
      };
      for (int i = 0; i < 2; ++i) {
        (i == 0 ? views.tight : views.free)
            .ForEachLeafIn(
                *box,
                [&](const CellKey& cell, const Leaf& leaf) {
                  leaves[i].emplace_back(cell, leaf);
                },
                skip);
      }
      ASSERT_EQ(leaves[0], leaves[1]);
    }
    ASSERT_EQ(views.tight.leaf_count(), views.free.leaf_count());
    ASSERT_EQ(views.tight.known_leaf_count(), views.free.known_leaf_count());
  }

  RootSquare root_;
  NedFrame frame_;
  GlobalMap tight_;
  GlobalMap free_;
  std::mt19937 random_;
};

TEST_P(TileBudget, ChangesNoAnswer) {
  std::deque<Pair> held;
  const std::uint64_t unpacks = PlainCodec::unpacks();
  std::uint64_t most_packed = 0;
  for (int round = 0; round < 30; ++round) {
    Change();
    if (Chance(0.3)) {
      const auto tight = tight_.Conglomerate();
      const auto free = free_.Conglomerate();
      ASSERT_EQ(tight.merges, free.merges);
      ASSERT_EQ(tight.leaves_after, free.leaves_after);
    }
    if (Chance(0.2)) continue;
    const Pair now{tight_.View(), free_.View()};
    ASSERT_FALSE(tight_.over_budget());
    const TileUse use = now.tight.tile_use();
    most_packed = std::max(most_packed, use.packed_tiles);
    ExpectSameAnswers(now);
    ASSERT_EQ(LeavesOf(now.tight), LeavesOf(now.free));
    if (!held.empty()) {
      const Pair& old = held[std::uniform_int_distribution<std::size_t>(
          0, held.size() - 1)(random_)];
      // An old view answers as ever, and differs from the new one as ever.
      ExpectSameAnswers(old);
      const auto diff = Diff(old.free, now.free);
      ASSERT_EQ(Diff(old.tight, now.tight), diff);
      ASSERT_EQ(Diff(old.tight.AtRest(), now.tight), diff);
    }
    held.push_back(now);
    while (held.size() > 4 || (!held.empty() && Chance(0.3))) {
      held.erase(held.begin() + static_cast<std::ptrdiff_t>(
                                    std::uniform_int_distribution<std::size_t>(
                                        0, held.size() - 1)(random_)));
    }
  }
  EXPECT_GT(most_packed, 10u);
  EXPECT_GT(PlainCodec::unpacks() - unpacks, 100u);
  // With all views gone but the newest, the budget is kept.
  held.clear();
  const GlobalMapView last = tight_.View();
  EXPECT_LE(last.tile_use().unpacked_bytes, kBudgetBytes);
  // What is held for all is what one without a budget says that it needs.
  EXPECT_EQ(last.memory_bytes(), free_.View().memory_bytes());
  EXPECT_EQ(free_.View().tile_use().memory_bytes, free_.View().memory_bytes());
}

INSTANTIATE_TEST_SUITE_P(Seeds, TileBudget, ::testing::Range(1u, 5u));

class FullBudget : public ::testing::Test {
 protected:
  static constexpr double kHalfM = 3000;

  FullBudget()
      : map_({.root = SquareOf(20480, 10.1), .memory = WithBudget(0)}) {
    map_.MergeArea(Rectangle(frame_, -kHalfM, kHalfM, -kHalfM, kHalfM), 10.1,
                   [this](const GeodeticPoint& p) {
                     return Measured(
                         static_cast<float>(500 + frame_.ToNed(p).east_m / 10),
                         0.4f);
                   });
    map_.Conglomerate();
  }

  NedFrame frame_{kNarragansett};
  GlobalMap map_;
};

TEST_F(FullBudget, ConglomerateDoesNotOpenWhatIsSettled) {
  const GlobalMapView view = map_.View();
  ASSERT_GT(view.tile_use().packed_tiles, 50u);
  const std::uint64_t unpacks = PlainCodec::unpacks();
  map_.Conglomerate();
  EXPECT_EQ(PlainCodec::unpacks(), unpacks);
}

TEST_F(FullBudget, DiffDoesNotOpenWhatIsShared) {
  const GlobalMapView before = map_.View();
  map_.MergeArea(Rectangle(frame_, 0, 15, 0, 15), 10.1,
                 [](const GeodeticPoint&) { return Measured(10.0f, 0.4f); });
  const GlobalMapView after = map_.View();
  const std::uint64_t unpacks = PlainCodec::unpacks();
  int visited = 0;
  DiffTiles(before, after, [&](const TileKey&, const Tile*) { ++visited; });
  // At most the four tiles about the middle, before and after.
  EXPECT_GE(visited, 1);
  EXPECT_LE(PlainCodec::unpacks() - unpacks, 8u);
}

TEST_F(FullBudget, BoundsDoNotOpenATile) {
  const GlobalMapView view = map_.View();
  const std::uint64_t unpacks = PlainCodec::unpacks();
  const auto bounds = view.Bounds(CellKey{});
  ASSERT_TRUE(bounds.has_value());
  EXPECT_NEAR(bounds->shoalest_m, 500 - kHalfM / 10, 2);
  EXPECT_NEAR(bounds->deepest_m, 500 + kHalfM / 10, 2);
  EXPECT_EQ(PlainCodec::unpacks(), unpacks);
}

TEST_F(FullBudget, WhatIsSkippedIsNotOpened) {
  const GlobalMapView view = map_.View();
  const std::uint64_t unpacks = PlainCodec::unpacks();
  int leaves = 0;
  view.ForEachLeafIn(
      {.row_first = 0,
       .row_last = (1u << kMaxLevel) - 1,
       .col_first = 0,
       .col_last = (1u << kMaxLevel) - 1},
      [&](const CellKey&, const Leaf& leaf) { leaves += leaf.known(); },
      [](const TileTotals& tile) { return tile.tiles == 1; });
  EXPECT_EQ(leaves, 0);
  EXPECT_EQ(PlainCodec::unpacks(), unpacks);
}

TEST_F(FullBudget, AWalkThroughTheMapLeavesItPacked) {
  const GlobalMapView view = map_.View();
  const TileUse before = view.tile_use();
  std::uint64_t known = 0;
  view.ForEachLeaf(
      [&](const CellKey&, const Leaf& leaf) { known += leaf.known(); });
  EXPECT_EQ(known, view.known_leaf_count());
  EXPECT_EQ(view.tile_use().unpacked_tiles, 0u);
  EXPECT_EQ(view.tile_use().packed_tiles, before.packed_tiles);
}

TEST_F(FullBudget, ReadersAloneMakeAViewDue) {
  GlobalMapView view = map_.View();
  ASSERT_FALSE(map_.over_budget());
  ASSERT_TRUE(view.At(kNarragansett).has_value());
  EXPECT_TRUE(map_.over_budget());
  EXPECT_EQ(view.tile_use().unpacked_tiles, 1u);
  GlobalMapView next = map_.View();
  EXPECT_FALSE(map_.over_budget());
  EXPECT_EQ(next.tile_use().unpacked_tiles, 0u);
  // The old view keeps what was read through it, until it goes.
  EXPECT_GT(next.tile_use().unpacked_bytes, 0u);
  view = {};
  EXPECT_EQ(next.tile_use().unpacked_bytes, 0u);
}

TEST_F(FullBudget, AViewAtRestKeepsNoTileThatIsEvicted) {
  GlobalMapView view = map_.View();
  const std::uint64_t leaves = view.leaf_count();
  const GlobalMapView rest = view.AtRest();
  (void)view.At(kNarragansett);
  view = map_.View();
  EXPECT_EQ(view.tile_use().unpacked_bytes, 0u);
  EXPECT_EQ(rest.leaf_count(), leaves);
  EXPECT_TRUE(Diff(rest, view).empty());
}

}  // namespace
}  // namespace fathom::map
