// What a real forward-looking sonar does wrong (Nervegna 2002, section 3.3):
// returns that are missing, that come by other ways, or from other sonars; a
// wrong speed of sound; a tide that nobody took off.

#ifndef FATHOM_SIM_FEEDER_SONAR_FAULTS_H_
#define FATHOM_SIM_FEEDER_SONAR_FAULTS_H_

#include <vector>

#include "absl/status/status.h"
#include "sim_feeder/forward_sonar.h"
#include "sim_feeder/random.h"

namespace fathom::feeder {

// Shares are probabilities of a measurement, in [0, 1], together at most 1.
struct SonarFaults {
  // There is no return.
  double dropout_share = 0.0;
  // The way by the surface is taken for the way: the seabed seems twice as far
  // below the sonar.
  double ghost_share = 0.0;
  // Another sonar's ping: anywhere between sonar and seabed, uniform.
  double crosstalk_share = 0.0;
  // Speed of sound over the true one, less 1, in [-0.1, 0.1]: distances from
  // the sonar are too long by it.
  double sound_speed_error = 0.0;
  // The water stands so far above the datum, metres, in [-20, 20], and depths
  // are told as if it did not.
  double tide_m = 0.0;

  // Whether the sonar tells what it measured.
  bool none() const { return *this == SonarFaults{}; }
  bool operator==(const SonarFaults&) const = default;
};

// Errors: INVALID_ARGUMENT naming the option and its range.
absl::Status ValidateSonarFaults(const SonarFaults& faults);

// Of what a sonar at `sonar_depth_m` measured, what it tells. Draws as many
// numbers for each measurement whatever the shares are (none without any
// fault). REQUIRES: valid.
std::vector<SonarMeasurement> WithFaults(
    const SonarFaults& faults, double sonar_depth_m,
    std::vector<SonarMeasurement> measurements, Random& random);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_SONAR_FAULTS_H_
