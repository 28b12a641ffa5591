// Tile: an immutable piece of the quadtree, six levels deep, without pointers
// inside it.
//
// The leaves of a tile, in Z-order, are an array. Which of the 64 x 64
// positions belongs to which leaf is told by one bit per position, set where a
// leaf begins: a leaf's index is the number of set bits up to the position,
// less one (its rank), and its size the distance to the next set bit. The bits
// come in two layers, so that large leaves cost nothing below them:
//
//   whole    64 bits, one for each block of 8 x 8 positions: a leaf of that
//            size or larger begins here
//   divided  64 bits: the block holds smaller leaves; it has
//   words[k] 64 bits for the k-th divided block: a leaf begins at this position
//   ranks[k] leaves in the divided blocks before the k-th, 16 bits
//
// Finding a leaf costs three population counts and no loop, against one
// dependent step per level in a tree of nodes (see docs/adr/0002). A full tile
// of 4096 leaves spends 0.16 bytes a leaf on its shape.
//
// A slot of the finest size may hold a whole tile in place of a leaf; so does
// the tree reach from level 0 to 24 in four tiles. Tiles are shared between
// the writer and all views (shared_ptr: a tile lives as long as any of them
// knows it), and two views that share a tile are equal there.
//
// Thread safety: immutable, except settled() which only the map's writer reads
// and sets.

#ifndef FATHOM_MAP_GLOBAL_TILE_H_
#define FATHOM_MAP_GLOBAL_TILE_H_

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "map/global/cell_key.h"
#include "map/global/leaf.h"

namespace fathom::map {

// The std_code of a slot that holds a child tile (no leaf has it: kind 0).
inline constexpr std::uint16_t kChildCode = 1;

// A tile's own slots (without those of its children) as plain arrays of equal
// length in Z-order: what the tile codec stores. The levels alone determine
// the shape. There is exactly one content for a tile.
struct TileContent {
  // Levels below the tile's root, 0..6. They must cover the tile exactly.
  std::vector<std::uint8_t> levels;
  // Of a slot with a child tile and of an unknown leaf: 0.
  std::vector<float> depths_m;
  // See leaf.h; kChildCode for a child tile (level 6 only), 0 for unknown.
  std::vector<std::uint16_t> std_codes;
  // Of a slot with a child tile and of an unknown leaf: 0.
  std::vector<std::uint32_t> times_s;
  // Empty if all are 0.
  std::vector<std::uint8_t> residual_codes;

  friend bool operator==(const TileContent&, const TileContent&) = default;
};

// Sums over a tile and all tiles below it.
struct TileTotals {
  std::uint64_t leaves = 0;        // Unknown ones too.
  std::uint64_t known_leaves = 0;  // Prior, measured and land.
  std::uint64_t tiles = 0;
  std::uint64_t memory_bytes = 0;  // With allocator overhead (16 B a block).
  // Least and greatest depth that any known leaf stands for, its residual
  // included; +inf and -inf if none is known. Uncertainty is not included.
  float shoalest_m = std::numeric_limits<float>::infinity();
  float deepest_m = -std::numeric_limits<float>::infinity();
};

class Tile {
 public:
  // One slot: a leaf of `level` below the root, or a child tile.
  struct Slot {
    Leaf leaf;
    std::uint8_t level = 0;
    std::shared_ptr<const Tile> child;  // Null for a leaf.
  };

  // What lies at a position.
  struct Found {
    Leaf leaf;  // residual_code is left 0: see FindSlot.
    int level = 0;
    const Tile* child = nullptr;  // Not null: the leaf says nothing.
  };

  // Builds a tile from its slots in Z-order. `tolerance_m` is the map's: what
  // residual codes are measured in. REQUIRES: they cover the tile exactly.
  static std::shared_ptr<const Tile> Build(const TileKey& key,
                                           std::span<const Slot> slots,
                                           float tolerance_m);

  ~Tile() = default;
  Tile(const Tile&) = delete;
  Tile& operator=(const Tile&) = delete;

  const TileKey& key() const { return key_; }

  // Slots of this tile, 1..4096.
  std::uint32_t slot_count() const { return slot_count_; }

  // The leaf or child at a position. REQUIRES: position < 4096. About 5 ns.
  Found Find(std::uint32_t position) const;

  // Calls visit(position, slot index, level) for each slot in Z-order.
  template <typename Visitor>
  void ForEachSlot(Visitor visit) const;

  // The leaf of a slot, residual too. REQUIRES: slot < slot_count().
  Leaf LeafAt(std::uint32_t slot) const;
  bool IsChild(std::uint32_t slot) const;
  // The child tile of a slot. REQUIRES: IsChild(slot).
  const std::shared_ptr<const Tile>& ChildAt(std::uint32_t slot) const;

  // Child tiles in Z-order.
  std::span<const std::shared_ptr<const Tile>> children() const {
    return children_;
  }

  const TileTotals& totals() const { return totals_; }

  // Whether both have the same slots and leaves; children are compared by
  // place, not by what is in them.
  bool SameSlots(const Tile& other) const;

  // The plain arrays. O(slots).
  TileContent Content() const;

  // Whether conglomerating this tile and all below it changes nothing. Only
  // for the writer of the map; false is always right.
  bool settled() const { return settled_; }
  void set_settled(bool settled) const { settled_ = settled; }

 private:
  // One leaf in memory: 10 bytes, at any even address.
  static constexpr std::size_t kRecordBytes = 10;

  explicit Tile(const TileKey& key) : key_(key) {}
  friend class TileBuilder;

  std::uint32_t IndexOf(std::uint32_t position, int* level) const;
  static int LevelOfRun(std::uint64_t starts, unsigned start, int finest);

  const std::byte* Record(std::uint32_t slot) const {
    return records_ + slot * kRecordBytes;
  }

  TileKey key_;
  mutable bool settled_ = false;
  bool has_residuals_ = false;
  std::uint32_t slot_count_ = 0;
  std::uint64_t whole_ = 0;
  std::uint64_t divided_ = 0;
  // One allocation: words, ranks, records, residuals.
  std::unique_ptr<std::byte[]> bytes_;
  std::size_t byte_count_ = 0;
  const std::uint64_t* words_ = nullptr;
  const std::uint16_t* ranks_ = nullptr;  // One more than words.
  const std::byte* records_ = nullptr;
  const std::uint8_t* residuals_ = nullptr;  // Null if all are 0.
  std::vector<std::shared_ptr<const Tile>> children_;
  TileTotals totals_;
};

// Checks a stored content: array lengths, a shape that covers the tile
// exactly and goes no deeper than `max_level`, children only where they may be,
// codes and depths in range, canonical zeros.
// Errors: DATA_LOSS naming the tile and what is wrong.
absl::Status ValidateContent(const TileKey& key, const TileContent& content,
                             int max_level);

template <typename Visitor>
void Tile::ForEachSlot(Visitor visit) const {
  std::uint32_t slot = 0;
  for (std::uint32_t position = 0; position < kTileCells; ++slot) {
    int level = 0;
    IndexOf(position, &level);
    visit(position, slot, level);
    position += SpanOf(level);
  }
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_TILE_H_
