#include "map/global/fuse.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <span>
#include <vector>

namespace fathom::map {
namespace {

// ---- The codes ----

TEST(SpreadCode, IsRightToNineTenthsOfAPercentAndNeverOffAtOne) {
  EXPECT_EQ(EncodeSpread(1.0), 0);
  EXPECT_EQ(EncodeSpread(1000.0), 255);
  for (double ratio = 1.0; ratio < 82; ratio *= 1.001) {
    const double decoded = kSpreadRatios[EncodeSpread(ratio)];
    ASSERT_NEAR(decoded / ratio, 1.0, 0.0088) << ratio;
  }
}

TEST(MakeLeaf, KeepsThePredictiveStdWhereTheSpreadIsBeyondTheCode) {
  // 1 m of variability about a mean known to 1 mm: 1000 is more than 83.
  const Leaf leaf =
      MakeLeaf(LeafKind::kMeasured,
               {.mean_m = 5, .variance_m2 = 1e-6, .variability_m2 = 1.0});
  EXPECT_NEAR(leaf.std_m(), 1.0, 0.01);
  EXPECT_NEAR(leaf.mean_std_m(), 1.0 / 82.8, 0.0002);
}

// ---- The rules, by hand ----

TEST(FuseEvidence, OnlyTheVarianceOfTheMeanShrinks) {
  // Weights 4 and 1: k = 0.2; mean 10 + 0.2 * 0.5 = 10.1; variance 0.8 * 0.25 =
  // 0.2; variability 0.8 * 0.09 + 0.2 * 0.49 = 0.17. They are 0.5 apart where
  // two sigma are 2 sqrt(1.25) = 2.2.
  const CellEvidence fused =
      FuseEvidence({.mean_m = 10, .variance_m2 = 0.25, .variability_m2 = 0.09},
                   {.mean_m = 10.5, .variance_m2 = 1, .variability_m2 = 0.49});
  EXPECT_DOUBLE_EQ(fused.mean_m, 10.1);
  EXPECT_DOUBLE_EQ(fused.variance_m2, 0.2);
  EXPECT_NEAR(fused.variability_m2, 0.17, 1e-12);
}

TEST(FuseEvidence, DisagreementBeyondTwoSigmaWidens) {
  // 10 +- 0.1 and 12 +- 0.1: k = 0.5, mean 11, variance 0.005. Unexplained: 4 -
  // 4 * 0.02 = 3.92, a quarter of it is variability: std 0.995, so that both
  // lie one sigma off.
  const CellEvidence fused = FuseEvidence({.mean_m = 10, .variance_m2 = 0.01},
                                          {.mean_m = 12, .variance_m2 = 0.01});
  EXPECT_DOUBLE_EQ(fused.mean_m, 11);
  EXPECT_NEAR(fused.variance_m2, 0.005, 1e-12);
  EXPECT_NEAR(fused.variability_m2, 0.98, 1e-12);
}

TEST(FuseEvidence, LaterSurveysThatAgreeOutweighADisagreement) {
  CellEvidence fused = FuseEvidence({.mean_m = 10, .variance_m2 = 0.01},
                                    {.mean_m = 12, .variance_m2 = 0.01});
  for (int i = 0; i < 30; ++i) {
    fused = FuseEvidence(fused, {.mean_m = 10, .variance_m2 = 0.01});
  }
  EXPECT_NEAR(fused.mean_m, 10.06, 0.01);  // (31 * 10 + 12) / 32.
  // The batch's scatter about its mean: 4 * 31 / 32^2 = 0.12 m^2.
  EXPECT_LT(fused.variability_m2, 0.13);
  EXPECT_GT(fused.variability_m2, 0.03);
}

TEST(FuseEvidence, TheShoalestHazardStays) {
  const CellEvidence rock{.mean_m = 10, .variance_m2 = 1, .hazard_m = 3};
  const CellEvidence flat{.mean_m = 10, .variance_m2 = 1};
  const CellEvidence wreck{.mean_m = 10, .variance_m2 = 1, .hazard_m = 5};
  EXPECT_EQ(FuseEvidence(rock, flat).hazard_m, 3);
  EXPECT_EQ(FuseEvidence(flat, wreck).hazard_m, 5);
  EXPECT_EQ(FuseEvidence(wreck, rock).hazard_m, 3);
  EXPECT_EQ(FuseEvidence(flat, flat).hazard_m, kNoHazard);
  EXPECT_EQ(FuseWithPrior(wreck, flat).hazard_m, 5);
}

// 20 m, 12 000 m and 20 m in one cell: a std of 6 km. 1.645 of it above 20 m is
// -9850 m, which no tile may hold (a mission with it would not open again).
TEST(AddShoal, AHazardBeginsNoHigherThanALeafMayHold) {
  Leaf leaf = MakeLeaf(LeafKind::kMeasured, {.mean_m = 60, .variance_m2 = 1});
  EXPECT_TRUE(AddShoal({.mean_m = 20, .variance_m2 = 3.6e7}, leaf));
  EXPECT_EQ(leaf.hazard_m, kMinChartDepthM);
}

TEST(FuseWithPrior, ABadPriorDoesNotMatterAfterTwoSoundings) {
  // Prior 25 +- 2, truth 10: two soundings of 0.5 m, variance 0.125. Widened to
  // 225 - 0.125: it pulls by 15 * 0.125 / 225 = 8.3 mm.
  const CellEvidence fused =
      FuseWithPrior({.mean_m = 25, .variance_m2 = 4}, {.mean_m = 10,
                                                       .variance_m2 = 0.125,
                                                       .variability_m2 = 0.01,
                                                       .soundings = 2});
  EXPECT_NEAR(fused.mean_m, 10 + 0.00833, 1e-4);
  EXPECT_NEAR(fused.variance_m2, 0.125, 1e-3);
  EXPECT_DOUBLE_EQ(fused.variability_m2, 0.01);
  // A single one may itself be the error: its variance says so.
  const CellEvidence single =
      FuseWithPrior({.mean_m = 25, .variance_m2 = 4},
                    {.mean_m = 10, .variance_m2 = 0.25, .soundings = 1});
  // k (1 - k) d^2 = 4 * 0.25 / 4.25^2 * 225 = 12.5.
  EXPECT_NEAR(single.variance_m2, 0.25 + 12.46, 0.02);
}

TEST(DividedLeaf, MovesThreeQuartersOfTheVariabilityToTheMean) {
  // A plane of std 0.4 in the cell: its four parts' means vary by 0.12 m^2, the
  // depths inside each by 0.04.
  const Leaf leaf = MakeLeaf(LeafKind::kMeasured, {.mean_m = 10,
                                                   .variance_m2 = 0.01,
                                                   .variability_m2 = 0.16,
                                                   .hazard_m = 3});
  const Leaf part = DividedLeaf(leaf);
  EXPECT_NEAR(part.mean_std_m(), std::sqrt(0.13), 0.004);
  EXPECT_NEAR(part.variability_m(), 0.2, 0.007);
  EXPECT_NEAR(part.std_m(), leaf.std_m(), 0.009 * 0.412);
  EXPECT_EQ(part.hazard_m, 3);
  EXPECT_EQ(part.depth_m, 10);
}

TEST(EvidenceSum, PartsThatDifferAreVariability) {
  EvidenceSum sum;
  sum.Add({.mean_m = 8,
           .variance_m2 = 0.25,
           .variability_m2 = 0.1,
           .soundings = 3});
  sum.Add({.mean_m = 10,
           .variance_m2 = 0.25,
           .variability_m2 = 0.3,
           .soundings = 4,
           .hazard_m = 2});
  const CellEvidence joined = sum.Join(1.0);
  EXPECT_DOUBLE_EQ(joined.mean_m, 9);
  EXPECT_DOUBLE_EQ(joined.variance_m2, 0.25);
  EXPECT_DOUBLE_EQ(joined.variability_m2, 0.2 + 1.0);
  EXPECT_EQ(joined.soundings, 7u);
  EXPECT_EQ(joined.hazard_m, 2);
}

TEST(EvidenceSum, AShoalThatFillsAPartIsAHazard) {
  // Nine parts, one 4 m above the others: d = 4 - 4/9 = 3.556 from the mean
  // 19.556; the means' variance is 16 * 1/9 * 8/9 = 1.580, 1.6 of its std 2.01.
  EvidenceSum sum;
  for (int i = 0; i < 8; ++i) sum.Add({.mean_m = 20, .variance_m2 = 0.01});
  sum.Add({.mean_m = 16, .variance_m2 = 0.01, .variability_m2 = 0.03});
  const CellEvidence joined = sum.Join(1.0);
  EXPECT_NEAR(joined.mean_m, 19.5556, 1e-4);
  EXPECT_NEAR(joined.variability_m2, 1.580 + 0.03 / 9, 1e-3);
  // Its own answer ceases to be FREE at 16 - 1.645 sqrt(0.04) = 15.671.
  EXPECT_NEAR(joined.hazard_m, 15.671, 1e-4);
}

TEST(EvidenceSum, ChanceAndSlopeMakeNoHazard) {
  // Noise of 0.3 m alone: the least of 81 lies 2.4 sigma up on the average.
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 0.3);
  int hazards = 0;
  for (int cell = 0; cell < 2000; ++cell) {
    EvidenceSum sum;
    for (int i = 0; i < 81; ++i) {
      sum.Add({.mean_m = 20 + noise(random), .variance_m2 = 0.09});
    }
    hazards += sum.Join(1.0).hazard_m != kNoHazard;
  }
  // Once in a hundred cells, less by what the means' variance takes.
  EXPECT_LE(hazards, 20);
  // A slope along one axis: its end is 4 / sqrt(60 / 9) = 1.55 std up.
  EvidenceSum slope;
  for (int i = 0; i < 81; ++i) {
    slope.Add({.mean_m = 20 + 1.0 * (i % 9), .variance_m2 = 1e-4});
  }
  EXPECT_EQ(slope.Join(1.0).hazard_m, kNoHazard);
}

// ---- A prior counts once ----

// A prior and the soundings of one cell, which agree (within 0.7 sigma of the
// prior's and 1 sigma of theirs): then nothing is widened.
struct Case {
  CellEvidence prior;
  std::vector<CellEvidence> soundings;
};

Case RandomCase(std::mt19937& random, int soundings) {
  std::uniform_real_distribution<double> unit(0, 1);
  const double depth_m = 5 + 60 * unit(random);
  const double prior_std_m = 2 + 8 * unit(random);
  Case one{
      .prior = {.mean_m = depth_m + prior_std_m * 0.7 * (2 * unit(random) - 1),
                .variance_m2 = prior_std_m * prior_std_m},
      .soundings = {}};
  for (int i = 0; i < soundings; ++i) {
    const double std_m = 0.05 + 0.45 * unit(random);
    one.soundings.push_back({.mean_m = depth_m + std_m * (2 * unit(random) - 1),
                             .variance_m2 = std_m * std_m,
                             .soundings = 1});
  }
  return one;
}

// The weighted mean of `parts`: what a local map keeps between transfers, and
// the batch solution.
CellEvidence Batch(std::span<const CellEvidence> parts) {
  double weight = 0;
  double mean_m = 0;
  for (const CellEvidence& part : parts) {
    weight += 1 / part.variance_m2;
    mean_m += part.mean_m / part.variance_m2;
  }
  return {.mean_m = mean_m / weight,
          .variance_m2 = 1 / weight,
          .soundings = static_cast<std::uint32_t>(parts.size())};
}

constexpr int kSoundings = 24;

class Transfers : public ::testing::TestWithParam<int> {
 protected:
  // The soundings in GetParam() shares, one transfer each.
  static std::vector<CellEvidence> Shares(const Case& one) {
    const auto size = static_cast<std::size_t>(kSoundings / GetParam());
    std::vector<CellEvidence> shares;
    for (std::size_t begin = 0; begin < one.soundings.size(); begin += size) {
      shares.push_back(Batch(std::span(one.soundings).subspan(begin, size)));
    }
    return shares;
  }
  static CellEvidence All(const Case& one) {
    std::vector<CellEvidence> all = one.soundings;
    all.push_back(one.prior);
    return Batch(all);
  }
};

TEST_P(Transfers, GiveTheBatchSolution) {
  std::mt19937 random(17);
  for (int trial = 0; trial < 2000; ++trial) {
    const Case one = RandomCase(random, kSoundings);
    const std::vector<CellEvidence> shares = Shares(one);
    ASSERT_EQ(shares.size(), static_cast<std::size_t>(GetParam()));
    CellEvidence held = FuseWithPrior(one.prior, shares[0]);
    for (std::size_t i = 1; i < shares.size(); ++i) {
      held = FuseEvidence(held, shares[i]);
    }
    const CellEvidence all = All(one);
    ASSERT_NEAR(held.mean_m / all.mean_m, 1, 1e-6);
    ASSERT_NEAR(held.variance_m2 / all.variance_m2, 1, 1e-6);
  }
}

// The same in a leaf. Its std is rounded by up to 2^-10 of itself at each
// transfer, and so is that of later evidence. In a harmonic mean relative
// errors are averaged: k transfers err by at most (k + 1) 2^-10. An error e of
// the ratio of the stds moves a fused mean by 2 e g (1 - g) of the distance, g
// the gain, of which the next fusion keeps 1 - g.
TEST_P(Transfers, GiveTheBatchSolutionWithinTheCodesInALeaf) {
  std::mt19937 random(18);
  double worst_mean_m = 0;
  double worst_std = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const Case one = RandomCase(random, kSoundings);
    Leaf leaf = MakeLeaf(LeafKind::kPrior, one.prior);
    double bound_m = 4e-6;  // Depths are floats below 128 m.
    int transfers = 0;
    for (const CellEvidence& share : Shares(one)) {
      const CellEvidence held = EvidenceOf(leaf);
      const double gain =
          held.variance_m2 / (held.variance_m2 + share.variance_m2);
      ++transfers;
      bound_m = (1 - gain) * bound_m + 4e-6 +
                1.02 * 2 * (transfers + 1) * 0x1p-10 * gain * (1 - gain) *
                    std::abs(share.mean_m - held.mean_m);
      FuseLeaf(share, LeafKind::kMeasured, leaf);
    }
    const CellEvidence all = All(one);
    const double off_m = std::abs(leaf.depth_m - all.mean_m);
    const double off_std =
        std::abs(leaf.mean_std_m() / std::sqrt(all.variance_m2) - 1);
    ASSERT_LE(off_m, bound_m);
    ASSERT_LE(off_std, (transfers + 1) * 0x1.02p-10);
    worst_mean_m = std::max(worst_mean_m, off_m);
    worst_std = std::max(worst_std, off_std);
  }
  std::printf("%d transfers: mean off by up to %.3f mm, std by %.2f %%\n",
              GetParam(), 1000 * worst_mean_m, 100 * worst_std);
}

