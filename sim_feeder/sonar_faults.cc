#include "sim_feeder/sonar_faults.h"

#include <utility>

#include "sim_feeder/named_range.h"

namespace fathom::feeder {

absl::Status ValidateSonarFaults(const SonarFaults& faults) {
  const double shares =
      faults.dropout_share + faults.ghost_share + faults.crosstalk_share;
  return CheckRanges(
      {{"dropout_share", faults.dropout_share, 0, 1},
       {"ghost_share", faults.ghost_share, 0, 1},
       {"crosstalk_share", faults.crosstalk_share, 0, 1},
       {"the sum of dropout_share, ghost_share and crosstalk_share", shares, 0,
        1},
       {"sound_speed_error", faults.sound_speed_error, -0.1, 0.1},
       {"tide_m", faults.tide_m, -20, 20}});
}

std::vector<SonarMeasurement> WithFaults(
    const SonarFaults& faults, double sonar_depth_m,
    std::vector<SonarMeasurement> measurements, Random& random) {
  if (faults.none()) return measurements;
  const double stretch = 1.0 + faults.sound_speed_error;
  std::vector<SonarMeasurement> told;
  told.reserve(measurements.size());
  for (SonarMeasurement& measured : measurements) {
    const double draw = random.Uniform();
    const double place = random.Uniform();
    double below_m = measured.depth_m - sonar_depth_m;
    if (draw < faults.dropout_share) continue;
    if (draw < faults.dropout_share + faults.ghost_share) {
      below_m *= 2.0;
    } else if (draw < faults.dropout_share + faults.ghost_share +
                          faults.crosstalk_share) {
      below_m *= place;
    }
    measured.depth_m = sonar_depth_m + stretch * below_m + faults.tide_m;
    measured.range_m *= stretch;
    told.push_back(measured);
  }
  return told;
}

}  // namespace fathom::feeder
