// The integrated map: how layers join, what a transfer moves, and that a
// restored map with a replayed journal is the map that was lost.
#include "map/obstacle_map/obstacle_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <random>
#include <string>
#include <vector>

#include "tests/map/obstacle_map/test_missions.h"

namespace fathom::map {
namespace {

using ::absl::StatusCode;

TEST(ObstacleMap, KnowsNothingBeforeAnyEvidence) {
  ObstacleMap map(SmallMission());
  const auto view = map.View();
  EXPECT_FALSE(view->SeabedAt(Place(100, 100)).has_value());
  const ObstacleAnswer answer =
      view->Answer({.position = Place(100, 100), .depth_m = 10, .time = At(0)});
  EXPECT_EQ(answer.state, ObstacleState::kUnknown);
  EXPECT_EQ(answer.probability, 0);
}

TEST(ObstacleMap, AnIdIsUsedOnceInAMission) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Start(Survey("a")).ok());
  EXPECT_EQ(map.Start(Survey("a")).code(), StatusCode::kAlreadyExists);
  ASSERT_TRUE(map.Complete(ActivityId{"a"}, false).ok());
  EXPECT_EQ(map.Start(Survey("a")).code(), StatusCode::kAlreadyExists);
  EXPECT_EQ(map.Complete(ActivityId{"a"}, false).status().code(),
            StatusCode::kFailedPrecondition);
  EXPECT_EQ(map.Complete(ActivityId{"b"}, false).status().code(),
            StatusCode::kNotFound);
}

TEST(ObstacleMap, RefusesOneActivityPastItsBound) {
  MissionOptions options = SmallMission();
  options.max_open_activities = 2;
  ObstacleMap map(options);
  ASSERT_TRUE(map.Start(Survey("a")).ok());
  ASSERT_TRUE(map.Start(Survey("b")).ok());
  EXPECT_EQ(map.Start(Survey("c")).code(), StatusCode::kResourceExhausted);
  ASSERT_TRUE(map.Complete(ActivityId{"a"}, true).ok());
  EXPECT_TRUE(map.Start(Survey("c")).ok());
}

TEST(ObstacleMap, RefusesAnAreaWithTooManyCellsOrOutsideTheMission) {
  MissionOptions options = SmallMission();
  options.max_local_cells = 2499;  // The survey has 50 x 50 = 2500.
  ObstacleMap map(options);
  EXPECT_EQ(map.Start(Survey("a")).code(), StatusCode::kResourceExhausted);

  ObstacleMap wide(SmallMission());
  StartActivity far = Survey("far");
  far.options.south_west = {.latitude_deg = -10, .longitude_deg = 100};
  EXPECT_EQ(wide.Start(far).code(), StatusCode::kOutOfRange);
}

TEST(ObstacleMap, APingForAnActivityThatIsNotOpenChangesNothing) {
  ObstacleMap map(SmallMission());
  EXPECT_EQ(map.ApplyPing(HitAt("a", 100, 100, 20, 0.5f, 1)).status().code(),
            StatusCode::kNotFound);
  EXPECT_EQ(map.revision(), 0u);
}

TEST(ObstacleMap, AMeasuredCellStandsBeforeTheChart) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(30, 4), true).ok());
  ASSERT_TRUE(map.Start(Survey("a")).ok());
  ASSERT_TRUE(map.ApplyPing(HitAt("a", 105, 105, 20, 3, 1)).ok());
  const auto view = map.View();

  // Measured: prior 30 +- 4 and sounding 20 +- 3 (eqs. 4.17, 4.18, 4.20):
  // k = 16 / 25 = 0.64; mean = 30 - 6.4 = 23.6; variance = 0.36 x 16 = 5.76.
  const auto measured = view->SeabedAt(Place(105, 105));
  ASSERT_TRUE(measured.has_value());
  EXPECT_TRUE(measured->local);
  EXPECT_EQ(measured->activity->value, "a");
  EXPECT_EQ(measured->estimate.kind, EvidenceKind::kMeasured);
  EXPECT_NEAR(measured->estimate.depth_m, 23.6, 1e-4);
  EXPECT_NEAR(measured->estimate.std_m, 2.4, 1e-3);

  // Elsewhere the chart answers.
  const auto chart = view->SeabedAt(Place(405, 405));
  ASSERT_TRUE(chart.has_value());
  EXPECT_FALSE(chart->local);
  EXPECT_EQ(chart->estimate.kind, EvidenceKind::kPrior);
  EXPECT_EQ(chart->estimate.depth_m, 30);
  // The single layers.
  EXPECT_EQ(view->SeabedAt(Place(105, 105), LayerChoice::kGlobalOnly)
                ->estimate.depth_m,
            30);
  EXPECT_FALSE(
      view->SeabedAt(Place(405, 405), LayerChoice::kLocalOnly).has_value());
}

