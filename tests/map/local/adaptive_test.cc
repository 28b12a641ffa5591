// The default estimator's promises (domain section 4), by hand-computed
// numbers and by Monte Carlo with fixed seeds.

#include "map/local/adaptive.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <random>

#include "tests/map/local/local_test_map.h"

namespace fathom::map {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
const CellPrior kPrior20 = {
    .depth_m = 20.0f, .std_m = 5.0f, .kind = EvidenceKind::kPrior};

Neighbourhood Alone(const PackedEvidence& cell) {
  Neighbourhood cells = {};
  cells[kCenter] = &cell;
  return cells;
}

// Of a cell that nobody is beside.
MeanVariance Read(const Evidence& evidence, const CellPrior& prior,
                  double cell_size_m) {
  return ReadAdaptive(evidence, Alone(PackMoments(evidence)), prior,
                      cell_size_m)
      .predictive;
}

TEST(VariabilityAround, WithoutNeighboursIsThatOfATypicalSlope) {
  Evidence evidence;
  evidence.Add(20.0f, 0.5f, 1);
  const PackedEvidence packed = PackMoments(evidence);
  const RegionalVariability around = VariabilityAround(Alone(packed), 10.0);
  // A step of 0.03 * 10 = 0.3 m per cell: 0.09 / 12 = 0.0075 m^2, known to a
  // factor: (1.6 * (0.0075 + 0.0001))^2 = 1.4787e-4.
  EXPECT_FLOAT_EQ(around.variance_m2, 0.0075f);
  EXPECT_NEAR(around.uncertainty_m4, 1.4787e-4, 1e-8);
}

TEST(VariabilityAround, APlaneVariesByItsStepsSquaredOverTwelve) {
  // Nine cells of 10000 soundings each (exact, and their places average out),
  // stepping 2 m north and 1 m east.
  std::array<PackedEvidence, 9> plane;
  Neighbourhood cells;
  for (std::size_t k = 0; k < 9; ++k) {
    const std::size_t row = k / 3;
    const float depth_m =
        20.0f + 2.0f * static_cast<float>(row) + static_cast<float>(k % 3);
    Evidence evidence;
    for (int n = 0; n < 10000; ++n) evidence.Add(depth_m, 0.01f, 1);
    plane[k] = PackMoments(evidence);
    cells[k] = &plane[k];
  }
  // Steps: (4 + 1) / 12 = 0.41667, uncertain by sampling
  // (2 * 16 + 2 * 1) / (0.5 * 6) / 144 = 0.078704 and as a plane
  // (0.4 * 0.41677)^2 = 0.027791: 0.106495. Typical: 0.0075 with
  // (1.6 * 0.41677)^2 = 0.444657. The neighbours' scatter says 0 (less the
  // stated noise) with (0.6 * 0.41677)^2 = 0.062530 and next to no sampling:
  // each has seen 10000 soundings at one depth. Precisions 9.3901, 2.2489,
  // 15.992: (9.3901 * 0.41667 + 2.2489 * 0.0075) / 27.631 = 0.14221.
  EXPECT_NEAR(VariabilityAround(cells, 10.0).variance_m2, 0.14221, 2e-4);
}

TEST(VariabilityAround, SingleSoundingsScatterInsideTheirCells) {
  // Two exact single soundings 2 m apart, one north of the other: the step
  // holds 2 tau^2 for their places, and the missing axis steps alike:
  // (4 + 4) / (12 + 4) = 0.5. Sampling: 2 * 16 / 0.5 for each axis: 128 / 256 =
  // 0.5; plane (0.4 * 0.5001)^2 = 0.040016: 0.540016. Typical 0.0075 with
  // (1.6 * 0.5001)^2 = 0.640256. Precisions 1.85180 and 1.56188:
  // (1.85180 * 0.5 + 1.56188 * 0.0075) / 3.41368 = 0.27466.
  Evidence south, center;
  south.Add(20.0f, 0.001f, 1);
  center.Add(22.0f, 0.001f, 1);
  const PackedEvidence packed_south = PackMoments(south);
  const PackedEvidence packed_center = PackMoments(center);
  Neighbourhood cells = Alone(packed_center);
  cells[1] = &packed_south;
  EXPECT_NEAR(VariabilityAround(cells, 10.0).variance_m2, 0.27466, 1e-4);
}

TEST(VariabilityInside, IsTheScatterBeyondTheStatedNoise) {
  // Ten soundings of 0.1 m at 19 and 21 m in turn: W = 1000, mean 20,
  // scatter = 10 * 100 * 1 = 1000, freedom 9: excess (1000 - 9) * 10 / 1000 =
  // 9.91 m^2; alone 9.91 / 9 = 1.1011. 1000 is far beyond chance.
  Evidence evidence;
  for (int k = 0; k < 10; ++k) {
    evidence.Add(k % 2 == 0 ? 19.0f : 21.0f, 0.1f, 1);
  }
  const RegionalVariability calm = {.variance_m2 = 0.0075f,
                                    .uncertainty_m4 = 1.5e-4f};
  EXPECT_NEAR(VariabilityInside(evidence, calm), 1.1011, 1e-3);
}

TEST(VariabilityInside, AgreeingSoundingsForgetASteepRegion) {
  // Own: (0 - 99) * 100 / 10000 / 99 = -0.01, uncertain by
  // 2 (0.01 + 1.0)^2 / 99 = 0.020608; the region's 1.0 by 0.49: precisions
  // 48.525 and 2.0408: (2.0408 - 0.48525) / 50.566 = 0.030763, std 0.14063: x =
  // 0.21875, phi / Phi = 0.38951 / 0.58658 = 0.66404: 0.14063 * 0.88279 =
  // 0.12415. Eight times less than the region's.
  Evidence evidence;
  for (int k = 0; k < 100; ++k) evidence.Add(20.0f, 0.1f, 1);
  const RegionalVariability steep = {.variance_m2 = 1.0f,
                                     .uncertainty_m4 = 0.49f};
  EXPECT_NEAR(VariabilityInside(evidence, steep), 0.12415, 2e-3);
}

TEST(VariabilityInside, NoiseThatHidesItLeavesWhatItCouldHide) {
  // Scatter as chance has it (99 for 99), the region says 0 +- 0.01: own 0 with
  // 2 (0.01 + 0.8 * 0.01)^2 / 99 = 6.545e-6; both 6.143e-6, std 0.0024785,
  // * 0.79788 = 0.0019776.
  Evidence evidence = {
      .weight = 10000.0f, .mean_m = 20.0f, .scatter = 99.0f, .count = 100};
  const RegionalVariability unsure = {.variance_m2 = 0.0f,
                                      .uncertainty_m4 = 1e-4f};
  EXPECT_NEAR(VariabilityInside(evidence, unsure), 0.0019776, 1e-5);
}

// x + phi(x) / Phi(x) by the standard library against what a lone sounding
// reads from a region of mean x and std 1: interpolated to 2e-4.
TEST(VariabilityInside, IsTheMeanOfANormalCutOffBelowZero) {
  Evidence evidence;
  evidence.Add(20.0f, 0.1f, 1);
  for (float x = -19.99f; x <= 12.0f; x += 0.03f) {
    const double y = static_cast<double>(x);
    const double density = std::exp(-0.5 * y * y) / std::sqrt(2 * M_PI);
    const double exact = y + density / (0.5 * std::erfc(-y / std::sqrt(2.0)));
    const double got = static_cast<double>(VariabilityInside(
        evidence, {.variance_m2 = x, .uncertainty_m4 = 1.0f}));
    EXPECT_NEAR(got / exact, 1.0, 2e-4) << x;
  }
}

TEST(FusePrior, WithinWhatIsExplainedIsEq4_18And4_20) {
  // Prior 20, 4 m^2; evidence 21, 1 m^2: k = 0.8, 20.8, 0.8 m^2.
  const MeanVariance fused = FusePrior({21.0, 1.0}, 5, 20.0, 4.0);
  EXPECT_NEAR(fused.mean_m, 20.8, 1e-12);
  EXPECT_NEAR(fused.variance_m2, 0.8, 1e-12);
}

TEST(FusePrior, NoPriorLeavesTheEvidence) {
  const MeanVariance fused = FusePrior({21.0, 1.0}, 5, 0.0, kInf);
  EXPECT_EQ(fused.mean_m, 21.0);
  EXPECT_EQ(fused.variance_m2, 1.0);
}

TEST(FusePrior, IsContinuousWhereThePriorBeginsToBeWidened) {
  // d^2 = 4 + 1 = 5 is the border.
  const double at_m = 20.0 + std::sqrt(5.0);
  const MeanVariance below = FusePrior({at_m - 1e-9, 1.0}, 5, 20.0, 4.0);
  const MeanVariance above = FusePrior({at_m + 1e-9, 1.0}, 5, 20.0, 4.0);
  EXPECT_NEAR(below.mean_m, above.mean_m, 1e-8);
  EXPECT_NEAR(below.variance_m2, above.variance_m2, 1e-8);
}

// A prior 15 m wrong that claims 1 m; soundings of 0.5 m at 35.
TEST(Adaptive, PriorFifteenMetresWrongIsForgottenAfterTwoHits) {
  const CellPrior wrong = {
      .depth_m = 20.0f, .std_m = 1.0f, .kind = EvidenceKind::kPrior};
  Evidence evidence;
  evidence.Add(35.0f, 0.5f, 1);
  const MeanVariance one = Read(evidence, wrong, 10.0);
  // Either may be wrong: k = 1 / 1.25 = 0.8 about, k (1 - k) 225 = 36 m^2.
  EXPECT_GT(std::sqrt(one.variance_m2), 5.0);
  evidence.Add(35.0f, 0.5f, 2);
  const MeanVariance two = Read(evidence, wrong, 10.0);
  // Widened prior: 225 m^2 about; pulls by 15 * 0.125 / 225 = 8 mm.
  EXPECT_NEAR(two.mean_m, 35.0, 0.02);
  // sigma / sqrt(2) = 0.354 and a little variability.
  EXPECT_LT(std::sqrt(two.variance_m2), 0.5);

  // What 4.18 + 4.20 make of it: k = 1 / (1 + 0.125) = 0.889, 33.33 m: 1.7 m
  // wrong and sure of it.
  EXPECT_NEAR(20.0 + 15.0 / 1.125, 33.33, 0.01);
}

// Soundings of "no" error at different depths: the std is not below the
// spread, whichever way that is counted (n - 1).
TEST(Adaptive, DisagreeingCertainSoundingsLeaveAStdNotBelowTheirSpread) {
  for (int n = 2; n <= 12; ++n) {
    Evidence evidence;
    double sum = 0.0, sum2 = 0.0;
    for (int k = 0; k < n; ++k) {
      const float depth_m = 20.0f + 2.0f * static_cast<float>(k % 2);
      evidence.Add(depth_m, 1e-6f, 1);
      sum += depth_m;
      sum2 += depth_m * depth_m;
    }
    const double spread_m = std::sqrt((sum2 - sum * sum / n) / (n - 1));
    const MeanVariance read = Read(evidence, CellPrior{}, 10.0);
    EXPECT_GE(std::sqrt(read.variance_m2), spread_m) << n;
    EXPECT_LE(std::sqrt(read.variance_m2), 1.5 * spread_m) << n;
    EXPECT_NEAR(read.mean_m, sum / n, 1e-3) << n;
  }
}

// Truths from the prior, pings that agree: the error is within 10 % of
// sigma / sqrt(n). 4000 trials know an RMSE to 1.1 % (1 std).
TEST(Adaptive, AgreeingPingsReachTheOptimum) {
  constexpr int kTrials = 4000;
  constexpr double kSigmaM = 0.5;
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  for (const int pings : {1, 2, 5, 10, 100}) {
    double square = 0.0;
    int within_1 = 0, within_2 = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      const double truth_m = 20.0 + 5.0 * normal(random);
      Evidence evidence;
      for (int ping = 0; ping < pings; ++ping) {
        evidence.Add(static_cast<float>(truth_m + kSigmaM * normal(random)),
                     static_cast<float>(kSigmaM), 1);
      }
      // 1 m cells: hardly any variability is presumed.
      const MeanVariance read = Read(evidence, kPrior20, 1.0);
      const double error_m = read.mean_m - truth_m;
      square += error_m * error_m;
      within_1 += error_m * error_m <= read.variance_m2;
      within_2 += error_m * error_m <= 4.0 * read.variance_m2;
    }
    const double rmse_m = std::sqrt(square / kTrials);
    const double optimum_m = kSigmaM / std::sqrt(pings);
    std::printf(
        "adaptive, %3d pings that agree: RMSE %.4f m, optimum %.4f m; "
        "%.1f %% within 1 std, %.1f %% within 2\n",
        pings, rmse_m, optimum_m, 100.0 * within_1 / kTrials,
        100.0 * within_2 / kTrials);
    EXPECT_LE(rmse_m, 1.1 * optimum_m) << pings;
    // Never overconfident beyond 3 points; unsure is allowed: chance scatter
    // of few pings is taken for variability.
    EXPECT_GE(within_1, 0.653 * kTrials) << pings;
    EXPECT_GE(within_2, 0.925 * kTrials) << pings;
  }
}

