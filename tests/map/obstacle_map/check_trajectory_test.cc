// Paths past walls, over unknown water and across contacts, by hand; and random
// paths over random maps against brute force.

#include "map/obstacle_map/check_trajectory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "map/geodesy/ned_frame.h"
#include "map/obstacle_map/timed_leg.h"
#include "map/query/stadium.h"
#include "tests/map/obstacle_map/test_missions.h"

namespace fathom::map {
namespace {

using ::testing::HasSubstr;

Waypoint At(double north_m, double east_m, double depth_m, int seconds) {
  return {.position = Place(north_m, east_m),
          .depth_m = depth_m,
          .time = map::At(seconds)};
}

Trajectory PathOf(std::vector<Waypoint> waypoints, double radius_m = 5) {
  Trajectory path;
  path.waypoints = std::move(waypoints);
  path.radius_m = radius_m;
  return path;
}

// An activity of 500 m, here with cells of `cell_m`.
void StartSurvey(ObstacleMap& map, double cell_m = 10,
                 const std::string& id = "a") {
  StartActivity survey = Survey(id, EstimatorKind::kAdaptive);
  survey.options.cell_size_m = cell_m;
  ASSERT_TRUE(map.Start(survey).ok());
}

void Sound(ObstacleMap& map, double north_m, double east_m, float depth_m,
           int times = 3) {
  for (int n = 1; n <= times; ++n) {
    ASSERT_TRUE(
        map.ApplyPing(HitAt("a", north_m, east_m, depth_m, 0.05f, n)).ok());
  }
}

TrajectoryVerdict Check(ObstacleMap& map, const Trajectory& path,
                        const TrajectoryCheck& check = {}) {
  auto verdict = CheckTrajectory(*map.View(), path, check);
  EXPECT_TRUE(verdict.ok()) << verdict.status();
  return verdict.value_or(TrajectoryVerdict{});
}

TEST(CheckTrajectory, OpenWaterIsFree) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(30, 4), true).ok());
  const auto verdict = Check(
      map, PathOf({At(0, 0, 5, 0), At(100, 0, 5, 50), At(100, 100, 9, 99)}));
  EXPECT_EQ(verdict.state, ObstacleState::kFree);
  EXPECT_FALSE(verdict.first_conflict.has_value());
  ASSERT_EQ(verdict.legs.size(), 2u);
  // The chart's 30 m less the vehicle's depth; Phi((5 - 30) / 4) = 2e-10 and
  // Phi((9 - 30) / 4) = 7.6e-8. (A leaf stores its std to 1 %.)
  EXPECT_NEAR(*verdict.legs[0].least_clearance_m, 25, 1e-4);
  EXPECT_NEAR(*verdict.legs[1].least_clearance_m, 21, 1e-4);
  EXPECT_LT(verdict.legs[0].worst_probability, 1e-9);
  EXPECT_NEAR(verdict.legs[1].worst_probability, 7.6e-8, 2e-8);
  EXPECT_TRUE(verdict.approaches.empty());
}

TEST(CheckTrajectory, AWallIsMetWhereAndWhenItStands) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(30, 1), true).ok());
  StartSurvey(map);
  // One row of cells, 250 to 260 m north, rises to 3 m below the datum.
  for (int east = 205; east < 300; east += 10) Sound(map, 255, east, 3);
  const Trajectory path =
      PathOf({At(20, 252, 10, 0), At(100, 252, 10, 40), At(400, 252, 10, 190),
              At(450, 252, 10, 215)});
  const auto verdict = Check(map, path);
  EXPECT_EQ(verdict.state, ObstacleState::kOccupied);
  EXPECT_EQ(verdict.legs[0].state, ObstacleState::kFree);
  EXPECT_EQ(verdict.legs[1].state, ObstacleState::kOccupied);
  EXPECT_EQ(verdict.legs[2].state, ObstacleState::kFree);
  EXPECT_GT(verdict.legs[1].worst_probability, 0.999);
  EXPECT_NEAR(*verdict.legs[1].least_clearance_m, 3 - 10, 0.1);
  ASSERT_TRUE(verdict.first_conflict.has_value());
  EXPECT_EQ(verdict.first_conflict->leg, 1u);
  EXPECT_EQ(verdict.first_conflict->depth_m, 10);
  // The disc of 5 m touches the wall 145 m along the leg, at 2 m/s; what is
  // told may be early by a cell's diagonal less half its side, 2.1 m.
  const double after_s = ToSeconds(verdict.first_conflict->time - map::At(40));
  EXPECT_LE(after_s, 72.5);
  EXPECT_GE(after_s, 72.5 - 1.1);
  const NedPoint place =
      NedFrame(kAreaSouthWest).ToNed(verdict.first_conflict->position);
  EXPECT_NEAR(place.north_m, 255, 0.01);
  ASSERT_TRUE(verdict.first_conflict->answer.seabed.has_value());
  EXPECT_TRUE(verdict.first_conflict->answer.seabed->local);

  const auto stopped = Check(map, path, {.stop_at_first = true});
  EXPECT_EQ(stopped.legs.size(), 2u);
  EXPECT_EQ(stopped.first_conflict->time, verdict.first_conflict->time);
}