ObstacleState StateAt(ObstacleMap& map, double depth_m) {
  return map.View()
      ->Answer({.position = Place(105, 105), .depth_m = depth_m, .time = At(9)})
      .state;
}

// A rock once hit is not forgotten when the next vehicle surveys the place and
// does not hit it.
TEST(ObstacleMap, AHazardOutlivesTheActivityThatFoundIt) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Start(Survey("a", EstimatorKind::kAdaptive)).ok());
  for (int n = 0; n < 9; ++n) {
    ASSERT_TRUE(map.ApplyPing(HitAt("a", 105, 105, 20, 0.1f, n)).ok());
  }
  ASSERT_TRUE(map.ApplyPing(HitAt("a", 105, 105, 15, 0.1f, 9)).ok());
  EXPECT_EQ(StateAt(map, 15), ObstacleState::kUncertain);
  ASSERT_TRUE(map.Complete(ActivityId{"a"}, false).ok());
  EXPECT_EQ(StateAt(map, 15), ObstacleState::kUncertain);
  ASSERT_TRUE(map.Start(Survey("b", EstimatorKind::kAdaptive)).ok());
  for (int n = 0; n < 50; ++n) {
    ASSERT_TRUE(map.ApplyPing(HitAt("b", 105, 105, 20, 0.1f, n)).ok());
  }
  EXPECT_EQ(StateAt(map, 15), ObstacleState::kUncertain);
  EXPECT_EQ(StateAt(map, 10), ObstacleState::kFree);
}

// Hit for the first time where only a chart knows better: held back as gross,
// yet the chart alone may not call the place free.
TEST(ObstacleMap, AShoalThatWaitsMakesTheChartsAnswerUncertain) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(60, 1), true).ok());
  ASSERT_TRUE(map.Start(Survey("a", EstimatorKind::kAdaptive)).ok());
  for (const double east_m : {95.0, 105.0, 115.0}) {
    ASSERT_TRUE(map.ApplyPing(HitAt("a", 95, east_m, 60, 0.1f, 1)).ok());
  }
  EXPECT_EQ(StateAt(map, 10), ObstacleState::kFree);
  const std::string before = map.View()->Digest();
  ASSERT_TRUE(map.ApplyPing(HitAt("a", 105, 105, 3, 0.1f, 2)).ok());
  EXPECT_EQ(StateAt(map, 10), ObstacleState::kUncertain);
  EXPECT_NE(map.View()->Digest(), before);
}

