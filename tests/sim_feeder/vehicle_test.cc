// Track plan and vehicle: where it goes and when.

#include "sim_feeder/vehicle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "sim_feeder/ship.h"
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
      Vehicle::Create(
          *seabed,
          {{.place = {0, 0}}, {.place = {100, 0}}, {.place = {100, 50}}}, {}));
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
      Vehicle::Create(*seabed, {{.place = {-200, 0}}, {.place = {400, 0}}},
                      {.altitude_m = 15.0}));
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
      Vehicle::Create(*seabed, {{.place = {-400, 0}}, {.place = {100, 0}}},
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

TEST(Vehicle, LoitersInCirclesToStarboardAndGoesOn) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 40.0; });
  // 100 m north at 2 m/s, circles of 20 m for 60 s at least, 50 m east. A
  // circle is 40 pi = 125.66 m and 62.83 s: one of them.
  const double circle_s = 40.0 * std::numbers::pi / 2.0;
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const Vehicle vehicle,
      Vehicle::Create(
          *seabed,
          {{.place = {0, 0}},
           {.place = {100, 0}, .loiter_radius_m = 20.0, .loiter_s = 60.0},
           {.place = {100, 50}}},
          {}));
  // Legs of 50 s and 25 s, 6 s for 90 degrees.
  EXPECT_NEAR(vehicle.duration_s(), 50.0 + circle_s + 6.0 + 25.0, 1e-9);
  EXPECT_NEAR(vehicle.length_m(), 150.0 + 40.0 * std::numbers::pi, 1e-9);
  // The centre lies 20 m to starboard: north 100, east 20. A quarter on, the
  // vehicle is north of it, bound east; after half, east of it, bound south.
  const VehicleState quarter = vehicle.StateAt(50.0 + circle_s / 4);
  EXPECT_NEAR(quarter.north_m, 120.0, 1e-9);
  EXPECT_NEAR(quarter.east_m, 20.0, 1e-9);
  EXPECT_NEAR(quarter.course_rad, std::numbers::pi / 2, 1e-9);
  const VehicleState half = vehicle.StateAt(50.0 + circle_s / 2);
  EXPECT_NEAR(half.north_m, 100.0, 1e-9);
  EXPECT_NEAR(half.east_m, 40.0, 1e-9);
  // atan(2^2 / (9.80665 x 20)) = 0.020392 rad, starboard down.
  EXPECT_NEAR(half.roll_rad, 0.020392, 1e-6);
  EXPECT_EQ(vehicle.StateAt(25.0).roll_rad, 0.0);
  const VehicleState end = vehicle.StateAt(50.0 + circle_s);
  EXPECT_NEAR(end.north_m, 100.0, 1e-9);
  EXPECT_NEAR(end.east_m, 0.0, 1e-9);
  EXPECT_NEAR(end.course_rad, 0.0, 1e-9);
}

TEST(Vehicle, LoitersWhereItStartsAndAsLongAsItIsTold) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 40.0; });
  // 130 s at 2 m/s are 260 m, 2.07 circles of 125.66 m: three whole ones.
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const Vehicle vehicle,
      Vehicle::Create(
          *seabed,
          {{.place = {10, 0}, .loiter_radius_m = 20.0, .loiter_s = 130.0}},
          {}));
  EXPECT_NEAR(vehicle.length_m(), 3 * 40.0 * std::numbers::pi, 1e-9);
  EXPECT_NEAR(vehicle.StateAt(0.0).course_rad, 0.0, 1e-9);
}

