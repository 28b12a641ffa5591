// The mean of the posterior against sums over a grid, where there are few
// enough unknowns for that.

#include "tests/accuracy/contact_optimum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <variant>
#include <vector>

namespace fathom::accuracy {
namespace {

// So sure of its velocity, and so little disturbed, that the place at the last
// report is all that is not known.
Encounter Straight() {
  return {.contact = {800, 600, 2, -1},
          .velocity_std_m_s = 1e-3,
          .process_noise_m2_s3 = 1e-9,
          .vehicle_m_s = {1.5, -1.0},
          .range_std_m = 20,
          .bearing_std_deg = 10,
          .step_s = 10,
          .reports = 4};
}

// E[place at the last report | all], by a grid of 2 m over 1.2 km.
Eigen::Vector2d MeanByGrid(const Encounter& encounter,
                           const std::vector<Moment>& moments) {
  const double to_rad = std::numbers::pi / 180;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weights = 0;
  for (double n = -600; n <= 600; n += 2) {
    for (double e = -600; e <= 600; e += 2) {
      const Eigen::Vector2d last =
          moments.back().truth.head<2>() + Eigen::Vector2d(n, e);
      double twice = 0;
      for (const Moment& moment : moments) {
        const auto& heard =
            std::get<map::RangeBearing>(moment.report.observation);
        const Eigen::Vector2d away =
            last +
            (moment.at_s - moments.back().at_s) * encounter.contact.tail<2>() -
            moment.vehicle;
        const double range =
            (heard.range_m - away.norm()) / encounter.range_std_m;
        const double bearing =
            std::remainder(
                heard.bearing_deg * to_rad - std::atan2(away.y(), away.x()),
                2 * std::numbers::pi) /
            (encounter.bearing_std_deg * to_rad);
        twice += range * range + bearing * bearing;
      }
      const double weight = std::exp(-twice / 2);
      sum += weight * last;
      weights += weight;
    }
  }
  return sum / weights;
}

TEST(MeanOfPosterior, IsThatOfAGrid) {
  const Encounter encounter = Straight();
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const std::vector<Moment> moments = accuracy::Run(encounter, seed);
    const PosteriorMean mean =
        MeanOfPosterior(encounter, moments, 200'000, seed);
    // A banana 90 m long to each side (1 sigma) and 10 m wide.
    EXPECT_GT(mean.effective_samples, 20'000) << seed;
    const Eigen::Vector2d by_grid = MeanByGrid(encounter, moments);
    EXPECT_LT((mean.x.head<2>() - by_grid).norm(), 1.0) << seed;
  }
}

TEST(MeanOfPosterior, IsTheTruthWithoutNoise) {
  Encounter encounter = Straight();
  encounter.velocity_std_m_s = 5;
  encounter.range_std_m = 1e-3;
  encounter.bearing_std_deg = 1e-4;
  const std::vector<Moment> moments = accuracy::Run(encounter, 1);
  const PosteriorMean mean = MeanOfPosterior(encounter, moments, 1000, 1);
  EXPECT_LT((mean.x - moments.back().truth).head<2>().norm(), 0.05);
  EXPECT_LT((mean.x - moments.back().truth).tail<2>().norm(), 0.01);
}

}  // namespace
}  // namespace fathom::accuracy
