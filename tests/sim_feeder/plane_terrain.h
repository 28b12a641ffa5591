// A small true seabed whose grid lies on the plane's own metres, so that
// expectations can be computed by hand: no geodesy gets in the way.

#ifndef FATHOM_TESTS_SIM_FEEDER_PLANE_TERRAIN_H_
#define FATHOM_TESTS_SIM_FEEDER_PLANE_TERRAIN_H_

#include <functional>
#include <memory>
#include <utility>

#include "map/geodesy/ned_frame.h"
#include "sim_feeder/local_terrain.h"
#include "sim_feeder/terrain.h"

namespace fathom::feeder {

inline constexpr map::GeodeticPoint kTestOrigin = {.latitude_deg = 41.5,
                                                   .longitude_deg = -70.7};

// Depths depth_m(north_m, east_m) at the centres of cells of `cell_m`, from
// -`reach_m` to +`reach_m` about kTestOrigin in both directions.
inline std::shared_ptr<const Terrain> MakePlaneTerrain(
    const std::function<double(double, double)>& depth_m, double cell_m,
    double reach_m) {
  TerrainGrid grid;
  grid.rows = static_cast<std::size_t>(2.0 * reach_m / cell_m);
  grid.columns = grid.rows;
  grid.cell_size_m = cell_m;
  grid.name = "test plane";
  for (std::size_t i = 0; i < grid.rows; ++i) {
    for (std::size_t j = 0; j < grid.columns; ++j) {
      grid.depth_m.push_back(static_cast<float>(
          depth_m(reach_m - (static_cast<double>(i) + 0.5) * cell_m,
                  (static_cast<double>(j) + 0.5) * cell_m - reach_m)));
    }
  }
  const map::NedFrame frame(kTestOrigin);
  Georeference georeference;
  georeference.to_grid =
      [=](const map::GeodeticPoint& point) -> std::optional<GridPoint> {
    const map::NedPoint ned = frame.ToNed(point);
    return GridPoint{.column = (ned.east_m + reach_m) / cell_m,
                     .row = (reach_m - ned.north_m) / cell_m};
  };
  georeference.to_geodetic =
      [=](const GridPoint& place) -> std::optional<map::GeodeticPoint> {
    return frame.ToGeodetic(reach_m - place.row * cell_m,
                            place.column * cell_m - reach_m);
  };
  return std::make_shared<const Terrain>(
      *Terrain::Create(std::move(grid), georeference));
}

// The same as rays see it, all of it.
inline std::shared_ptr<const LocalTerrain> MakePlaneSeabed(
    const std::function<double(double, double)>& depth_m, double cell_m = 10.0,
    double reach_m = 500.0) {
  return std::make_shared<const LocalTerrain>(*LocalTerrain::Create(
      MakePlaneTerrain(depth_m, cell_m, reach_m), kTestOrigin,
      {.south_m = -reach_m,
       .north_m = reach_m,
       .west_m = -reach_m,
       .east_m = reach_m}));
}

}  // namespace fathom::feeder

#endif  // FATHOM_TESTS_SIM_FEEDER_PLANE_TERRAIN_H_
