// Tile: an immutable piece of the quadtree, six levels deep, without pointers
// inside it.
//
// The leaves of a tile, in Z-order, are an array. Which leaf covers a position
// is told by bits, in two layers, so that large leaves cost nothing below them:
//
//   whole    64 bits, one for each block of 8 x 8 positions: a leaf of that
//            size or larger begins here
//   divided  64 bits: the block holds smaller leaves; it then has 32 bits:
//     0-15     the 2 x 2 positions at this place are four leaves
//     16-19    the quarter of the block is divided
//     20-31    its rank: leaves in the divided blocks before it
//
// A leaf's index is the number of leaves that begin before it: the bits of
// `whole` up to its block, the rank, and, as every division puts four leaves in
// the place of one, three for every set bit before it in the block. That is
// three population counts and no loop, against one dependent step per level in
// a tree of nodes (see docs/adr/0002). A full tile of 4096 leaves spends 0.06
// bytes a leaf on its shape; no tile more than 1 byte (4 leaves a block), its
// header of 100 bytes aside.
//
// A slot of the finest size that the tile spans (TileLadder::LevelsOf) may hold
// a whole tile in place of a leaf; so does the tree reach from level 0 to 24 in
// four tiles. It hangs there in a TileSlot (tile_memory.h), which the writer
// and all views that have the tile share; two views that share a slot are equal
// there.
//
// Thread safety: immutable.

#ifndef FATHOM_MAP_GLOBAL_TILE_H_
#define FATHOM_MAP_GLOBAL_TILE_H_

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <new>
#include <span>
#include <utility>
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
  // See leaf.h; kChildCode for a child tile (of the finest level that the tile
  // spans), 0 for unknown.
  std::vector<std::uint16_t> std_codes;
  // Of a slot with a child tile and of an unknown leaf: 0.
  std::vector<std::uint32_t> times_s;
  // Empty if all are 0.
  std::vector<std::uint8_t> residual_codes;
  // Empty if all are 0.
  std::vector<std::uint8_t> spread_codes;
  // Indices of the slots with a hazard, ascending, and their hazard_m.
  std::vector<std::uint16_t> hazard_slots;
  std::vector<float> hazards_m;

  friend bool operator==(const TileContent&, const TileContent&) = default;
};

// Sums over a tile and all tiles below it.
struct TileTotals {
  std::uint64_t leaves = 0;        // Unknown ones too.
  std::uint64_t known_leaves = 0;  // Prior, measured and land.
  std::uint64_t tiles = 0;
  // Of the tiles unpacked, without their slots; with allocator overhead (16 B
  // a block).
  std::uint64_t memory_bytes = 0;
  // Least and greatest depth that any known leaf stands for, its residual
  // included, the least its hazard too; +inf and -inf if none is known.
  // Uncertainty is not included.
  float shoalest_m = std::numeric_limits<float>::infinity();
  float deepest_m = -std::numeric_limits<float>::infinity();
  // Of known leaves: the greatest predictive std, metres (0: none is known);
  // the earliest time that is known, Unix seconds (0: none).
  float largest_std_m = 0;
  std::uint32_t earliest_s = 0;

  // Adds those of a leaf or of a child tile.
  void AddStdAndTime(float std_m, std::uint32_t time_s) {
    largest_std_m = std::max(largest_std_m, std_m);
    if (time_s != 0 && (earliest_s == 0 || time_s < earliest_s)) {
      earliest_s = time_s;
    }
  }
};

class TileSlot;

// A tile's content as its codec's bytes (see TileCodec).
using PackedTile = std::vector<std::uint8_t>;

class Tile {
 public:
  // What lies at a position.
  struct Found {
    Leaf leaf;
    int level = 0;
    const TileSlot* child = nullptr;  // Not null: the leaf says nothing.
  };

  // Builds a tile from its slots in Z-order: levels[i] below the root and
  // leaves[i]; a slot whose std_code is kChildCode takes the next of
  // `children`. `tolerance_m` is the map's: what residual codes are measured
  // in. REQUIRES: the levels cover the tile exactly, as many child slots as
  // children, keys that agree.
  static std::unique_ptr<const Tile> Build(
      const TileKey& key, std::span<const std::uint8_t> levels,
      std::span<const Leaf> leaves,
      std::vector<std::shared_ptr<const TileSlot>> children, float tolerance_m);

