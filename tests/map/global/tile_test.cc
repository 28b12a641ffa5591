#include "map/global/tile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <random>

#include "map/global/tile_memory.h"
#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

constexpr float kTolerance = 0.5f;

Leaf Prior(float depth_m) {
  return {.depth_m = depth_m,
          .time_s = 7,
          .std_code = MakeStdCode(LeafKind::kPrior, 1.0f)};
}

struct Slots {
  std::vector<std::uint8_t> levels;
  std::vector<Leaf> leaves;

  std::shared_ptr<const Tile> Build() const {
    return Tile::Build(TileKey{}, levels, leaves, {}, kTolerance);
  }
};

// A random shape: each cell above level 6 is divided with the given chance.
// Every leaf has its own depth; every seventh is unknown.
Slots RandomSlots(std::uint32_t seed, double divide) {
  std::mt19937 random(seed);
  std::bernoulli_distribution divides(divide);
  Slots slots;
  const std::function<void(int)> grow = [&](int level) {
    if (level < kTileLevels && divides(random)) {
      for (int i = 0; i < 4; ++i) grow(level + 1);
      return;
    }
    const auto n = static_cast<float>(slots.leaves.size());
    slots.levels.push_back(static_cast<std::uint8_t>(level));
    slots.leaves.push_back(slots.leaves.size() % 7 == 6 ? Leaf{} : Prior(n));
  };
  grow(0);
  return slots;
}

TEST(Tile, FindsTheLeafThatCoversEachPosition) {
  // Oracle: walk the slots and count positions.
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    const Slots slots = RandomSlots(seed, 0.3 + 0.7 * (seed % 10) / 9.0);
    const auto tile = slots.Build();
    ASSERT_EQ(tile->slot_count(), slots.levels.size());
    std::uint32_t position = 0;
    for (std::size_t i = 0; i < slots.levels.size(); ++i) {
      for (std::uint32_t n = SpanOf(slots.levels[i]); n > 0; --n, ++position) {
        const Tile::Found found = tile->Find(position);
        ASSERT_EQ(found.leaf, slots.leaves[i]) << seed << " " << position;
        ASSERT_EQ(found.level, slots.levels[i]) << seed << " " << position;
        ASSERT_EQ(found.child, nullptr);
      }
    }
    ASSERT_EQ(position, kTileCells);
  }
}

TEST(Tile, VisitsSlotsInZOrder) {
  const Slots slots = RandomSlots(11, 0.8);
  std::uint32_t expected_position = 0;
  std::uint32_t expected_slot = 0;
  slots.Build()->ForEachSlot(
      [&](std::uint32_t position, std::uint32_t slot, int level) {
        EXPECT_EQ(position, expected_position);
        EXPECT_EQ(slot, expected_slot++);
        EXPECT_EQ(level, slots.levels[slot]);
        expected_position += SpanOf(level);
      });
  EXPECT_EQ(expected_position, kTileCells);
}

TEST(Tile, AFullOneSpendsLittleOnItsShape) {
  const Slots slots = RandomSlots(1, 1.0);
  const auto tile = slots.Build();
  ASSERT_EQ(tile->slot_count(), 4096u);
  // 6 B a leaf as all have one time; 65 blocks of 4 B, the tile itself and two
  // allocations: (24576 + 260 + 104 + 56) / 4096 = 6.1.
  EXPECT_LT(static_cast<double>(tile->totals().memory_bytes) / 4096, 6.11);
}

TEST(Tile, TimesThatDifferCostThreeBytesALeafAndAYearApartFour) {
  Slots slots = RandomSlots(1, 1.0);
  const auto one = slots.Build();
  EXPECT_EQ(one->LeafAt(100).time_s, 7u);
  EXPECT_EQ(one->LeafAt(6).time_s, 0u);  // Unknown.
  slots.leaves[100].time_s = 9;
  const auto two = slots.Build();
  EXPECT_EQ(two->totals().memory_bytes - one->totals().memory_bytes,
            3u * 4096u);
  EXPECT_EQ(two->LeafAt(100).time_s, 9u);
  EXPECT_EQ(two->LeafAt(101).time_s, 7u);
  EXPECT_EQ(two->LeafAt(6).time_s, 0u);
  EXPECT_FALSE(one->SameSlots(*two));
  // 2^24 - 2 seconds are the longest span of three bytes.
  slots.leaves[100].time_s = 7 + 0xfffffe;
  slots.leaves[102].time_s = 0;
  const auto edge = slots.Build();
  EXPECT_EQ(edge->totals().memory_bytes, two->totals().memory_bytes);
  EXPECT_EQ(edge->LeafAt(100).time_s, 7u + 0xfffffe);
  EXPECT_EQ(edge->LeafAt(101).time_s, 7u);
  EXPECT_EQ(edge->LeafAt(102).time_s, 0u);
  EXPECT_EQ(edge->Find(4095).leaf.time_s, slots.leaves[4095].time_s);
  slots.leaves[100].time_s = 7 + 0xffffff;
  const auto wide = slots.Build();
  EXPECT_EQ(wide->totals().memory_bytes - one->totals().memory_bytes,
            4u * 4096u);
  EXPECT_EQ(wide->LeafAt(100).time_s, 7u + 0xffffff);
  EXPECT_EQ(wide->LeafAt(101).time_s, 7u);
}

