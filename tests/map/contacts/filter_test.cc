#include "map/contacts/filter.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "tests/testing/contact_reference.h"
#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

const std::string kReference = FATHOM_SHARED_DATA_DIR "/reference";

constexpr double kRadPerDeg = std::numbers::pi / 180.0;

// Both axes alike and independent, [p v] with the given covariance.
TrackState TwoAxes(double pp, double pv, double vv) {
  TrackState state;
  for (int axis = 0; axis < 2; ++axis) {
    state.P(axis, axis) = pp;
    state.P(axis, axis + 2) = state.P(axis + 2, axis) = pv;
    state.P(axis + 2, axis + 2) = vv;
  }
  return state;
}

PositionMeasurement At(double north_m, double east_m, double variance_m2) {
  return {.z = {north_m, east_m},
          .R = Eigen::Matrix2d::Identity() * variance_m2};
}

bool IsSymmetricPositiveDefinite(const Eigen::Matrix4d& P) {
  if (P != P.transpose()) return false;
  return Eigen::LLT<Eigen::Matrix4d>(P).info() == Eigen::Success;
}

TEST(Filter, NamesRoundTrip) {
  EXPECT_THAT(ParseFilter("per_axis"),
              testing::IsOkAndHolds(FilterKind::kPerAxis));
  EXPECT_THAT(ParseFilter("four_state"),
              testing::IsOkAndHolds(FilterKind::kFourState));
  EXPECT_EQ(FilterName(FilterKind::kPerAxis), "per_axis");
  EXPECT_EQ(FilterName(FilterKind::kFourState), "four_state");
  EXPECT_THAT(ParseFilter("ekf"),
              testing::StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST(Predict, MatchesTheSumByHand) {
  TrackState state = TwoAxes(4, 1, 2);
  state.x << 10, 20, 3, -1;
  const TrackState next = Predict(state, 2.0, 3.0);
  // p + T v: 10 + 2 * 3, 20 - 2 * 1.
  EXPECT_EQ(next.x, Eigen::Vector4d(16, 18, 3, -1));
  // pp + 2 T pv + T^2 vv + q T^3/3 = 4 + 4 + 8 + 8.
  EXPECT_DOUBLE_EQ(next.P(0, 0), 24);
  // pv + T vv + q T^2/2 = 1 + 4 + 6.
  EXPECT_DOUBLE_EQ(next.P(0, 2), 11);
  // vv + q T = 2 + 6.
  EXPECT_DOUBLE_EQ(next.P(2, 2), 8);
  EXPECT_EQ(next.P(0, 1), 0);
  EXPECT_EQ(next.P(0, 3), 0);
}

TEST(Predict, TwoSpansAreTheirSum) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int i = 0; i < 1000; ++i) {
    Eigen::Matrix4d root;
    TrackState state;
    for (int k = 0; k < 16; ++k) root(k / 4, k % 4) = 10 * unit(random);
    for (int k = 0; k < 4; ++k) state.x(k) = 100 * unit(random);
    state.P = root * root.transpose();
    state.P = (0.5 * (state.P + state.P.transpose())).eval();
    const double t1 = 300 * std::fabs(unit(random));
    const double t2 = 300 * std::fabs(unit(random));
    const double q = 0.02 * std::fabs(unit(random));
    const TrackState once = Predict(state, t1 + t2, q);
    const TrackState twice = Predict(Predict(state, t1, q), t2, q);
    EXPECT_LT((once.x - twice.x).norm(), 1e-12 * (1 + once.x.norm()));
    EXPECT_LT((once.P - twice.P).norm(), 1e-12 * once.P.norm());
  }
}

TEST(Predict, BackwardsIsNoSurerThanForwards) {
  TrackState state = TwoAxes(4, 0, 2);
  state.x << 10, 20, 3, -1;
  const TrackState back = Predict(state, -2.0, 3.0);
  EXPECT_EQ(back.x, Eigen::Vector4d(4, 22, 3, -1));
  // 4 + 2^2 * 2 + 3 * 2^3 / 3 = 20, the same as forwards without pv.
  EXPECT_DOUBLE_EQ(back.P(0, 0), 20);
  EXPECT_TRUE(IsSymmetricPositiveDefinite(back.P));
}