  // The tile of a content as Content() gave it. REQUIRES: ValidateContent is
  // OK; as many children as there are child slots, in Z-order.
  static std::unique_ptr<const Tile> FromContent(
      const TileKey& key, const TileContent& content,
      std::vector<std::shared_ptr<const TileSlot>> children, float tolerance_m);

  ~Tile();
  static void operator delete(void* tile) { ::operator delete(tile); }
  Tile(const Tile&) = delete;
  Tile& operator=(const Tile&) = delete;

  const TileKey& key() const { return key_; }

  // Slots of this tile, 1..4096.
  std::uint32_t slot_count() const { return slot_count_; }

  // The leaf or child at a position. REQUIRES: position < 4096. About 5 ns.
  Found Find(std::uint32_t position) const;

  // The leaf that covers a cell of the lattice of kMaxLevel in the tree below
  // `root`; `level` is then that of the leaf from the top. Unpacks the tiles on
  // its way: see TileSlot::tile for what the caller holds. REQUIRES: root is of
  // level 0. About 10 ns a tile that is in cache.
  static Found Descend(const Tile& root, std::uint32_t row, std::uint32_t col);

  // Calls visit(position, slot index, level) for each slot in Z-order.
  template <typename Visitor>
  void ForEachSlot(Visitor visit) const;

  // The leaf of a slot, with all its fields. REQUIRES: slot < slot_count().
  Leaf LeafAt(std::uint32_t slot) const;
  bool IsChild(std::uint32_t slot) const;
  // The child tile of a slot. REQUIRES: IsChild(slot).
  const std::shared_ptr<const TileSlot>& ChildAt(std::uint32_t slot) const;

  // Child tiles in Z-order.
  std::span<const std::shared_ptr<const TileSlot>> children() const {
    return {Children(), child_count_};
  }

  const TileTotals& totals() const { return totals_; }

  // Of this tile alone, with the allocator's overhead.
  std::uint64_t memory_bytes() const;

  // Whether both have the same slots and leaves; children are compared by
  // place, not by what is in them.
  bool SameSlots(const Tile& other) const;

  // The plain arrays. O(slots).
  TileContent Content() const;

 private:
  // The tile is one allocation: this object, and behind it
  //   children shared pointers in Z-order
  //   blocks   for each divided block its 32 bits; and one more rank, that of
  //            the end
  //   records  for each slot depth (4 bytes), code (2) and time; the time takes
  //            3 bytes, as seconds since time_s_ plus 1 (0: unknown); 4 bytes,
  //            as it is, where the tile's span 194 days or more; none where all
  //            known leaves have one time and none is a child
  //   residual codes, one byte for each slot, unless all are 0
  //   spread codes, the same
  //   hazards  slots (2 bytes each), then depths (4 bytes each)
  //   a byte   so that a time of 3 bytes can be read with one load
  // Fields are read with memcpy. A leaf is found in three lines of cache: this
  // object's first, a block's, a record's.
  static constexpr std::size_t kBlockBytes = 4;
  static constexpr std::size_t kRecordBytes = 10;
  static constexpr std::size_t kShortTimeBytes = 9;
  static constexpr std::size_t kTimelessBytes = 6;
  static constexpr std::size_t kHazardBytes = 6;

  explicit Tile(const TileKey& key) : key_(key) {}
  static void* operator new(std::size_t size, std::size_t bytes_behind) {
    return ::operator new(size + bytes_behind);
  }
  static void operator delete(void* tile, std::size_t /*bytes_behind*/) {
    ::operator delete(tile);
  }
  // Completes the totals of the own leaves.
  void AddChildren();

