#include "client/cli/raster_sampling.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/status_macros.h"
#include "client/cli/geo_math.h"

namespace fathom::client::cli {
namespace {

// Cells read at once.
constexpr std::int64_t kBlockCells = 512 * 512;

}  // namespace

absl::StatusOr<std::vector<float>> DepthsAt(DepthRaster& raster,
                                            const Region& region) {
  std::vector<float> depths(region.depth_m.size(),
                            std::numeric_limits<float>::quiet_NaN());
  const LonLatGrid& grid = raster.grid();
  for (const GridBlock& block : CutIntoBlocks(grid, kBlockCells)) {
    FATHOM_ASSIGN_OR_RETURN(const v1::DepthTile tile, raster.Read(block));
    if (tile.depth_m().empty()) continue;
    const double north = grid.north_deg - static_cast<double>(block.first_row) *
                                              grid.latitude_step_deg;
    const double west =
        grid.west_deg +
        static_cast<double>(block.first_column) * grid.longitude_step_deg;
    // Rows of the region whose middles may lie in the block.
    const auto row_of = [&](double latitude_deg) {
      return std::clamp((region.north_west.latitude_deg() - latitude_deg) /
                                region.latitude_step_deg -
                            0.5,
                        0.0, static_cast<double>(region.rows));
    };
    const auto first = static_cast<std::uint32_t>(std::floor(row_of(north)));
    const auto end = static_cast<std::uint32_t>(std::min<double>(
        region.rows, std::ceil(row_of(north - static_cast<double>(block.rows) *
                                                  grid.latitude_step_deg)) +
                         1));
    for (std::uint32_t row = first; row < end; ++row) {
      const double latitude_deg = region.north_west.latitude_deg() -
                                  (row + 0.5) * region.latitude_step_deg;
      const double y =
          std::floor((north - latitude_deg) / grid.latitude_step_deg);
      if (y < 0 || y >= static_cast<double>(block.rows)) continue;
      for (std::uint32_t column = 0; column < region.columns; ++column) {
        const double longitude_deg = region.north_west.longitude_deg() +
                                     (column + 0.5) * region.longitude_step_deg;
        double east_deg = WrapLongitude(longitude_deg - west);
        if (east_deg < 0) east_deg += 360;
        const double x = std::floor(east_deg / grid.longitude_step_deg);
        if (x >= static_cast<double>(block.columns)) continue;
        depths[region.Index(row, column)] =
            tile.depth_m(static_cast<int>(y) * static_cast<int>(block.columns) +
                         static_cast<int>(x));
      }
    }
  }
  return depths;
}

}  // namespace fathom::client::cli
