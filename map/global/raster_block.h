// RasterBlock: a rectangle of an a-priori chart on a regular grid of latitude
// and longitude, as it enters the global map (Nervegna 2002, sections 1.2 and
// 4.4.3). Plain data.

#ifndef FATHOM_MAP_GLOBAL_RASTER_BLOCK_H_
#define FATHOM_MAP_GLOBAL_RASTER_BLOCK_H_

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "map/geodesy/points.h"

namespace fathom::map {

struct RasterBlock {
  // 16 M cells: 200 MB with everything. A larger chart comes in blocks.
  static constexpr std::uint64_t kMaxCells = 1u << 24;

  // The outer north-west corner of the first cell (not its middle).
  GeodeticPoint north_west;
  // Size of a cell, degrees, > 0: north to south and west to east. The block
  // may cross the antimeridian; it must not reach over a pole.
  double latitude_step_deg = 0;
  double longitude_step_deg = 0;
  std::uint32_t rows = 0;     // North to south, >= 1.
  std::uint32_t columns = 0;  // West to east, >= 1.
  // Row-major from the north-west, rows x columns. Depth below the mission's
  // datum, metres, positive down, in [kMinChartDepthM, kMaxChartDepthM]; NaN:
  // unknown.
  std::vector<float> depth_m;
  // 1 sigma, metres, > 0; rows x columns, or one value for all cells. A cell
  // whose std is NaN is unknown.
  std::vector<float> std_m;
  // 1 land, 0 water; rows x columns, or empty: no land. The depth of a land
  // cell is ignored.
  std::vector<std::uint8_t> land;
  // When the chart was surveyed, Unix seconds; 0: unknown.
  std::uint32_t time_s = 0;
  // Whether the chart replaces what earlier charts said, or is fused with it
  // as independent knowledge. Measured leaves are never touched by a chart.
  bool replace = false;
};

// Errors: INVALID_ARGUMENT naming the field, its value and what is asked:
// corners and steps, sizes, array lengths, infinite or absurd depths, stds
// that are not > 0. O(cells).
absl::Status ValidateRaster(const RasterBlock& block);

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_RASTER_BLOCK_H_
