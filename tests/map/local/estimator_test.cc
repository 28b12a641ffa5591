#include "map/local/estimator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <random>

#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

using ::fathom::testing::IsOkAndHolds;
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

TEST(EstimatorKind, NamesGoThereAndBack) {
  for (const EstimatorKind kind :
       {EstimatorKind::kNervegna, EstimatorKind::kKalman,
        EstimatorKind::kAdaptive}) {
    EXPECT_THAT(ParseEstimator(EstimatorName(kind)), IsOkAndHolds(kind));
  }
  EXPECT_THAT(ParseEstimator("Kalman"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("nervegna, kalman, adaptive")));
}

TEST(Equations, Eq4_17GainIsTheShareOfTheOldVariance) {
  EXPECT_DOUBLE_EQ(Gain(4.0, 1.0), 0.8);  // 4 / (4 + 1).
  EXPECT_DOUBLE_EQ(Gain(0.5, 0.5), 0.5);
  EXPECT_DOUBLE_EQ(Gain(0.0, 1.0), 0.0);
  EXPECT_EQ(Gain(std::numeric_limits<double>::infinity(), 1.0), 1.0);
}

TEST(Equations, Eq4_18MeanIsTheWeightedMean) {
  // 0.2 * 20 + 0.8 * 25 = 24.
  EXPECT_DOUBLE_EQ(FuseMean(0.8, 20.0, 25.0), 24.0);
}

TEST(Equations, Eq4_19CorrectionGivesTheMeanOf4_18) {
  // 20 + 0.8 * 5 = 24.
  EXPECT_DOUBLE_EQ(CorrectMean(0.8, 20.0, 25.0), 24.0);
  for (const double k : {0.0, 0.1, 0.37, 0.5, 0.99, 1.0}) {
    EXPECT_NEAR(CorrectMean(k, 13.7, 15.2), FuseMean(k, 13.7, 15.2), 1e-14);
  }
}

TEST(Equations, Eq4_20VarianceIsThatOfTheOptimalMean) {
  // (1 - 0.8) * 4 = 0.8; also k s2^2 = 0.8 * 1; also the printed half-sum
  // (0.8 + 0.8) / 2; also 4.15: 1 / 5 * 4.
  EXPECT_DOUBLE_EQ(FuseVarianceKalman(0.8, 4.0), 0.8);
  // Fig. 4-7: equal variances halve.
  EXPECT_DOUBLE_EQ(FuseVarianceKalman(Gain(0.5, 0.5), 0.5), 0.25);
}

TEST(Equations, Eq4_20IgnoresDisagreement) {
  // The thesis's pathological case: zero variance, other mean.
  EXPECT_EQ(FuseVarianceKalman(Gain(1.0, 0.0), 1.0), 0.0);
}

TEST(Equations, Eq4_21VarianceAddsTheMovementOfTheMean) {
  // 0.2 * 4 + 0.8 * (20 - 25)^2 = 0.8 + 20 = 20.8.
  EXPECT_DOUBLE_EQ(FuseVarianceNervegna(0.8, 4.0, 20.0, 25.0), 20.8);
  // The pathological case is no longer certain: 0 + 1 * 5^2.
  EXPECT_DOUBLE_EQ(FuseVarianceNervegna(1.0, 4.0, 20.0, 25.0), 25.0);
}

TEST(Equations, Eq4_22ReachIsTheCeilingOfTheQuotient) {
  EXPECT_EQ(SmoothReach(20.0, 10.0), 2u);
  EXPECT_EQ(SmoothReach(20.1, 10.0), 3u);
  EXPECT_EQ(SmoothReach(0.0, 10.0), 0u);
}

TEST(Equations, Eq4_23BoundsAreTheIndexPlusAndMinusReachInsideTheMap) {
  // 5 +- 2 and 7 +- 2.
  EXPECT_EQ(SmoothBounds({.i = 5, .j = 7}, 2, 50, 50),
            (NeighbourBounds{.north = 7, .east = 9, .south = 3, .west = 5}));
  // Cut at the south-west and the north-east corner of a 6 x 8 map.
  EXPECT_EQ(SmoothBounds({.i = 0, .j = 1}, 2, 6, 8),
            (NeighbourBounds{.north = 2, .east = 3, .south = 0, .west = 0}));
  EXPECT_EQ(SmoothBounds({.i = 5, .j = 7}, 2, 6, 8),
            (NeighbourBounds{.north = 5, .east = 7, .south = 3, .west = 5}));
}

TEST(Equations, Eq4_24SmoothGainFallsWithDistance) {
  // 0.5 * 4 / (4 + 1 + 1) = 1/3; two cells: 2 / 7.
  EXPECT_DOUBLE_EQ(SmoothGain(0.5, 4.0, 1.0, 1), 1.0 / 3.0);
  EXPECT_DOUBLE_EQ(SmoothGain(0.5, 4.0, 1.0, 2), 2.0 / 7.0);
  // s = 1 and n_ij = 0 is 4.17; s = 0 is no smoothing.
  EXPECT_DOUBLE_EQ(SmoothGain(1.0, 4.0, 1.0, 0), Gain(4.0, 1.0));
  EXPECT_EQ(SmoothGain(0.0, 4.0, 1.0, 1), 0.0);
}

