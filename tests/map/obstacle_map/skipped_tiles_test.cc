// A check that leaves out tiles whose shoalest depth cannot matter says what
// one says that reads every leaf: random missions, wide and narrow paths.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

#include "map/obstacle_map/check_trajectory.h"
#include "tests/map/obstacle_map/test_missions.h"

namespace fathom::map {
namespace {

constexpr int kChartSide = 300;
constexpr double kStepM = 10;

// 3 km of seabed that falls to the north-east from 12 m by a metre in 100 m,
// with relief of 0.5 m: no two leaves are alike, nothing conglomerates.
RasterBlock RoughChart(std::mt19937& random, float std_m) {
  std::uniform_real_distribution<float> relief(-0.5f, 0.5f);
  RasterBlock chart;
  chart.latitude_step_deg = kStepM / 111'000;
  chart.longitude_step_deg = kStepM / 83'000;
  chart.north_west = {.latitude_deg = kAreaSouthWest.latitude_deg +
                                      kChartSide * chart.latitude_step_deg,
                      .longitude_deg = kAreaSouthWest.longitude_deg};
  chart.rows = kChartSide;
  chart.columns = kChartSide;
  chart.time_s = 1'767'225'600 - 100 * 86'400;
  chart.replace = true;
  for (int row = 0; row < kChartSide; ++row) {
    for (int column = 0; column < kChartSide; ++column) {
      const int north = kChartSide - 1 - row;
      chart.depth_m.push_back(12 + 0.05f * static_cast<float>(north + column) +
                              relief(random));
      chart.std_m.push_back(std_m + 0.2f * relief(random));
    }
  }
  return chart;
}

struct Scene {
  bool holes = false;
  bool land = false;
  bool ageing = false;
  bool survey_open = false;
  bool survey_merged = false;
  bool ship = false;
};

ObstacleMap Make(const Scene& scene, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(0, 1);
  MissionOptions options = SmallMission();
  if (scene.ageing) options.ageing_rate_m2_s = 1.0 / (30 * 86'400);
  ObstacleMap map(options);
  RasterBlock chart = RoughChart(random, 0.5f);
  if (scene.land) chart.land.assign(chart.depth_m.size(), 0);
  for (std::size_t k = 0; k < chart.depth_m.size(); ++k) {
    if (scene.holes && unit(random) < 1e-4) {
      chart.depth_m[k] = std::numeric_limits<float>::quiet_NaN();
    }
    if (scene.land && unit(random) < 1e-4) chart.land[k] = 1;
  }
  EXPECT_TRUE(map.Import(chart, true).ok());
  // A worse and older chart of the north-east quarter's north half.
  RasterBlock rough = RoughChart(random, 2.0f);
  rough.time_s -= 1000 * 86'400;
  for (std::size_t k = 0; k < rough.depth_m.size(); ++k) {
    if (k / kChartSide > 100 || k % kChartSide < 150) {
      rough.depth_m[k] = std::numeric_limits<float>::quiet_NaN();
    }
  }
  EXPECT_TRUE(map.Import(rough, true).ok());
  if (scene.survey_open || scene.survey_merged) {
    StartActivity survey = Survey("a", EstimatorKind::kAdaptive);
    EXPECT_TRUE(map.Start(survey).ok());
    // Rocks among deeper soundings: point hazards.
    for (int n = 1; n <= 400; ++n) {
      const double north_m = 500 * unit(random);
      const double east_m = 500 * unit(random);
      for (const float depth_m : {14.0f, 14.1f, n % 40 == 0 ? 9.0f : 13.9f}) {
        EXPECT_TRUE(
            map.ApplyPing(HitAt("a", north_m, east_m, depth_m, 0.05f, n)).ok());
      }
    }
    if (scene.survey_merged) {
      EXPECT_TRUE(map.Complete(ActivityId{"a"}, false).ok());
    }
  }
  if (scene.ship) {
    const ContactFix fix = {.position = Place(1500, 1500)};
    EXPECT_TRUE(
        map.ApplyContact({.key = {.source = {"ais"}, .contact = {"ship"}},
                          .contact_class = ContactClass::kVessel,
                          .time = At(1900),
                          .observation = fix,
                          .depth_m = {},
                          .depth_std_m = {}})
            .applied);
  }
  return map;
}

void ExpectSame(const TrajectoryVerdict& skipped,
                const TrajectoryVerdict& all) {
  EXPECT_EQ(skipped.state, all.state);
  ASSERT_EQ(skipped.legs.size(), all.legs.size());
  for (std::size_t i = 0; i < all.legs.size(); ++i) {
    EXPECT_EQ(skipped.legs[i].state, all.legs[i].state);
    EXPECT_NEAR(skipped.legs[i].worst_probability,
                all.legs[i].worst_probability,
                1e-9 * all.legs[i].worst_probability);
    EXPECT_EQ(skipped.legs[i].least_clearance_m, all.legs[i].least_clearance_m);
  }
  ASSERT_EQ(skipped.first_conflict.has_value(), all.first_conflict.has_value());
  if (!all.first_conflict.has_value()) return;
  EXPECT_EQ(skipped.first_conflict->leg, all.first_conflict->leg);
  EXPECT_EQ(skipped.first_conflict->time, all.first_conflict->time);
  EXPECT_EQ(skipped.first_conflict->position.latitude_deg,
            all.first_conflict->position.latitude_deg);
  EXPECT_EQ(skipped.first_conflict->position.longitude_deg,
            all.first_conflict->position.longitude_deg);
  EXPECT_EQ(skipped.first_conflict->depth_m, all.first_conflict->depth_m);
  EXPECT_EQ(skipped.first_conflict->answer.state,
            all.first_conflict->answer.state);
  EXPECT_EQ(skipped.first_conflict->answer.probability,
            all.first_conflict->answer.probability);
}

TEST(SkippedTiles, ChangeNoVerdict) {
  std::mt19937 random(64);
  std::uniform_real_distribution<double> unit(0, 1);
  const Scene scenes[] = {{},
                          {.ageing = true},
                          {.holes = true},
                          {.land = true},
                          {.holes = true, .ageing = true, .survey_open = true},
                          {.survey_merged = true},
                          {.ageing = true, .survey_merged = true},
                          {.ship = true}};
  int conflicts = 0;
  int free_of_conflict = 0;
  for (const Scene& scene : scenes) {
    ObstacleMap map = Make(scene, random);
    const auto view = map.View();
    std::uint64_t read = 0;
    std::uint64_t all = 0;
    for (int trial = 0; trial < 20; ++trial) {
      Trajectory path;
      path.unknown_is_free = trial % 2 == 0;
      path.radius_m = 2;
      path.vertical_clearance_m = unit(random);
      path.position_std_m = trial % 3 == 0 ? 1 : 200 * unit(random);
      const double deep_m = trial % 4 == 0 ? 11 + 4 * unit(random) : 2;
      // Parallel to the seabed, or anyhow.
      const bool parallel = trial % 5 == 0;
      const double from_m = 200 + 1000 * unit(random);
      for (int k = 0; k < 3; ++k) {
        const double north_m =
            parallel ? from_m + 600 * k : 200 + 2500 * unit(random);
        const double east_m =
            parallel ? from_m + 100 * k : 200 + 2500 * unit(random);
        path.waypoints.push_back(
            {.position = Place(north_m, east_m),
             .depth_m = deep_m + (parallel ? 3.5 * k : 2 * unit(random)),
             .time = At(2000 + 1000 * k)});
      }
      const auto skipped = CheckTrajectory(*view, path);
      const auto whole = CheckTrajectory(*view, path, {.skip_deep = false});
      // To its first conflict.
      const auto first = CheckTrajectory(*view, path, {.stop_at_first = true});
      ASSERT_TRUE(first.ok());
      EXPECT_EQ(first->first_conflict.has_value(),
                whole.ok() && whole->first_conflict.has_value());
      ASSERT_TRUE(skipped.ok() && whole.ok());
      ExpectSame(*skipped, *whole);
      EXPECT_LE(skipped->cells, whole->cells);
      read += skipped->cells;
      all += whole->cells;
      (whole->first_conflict.has_value() ? conflicts : free_of_conflict) += 1;
    }
    // By then the ship may be anywhere: it is near every leg.
    if (scene.ship) {
      EXPECT_EQ(read, all);
    } else {
      EXPECT_LT(static_cast<double>(read), 0.9 * static_cast<double>(all));
    }
  }
  EXPECT_GT(conflicts, 10);
  EXPECT_GT(free_of_conflict, 10);
}

// Hand-made: 12 m of water at the start of the leg, 30 m beyond 640 m; the
// vehicle is at 2 m. After the first pieces nothing can be shallower.
TEST(SkippedTiles, DeepWaterIsNotRead) {
  std::mt19937 random(1);
  ObstacleMap map = Make({}, random);
  Trajectory path;
  path.radius_m = 2;
  path.position_std_m = 150;
  path.waypoints = {
      {.position = Place(400, 400), .depth_m = 2, .time = At(2000)},
      {.position = Place(2500, 2500), .depth_m = 2, .time = At(4000)}};
  const auto skipped = CheckTrajectory(*map.View(), path);
  const auto whole = CheckTrajectory(*map.View(), path, {.skip_deep = false});
  ASSERT_TRUE(skipped.ok() && whole.ok());
  ExpectSame(*skipped, *whole);
  EXPECT_LT(skipped->cells, whole->cells / 2);
}

}  // namespace
}  // namespace fathom::map
