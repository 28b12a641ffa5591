#include "map/global/tile_memory.h"

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "tests/map/global/plain_codec.h"

namespace fathom::map {
namespace {

constexpr float kTolerance = 0.5f;

// A tile of 4 leaves, all of one depth.
std::unique_ptr<const Tile> FourLeaves(std::uint32_t col, float depth_m) {
  const std::vector<std::uint8_t> levels(4, 1);
  const std::vector<Leaf> leaves(
      4, {.depth_m = depth_m,
          .time_s = 7,
          .std_code = MakeStdCode(LeafKind::kPrior, 1.0f)});
  return Tile::Build({.level = 6, .row = 0, .col = col}, levels, leaves, {},
                     kTolerance);
}

class TileMemoryTest : public ::testing::Test {
 protected:
  using Slot = std::shared_ptr<const TileSlot>;

  void Budget(std::uint64_t tiles) {
    memory_ = std::make_shared<TileMemory>(
        TileMemoryOptions{.budget_bytes = tiles * tile_bytes_,
                          .codec = PlainCodec::Codec()},
        kTolerance);
  }
  Slot Add(std::uint32_t col, float depth_m) {
    return std::make_shared<const TileSlot>(memory_, FourLeaves(col, depth_m));
  }
  // Without touching.
  static float DepthIn(const Tile& tile) { return tile.LeafAt(0).depth_m; }

