// The passive sonar: Nervegna 2002, algorithm PAS-SONAR-MEAS, fig. 3-4.
//
// It hears every target at any range and bearing and gives both, each with
// white Gaussian noise; the range's deviation is tied to the bearing's by
// s_R = r tan(s_B) (eq. 3.1). Errata of the figure: lines 2-3 take the
// vehicle's own place where target minus vehicle is meant, and need atan2.

#ifndef FATHOM_SIM_FEEDER_PASSIVE_SONAR_H_
#define FATHOM_SIM_FEEDER_PASSIVE_SONAR_H_

#include "sim_feeder/random.h"

namespace fathom::feeder {

struct PassiveMeasurement {
  // Horizontal, metres. May be <= 0 when the noise is as large as the range:
  // such a measurement says nothing and must be left out.
  double range_m = 0.0;
  // Clockwise from the bow, radians in (-pi, pi].
  double bearing_rad = 0.0;
  // Stated deviations: eq. 3.1 with the measured range, since a sonar does
  // not know the true one. 1 sigma.
  double range_std_m = 0.0;
  double bearing_std_rad = 0.0;
};

// A place and a course in one plane.
struct PassiveGeometry {
  double sonar_north_m = 0.0;
  double sonar_east_m = 0.0;
  double course_rad = 0.0;
  double target_north_m = 0.0;
  double target_east_m = 0.0;
};

// REQUIRES: bearing_std_rad in [0, pi/3].
PassiveMeasurement MeasurePassive(const PassiveGeometry& geometry,
                                  double bearing_std_rad, Random& random);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_PASSIVE_SONAR_H_