TEST(Vehicle, KeepsItsAltitudeOnACircle) {
  // 1 in 20 deeper to the north.
  const auto seabed =
      MakePlaneSeabed([](double north_m, double) { return 40 + north_m / 20; });
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const Vehicle vehicle,
      Vehicle::Create(
          *seabed,
          {{.place = {0, 0}, .loiter_radius_m = 100.0, .loiter_s = 60.0}},
          {.altitude_m = 15.0}));
  // A circle of 200 pi m at 2 m/s. After a quarter it is 100 m north: 45 m of
  // water. Depths are planned every 2 m, straight between: millimetres.
  EXPECT_NEAR(vehicle.StateAt(25.0 * std::numbers::pi).depth_m, 30.0, 5e-3);
  // At the start it goes north, down by 1 in 20: bow down by atan(0.05).
  EXPECT_NEAR(vehicle.StateAt(0.5).pitch_rad, -std::atan(0.05), 1e-3);
}

TEST(Vehicle, RefusesACircleTighterThanItTurns) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 40.0; });
  // 2 m/s at 15 degrees/s: 2 / 0.2618 = 7.64 m.
  const auto create = [&](double radius_m) {
    return Vehicle::Create(
        *seabed,
        {{.place = {0, 0}, .loiter_radius_m = radius_m, .loiter_s = 60.0}}, {});
  };
  FATHOM_EXPECT_OK(create(7.65));
  EXPECT_THAT(create(7.63), StatusIs(absl::StatusCode::kInvalidArgument,
                                     ::testing::HasSubstr("7.64 m")));
  EXPECT_THAT(Vehicle::Create(*seabed, {{.place = {0, 0}}}, {}),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST(Chase, HeadsForTheVehicleAgainAndAgain) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 40.0; });
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const Vehicle vehicle,
      Vehicle::Create(*seabed, {{.place = {0, 0}}, {.place = {400, 0}}}, {}));
  Ship ship = {.id = "hunter", .start = {.north_m = 0, .east_m = -100}};
  Chase(vehicle, {.ship_id = "hunter", .speed_m_s = 4, .interval_s = 10}, 200,
        ship);
  // For 10 s east at 4 m/s; then the vehicle is 20 m north and 60 m east of it:
  // 4 m/s along (20, 60) / 63.25 = (1.26491, 3.79473).
  EXPECT_NEAR(ship.PlaceAt(10).east_m, -60.0, 1e-9);
  EXPECT_NEAR(ship.MotionAt(15).north_m_s, 1.26491, 1e-5);
  EXPECT_NEAR(ship.MotionAt(15).east_m_s, 3.79473, 1e-5);
  // In the end it lies where the vehicle was at the last look, 20 m astern, and
  // goes as fast.
  const VehicleState prey = vehicle.StateAt(190);
  EXPECT_NEAR(ship.PlaceAt(200).north_m, prey.north_m, 1e-6);
  EXPECT_NEAR(ship.PlaceAt(200).east_m, prey.east_m, 1e-6);
  EXPECT_NEAR(ship.MotionAt(195).north_m_s, 2.0, 1e-6);
}

TEST(Chase, BeginsWhenTheScriptIsOver) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 40.0; });
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const Vehicle vehicle,
      Vehicle::Create(*seabed, {{.place = {0, 0}}, {.place = {400, 0}}}, {}));
  // South at 1 m/s for 60 s, then towards the vehicle, 120 + 60 m north of it.
  Ship ship = {.id = "hunter", .north_m_s = -1};
  Chase(vehicle,
        {.ship_id = "hunter", .from_s = 60, .speed_m_s = 4, .interval_s = 10},
        200, ship);
  EXPECT_NEAR(ship.PlaceAt(60).north_m, -60.0, 1e-9);
  EXPECT_NEAR(ship.MotionAt(65).north_m_s, 4.0, 1e-9);
}

TEST(Vehicle, RefusesATrackOverLand) {
  const auto seabed = MakePlaneSeabed(
      [](double north_m, double) { return north_m > 50 ? -1.0 : 10.0; });
  EXPECT_THAT(
      Vehicle::Create(*seabed, {{.place = {0, 0}}, {.place = {100, 0}}}, {}),
      StatusIs(absl::StatusCode::kOutOfRange));
}

}  // namespace
}  // namespace fathom::feeder