TEST(Equations, Eq4_25DistanceIsTheLargerOfBothDifferences) {
  EXPECT_EQ(CellsApart({.i = 5, .j = 7}, {.i = 3, .j = 8}), 2u);
  EXPECT_EQ(CellsApart({.i = 5, .j = 7}, {.i = 5, .j = 7}), 0u);
}

struct Outcome {
  double rmse_m = 0.0;
  double within_1_std = 0.0;
  double mean_variance_m2 = 0.0;
};

// `pings` soundings of sigma 0.5 m on truths drawn from the prior 20 +- 5 m.
template <typename FuseVariance>
Outcome Simulate(int pings, FuseVariance fuse_variance) {
  constexpr int kTrials = 2000;
  constexpr double kSigmaM = 0.5;
  std::mt19937_64 random(421);
  std::normal_distribution<double> normal;
  Outcome outcome;
  for (int trial = 0; trial < kTrials; ++trial) {
    const double truth_m = 20.0 + 5.0 * normal(random);
    double mean_m = 20.0;
    double variance_m2 = 25.0;
    for (int ping = 0; ping < pings; ++ping) {
      const double z_m = truth_m + kSigmaM * normal(random);
      const double k = Gain(variance_m2, kSigmaM * kSigmaM);
      variance_m2 = fuse_variance(k, variance_m2, mean_m, z_m);
      mean_m = CorrectMean(k, mean_m, z_m);
    }
    const double error_m = mean_m - truth_m;
    outcome.rmse_m += error_m * error_m / kTrials;
    outcome.mean_variance_m2 += variance_m2 / kTrials;
    if (error_m * error_m <= variance_m2) outcome.within_1_std += 1.0 / kTrials;
  }
  outcome.rmse_m = std::sqrt(outcome.rmse_m);
  return outcome;
}

// Why `nervegna` is not the default (domain section 4). Let V be the variance
// it settles at. In expectation (mu1 - mu2)^2 is the error of mu1 plus
// sigma^2; with k = V / (V + sigma^2), V = (1 - k) V + k E gives V = E, the
// mean square step. The mean is then an exponential average of gain k, whose
// error variance is e = k / (2 - k) sigma^2, so V = sigma^2 + e = 2 / (2 - k)
// sigma^2; with v = V / sigma^2, k = v / (v + 1): v = 2 (v + 1) / (v + 2), i.e.
// v^2 = 2. Hence std^2 = sqrt(2) sigma^2, and e = (sqrt(2) - 1) sigma^2: an
// RMSE of 0.64 sigma if k stood still. k varies with each step (it is larger
// after a surprise), and the simulation finds an RMSE of 0.54 sigma and a mean
// std^2 of 1.02 sigma^2; either way neither falls with more pings.
TEST(Equations, Eq4_21NeverSettlesBelowHalfASigmaHoweverManyPings) {
  const Outcome after_100 = Simulate(100, FuseVarianceNervegna);
  const Outcome after_1000 = Simulate(1000, FuseVarianceNervegna);
  std::printf(
      "4.21: RMSE %.3f m after 100, %.3f m after 1000; mean std^2 %.3f sigma^2;"
      " %.1f %% within 1 std\n",
      after_100.rmse_m, after_1000.rmse_m, after_1000.mean_variance_m2 / 0.25,
      100.0 * after_1000.within_1_std);
  // Ten times the pings and no better. 2000 trials give an RMSE to 1.6 %.
  EXPECT_NEAR(after_100.rmse_m, 0.54 * 0.5, 0.02);
  EXPECT_NEAR(after_1000.rmse_m, after_100.rmse_m, 0.02);
  EXPECT_GT(after_1000.within_1_std, 0.88);  // 0.68 would be calibrated.

  // The fixed point itself, the square of the step put at its expectation:
  // from 100 sigma^2, v <- (1 - k) v + k (1 + e) with e the error variance of
  // an exponential average of gain k, settles at sqrt(2).
  double v = 100.0;
  for (int step = 0; step < 1000; ++step) {
    const double k = Gain(v, 1.0);
    const double moved = std::sqrt(1.0 + k / (2.0 - k));
    v = FuseVarianceNervegna(k, v, moved, 0.0);
  }
  EXPECT_NEAR(v, std::numbers::sqrt2, 1e-9);
}

TEST(Equations, Eq4_20ReachesTheOptimumAndIsCalibratedWherePingsAgree) {
  const auto kalman = [](double k, double variance_1, double, double) {
    return FuseVarianceKalman(k, variance_1);
  };
  const Outcome after_10 = Simulate(10, kalman);
  const Outcome after_100 = Simulate(100, kalman);
  // 0.5 / sqrt(10) = 0.158; 0.5 / sqrt(100) = 0.05; 2000 trials: +- 1.6 % std.
  EXPECT_NEAR(after_10.rmse_m, 0.158, 0.158 * 0.05);
  EXPECT_NEAR(after_100.rmse_m, 0.05, 0.05 * 0.05);
  // Binomial std of a share of 0.683 in 2000: 0.0104.
  EXPECT_NEAR(after_100.within_1_std, 0.683, 0.031);
}

}  // namespace
}  // namespace fathom::map
