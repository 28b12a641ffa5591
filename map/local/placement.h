// Where measurements fall: from ranges and bearings to places in the grid.
//
// Nervegna 2002, section 4.3.3, eqs. 4.1, 4.2 and 4.4, each under its name, for
// many beams side by side; eq. 4.5 is LocalGrid::Locate. Eq. 4.3 (latitude and
// longitude to metres) is replaced by NedFrame::ToNed, see
// map/geodesy/ned_frame.h; as printed it is SphericalNorthEast there.
//
// The grid's plane is NED at the south-west corner: x north, y east. All
// functions are pure and thread-safe. A lane that holds no beam may hold any
// finite number.

#ifndef FATHOM_MAP_LOCAL_PLACEMENT_H_
#define FATHOM_MAP_LOCAL_PLACEMENT_H_

#include <Eigen/Core>

#include "map/geodesy/points.h"

namespace fathom::map {

// Numbers of several beams, reckoned four or two at a time: a beam's sine and
// cosine cost a third of what they do alone.
inline constexpr int kBeamsAtOnce = 16;
using BeamFloats = Eigen::Array<float, kBeamsAtOnce, 1>;
using BeamDoubles = Eigen::Array<double, kBeamsAtOnce, 1>;

// Places of beams on the plane, metres or cells.
struct BeamPlaces {
  BeamDoubles north;
  BeamDoubles east;
};

// Eq. 4.1: theta = phi + beta. All radians; the result is not reduced.
inline BeamFloats BeamAzimuthRad(double heading_rad,
                                 const BeamFloats& bearing_rad) {
  return static_cast<float>(heading_rad) + bearing_rad;
}

// Eq. 4.2: (r cos theta, r sin theta), metres north and east of the vehicle.
// In float: with |theta| < 2 pi the error of both equations is below 7e-7 r,
// 0.7 mm at a kilometre.
inline BeamPlaces BeamOffset(const BeamFloats& range_m,
                             const BeamFloats& azimuth_rad) {
  // Into variables: within a cast Eigen reckons them one by one.
  const BeamFloats north_m = range_m * azimuth_rad.cos();
  const BeamFloats east_m = range_m * azimuth_rad.sin();
  return {.north = north_m.cast<double>(), .east = east_m.cast<double>()};
}

// Eq. 4.4: the vehicle's place plus the offset, metres.
inline BeamPlaces ObstaclePosition(const NedPoint& vehicle,
                                   const BeamPlaces& offset) {
  return {.north = vehicle.north_m + offset.north,
          .east = vehicle.east_m + offset.east};
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_PLACEMENT_H_