TEST(Tile, KeepsResidualsOnlyWhereThereAreAny) {
  Slots slots = RandomSlots(1, 1.0);
  const auto without = slots.Build();
  slots.leaves[100].residual_code = 9;
  const auto with = slots.Build();
  EXPECT_EQ(with->totals().memory_bytes - without->totals().memory_bytes,
            4096u);
  EXPECT_EQ(with->LeafAt(100).residual_code, 9);
  EXPECT_EQ(with->LeafAt(101).residual_code, 0);
}

TEST(Tile, KeepsSpreadsAndHazardsOnlyWhereThereAreAny) {
  Slots slots = RandomSlots(1, 1.0);
  const auto without = slots.Build();
  slots.leaves[4095].spread_code = 9;
  const auto spread = slots.Build();
  EXPECT_EQ(spread->totals().memory_bytes - without->totals().memory_bytes,
            4096u);
  // Six bytes a hazard.
  slots.leaves[0].hazard_m = -2.5f;
  slots.leaves[100].hazard_m = 3.25f;
  slots.leaves[4095].hazard_m = 4.0f;
  const auto hazards = slots.Build();
  EXPECT_EQ(hazards->totals().memory_bytes - spread->totals().memory_bytes,
            18u);
  for (std::uint32_t slot = 0; slot < 4096; ++slot) {
    ASSERT_EQ(hazards->LeafAt(slot), slots.leaves[slot]) << slot;
    ASSERT_EQ(hazards->Find(slot).leaf, slots.leaves[slot]) << slot;
  }
  EXPECT_FALSE(hazards->SameSlots(*spread));
  EXPECT_FALSE(spread->SameSlots(*without));
}

TEST(Tile, AHazardIsTheShoalestDepth) {
  Slots slots{.levels = {1, 1, 1, 1},
              .leaves = {Prior(10), Prior(12), Leaf{}, Prior(11)}};
  slots.leaves[1].hazard_m = 2.5f;
  const TileTotals totals = slots.Build()->totals();
  EXPECT_EQ(totals.shoalest_m, 2.5f);
  EXPECT_EQ(totals.deepest_m, 12.0f);
}

TEST(Tile, IsTheSameOnlyInEveryField) {
  const Slots slots = RandomSlots(3, 0.9);
  const auto tile = slots.Build();
  EXPECT_TRUE(tile->SameSlots(*slots.Build()));
  Slots later = slots;
  for (Leaf& leaf : later.leaves) {
    if (leaf.known()) leaf.time_s = 8;
  }
  EXPECT_FALSE(tile->SameSlots(*later.Build()));
  Slots deeper = slots;
  deeper.leaves[0].depth_m += 1;
  EXPECT_FALSE(tile->SameSlots(*deeper.Build()));
  Slots less_sure = slots;
  less_sure.leaves[0].std_code += 1;
  EXPECT_FALSE(tile->SameSlots(*less_sure.Build()));
  Slots merged = slots;
  merged.leaves[0].residual_code = 1;
  EXPECT_FALSE(tile->SameSlots(*merged.Build()));
}

TEST(Tile, TotalsHoldWhatLiesBelow) {
  Slots slots{.levels = {1, 1, 1, 1},
              .leaves = {Prior(10), Prior(12), Leaf{}, Prior(11)}};
  // 51 / 255 of 0.5 m: 0.1 m to each side.
  slots.leaves[0].residual_code = 51;
  const TileTotals totals = slots.Build()->totals();
  EXPECT_EQ(totals.leaves, 4u);
  EXPECT_EQ(totals.known_leaves, 3u);
  EXPECT_FLOAT_EQ(totals.shoalest_m, 9.9f);
  EXPECT_FLOAT_EQ(totals.deepest_m, 12.0f);
}