INSTANTIATE_TEST_SUITE_P(OneToAll, Transfers,
                         ::testing::Values(1, 2, 3, 6, kSoundings));

// ---- Order ----

struct Surveys {
  CellEvidence prior, a, b;
};

// A prior and two surveys of one cell; their means lie `sigmas` standard
// deviations (of the larger of two) about one depth.
Surveys RandomSurveys(std::mt19937& random, double sigmas) {
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> normal;
  const double depth_m = 5 + 60 * unit(random);
  const auto make = [&](double std_m, double variability_m) {
    return CellEvidence{
        .mean_m =
            depth_m + sigmas * std_m * std::clamp(normal(random), -1., 1.),
        .variance_m2 = std_m * std_m,
        .variability_m2 = variability_m * variability_m,
        .soundings = 5,
        .time_s = 1 + static_cast<std::uint32_t>(100 * unit(random))};
  };
  return {.prior = make(1 + 9 * unit(random), 0),
          .a = make(0.02 + 0.5 * unit(random), unit(random)),
          .b = make(0.02 + 0.5 * unit(random), unit(random))};
}

TEST(Order, PriorAndSurveysThatAgreeGiveTheBatchSolutionInEitherOrder) {
  std::mt19937 random(7);
  for (int i = 0; i < 10000; ++i) {
    const Surveys s = RandomSurveys(random, 0.7);
    const CellEvidence ab = FuseEvidence(FuseWithPrior(s.prior, s.a), s.b);
    const CellEvidence ba = FuseEvidence(FuseWithPrior(s.prior, s.b), s.a);
    // Weighted means, all at once.
    double weight = 0;
    double mean_m = 0;
    for (const CellEvidence* e : {&s.prior, &s.a, &s.b}) {
      weight += 1 / e->variance_m2;
      mean_m += e->mean_m / e->variance_m2;
    }
    mean_m /= weight;
    for (const CellEvidence* fused : {&ab, &ba}) {
      ASSERT_NEAR(fused->mean_m, mean_m, 1e-6);
      ASSERT_NEAR(fused->variance_m2 * weight, 1, 1e-6);
    }
    ASSERT_EQ(ab.time_s, ba.time_s);
  }
}