  const std::uint64_t tile_bytes_ = FourLeaves(0, 1)->memory_bytes();
  std::shared_ptr<TileMemory> memory_;
};

TEST_F(TileMemoryTest, APackedTileReadsTheSame) {
  Budget(0);
  const Slot slot = Add(5, 12.5f);
  const TileContent content = slot->tile().Content();
  const TileTotals totals = slot->tile().totals();
  EXPECT_TRUE(memory_->over_budget());
  // It has been read: the first round of the clock only takes note of it.
  EXPECT_TRUE(memory_->Evict());
  EXPECT_TRUE(slot->packed());
  EXPECT_FALSE(memory_->over_budget());
  EXPECT_EQ(slot->totals().leaves, totals.leaves);
  EXPECT_EQ(slot->totals().shoalest_m, 12.5f);
  EXPECT_EQ(slot->key(), (TileKey{.level = 6, .row = 0, .col = 5}));

  // A look unpacks for itself alone.
  EXPECT_EQ(slot->Look()->Content(), content);
  EXPECT_TRUE(slot->packed());

  EXPECT_EQ(slot->tile().Content(), content);
  EXPECT_FALSE(slot->packed());
  EXPECT_EQ(slot->tile().totals().memory_bytes, totals.memory_bytes);
}

TEST_F(TileMemoryTest, EncodesATileOnce) {
  Budget(0);
  const Slot slot = Add(5, 12.5f);
  const std::uint64_t before = PlainCodec::packs();
  for (int round = 0; round < 5; ++round) {
    (void)slot->tile();
    EXPECT_TRUE(memory_->Evict());
    EXPECT_FALSE(memory_->Evict());
  }
  EXPECT_EQ(PlainCodec::packs() - before, 1u);
}

TEST_F(TileMemoryTest, TheClockSparesWhatWasReadSinceItCame) {
  Budget(2);
  const Slot slots[] = {Add(0, 10), Add(1, 11), Add(2, 12), Add(3, 13)};
  (void)slots[0]->tile();
  (void)slots[2]->tile();
  EXPECT_TRUE(memory_->Evict());
  EXPECT_FALSE(slots[0]->packed());
  EXPECT_TRUE(slots[1]->packed());
  EXPECT_FALSE(slots[2]->packed());
  EXPECT_TRUE(slots[3]->packed());
  // Both have lost their mark; the hand stands at 0, and only 2 is read.
  (void)slots[2]->tile();
  const Slot fifth = Add(4, 14);
  EXPECT_TRUE(memory_->Evict());
  EXPECT_TRUE(slots[0]->packed());
  EXPECT_FALSE(slots[2]->packed());
  EXPECT_FALSE(fifth->packed());
}

// The hand passes 64 slots at a time: of 200 that all were read it goes a whole
// round, over pieces that have no victim, and then packs the first 150.
TEST_F(TileMemoryTest, GoesAsFarRoundTheClockAsItMust) {
  Budget(50);
  std::vector<Slot> slots;
  for (std::uint32_t i = 0; i < 200; ++i) {
    slots.push_back(Add(i, 10));
    (void)slots.back()->tile();
  }
  EXPECT_TRUE(memory_->Evict());
  EXPECT_EQ(memory_->Use().unpacked_tiles, 50u);
  for (std::size_t i = 0; i < slots.size(); ++i) {
    EXPECT_EQ(slots[i]->packed(), i < 150) << i;
  }
}

TEST_F(TileMemoryTest, EvictsNoMoreThanTheBudgetAsks) {
  Budget(2);
  std::vector<Slot> slots;
  for (std::uint32_t i = 0; i < 7; ++i) slots.push_back(Add(i, 10));
  EXPECT_TRUE(memory_->Evict());
  EXPECT_EQ(memory_->Use().unpacked_tiles, 2u);
  EXPECT_EQ(memory_->Use().packed_tiles, 5u);
}

TEST_F(TileMemoryTest, CountsWhatIsHeld) {
  Budget(1);
  {
    const Slot kept = Add(0, 10);
    std::optional<TileGuard> guard(std::in_place, memory_);
    const Slot packed = Add(1, 11);
    const std::uint64_t slots = memory_->Use().memory_bytes - 2 * tile_bytes_;
    // Beside the tiles: two slots of 100 to 250 bytes.
    EXPECT_GT(slots, 200u);
    EXPECT_LT(slots, 500u);
    (void)kept->tile();
    EXPECT_TRUE(memory_->Evict());
    ASSERT_TRUE(packed->packed());
    TileUse use = memory_->Use();
    EXPECT_EQ(use.budget_bytes, tile_bytes_);
    EXPECT_EQ(use.unpacked_tiles, 1u);
    EXPECT_EQ(use.packed_tiles, 1u);
    // The evicted one is still there for who holds the guard.
    EXPECT_EQ(use.unpacked_bytes, 2 * tile_bytes_);
    guard.reset();
    use = memory_->Use();
    EXPECT_EQ(use.unpacked_bytes, tile_bytes_);
    // Key, nine counts, and 4 leaves of 1 + 4 + 2 + 4 bytes: 124; the vector,
    // and two blocks of the allocator's: 56.
    EXPECT_EQ(use.packed_bytes, 8u + 9 * 8 + 4 * 11 + 56);
    EXPECT_EQ(use.memory_bytes, slots + tile_bytes_ + use.packed_bytes);
  }
  EXPECT_EQ(memory_->Use().memory_bytes, 0u);
  EXPECT_EQ(memory_->Use().unpacked_tiles, 0u);
  EXPECT_EQ(memory_->Use().packed_tiles, 0u);
}

TEST_F(TileMemoryTest, AGuardKeepsWhatIsReadUnderIt) {
  Budget(0);
  const Slot slot = Add(0, 10);
  std::optional<TileGuard> old(std::in_place, memory_);
  const Tile& first = slot->tile();
  EXPECT_TRUE(memory_->Evict());
  std::optional<TileGuard> newer(std::in_place, memory_);
  // Unpacked again, and read under the old guard too.
  const Tile& second = slot->tile();
  EXPECT_TRUE(memory_->Evict());
  std::optional<TileGuard> newest(std::in_place, memory_);
  EXPECT_EQ(memory_->Use().unpacked_bytes, 2 * tile_bytes_);
  // Whoever holds the old guard may have read both.
  newer.reset();
  EXPECT_EQ(memory_->Use().unpacked_bytes, 2 * tile_bytes_);
  EXPECT_EQ(DepthIn(first), 10);
  EXPECT_EQ(DepthIn(second), 10);
  old.reset();
  EXPECT_EQ(memory_->Use().unpacked_bytes, 0u);
  newest.reset();
}

// Of two that were there when it was evicted, the newer may go last.
TEST_F(TileMemoryTest, ANewerGuardKeepsItAfterTheOldest) {
  Budget(0);
  const Slot slot = Add(0, 10);
  std::optional<TileGuard> old(std::in_place, memory_);
  std::optional<TileGuard> newer(std::in_place, memory_);
  const Tile& tile = slot->tile();
  EXPECT_TRUE(memory_->Evict());
  old.reset();
  EXPECT_EQ(memory_->Use().unpacked_bytes, tile_bytes_);
  EXPECT_EQ(DepthIn(tile), 10);
  newer.reset();
  EXPECT_EQ(memory_->Use().unpacked_bytes, 0u);
}

TEST_F(TileMemoryTest, ANewGuardDoesNotKeepWhatWasEvictedBefore) {
  Budget(0);
  const Slot slot = Add(0, 10);
  std::optional<TileGuard> old(std::in_place, memory_);
  EXPECT_TRUE(memory_->Evict());
  const TileGuard newer(memory_);
  old.reset();
  EXPECT_EQ(memory_->Use().unpacked_bytes, 0u);
}

TEST_F(TileMemoryTest, ManyGuardsKeepABoundedNumberOfCopies) {
  Budget(0);
  const Slot slot = Add(0, 10);
  std::vector<std::unique_ptr<const TileGuard>> guards;
  for (int i = 0; i < 150'000; ++i) {
    guards.push_back(std::make_unique<const TileGuard>(memory_));
    (void)slot->tile();
    (void)memory_->Evict();
  }
  // Evicted again and again it would be there 150 000 times: 22 MB.
  constexpr std::uint64_t kMost = 16 << 20;
  const std::uint64_t held = memory_->Use().unpacked_bytes;
  EXPECT_GT(held, kMost);
  EXPECT_LE(held, kMost + 2 * tile_bytes_);
  EXPECT_FALSE(slot->packed());
  // The newest first: nothing may go before the oldest does.
  while (guards.size() > 1) guards.pop_back();
  EXPECT_EQ(memory_->Use().unpacked_bytes, held);
  guards.clear();
  EXPECT_EQ(memory_->Use().unpacked_bytes, tile_bytes_);
  EXPECT_TRUE(memory_->Evict());
  EXPECT_EQ(memory_->Use().unpacked_bytes, 0u);
}

TEST_F(TileMemoryTest, ATileWithChildrenStays) {
  Budget(0);
  const Slot child = Add(0, 10);
  std::vector<std::uint8_t> levels = {6, 6, 6, 6, 5, 5, 5, 4, 4, 4,
                                      3, 3, 3, 2, 2, 2, 1, 1, 1};
  std::vector<Leaf> leaves(levels.size());
  leaves[0] = {.std_code = kChildCode};
  const auto parent = std::make_shared<const TileSlot>(
      memory_, Tile::Build({.level = 0}, levels, leaves, {child}, kTolerance));
  EXPECT_TRUE(memory_->Evict());
  EXPECT_TRUE(child->packed());
  EXPECT_FALSE(parent->packed());
  // Reading goes through it, and unpacks.
  EXPECT_EQ(Tile::Descend(parent->tile(), 0, 0).leaf.depth_m, 10);
  EXPECT_FALSE(child->packed());
}

TEST_F(TileMemoryTest, TheRootStays) {
  Budget(0);
  const std::vector<std::uint8_t> levels(4, 1);
  const std::vector<Leaf> leaves(4);
  const auto root = std::make_shared<const TileSlot>(
      memory_, Tile::Build({}, levels, leaves, {}, kTolerance));
  EXPECT_FALSE(memory_->over_budget());
  EXPECT_FALSE(memory_->Evict());
  EXPECT_FALSE(root->packed());
}

TEST_F(TileMemoryTest, WithoutACodecNothingIsPacked) {
  memory_ = std::make_shared<TileMemory>(TileMemoryOptions{.budget_bytes = 0},
                                         kTolerance);
  const Slot slot = Add(0, 10);
  EXPECT_FALSE(memory_->Evict());
  EXPECT_FALSE(slot->packed());
}

TEST_F(TileMemoryTest, ATileMayComePacked) {
  Budget(1);
  const auto tile = FourLeaves(3, 10);
  const Slot slot = std::make_shared<const TileSlot>(
      memory_, tile->key(), tile->totals(),
      PlainCodec::Codec().pack(tile->key(), tile->Content()));
  EXPECT_TRUE(slot->packed());
  EXPECT_EQ(memory_->Use().packed_tiles, 1u);
  EXPECT_EQ(slot->tile().Content(), tile->Content());
  EXPECT_EQ(memory_->Use().packed_tiles, 0u);
  EXPECT_EQ(memory_->Use().unpacked_bytes, tile_bytes_);
}

TEST_F(TileMemoryTest, BytesThatChangedInMemoryEndTheProgram) {
  Budget(1);
  const auto tile = FourLeaves(3, 10);
  PackedTile packed = PlainCodec::Codec().pack(tile->key(), tile->Content());
  packed[8] ^= 1;  // The key.
  const Slot slot = std::make_shared<const TileSlot>(
      memory_, tile->key(), tile->totals(), std::move(packed));
  EXPECT_DEATH((void)slot->tile(), "");
}

TEST_F(TileMemoryTest, ASlotMayGoWhileItIsOnTheClock) {
  Budget(1);
  Slot slots[] = {Add(0, 10), Add(1, 11), Add(2, 12)};
  slots[0].reset();  // The one at the hand.
  EXPECT_TRUE(memory_->Evict());
  EXPECT_TRUE(slots[1]->packed());
  EXPECT_FALSE(slots[2]->packed());
  slots[2].reset();
  slots[1].reset();
  EXPECT_EQ(memory_->Use().memory_bytes, 0u);
}

}  // namespace
}  // namespace fathom::map
