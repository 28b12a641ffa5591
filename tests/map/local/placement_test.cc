#include "map/local/placement.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "map/local/local_grid.h"

namespace fathom::map {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr float kPiFloat = std::numbers::pi_v<float>;
constexpr int kLast = kBeamsAtOnce - 1;

TEST(Placement, Eq4_1AzimuthIsHeadingPlusBearing) {
  // 30 + 60 degrees = 90.
  EXPECT_FLOAT_EQ(
      BeamAzimuthRad(kPi / 6.0, BeamFloats::Constant(kPiFloat / 3))[kLast],
      kPiFloat / 2);
}

TEST(Placement, Eq4_2OffsetIsRangeTimesCosineAndSine) {
  // r = 10, theta = 60 degrees: (10 * 0.5, 10 * 0.8660254).
  const BeamPlaces offset = BeamOffset(BeamFloats::Constant(10.0f),
                                       BeamFloats::Constant(kPiFloat / 3));
  for (int lane = 0; lane < kBeamsAtOnce; ++lane) {
    EXPECT_NEAR(offset.north[lane], 5.0, 1e-5);
    EXPECT_NEAR(offset.east[lane], 8.660254, 1e-5);
  }
}

// The floats' error below 2 pi: the azimuth's, half a unit of 4.8e-7 rad twice
// (heading plus bearing), 1.2e-7 of the functions and 6e-8 of the product:
// 6.6e-7 r.
TEST(Placement, Eq4_2OffsetIsGoodToAMillimetreAtAKilometre) {
  for (int k = -2000; k <= 2000; ++k) {
    const double heading_rad = k * 0.0016;
    const double bearing_rad = k * 0.0015;
    const BeamPlaces offset = BeamOffset(
        BeamFloats::Constant(1000.0f),
        BeamAzimuthRad(heading_rad,
                       BeamFloats::Constant(static_cast<float>(bearing_rad))));
    const double azimuth_rad = heading_rad + bearing_rad;
    EXPECT_NEAR(offset.north[kLast], 1000.0 * std::cos(azimuth_rad), 7e-4);
    EXPECT_NEAR(offset.east[kLast], 1000.0 * std::sin(azimuth_rad), 7e-4);
  }
}

// No bearing is too large to be placed, and none disturbs its neighbours.
TEST(Placement, Eq4_2BearingsOfManyTurns) {
  BeamFloats azimuth_rad = BeamFloats::Constant(kPiFloat / 3);
  azimuth_rad[1] = 1e30f;
  azimuth_rad[2] = -3e5f;
  const BeamPlaces offset =
      BeamOffset(BeamFloats::Constant(10.0f), azimuth_rad);
  for (const int lane : {1, 2}) {
    const double azimuth = double{azimuth_rad[lane]};
    EXPECT_NEAR(offset.north[lane], 10.0 * std::cos(azimuth), 1e-4);
    EXPECT_NEAR(offset.east[lane], 10.0 * std::sin(azimuth), 1e-4);
  }
  EXPECT_NEAR(offset.north[0], 5.0, 1e-5);
  EXPECT_NEAR(offset.north[3], 5.0, 1e-5);
}

TEST(Placement, Eq4_4ObstacleIsVehiclePlusOffset) {
  const BeamPlaces at = ObstaclePosition(
      {100.0, 200.0, 0.0},
      {.north = BeamDoubles::Constant(5.0), .east = BeamDoubles::Constant(-8)});
  EXPECT_EQ(at.north[kLast], 105.0);
  EXPECT_EQ(at.east[kLast], 192.0);
}

TEST(Placement, Eq4_5IndexIsTheFloorOfTheQuotient) {
  const LocalGrid grid(LocalMapOptions{.south_west = {41.5, -71.4},
                                       .north_extent_m = 500,
                                       .east_extent_m = 300,
                                       .cell_size_m = 10});
  CellIndex cell;
  // floor(105 / 10) = 10, floor(192 / 10) = 19.
  ASSERT_TRUE(grid.Locate(105.0 / 10, 192.0 / 10, cell));
  EXPECT_EQ(cell, (CellIndex{.i = 10, .j = 19}));
  // A cell owns its south and west border, and so does the grid.
  ASSERT_TRUE(grid.Locate(2.0, 3.0, cell));
  EXPECT_EQ(cell, (CellIndex{.i = 2, .j = 3}));
  ASSERT_TRUE(grid.Locate(0.0, -0.0, cell));
  EXPECT_EQ(cell, (CellIndex{.i = 0, .j = 0}));
  ASSERT_TRUE(grid.Locate(49.999, 29.999, cell));
  EXPECT_EQ(cell, (CellIndex{.i = 49, .j = 29}));
  // Floor, not truncation: just outside is not 0.
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  for (const double outside : {-0.01, 50.0, -1e300, 1e300, kNaN}) {
    EXPECT_FALSE(grid.Locate(outside, 1.0, cell)) << outside;
    EXPECT_FALSE(grid.Locate(1.0, outside, cell)) << outside;
  }
}

}  // namespace
}  // namespace fathom::map
