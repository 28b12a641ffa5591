// Angles that wrap. Pure functions.

#ifndef FATHOM_SIM_FEEDER_ANGLES_H_
#define FATHOM_SIM_FEEDER_ANGLES_H_

#include <cmath>
#include <numbers>

namespace fathom::feeder {

inline constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;
inline constexpr double kRadiansPerDegree = std::numbers::pi / 180.0;

// The same direction in (-pi, pi]. REQUIRES: finite.
inline double WrapToPi(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, 2.0 * std::numbers::pi);
  return wrapped <= -std::numbers::pi ? std::numbers::pi : wrapped;
}

// The same direction in [0, 360). REQUIRES: finite.
inline double WrapTo360(double angle_deg) {
  const double wrapped = std::fmod(angle_deg, 360.0);
  const double positive = wrapped < 0.0 ? wrapped + 360.0 : wrapped;
  return positive >= 360.0 ? 0.0 : positive;
}

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_ANGLES_H_