struct Coverage {
  double within[3] = {0.0, 0.0, 0.0};  // Of 1, 2, 3 std.
};

// Depths anywhere in a cell of a slope against its estimate, `hits` soundings
// of 0.3 m at random places in each of 12 x 12 cells of 10 m.
Coverage CoverageOnASlope(double slope, double azimuth_rad, int hits,
                          std::uint64_t seed) {
  LocalMapOptions options = TestOptions(EstimatorKind::kAdaptive);
  // No prior: a wrong one widens the answers and would hide the slope's part.
  options.default_depth_m.reset();
  options.default_std_m.reset();
  LocalMap map = MakeMap(options);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> inside(0.0, 10.0);
  const auto truth_m = [&](double north_m, double east_m) {
    return 20.0 + slope * (north_m * std::cos(azimuth_rad) +
                           east_m * std::sin(azimuth_rad));
  };
  constexpr int kSide = 12;
  for (int hit = 0; hit < hits; ++hit) {
    for (int k = 0; k < kSide * kSide; ++k) {
      const int row = k / kSide;
      const double north_m = 10.0 * row + inside(random);
      const double east_m = 10.0 * (k % kSide) + inside(random);
      map.Update(PingAt(options, north_m, east_m,
                        static_cast<float>(truth_m(north_m, east_m) +
                                           0.3 * normal(random)),
                        0.3f),
                 nullptr);
    }
  }
  const LocalMapView view = map.View();
  Coverage coverage;
  constexpr int kProbes = 200;
  for (int k = 0; k < kSide * kSide; ++k) {
    const int row = k / kSide;
    const DepthEstimate estimate = *view.AtCell({.i = row, .j = k % kSide});
    for (int probe = 0; probe < kProbes; ++probe) {
      const double error_m = truth_m(10.0 * row + inside(random),
                                     10.0 * (k % kSide) + inside(random)) -
                             estimate.depth_m;
      for (int n = 0; n < 3; ++n) {
        if (std::fabs(error_m) <= (n + 1.0) * estimate.std_m) {
          coverage.within[n] += 100.0 / (kSide * kSide * kProbes);
        }
      }
    }
  }
  return coverage;
}