TEST(ObstacleMap, TransferCountsThePriorOnce) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(24, 4), true).ok());
  ASSERT_TRUE(map.Start(Survey("a")).ok());
  ASSERT_TRUE(map.ApplyPing(HitAt("a", 105, 105, 20, 3, 1)).ok());
  ASSERT_TRUE(map.Transfer(ActivityId{"a"}).ok());
  // A second transfer without new evidence moves nothing.
  const auto again = map.Transfer(ActivityId{"a"});
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(again->leaves_written, 0u);
  ASSERT_TRUE(map.ApplyPing(HitAt("a", 105, 105, 20, 3, 2)).ok());
  ASSERT_TRUE(map.Complete(ActivityId{"a"}, false).ok());

  // Batch solution of prior and two soundings: weights 1/16, 1/9, 1/9:
  // w = 41/144; mean = (24/16 + 40/9) x 144/41 = (216 + 640)/41 = 20.8780;
  // variance = 144/41 = 3.5122, std 1.8741 (codes keep it within 0.2 %).
  const auto seabed = map.View()->SeabedAt(Place(105, 105));
  ASSERT_TRUE(seabed.has_value());
  EXPECT_FALSE(seabed->local);
  EXPECT_EQ(seabed->estimate.kind, EvidenceKind::kMeasured);
  EXPECT_NEAR(seabed->estimate.depth_m, 856.0 / 41, 0.02);
  EXPECT_NEAR(seabed->estimate.std_m, std::sqrt(144.0 / 41), 0.01);
}

// Two vehicles survey one place at the same time, on unknown ground, and end in
// either order: one map. (Over a chart they differ by code steps:
// tests/map/global/fuse_test.cc.)
TEST(ObstacleMap, TwoVehiclesSurveysMergeToOneMapInEitherOrder) {
  const auto digest_of = [](const std::array<const char*, 2>& order,
                            std::uint64_t& leaves) {
    ObstacleMap map(SmallMission());
    for (const char* id : {"a", "b"}) {
      StartActivity survey = Survey(id, EstimatorKind::kAdaptive);
      // Half over each other, their grids a third of a cell apart.
      if (id[0] == 'b') survey.options.south_west = Place(203.3, 103.3);
      EXPECT_TRUE(map.Start(survey).ok());
    }
    std::mt19937 random(5);
    std::uniform_real_distribution<double> place(0, 700);
    std::normal_distribution<float> noise;
    for (int i = 0; i < 20000; ++i) {
      const double north_m = place(random);
      const double east_m = place(random);
      const float depth_m =
          20 + static_cast<float>(0.004 * north_m) + 0.3f * noise(random);
      EXPECT_TRUE(map.ApplyPing(HitAt(i % 2 == 0 ? "a" : "b", north_m, east_m,
                                      depth_m, 0.3f, i))
                      .ok());
    }
    for (const char* id : order) {
      EXPECT_TRUE(map.Complete(ActivityId{id}, false).ok());
    }
    leaves = map.View()->global().known_leaf_count();
    return map.View()->Digest();
  };
  std::uint64_t leaves = 0;
  const std::string digest = digest_of({"a", "b"}, leaves);
  EXPECT_EQ(digest_of({"b", "a"}, leaves), digest);
  EXPECT_GT(leaves, 100u);
  // Conglomerated in the end: two squares of 63 x 63 leaves less the overlap
  // would be some 6000.
  EXPECT_LT(leaves, 5000u);
}

TEST(ObstacleMap, ADiscardedActivityLeavesNothing) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Start(Survey("a")).ok());
  ASSERT_TRUE(map.ApplyPing(HitAt("a", 105, 105, 20, 3, 1)).ok());
  ASSERT_TRUE(map.Complete(ActivityId{"a"}, true).ok());
  EXPECT_FALSE(map.View()->SeabedAt(Place(105, 105)).has_value());
}

TEST(ObstacleMap, AViewDoesNotChangeWhileTheWriterGoesOn) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Start(Survey("a")).ok());
  ASSERT_TRUE(map.ApplyPing(HitAt("a", 105, 105, 20, 3, 1)).ok());
  const auto before = map.View();
  const std::string digest = before->Digest();
  ASSERT_TRUE(map.ApplyPing(HitAt("a", 105, 105, 25, 0.1f, 2)).ok());
  ASSERT_TRUE(map.Complete(ActivityId{"a"}, false).ok());
  EXPECT_EQ(before->Digest(), digest);
  EXPECT_EQ(before->SeabedAt(Place(105, 105))->estimate.depth_m, 20);
  EXPECT_NE(map.View()->Digest(), digest);
}

