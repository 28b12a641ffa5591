// Rocks narrower than a cell, and the gate for gross errors.

#include "map/local/hazard.h"

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <random>
#include <utility>

#include "map/geodesy/depth_fusion.h"
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

Evidence Soundings(std::initializer_list<float> depths_m, float std_m) {
  Evidence evidence;
  for (const float depth_m : depths_m) evidence.Add(depth_m, std_m, 1);
  return evidence;
}

TEST(LeastOfNormals, IsTheNormalQuantileOfOneHundredthOfOneInN) {
  for (const double n : {2.0, 3.0, 10.0, 100.0, 1000.0}) {
    double low = 0.0, high = 10.0;
    for (int step = 0; step < 60; ++step) {
      const double middle = 0.5 * (low + high);
      const bool rarer = 0.5 * std::erfc(middle / std::sqrt(2.0)) < 0.01 / n;
      (rarer ? high : low) = middle;
    }
    EXPECT_LT(LeastOfNormals(n) - low, 0.03) << n;
    EXPECT_GT(LeastOfNormals(n) - low, n > 30 ? -0.07 : -0.03) << n;
  }
}

TEST(HazardDepth, IsFourAndAHalfStdAboveARockThatNoiseDoesNotExplain) {
  // Nine soundings at 20 m and one at 18 m, 0.1 m each: the others are 2 m
  // deeper, and noise explains q_10 = sqrt(2 ln 500) - 0.45 = 3.0755 times
  // 0.1 m. The hazard: 18 - 4.5 * 0.1.
  EXPECT_NEAR(
      HazardDepth(Soundings({20, 20, 20, 20, 20, 20, 20, 20, 20, 18}, 0.1f)),
      17.55f, 1e-4);
}

TEST(HazardDepth, TheShoalSideOfASlopeIsOneToo) {
  // The others' mean is (19 + 20 + 21 + 22) / 4 = 20.5, 2.5 m deeper; noise
  // explains q_5 = sqrt(2 ln 250) - 0.45 = 2.873 times 0.1 m.
  EXPECT_NEAR(HazardDepth(Soundings({18, 19, 20, 21, 22}, 0.1f)), 17.55f, 1e-4);
}

// A rock at 0.15 m that was read at 0.411 m (2.6 std too deep) between two
// soundings of the floor: q_3 = sqrt(2 ln 150) - 0.45 = 2.7156.
TEST(HazardDepth, OfThreeSoundingsTheOthersMayBeWrongToo) {
  // The others' mean is (0.681 + 0.786) / 2 = 0.7335, 0.3225 m deeper, more
  // than 0.27156 m. 0.411 - 0.45 = -0.039, above the rock.
  EXPECT_NEAR(HazardDepth(Soundings({0.681f, 0.411f, 0.786f}, 0.1f)), -0.039f,
              1e-4);
  // 0.7335 - 0.464 = 0.2695 m is explained, 0.7335 - 0.460 = 0.2735 m is not.
  EXPECT_TRUE(
      std::isnan(HazardDepth(Soundings({0.681f, 0.464f, 0.786f}, 0.1f))));
  EXPECT_NEAR(HazardDepth(Soundings({0.681f, 0.460f, 0.786f}, 0.1f)), 0.010f,
              1e-4);
}

TEST(HazardDepth, ConsistentSoundingsRarelyMakeOne) {
  // n (1 - Phi(q_n sqrt((n - 1) / n))): 3 (1 - Phi(2.2173)) = 3.99 %,
  // 10 (1 - Phi(2.9177)) = 1.76 %, 100 (1 - Phi(3.6588)) = 1.27 %.
  std::mt19937_64 random(5);
  std::normal_distribution<float> noise(0.0f, 0.3f);
  for (const auto& [hits, share] :
       {std::pair(3, 0.0399), std::pair(10, 0.0176), std::pair(100, 0.0127)}) {
    int hazards = 0;
    constexpr int kCells = 4000;
    for (int cell = 0; cell < kCells; ++cell) {
      Evidence evidence;
      for (int n = 0; n < hits; ++n) {
        evidence.Add(20.0f + noise(random), 0.3f, 1);
      }
      hazards += !std::isnan(HazardDepth(evidence));
    }
    // Three std of a count.
    EXPECT_NEAR(hazards, share * kCells, 3 * std::sqrt(share * kCells)) << hits;
  }
}

TEST(HazardDepth, FewerThanThreeSoundingsMayBothBeOnARock) {
  Evidence evidence;
  EXPECT_TRUE(std::isnan(HazardDepth(evidence)));
  evidence.Add(20.0f, 0.1f, 1);
  EXPECT_NEAR(HazardDepth(evidence), 19.55f, 1e-4);
}

TEST(HazardDepth, SoundingsThatAreNotCredibleMakeNone) {
  // 5 m of std is beyond any order of survey.
  Evidence evidence;
  for (int n = 0; n < 9; ++n) evidence.Add(20.0f, 0.1f, 1);
  evidence.Add(5.0f, 5.0f, 1);
  EXPECT_TRUE(std::isnan(HazardDepth(evidence)));
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
  EXPECT_NEAR(got.hazard_m, 0.55f - 0.45f, 1e-4);
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
  // The shoaler less 4.5 * 0.2 m.
  EXPECT_NEAR(got.hazard_m, 3.1f, 1e-3);
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
