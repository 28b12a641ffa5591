// Where the beams of one ping meet the seabed.
//
// Nervegna 2002, section 3.5.1: 101 rays of zero width, 1.5 degrees apart, in
// the plane perpendicular to the vehicle's path; the middle one points
// straight down, the outermost 75 degrees to port and to starboard.
//
// The terrain is looked up along the two half lines across the track and taken
// as straight between the lookups. A ray farther from the vertical lies above
// one nearer to it, so the first meetings come in order and one walk along the
// profile finds them all: cost O(lookups + beams), about 2 us.

#ifndef FATHOM_SIM_FEEDER_SWATH_H_
#define FATHOM_SIM_FEEDER_SWATH_H_

#include <vector>

#include "sim_feeder/local_terrain.h"

namespace fathom::feeder {

struct BeamFan {
  // Odd, >= 1: the middle beam points down.
  int beam_count = 101;
  // Between neighbours, degrees; (beam_count - 1) / 2 * spacing_deg < 90.
  double spacing_deg = 1.5;
  // Longest way along a ray, metres: beyond it there is no return.
  double max_slant_range_m = 300.0;
};

// Where the sonar is, in the terrain's plane.
struct SonarPlace {
  double north_m = 0.0;
  double east_m = 0.0;
  double depth_m = 0.0;
  // Course in the plane, radians clockwise from its north axis.
  double course_rad = 0.0;
};

struct BeamHit {
  // 0 outermost port, beam_count - 1 outermost starboard.
  int beam = 0;
  double north_m = 0.0;
  double east_m = 0.0;
  // The terrain's own depth at that place (thesis: looked up in the terrain
  // database), not the ray's.
  double depth_m = 0.0;
};

// The hits, port to starboard. A beam is absent where its ray leaves the
// terrain, meets a place without value or is longer than the range; none is
// there when the sonar lies in the ground.
//
// Lookups lie a quarter of a terrain cell apart: between them the bilinear
// seabed bends by less than 0.008 cell^2 of its twist (2 cm on Woods Hole's
// rocks at 10 m).
std::vector<BeamHit> IntersectSwath(const LocalTerrain& terrain,
                                    const BeamFan& fan,
                                    const SonarPlace& sonar);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_SWATH_H_