TEST(Convert, MatchesEveryReferenceRow) {
  for (const FilterKind kind : {FilterKind::kFourState, FilterKind::kPerAxis}) {
    const auto errors = testing::ConversionErrors(kReference, kind);
    if (!std::filesystem::exists(kReference))
      GTEST_SKIP() << "no shared reference numbers";
    ASSERT_FALSE(errors.empty());
    EXPECT_EQ(errors.size(), 7u);
    for (const auto& [row, error] : errors) EXPECT_LE(error, 1e-9) << row;
  }
}

TEST(ConvertUnbiased, MatchesTheFormulaByHand) {
  // r = 100, a = 0, sr = 2, sa = 0.5: s = 0.25, e^-s = 0.778800783071405,
  // e^-2s = 0.606530659712633, e^(-s/2) = 0.882496902584595.
  const PositionMeasurement got = ConvertUnbiased({.range_m = 100,
                                                   .azimuth_rad = 0,
                                                   .range_std_m = 2,
                                                   .azimuth_std_rad = 0.5});
  EXPECT_NEAR(got.z(0), 88.2496902584595, 1e-10);
  EXPECT_EQ(got.z(1), 0);
  // 10004 * 1.606530659712633 / 2 - 10000 * 0.778800783071405.
  EXPECT_NEAR(got.R(0, 0), 247.858529168542, 1e-8);
  // 10004 * (1 - 0.606530659712633) / 2.
  EXPECT_NEAR(got.R(1, 1), 1968.13364011741, 1e-8);
  EXPECT_NEAR(got.R(0, 1), 0, 1e-10);
}

TEST(Update, PerAxisMatchesTheSumByHand) {
  const TrackState prior = TwoAxes(4, 1, 2);
  const UpdatedState got = Update(FilterKind::kPerAxis, prior, At(2, -4, 4));
  // s = 4 + 4; k = [4/8, 1/8]; x = k z.
  EXPECT_EQ(got.state.x, Eigen::Vector4d(1, -2, 0.25, -0.5));
  EXPECT_DOUBLE_EQ(got.state.P(0, 0), 2);      // (1 - 0.5) 4
  EXPECT_DOUBLE_EQ(got.state.P(0, 2), 0.5);    // (1 - 0.5) 1
  EXPECT_DOUBLE_EQ(got.state.P(2, 2), 1.875);  // 2 - 1/8
  EXPECT_DOUBLE_EQ(got.nis, 2 * 2 / 8. + 4 * 4 / 8.);
}

TEST(Update, PreciseMeasurementKeepsTheCovariancePositive) {
  // Eq. 5.13 as printed, with S_z^-1: 100 - 100 * 100 / 1 = -9900. With
  // (C P C' + S_z)^-1: 100 - 100 * 100 / 101 = 100/101.
  const TrackState prior = TwoAxes(100, 0, 1);
  for (const FilterKind kind : {FilterKind::kPerAxis, FilterKind::kFourState}) {
    const UpdatedState got = Update(kind, prior, At(0, 0, 1));
    EXPECT_NEAR(got.state.P(0, 0), 100.0 / 101.0, 1e-13);
  }
}

