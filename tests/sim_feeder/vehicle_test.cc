// Track plan and vehicle: where it goes and when.

#include "sim_feeder/vehicle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "sim_feeder/track_plan.h"
#include "tests/sim_feeder/plane_terrain.h"
#include "tests/testing/status_matchers.h"

namespace fathom::feeder {
namespace {

using ::fathom::testing::StatusIs;

constexpr SurveyArea kArea = {.south_west = kTestOrigin,
                              .north_extent_m = 400.0,
                              .east_extent_m = 200.0,
                              .cell_size_m = 10.0};

TEST(PlanTrack, MowsToAndFroAlongTheLongerSide) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 20.0; });
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::vector<PlanePoint> track,
                              PlanTrack(*seabed, kArea, {.spacing_m = 50.0}));
  // 200 m / 50 m: four legs at 25, 75, 125 and 175 m east, two corners each.
  ASSERT_EQ(track.size(), 8u);
  for (std::size_t leg = 0; leg < 4; ++leg) {
    const PlanePoint& start = track[2 * leg];
    const PlanePoint& end = track[2 * leg + 1];
    EXPECT_DOUBLE_EQ(start.east_m, 25.0 + 50.0 * static_cast<double>(leg));
    EXPECT_DOUBLE_EQ(end.east_m, start.east_m);
    // Even legs go north, odd ones south; both nearly to the border.
    EXPECT_NEAR(end.north_m - start.north_m, leg % 2 == 0 ? 390.0 : -390.0,
                10.0);
  }
}

TEST(PlanTrack, GoesAroundAnIsland) {
  const auto island = [](double north_m, double east_m) {
    return std::hypot(north_m - 200.0, east_m - 100.0) < 60.0 ? -2.0 : 20.0;
  };
  const auto seabed = MakePlaneSeabed(island);
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::vector<PlanePoint> track,
                              PlanTrack(*seabed, kArea, {.spacing_m = 25.0}));
  double length_m = 0.0;
  for (std::size_t i = 0; i + 1 < track.size(); ++i) {
    const double north_m = track[i + 1].north_m - track[i].north_m;
    const double east_m = track[i + 1].east_m - track[i].east_m;
    const double leg_m = std::hypot(north_m, east_m);
    length_m += leg_m;
    for (double s = 0.0; s <= leg_m; s += 1.0) {
      ASSERT_GE(*seabed->DepthAt(track[i].north_m + north_m * s / leg_m,
                                 track[i].east_m + east_m * s / leg_m),
                3.9)
          << "corner " << i;
    }
  }
  // Eight legs of some 390 m less the island, and the ways between them.
  EXPECT_GT(length_m, 2500.0);
  EXPECT_LT(length_m, 5000.0);
}

TEST(PlanTrack, SaysWhenThereIsNoWater) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 3.0; });
  EXPECT_THAT(PlanTrack(*seabed, kArea, {.min_water_m = 4.0}),
              StatusIs(absl::StatusCode::kNotFound));
}

TEST(Vehicle, KeepsSpeedOnLegsAndTurnsOnTheSpot) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 40.0; });
  // 100 m north, then 50 m east, at 2 m/s: 50 s, 90 degrees at 15 deg/s: 6 s,
  // 25 s.
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const Vehicle vehicle,
      Vehicle::Create(*seabed, {{0, 0}, {100, 0}, {100, 50}}, {}));
  EXPECT_DOUBLE_EQ(vehicle.duration_s(), 81.0);
  EXPECT_DOUBLE_EQ(vehicle.length_m(), 150.0);
  EXPECT_DOUBLE_EQ(vehicle.StateAt(25.0).north_m, 50.0);
  EXPECT_DOUBLE_EQ(vehicle.StateAt(25.0).course_rad, 0.0);
  EXPECT_DOUBLE_EQ(vehicle.StateAt(53.0).north_m, 100.0);
  EXPECT_NEAR(vehicle.StateAt(53.0).course_rad, std::numbers::pi / 4, 1e-12);
  EXPECT_DOUBLE_EQ(vehicle.StateAt(66.0).east_m, 20.0);
  EXPECT_NEAR(vehicle.StateAt(66.0).course_rad, std::numbers::pi / 2, 1e-12);
  EXPECT_DOUBLE_EQ(vehicle.StateAt(1000.0).east_m, 50.0);
}

TEST(Vehicle, KeepsItsAltitudeAndItsLeastDepth) {
  const auto seabed =
      MakePlaneSeabed([](double north_m, double) { return 20 + north_m / 20; });
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const Vehicle vehicle,
      Vehicle::Create(*seabed, {{-200, 0}, {400, 0}}, {.altitude_m = 15.0}));
  // At north 300 m: water 35 m, so 20 m deep. At -200 m: water 10 m, less than
  // the altitude: 1 m below the surface.
  EXPECT_NEAR(vehicle.StateAt(250.0).depth_m, 20.0, 1e-3);
  EXPECT_NEAR(vehicle.StateAt(0.0).depth_m, 1.0, 1e-3);
}

TEST(Vehicle, ClimbsInTimeForACliff) {
  // From 100 m to 30 m of water at north 0 (the bilinear flank is 10 m wide).
  const auto seabed = MakePlaneSeabed(
      [](double north_m, double) { return north_m < 0 ? 100.0 : 30.0; });
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const Vehicle vehicle,
      Vehicle::Create(*seabed, {{-400, 0}, {100, 0}},
                      {.speed_m_s = 1.0, .altitude_m = 10.0}));
  double before_m = vehicle.StateAt(0.0).depth_m;
  EXPECT_NEAR(before_m, 90.0, 1e-9);
  for (int s = 1; s <= 500; ++s) {
    const VehicleState state = vehicle.StateAt(s);
    // 20 degrees: 0.364 m of climb in each metre.
    ASSERT_LE(std::abs(state.depth_m - before_m),
              std::tan(20.0 * std::numbers::pi / 180.0) + 1e-9);
    // Depths are planned every 2 m: 1 m beside the edge is 0.364 m of climb.
    ASSERT_LE(state.depth_m, *seabed->DepthAt(state.north_m, 0) - 9.63);
    before_m = state.depth_m;
  }
  EXPECT_NEAR(before_m, 20.0, 1e-9);
}

TEST(Vehicle, RefusesATrackOverLand) {
  const auto seabed = MakePlaneSeabed(
      [](double north_m, double) { return north_m > 50 ? -1.0 : 10.0; });
  EXPECT_THAT(Vehicle::Create(*seabed, {{0, 0}, {100, 0}}, {}),
              StatusIs(absl::StatusCode::kOutOfRange));
}

}  // namespace
}  // namespace fathom::feeder