// One rock of one cell, 7 m beside the path of a disc of 5 m: its near border
// is at 4 m, 6 m or just out of reach.
TEST(CheckTrajectory, TheSweptWidthReachesExactlySoFar) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(30, 1), true).ok());
  StartSurvey(map);
  Sound(map, 255, 265, 3);  // The cell from 260 to 270 m east.
  const auto state = [&](double east_m, double std_m) {
    Trajectory path =
        PathOf({At(100, east_m, 10, 0), At(400, east_m, 10, 150)});
    path.position_std_m = std_m;
    return Check(map, path).state;
  };
  EXPECT_EQ(state(255.01, 0), ObstacleState::kOccupied);
  EXPECT_EQ(state(254.99, 0), ObstacleState::kFree);
  // With a std of 2 m and c = 0.95 the disc grows by 2 sqrt(-2 ln 0.05) =
  // 4.895 m.
  EXPECT_EQ(state(250.12, 2), ObstacleState::kOccupied);
  EXPECT_EQ(state(250.09, 2), ObstacleState::kFree);
}

// One sounding of 20 m, 5 cm sure, may be on a rock's top: the hazard
// begins 4.5 std above it, at 19.775 m, where P is small.
TEST(CheckTrajectory, APointHazardIsAConflictThoughNotOccupied) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(60, 1), true).ok());
  StartSurvey(map);
  Sound(map, 255, 255, 20, 1);
  const auto above =
      Check(map, PathOf({At(100, 255, 19.77, 0), At(400, 255, 19.77, 150)}));
  EXPECT_FALSE(above.first_conflict.has_value());
  const auto at =
      Check(map, PathOf({At(100, 255, 19.78, 0), At(400, 255, 19.78, 150)}));
  EXPECT_EQ(at.state, ObstacleState::kUncertain);
  EXPECT_LT(at.legs[0].worst_probability, 0.5);  // Far below 0.95.
  ASSERT_TRUE(at.first_conflict.has_value());
  EXPECT_EQ(at.first_conflict->answer.state, ObstacleState::kUncertain);
}

TEST(CheckTrajectory, UnknownWaterCountsAsAsked) {
  ObstacleMap map(SmallMission());
  Trajectory path = PathOf({At(0, 0, 5, 0), At(100, 0, 5, 50)});
  const auto closed = Check(map, path);
  EXPECT_EQ(closed.state, ObstacleState::kUnknown);
  ASSERT_TRUE(closed.first_conflict.has_value());
  EXPECT_EQ(closed.first_conflict->time, map::At(0));
  EXPECT_EQ(closed.first_conflict->answer.state, ObstacleState::kUnknown);
  EXPECT_FALSE(closed.legs[0].least_clearance_m.has_value());
  path.unknown_is_free = true;
  const auto open = Check(map, path);
  EXPECT_EQ(open.state, ObstacleState::kFree);
  EXPECT_FALSE(open.first_conflict.has_value());
}

