#include "sim_feeder/local_terrain.h"

#include <cmath>
#include <limits>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"

namespace fathom::feeder {
namespace {

constexpr double kMaxSideM = 200'000.0;

}  // namespace

absl::StatusOr<LocalTerrain> LocalTerrain::Create(
    std::shared_ptr<const Terrain> terrain, const map::GeodeticPoint& origin,
    const PlaneBox& box) {
  const double north_extent_m = box.north_m - box.south_m;
  const double east_extent_m = box.east_m - box.west_m;
  if (!(north_extent_m > 0.0) || !(east_extent_m > 0.0) ||
      north_extent_m > kMaxSideM || east_extent_m > kMaxSideM) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "the area is %g m north by %g m east; each must be above 0 and at "
        "most %g m",
        north_extent_m, east_extent_m, kMaxSideM));
  }
  return LocalTerrain(std::move(terrain), origin, box);
}

LocalTerrain::LocalTerrain(std::shared_ptr<const Terrain> terrain,
                           const map::GeodeticPoint& origin,
                           const PlaneBox& box)
    : terrain_(std::move(terrain)), frame_(origin), box_(box) {
  const std::size_t rows = static_cast<std::size_t>(std::ceil(
                               (box.north_m - box.south_m) / lattice_m_)) +
                           2;
  lattice_columns_ = static_cast<std::size_t>(
                         std::ceil((box.east_m - box.west_m) / lattice_m_)) +
                     2;
  lattice_.reserve(rows * lattice_columns_);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  // In a grid around the Earth, columns of one lattice square must not lie on
  // both sides of the seam: count on from the first.
  const double turn = static_cast<double>(terrain_->grid().columns);
  std::optional<double> first_column;
  for (std::size_t i = 0; i < rows; ++i) {
    const double north_m = box.south_m + static_cast<double>(i) * lattice_m_;
    for (std::size_t j = 0; j < lattice_columns_; ++j) {
      const double east_m = box.west_m + static_cast<double>(j) * lattice_m_;
      GridPoint place = terrain_->georeference()
                            .to_grid(frame_.ToGeodetic(north_m, east_m))
                            .value_or(GridPoint{.column = nan, .row = nan});
      if (terrain_->grid().wraps_east && !std::isnan(place.column)) {
        if (!first_column.has_value()) first_column = place.column;
        const double turns = std::round((place.column - *first_column) / turn);
        place.column -= turns * turn;
      }
      lattice_.push_back(place);
    }
  }
}

std::optional<double> LocalTerrain::DepthAt(double north_m,
                                            double east_m) const {
  if (!(north_m >= box_.south_m && north_m <= box_.north_m &&
        east_m >= box_.west_m && east_m <= box_.east_m)) {
    return std::nullopt;
  }
  const double y = (north_m - box_.south_m) / lattice_m_;
  const double x = (east_m - box_.west_m) / lattice_m_;
  const std::size_t row = static_cast<std::size_t>(y);
  const std::size_t column = static_cast<std::size_t>(x);
  const double v = y - static_cast<double>(row);
  const double u = x - static_cast<double>(column);
  const GridPoint* south = lattice_.data() + row * lattice_columns_ + column;
  const GridPoint* north = south + lattice_columns_;
  const double w00 = (1.0 - v) * (1.0 - u);
  const double w01 = (1.0 - v) * u;
  const double w10 = v * (1.0 - u);
  const double w11 = v * u;
  GridPoint place{.column = w00 * south[0].column + w01 * south[1].column +
                            w10 * north[0].column + w11 * north[1].column,
                  .row = w00 * south[0].row + w01 * south[1].row +
                         w10 * north[0].row + w11 * north[1].row};
  if (terrain_->grid().wraps_east) {
    const double turn = static_cast<double>(terrain_->grid().columns);
    if (place.column >= turn) place.column -= turn;
    if (place.column < 0.0) place.column += turn;
  }
  return terrain_->DepthAtGrid(place);
}

}  // namespace fathom::feeder
