// GlobalMapView: the global map at one moment; what queries, storage and the
// digest read.
//
// A view is a root square, the root tile of a tree that never changes, and a
// guard of the tiles that are read through it. It is copied at the cost of two
// reference counts, stays valid whatever the writer does, and any number of
// threads may use one view or copies of it. A default-made view knows nothing.
//
// A tile that is packed (tile_memory.h) is unpacked when it is read, some 0.1
// ms; tiles that are evicted while a view is held are kept until it is gone.

#ifndef FATHOM_MAP_GLOBAL_GLOBAL_MAP_VIEW_H_
#define FATHOM_MAP_GLOBAL_GLOBAL_MAP_VIEW_H_

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include "absl/functional/function_ref.h"
#include "map/geodesy/depth_estimate.h"
#include "map/geodesy/points.h"
#include "map/global/cell_key.h"
#include "map/global/leaf.h"
#include "map/global/root_square.h"
#include "map/global/tile.h"
#include "map/global/tile_memory.h"

namespace fathom::map {

// The least and the greatest depth in a part of the map (of means, without
// their uncertainty; of every fine mean that a merged leaf replaced; the least
// of point hazards too).
struct DepthBounds {
  float shoalest_m = 0;
  float deepest_m = 0;
};

class GlobalMapView {
 public:
  GlobalMapView() = default;
  // For GlobalMap and for tests.
  GlobalMapView(const RootSquare& root,
                std::shared_ptr<const TileSlot> root_slot,
                std::shared_ptr<const TileGuard> guard, float tolerance_m)
      : root_(root),
        guard_(std::move(guard)),
        root_slot_(std::move(root_slot)),
        root_tile_(&root_slot_->tile()),
        tolerance_m_(tolerance_m) {}

  // The leaf at a point: prior, measured or land, never smoothed. nullopt
  // where nothing is known, outside the square and for coordinates that are
  // not finite. variability_m and hazard_m as they are known; shoalest_m and
  // soundings are not kept (NaN, 0). At most four tiles deep;
  // <= 50 ns on a warm map.
  std::optional<DepthEstimate> At(const GeodeticPoint& point) const;
  // The same into `estimate`, for who has a place for it; false (`estimate` is
  // then whatever it was) where At is nullopt.
  bool Read(const GeodeticPoint& point, DepthEstimate& estimate) const;

  // As At, with the leaf as it is kept and the cell that it fills; an unknown
  // leaf too. nullopt outside the square.
  std::optional<std::pair<CellKey, Leaf>> LeafAt(
      const GeodeticPoint& point) const;

  // What a leaf says, as At tells it. REQUIRES: leaf.known().
  DepthEstimate EstimateOf(const CellKey& cell, const Leaf& leaf) const;

  // Calls visit(cell, leaf) once for every leaf, unknown ones too, that shares
  // a place with the box, in Z-order. About 25 ns a leaf.
  void ForEachLeafIn(
      const LatticeBox& box,
      absl::FunctionRef<void(const CellKey&, const Leaf&)> visit) const {
    ForEachLeafIn(box, visit, [](const TileTotals&) { return false; });
  }
  // The same but for the leaves of tiles, and of all tiles below them, of
  // whose totals `skip` says so; it is asked when their first leaf is due.
  void ForEachLeafIn(const LatticeBox& box,
                     absl::FunctionRef<void(const CellKey&, const Leaf&)> visit,
                     absl::FunctionRef<bool(const TileTotals&)> skip) const;

  // Answers "could anything in this cell be shallower than z?" without opening
  // it. nullopt: nothing is known in the cell. Where the map is coarser than
  // the cell, the leaf's own bounds. O(1) for a tile's root cell, else at most
  // 4096 slots. REQUIRES: a valid cell.
  std::optional<DepthBounds> Bounds(const CellKey& cell) const;

  // Calls visit(cell, leaf) for every leaf, unknown ones too, in Z-order over
  // the whole square: the canonical order, which depends on the content alone.
  void ForEachLeaf(
      const std::function<void(const CellKey&, const Leaf&)>& visit) const;

  // Calls visit(tile) for every tile, parents before children; the tile is
  // valid during the call.
  void ForEachTile(const std::function<void(const Tile&)>& visit) const;

  const RootSquare& root() const { return root_; }
  // Null only in a default-made view.
  const Tile* root_tile() const { return root_tile_; }
  const TileSlot* root_slot() const { return root_slot_.get(); }
  // What Leaf::residual_code is measured in (see GlobalMapOptions).
  float tolerance_m() const { return tolerance_m_; }

  // Leaves, unknown ones too: what max_cells bounds. 1 in an empty map. O(1).
  std::uint64_t leaf_count() const {
    return root_tile_ ? root_tile_->totals().leaves : 0;
  }
  // Leaves that hold a value. O(1).
  std::uint64_t known_leaf_count() const {
    return root_tile_ ? root_tile_->totals().known_leaves : 0;
  }
  // What the map's tiles take now, those of other versions that somebody still
  // holds too; allocator overhead estimated. All 0 in a default-made view and
  // at rest. O(1), under a lock.
  TileUse tile_use() const {
    return guard_ ? guard_->memory().Use() : TileUse{};
  }

  // What this view's tiles take when all are unpacked, their slots included;
  // allocator overhead estimated. O(1).
  std::uint64_t memory_bytes() const {
    if (root_tile_ == nullptr) return 0;
    const TileTotals& totals = root_tile_->totals();
    return totals.memory_bytes + totals.tiles * TileSlot::OwnBytes();
  }

  // The same tree without a guard: for who keeps a view for long to compare a
  // later one with it, and should not keep what is evicted meanwhile. Only
  // counts may be asked of it, and DiffTiles as `old`.
  GlobalMapView AtRest() const {
    GlobalMapView view = *this;
    view.guard_.reset();
    return view;
  }

 private:
  void Tell(const Leaf& leaf, int level, DepthEstimate& estimate) const;

  RootSquare root_;
  std::shared_ptr<const TileGuard> guard_;
  std::shared_ptr<const TileSlot> root_slot_;
  // That of the slot, which is never packed.
  const Tile* root_tile_ = nullptr;
  float tolerance_m_ = 0;
};

// Calls visit(key, tile) for each tile of `now` whose own slots differ from
// those of the same key in `old` (parents before children, siblings in
// Z-order; the tile is valid during the call), and visit(key, nullptr) for each
// tile that is gone. Tiles that the views share are not opened: the cost is
// that of what changed. A parent of a changed tile is visited only if its own
// slots changed.
// REQUIRES: both views are of one map; `old` may be default-made or at rest.
void DiffTiles(const GlobalMapView& old, const GlobalMapView& now,
               const std::function<void(const TileKey&, const Tile*)>& visit);

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_GLOBAL_MAP_VIEW_H_
