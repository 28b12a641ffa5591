// What goes wrong on purpose: sonar faults and navigation errors.

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "sim_feeder/navigation.h"
#include "sim_feeder/sonar_faults.h"
#include "tests/testing/status_matchers.h"

namespace fathom::feeder {
namespace {

std::vector<SonarMeasurement> Flat(std::size_t count) {
  return std::vector<SonarMeasurement>(
      count, {.range_m = 50, .depth_m = 30, .std_m = 0.1});
}

TEST(WithFaults, NoneChangesNothing) {
  Random random(1, RandomStream::kSonarFaults);
  const auto told = WithFaults({}, 10, Flat(100), random);
  ASSERT_EQ(told.size(), 100U);
  for (const SonarMeasurement& measured : told) {
    EXPECT_EQ(measured.depth_m, 30);
    EXPECT_EQ(measured.range_m, 50);
  }
}

TEST(WithFaults, SharesAreKept) {
  constexpr std::size_t kCount = 100'000;
  Random random(2, RandomStream::kSonarFaults);
  const auto told = WithFaults(
      {.dropout_share = 0.2, .ghost_share = 0.05, .crosstalk_share = 0.01}, 10,
      Flat(kCount), random);
  double ghosts = 0;
  double crosstalk = 0;
  double crosstalk_sum_m = 0;
  for (const SonarMeasurement& measured : told) {
    // 20 m below a sonar at 10 m: a ghost is 40 m below it.
    if (measured.depth_m == 50) {
      ++ghosts;
    } else if (measured.depth_m != 30) {
      ++crosstalk;
      crosstalk_sum_m += measured.depth_m;
      EXPECT_GE(measured.depth_m, 10);
      EXPECT_LT(measured.depth_m, 30);
    }
  }
  // Four standard deviations of the binomials: 0.2 +- 0.0051, 0.05 +- 0.0028,
  // 0.01 +- 0.0013; the mean of 1000 uniforms in [10, 30]: 20 +- 0.73.
  EXPECT_NEAR(static_cast<double>(told.size()) / kCount, 0.8, 0.0051);
  EXPECT_NEAR(ghosts / kCount, 0.05, 0.0028);
  EXPECT_NEAR(crosstalk / kCount, 0.01, 0.0013);
  EXPECT_NEAR(crosstalk_sum_m / crosstalk, 20, 0.8);
}

TEST(WithFaults, SoundSpeedStretchesAndTheTideLifts) {
  Random random(3, RandomStream::kSonarFaults);
  const auto told = WithFaults({.sound_speed_error = 0.01, .tide_m = 1.5}, 10,
                               Flat(1), random);
  // 10 + 1.01 * 20 + 1.5, and 50 * 1.01.
  EXPECT_DOUBLE_EQ(told[0].depth_m, 31.7);
  EXPECT_DOUBLE_EQ(told[0].range_m, 50.5);
}

TEST(ValidateSonarFaults, NamesTheOption) {
  FATHOM_EXPECT_OK(ValidateSonarFaults({.dropout_share = 1}));
  EXPECT_EQ(ValidateSonarFaults({.ghost_share = -0.1}).message(),
            "ghost_share=-0.1 must be in [0, 1]");
  EXPECT_EQ(
      ValidateSonarFaults({.dropout_share = 0.7, .ghost_share = 0.7}).message(),
      "the sum of dropout_share, ghost_share and crosstalk_share=1.4 must be "
      "in [0, 1]");
  EXPECT_FALSE(ValidateSonarFaults({.tide_m = NAN}).ok());
}

TEST(Navigation, ExactStaysExact) {
  Navigation navigation({}, 1);
  navigation.Advance(1000);
  EXPECT_EQ(navigation.error().north_m, 0);
  EXPECT_EQ(navigation.error().east_m, 0);
  EXPECT_EQ(navigation.stated_std_m(), 0);
}

TEST(Navigation, TheWalkGrowsWithTheRootOfTimeAndIsStated) {
  // 0.1 m after 1 s: 1 m after 100 s; over 2000 runs the deviation of either
  // axis is within 4 / sqrt(2 * 2000) = 6.4 % of it.
  double square_sum_m2 = 0;
  constexpr int kRuns = 2000;
  for (int run = 0; run < kRuns; ++run) {
    Navigation navigation({.bias_north_m = 3, .walk_m_per_sqrt_s = 0.1},
                          static_cast<std::uint64_t>(run));
    for (int second = 1; second <= 100; ++second) navigation.Advance(second);
    const double off_m = navigation.error().north_m - 3;
    square_sum_m2 += off_m * off_m;
    EXPECT_DOUBLE_EQ(navigation.stated_std_m(), 1.0);
  }
  EXPECT_NEAR(std::sqrt(square_sum_m2 / kRuns), 1.0, 0.064);
}

TEST(Navigation, AFixEndsTheDrift) {
  const NavigationOptions options = {
      .walk_m_per_sqrt_s = 1, .fix_interval_s = 60, .fix_std_m = 0.5};
  Navigation navigation(options, 4);
  navigation.Advance(59);
  // hypot(0.5, sqrt(59)).
  EXPECT_NEAR(navigation.stated_std_m(), std::sqrt(59.25), 1e-12);
  navigation.Advance(60);
  EXPECT_DOUBLE_EQ(navigation.stated_std_m(), 0.5);
  EXPECT_LT(std::fabs(navigation.error().north_m), 3);
  // The same way in one step: the fixes in between are kept.
  navigation.Advance(60 * 100 + 1);
  EXPECT_NEAR(navigation.stated_std_m(), std::sqrt(1.25), 1e-12);
}

}  // namespace
}  // namespace fathom::feeder
