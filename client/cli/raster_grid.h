// Regular grids of latitude and longitude: clipping to an area and cutting
// into blocks. Plain arithmetic, no GDAL. Thread-safe.

#ifndef FATHOM_CLIENT_CLI_RASTER_GRID_H_
#define FATHOM_CLIENT_CLI_RASTER_GRID_H_

#include <cstdint>
#include <optional>
#include <vector>

#include "client/cli/arguments.h"

namespace fathom::client::cli {

// Rows run north to south, columns west to east. Longitudes grow without
// wrapping: column c covers west_deg + c * step, which may pass 180.
struct LonLatGrid {
  double north_deg = 0;
  double west_deg = 0;
  double latitude_step_deg = 0;
  double longitude_step_deg = 0;
  std::int64_t rows = 0;
  std::int64_t columns = 0;
  // The columns close the circle: any column number is valid.
  bool periodic = false;

  double CenterLatitude(std::int64_t row) const {
    return north_deg - (static_cast<double>(row) + 0.5) * latitude_step_deg;
  }
  double CenterLongitude(std::int64_t column) const {
    return west_deg + (static_cast<double>(column) + 0.5) * longitude_step_deg;
  }
};

// The cells of `grid` that touch `box` (all, without one) and that do not
// reach beyond a pole; nullopt if there are none. Where a grid of less than a
// turn touches the box on two sides, the wider part is kept. The result is
// never wider than a turn.
std::optional<LonLatGrid> Clip(const LonLatGrid& grid,
                               const std::optional<GeoBox>& box);

struct GridBlock {
  std::int64_t first_row = 0;
  std::int64_t first_column = 0;
  std::int64_t rows = 0;
  std::int64_t columns = 0;
};

// Cuts a grid into blocks of at most `max_cells` cells, about square, row by
// row from the north-west. No block's cell middles lie on both sides of the
// antimeridian. REQUIRES: max_cells >= 1.
std::vector<GridBlock> CutIntoBlocks(const LonLatGrid& grid,
                                     std::int64_t max_cells);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_RASTER_GRID_H_
