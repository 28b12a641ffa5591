// The true seabed in metres about an origin: what rays are shot at.
//
// A Terrain is asked by latitude and longitude, which costs a map projection
// each time. Here the way from the plane to the terrain's grid is tabulated
// on a lattice and read bilinearly. The table moves places, never depths; its
// error is below lattice^2 / (8 R) tan(latitude): 0.1 mm at 64 m and 41.5 N.
//
// Immutable after Create; thread-safe.

#ifndef FATHOM_SIM_FEEDER_LOCAL_TERRAIN_H_
#define FATHOM_SIM_FEEDER_LOCAL_TERRAIN_H_

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "map/geodesy/ned_frame.h"
#include "map/geodesy/points.h"
#include "sim_feeder/terrain.h"

namespace fathom::feeder {

// A rectangle in a plane, metres north and east of its origin.
struct PlaneBox {
  double south_m = 0.0;
  double north_m = 0.0;
  double west_m = 0.0;
  double east_m = 0.0;
};

class LocalTerrain {
 public:
  // Tabulates `box` of the plane that touches the Earth at `origin`.
  //
  // Errors: INVALID_ARGUMENT when the box is empty or larger than 200 km a
  // side (the table would pass 10 M points).
  static absl::StatusOr<LocalTerrain> Create(
      std::shared_ptr<const Terrain> terrain, const map::GeodeticPoint& origin,
      const PlaneBox& box);

  // Depth, metres, positive down; nullopt outside the box or the terrain and
  // where the terrain has no value. About 15 ns.
  std::optional<double> DepthAt(double north_m, double east_m) const;

  const map::NedFrame& frame() const { return frame_; }
  const PlaneBox& box() const { return box_; }
  // Side of a terrain cell, metres, about.
  double cell_size_m() const { return terrain_->grid().cell_size_m; }
  const Terrain& terrain() const { return *terrain_; }

 private:
  LocalTerrain(std::shared_ptr<const Terrain> terrain,
               const map::GeodeticPoint& origin, const PlaneBox& box);

  std::shared_ptr<const Terrain> terrain_;
  map::NedFrame frame_;
  PlaneBox box_;
  double lattice_m_ = 64.0;
  std::size_t lattice_columns_ = 0;
  // Row-major from the south-west; NaN where the terrain has no such place.
  std::vector<GridPoint> lattice_;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_LOCAL_TERRAIN_H_
