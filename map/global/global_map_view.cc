#include "map/global/global_map_view.h"

#include <algorithm>
#include <bit>
#include <span>
#include <vector>

namespace fathom::map {
namespace {

void VisitLeaves(
    const Tile& tile,
    const std::function<void(const CellKey&, const Leaf&)>& visit) {
  tile.ForEachSlot([&](std::uint32_t position, std::uint32_t slot, int level) {
    if (tile.IsChild(slot)) {
      VisitLeaves(*tile.ChildAt(slot)->Look(), visit);
    } else {
      visit(CellInTile(tile.key(), position, level), tile.LeafAt(slot));
    }
  });
}

void VisitTiles(const Tile& tile,
                const std::function<void(const Tile&)>& visit) {
  visit(tile);
  for (const auto& child : tile.children()) VisitTiles(*child->Look(), visit);
}

using LeafVisitor = absl::FunctionRef<void(const CellKey&, const Leaf&)>;
using TileSkipper = absl::FunctionRef<bool(const TileTotals&)>;

// The leaves of the cell that the box touches. `slot`: the tile of which the
// cell is the root or a part, or one above it. Opens no tile that is skipped or
// that the box does not touch.
void VisitLeavesIn(const TileSlot* slot, const CellKey& cell,
                   const LatticeBox& box, LeafVisitor visit, TileSkipper skip) {
  const int up = kMaxLevel - cell.level;
  const std::uint32_t row = cell.row << up;
  const std::uint32_t col = cell.col << up;
  const std::uint32_t last = (1u << up) - 1;
  if (row > box.row_last || row + last < box.row_first || col > box.col_last ||
      col + last < box.col_first) {
    return;
  }
  while (true) {
    const int below = cell.level - slot->key().level;
    if (below == 0) {
      if (skip(slot->totals())) return;
      if (slot->totals().leaves > 1) break;
    }
    const Tile::Found found =
        slot->tile().Find(PositionInTile(cell, slot->key().level));
    if (found.level > below) break;
    if (found.child != nullptr) {
      slot = found.child;
      continue;
    }
    const int level = slot->key().level + found.level;
    const int down = cell.level - level;
    visit({.level = static_cast<std::uint8_t>(level),
           .row = cell.row >> down,
           .col = cell.col >> down},
          found.leaf);
    return;
  }
  for (std::uint32_t quarter = 0; quarter < 4; ++quarter) {
    VisitLeavesIn(slot,
                  {.level = static_cast<std::uint8_t>(cell.level + 1),
                   .row = cell.row * 2 + quarter / 2,
                   .col = cell.col * 2 + quarter % 2},
                  box, visit, skip);
  }
}

using TileVisitor = std::function<void(const TileKey&, const Tile*)>;

using Children = std::span<const std::shared_ptr<const TileSlot>>;

// None if there is no tile. Tiles with children are never packed.
Children ChildrenOf(const TileSlot* slot) {
  if (slot == nullptr || slot->totals().tiles == 1) return {};
  return slot->tile().children();
}

void VisitGone(const TileSlot& slot, const TileVisitor& visit) {
  visit(slot.key(), nullptr);
  for (const auto& child : ChildrenOf(&slot)) VisitGone(*child, visit);
}

void VisitDifferent(const TileSlot* old, const TileSlot& now,
                    const TileVisitor& visit) {
  if (old == &now) return;
  {
    const TileLook tile = now.Look();
    if (old == nullptr || !old->Look()->SameSlots(*tile)) {
      visit(now.key(), &*tile);
    }
  }
  // Siblings are of one level and in Z-order in both tiles.
  const auto z_order = [](const std::shared_ptr<const TileSlot>& slot) {
    return ZOrder(slot->key().row & (kTileSide - 1),
                  slot->key().col & (kTileSide - 1));
  };
  const Children before = ChildrenOf(old);
  std::size_t next = 0;
  for (const std::shared_ptr<const TileSlot>& child : ChildrenOf(&now)) {
    for (; next < before.size() && z_order(before[next]) < z_order(child);
         ++next) {
      VisitGone(*before[next], visit);
    }
    const bool both =
        next < before.size() && before[next]->key() == child->key();
    VisitDifferent(both ? before[next].get() : nullptr, *child, visit);
    if (both) ++next;
  }
  for (; next < before.size(); ++next) VisitGone(*before[next], visit);
}

}  // namespace

// Field by field into its place, see Tile::Descend.
inline void GlobalMapView::Tell(const Leaf& leaf, int level,
                                DepthEstimate& estimate) const {
  estimate = {};
  estimate.depth_m = leaf.depth_m;
  estimate.std_m = leaf.std_m();
  estimate.kind = ToEvidenceKind(leaf.kind());
  estimate.time_s = leaf.time_s;
  if (leaf.spread_code != 0) estimate.variability_m = leaf.variability_m();
  if (leaf.hazard_m < leaf.depth_m) estimate.hazard_m = leaf.hazard_m;
  estimate.cell_size_m = static_cast<float>(root_.cell_size_m(level));
}

bool GlobalMapView::Read(const GeodeticPoint& point,
                         DepthEstimate& estimate) const {
  const std::optional<LatticePoint> place = root_.LocateLattice(point);
  if (!place || root_tile_ == nullptr) return false;
  const Tile::Found found = Tile::Descend(*root_tile_, place->row, place->col);
  if (!found.leaf.known()) return false;
  Tell(found.leaf, found.level, estimate);
  return true;
}

DepthEstimate GlobalMapView::EstimateOf(const CellKey& cell,
                                        const Leaf& leaf) const {
  DepthEstimate estimate;
  Tell(leaf, cell.level, estimate);
  return estimate;
}

std::optional<DepthEstimate> GlobalMapView::At(
    const GeodeticPoint& point) const {
  std::optional<DepthEstimate> answer;
  if (!Read(point, answer.emplace())) answer.reset();
  return answer;
}

std::optional<std::pair<CellKey, Leaf>> GlobalMapView::LeafAt(
    const GeodeticPoint& point) const {
  const std::optional<LatticePoint> place = root_.LocateLattice(point);
  if (!place || root_tile_ == nullptr) return std::nullopt;
  const Tile::Found found = Tile::Descend(*root_tile_, place->row, place->col);
  const int up = kMaxLevel - found.level;
  return std::pair{CellKey{.level = static_cast<std::uint8_t>(found.level),
                           .row = place->row >> up,
                           .col = place->col >> up},
                   found.leaf};
}

void GlobalMapView::ForEachLeafIn(const LatticeBox& box, LeafVisitor visit,
                                  TileSkipper skip) const {
  if (root_tile_ == nullptr) return;
  // From the least cell that holds the box.
  const std::uint32_t differ =
      (box.row_first ^ box.row_last) | (box.col_first ^ box.col_last);
  const int up = static_cast<int>(std::bit_width(differ));
  VisitLeavesIn(root_slot_.get(),
                {.level = static_cast<std::uint8_t>(kMaxLevel - up),
                 .row = box.row_first >> up,
                 .col = box.col_first >> up},
                box, visit, skip);
}

std::optional<DepthBounds> GlobalMapView::Bounds(const CellKey& cell) const {
  if (root_tile_ == nullptr) return std::nullopt;
  DepthBounds bounds{.shoalest_m = std::numeric_limits<float>::infinity(),
                     .deepest_m = -std::numeric_limits<float>::infinity()};
  const auto add_leaf = [&](const Leaf& leaf) {
    if (!leaf.known()) return;
    const float residual_m = DecodeResidualM(leaf.residual_code, tolerance_m_);
    bounds.shoalest_m =
        std::min({bounds.shoalest_m, leaf.depth_m - residual_m, leaf.hazard_m});
    bounds.deepest_m = std::max(bounds.deepest_m, leaf.depth_m + residual_m);
  };
  const auto add_tile = [&](const TileTotals& totals) {
    bounds.shoalest_m = std::min(bounds.shoalest_m, totals.shoalest_m);
    bounds.deepest_m = std::max(bounds.deepest_m, totals.deepest_m);
  };

  const TileSlot* slot = root_slot_.get();
  while (slot != nullptr) {
    const int below = cell.level - slot->key().level;
    if (below == 0) {
      add_tile(slot->totals());
      break;
    }
    const Tile& tile = slot->tile();
    const std::uint32_t begin = PositionInTile(cell, tile.key().level);
    const Tile::Found found = tile.Find(begin);
    if (found.child != nullptr && below >= found.level) {
      slot = found.child;
      continue;
    }
    if (found.level <= below) {
      add_leaf(found.leaf);
      break;
    }
    // The cell is divided inside this tile.
    for (std::uint32_t p = begin; p < begin + SpanOf(below);) {
      const Tile::Found part = tile.Find(p);
      if (part.child != nullptr) {
        add_tile(part.child->totals());
      } else {
        add_leaf(part.leaf);
      }
      p += SpanOf(part.level);
    }
    break;
  }
  if (bounds.shoalest_m > bounds.deepest_m) return std::nullopt;
  return bounds;
}

void GlobalMapView::ForEachLeaf(
    const std::function<void(const CellKey&, const Leaf&)>& visit) const {
  if (root_tile_ != nullptr) VisitLeaves(*root_tile_, visit);
}

void GlobalMapView::ForEachTile(
    const std::function<void(const Tile&)>& visit) const {
  if (root_tile_ != nullptr) VisitTiles(*root_tile_, visit);
}

void DiffTiles(const GlobalMapView& old, const GlobalMapView& now,
               const std::function<void(const TileKey&, const Tile*)>& visit) {
  if (now.root_slot() == nullptr) return;
  VisitDifferent(old.root_slot(), *now.root_slot(), visit);
}

}  // namespace fathom::map
