// The true seabed: a grid of depths with its place on the Earth.
//
// The independent oracle of the map under test: nothing of map/ but geodetic
// points is used here. Depths are metres below the raster's zero, positive
// down; land is a negative depth, a missing value is NaN. Between the centres
// of its cells the seabed is bilinear, so it is continuous and its value at
// any place is exact.
//
// Immutable after construction. DepthAtGrid is thread-safe; DepthAt is as
// thread-safe as the georeference (GDAL's is not).

#ifndef FATHOM_SIM_FEEDER_TERRAIN_H_
#define FATHOM_SIM_FEEDER_TERRAIN_H_

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "map/geodesy/points.h"

namespace fathom::feeder {

// A place in the grid: (0, 0) is the outer corner of the first cell, cell
// (row, column) has its centre at (column + 0.5, row + 0.5).
struct GridPoint {
  double column = 0.0;
  double row = 0.0;
};

// The two ways between the Earth and the grid; nullopt where there is none.
struct Georeference {
  std::function<std::optional<GridPoint>(const map::GeodeticPoint&)> to_grid;
  std::function<std::optional<map::GeodeticPoint>(const GridPoint&)>
      to_geodetic;
};

struct TerrainGrid {
  std::size_t rows = 0;
  std::size_t columns = 0;
  // Row-major, metres, positive down, NaN: no value.
  std::vector<float> depth_m = {};
  // Side of a cell, metres, about: what a ray steps by.
  double cell_size_m = 0.0;
  // The last column is followed by the first (a grid around the whole Earth).
  bool wraps_east = false;
  // What it is, for people.
  std::string name = {};
};

class Terrain {
 public:
  // Errors: INVALID_ARGUMENT when the grid is smaller than 2 x 2, its size
  // does not fit its values, or the cell size is not positive.
  static absl::StatusOr<Terrain> Create(TerrainGrid grid,
                                        Georeference georeference);

  // Depth at a place, metres; nullopt outside the outermost cell centres and
  // where one of the four cells around has no value.
  std::optional<double> DepthAt(const map::GeodeticPoint& point) const;

  // The same at a grid place. About 10 ns.
  std::optional<double> DepthAtGrid(const GridPoint& place) const;

  // The middle of the grid.
  absl::StatusOr<map::GeodeticPoint> Middle() const;

  const Georeference& georeference() const { return georeference_; }
  const TerrainGrid& grid() const { return grid_; }

 private:
  Terrain(TerrainGrid grid, Georeference georeference);

  TerrainGrid grid_;
  Georeference georeference_;
};

// A grid of latitude and longitude whose outer north-west corner is
// `north_west` and whose rows go south: longitudes are understood modulo 360.
// REQUIRES: both steps positive.
Georeference GeographicReference(const map::GeodeticPoint& north_west,
                                 double latitude_step_deg,
                                 double longitude_step_deg);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_TERRAIN_H_
