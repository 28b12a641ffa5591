#include "map/global/work_tree.h"

#include <algorithm>
#include <cstring>
#include <span>
#include <utility>

#include "absl/base/macros.h"
#include "map/global/fuse.h"

namespace fathom::map {

WorkTile::WorkTile(const TileKey& its_key, const Leaf& leaf)
    : key(its_key), modified(true) {
  levels.fill(0);
  leaves[0] = leaf;
}

TileKey WorkNode::key() const {
  if (const WorkTile* open = work.get()) return open->key;
  ABSL_ASSERT(frozen != nullptr);
  return frozen->key();
}

WorkTile::WorkTile(const Tile& tile) : key(tile.key()) {
  std::uint32_t next_child = 0;
  tile.ForEachSlot([&](std::uint32_t position, std::uint32_t slot, int level) {
    std::memset(&levels[position], level, SpanOf(level));
    leaves[position] = tile.LeafAt(slot);
    // Children are numbered in Z-order.
    if (tile.IsChild(slot)) leaves[position].time_s = next_child++;
  });
  children.reserve(tile.children().size());
  for (const std::shared_ptr<const TileSlot>& child : tile.children()) {
    children.push_back({.frozen = child, .work = nullptr});
  }
}

void WorkTile::Divide(std::uint32_t start) {
  const int level = levels[start] + 1;
  const std::uint32_t span = SpanOf(level);
  std::memset(&levels[start], level, std::size_t{4} * span);
  leaves[start] = DividedLeaf(leaves[start]);
  for (std::uint32_t i = 1; i < 4; ++i) {
    leaves[start + i * span] = leaves[start];
  }
  modified = true;
}

void WorkTile::Merge(std::uint32_t start, int level, const Leaf& leaf) {
  std::memset(&levels[start], level, SpanOf(level));
  leaves[start] = leaf;
  modified = true;
}

void WorkTile::SetChild(std::uint32_t start, WorkNode child) {
  const auto gap =
      std::find_if(children.begin(), children.end(), [](const WorkNode& node) {
        return node.frozen == nullptr && node.work == nullptr;
      });
  const auto index = static_cast<std::uint32_t>(gap - children.begin());
  if (gap == children.end()) {
    children.push_back(std::move(child));
  } else {
    *gap = std::move(child);
  }
  leaves[start] = {.time_s = index, .std_code = kChildCode};
  modified = true;
}

void WorkTile::RemoveChild(std::uint32_t start, const Leaf& leaf) {
  ChildAt(start) = {};
  leaves[start] = leaf;
  modified = true;
}

WorkTree::WorkTree(std::shared_ptr<TileMemory> memory,
                   std::shared_ptr<const TileSlot> root, TileLadder ladder,
                   std::uint64_t max_cells, float tolerance_m)
    : memory_(std::move(memory)),
      ladder_(ladder),
      max_cells_(max_cells),
      tolerance_m_(tolerance_m) {
  if (root == nullptr) {
    const std::uint8_t level = 0;
    const Leaf unknown;
    root = std::make_shared<const TileSlot>(
        memory_,
        Tile::Build(TileKey{}, {&level, 1}, {&unknown, 1}, {}, tolerance_m));
  }
  leaf_count_ = root->totals().leaves;
  root_.frozen = std::move(root);
}

WorkTile& WorkTree::Open(WorkNode& node) {
  if (node.work == nullptr) {
    node.work = std::make_unique<WorkTile>(*node.frozen->Look());
    ++open_tiles_;
  }
  return *node.work;
}

WorkTile* WorkTree::OpenTile(const TileKey& key) {
  WorkTile* tile = &Open(root_);
  while (tile->key.level < key.level) {
    tile->settled = false;
    const std::uint32_t start =
        tile->StartOf(PositionInTile(key.Root(), tile->key.level));
    if (tile->leaves[start].std_code != kChildCode) return nullptr;
    tile = &Open(tile->ChildAt(start));
  }
  tile->settled = false;
  return tile;
}

WorkTile& WorkTree::DivideIntoChild(WorkTile& tile, std::uint32_t start) {
  const CellKey cell = CellInTile(tile.key, start, tile.levels[start]);
  WorkNode node;
  node.work = std::make_unique<WorkTile>(
      TileKey{.level = cell.level, .row = cell.row, .col = cell.col},
      tile.leaves[start]);
  ++open_tiles_;
  WorkTile& child = *node.work;
  tile.SetChild(start, std::move(node));
  return child;
}

const std::shared_ptr<const TileSlot>& WorkTree::Freeze() {
  FreezeNode(root_);
  return root_.frozen;
}

void WorkTree::FreezeNode(WorkNode& node) {
  if (node.work == nullptr) return;
  WorkTile& work = *node.work;
  // Children first: the arrays below are shared by all levels.
  for (WorkNode& child : work.children) FreezeNode(child);

  std::vector<std::shared_ptr<const TileSlot>> children;
  frozen_levels_.clear();
  frozen_leaves_.clear();
  for (std::uint32_t position = 0; position < kTileCells;) {
    const std::uint8_t level = work.levels[position];
    frozen_levels_.push_back(level);
    frozen_leaves_.push_back(work.leaves[position]);
    if (work.leaves[position].std_code == kChildCode) {
      children.push_back(work.ChildAt(position).frozen);
    }
    position += SpanOf(level);
  }

  bool same_children = node.frozen != nullptr;
  if (same_children) {
    // A tile with children is never packed.
    std::span<const std::shared_ptr<const TileSlot>> before;
    if (node.frozen->totals().tiles > 1) {
      before = node.frozen->tile().children();
    }
    same_children = std::equal(children.begin(), children.end(), before.begin(),
                               before.end());
  }
  if (!same_children || work.modified) {
    std::unique_ptr<const Tile> tile =
        Tile::Build(work.key, frozen_levels_, frozen_leaves_,
                    std::move(children), tolerance_m_);
    if (!same_children || !tile->SameSlots(*node.frozen->Look())) {
      node.frozen = std::make_shared<const TileSlot>(memory_, std::move(tile));
    }
  }
  if (work.settled) node.frozen->set_settled(true);
  node.work.reset();
  --open_tiles_;
}

}  // namespace fathom::map