// A chart covers the mission's square; what lies beyond is unknown.
TEST(CheckTrajectory, BeyondTheMissionIsUnknown) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(30, 1), true).ok());
  // The square ends 41.45 N, 5.55 km south of the area's corner.
  EXPECT_EQ(Check(map, PathOf({At(-5400, 0, 5, 0), At(-5500, 0, 5, 50)})).state,
            ObstacleState::kFree);
  EXPECT_EQ(Check(map, PathOf({At(-5400, 0, 5, 0), At(-5600, 0, 5, 50)})).state,
            ObstacleState::kUnknown);
  EXPECT_EQ(Check(map, PathOf({At(-9000, 0, 5, 0), At(-9100, 0, 5, 50)})).state,
            ObstacleState::kUnknown);
}

// The deepest that the vehicle may be while over a cell is what counts.
TEST(CheckTrajectory, ADivingLegIsJudgedByItsDepthThere) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(60, 1), true).ok());
  StartSurvey(map);
  Sound(map, 105, 255, 20);
  // 10 to 50 m over 400 m: at the cell, 95 to 115 m along with its reach, 20.5
  // m deep when 105 m along.
  const auto verdict =
      Check(map, PathOf({At(0, 255, 10, 0), At(400, 255, 50, 200)}));
  EXPECT_EQ(verdict.legs[0].state, ObstacleState::kOccupied);
  const double deepest_m = 10 + 0.1 * (105 + 5 + 7.1);
  EXPECT_NEAR(verdict.first_conflict->depth_m, deepest_m, 0.05);
  // Half as steep it passes 5 m above.
  EXPECT_EQ(Check(map, PathOf({At(0, 255, 5, 0), At(400, 255, 25, 200)})).state,
            ObstacleState::kFree);
}

ContactReport Fix(double north_m, double east_m, double north_m_s,
                  double east_m_s) {
  return {.key = {.source = {"ais"}, .contact = {"ship"}},
          .contact_class = ContactClass::kVessel,
          .time = map::At(0),
          .observation = ContactFix{.position = Place(north_m, east_m),
                                    .velocity_north_m_s = north_m_s,
                                    .velocity_east_m_s = east_m_s},
          .depth_m = {},
          .depth_std_m = {}};
}

// The vehicle goes north at 2 m/s, the ship west at 2 m/s: they are (210 - 2 t,
// 200 - 2 t) apart, closest after 102.5 s at (5, -5): 7.07 m.
TEST(CheckTrajectory, ACrossingContactIsMetAtItsClosestPointOfApproach) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(60, 1), true).ok());
  ASSERT_TRUE(map.ApplyContact(Fix(210, 450, 0, -2)).applied);
  Trajectory path =
      PathOf({At(0, 250, 2, 0), At(100, 250, 2, 50), At(400, 250, 2, 200)}, 1);
  // The ship's place has grown vague by then: P is 0.80 at most.
  path.confidence = 0.75;
  const auto verdict = Check(map, path);
  EXPECT_EQ(verdict.legs[0].state, ObstacleState::kFree);
  EXPECT_EQ(verdict.legs[1].state, ObstacleState::kOccupied);
  ASSERT_EQ(verdict.approaches.size(), 1u);
  const ContactApproach& approach = verdict.approaches[0];
  EXPECT_EQ(approach.key.contact.value, "ship");
  EXPECT_NEAR(approach.distance_m, 7.07, 0.05);
  EXPECT_NEAR(ToSeconds(approach.time - map::At(0)), 102.5, 0.1);
  EXPECT_GT(approach.probability, 0.75);
  ASSERT_TRUE(verdict.first_conflict.has_value());
  EXPECT_EQ(verdict.first_conflict->leg, 1u);
  ASSERT_EQ(verdict.first_conflict->answer.contacts.size(), 1u);
  const Time met = verdict.first_conflict->time;
  EXPECT_LE(met, approach.time);
  EXPECT_GT(met, map::At(50));

  // Below its keel there is nothing to meet, but the approach is still told.
  Trajectory below = path;
  for (Waypoint& waypoint : below.waypoints) waypoint.depth_m = 40;
  const auto under = Check(map, below);
  EXPECT_EQ(under.state, ObstacleState::kFree);
  ASSERT_EQ(under.approaches.size(), 1u);
  EXPECT_EQ(under.approaches[0].distance_m, approach.distance_m);
}