// A plane is not normal inside a cell: with mean and std known exactly, a
// slope along an axis is uniform (57.7 % within 1 std), a diagonal one
// triangular (65 %), all within 2.45 std. So the numbers are printed and held
// to a sane band.
TEST(Adaptive, SlopingCellCoversTheDepthsInsideIt) {
  for (const double slope : {0.02, 0.1, 0.3}) {
    for (const double azimuth_deg : {0.0, 30.0, 45.0}) {
      for (const int hits : {1, 3, 10, 30}) {
        const Coverage got =
            CoverageOnASlope(slope, azimuth_deg * 3.14159265 / 180.0, hits,
                             static_cast<std::uint64_t>(hits));
        std::printf(
            "slope %.2f towards %2.0f deg, %2d hits a cell: %.1f / %.1f / "
            "%.1f %% within 1 / 2 / 3 std\n",
            slope, azimuth_deg, hits, got.within[0], got.within[1],
            got.within[2]);
        EXPECT_GT(got.within[0], 52.0);
        EXPECT_GT(got.within[1], 90.0);
        EXPECT_GT(got.within[2], 97.0);
        // Not unsure without end either.
        EXPECT_LT(got.within[0], 85.0);
      }
    }
  }
}

}  // namespace
}  // namespace fathom::map