TEST(Update, FollowsATargetWithoutLag) {
  // Eq. 5.12 as printed weighs y_(k+1) against C x_k: on exact measurements
  // of a steady target it would lag. The filter must meet it exactly.
  for (const FilterKind kind : {FilterKind::kPerAxis, FilterKind::kFourState}) {
    TrackState state = FirstState(At(0, 0, 1), 10);
    for (int k = 1; k <= 200; ++k) {
      state =
          Update(kind, Predict(state, 10, 0), At(50.0 * k, -30.0 * k, 1)).state;
    }
    // The prior, v = 0 +- 10, is worth 1e-2 against sum(t^2) = 2.7e8.
    EXPECT_NEAR(state.x(0), 10'000, 1e-4);
    EXPECT_NEAR(state.x(2), 5, 1e-6);
    EXPECT_NEAR(state.x(3), -3, 1e-6);
  }
}

TEST(Update, BothFiltersAgreeWhenTheAxesAreIndependent) {
  TrackState a = FirstState(At(10, -20, 25), 8);
  TrackState b = a;
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0, 5);
  for (int k = 0; k < 100; ++k) {
    const PositionMeasurement seen = At(noise(random), noise(random), 25);
    a = Update(FilterKind::kPerAxis, Predict(a, 3, 0.01), seen).state;
    b = Update(FilterKind::kFourState, Predict(b, 3, 0.01), seen).state;
    EXPECT_LT((a.x - b.x).norm(), 1e-9);
    EXPECT_LT((a.P - b.P).norm(), 1e-9);
  }
}

TEST(Update, MatchesTheReferenceStep) {
  const auto errors = testing::KalmanStepErrors(kReference);
  if (!std::filesystem::exists(kReference))
    GTEST_SKIP() << "no shared reference numbers";
  ASSERT_FALSE(errors.empty());
  for (const auto& [row, error] : errors) EXPECT_LE(error, 1e-6) << row;
  EXPECT_LE(errors.front().error, 1e-12);  // Process noise.
  EXPECT_LE(errors.back().error, 1e-9);    // NIS.
}

TEST(Update, ReachesTheSteadyStateOfTheReference) {
  for (const FilterKind kind : {FilterKind::kPerAxis, FilterKind::kFourState}) {
    const auto errors = testing::SteadyStateErrors(kReference, kind);
    if (!std::filesystem::exists(kReference))
      GTEST_SKIP() << "no shared reference numbers";
    ASSERT_FALSE(errors.empty());
    EXPECT_EQ(errors.size(), 4u);
    for (const auto& [row, error] : errors) EXPECT_LE(error, 1e-6) << row;
  }
}

TEST(Update, CovarianceStaysPositiveDefiniteOverRandomSteps) {
  for (const FilterKind kind : {FilterKind::kPerAxis, FilterKind::kFourState}) {
    std::mt19937_64 random(11);
    std::uniform_real_distribution<double> unit(0, 1);
    TrackState state = FirstState(At(0, 0, 100), 10);
    for (int k = 0; k < 10'000; ++k) {
      // 1 ms to 17 minutes; ranges to 30 km; 0.5 m to 500 m; to 10 degrees.
      const double dt_s = std::pow(10, -3 + 6 * unit(random));
      const double q = std::pow(10, -5 + 4 * unit(random));
      const PolarMeasurement polar{
          .range_m = 30'000 * unit(random) + 1,
          .azimuth_rad = 6.3 * unit(random),
          .range_std_m = std::pow(10, -0.3 + 3 * unit(random)),
          .azimuth_std_rad = 10 * kRadPerDeg * unit(random) + 1e-5};
      state = Update(kind, Predict(state, dt_s, q),
                     kind == FilterKind::kPerAxis ? ConvertPlain(polar)
                                                  : ConvertUnbiased(polar))
                  .state;
      ASSERT_TRUE(state.x.allFinite()) << k;
      ASSERT_TRUE(IsSymmetricPositiveDefinite(state.P)) << k << "\n" << state.P;
    }
  }
}

