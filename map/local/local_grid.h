// The geometry of one local map, worked out once from its options. Immutable
// and shared by the writer and all views.

#ifndef FATHOM_MAP_LOCAL_LOCAL_GRID_H_
#define FATHOM_MAP_LOCAL_LOCAL_GRID_H_

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "map/geodesy/ned_frame.h"
#include "map/local/local_block.h"
#include "map/local/local_map_options.h"
#include "map/local/placement.h"

namespace fathom::map {

struct LocalGrid {
  // REQUIRES: ValidateLocalMapOptions(options) is OK.
  explicit LocalGrid(const LocalMapOptions& map_options)
      : options(map_options),
        frame(map_options.south_west),
        cells_north(CellsAlong(options.north_extent_m, options.cell_size_m)),
        cells_east(CellsAlong(options.east_extent_m, options.cell_size_m)),
        blocks_north((cells_north + kBlockSide - 1) / kBlockSide),
        blocks_east((cells_east + kBlockSide - 1) / kBlockSide),
        reach(
            options.smoothing_scale > 0.0
                ? SmoothReach(options.smoothing_distance_m, options.cell_size_m)
                : 0) {}

  // Whole cells that cover `extent_m`. The slack of 1e-9 of a cell keeps
  // 0.3 m at 0.1 m from becoming four cells.
  static std::uint32_t CellsAlong(double extent_m, double cell_size_m) {
    return std::max(1u, static_cast<std::uint32_t>(
                            std::ceil(extent_m / cell_size_m - 1e-9)));
  }

  bool Contains(CellIndex cell) const {
    return cell.i >= 0 && cell.j >= 0 &&
           static_cast<std::uint32_t>(cell.i) < cells_north &&
           static_cast<std::uint32_t>(cell.j) < cells_east;
  }

  // The cell under a point of the plane into `cell`; false outside and for
  // NaN. (Not an optional: on the path of each sounding its packing stalls.)
  // The bound keeps CellOf's conversion to integers defined.
  bool Locate(double north_m, double east_m, CellIndex& cell) const {
    constexpr double kBoundM = 1e7;  // Beyond any grid; at 1 cm 1e9 cells.
    if (!(std::fabs(north_m) < kBoundM && std::fabs(east_m) < kBoundM)) {
      return false;
    }
    cell = CellOf(north_m, east_m, options.cell_size_m);
    return Contains(cell);
  }

  static BlockIndex BlockOf(CellIndex cell) {
    return {.row = static_cast<std::uint32_t>(cell.i) / kBlockSide,
            .col = static_cast<std::uint32_t>(cell.j) / kBlockSide};
  }
  // Place of the cell inside its block.
  static std::size_t OffsetOf(CellIndex cell) {
    return (static_cast<std::uint32_t>(cell.i) % kBlockSide) * kBlockSide +
           static_cast<std::uint32_t>(cell.j) % kBlockSide;
  }
  bool Contains(BlockIndex block) const {
    return block.row < blocks_north && block.col < blocks_east;
  }

  // Corner (i, j) of the grid's lines, i.e. the south-west corner of that
  // cell.
  GeodeticPoint Corner(std::uint32_t i, std::uint32_t j) const {
    return frame.ToGeodetic(i * options.cell_size_m, j * options.cell_size_m);
  }
  GeodeticPoint Center(CellIndex cell) const {
    return frame.ToGeodetic((cell.i + 0.5) * options.cell_size_m,
                            (cell.j + 0.5) * options.cell_size_m);
  }

  const LocalMapOptions options;
  const NedFrame frame;
  const std::uint32_t cells_north;
  const std::uint32_t cells_east;
  const std::uint32_t blocks_north;
  const std::uint32_t blocks_east;
  const std::uint32_t reach;  // Eq. 4.22; 0: no smoothing.
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_LOCAL_GRID_H_