TEST(CheckTrajectory, AContactThatIsLongGoneIsNotMet) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(60, 1), true).ok());
  ASSERT_TRUE(map.ApplyContact(Fix(210, 3000, 0, 5)).applied);
  const auto verdict =
      Check(map, PathOf({At(0, 250, 2, 0), At(400, 250, 2, 200)}, 1));
  EXPECT_EQ(verdict.state, ObstacleState::kFree);
  EXPECT_TRUE(verdict.approaches.empty());
}

// The greatest P over the leg is that of a fine scan in time.
TEST(CheckTrajectory, TheGreatestContactProbabilityIsFound) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int trial = 0; trial < 30; ++trial) {
    ObstacleMap map(SmallMission());
    ASSERT_TRUE(map.Import(FlatChart(90, 1), true).ok());
    ASSERT_TRUE(
        map.ApplyContact(Fix(200 + 150 * unit(random), 250 + 150 * unit(random),
                             4 * unit(random), 4 * unit(random)))
            .applied);
    const Trajectory path = PathOf(
        {At(0, 250, 2, 30), At(400, 250 + 100 * unit(random), 2, 230)}, 2);
    const auto verdict = Check(map, path);
    const auto view = map.View();
    const TimedLeg leg(path.waypoints[0], path.waypoints[1]);
    double greatest = 0;
    for (int k = 0; k <= 4000; ++k) {
      const double share = k / 4000.0;
      const auto answer = view->Answer({.position = leg.PlaceAt(share),
                                        .depth_m = 2,
                                        .time = leg.TimeAt(share),
                                        .radius_m = 2});
      greatest = std::max(greatest, answer.probability);
    }
    if (greatest < 1e-5) continue;
    EXPECT_NEAR(verdict.legs[0].worst_probability / greatest, 1, 1e-3) << trial;
  }
}

// What brute force finds: every two metres of the leg, every metre and
// a half of the disc.
struct Brute {
  double worst = 0;
  bool occupied = false;
  bool unknown = false;
};
Brute ByBruteForce(const ObstacleMapView& view, const Trajectory& path,
                   double half_width_m, double deeper_m) {
  Brute brute;
  const TimedLeg leg(path.waypoints[0], path.waypoints[1]);
  const int steps = static_cast<int>(leg.length_m() / 2) + 1;
  for (int k = 0; k <= steps; ++k) {
    const double share = static_cast<double>(k) / steps;
    const GeodeticPoint middle = leg.PlaceAt(share);
    const NedFrame frame(middle);
    for (int ring = 0; 1.5 * ring <= half_width_m; ++ring) {
      const double r = std::min(1.5 * (ring + 1), half_width_m) * (1 - 1e-6);
      const int around = 1 + 6 * ring;
      for (int n = 0; n < around; ++n) {
        const double angle = 2 * std::numbers::pi * n / around;
        const auto answer =
            view.Answer({.position = frame.ToGeodetic(r * std::cos(angle),
                                                      r * std::sin(angle)),
                         .depth_m = leg.DepthAt(share) + deeper_m,
                         .time = leg.TimeAt(share),
                         .confidence = path.confidence});
        brute.worst = std::max(brute.worst, answer.probability);
        brute.occupied |= answer.state == ObstacleState::kOccupied;
        brute.unknown |= answer.state == ObstacleState::kUnknown;
      }
    }
  }
  return brute;
}

// No cell of the finest layer under the swept width is skipped, and none is
// judged that lies further than a cell's diagonal from it. Charts with holes,
// half-surveyed areas, rocks of one cell; paths across the areas' borders.
class BruteForce : public ::testing::TestWithParam<double> {};

