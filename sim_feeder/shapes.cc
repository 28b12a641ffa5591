#include "sim_feeder/shapes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_format.h"
#include "map/geodesy/ned_frame.h"
#include "sim_feeder/angles.h"

namespace fathom::feeder {
namespace {

constexpr double kMaxCells = 16e6;

double GaussianM(const Shape& shape, double off_m) {
  const double sigmas = off_m / (0.5 * shape.width_m);
  return shape.height_m * std::exp(-0.5 * sigmas * sigmas);
}

}  // namespace

double RaisedM(const std::vector<Shape>& shapes, double north_m,
               double east_m) {
  double slopes_m = 0;
  double highest_m = 0;
  double deepest_m = 0;
  for (const Shape& shape : shapes) {
    const double azimuth_rad = shape.azimuth_deg * kRadiansPerDegree;
    const double dn_m = north_m - shape.north_m;
    const double de_m = east_m - shape.east_m;
    const double along_m =
        dn_m * std::cos(azimuth_rad) + de_m * std::sin(azimuth_rad);
    const double across_m =
        de_m * std::cos(azimuth_rad) - dn_m * std::sin(azimuth_rad);
    // Beyond the ends of a line.
    const double past_m =
        std::max(0.0, std::fabs(along_m) - 0.5 * shape.length_m);
    switch (shape.kind) {
      case ShapeKind::kSlope:
        slopes_m += shape.height_m * along_m / shape.length_m;
        break;
      case ShapeKind::kRidge:
        highest_m =
            std::max(highest_m, GaussianM(shape, std::hypot(across_m, past_m)));
        break;
      case ShapeKind::kChannel:
        deepest_m =
            std::max(deepest_m, GaussianM(shape, std::hypot(across_m, past_m)));
        break;
      case ShapeKind::kPinnacle:
        highest_m =
            std::max(highest_m, GaussianM(shape, std::hypot(dn_m, de_m)));
        break;
      case ShapeKind::kWreck:
      case ShapeKind::kWall:
        if (past_m == 0 && std::fabs(across_m) <= 0.5 * shape.width_m) {
          highest_m = std::max(highest_m, shape.height_m);
        }
        break;
    }
  }
  return slopes_m + highest_m - deepest_m;
}

absl::StatusOr<Terrain> ShapedTerrain(
    const std::function<std::optional<double>(double, double)>& depth_m,
    const std::vector<Shape>& shapes, const map::GeodeticPoint& origin,
    const PlaneBox& box, double cell_m) {
  const double rows = std::ceil((box.north_m - box.south_m) / cell_m);
  const double columns = std::ceil((box.east_m - box.west_m) / cell_m);
  if (!(rows * columns <= kMaxCells)) {
    return absl::ResourceExhaustedError(absl::StrFormat(
        "a seabed of %g x %g cells is too large, at most %g: a cell of %.1f m "
        "would do",
        rows, columns, kMaxCells,
        cell_m * std::sqrt(rows * columns / kMaxCells) + 0.05));
  }
  TerrainGrid grid;
  grid.rows = static_cast<std::size_t>(rows);
  grid.columns = static_cast<std::size_t>(columns);
  grid.cell_size_m = cell_m;
  grid.name = absl::StrFormat("%d shapes", shapes.size());
  grid.depth_m.reserve(grid.rows * grid.columns);
  for (std::size_t i = 0; i < grid.rows; ++i) {
    const double north_m =
        box.north_m - (static_cast<double>(i) + 0.5) * cell_m;
    for (std::size_t j = 0; j < grid.columns; ++j) {
      const double east_m =
          box.west_m + (static_cast<double>(j) + 0.5) * cell_m;
      const std::optional<double> base_m = depth_m(north_m, east_m);
      grid.depth_m.push_back(
          base_m.has_value()
              ? static_cast<float>(*base_m - RaisedM(shapes, north_m, east_m))
              : std::numeric_limits<float>::quiet_NaN());
    }
  }
  const map::NedFrame frame(origin);
  Georeference georeference;
  georeference.to_grid =
      [=](const map::GeodeticPoint& point) -> std::optional<GridPoint> {
    const map::NedPoint at = frame.ToNed(point);
    return GridPoint{.column = (at.east_m - box.west_m) / cell_m,
                     .row = (box.north_m - at.north_m) / cell_m};
  };
  georeference.to_geodetic =
      [=](const GridPoint& place) -> std::optional<map::GeodeticPoint> {
    return frame.ToGeodetic(box.north_m - place.row * cell_m,
                            box.west_m + place.column * cell_m);
  };
  return Terrain::Create(std::move(grid), std::move(georeference));
}

}  // namespace fathom::feeder
