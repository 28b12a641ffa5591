// A mission whose global map keeps few tiles unpacked says what one says that
// keeps them all, bit for bit: points, the nearest obstacle, paths, digests;
// over random charts, surveys and contacts, from views held for random times.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <deque>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "map/obstacle_map/check_trajectory.h"
#include "map/obstacle_map/find_nearest.h"
#include "tests/map/global/plain_codec.h"
#include "tests/map/obstacle_map/test_missions.h"

namespace fathom::map {
namespace {

using ViewPtr = std::shared_ptr<const ObstacleMapView>;

// Two tiles of some thirty.
constexpr std::uint64_t kBudgetBytes = 60'000;

MissionOptions Options(bool tight) {
  MissionOptions options = SmallMission();
  options.ageing_rate_m2_s = 1.0 / (30 * 86'400);
  if (tight) {
    options.global.memory = {.budget_bytes = kBudgetBytes,
                             .codec = PlainCodec::Codec()};
  }
  return options;
}

struct Pair {
  ViewPtr tight;
  ViewPtr free;
};

class MissionTileBudget : public ::testing::TestWithParam<unsigned> {
 protected:
  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  GeodeticPoint AnyPlace() {
    return Place(Uniform(-2500, 6000), Uniform(-5000, 6000));
  }

  // Calls `change` for both maps; what it draws is drawn once.
  template <typename Change>
  void Both(Change change) {
    change(tight_);
    change(free_);
  }

  void Import() {
    RasterBlock chart;
    chart.north_west = AnyPlace();
    chart.latitude_step_deg = 10 / 111'000.0;
    chart.longitude_step_deg = 10 / 83'000.0;
    chart.rows = 120;
    chart.columns = 120;
    chart.time_s = 1'700'000'000;
    chart.replace = Uniform(0, 1) < 0.5;
    const double rough_m = Uniform(0, 1) < 0.2 ? 0.1 : 2.0;
    for (int k = 0; k < 120 * 120; ++k) {
      chart.depth_m.push_back(
          static_cast<float>(15 + Uniform(-rough_m, rough_m)));
    }
    chart.std_m = {0.7f};
    const bool last = Uniform(0, 1) < 0.7;
    Both([&](ObstacleMap& map) { ASSERT_TRUE(map.Import(chart, last).ok()); });
  }

  void Survey() {
    const std::string id = "a" + std::to_string(++activities_);
    StartActivity start = map::Survey(id, EstimatorKind::kAdaptive);
    std::vector<Ping> pings;
    for (int n = 1; n <= 150; ++n) {
      const double north_m = Uniform(0, 500);
      const double east_m = Uniform(0, 500);
      for (const float depth_m : {14.0f, 14.1f, n % 40 == 0 ? 9.0f : 13.9f}) {
        pings.push_back(HitAt(id, north_m, east_m, depth_m, 0.05f, n));
      }
    }
    const bool discard = Uniform(0, 1) < 0.2;
    const bool twice = Uniform(0, 1) < 0.5;
    Both([&](ObstacleMap& map) {
      ASSERT_TRUE(map.Start(start).ok());
      for (std::size_t i = 0; i < pings.size(); ++i) {
        ASSERT_TRUE(map.ApplyPing(pings[i]).ok());
        if (twice && i == pings.size() / 2) {
          ASSERT_TRUE(map.Transfer(ActivityId{id}).ok());
        }
      }
      ASSERT_TRUE(map.Complete(ActivityId{id}, discard).ok());
    });
  }

  void ExpectSameAnswers(const Pair& views) {
    for (int i = 0; i < 50; ++i) {
      const GeodeticPoint place = AnyPlace();
      const auto tight = views.tight->SeabedAt(place);
      const auto free = views.free->SeabedAt(place);
      ASSERT_EQ(tight.has_value(), free.has_value());
      if (free) {
        ASSERT_EQ(tight->estimate.depth_m, free->estimate.depth_m);
        ASSERT_EQ(tight->estimate.std_m, free->estimate.std_m);
        ASSERT_EQ(tight->estimate.time_s, free->estimate.time_s);
      }
    }
    for (int i = 0; i < 6; ++i) {
      NearestQuestion question;
      question.query.position = AnyPlace();
      question.query.depth_m = Uniform(1, 16);
      question.query.time = At(3000);
      question.query.confidence = 0.95;
      question.search_radius_m = Uniform(50, 3000);
      question.unknown_is_free = i % 2 == 0;
      const auto tight = FindNearestObstacle(*views.tight, question);
      const auto free = FindNearestObstacle(*views.free, question);
      ASSERT_EQ(tight.status(), free.status());
      if (!free.ok()) continue;
      ASSERT_EQ(tight->has_value(), free->has_value());
      if (!free->has_value()) continue;
      ++found_;
      ASSERT_EQ((*tight)->distance_m, (*free)->distance_m);
      ASSERT_EQ((*tight)->bearing_deg, (*free)->bearing_deg);
      ASSERT_EQ((*tight)->answer.state, (*free)->answer.state);
      ASSERT_EQ((*tight)->answer.probability, (*free)->answer.probability);
    }
    for (int i = 0; i < 6; ++i) {
      Trajectory path;
      path.unknown_is_free = i % 2 == 0;
      path.radius_m = 2;
      path.position_std_m = Uniform(1, 100);
      for (int k = 0; k < 3; ++k) {
        path.waypoints.push_back({.position = AnyPlace(),
                                  .depth_m = Uniform(1, 14),
                                  .time = At(4000 + 3000 * k)});
      }
      const auto tight = CheckTrajectory(*views.tight, path);
      const auto free = CheckTrajectory(*views.free, path);
      ASSERT_EQ(tight.status(), free.status());
      if (!free.ok()) continue;
      ++judged_;
      ASSERT_EQ(tight->state, free->state);
      ASSERT_EQ(tight->cells, free->cells);
      ASSERT_EQ(tight->legs.size(), free->legs.size());
      for (std::size_t k = 0; k < free->legs.size(); ++k) {
        ASSERT_EQ(tight->legs[k].state, free->legs[k].state);
        ASSERT_EQ(tight->legs[k].worst_probability,
                  free->legs[k].worst_probability);
        ASSERT_EQ(tight->legs[k].least_clearance_m,
                  free->legs[k].least_clearance_m);
      }
      ASSERT_EQ(tight->first_conflict.has_value(),
                free->first_conflict.has_value());
    }
    ASSERT_EQ(views.tight->Digest(), views.free->Digest());
  }

  std::mt19937 random_{GetParam()};
  ObstacleMap tight_{Options(true)};
  ObstacleMap free_{Options(false)};
  int activities_ = 0;
  int found_ = 0;
  int judged_ = 0;
};

TEST_P(MissionTileBudget, ChangesNoAnswer) {
  std::deque<Pair> held;
  for (int round = 0; round < 12; ++round) {
    // Enough that much is packed; then anything.
    round < 4 || Uniform(0, 1) < 0.5 ? Import() : Survey();
    if (HasFatalFailure()) return;
    const Pair now{tight_.View(), free_.View()};
    EXPECT_EQ(now.tight->revision(), now.free->revision());
    EXPECT_FALSE(tight_.over_budget());
    ExpectSameAnswers(now);
    if (!held.empty()) ExpectSameAnswers(held[random_() % held.size()]);
    if (HasFatalFailure()) return;
    held.push_back(now);
    while (held.size() > 3) {
      held.erase(held.begin() +
                 static_cast<std::ptrdiff_t>(random_() % held.size()));
    }
  }
  EXPECT_GT(tight_.tile_use().packed_tiles, 10u);
  EXPECT_GT(found_, 20);
  EXPECT_GT(judged_, 20);
  // Readers alone have unpacked: the next view packs, of the same revision.
  const std::uint64_t revision = tight_.View()->revision();
  held.clear();
  ViewPtr view = tight_.View();
  for (int i = 0; i < 300; ++i) (void)view->SeabedAt(AnyPlace());
  EXPECT_TRUE(tight_.over_budget());
  view = tight_.View();
  EXPECT_EQ(view->revision(), revision);
  EXPECT_LE(view->global().tile_use().unpacked_bytes, kBudgetBytes);
  EXPECT_EQ(view->Digest(), free_.View()->Digest());
}

INSTANTIATE_TEST_SUITE_P(Seeds, MissionTileBudget, ::testing::Range(1u, 4u));

}  // namespace
}  // namespace fathom::map
