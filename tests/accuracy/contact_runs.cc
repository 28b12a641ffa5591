#include "tests/accuracy/contact_runs.h"

#include <cmath>
#include <random>

#include "map/geodesy/ned_frame.h"

namespace fathom::accuracy {
namespace {

using Random = std::mt19937_64;

// Constant velocity and white acceleration over T: q [T^3/3 T^2/2; T^2/2 T] on
// each axis, by its Cholesky factor.
void Move(Eigen::Vector4d& x, double T, double q, Random& random) {
  std::normal_distribution<double> normal;
  const double pp = std::sqrt(q * T * T * T / 3);
  const double vp = pp > 0 ? q * T * T / 2 / pp : 0;
  const double vv = std::sqrt(std::max(0.0, q * T - vp * vp));
  for (int axis = 0; axis < 2; ++axis) {
    const double a = normal(random);
    const double b = normal(random);
    x(axis) += T * x(axis + 2) + pp * a;
    x(axis + 2) += vp * a + vv * b;
  }
}

}  // namespace

map::GeodeticPoint Origin() {
  return {.latitude_deg = 41.5, .longitude_deg = -71.4};
}

Time AtS(double seconds) {
  return TimeFromUnixMicros(1'022'241'600'000'000 +
                            static_cast<std::int64_t>(seconds * 1e6));
}

std::vector<Moment> Run(const Encounter& encounter, std::uint64_t seed) {
  Random random(seed);
  std::normal_distribution<double> normal;
  const map::NedFrame plane(Origin());
  std::vector<Moment> moments;
  Eigen::Vector4d truth = encounter.contact;
  truth(2) += encounter.velocity_std_m_s * normal(random);
  truth(3) += encounter.velocity_std_m_s * normal(random);
  for (int i = 0; i < encounter.reports; ++i) {
    if (i > 0) {
      Move(truth, encounter.step_s, encounter.process_noise_m2_s3, random);
    }
    Moment moment;
    moment.at_s = encounter.step_s * i;
    moment.truth = truth;
    moment.vehicle = moment.at_s * encounter.vehicle_m_s;
    const map::GeodeticPoint own =
        plane.ToGeodetic(moment.vehicle(0), moment.vehicle(1));
    const map::RangeAzimuth seen =
        map::Inverse(own, plane.ToGeodetic(truth(0), truth(1)));
    moment.range_m = seen.distance_m;
    moment.azimuth_deg = seen.azimuth_deg;
    const double range_m =
        seen.distance_m + encounter.range_std_m * normal(random);
    const double bearing_deg =
        seen.azimuth_deg + encounter.bearing_std_deg * normal(random);
    moment.report.key = {.source = {"auv"}, .contact = {"c"}};
    moment.report.contact_class = map::ContactClass::kVessel;
    moment.report.time = AtS(moment.at_s);
    moment.report.observation =
        map::RangeBearing{.pose = {.position = own},
                          .range_m = std::max(range_m, 0.1),
                          .bearing_deg = bearing_deg,
                          .range_std_m = encounter.range_std_m,
                          .bearing_std_deg = encounter.bearing_std_deg};
    moments.push_back(moment);
  }
  return moments;
}

Eigen::Vector4d Ahead(const Encounter& encounter, const Eigen::Vector4d& truth,
                      double ahead_s, std::uint64_t seed) {
  Eigen::Vector4d later = truth;
  if (ahead_s == 0) return later;
  Random random(seed);
  Move(later, ahead_s, encounter.process_noise_m2_s3, random);
  return later;
}

Eigen::Vector4d ErrorOf(const map::ContactPoint& estimate,
                        const Eigen::Vector4d& truth) {
  map::ContactPoint point;
  point.frame_origin = Origin();
  point.x = truth;
  return estimate.x - map::InPlaneAt(point, estimate.frame_origin).x;
}

}  // namespace fathom::accuracy
