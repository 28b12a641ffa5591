// Where a vehicle was and how it was turned when it measured.
//
// The thesis's vehicle position (section 4.2, fig. 4-1): lat_uuv, lon_uuv and
// the heading phi. Plain value, no behaviour.

#ifndef FATHOM_MAP_GEODESY_POSE_H_
#define FATHOM_MAP_GEODESY_POSE_H_

#include "map/geodesy/points.h"

namespace fathom::map {

struct Pose {
  GeodeticPoint position;
  // Below the mission's vertical datum, positive down.
  double depth_m = 0.0;
  // Clockwise from true north. Any finite value; [0, 360) by custom.
  double heading_deg = 0.0;
  // Horizontal 1-sigma of the position, per axis; 0 means taken as exact, as
  // in the thesis (its section 7.2 leaves it to future work).
  double position_std_m = 0.0;

  friend bool operator==(const Pose&, const Pose&) = default;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_GEODESY_POSE_H_
