#include "sim_feeder/score.h"

#include <gtest/gtest.h>

#include <cmath>

namespace fathom::feeder {
namespace {

TEST(DepthScore, IsWhatTheSumsSay) {
  DepthScore score;
  score.Add(11.0, 1.0, 10.0);  // +1: one std.
  score.Add(8.0, 1.0, 10.0);   // -2: two std.
  score.Add(15.0, 1.0, 10.0);  // +5: five std.
  EXPECT_EQ(score.count(), 3u);
  EXPECT_NEAR(score.RmseM(), std::sqrt((1.0 + 4.0 + 25.0) / 3.0), 1e-12);
  EXPECT_NEAR(score.BiasM(), (1.0 - 2.0 + 5.0) / 3.0, 1e-12);
  EXPECT_NEAR(score.ShareWithin(1), 1.0 / 3.0, 1e-12);
  EXPECT_NEAR(score.ShareWithin(2), 2.0 / 3.0, 1e-12);
  EXPECT_NEAR(score.ShareWithin(3), 2.0 / 3.0, 1e-12);
  EXPECT_NEAR(score.MeanNees(), 10.0, 1e-12);
}

TEST(ReliabilityScore, IsWhatTheSumsSay) {
  ReliabilityScore score;
  score.Add(0.82, true);   // 0.0324
  score.Add(0.88, false);  // 0.7744
  score.Add(0.0, false);   // 0
  score.Add(1.0, true);    // 0, in the last bin
  EXPECT_NEAR(score.Brier(), (0.0324 + 0.7744) / 4.0, 1e-12);
  EXPECT_EQ(score.bins()[8].count, 2u);
  EXPECT_NEAR(score.bins()[8].MeanStated(), 0.85, 1e-12);
  EXPECT_NEAR(score.bins()[8].Frequency(), 0.5, 1e-12);
  EXPECT_EQ(score.bins()[9].count, 1u);
  EXPECT_EQ(score.bins()[0].count, 1u);
  // (2 |0.85 - 0.5| + 0 + 0) / 4.
  EXPECT_NEAR(score.CalibrationError(), 0.175, 1e-12);
}

TEST(PositionNees, IsTheQuadraticFormOfTheInverse) {
  // P = [4 0; 0 9], e = (2, 3): 4/4 + 9/9 = 2.
  EXPECT_NEAR(PositionNees(2.0, 3.0, {.nn = 4.0, .ne = 0.0, .ee = 9.0}), 2.0,
              1e-12);
  // P = [2 1; 1 2], P^-1 = [2 -1; -1 2] / 3, e = (1, -1): (2 + 2 + 2) / 3 = 2.
  EXPECT_NEAR(PositionNees(1.0, -1.0, {.nn = 2.0, .ne = 1.0, .ee = 2.0}), 2.0,
              1e-12);
  EXPECT_TRUE(
      std::isinf(PositionNees(1.0, 1.0, {.nn = 1.0, .ne = 1.0, .ee = 1.0})));
}

TEST(ContactScore, CountsWhatLiesInsideTheEllipse) {
  ContactScore score;
  score.Add(3.0, 4.0, {.nn = 25.0, .ne = 0.0, .ee = 25.0});    // NEES 1.
  score.Add(30.0, 40.0, {.nn = 25.0, .ne = 0.0, .ee = 25.0});  // NEES 100.
  EXPECT_NEAR(score.RmseM(), std::sqrt((25.0 + 2500.0) / 2.0), 1e-12);
  EXPECT_NEAR(score.MeanNees(), 50.5, 1e-12);
  EXPECT_NEAR(score.ShareWithin95(), 0.5, 1e-12);
}

}  // namespace
}  // namespace fathom::feeder
