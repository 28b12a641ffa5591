#include "map/local/placement.h"

#include <gtest/gtest.h>

#include <numbers>

namespace fathom::map {
namespace {

constexpr double kPi = std::numbers::pi;

TEST(Placement, Eq4_1AzimuthIsHeadingPlusBearing) {
  // 30 + 60 degrees = 90.
  EXPECT_DOUBLE_EQ(BeamAzimuthRad(kPi / 6.0, kPi / 3.0), kPi / 2.0);
}

TEST(Placement, Eq4_2OffsetIsRangeTimesCosineAndSine) {
  // r = 10, theta = 60 degrees: (10 * 0.5, 10 * 0.8660254).
  const NedPoint offset = BeamOffset(10.0, kPi / 3.0);
  EXPECT_NEAR(offset.north_m, 5.0, 1e-5);
  EXPECT_NEAR(offset.east_m, 8.660254, 1e-5);
}

// The float's error: half a unit of 2.4e-7 rad at 3 rad, plus 6e-8: 0.2 mm.
TEST(Placement, Eq4_2OffsetAtAKilometreIsGoodToAThirdOfAMillimetre) {
  for (int k = -1000; k <= 1000; ++k) {
    const double azimuth_rad = k * 0.0031;
    const NedPoint offset = BeamOffset(1000.0, azimuth_rad);
    EXPECT_NEAR(offset.north_m, 1000.0 * std::cos(azimuth_rad), 3e-4);
    EXPECT_NEAR(offset.east_m, 1000.0 * std::sin(azimuth_rad), 3e-4);
  }
}

TEST(Placement, Eq4_4ObstacleIsVehiclePlusOffset) {
  const NedPoint at = ObstaclePosition({100.0, 200.0, 0.0}, {5.0, -8.0, 0.0});
  EXPECT_EQ(at, (NedPoint{105.0, 192.0, 0.0}));
}

TEST(Placement, Eq4_5IndexIsTheFloorOfTheQuotient) {
  // floor(105 / 10) = 10, floor(192 / 10) = 19.
  EXPECT_EQ(CellOf(105.0, 192.0, 10.0), (CellIndex{.i = 10, .j = 19}));
  // A cell owns its south and west border.
  EXPECT_EQ(CellOf(20.0, 30.0, 10.0), (CellIndex{.i = 2, .j = 3}));
  // Floor, not truncation: just outside is -1, not 0.
  EXPECT_EQ(CellOf(-0.1, -10.0, 10.0), (CellIndex{.i = -1, .j = -1}));
}

TEST(Placement, Eq4_5FlatIndexIsRowMajorFromTheSouthWest) {
  // 19 + 10 * 50 = 519.
  EXPECT_EQ(FlatIndex({.i = 10, .j = 19}, 50), 519u);
  // 25 M cells: 4999 + 4999 * 5000 = 24 999 999, the last.
  EXPECT_EQ(FlatIndex({.i = 4999, .j = 4999}, 5000), 24'999'999u);
}

}  // namespace
}  // namespace fathom::map
