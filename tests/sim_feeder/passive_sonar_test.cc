#include "sim_feeder/passive_sonar.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sim_feeder/angles.h"

namespace fathom::feeder {
namespace {

TEST(MeasurePassive, RangeAndBearingInAllQuadrants) {
  Random random(1, RandomStream::kPassiveSonar);
  struct Case {
    double north_m;
    double east_m;
    double course_deg;
    double bearing_deg;
  };
  // A 3-4-5 triangle: atan(4 / 3) = 53.1301 degrees from north.
  const double a = std::atan2(4.0, 3.0) * kDegreesPerRadian;
  for (const Case& expected : {
           Case{300, 400, 0, a}, Case{-300, 400, 0, 180 - a},
           Case{-300, -400, 0, a - 180}, Case{300, -400, 0, -a},
           Case{300, 400, 90, a - 90},
           Case{-300, -400, 90, a + 90},   // a - 180 - 90 = a - 270.
           Case{300, -400, 200, 160 - a},  // -a - 200 + 360.
       }) {
    const PassiveMeasurement found =
        MeasurePassive({.sonar_north_m = 1000,
                        .sonar_east_m = -2000,
                        .course_rad = expected.course_deg * kRadiansPerDegree,
                        .target_north_m = 1000 + expected.north_m,
                        .target_east_m = -2000 + expected.east_m},
                       0.0, random);
    EXPECT_NEAR(found.range_m, 500.0, 1e-9);
    EXPECT_NEAR(found.bearing_rad * kDegreesPerRadian, expected.bearing_deg,
                1e-9);
  }
}

TEST(MeasurePassive, RangeNoiseIsRangeTimesTangentOfBearingNoise) {
  Random random(2, RandomStream::kPassiveSonar);
  constexpr double kBearingStdRad = 2.0 * kRadiansPerDegree;
  constexpr int kDraws = 100'000;
  double range_sum = 0, range_squares = 0, bearing_sum = 0, bearing_squares = 0;
  for (int i = 0; i < kDraws; ++i) {
    const PassiveMeasurement found =
        MeasurePassive({.target_north_m = 800.0, .target_east_m = 600.0},
                       kBearingStdRad, random);
    const double range_error = found.range_m - 1000.0;
    const double bearing_error = found.bearing_rad - std::atan2(600.0, 800.0);
    range_sum += range_error;
    range_squares += range_error * range_error;
    bearing_sum += bearing_error;
    bearing_squares += bearing_error * bearing_error;
    // What it states follows from what it measured (eq. 3.1).
    ASSERT_NEAR(found.range_std_m, found.range_m * std::tan(kBearingStdRad),
                1e-9);
    ASSERT_DOUBLE_EQ(found.bearing_std_rad, kBearingStdRad);
  }
  // Eq. 3.1: s_R = 1000 tan(2 deg) = 34.921 m. Five standard errors.
  const double range_std_m = 1000.0 * std::tan(kBearingStdRad);
  const double mean_error = 5.0 / std::sqrt(kDraws);
  const double variance_error = 5.0 * std::sqrt(2.0 / kDraws);
  EXPECT_NEAR(range_std_m, 34.921, 1e-3);
  EXPECT_NEAR(range_sum / kDraws, 0.0, mean_error * range_std_m);
  EXPECT_NEAR(range_squares / kDraws / (range_std_m * range_std_m), 1.0,
              variance_error);
  EXPECT_NEAR(bearing_sum / kDraws, 0.0, mean_error * kBearingStdRad);
  EXPECT_NEAR(bearing_squares / kDraws / (kBearingStdRad * kBearingStdRad), 1.0,
              variance_error);
}

}  // namespace
}  // namespace fathom::feeder
