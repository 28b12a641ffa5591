// How two independent opinions of one depth become one: the thesis's gain and
// fusion rules by their equations' numbers, and the rule for a prior that the
// evidence contradicts. Local and global map fuse with the same functions.
//
// Throughout, 1 is what was held and 2 what is added. Means are metres,
// variances m^2. All functions are pure and thread-safe.

#ifndef FATHOM_MAP_GEODESY_DEPTH_FUSION_H_
#define FATHOM_MAP_GEODESY_DEPTH_FUSION_H_

#include <cmath>
#include <cstdint>

namespace fathom::map {

// A mean and its variance; metres and m^2.
struct MeanVariance {
  double mean_m = 0.0;
  double variance_m2 = 0.0;
};

// Eq. 4.17: k = s1^2 / (s1^2 + s2^2), in [0, 1]. REQUIRES: both >= 0, not both
// 0. An infinite variance_1 (nothing known before) gives 1.
inline double Gain(double variance_1, double variance_2) {
  if (std::isinf(variance_1)) return 1.0;
  return variance_1 / (variance_1 + variance_2);
}

// Eq. 4.18: (1 - k) mu1 + k mu2.
inline double FuseMean(double k, double mean_1, double mean_2) {
  return (1.0 - k) * mean_1 + k * mean_2;
}

// Eq. 4.19: mu1 + k (mu2 - mu1): the same number as 4.18, written as a
// correction. The one the map computes with: exact where the means agree.
inline double CorrectMean(double k, double mean_1, double mean_2) {
  return mean_1 + k * (mean_2 - mean_1);
}

// Eq. 4.20 (4.15): (1 - k) s1^2 = k s2^2, the variance of the optimal mean.
inline double FuseVarianceKalman(double k, double variance_1) {
  return (1.0 - k) * variance_1;
}

// Eq. 4.21: (1 - k) s1^2 + k (mu1 - mu2)^2, the thesis's choice.
inline double FuseVarianceNervegna(double k, double variance_1, double mean_1,
                                   double mean_2) {
  const double moved_m = mean_1 - mean_2;
  return (1.0 - k) * variance_1 + k * moved_m * moved_m;
}

// The mean of `evidence` (variance `variance_m2` about the cell's mean)
// together with the prior. `soundings` is how many made it.
//
// Let d be their distance. If d^2 is within what both variances explain, this
// is 4.18 + 4.20. Else the prior's variance is widened to what would explain
// d (its maximum-likelihood value d^2 - variance), which continues the former
// without a step: the farther off the prior, the less it pulls. A prior 15 m
// wrong then pulls two soundings of 0.5 m by 8 mm. A single sounding that
// contradicts the prior beyond 3 sigma may itself be the error, so the
// variance of "either one" (k (1 - k) d^2 with the unwidened k) is added until
// a second one has come.
// An infinite prior_variance_m2 means no prior.
MeanVariance FusePrior(const MeanVariance& evidence, std::uint32_t soundings,
                       double prior_mean_m, double prior_variance_m2);

// How many std the least of n independent normal draws lies below their mean
// at most, but for once in a hundred sets of n: the normal quantile of 1 - 0.01
// / n (Bonferroni). Within 0.03 for n up to 30, and up to 0.07 less for n up to
// 1000, so that a little more counts as no chance: the safe side.
inline double LeastOfNormals(double n) {
  return std::sqrt(2.0 * std::log(50.0 * n)) - 0.45;
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_GEODESY_DEPTH_FUSION_H_
