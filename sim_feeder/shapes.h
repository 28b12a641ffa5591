// Shapes that a scenario sets on the seabed: what a map must not average away,
// at places and sizes that are known.

#ifndef FATHOM_SIM_FEEDER_SHAPES_H_
#define FATHOM_SIM_FEEDER_SHAPES_H_

#include <functional>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "map/geodesy/points.h"
#include "sim_feeder/local_terrain.h"

namespace fathom::feeder {

enum class ShapeKind {
  // From 0 at the place to height_m at length_m along the azimuth, and so on
  // beyond; level across.
  kSlope,
  // A Gaussian across its line, of 1 sigma width_m / 2; length_m long, ending
  // as it is wide. A channel is a ridge of negative height.
  kRidge,
  kChannel,
  // A Gaussian of 1 sigma width_m / 2 about its place.
  kPinnacle,
  // Upright sides: length_m along the azimuth by width_m across, height_m
  // above the seabed at each place. A wall is a long thin one.
  kWreck,
  kWall,
};

struct Shape {
  ShapeKind kind = ShapeKind::kPinnacle;
  // Its middle (a slope's begin) in the plane about the area's south-west
  // corner, metres.
  double north_m = 0.0;
  double east_m = 0.0;
  // Of its length, degrees clockwise from the plane's north.
  double azimuth_deg = 0.0;
  double length_m = 100.0;
  double width_m = 10.0;
  // Above the seabed, metres; a channel's depth below it. > 0 but for slopes.
  double height_m = 5.0;
};

// How much the shapes raise the seabed at a place, metres: slopes add up; of
// the others the highest (and the deepest channel) counts.
double RaisedM(const std::vector<Shape>& shapes, double north_m, double east_m);

// The seabed `depth_m` (by north and east in the plane that touches the Earth
// at `origin`) with the shapes, on a grid of cell_m over `box`. Errors:
// RESOURCE_EXHAUSTED above 16 M cells, naming the cell that would do.
absl::StatusOr<Terrain> ShapedTerrain(
    const std::function<std::optional<double>(double, double)>& depth_m,
    const std::vector<Shape>& shapes, const map::GeodeticPoint& origin,
    const PlaneBox& box, double cell_m);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_SHAPES_H_