ContactReport ShipAt(double north_m, double east_m, int seconds) {
  ContactReport report;
  report.key = {SourceId{"c4i"}, ContactId{"ship"}};
  report.contact_class = ContactClass::kVessel;
  report.time = At(seconds);
  report.observation = ContactFix{.position = Place(north_m, east_m),
                                  .velocity_north_m_s = 0,
                                  .velocity_east_m_s = 5};
  return report;
}

TEST(ObstacleMap, AContactIsWhereItWillBe) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(200, 1), true).ok());
  ASSERT_TRUE(map.ApplyContact(ShipAt(0, 0, 0)).applied);
  const auto view = map.View();
  // 5 m/s east for 600 s: 3000 m.
  const ObstacleQuery there{
      .position = Place(0, 3000), .depth_m = 2, .time = At(600)};
  const ObstacleAnswer then = view->Answer(there);
  ASSERT_EQ(then.contacts.size(), 1u);
  EXPECT_LT(then.contacts[0].distance_m, 2.0);
  ObstacleQuery now = there;
  now.time = At(0);
  EXPECT_EQ(view->Answer(now).state, ObstacleState::kFree);
  EXPECT_GT(then.probability, view->Answer(now).probability);

  ASSERT_TRUE(
      map.Drop({.key = {SourceId{"c4i"}, ContactId{"ship"}}, .time = At(700)})
          .ok());
  ObstacleQuery later = there;
  later.time = At(800);
  later.position = Place(0, 4000);
  EXPECT_TRUE(map.View()->Answer(later).contacts.empty());
  EXPECT_EQ(
      map.Drop({.key = {SourceId{"c4i"}, ContactId{"other"}}, .time = At(1)})
          .status()
          .code(),
      StatusCode::kNotFound);
}

// Everything that storage does, without a file: the pieces of a view put into
// a new map.
std::unique_ptr<ObstacleMap> Restored(const ObstacleMapView& view) {
  auto map = std::make_unique<ObstacleMap>(SmallMission());
  view.global().ForEachTile([&](const Tile& tile) {
    EXPECT_TRUE(map->RestoreTile(tile.key(), tile.Content()).ok());
  });
  for (const auto& activity : view.activities()) {
    StoredActivity stored;
    stored.start = {.id = activity->id,
                    .vehicle_id = activity->vehicle_id,
                    .start = activity->start,
                    .options = activity->options};
    stored.open = activity->open();
    stored.measurements_accepted = activity->measurements_accepted;
    stored.rejects = activity->rejects;
    stored.cells_measured = activity->cells_measured;
    EXPECT_TRUE(map->RestoreActivity(stored).ok());
    if (activity->open()) {
      activity->local->ForEachBlock(
          [&](BlockIndex index, const LocalBlock& block) {
            EXPECT_TRUE(map->RestoreBlock(activity->id, index, block).ok());
          });
    }
  }
  view.contacts().ForEach([&](const Contact& contact) {
    EXPECT_TRUE(map->RestoreContact(contact.ToStored()).ok());
  });
  EXPECT_TRUE(map->RestoreRevision(view.revision(), view.as_of()).ok());
  return map;
}