TEST(Tile, LeadsToItsChildren) {
  const TileKey child_key{.level = 6, .row = 0, .col = 1};
  const Slots below{.levels = {1, 1, 1, 1},
                    .leaves = {Prior(1), Prior(2), Prior(3), Prior(4)}};
  const auto child = std::make_shared<const TileSlot>(
      std::make_shared<TileMemory>(TileMemoryOptions{}, kTolerance),
      Tile::Build(child_key, below.levels, below.leaves, {}, kTolerance));
  // Level 6 cells 0..3 (the second is the child), then whatever is left.
  Slots slots;
  slots.levels = {6, 6, 6, 6, 5, 5, 5, 4, 4, 4, 3, 3, 3, 2, 2, 2, 1, 1, 1};
  slots.leaves.assign(slots.levels.size(), Prior(9));
  slots.leaves[1] = {.std_code = kChildCode};
  const auto tile =
      Tile::Build(TileKey{}, slots.levels, slots.leaves, {child}, kTolerance);
  EXPECT_EQ(tile->Find(1).child, child.get());
  EXPECT_EQ(tile->Find(0).child, nullptr);
  EXPECT_EQ(tile->totals().leaves, 18u + 4u);
  EXPECT_EQ(tile->totals().tiles, 2u);
  EXPECT_EQ(tile->totals().shoalest_m, 1.0f);
  // Lattice column 2^18 is where level-6 cell (0, 1) begins: its NW quarter.
  const Tile::Found found = Tile::Descend(*tile, 0, 1u << 18);
  EXPECT_EQ(found.leaf.depth_m, 1.0f);
  EXPECT_EQ(found.level, 7);
}

TEST(TileContent, RoundTripsThroughValidation) {
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    Slots slots = RandomSlots(seed, 0.85);
    if (seed % 2 == 1) {
      slots.leaves[0].residual_code = 200;
      slots.leaves[0].spread_code = 30;
      slots.leaves[0].hazard_m = 1.5f;
    }
    const auto tile = slots.Build();
    const TileContent content = tile->Content();
    EXPECT_EQ(content.levels, slots.levels);
    EXPECT_EQ(content.residual_codes.empty(), seed % 2 == 0);
    EXPECT_EQ(content.spread_codes.empty(), seed % 2 == 0);
    EXPECT_EQ(content.hazard_slots.empty(), seed % 2 == 0);
    EXPECT_THAT(ValidateContent(TileKey{}, content, 24), IsOk());
  }
}

class BadContent : public ::testing::Test {
 protected:
  BadContent()
      : content_(Slots{.levels = {1, 1, 1, 1},
                       .leaves = {Prior(1), Prior(2), Leaf{}, Prior(4)}}
                     .Build()
                     ->Content()) {}

  void ExpectRefused(const char* text, TileKey key = {}, int max_level = 24) {
    EXPECT_THAT(ValidateContent(key, content_, max_level),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr(text)));
  }

  TileContent content_;
};

TEST_F(BadContent, StartsOutGood) {
  EXPECT_THAT(ValidateContent({}, content_, 24), IsOk());
}

TEST_F(BadContent, ShortArray) {
  content_.times_s.pop_back();
  ExpectRefused("different lengths");
}

TEST_F(BadContent, ShapeThatLeavesAHole) {
  content_.levels[3] = 2;
  ExpectRefused("do not fill");
}

TEST_F(BadContent, ShapeThatIsNotAligned) {
  content_.levels = {2, 1, 1, 1};
  ExpectRefused("does not fit");
}

TEST_F(BadContent, ShapeDeeperThanTheMap) {
  ExpectRefused("does not fit", {}, 0);
}

TEST_F(BadContent, KeyOutsideTheMap) {
  ExpectRefused("no tile", {.level = 6, .row = 64, .col = 0});
  ExpectRefused("no tile", {.level = 5});
  ExpectRefused("no tile", {.level = 12}, 12);
}

TEST_F(BadContent, DepthThatIsNoNumber) {
  content_.depths_m[0] = std::numeric_limits<float>::quiet_NaN();
  ExpectRefused("slot 0");
}

TEST_F(BadContent, StdOutsideItsCode) {
  content_.std_codes[0] |= 0x3fff;
  ExpectRefused("slot 0");
}

TEST_F(BadContent, UnknownLeafWithAValue) {
  content_.depths_m[2] = 5;
  ExpectRefused("not canonical");
}

TEST_F(BadContent, ChildAboveTheFinestLevel) {
  content_.std_codes[2] = kChildCode;
  ExpectRefused("not canonical");
}

TEST_F(BadContent, SpreadsThatAreAllZero) {
  content_.spread_codes.assign(4, 0);
  ExpectRefused("all zero");
}

TEST_F(BadContent, HazardsThatDoNotFit) {
  content_.hazard_slots = {2};  // Unknown.
  content_.hazards_m = {1.0f};
  ExpectRefused("does not fit");
  content_.hazard_slots = {1, 0};  // Not ascending.
  content_.hazards_m = {1.0f, 1.0f};
  ExpectRefused("does not fit");
  content_.hazard_slots = {4};  // No such slot.
  content_.hazards_m = {1.0f};
  ExpectRefused("does not fit");
  content_.hazard_slots = {1};
  content_.hazards_m = {std::numeric_limits<float>::infinity()};
  ExpectRefused("does not fit");
  content_.hazards_m = {};
  ExpectRefused("different lengths");
}

TEST_F(BadContent, ResidualsThatAreAllZero) {
  content_.residual_codes.assign(4, 0);
  ExpectRefused("all zero");
}

}  // namespace
}  // namespace fathom::map