  // The slot that covers a position, and its level.
  struct Rank;
  Rank RankOf(std::uint32_t position) const;
  int LevelOf(std::uint32_t position) const;
  // The time of a leaf with the given record and code.
  std::uint32_t TimeOf(const std::byte* record, std::uint16_t std_code) const;
  // The index of the child in the given record.
  std::uint32_t ChildIndex(const std::byte* record) const;
  // The fields of a slot that lie behind its record.
  void LoadRest(std::uint32_t slot, Leaf& leaf) const;

  using Child = std::shared_ptr<const TileSlot>;
  const Child* Children() const {
    return reinterpret_cast<const Child*>(this + 1);
  }
  const std::byte* Block(std::size_t k) const {
    return reinterpret_cast<const std::byte*>(this) + blocks_at_ +
           k * kBlockBytes;
  }
  const std::byte* Record(std::size_t slot) const {
    return reinterpret_cast<const std::byte*>(this) + records_at_ +
           slot * record_bytes_;
  }
  // From the blocks to the end.
  std::size_t ByteCount() const {
    return records_at_ - blocks_at_ +
           slot_count_ * (record_bytes_ + (has_residuals_ ? 1u : 0u) +
                          (has_spreads_ ? 1u : 0u)) +
           hazard_count_ * kHazardBytes;
  }
  const std::byte* Residuals() const { return Record(slot_count_); }
  const std::byte* Spreads() const {
    return Residuals() + (has_residuals_ ? slot_count_ : 0);
  }
  const std::byte* HazardSlots() const {
    return Spreads() + (has_spreads_ ? slot_count_ : 0);
  }
  const std::byte* HazardDepths() const {
    return HazardSlots() + hazard_count_ * sizeof(std::uint16_t);
  }

  std::uint64_t whole_ = 0;
  std::uint64_t divided_ = 0;
  // From the start of this object, bytes.
  std::uint32_t blocks_at_ = 0;
  std::uint32_t records_at_ = 0;
  std::uint16_t slot_count_ = 0;
  std::uint16_t child_count_ = 0;
  std::uint8_t record_bytes_ = kRecordBytes;
  bool has_residuals_ = false;
  bool has_spreads_ = false;
  // Where in a lattice index the position within a child begins: known before
  // the child is read, so that Descend does not wait for it (15 ns).
  std::uint8_t child_shift_ = 0;
  std::uint16_t hazard_count_ = 0;
  // Of all known leaves, if the records hold none; the earliest that is known,
  // if they hold 3 bytes.
  std::uint32_t time_s_ = 0;
  TileKey key_;
  TileTotals totals_;
};

// Checks a stored content: array lengths, a shape that covers the tile
// exactly and goes no deeper than `max_level`, children only where they may be,
// codes and depths in range, canonical zeros.
// Errors: DATA_LOSS naming the tile and what is wrong.
absl::Status ValidateContent(const TileKey& key, const TileContent& content,
                             int max_level);

// A tile on its way back from the disk: checked, and built unless it waits for
// its children. Most tiles have none, so most of the work is done by Make,
// which is pure: a loader may call it on many threads.
struct RestoredTile {
  TileKey key;
  // Null: it is packed, or it has children.
  std::unique_ptr<const Tile> tile = nullptr;
  // Of a tile with children, until they are there.
  TileContent content = {};
  // Of a packed one: its totals and the bytes that Make's content was read
  // from.
  TileTotals totals = {};
  PackedTile packed = {};

  // Errors: those of ValidateContent. About 15 ns a slot.
  static absl::StatusOr<RestoredTile> Make(const TileKey& key,
                                           TileContent content, int max_level,
                                           float tolerance_m);

  // Keeps the bytes in the place of the tile. REQUIRES: `tile` is there, and
  // its content is what the map's codec unpacks from `bytes`.
  void Pack(PackedTile bytes) {
    totals = tile->totals();
    packed = std::move(bytes);
    tile.reset();
  }
};

template <typename Visitor>
void Tile::ForEachSlot(Visitor visit) const {
  std::uint32_t slot = 0;
  for (std::uint32_t position = 0; position < kTileCells; ++slot) {
    const int level = LevelOf(position);
    visit(position, slot, level);
    position += SpanOf(level);
  }
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_TILE_H_
