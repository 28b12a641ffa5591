// The geometry of one local map, worked out once from its options. Immutable
// and shared by the writer and all views.

#ifndef FATHOM_MAP_LOCAL_LOCAL_GRID_H_
#define FATHOM_MAP_LOCAL_LOCAL_GRID_H_

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "map/geodesy/ned_frame.h"
#include "map/local/cell_index.h"
#include "map/local/local_block.h"
#include "map/local/local_map_options.h"

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

  // Eq. 4.5: i = floor(x / res), j = floor(y / res). The quotients, cells north
  // and east of the south-west corner, to a cell; a cell owns its south and
  // west border. False outside and for NaN. (Not an optional: on the path of
  // each sounding its packing stalls.)
  bool Locate(double cells_north_of, double cells_east_of,
              CellIndex& cell) const {
    if (!(cells_north_of >= 0.0 && cells_north_of < cells_north &&
          cells_east_of >= 0.0 && cells_east_of < cells_east)) {
      return false;
    }
    // Truncation: the floor of what is not negative.
    cell = {.i = static_cast<std::int32_t>(cells_north_of),
            .j = static_cast<std::int32_t>(cells_east_of)};
    return true;
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

  // No other map of this process has it; never 0.
  const std::uint64_t id = NextId();
  const LocalMapOptions options;
  const NedFrame frame;
  const std::uint32_t cells_north;
  const std::uint32_t cells_east;
  const std::uint32_t blocks_north;
  const std::uint32_t blocks_east;
  const std::uint32_t reach;  // Eq. 4.22; 0: no smoothing.

 private:
  static std::uint64_t NextId() {
    static std::atomic<std::uint64_t> last{0};
    return ++last;
  }
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_LOCAL_GRID_H_