TEST_P(BruteForce, FindsNothingThatTheCheckMissed) {
  const double cell_m = GetParam();
  std::mt19937 random(2002);
  std::uniform_real_distribution<double> unit(0, 1);
  int occupied = 0;
  int free = 0;
  for (int trial = 0; trial < 3; ++trial) {
    ObstacleMap map(SmallMission());
    RasterBlock chart = FlatChart(30, 1);
    for (float& depth_m : chart.depth_m) {
      if (unit(random) < 0.1) depth_m = std::numeric_limits<float>::quiet_NaN();
    }
    if (trial % 3 != 0) {
      ASSERT_TRUE(map.Import(chart, true).ok());
    }
    StartSurvey(map, cell_m);
    for (int n = 0; n < 150; ++n) {
      Sound(map, 500 * unit(random), 500 * unit(random),
            unit(random) < 0.2 ? 4.0f : 26.0f, 1);
    }
    const auto view = map.View();
    for (int k = 0; k < 5; ++k) {
      const double deep_m = 6 + 6 * unit(random);
      Trajectory path = PathOf(
          {At(-40 + 580 * unit(random), -40 + 580 * unit(random), deep_m, 0),
           At(-40 + 580 * unit(random), -40 + 580 * unit(random), deep_m, 300)},
          1 + 8 * unit(random));
      const auto verdict = CheckTrajectory(*view, path);
      ASSERT_TRUE(verdict.ok());
      const LegVerdict& leg = verdict->legs[0];
      const double w = SweptHalfWidthM(path);
      const Brute least = ByBruteForce(*view, path, w, 0);
      EXPECT_GE(leg.worst_probability, least.worst - 1e-9);
      EXPECT_TRUE(!least.occupied || leg.state == ObstacleState::kOccupied);
      EXPECT_TRUE(!least.unknown || leg.state == ObstacleState::kOccupied ||
                  leg.state == ObstacleState::kUnknown);
      // The coarser of leaf (10 m) and cell.
      const double diagonal_m = 1.5 * std::max(cell_m, 10.0);
      const Brute most = ByBruteForce(*view, path, w + diagonal_m, 0);
      EXPECT_LE(leg.worst_probability, most.worst + 1e-9);
      if (leg.state == ObstacleState::kUnknown) {
        EXPECT_TRUE(most.unknown);
      }
      occupied += leg.state == ObstacleState::kOccupied;
      free += leg.state != ObstacleState::kOccupied;
    }
  }
  EXPECT_GT(occupied, 0);
  EXPECT_GT(free, 0);
}

INSTANTIATE_TEST_SUITE_P(Cells, BruteForce, ::testing::Values(2.0, 10.0, 25.0));

