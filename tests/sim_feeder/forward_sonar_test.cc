#include "sim_feeder/forward_sonar.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "sim_feeder/angles.h"
#include "tests/sim_feeder/plane_terrain.h"
#include "tests/testing/status_matchers.h"

namespace fathom::feeder {
namespace {

using ::fathom::testing::StatusIs;

constexpr double kSigmaM = 0.4;
constexpr int kDraws = 200'000;

struct Moments {
  double mean = 0.0;
  double variance = 0.0;
};

template <typename Draw>
Moments MomentsOf(Draw draw) {
  double sum = 0.0;
  double squares = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = draw();
    sum += x;
    squares += x * x;
  }
  const double mean = sum / kDraws;
  return {mean, squares / kDraws - mean * mean};
}

class NoiseOfBeams : public ::testing::TestWithParam<int> {};

// Appendix A.1: the mean of n beams is N(0, sigma^2 / n).
TEST_P(NoiseOfBeams, MeanHasNoBiasAndTheVarianceOfAMean) {
  const int n = GetParam();
  Random random(5, RandomStream::kSonar);
  const Moments found =
      MomentsOf([&] { return DrawCellNoise(random, kSigmaM, n).mean_m; });
  const double variance = kSigmaM * kSigmaM / n;
  // Five standard errors: sqrt(v / N) of a mean, v sqrt(2 / N) of a variance.
  EXPECT_NEAR(found.mean, 0.0, 5.0 * std::sqrt(variance / kDraws));
  EXPECT_NEAR(found.variance, variance,
              5.0 * variance * std::sqrt(2.0 / kDraws));
}

// Appendix A.2: E[s^2] = sigma^2, Var[s^2] = 2 sigma^4 / (n - 1).
TEST_P(NoiseOfBeams, VarianceHasNoBiasAndTheVarianceOfAVariance) {
  const int n = GetParam();
  Random random(6, RandomStream::kSonar);
  const Moments found = MomentsOf([&] {
    const double s = DrawCellNoise(random, kSigmaM, n).beam_std_m;
    return s * s;
  });
  const double sigma2 = kSigmaM * kSigmaM;
  if (n == 1) {
    // One beam shows no spread: sigma itself, always.
    EXPECT_NEAR(found.mean, sigma2, 1e-12);
    EXPECT_NEAR(found.variance, 0.0, 1e-12);
    return;
  }
  const double variance = 2.0 * sigma2 * sigma2 / (n - 1);
  EXPECT_NEAR(found.mean, sigma2, 5.0 * std::sqrt(variance / kDraws));
  // Excess kurtosis of chi-square with k degrees is 12 / k, so the standard
  // error of the variance is v sqrt((2 + 12 / k) / N).
  EXPECT_NEAR(found.variance, variance,
              5.0 * variance * std::sqrt((2.0 + 12.0 / (n - 1)) / kDraws));
}

INSTANTIATE_TEST_SUITE_P(Beams, NoiseOfBeams, ::testing::Values(1, 2, 5, 20));

// A sonar without noise over a flat floor 20 m below it.
ForwardSonarOptions Quiet() {
  ForwardSonarOptions options;
  options.beam_std_m = 0.0;
  options.sonar_cell_m = 10.0;
  return options;
}

const SonarMeasurement* FindAt(const std::vector<SonarMeasurement>& all,
                               double range_m, double bearing_deg) {
  for (const SonarMeasurement& one : all) {
    if (std::abs(one.range_m - range_m) < 1e-6 &&
        std::abs(one.bearing_rad * kDegreesPerRadian - bearing_deg) < 1e-6) {
      return &one;
    }
  }
  return nullptr;
}

TEST(MeasureForward, RangeAndBearingAreOfTheCellCentreInAllQuadrants) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 20.0; });
  Random random(1, RandomStream::kSonar);
  // At north 52, east 5: in the cells' row 5, whose centres lie 3 m north;
  // columns k have centres 10 k east of the vehicle. atan2(10, 3) = 73.3008
  // degrees, range sqrt(109).
  const double range_m = std::sqrt(109.0);
  const double away_deg = std::atan2(10.0, 3.0) * kDegreesPerRadian;
  struct Case {
    double course_deg;
    double east_cell_deg;  // Bearing of the cell 10 m east.
    double west_cell_deg;  // Of the one 10 m west.
  };
  for (const Case& expected : {
           // North: ahead on either side.
           Case{0.0, away_deg, -away_deg},
           // South: abaft, and the sides change. atan(y / x) without its
           // quadrant would put both ahead.
           Case{180.0, away_deg - 180.0, 180.0 - away_deg},
           // 10 degrees: all bearings fall by 10.
           Case{10.0, away_deg - 10.0, -away_deg - 10.0},
       }) {
    // On course 10 the swath leaves row 5 by 10 tan(10) = 1.8 m: still in it.
    const std::vector<SonarMeasurement> all =
        MeasureForward(*seabed, Quiet(),
                       {.north_m = 52.0,
                        .east_m = 5.0,
                        .course_rad = expected.course_deg * kRadiansPerDegree},
                       random);
    EXPECT_NE(FindAt(all, range_m, expected.east_cell_deg), nullptr)
        << expected.course_deg;
    EXPECT_NE(FindAt(all, range_m, expected.west_cell_deg), nullptr)
        << expected.course_deg;
  }
}

