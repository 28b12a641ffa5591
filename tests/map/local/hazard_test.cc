// Rocks narrower than a cell, and the gate for gross errors.

#include "map/local/hazard.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "map/local/local_grid.h"
#include "tests/map/local/local_test_map.h"

namespace fathom::map {
namespace {

const CellIndex kCell = {.i = 10, .j = 10};

// No prior: what the soundings say is what is looked at.
LocalMapOptions Options(EstimatorKind kind = EstimatorKind::kAdaptive) {
  LocalMapOptions options = TestOptions(kind);
  options.default_depth_m.reset();
  options.default_std_m.reset();
  return options;
}

TEST(HazardDepth, IsFourStdAboveARockThatNoiseDoesNotExplain) {
  // Nine soundings at 20 m and one at 18 m, 0.1 m each: mean 19.8, the others
  // 2 m deeper. q_10 = sqrt(2 ln 500) - 0.45 = 3.0755: explained are
  // 3.0755 * 0.1 * sqrt(10 / 9) = 0.324 m.
  Evidence evidence;
  for (int n = 0; n < 9; ++n) evidence.Add(20.0f, 0.1f, 1);
  evidence.Add(18.0f, 0.1f, 1);
  EXPECT_NEAR(HazardDepth(evidence, 0.0), 17.6f, 1e-4);
  // A slope that varies by 1.6 m (std) explains it: 1.3 * 1.6 = 2.08 m times
  // sqrt(10 / 9).
  EXPECT_TRUE(std::isnan(HazardDepth(evidence, 1.6 * 1.6)));
}

TEST(HazardDepth, ConsistentSoundingsAreNoneOnceInAHundredCells) {
  std::mt19937_64 random(5);
  std::normal_distribution<float> noise(0.0f, 0.3f);
  for (const int hits : {3, 10, 100}) {
    int hazards = 0;
    constexpr int kCells = 4000;
    for (int cell = 0; cell < kCells; ++cell) {
      Evidence evidence;
      for (int n = 0; n < hits; ++n) {
        evidence.Add(20.0f + noise(random), 0.3f, 1);
      }
      hazards += !std::isnan(HazardDepth(evidence, 0.0));
    }
    // 1 % is 40; 7 is its std.
    EXPECT_LT(hazards, 0.02 * kCells) << hits;
  }
}

TEST(HazardDepth, FewerThanThreeSoundingsMayBothBeOnARock) {
  Evidence evidence;
  EXPECT_TRUE(std::isnan(HazardDepth(evidence, 0.0)));
  evidence.Add(20.0f, 0.1f, 1);
  EXPECT_NEAR(HazardDepth(evidence, 0.0), 19.6f, 1e-4);
}

TEST(HazardDepth, SoundingsThatAreNotCredibleMakeNone) {
  // 5 m of std is beyond any order of survey.
  Evidence evidence;
  for (int n = 0; n < 9; ++n) evidence.Add(20.0f, 0.1f, 1);
  evidence.Add(5.0f, 5.0f, 1);
  EXPECT_TRUE(std::isnan(HazardDepth(evidence, 0.0)));
}

TEST(IsGrossShoal, TakesMoreThanTenMetresAndHalfOfTheDepth) {
  EXPECT_TRUE(IsGrossShoal(0.55f, 90.0f));
  EXPECT_FALSE(IsGrossShoal(50.0f, 90.0f));  // A wreck.
  EXPECT_FALSE(IsGrossShoal(0.0f, 9.0f));    // A quay.
  EXPECT_FALSE(IsGrossShoal(90.0f, 0.55f));  // Deeper is not shoal.
}

// The dropout that crowd-sourced logs are full of: 0.55 m beside 90 m.
TEST(Gate, AGrossShoalIsHeldBackCountedAndNotFree) {
  const LocalMapOptions options = Options();
  LocalMap map = MakeMap(options);
  for (int n = 0; n < 5; ++n) {
    map.Update(PingOn(options, kCell, 90.0f, 0.2f), nullptr);
  }
  const LocalMap::UpdateResult result =
      map.Update(PingOn(options, kCell, 0.55f, 0.1f), nullptr);
  EXPECT_EQ(result.accepted, 0u);
  EXPECT_EQ(result.rejects.count(RejectReason::kGated), 1u);
  const DepthEstimate got = *map.View().AtCell(kCell);
  EXPECT_NEAR(got.depth_m, 90.0f, 0.1f);
  EXPECT_LT(got.std_m, 1.0f);
  EXPECT_NEAR(got.hazard_m, 0.55f - 0.4f, 1e-4);
}

TEST(Gate, TheSecondCredibleHitOnANewShoalCountsAtOnce) {
  const LocalMapOptions options = Options();
  LocalMap map = MakeMap(options);
  for (int n = 0; n < 5; ++n) {
    map.Update(PingOn(options, kCell, 40.0f, 0.2f), nullptr);
  }
  EXPECT_EQ(map.Update(PingOn(options, kCell, 4.0f, 0.2f), nullptr).accepted,
            0u);
  EXPECT_EQ(map.Update(PingOn(options, kCell, 4.5f, 0.2f), nullptr).accepted,
            1u);
  const LocalMapView view = map.View();
  const DepthEstimate got = *view.AtCell(kCell);
  // Both are in: 5 at 40 and 4, 4.5: (200 + 8.5) / 7 = 29.79.
  EXPECT_NEAR(got.depth_m, 29.79f, 0.1f);
  EXPECT_EQ(got.shoalest_m, 4.0f);
  EXPECT_NEAR(got.hazard_m, 3.2f, 1e-3);
  EXPECT_TRUE(view.Block(LocalGrid::BlockOf(kCell))->pending.empty());
}

TEST(Gate, ASecondOneElsewhereOrNotCredibleConfirmsNothing) {
  const PendingShoal waiting = {.depth_m = 4.0f, .std_m = 0.2f};
  EXPECT_TRUE(Confirms(waiting, 5.9f, 0.2f));
  EXPECT_FALSE(Confirms(waiting, 6.1f, 0.2f));
  EXPECT_FALSE(Confirms(waiting, 4.0f, 5.0f));
}

TEST(Gate, IsForgottenAfterFiveHundredSoundingsThatDoNotConfirmIt) {
  const LocalMapOptions options = Options();
  LocalMap map = MakeMap(options);
  for (int n = 0; n < 5; ++n) {
    map.Update(PingOn(options, kCell, 90.0f, 0.2f), nullptr);
  }
  map.Update(PingOn(options, kCell, 0.55f, 0.1f), nullptr);
  for (std::uint32_t n = 1; n < kPendingSoundings; ++n) {
    map.Update(PingOn(options, kCell, 90.0f, 0.2f), nullptr);
  }
  EXPECT_FALSE(std::isnan(map.View().AtCell(kCell)->hazard_m));
  map.Update(PingOn(options, kCell, 90.0f, 0.2f), nullptr);
  EXPECT_TRUE(std::isnan(map.View().AtCell(kCell)->hazard_m));
}

TEST(Gate, NeighboursSpeakForACellThatIsNew) {
  const LocalMapOptions options = Options();
  LocalMap map = MakeMap(options);
  for (const int j : {9, 10, 11}) {
    map.Update(PingOn(options, {.i = 9, .j = j}, 60.0f, 0.2f), nullptr);
  }
  EXPECT_EQ(map.Update(PingOn(options, kCell, 3.0f, 0.2f), nullptr).accepted,
            0u);
  // Held back and nothing else known: the map says nothing of the cell.
  EXPECT_FALSE(map.View().AtCell(kCell).has_value());
  EXPECT_EQ(map.Update(PingOn(options, kCell, 3.1f, 0.2f), nullptr).accepted,
            1u);
  EXPECT_NEAR(map.View().AtCell(kCell)->depth_m, 3.05f, 0.2f);
}

TEST(Gate, TheThesisEstimatorsTakeEverySounding) {
  for (const EstimatorKind kind :
       {EstimatorKind::kNervegna, EstimatorKind::kKalman}) {
    const LocalMapOptions options = Options(kind);
    LocalMap map = MakeMap(options);
    for (int n = 0; n < 5; ++n) {
      map.Update(PingOn(options, kCell, 90.0f, 0.2f), nullptr);
    }
    EXPECT_EQ(map.Update(PingOn(options, kCell, 0.55f, 0.1f), nullptr).accepted,
              1u);
  }
}

}  // namespace
}  // namespace fathom::map