// A ship of the model itself, heard from a fixed place: the mean of
// (x - truth)' P^-1 (x - truth) over 200 runs, 4 states, must lie in the 95 %
// interval [3.6176, 4.4014] of chi^2(800)/200 (nrl_reference_octave.txt,
// "0.95,4,200").
TEST(Update, ErrorsAreThoseThatTheCovarianceClaims) {
  std::mt19937_64 random(2002);
  std::normal_distribution<double> normal;
  constexpr double kT = 10;
  constexpr double kQ = 2e-3;
  constexpr double kVelocityStd = 5;
  double nees = 0;
  for (int run = 0; run < 200; ++run) {
    Eigen::Vector4d truth(4000, 3000, kVelocityStd * normal(random),
                          kVelocityStd * normal(random));
    TrackState state;
    for (int k = 0; k <= 30; ++k) {
      if (k > 0) {
        for (int axis = 0; axis < 2; ++axis) {
          // Cholesky's factor of q [T^3/3 T^2/2; T^2/2 T].
          const double a = normal(random);
          const double b = normal(random);
          const double pp = std::sqrt(kQ * kT * kT * kT / 3);
          const double vp = kQ * kT * kT / 2 / pp;
          truth(axis) += kT * truth(axis + 2) + pp * a;
          truth(axis + 2) += vp * a + std::sqrt(kQ * kT - vp * vp) * b;
        }
      }
      constexpr double kRangeStd = 20;
      constexpr double kAzimuthStd = 1 * kRadPerDeg;
      const PositionMeasurement seen =
          ConvertUnbiased({.range_m = std::hypot(truth(0), truth(1)) +
                                      kRangeStd * normal(random),
                           .azimuth_rad = std::atan2(truth(1), truth(0)) +
                                          kAzimuthStd * normal(random),
                           .range_std_m = kRangeStd,
                           .azimuth_std_rad = kAzimuthStd});
      state = k == 0
                  ? FirstState(seen, kVelocityStd)
                  : Update(FilterKind::kFourState, Predict(state, kT, kQ), seen)
                        .state;
    }
    const Eigen::Vector4d error = state.x - truth;
    nees += error.dot(state.P.inverse() * error) / 200;
  }
  EXPECT_GT(nees, 3.6176);
  EXPECT_LT(nees, 4.4014);
}

TEST(ConvertAbout, MatchesTheSumByHand) {
  // r = 1000 m, 10 m sure, at 30 degrees, 0.2 rad sure, known to be at
  // (900, 450) with P = diag(100, 400). s = 0.04, e^(s/2) = 1.0202013400.
  // M = [810100 405000; 405000 202900], tr M = 1013000, g = 100 / 1013000.
  // sinh(0.02)^2 = 4.0005334e-4; cosh(0.04) = 1.0008001067; sinh(0.04) =
  // 0.0400106675. c = 2 * 4.0005334e-4 + 1.0008001067 g = 8.9890235e-4;
  // d = 0.0400106675 (1 + g) = 0.0400146172.
  const PositionMeasurement seen = ConvertAbout(
      {.range_m = 1000,
       .azimuth_rad = 30 * kRadPerDeg,
       .range_std_m = 10,
       .azimuth_std_rad = 0.2},
      {.z = {900, 450}, .R = (Eigen::Matrix2d() << 100, 0, 0, 400).finished()});
  EXPECT_NEAR(seen.z(0), 1020.2013400 * std::cos(30 * kRadPerDeg), 1e-6);
  EXPECT_NEAR(seen.z(1), 1020.2013400 * 0.5, 1e-6);
  const double c = 8.9890235e-4;
  const double d = 0.0400146172;
  EXPECT_NEAR(seen.R(0, 0), c * 810100 + d * 202900, 1e-2);
  EXPECT_NEAR(seen.R(1, 1), c * 202900 + d * 810100, 1e-2);
  EXPECT_NEAR(seen.R(0, 1), (c - d) * 405000, 1e-2);
  EXPECT_EQ(seen.R(0, 1), seen.R(1, 0));
}

TEST(ConvertAbout, WithoutAKnownDirectionIsTheUnbiasedConversion) {
  const PolarMeasurement polar{.range_m = 300,
                               .azimuth_rad = 1,
                               .range_std_m = 10,
                               .azimuth_std_rad = 0.1};
  // sqrt(2 * 180^2) = 255 m is more than half of 400 m.
  const PositionMeasurement seen =
      ConvertAbout(polar, At(0, 400, 180.0 * 180.0));
  const PositionMeasurement plain = ConvertUnbiased(polar);
  EXPECT_EQ(seen.z, plain.z);
  EXPECT_EQ(seen.R, plain.R);
}

