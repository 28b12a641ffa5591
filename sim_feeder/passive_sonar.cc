#include "sim_feeder/passive_sonar.h"

#include <cmath>

#include "sim_feeder/angles.h"

namespace fathom::feeder {

PassiveMeasurement MeasurePassive(const PassiveGeometry& geometry,
                                  double bearing_std_rad, Random& random) {
  const double dx_m = geometry.target_north_m - geometry.sonar_north_m;
  const double dy_m = geometry.target_east_m - geometry.sonar_east_m;
  const double true_range_m = std::hypot(dx_m, dy_m);
  const double true_bearing_rad = std::atan2(dy_m, dx_m) - geometry.course_rad;
  PassiveMeasurement measurement;
  measurement.bearing_rad =
      WrapToPi(true_bearing_rad + random.Normal(0.0, bearing_std_rad));
  measurement.range_m =
      true_range_m +
      random.Normal(0.0, true_range_m * std::tan(bearing_std_rad));
  measurement.range_std_m = measurement.range_m * std::tan(bearing_std_rad);
  measurement.bearing_std_rad = bearing_std_rad;
  return measurement;
}

}  // namespace fathom::feeder
