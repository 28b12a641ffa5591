// Simulated encounters for the contacts' figures: truth and what a passive
// sonar on a vehicle under way tells of it (Nervegna 2002, section 3.6).

#ifndef FATHOM_TESTS_ACCURACY_CONTACT_RUNS_H_
#define FATHOM_TESTS_ACCURACY_CONTACT_RUNS_H_

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "map/contacts/contact_map.h"

namespace fathom::accuracy {

struct Encounter {
  // [n, e, vn, ve] of the contact at the first report, metres and m/s, and 1
  // sigma of what is drawn on top of its velocity.
  Eigen::Vector4d contact = Eigen::Vector4d::Zero();
  double velocity_std_m_s = 0;
  // Density of its accelerations, m^2/s^3.
  double process_noise_m2_s3 = 0;
  // The vehicle's velocity, from the plane's origin.
  Eigen::Vector2d vehicle_m_s = Eigen::Vector2d::Zero();
  double range_std_m = 0;
  double bearing_std_deg = 0;
  double step_s = 10;
  int reports = 61;
};

// One report of a run, the truth then and the report itself.
struct Moment {
  double at_s = 0;
  Eigen::Vector4d truth;
  Eigen::Vector2d vehicle;
  double range_m = 0;
  double azimuth_deg = 0;
  map::ContactReport report;
};

// The plane's origin, 41.5 N 71.4 W, and the first report's time.
map::GeodeticPoint Origin();
Time AtS(double seconds);

// The same seed draws the same run whatever the noise is.
std::vector<Moment> Run(const Encounter& encounter, std::uint64_t seed);

// The truth `ahead_s` after a moment, drawn anew.
Eigen::Vector4d Ahead(const Encounter& encounter, const Eigen::Vector4d& truth,
                      double ahead_s, std::uint64_t seed);

// The estimate less the truth, [n, e, vn, ve] in the estimate's plane.
Eigen::Vector4d ErrorOf(const map::ContactPoint& estimate,
                        const Eigen::Vector4d& truth);

}  // namespace fathom::accuracy

#endif  // FATHOM_TESTS_ACCURACY_CONTACT_RUNS_H_
