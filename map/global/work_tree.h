// WorkTree: the quadtree while it is written. Private to map/global.
//
// A tile that is written is expanded ("opened") into a WorkTile: the level of
// the leaf at each of its 64 x 64 positions, and a leaf record that is valid
// where a leaf begins. Dividing or merging then is a fill of a few bytes and
// four copies. Freeze() turns all open tiles into immutable ones again; one
// whose slots and children ended as they began keeps its identity.
//
// What is packed is unpacked for the expansion only. Open tiles take 53 KB
// each; FreezeIfLarge() bounds them. Not thread-safe.

#ifndef FATHOM_MAP_GLOBAL_WORK_TREE_H_
#define FATHOM_MAP_GLOBAL_WORK_TREE_H_

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "map/global/cell_key.h"
#include "map/global/leaf.h"
#include "map/global/tile.h"
#include "map/global/tile_memory.h"

namespace fathom::map {

struct WorkTile;

// A place in the tree that holds a tile: frozen, open, or open over the frozen
// one from which it was expanded. Never empty once in the tree.
struct WorkNode {
  std::shared_ptr<const TileSlot> frozen;
  std::unique_ptr<WorkTile> work;

  // REQUIRES: one of the two is there.
  TileKey key() const;
};

struct WorkTile {
  TileKey key;
  // Whether slots were changed since the tile was expanded.
  bool modified = false;
  // See TileSlot::settled().
  bool settled = false;
  // Levels below the root of the slot that covers each position.
  std::array<std::uint8_t, kTileCells> levels;
  // Valid where a slot begins. Of a child slot: std_code is kChildCode and
  // time_s the index in `children`.
  std::array<Leaf, kTileCells> leaves;
  // Emptied places are left behind and reused.
  std::vector<WorkNode> children;

  // A tile of one leaf.
  WorkTile(const TileKey& its_key, const Leaf& leaf);
  // The expansion of a frozen tile.
  explicit WorkTile(const Tile& tile);

  // Where the slot that covers `position` begins.
  std::uint32_t StartOf(std::uint32_t position) const {
    return position & ~(SpanOf(levels[position]) - 1);
  }
  bool IsChild(std::uint32_t position) const {
    return leaves[StartOf(position)].std_code == kChildCode;
  }
  WorkNode& ChildAt(std::uint32_t start) {
    return children[leaves[start].time_s];
  }

  // Replaces the leaf that begins at `start` by four that inherit from it
  // (DividedLeaf).
  // REQUIRES: its level < 6.
  void Divide(std::uint32_t start);
  // Replaces all slots of the cell of `level` that begins at `start` by one
  // leaf. REQUIRES: none of them is a child.
  void Merge(std::uint32_t start, int level, const Leaf& leaf);
  // Replaces the leaf (of the finest level that the tile spans) at `start` by a
  // child tile.
  void SetChild(std::uint32_t start, WorkNode child);
  // Replaces the child at `start` by a leaf.
  void RemoveChild(std::uint32_t start, const Leaf& leaf);
};

class WorkTree {
 public:
  // Open tiles before FreezeIfLarge() acts: 54 MB.
  static constexpr std::size_t kMaxOpenTiles = 1024;

  // All tiles will be of `memory`. REQUIRES: `root` holds a level 0 tile of
  // it, or is null: one unknown leaf.
  WorkTree(std::shared_ptr<TileMemory> memory,
           std::shared_ptr<const TileSlot> root, TileLadder ladder,
           std::uint64_t max_cells, float tolerance_m);

  const std::shared_ptr<TileMemory>& memory() const { return memory_; }
  const TileLadder& ladder() const { return ladder_; }

  std::uint64_t leaf_count() const { return leaf_count_; }
  float tolerance_m() const { return tolerance_m_; }
  WorkNode& root() { return root_; }

  // The open tile of a node; expands it if it is frozen.
  WorkTile& Open(WorkNode& node);

  // The open tile `key` if the tree reaches down to it, else null. Nothing is
  // divided.
  WorkTile* OpenTile(const TileKey& key);

  // Where a cell, or the coarser leaf that covers it, begins.
  struct Place {
    WorkTile* tile = nullptr;
    std::uint32_t start = 0;
    // Whether the place is the cell itself, divided down to.
    bool exact = false;

    Leaf& leaf() const { return tile->leaves[start]; }
    CellKey cell() const {
      return CellInTile(tile->key, start, tile->levels[start]);
    }
  };

  // Divides down to `cell`. Stops early at a leaf for which may_divide(leaf)
  // is false, or when a division would pass max_cells.
  // REQUIRES: where the tree is deeper than the cell, the caller goes on.
  template <typename MayDivide>
  Place Reach(const CellKey& cell, MayDivide may_divide);

  // Freezes all open tiles and returns the root.
  const std::shared_ptr<const TileSlot>& Freeze();
  void FreezeNode(WorkNode& node);
  // Empties a node whose tile has been given up.
  void Discard(WorkNode& node) {
    if (node.work != nullptr) --open_tiles_;
    node = {};
  }
  // Bounds memory; pointers to open tiles die.
  void FreezeIfLarge() {
    if (open_tiles_ > kMaxOpenTiles) Freeze();
  }

  // For conglomeration: `merges` times four leaves became one.
  void CountMerges(std::uint64_t merges) { leaf_count_ -= 3 * merges; }

 private:
  // Whether one more division keeps the bound.
  bool HasRoom() const { return leaf_count_ + 3 <= max_cells_; }
  WorkTile& DivideIntoChild(WorkTile& tile, std::uint32_t start);

  std::shared_ptr<TileMemory> memory_;
  WorkNode root_;
  TileLadder ladder_;
  std::uint64_t max_cells_;
  float tolerance_m_;
  std::uint64_t leaf_count_ = 1;
  std::size_t open_tiles_ = 0;
  // For FreezeNode, so that it allocates once.
  std::vector<std::uint8_t> frozen_levels_;
  std::vector<Leaf> frozen_leaves_;
};

template <typename MayDivide>
WorkTree::Place WorkTree::Reach(const CellKey& cell, MayDivide may_divide) {
  WorkTile* tile = &Open(root_);
  for (;;) {
    tile->settled = false;
    const int below = cell.level - tile->key.level;
    const int span = ladder_.LevelsOf(tile->key.level);
    const int wanted = below < span ? below : span;
    const std::uint32_t position = PositionInTile(cell, tile->key.level);
    std::uint32_t start = tile->StartOf(position);
    while (tile->levels[position] < wanted) {
      if (!HasRoom() || !may_divide(tile->leaves[start])) {
        return {.tile = tile, .start = start, .exact = false};
      }
      tile->Divide(start);
      leaf_count_ += 3;
      start = tile->StartOf(position);
    }
    if (below <= span) {
      return {.tile = tile, .start = start, .exact = true};
    }
    if (tile->leaves[start].std_code != kChildCode) {
      if (!HasRoom() || !may_divide(tile->leaves[start])) {
        return {.tile = tile, .start = start, .exact = false};
      }
      // Divided at once below: no tile is ever a single leaf but the root.
      tile = &DivideIntoChild(*tile, start);
    } else {
      tile = &Open(tile->ChildAt(start));
    }
  }
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_WORK_TREE_H_
