#include "map/query/tabulated_normal.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "map/query/disc_probability.h"

namespace fathom::map {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(TabulatedNormalCdf, MatchesPublishedValues) {
  EXPECT_EQ(TabulatedNormalCdf(0), 0.5);
  // Abramowitz and Stegun, table 26.1.
  EXPECT_NEAR(TabulatedNormalCdf(1), 0.841344746068543, 1e-15);
  EXPECT_NEAR(TabulatedNormalCdf(-1.99), 0.023295467750212, 1e-14);
  EXPECT_NEAR(TabulatedNormalCdf(-2.33), 0.009903075559164, 1e-14);
  EXPECT_EQ(TabulatedNormalCdf(-kInfinity), 0);
  EXPECT_EQ(TabulatedNormalCdf(kInfinity), 1);
  EXPECT_TRUE(
      std::isnan(TabulatedNormalCdf(std::numeric_limits<double>::quiet_NaN())));
}

// Steps that fall everywhere between the tabulated places, both sides of +-8.
TEST(TabulatedNormalCdf, IsNormalCdfToTenDigits) {
  double last = 0;
  for (double x = -9; x < 9; x += 0.00137) {
    const double exact = NormalCdf(x);
    const double got = TabulatedNormalCdf(x);
    ASSERT_NEAR(got / exact, 1.0, 1e-10) << x;
    ASSERT_GE(got, last - 2e-16) << x;  // Rounding, near 1.
    last = got;
  }
}

}  // namespace
}  // namespace fathom::map
