#include "map/local/evidence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace fathom::map {
namespace {

TEST(Evidence, OneSounding) {
  Evidence evidence;
  EXPECT_TRUE(evidence.empty());
  evidence.Add(20.0f, 0.5f, 100);
  EXPECT_EQ(evidence.weight, 4.0f);  // 1 / 0.25.
  EXPECT_EQ(evidence.mean_m, 20.0f);
  EXPECT_EQ(evidence.scatter, 0.0f);
  EXPECT_EQ(evidence.count, 1);
  EXPECT_EQ(evidence.time_s, 100u);
  EXPECT_EQ(evidence.shoalest_m, 20.0f);
}

TEST(Evidence, TwoSoundingsByHand) {
  Evidence evidence;
  evidence.Add(20.0f, 0.5f, 100);
  evidence.Add(23.0f, 1.0f, 90);
  // W = 4 + 1 = 5; mean = (4 * 20 + 1 * 23) / 5 = 20.6;
  // scatter = 4 * 0.36 + 1 * 5.76 = 7.2; the newest time stays.
  EXPECT_FLOAT_EQ(evidence.weight, 5.0f);
  EXPECT_FLOAT_EQ(evidence.mean_m, 20.6f);
  EXPECT_NEAR(evidence.scatter, 7.2f, 1e-5);
  EXPECT_EQ(evidence.time_s, 100u);
  EXPECT_EQ(evidence.shoalest_m, 20.0f);
}

TEST(Evidence, AnyOrderAndGroupingGiveTheSameUpToRounding) {
  std::mt19937 random(1);
  std::normal_distribution<float> normal;
  std::uniform_real_distribution<float> std_m(0.1f, 2.0f);
  struct Sounding {
    float depth_m, std_m;
  };
  std::vector<Sounding> soundings(200);
  for (Sounding& one : soundings) {
    one.std_m = std_m(random);
    one.depth_m = 60.0f + one.std_m * normal(random);
  }
  // The oracle in double, two passes.
  double weight = 0.0, sum = 0.0, scatter = 0.0;
  for (const Sounding& one : soundings) {
    const double w = 1.0 / (double{one.std_m} * one.std_m);
    weight += w;
    sum += w * one.depth_m;
  }
  for (const Sounding& one : soundings) {
    const double w = 1.0 / (double{one.std_m} * one.std_m);
    scatter += w * std::pow(one.depth_m - sum / weight, 2);
  }
  for (std::size_t shuffle = 0; shuffle < 50; ++shuffle) {
    std::shuffle(soundings.begin(), soundings.end(), random);
    std::vector<Evidence> parts(1 + shuffle % 7);
    for (std::size_t k = 0; k < soundings.size(); ++k) {
      parts[k % parts.size()].Add(soundings[k].depth_m, soundings[k].std_m, 1);
    }
    Evidence all;
    for (const Evidence& part : parts) all.Merge(part);
    EXPECT_NEAR(all.weight, weight, weight * 1e-5);
    EXPECT_NEAR(all.mean_m, sum / weight, 1e-4);  // A float at 60 m: 4e-6.
    EXPECT_NEAR(all.scatter, scatter, scatter * 1e-3);
    EXPECT_EQ(all.count, 200);
  }
}

TEST(Evidence, MergingNothingChangesNothing) {
  Evidence evidence;
  evidence.Add(20.0f, 0.5f, 100);
  const Evidence before = evidence;
  evidence.Merge(Evidence{});
  EXPECT_EQ(evidence.weight, before.weight);
  EXPECT_EQ(evidence.mean_m, before.mean_m);
  EXPECT_EQ(evidence.shoalest_m, before.shoalest_m);
  EXPECT_EQ(evidence.count, before.count);
}

TEST(Evidence, AStdBelowAMillimetreCountsAsOne) {
  Evidence evidence;
  evidence.Add(20.0f, 1e-30f, 100);
  EXPECT_FLOAT_EQ(evidence.weight, 1e6f);  // 1 / 0.001^2.
  evidence.Add(21.0f, 1e-30f, 100);
  EXPECT_TRUE(std::isfinite(evidence.scatter));
}

TEST(Evidence, AFullCountHalvesAndKeepsItsMean) {
  Evidence evidence;
  for (int k = 0; k < 32'767; ++k) evidence.Add(20.0f, 1.0f, 1);
  EXPECT_EQ(evidence.count, 32'767);
  EXPECT_EQ(evidence.weight, 32'767.0f);
  evidence.Add(20.0f, 1.0f, 2);
  EXPECT_EQ(evidence.count, 16'384);      // 32 767 / 2 + 1.
  EXPECT_EQ(evidence.weight, 16'384.5f);  // 32 767 / 2 + 1.
  EXPECT_EQ(evidence.mean_m, 20.0f);
  EXPECT_EQ(evidence.time_s, 2u);
  Evidence twice = evidence;
  for (int k = 0; k < 20'000; ++k) twice.Add(20.0f, 1.0f, 2);
  twice.Merge(evidence);
  EXPECT_LE(twice.count, 32'767);
  EXPECT_NEAR(twice.weight / twice.count, 1.0f, 1e-3);
}

TEST(Evidence, ShoalestIsKeptWhereTheMeanHidesIt) {
  Evidence evidence;
  for (int k = 0; k < 99; ++k) evidence.Add(20.0f, 0.3f, 1);
  evidence.Add(16.0f, 0.3f, 2);                // A rock.
  EXPECT_NEAR(evidence.mean_m, 19.96f, 1e-3);  // 20 - 4 / 100.
  EXPECT_EQ(evidence.shoalest_m, 16.0f);
  Evidence later;
  later.Add(20.0f, 0.3f, 3);
  later.Merge(evidence);
  EXPECT_EQ(later.shoalest_m, 16.0f);
}

TEST(Evidence, AnUncertainSoundingDoesNotSetTheShoalest) {
  // S-44 order 2 at 20 m: sqrt(1 + 0.46^2) = 1.1007 m at 95 %, 0.5616 m std.
  EXPECT_TRUE(IsCredible(20.0f, 0.561f));
  EXPECT_FALSE(IsCredible(20.0f, 0.562f));
  Evidence evidence;
  evidence.Add(5.0f, 3.0f, 1);
  EXPECT_TRUE(std::isnan(evidence.shoalest_m));
  evidence.Add(20.0f, 0.3f, 1);
  EXPECT_EQ(evidence.shoalest_m, 20.0f);
}

}  // namespace
}  // namespace fathom::map
