#include "sim_feeder/random.h"

#include <gtest/gtest.h>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <functional>
#include <vector>

namespace fathom::feeder {
namespace {

constexpr int kDraws = 100'000;
constexpr int kBins = 50;

// Pearson's statistic of `draws` over kBins bins that are equally probable
// under `cdf`: chi-square of kBins - 1 degrees of freedom if the draws follow
// it.
double PearsonStatistic(const std::function<double()>& draw,
                        const std::function<double(double)>& cdf) {
  std::vector<int> counts(kBins, 0);
  for (int i = 0; i < kDraws; ++i) {
    const int bin = static_cast<int>(cdf(draw()) * kBins);
    ++counts[static_cast<std::size_t>(std::min(bin, kBins - 1))];
  }
  const double expected = static_cast<double>(kDraws) / kBins;
  double statistic = 0.0;
  for (const int count : counts) {
    statistic += (count - expected) * (count - expected) / expected;
  }
  return statistic;
}

// The 99.9 % point of chi-square with 49 degrees of freedom.
const double kBound =
    boost::math::quantile(boost::math::chi_squared(kBins - 1), 0.999);

TEST(Random, NormalDrawsFollowTheNormalDistribution) {
  Random random(7, RandomStream::kSonar);
  const boost::math::normal normal;
  EXPECT_LT(
      PearsonStatistic([&] { return random.Normal(); },
                       [&](double x) { return boost::math::cdf(normal, x); }),
      kBound);
}

class ChiSquareFit : public ::testing::TestWithParam<int> {};

TEST_P(ChiSquareFit, DrawsFollowTheChiSquareDistribution) {
  const int freedom = GetParam();
  Random random(11, RandomStream::kSonar);
  const boost::math::chi_squared distribution(freedom);
  EXPECT_LT(PearsonStatistic(
                [&] { return random.ChiSquare(freedom); },
                [&](double x) { return boost::math::cdf(distribution, x); }),
            kBound);
}

// n - 1 for n = 2, 5, 20 beams, and a shape below 1 (1 / 2) with the first.
INSTANTIATE_TEST_SUITE_P(Beams, ChiSquareFit, ::testing::Values(1, 4, 19));

TEST(Random, TheFitWouldSeeAWrongDistribution) {
  // Chi-square of 4 judged as one of 5: the test above is able to fail.
  Random random(11, RandomStream::kSonar);
  const boost::math::chi_squared wrong(5);
  EXPECT_GT(
      PearsonStatistic([&] { return random.ChiSquare(4); },
                       [&](double x) { return boost::math::cdf(wrong, x); }),
      10.0 * kBound);
}

TEST(Random, UniformStaysInItsInterval) {
  Random random(3, RandomStream::kShips);
  for (int i = 0; i < kDraws; ++i) {
    const double x = random.Uniform(-2.0, 5.0);
    ASSERT_GE(x, -2.0);
    ASSERT_LT(x, 5.0);
  }
}

TEST(Random, SameSeedSameNumbersOtherStreamOtherNumbers) {
  Random a(1, RandomStream::kSonar);
  Random b(1, RandomStream::kSonar);
  Random other_stream(1, RandomStream::kShips);
  Random other_seed(2, RandomStream::kSonar);
  const double first = a.Uniform();
  EXPECT_EQ(first, b.Uniform());
  EXPECT_NE(first, other_stream.Uniform());
  EXPECT_NE(first, other_seed.Uniform());
}

}  // namespace
}  // namespace fathom::feeder