// All that the map takes, also what no sea has, is stored and comes back: a
// hazard begins 4.5 std above its sounding, which here is the sky, goes into
// the global map and from there into the prior of the next activity.
TEST(RestoringExtremes, WhateverWasTakenComesBack) {
  for (const EstimatorKind kind :
       {EstimatorKind::kNervegna, EstimatorKind::kKalman,
        EstimatorKind::kAdaptive}) {
    ObstacleMap map(SmallMission());
    std::mt19937_64 random(11);
    const auto pick = [&random](std::initializer_list<float> from) {
      return from.begin()[random() % from.size()];
    };
    for (const std::string id : {"a", "b", "c"}) {
      StartActivity survey = Survey(id, kind);
      survey.options.smoothing_distance_m = 20;
      survey.options.smoothing_scale = 0.5;
      ASSERT_TRUE(map.Start(survey).ok());
      ASSERT_TRUE(map.ApplyPing(HitAt(id, 105, 105, -99.5f, 1.2f, 1)).ok());
      for (int i = 0; i < 600; ++i) {
        // Few places, so that each is hit often.
        ASSERT_TRUE(
            map.ApplyPing(HitAt(id,
                                5 + 10.0 * static_cast<double>(random() % 12),
                                5 + 10.0 * static_cast<double>(random() % 12),
                                pick({-100, -99.5, 0, 20, 60, 12'000}),
                                pick({1e-4f, 0.1f, 1.2f, 80, 100}), i))
                .ok());
      }
      Restored(*map.View());
      ASSERT_TRUE(map.Transfer(ActivityId{id}).ok());
      Restored(*map.View());
    }
    EXPECT_EQ(Restored(*map.View())->View()->Digest(), map.View()->Digest());
  }
}

class Restoring : public ::testing::TestWithParam<EstimatorKind> {};

TEST_P(Restoring, PiecesPlusReplayGiveTheSameMapDigestForDigest) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(30, 4), true).ok());
  StartActivity survey = Survey("a", GetParam());
  survey.options.smoothing_distance_m = 20;
  survey.options.smoothing_scale = 0.5;
  ASSERT_TRUE(map.Start(survey).ok());

  // Events of the first half are in the checkpoint, the others in the journal.
  const auto apply = [](ObstacleMap& to, int i) {
    ASSERT_TRUE(
        to.ApplyPing(HitAt("a", 20 + (i * 37) % 460, 20 + (i * 91) % 460,
                           static_cast<float>(20 + i % 7), 0.5f, i))
            .ok());
    ASSERT_TRUE(to.ApplyContact(ShipAt(i, 2.0 * i, i)).applied);
  };
  for (int i = 0; i < 200; ++i) {
    apply(map, i);
    if (i == 100) {
      ASSERT_TRUE(map.Transfer(ActivityId{"a"}).ok());
    }
  }
  const std::unique_ptr<ObstacleMap> second = Restored(*map.View());
  EXPECT_EQ(second->View()->Digest(), map.View()->Digest());
  EXPECT_EQ(second->revision(), map.revision());
  for (int i = 200; i < 400; ++i) {
    apply(map, i);
    apply(*second, i);
  }
  ASSERT_TRUE(map.Complete(ActivityId{"a"}, false).ok());
  ASSERT_TRUE(second->Complete(ActivityId{"a"}, false).ok());
  EXPECT_EQ(second->View()->Digest(), map.View()->Digest());
  EXPECT_EQ(second->revision(), map.revision());
  EXPECT_EQ(second->View()->as_of(), map.View()->as_of());
}

INSTANTIATE_TEST_SUITE_P(EveryEstimator, Restoring,
                         ::testing::Values(EstimatorKind::kNervegna,
                                           EstimatorKind::kKalman,
                                           EstimatorKind::kAdaptive));

TEST(ObstacleMap, TheDigestSeesEveryPart) {
  ObstacleMap map(SmallMission());
  std::vector<std::string> digests = {map.View()->Digest()};
  const auto changed = [&] {
    digests.push_back(map.View()->Digest());
    return digests.back() != digests[digests.size() - 2];
  };
  ASSERT_TRUE(map.Import(FlatChart(30, 4), true).ok());
  EXPECT_TRUE(changed());
  ASSERT_TRUE(map.Start(Survey("a")).ok());
  EXPECT_TRUE(changed());
  ASSERT_TRUE(map.ApplyPing(HitAt("a", 105, 105, 20, 3, 1)).ok());
  EXPECT_TRUE(changed());
  ASSERT_TRUE(map.ApplyContact(ShipAt(0, 0, 0)).applied);
  EXPECT_TRUE(changed());
  ASSERT_TRUE(map.Transfer(ActivityId{"a"}).ok());
  EXPECT_TRUE(changed());
}

}  // namespace
}  // namespace fathom::map