// How far the leaves of the two orders are apart, as stored.
struct Apart {
  int std_steps = 0;
  int spread_steps = 0;
  double depth_m = 0;
  int equal = 0;
  int trials = 0;
};

Apart Measure(double sigmas, bool with_prior) {
  std::mt19937 random(11);
  Apart apart;
  for (int i = 0; i < 20000; ++i) {
    const Surveys s = RandomSurveys(random, sigmas);
    const auto fuse = [&](const CellEvidence& first,
                          const CellEvidence& second) {
      Leaf leaf = with_prior ? MakeLeaf(LeafKind::kPrior, s.prior)
                             : MakeLeaf(LeafKind::kMeasured, first);
      if (with_prior) FuseLeaf(first, LeafKind::kMeasured, leaf);
      FuseLeaf(second, LeafKind::kMeasured, leaf);
      return leaf;
    };
    const Leaf ab = fuse(s.a, s.b);
    const Leaf ba = fuse(s.b, s.a);
    apart.std_steps =
        std::max(apart.std_steps, std::abs(ab.std_code - ba.std_code));
    apart.spread_steps =
        std::max(apart.spread_steps, std::abs(ab.spread_code - ba.spread_code));
    apart.depth_m = std::max(
        apart.depth_m, std::abs(static_cast<double>(ab.depth_m) - ba.depth_m));
    apart.equal += ab == ba ? 1 : 0;
    ++apart.trials;
  }
  std::printf(
      "%s two surveys within %.1f sigma, either order: std code off by up to "
      "%d, spread code %d, depth %.2f mm; equal to the bit %.1f %%\n",
      with_prior ? "prior and" : "no prior,", sigmas, apart.std_steps,
      apart.spread_steps, 1000 * apart.depth_m,
      100.0 * apart.equal / apart.trials);
  return apart;
}

