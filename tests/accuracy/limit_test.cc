// A figure that is no number fails its limit, wherever it comes.

#include "tests/accuracy/limit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <limits>

#include "tests/testing/worse.h"

namespace fathom::accuracy {
namespace {

using testing::WorseOf;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

int Missed(std::initializer_list<double> offered) {
  Limit limit("figure", 1);
  for (const double value : offered) limit.Offer(value, "here");
  return limit.Report();
}

TEST(WorseOf, IsTheLargerAndNaNBeforeAll) {
  EXPECT_EQ(WorseOf(1, 2), 2);
  EXPECT_EQ(WorseOf(2, 1), 2);
  EXPECT_EQ(WorseOf(-3, -2), -2);
  for (const double other :
       {0.0, 1.0, std::numeric_limits<double>::infinity(), kNaN}) {
    EXPECT_TRUE(std::isnan(WorseOf(kNaN, other)));
    EXPECT_TRUE(std::isnan(WorseOf(other, kNaN)));
  }
}

TEST(Limit, HoldsTheWorstItWasOffered) {
  EXPECT_EQ(Missed({}), 0);
  EXPECT_EQ(Missed({-5}), 0);
  EXPECT_EQ(Missed({0.5, 1, 0.2}), 0);
  EXPECT_EQ(Missed({0.5, 1.5, 0.2}), 1);
}

TEST(Limit, IsMissedByANaN) {
  EXPECT_EQ(Missed({kNaN}), 1);
  EXPECT_EQ(Missed({0.5, kNaN}), 1);
  EXPECT_EQ(Missed({kNaN, 0.5}), 1);
  EXPECT_EQ(Missed({0.2, kNaN, 0.5}), 1);
}

}  // namespace
}  // namespace fathom::accuracy