TEST(MeasureForward, GroupsTheBeamsOfACell) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 20.0; });
  Random random(1, RandomStream::kSonar);
  const std::vector<SonarMeasurement> all = MeasureForward(
      *seabed, Quiet(), {.north_m = 55.0, .east_m = 5.0}, random);
  int beams = 0;
  for (const SonarMeasurement& one : all) beams += one.beam_count;
  EXPECT_EQ(beams, 101);
  // Within 5 m of the track: |tan a| < 0.25, a < 14.036 degrees: 9 beams a
  // side and the middle one. The centre is the vehicle's own place.
  const SonarMeasurement* own = FindAt(all, 0.0, 0.0);
  ASSERT_NE(own, nullptr);
  EXPECT_EQ(own->beam_count, 19);
  EXPECT_DOUBLE_EQ(own->depth_m, 20.0);
  // 75 degrees reach 74.6 m: the cells whose centres are 0 to 70 m away, 15 in
  // all.
  EXPECT_EQ(all.size(), 15u);
}

TEST(MeasureForward, SmallerSonarCellsGiveMoreMeasurements) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 20.0; });
  Random random(1, RandomStream::kSonar);
  ForwardSonarOptions options = Quiet();
  options.sonar_cell_m = 1.0;  // Scale factor 10.
  const std::vector<SonarMeasurement> all = MeasureForward(
      *seabed, options, {.north_m = 55.5, .east_m = 5.5}, random);
  // Centres at whole metres from the vehicle.
  std::set<double> ranges;
  for (const SonarMeasurement& one : all) {
    EXPECT_NEAR(one.range_m, std::round(one.range_m), 1e-9);
    ranges.insert(std::round(one.range_m));
  }
  EXPECT_GT(all.size(), 60u);
  // 21 degrees and 22.5 degrees are 7.68 and 8.28 m out: both in cell 8.
  EXPECT_EQ(ranges.count(8.0), 1u);
}

TEST(MeasureForward, StatesTheDeviationOfTheMean) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 20.0; });
  Random random(1, RandomStream::kSonar);
  ForwardSonarOptions options;
  options.beam_std_m = kSigmaM;
  double normalised = 0.0;
  double lone = 0.0;
  int many_beams = 0;
  int one_beam = 0;
  for (int i = 0; i < 2000; ++i) {
    for (const SonarMeasurement& one : MeasureForward(
             *seabed, options, {.north_m = 55.0, .east_m = 5.0}, random)) {
      const double error_m = one.depth_m - 20.0;
      if (one.beam_count == 19) {
        ++many_beams;
        normalised += error_m * error_m / (one.std_m * one.std_m);
      } else if (one.beam_count == 1) {
        ++one_beam;
        lone += error_m * error_m;
        EXPECT_DOUBLE_EQ(one.std_m, kSigmaM);
      }
    }
  }
  ASSERT_EQ(many_beams, 2000);
  // (mean / (s / sqrt n))^2 is Student's t^2 with k = 18 degrees: its mean is
  // k / (k - 2) = 1.125; its variance 2 k^2 (k - 1) / ((k - 2)^2 (k - 4)) =
  // 3.07, so five standard errors are 0.20.
  EXPECT_NEAR(normalised / many_beams, 1.125, 0.20);
  if (one_beam > 0) {
    const double variance = kSigmaM * kSigmaM;
    EXPECT_NEAR(lone / one_beam, variance,
                5.0 * variance * std::sqrt(2.0 / one_beam));
  }
}

TEST(MeasureForward, NeverStatesLessThanItsResolution) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 20.0; });
  Random random(1, RandomStream::kSonar);
  ForwardSonarOptions options = Quiet();
  options.least_std_m = 0.05;
  for (const SonarMeasurement& one :
       MeasureForward(*seabed, options, {.north_m = 55.0}, random)) {
    EXPECT_DOUBLE_EQ(one.std_m, 0.05);
  }
}

TEST(ForwardSonar, RefusesBadOptions) {
  ForwardSonarOptions options;
  options.fan.beam_count = 100;
  EXPECT_THAT(ValidateForwardSonar(options),
              StatusIs(absl::StatusCode::kInvalidArgument));
  options = {};
  options.fan.spacing_deg = 1.8;  // 50 * 1.8 = 90 degrees.
  EXPECT_THAT(ValidateForwardSonar(options),
              StatusIs(absl::StatusCode::kInvalidArgument));
  options = {};
  options.sonar_cell_m = std::nan("");
  EXPECT_THAT(ValidateForwardSonar(options),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

}  // namespace
}  // namespace fathom::feeder
