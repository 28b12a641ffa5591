// What a local map was at one moment, for readers.
//
// A view is a value of a few pointers: copying it is cheap, and nothing that
// the writer does later changes what it answers. Any number of threads may
// read one view, or copies of it, at once; the writer never waits for them.
// The pieces that a view alone still refers to are freed with it.

#ifndef FATHOM_MAP_LOCAL_LOCAL_MAP_VIEW_H_
#define FATHOM_MAP_LOCAL_LOCAL_MAP_VIEW_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "map/geodesy/depth_estimate.h"
#include "map/geodesy/ned_frame.h"
#include "map/geodesy/points.h"
#include "map/local/cell_index.h"
#include "map/local/local_block.h"
#include "map/local/local_map_options.h"

namespace fathom::map {

class BlockDirectory;
struct LocalGrid;

// The corners of an area: south-west, north-west, north-east, south-east.
using AreaCorners = std::array<GeodeticPoint, 4>;

class LocalMapView {
 public:
  // A view of nothing: contains no point. Assign to it.
  LocalMapView();

  // Whether the point lies in the activity's area (south and west border
  // included, north and east border not).
  bool Contains(const GeodeticPoint& point) const;

  // The estimate of the cell under the point; 220 ns where it was measured,
  // 100 where this thread asked before (map/local/reading_cache.h).
  //
  // kMeasured: soundings fell in the cell; prior and evidence fused by the
  //   activity's estimator, std_m predictive.
  // kSmoothed: none did, but within smoothing_distance_m. For `nervegna` what
  //   smoothing wrote; for the others computed now from the measured cells,
  //   never more certain than any of them (map/local/smoothed_reading.h), and
  //   left out where the block's own prior is the more certain one. A caller
  //   who has a prior of his own there should take the more certain.
  // nullopt: outside, or nothing was measured near: the caller reads the
  //   global map, then DefaultPrior().
  std::optional<DepthEstimate> At(const GeodeticPoint& point) const;

  // As At, by index. nullopt outside the grid.
  std::optional<DepthEstimate> AtCell(CellIndex cell) const;

  // hazard_m of a sounding that waits in the cell under the point for a second
  // one (map/local/hazard.h), also where At() has no answer; NaN: none waits.
  float PendingHazardAt(const GeodeticPoint& point) const;
  // Whether any sounding of the map waits.
  bool any_pending() const;

  // What the soundings since the last transfer alone say, the prior left out:
  // what a transfer carries to the global map. kMeasured or nullopt. (For
  // `nervegna`, which keeps no variance apart from its prior, the std is the
  // cell's own.)
  std::optional<DepthEstimate> EvidenceAt(const GeodeticPoint& point) const;

  // Calls `visit` for each block that has evidence since the last transfer,
  // with the corners of its area (cut at the map's border) and the number of
  // such cells; in order of block row, then column.
  void ForEachMeasuredArea(
      const std::function<void(const AreaCorners& corners,
                               std::size_t measured_cells)>& visit) const;

  // All blocks, in order of row, then column.
  void ForEachBlock(
      const std::function<void(BlockIndex, const LocalBlock&)>& visit) const;

  // The block, or null if no cell of it was ever touched. Valid as long as
  // this view or a copy.
  const LocalBlock* Block(BlockIndex index) const;

  // options().default_depth_m and default_std_m as an estimate (kPrior), if
  // they were given.
  std::optional<DepthEstimate> DefaultPrior() const;

  std::uint32_t cells_north() const;
  std::uint32_t cells_east() const;
  // Cells in which a sounding ever fell.
  std::uint64_t cells_measured() const;
  std::uint64_t block_count() const;
  // What the view keeps alive: directory, blocks, priors. Pieces shared with
  // other views count in each.
  std::uint64_t memory_bytes() const;

  // REQUIRES of both: not a view of nothing.
  const LocalMapOptions& options() const;
  const NedFrame& frame() const;

  // The cell under the point; nullopt outside the grid or for NaN.
  std::optional<CellIndex> CellAt(const GeodeticPoint& point) const;
  // The middle of the cell. REQUIRES: in the grid.
  GeodeticPoint CellCenter(CellIndex cell) const;

 private:
  friend class LocalMap;
  friend void DiffBlocks(
      const LocalMapView& old_view, const LocalMapView& now,
      const std::function<void(BlockIndex, const LocalBlock&)>& visit);

  LocalMapView(std::shared_ptr<const LocalGrid> grid,
               std::shared_ptr<const BlockDirectory> directory);

  std::shared_ptr<const LocalGrid> grid_;
  std::shared_ptr<const BlockDirectory> directory_;
};

// Calls `visit` for every block of `now` that is not the very same piece in
// `old_view`: what a checkpoint has to write. Blocks never vanish. `old_view`
// may be a view of nothing (then all blocks are visited) but not of another
// map. In order of block row, then column; cost is that of what changed plus
// one comparison per 65 536 untouched cells.
void DiffBlocks(
    const LocalMapView& old_view, const LocalMapView& now,
    const std::function<void(BlockIndex, const LocalBlock&)>& visit);

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_LOCAL_MAP_VIEW_H_