TEST(Order, TwoSurveysOfUnknownGroundAreEqualToTheBit) {
  for (const double sigmas : {0.7, 5.0}) {
    const Apart apart = Measure(sigmas, /*with_prior=*/false);
    EXPECT_EQ(apart.equal, apart.trials);
  }
}

// Over a prior, or with a third survey, equal bits are out of reach of 12 bytes
// a leaf. An order-free sum needs fixed point: weights from 1e-2 (a chart of 10
// m) to 1e6 m^-2 with 1 % at the lower end take 34 bits, weight times depth (12
// km to 1 mm: 24 bits) 58, weight times variability and scatter (without which
// disagreement depends on the order) 58 and more, and the prior must stay apart
// (all evidence together widens it): 46. With kind, time and residual that is
// 240 bits, 30 bytes. What the folded prior and the codes cost instead: steps
// of std (0.2 %), less than a millimetre, and where the prior is only twice as
// uncertain as the surveys (the first of them then stands for it too when
// variability is averaged) five steps of spread, 9 %.
TEST(Order, OverAPriorStoredLeavesDifferByCodeSteps) {
  const Apart apart = Measure(0.7, /*with_prior=*/true);
  EXPECT_LE(apart.std_steps, 2);
  EXPECT_LE(apart.spread_steps, 5);
  EXPECT_LE(apart.depth_m, 0.001);
}

}  // namespace
}  // namespace fathom::map