TEST(ConvertAbout, ItsNoiseIsThatOfTheMeasurement) {
  // 400 000 draws of a place and its measurement: mean of z - place is 0 and
  // its second moment R, within 1 % (the draws leave 0.3 %).
  std::mt19937_64 random(21);
  std::normal_distribution<double> normal;
  const PositionMeasurement known{
      .z = {1500, -2500},
      .R = (Eigen::Matrix2d() << 90'000, 20'000, 20'000, 60'000).finished()};
  const Eigen::Matrix2d root = known.R.llt().matrixL();
  constexpr int kDraws = 400'000;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
  PositionMeasurement seen;
  for (int i = 0; i < kDraws; ++i) {
    const Eigen::Vector2d place =
        known.z + root * Eigen::Vector2d(normal(random), normal(random));
    seen = ConvertAbout({.range_m = place.norm() + 40 * normal(random),
                         .azimuth_rad = std::atan2(place.y(), place.x()) +
                                        0.17 * normal(random),
                         .range_std_m = 40,
                         .azimuth_std_rad = 0.17},
                        known);
    const Eigen::Vector2d noise = seen.z - place;
    mean += noise / kDraws;
    second += noise * noise.transpose() / kDraws;
  }
  EXPECT_LT(mean.norm(), 4 * std::sqrt(seen.R.trace() / kDraws));
  EXPECT_LT((second - seen.R).norm(), 0.01 * seen.R.norm());
}

TEST(PolarNis, IsTheSumOfSquaresInRangeAndBearing) {
  // Known to be due north at 2000 m, 30 m along the ray and 40 m across; S of
  // range 30^2 + 40^2 = 50^2, of azimuth (40 / 2000)^2 + 0.015^2 = 0.025^2:
  // 100 m and 0.05 rad off are 2 sigma each.
  const PositionMeasurement known{
      .z = {2000, 0}, .R = (Eigen::Matrix2d() << 900, 0, 0, 1600).finished()};
  EXPECT_NEAR(PolarNis({.range_m = 2100,
                        .azimuth_rad = 0.05 - 2 * std::numbers::pi,
                        .range_std_m = 40,
                        .azimuth_std_rad = 0.015},
                       known),
              8, 1e-9);
}

TEST(Fuse, WeighsEachByTheOthersVariance) {
  // 1 and 3: a quarter of the way, variance 1 * 3 / (1 + 3); velocities of 4
  // and 4 in the middle.
  TrackState a;
  a.x << 10, 0, 2, 0;
  a.P.diagonal() << 1, 1, 4, 4;
  TrackState b;
  b.x << 14, 0, 4, 0;
  b.P.diagonal() << 3, 3, 4, 4;
  const TrackState fused = Fuse(a, b);
  EXPECT_LT((fused.x - Eigen::Vector4d(11, 0, 3, 0)).norm(), 1e-12);
  EXPECT_LT((fused.P.diagonal() - Eigen::Vector4d(0.75, 0.75, 2, 2)).norm(),
            1e-12);
  // The order does not matter, nor what lies between the axes.
  a.P(0, 1) = a.P(1, 0) = 0.5;
  b.P(0, 2) = b.P(2, 0) = -1;
  const TrackState one = Fuse(a, b);
  const TrackState other = Fuse(b, a);
  EXPECT_LT((one.x - other.x).norm(), 1e-12);
  EXPECT_LT((one.P - other.P).norm(), 1e-12);
  const Eigen::Matrix4d P = (a.P.inverse() + b.P.inverse()).inverse();
  EXPECT_LT((one.P - P).norm(), 1e-12);
}

}  // namespace
}  // namespace fathom::map
