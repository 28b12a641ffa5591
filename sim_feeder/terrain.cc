#include "sim_feeder/terrain.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"

namespace fathom::feeder {
namespace {

constexpr double kRounding = 1e-6;

}  // namespace

absl::StatusOr<Terrain> Terrain::Create(TerrainGrid grid,
                                        Georeference georeference) {
  if (grid.rows < 2 || grid.columns < 2) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "terrain \"%s\" has rows=%d columns=%d; at least 2 x 2 are needed",
        grid.name, grid.rows, grid.columns));
  }
  if (grid.depth_m.size() != grid.rows * grid.columns) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "terrain \"%s\" has %d values for rows=%d columns=%d", grid.name,
        grid.depth_m.size(), grid.rows, grid.columns));
  }
  if (!(grid.cell_size_m > 0.0) || !std::isfinite(grid.cell_size_m)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("terrain \"%s\" has cell_size_m=%g; it must be > 0",
                        grid.name, grid.cell_size_m));
  }
  return Terrain(std::move(grid), std::move(georeference));
}

Terrain::Terrain(TerrainGrid grid, Georeference georeference)
    : grid_(std::move(grid)), georeference_(std::move(georeference)) {}

std::optional<double> Terrain::DepthAt(const map::GeodeticPoint& point) const {
  const std::optional<GridPoint> place = georeference_.to_grid(point);
  if (!place.has_value()) return std::nullopt;
  return DepthAtGrid(*place);
}

std::optional<double> Terrain::DepthAtGrid(const GridPoint& place) const {
  double x = place.column - 0.5;
  double y = place.row - 0.5;
  const double last_row = static_cast<double>(grid_.rows - 1);
  const double last_column =
      static_cast<double>(grid_.columns - (grid_.wraps_east ? 0 : 1));
  if (grid_.wraps_east && x < 0.0) x += static_cast<double>(grid_.columns);
  // A millionth of a cell is rounding. Written so that NaN fails.
  if (!(y >= -kRounding && y <= last_row + kRounding && x >= -kRounding &&
        x <= last_column + kRounding)) {
    return std::nullopt;
  }
  x = std::clamp(x, 0.0, last_column);
  y = std::clamp(y, 0.0, last_row);
  std::size_t row = static_cast<std::size_t>(y);
  std::size_t column = static_cast<std::size_t>(x);
  if (row == grid_.rows - 1) --row;  // y is exactly the last centre.
  if (column == grid_.columns) --column;
  if (!grid_.wraps_east && column == grid_.columns - 1) --column;
  const std::size_t next = column + 1 == grid_.columns ? 0 : column + 1;
  const double v = y - static_cast<double>(row);
  const double u = x - static_cast<double>(column);
  const float* north = grid_.depth_m.data() + row * grid_.columns;
  const float* south = north + grid_.columns;
  const double top = (1.0 - u) * north[column] + u * north[next];
  const double bottom = (1.0 - u) * south[column] + u * south[next];
  const double depth_m = (1.0 - v) * top + v * bottom;
  if (std::isnan(depth_m)) return std::nullopt;
  return depth_m;
}

absl::StatusOr<map::GeodeticPoint> Terrain::Middle() const {
  const std::optional<map::GeodeticPoint> middle = georeference_.to_geodetic(
      {.column = 0.5 * static_cast<double>(grid_.columns),
       .row = 0.5 * static_cast<double>(grid_.rows)});
  if (!middle.has_value()) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "the middle of terrain \"%s\" has no place on the Earth", grid_.name));
  }
  return *middle;
}

Georeference GeographicReference(const map::GeodeticPoint& north_west,
                                 double latitude_step_deg,
                                 double longitude_step_deg) {
  Georeference georeference;
  georeference.to_grid =
      [=](const map::GeodeticPoint& point) -> std::optional<GridPoint> {
    // Into [west, west + 360), with a hair's tolerance for the west edge.
    double east_deg = point.longitude_deg - north_west.longitude_deg;
    east_deg -= 360.0 * std::floor((east_deg + 1e-9) / 360.0);
    return GridPoint{.column = east_deg / longitude_step_deg,
                     .row = (north_west.latitude_deg - point.latitude_deg) /
                            latitude_step_deg};
  };
  georeference.to_geodetic =
      [=](const GridPoint& place) -> std::optional<map::GeodeticPoint> {
    return map::GeodeticPoint{
        .latitude_deg = north_west.latitude_deg - place.row * latitude_step_deg,
        .longitude_deg = map::NormalizeLongitudeDeg(
            north_west.longitude_deg + place.column * longitude_step_deg)};
  };
  return georeference;
}

}  // namespace fathom::feeder
