#include "map/query/disc_probability.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "tests/testing/contact_reference.h"

namespace fathom::map {
namespace {

using ::fathom::testing::DiscCase;
using ::fathom::testing::ManyChords;

const std::string kReference = FATHOM_SHARED_DATA_DIR "/reference";

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Eigen::Matrix2d Diagonal(double std_north_m, double std_east_m) {
  return Eigen::Vector2d(std_north_m * std_north_m, std_east_m * std_east_m)
      .asDiagonal();
}

TEST(NormalCdf, MatchesPublishedValues) {
  EXPECT_DOUBLE_EQ(NormalCdf(0), 0.5);
  // Abramowitz and Stegun, table 26.1.
  EXPECT_NEAR(NormalCdf(1), 0.841344746068543, 1e-15);
  EXPECT_NEAR(NormalCdf(-2), 0.022750131948179, 1e-15);
  EXPECT_NEAR(NormalCdf(-10) / 7.61985302416053e-24, 1, 1e-12);
  EXPECT_EQ(NormalCdf(-kInfinity), 0);
  EXPECT_EQ(NormalCdf(kInfinity), 1);
}

TEST(NormalInterval, KeepsItsPrecisionInBothTails) {
  // Phi(-10) - Phi(-11) = 7.61985302416053e-24 - 1.91065957449869e-28.
  const double expected = 7.61985302416053e-24 - 1.91065957449869e-28;
  EXPECT_NEAR(NormalInterval(10, 11) / expected, 1, 1e-12);
  EXPECT_NEAR(NormalInterval(-11, -10) / expected, 1, 1e-12);
  EXPECT_EQ(NormalInterval(1, 1), 0);
  EXPECT_EQ(NormalInterval(2, 1), 0);
  // A narrow interval is its width times the density: 1e-9 / sqrt(2 pi).
  EXPECT_NEAR(NormalInterval(0, 1e-9) / 3.98942280401433e-10, 1, 1e-12);
}

TEST(DiscProbability, OfACentredCircularNormalIsRayleighs) {
  // 1 - exp(-R^2 / 2 s^2).
  for (const double ratio : {1e-3, 0.1, 0.5, 1.0, 2.0, 5.0}) {
    EXPECT_NEAR(DiscProbability({0, 0}, Diagonal(50, 50), 50 * ratio) /
                    -std::expm1(-ratio * ratio / 2),
                1, 1e-7)
        << ratio;
  }
}

TEST(DiscProbability, MatchesThePublishedCases) {
  const auto cases = testing::PublishedDiscs(kReference);
  if (!std::filesystem::exists(kReference))
    GTEST_SKIP() << "no shared reference numbers";
  ASSERT_FALSE(cases.empty());
  EXPECT_EQ(cases.size(), 7u);
  for (const DiscCase& one : cases) {
    EXPECT_NEAR(DiscProbability(one.offset_m, one.covariance_m2, one.radius_m),
                one.printed, one.printed_within)
        << one.row;
    EXPECT_LE(testing::RelativeError(one), 1e-6) << one.row;
  }
}

TEST(DiscProbability, MatchesTheIsotropicCases) {
  const auto cases = testing::IsotropicDiscs(kReference);
  if (!std::filesystem::exists(kReference))
    GTEST_SKIP() << "no shared reference numbers";
  ASSERT_FALSE(cases.empty());
  EXPECT_EQ(cases.size(), 7u);
  for (const DiscCase& one : cases) {
    EXPECT_LE(testing::RelativeError(one), 1e-6) << one.row;
  }
}

// Each within 1e-6 of itself, and enough of them below 1e-9.
void ExpectKeepsItsRelativeError(const std::vector<DiscCase>& cases,
                                 std::size_t least, int least_small) {
  int small = 0;
  for (const DiscCase& one : cases) {
    if (one.probability < 1e-9) ++small;
    EXPECT_LE(testing::RelativeError(one), 1e-6)
        << one.row << ": " << one.offset_m.transpose() << " radius "
        << one.radius_m << "\n"
        << one.covariance_m2;
  }
  EXPECT_GT(cases.size(), least);
  EXPECT_GT(small, least_small);
}

TEST(DiscProbability, IsotropicKeepsItsRelativeErrorDownTo1eMinus12) {
  ExpectKeepsItsRelativeError(testing::SummedIsotropicDiscs(2000), 1000, 20);
}

TEST(DiscProbability, AnyEllipseKeepsItsRelativeErrorDownTo1eMinus12) {
  ExpectKeepsItsRelativeError(testing::SummedEllipticDiscs(500), 300, 10);
}

TEST(DiscProbability, SharpMeanAtTheEdgeOfAWideDisc) {
  // The dearest shape: sigma far below the radius, mean on the edge. Of a
  // straight edge half would lie inside; the disc's curve takes
  // s / (2 R) * phi(0) off: 0.5 - 0.001 / 2 * 0.398942 (+ O(s^2 / R^2)).
  EXPECT_NEAR(DiscProbability({1000, 0}, Diagonal(1, 1), 1000),
              0.5 - 0.0005 * 0.398942280401433, 1e-6);
  for (const double angle : {0.0, 0.4, 0.8, 1.2, 1.5707963}) {
    const double p = std::cos(angle);
    const double q = std::sin(angle);
    EXPECT_NEAR(DiscProbability({p, q}, Diagonal(0.005, 0.004), 1) /
                    ManyChords(p, q, 0.005, 0.004, 1),
                1, 1e-6)
        << angle;
  }
}

TEST(DiscProbability, GrowsWithTheRadius) {
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int i = 0; i < 300; ++i) {
    const double major = std::pow(10, 3 * unit(random));
    const Eigen::Matrix2d covariance =
        Diagonal(major, major * (0.02 + 0.98 * unit(random)));
    const Eigen::Vector2d offset(4 * major * unit(random),
                                 4 * major * unit(random));
    double before = 0;
    for (double radius = 0; radius < 10 * major; radius += 0.25 * major) {
      const double now = DiscProbability(offset, covariance, radius);
      // Either may err by 1e-6 of itself.
      EXPECT_GE(now, before * (1 - 2e-6));
      EXPECT_LE(now, 1);
      before = now;
    }
    EXPECT_GT(before, 0.99);
  }
}

TEST(DiscProbability, WithoutUncertaintyIsInsideOrOutside) {
  const Eigen::Matrix2d nothing = Eigen::Matrix2d::Zero();
  EXPECT_NEAR(DiscProbability({99, 0}, nothing, 100), 1, 1e-6);
  EXPECT_NEAR(DiscProbability({60, 79}, nothing, 100), 1, 1e-6);
  EXPECT_EQ(DiscProbability({101, 0}, nothing, 100), 0);
}

TEST(DiscProbability, NoRadiusIsNothingAndNaNIsNaN) {
  EXPECT_EQ(DiscProbability({0, 0}, Diagonal(1, 1), 0), 0);
  EXPECT_TRUE(
      std::isnan(DiscProbability({std::nan(""), 0}, Diagonal(1, 1), 1)));
  EXPECT_TRUE(std::isnan(DiscProbability({0, 0}, Diagonal(kInfinity, 1), 1)));
}

}  // namespace
}  // namespace fathom::map
