#include "sim_feeder/relief.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace fathom::feeder {
namespace {

// Von Karman covariance over std^2 (relief.h).
double VonKarman(double lag_over_length, double hurst) {
  if (lag_over_length == 0.0) return 1.0;
  return std::pow(2.0, 1.0 - hurst) / std::tgamma(hurst) *
         std::pow(lag_over_length, hurst) *
         std::cyl_bessel_k(hurst, lag_over_length);
}

TEST(Relief, HasTheStatedDeviationAndCorrelation) {
  // Average over many drawings, at one place and a lag of it: ensemble
  // moments, free of the area's size. Values of one drawing are correlated
  // only through its own waves, so the errors are those of 4000 draws:
  // 5 sqrt(2 / 4000) = 11 % of a variance.
  constexpr int kDrawings = 4000;
  const std::vector<double> lags_m = {0.0, 100.0, 400.0, 1200.0};
  std::vector<double> products(lags_m.size(), 0.0);
  double sum = 0.0;
  for (int i = 0; i < kDrawings; ++i) {
    const Relief relief({.seed = static_cast<std::uint64_t>(i),
                         .std_m = 3.0,
                         .correlation_length_m = 400.0,
                         .hurst = 0.8,
                         .shortest_m = 1.0,
                         .waves = 64});
    const double here = relief.At(500.0, -200.0);
    sum += here;
    for (std::size_t k = 0; k < lags_m.size(); ++k) {
      products[k] += here * relief.At(500.0, -200.0 + lags_m[k]);
    }
  }
  EXPECT_NEAR(sum / kDrawings, 0.0, 5.0 * 3.0 / std::sqrt(kDrawings));
  for (std::size_t k = 0; k < lags_m.size(); ++k) {
    EXPECT_NEAR(products[k] / kDrawings / 9.0,
                VonKarman(lags_m[k] / 400.0, 0.8), 0.11)
        << "lag " << lags_m[k];
  }
}

TEST(Relief, SameSeedSameSeabed) {
  const Relief a({.seed = 4});
  const Relief b({.seed = 4});
  const Relief other({.seed = 5});
  EXPECT_EQ(a.At(12.0, 34.0), b.At(12.0, 34.0));
  EXPECT_NE(a.At(12.0, 34.0), other.At(12.0, 34.0));
}

}  // namespace
}  // namespace fathom::feeder