TEST(CheckTrajectory, WorkIsBoundedAndCanBeStopped) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(30, 1), true).ok());
  StartSurvey(map, 1);
  const Trajectory path = PathOf({At(0, 250, 5, 0), At(499, 250, 5, 250)}, 20);
  const auto verdict = Check(map, path);
  // Three pieces of 166.3 m by 40 m with half a disc of 20 m at either end,
  // less what of the outermost two discs lies outside: 23 729 - 2 x 628 m^2 in
  // cells of 1 m, and half a cell all around, 3 x 230 and 2 x 166 m.
  EXPECT_NEAR(static_cast<double>(verdict.cells), 23'100, 500);
  const auto bounded =
      CheckTrajectory(*map.View(), path, {.most_cells = 10'000});
  EXPECT_EQ(bounded.status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(bounded.status().message()), HasSubstr("10000"));
  // At the limit, and one past it.
  EXPECT_TRUE(
      CheckTrajectory(*map.View(), path, {.most_cells = verdict.cells}).ok());
  EXPECT_EQ(
      CheckTrajectory(*map.View(), path, {.most_cells = verdict.cells - 1})
          .status()
          .code(),
      absl::StatusCode::kResourceExhausted);
  const std::atomic<bool> stop = true;
  EXPECT_EQ(CheckTrajectory(*map.View(), path, {.stop = &stop}).status().code(),
            absl::StatusCode::kCancelled);
}

TEST(TooLongLegM, AcrossTheAntimeridianToo) {
  // At the equator a degree of longitude is 111.319 km: 0.9 of it is the
  // longest leg and a bit.
  EXPECT_FALSE(TooLongLegM({0, 179.9}, {0, -179.9}).has_value());
  EXPECT_FALSE(TooLongLegM({0, 0}, {0, 0.898}).has_value());
  const std::optional<double> beyond = TooLongLegM({0, 179.5}, {0, -179.6});
  ASSERT_TRUE(beyond.has_value());
  EXPECT_NEAR(*beyond, 0.9 * 111'319.49, 1);
}

TEST(ValidateTrajectory, NamesWhatIsWrong) {
  const Trajectory good = PathOf({At(0, 0, 5, 0), At(100, 0, 5, 50)});
  EXPECT_TRUE(ValidateTrajectory(good).ok());
  const auto wrong = [&](auto change, const char* text) {
    Trajectory path = good;
    change(path);
    const absl::Status status = ValidateTrajectory(path);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << text;
    EXPECT_THAT(std::string(status.message()), HasSubstr(text));
  };
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  wrong([](Trajectory& p) { p.waypoints.pop_back(); }, "at least 2");
  wrong([](Trajectory& p) { p.confidence = 0.5; }, "confidence=0.5");
  wrong([](Trajectory& p) { p.radius_m = -1; }, "radius_m=-1");
  wrong([](Trajectory& p) { p.position_std_m = kNaN; }, "position_std_m");
  wrong([](Trajectory& p) { p.vertical_clearance_m = 1e9; },
        "vertical_clearance_m");
  wrong([](Trajectory& p) { p.waypoints[1].depth_m = kNaN; },
        "waypoints[1].depth_m");
  wrong([](Trajectory& p) { p.waypoints[1].time = p.waypoints[0].time; },
        "waypoints[1].time");
  wrong([](Trajectory& p) { p.waypoints[0].position.latitude_deg = 91; },
        "waypoints[0].position");
  wrong([](Trajectory& p) { p.waypoints[1].position.latitude_deg += 1; },
        "waypoints[1].position is 111");
}

// A leg of 40 km lies on the geodesic.
TEST(TimedLeg, ALongLegFollowsTheGeodesic) {
  const GeodeticPoint from = {.latitude_deg = 60, .longitude_deg = 179.9};
  const GeodeticPoint to = Direct(from, 80, 40'000);
  const TimedLeg leg({.position = from, .depth_m = 0, .time = map::At(0)},
                     {.position = to, .depth_m = 10, .time = map::At(1000)});
  EXPECT_EQ(leg.piece_count(), 200u);
  EXPECT_NEAR(leg.length_m(), 40'000, 1e-6);
  for (const double share : {0.0, 0.1234, 0.5, 0.99, 1.0}) {
    const GeodeticPoint exact = Direct(from, 80, 40'000 * share);
    EXPECT_LT(DistanceM(leg.PlaceAt(share), exact), 1e-3) << share;
    EXPECT_NEAR(leg.ShareAt(leg.TimeAt(share)), share, 1e-8);
  }
  EXPECT_EQ(leg.DepthAt(0.5), 5);
}

TEST(Stadium, TouchesSquaresByDistance) {
  const Stadium swept = {.from = {0, 0}, .to = {100, 0}, .half_width_m = 5};
  const auto square = [](double north_m, double east_m, double half_m) {
    return PlaneQuad{PlanePoint{north_m - half_m, east_m - half_m},
                     PlanePoint{north_m + half_m, east_m - half_m},
                     PlanePoint{north_m + half_m, east_m + half_m},
                     PlanePoint{north_m - half_m, east_m + half_m}};
  };
  EXPECT_TRUE(swept.Touches(square(50, 0, 1), 0));     // Inside.
  EXPECT_TRUE(swept.Touches(square(50, 0, 1000), 0));  // Around it.
  EXPECT_TRUE(swept.Touches(square(50, 5.9, 1), 0));   // Border at 4.9.
  EXPECT_FALSE(swept.Touches(square(50, 6.1, 1), 0));  // Border at 5.1.
  EXPECT_TRUE(swept.Touches(square(50, 6.1, 1), 0.2));
  // Corner at (103.6, 3.6): hypot(3.6, 3.6) = 5.09; at (103.5, 3.5): 4.95.
  EXPECT_FALSE(swept.Touches(square(104.6, 4.6, 1), 0));
  EXPECT_TRUE(swept.Touches(square(104.5, 4.5, 1), 0));
}

}  // namespace
}  // namespace fathom::map
