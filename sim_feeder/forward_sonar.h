// The active forward-looking sonar: Nervegna 2002, algorithm FLS-MEAS, fig.
// 3-3, after the Reson SeaBat 8101.
//
// Beams that fall into one sonar cell become one measurement: range and
// bearing of the cell, mean depth and a standard deviation. Departures from
// the figure, each an erratum of it:
//  - lines 10-11 divide by scale_factor where the scaled cell size is meant;
//    here a cell index is floor(x / sonar_cell_m);
//  - lines 44-51 give range and bearing of the cell's south-west corner; here
//    of its centre, which is where a map of the same cells must put it;
//  - line 54 needs atan2(dy, dx);
//  - lines 38-41 draw the variance from a Gaussian, which divides by zero for
//    n = 1 and may be negative for small n; here it is drawn from the exact
//    sigma^2 chi^2(n-1) / (n-1) (appendix A.2), and is sigma^2 for n = 1;
//  - line 43 reports the deviation s of single beams; the measurement is a
//    mean of n, so its own 1 sigma is s / sqrt(n) (appendix A.1).

#ifndef FATHOM_SIM_FEEDER_FORWARD_SONAR_H_
#define FATHOM_SIM_FEEDER_FORWARD_SONAR_H_

#include <vector>

#include "absl/status/status.h"
#include "sim_feeder/local_terrain.h"
#include "sim_feeder/random.h"
#include "sim_feeder/swath.h"

namespace fathom::feeder {

struct ForwardSonarOptions {
  BeamFan fan;
  // Noise of a single beam's depth, 1 sigma metres, >= 0 (thesis sigma; its
  // mean mu is 0).
  double beam_std_m = 0.3;
  // Side of a sonar cell, metres, > 0: terrain cell / scale factor. Cells line
  // up with the plane's origin.
  double sonar_cell_m = 10.0;
  // Least reported deviation, metres, > 0. s of two beams is often near 0,
  // and a map that weighs by 1 / s^2 would take such a cell for exact; a real
  // sonar never states less than its resolution.
  double least_std_m = 0.02;
};

// Errors: INVALID_ARGUMENT naming the option and its range.
absl::Status ValidateForwardSonar(const ForwardSonarOptions& options);

// One measurement, for one sonar cell.
struct SonarMeasurement {
  // Horizontal, from the sonar to the cell's centre, metres (eq. 4.2).
  double range_m = 0.0;
  // Of the centre, clockwise from the bow, radians in (-pi, pi] (eq. 4.1).
  double bearing_rad = 0.0;
  // Mean of the beams' depths plus noise, metres, positive down.
  double depth_m = 0.0;
  // 1 sigma of that mean, metres, > 0.
  double std_m = 0.0;
  // How many beams n fell into the cell.
  int beam_count = 0;
};

// Noise of the mean of n beams, and the deviation that they show.
struct CellNoise {
  // N(0, sigma^2 / n), metres.
  double mean_m = 0.0;
  // s: root of sigma^2 chi^2(n-1) / (n-1); sigma for n = 1. Metres.
  double beam_std_m = 0.0;
};

// REQUIRES: beam_std_m >= 0, beam_count >= 1.
CellNoise DrawCellNoise(Random& random, double beam_std_m, int beam_count);

// The measurements of one ping, port to starboard; empty where nothing
// returned.
std::vector<SonarMeasurement> MeasureForward(const LocalTerrain& terrain,
                                             const ForwardSonarOptions& options,
                                             const SonarPlace& sonar,
                                             Random& random);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_FORWARD_SONAR_H_
