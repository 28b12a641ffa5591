#include "map/query/disc_probability.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "tests/testing/shared_numbers.h"

namespace fathom::map {
namespace {

using ::fathom::testing::LinesOf;
using ::fathom::testing::NumbersIn;

const std::string kReference = FATHOM_SHARED_DATA_DIR "/reference/";

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Eigen::Matrix2d Diagonal(double std_north_m, double std_east_m) {
  return Eigen::Vector2d(std_north_m * std_north_m, std_east_m * std_east_m)
      .asDiagonal();
}

// The isotropic case as a series of positive terms (noncentral chi-square):
// sum over k of Poisson(k; d^2 / 2 s^2) P(Poisson(R^2 / 2 s^2) > k). It loses
// nothing in the tail and shares nothing with the code under test.
double IsotropicSeries(double d, double s, double radius) {
  const long double lambda = static_cast<long double>(d / s) * (d / s) / 2;
  const long double y = static_cast<long double>(radius / s) * (radius / s) / 2;
  long double sum = 0;
  for (int k = 0; k < 4000; ++k) {
    const long double weight =
        expl(-lambda + (k == 0 ? 0 : k * logl(lambda)) - lgammal(k + 1.0L));
    if (lambda == 0 && k > 0) break;
    // e^-y sum over j > k of y^j / j!.
    long double term = expl(-y + (k + 1) * logl(y) - lgammal(k + 2.0L));
    long double tail = 0;
    for (int j = k + 1; term > tail * 1e-20L || j < y; ++j) {
      tail += term;
      term *= y / (j + 1);
      if (term == 0 && j > y) break;
    }
    sum += weight * tail;
    if (k > lambda && weight * tail < sum * 1e-16L) break;
  }
  return static_cast<double>(sum);
}

// Any case, by thousands of chords across the *major* axis in long double; the
// code under test takes few, along the minor one. p along the major axis.
double ManyChords(double p, double q, double major, double minor,
                  double radius) {
  const auto cdf = [](long double x) { return 0.5L * erfcl(-x / sqrtl(2.0L)); };
  // Enough to resolve the minor axis anywhere on the disc.
  const int chords = 2000 + static_cast<int>(40 * radius / minor);
  const long double step = std::numbers::pi_v<long double> / chords;
  long double sum = 0;
  for (int i = 0; i < chords; ++i) {
    const long double t =
        -std::numbers::pi_v<long double> / 2 + (i + 0.5L) * step;
    const long double along = (radius * sinl(t) - p) / major;
    const long double chord = radius * cosl(t);
    long double low = (q - chord) / minor;
    long double high = (q + chord) / minor;
    if (low + high > 0) {
      const long double flipped = -low;
      low = -high;
      high = flipped;
    }
    sum += expl(-along * along / 2) * chord * (cdf(high) - cdf(low));
  }
  return static_cast<double>(
      sum * step / (major * sqrtl(2 * std::numbers::pi_v<long double>)));
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
  const auto lines = LinesOf(kReference + "disc_probability_published.csv");
  if (lines.empty()) GTEST_SKIP() << "no shared reference numbers";
  int rows = 0;
  for (const std::string& line : lines) {
    const std::size_t comma = line.find(',');
    if (!line.starts_with("Chan")) continue;
    ++rows;
    // xm ym sigmaX sigmaY radius expected_P test_tol quadrature_P.
    const std::vector<double> n = NumbersIn(line.substr(comma));
    const double got =
        DiscProbability({n[0], n[1]}, Diagonal(n[2], n[3]), n[4]);
    EXPECT_NEAR(got, n[5], n[6]) << line;
    EXPECT_NEAR(got / n[7], 1, 1e-6) << line;
  }
  EXPECT_EQ(rows, 7);
}

TEST(DiscProbability, MatchesTheIsotropicCases) {
  const auto lines = LinesOf(kReference + "isotropic_disk_probability.csv");
  if (lines.empty()) GTEST_SKIP() << "no shared reference numbers";
  int rows = 0;
  for (const std::string& line : lines) {
    if (line.starts_with("d_m")) continue;
    ++rows;
    const std::vector<double> n = NumbersIn(line);  // d sigma radius P
    EXPECT_NEAR(DiscProbability({n[0], 0}, Diagonal(n[1], n[1]), n[2]) / n[3],
                1, 1e-6)
        << line;
  }
  EXPECT_EQ(rows, 7);
}

TEST(DiscProbability, IsotropicKeepsItsRelativeErrorDownTo1eMinus12) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(0, 1);
  int small = 0;
  for (int i = 0; i < 2000; ++i) {
    const double s = 10;
    const double radius = s * std::pow(10, -2 + 3.3 * unit(random));
    const double d = std::max(0.0, radius + s * (11 * unit(random) - 3));
    const double expected = IsotropicSeries(d, s, radius);
    if (expected < 1e-12) continue;
    if (expected < 1e-9) ++small;
    const double angle = 7 * unit(random);
    const double got = DiscProbability(
        {d * std::cos(angle), d * std::sin(angle)}, Diagonal(s, s), radius);
    EXPECT_NEAR(got / expected, 1, 1e-6) << d << " " << radius;
  }
  EXPECT_GT(small, 20);
}

TEST(DiscProbability, AnyEllipseKeepsItsRelativeErrorDownTo1eMinus12) {
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> unit(0, 1);
  int counted = 0;
  int small = 0;
  for (int i = 0; i < 500; ++i) {
    const double radius = std::pow(10, 3 * unit(random));
    const double major = radius * std::pow(10, -1.5 + 4 * unit(random));
    const double minor = major * std::pow(10, -2 * unit(random) * unit(random));
    const double turn = 7 * unit(random);
    const double out = 7 * unit(random);
    const double at = 7 * unit(random);
    const double p = std::cos(at) * (out * major + radius * unit(random));
    const double q = std::sin(at) * (out * minor + radius * unit(random));
    const double expected = ManyChords(p, q, major, minor, radius);
    if (expected < 1e-12) continue;
    ++counted;
    if (expected < 1e-9) ++small;
    Eigen::Matrix2d axes;
    axes << std::cos(turn), -std::sin(turn), std::sin(turn), std::cos(turn);
    const double got = DiscProbability(
        axes * Eigen::Vector2d(p, q),
        axes * Diagonal(major, minor) * axes.transpose(), radius);
    EXPECT_NEAR(got / expected, 1, 1e-6)
        << p << " " << q << " " << major << " " << minor << " " << radius;
  }
  EXPECT_GT(counted, 300);
  EXPECT_GT(small, 10);
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
