#include "map/geodesy/small_angle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace fathom::map {
namespace {

constexpr double kReach = 1.5 * kSmallRad;

// Against the library's, to two units in the last place of 0.03 and of 1.
TEST(SmallAngle, SeriesAreTheFunctions) {
  for (int k = -1000; k <= 1000; ++k) {
    const double x = k * kReach / 1000;
    const SineCosine got = SineCosineOfSmall(x);
    EXPECT_NEAR(got.sine, std::sin(x), 7e-18) << x;
    EXPECT_NEAR(got.cosine, std::cos(x), 2.3e-16) << x;
    EXPECT_NEAR(ArcTangentOfSmall(x), std::atan(x), 7e-18) << x;
  }
}

TEST(SmallAngle, NaNStaysNaN) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(SineCosineOfSmall(kNaN).sine));
  EXPECT_TRUE(std::isnan(ArcTangentOfSmall(kNaN)));
}

TEST(SmallAngle, EastOfGoesAcrossTheAntimeridian) {
  // From 179.5 E to 179.5 W is 1 degree east.
  EXPECT_NEAR(EastOfRad({.latitude_deg = 0, .longitude_deg = 179.5},
                        {.latitude_deg = 5, .longitude_deg = -179.5}),
              0.017453292519943, 1e-14);
}

}  // namespace
}  // namespace fathom::map
