#include "map/local/adaptive.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "map/local/estimator.h"

namespace fathom::map {
namespace {

// Steps to neighbours count at most so many degrees of freedom, and the
// neighbours' scatter too: a region must not outvote a cell that was sounded
// a few dozen times.
constexpr double kMaxStepFreedom = 4.0;
constexpr double kMaxScatterFreedom = 4.0;
// kTypicalSlope's weight: that of half a sounding.
constexpr double kTypicalFreedom = 0.5;

// (S - (n - 1)) s_h^2: excess scatter, an estimate of (n - 1) tau^2, where
// s_h^2 = n / W is the typical stated variance.
double Excess(const Evidence& evidence) {
  const double n = evidence.count;
  return (evidence.scatter - (n - 1.0)) * n / evidence.weight;
}

}  // namespace

RegionalVariability VariabilityAround(const Neighbourhood& cells,
                                      double cell_size_m) {
  double step2_sum[2] = {0.0, 0.0};  // North, east.
  double steps[2] = {0.0, 0.0};
  double excess = 0.0;
  double scatter_freedom = 0.0;
  for (std::size_t k = 0; k < 9; ++k) {
    const Evidence* cell = cells[k];
    if (cell == nullptr) continue;
    if (k != kCenter && cell->count > 1) {
      // The mean over neighbours, each with its own freedom, of tau^2.
      excess += Excess(*cell);
      scatter_freedom += cell->count - 1.0;
    }
    const Evidence* const next[2] = {k < 6 ? cells[k + 3] : nullptr,
                                     k % 3 < 2 ? cells[k + 1] : nullptr};
    for (int axis = 0; axis < 2; ++axis) {
      if (next[axis] == nullptr) continue;
      const double step_m = static_cast<double>(next[axis]->mean_m) -
                            static_cast<double>(cell->mean_m);
      // Two means differ by their noise alone already.
      const double noise_m2 = 1.0 / cell->weight + 1.0 / next[axis]->weight;
      step2_sum[axis] += step_m * step_m - noise_m2;
      steps[axis] += 1.0;
    }
  }

  const double typical_m = kTypicalSlope * cell_size_m;
  double weighted = kTypicalFreedom * typical_m * typical_m / 12.0;
  double freedom = kTypicalFreedom;
  if (steps[0] + steps[1] > 0.0) {
    // An axis without a pair is taken to step as the other one does.
    double step2[2];
    for (int axis = 0; axis < 2; ++axis) {
      const int used = steps[axis] > 0.0 ? axis : 1 - axis;
      step2[axis] = std::max(0.0, step2_sum[used] / steps[used]);
    }
    const double step_freedom =
        std::min(kMaxStepFreedom, 0.5 * (steps[0] + steps[1]));
    weighted += step_freedom * (step2[0] + step2[1]) / 12.0;
    freedom += step_freedom;
  }
  if (scatter_freedom > 0.0) {
    const double used = std::min(kMaxScatterFreedom, scatter_freedom);
    weighted += used * std::max(0.0, excess / scatter_freedom);
    freedom += used;
  }
  return {.variance_m2 = weighted / freedom, .degrees_of_freedom = freedom};
}

double VariabilityInside(const Evidence& evidence,
                         const RegionalVariability& around) {
  const double freedom = evidence.count - 1.0;
  const double regional = around.degrees_of_freedom * around.variance_m2;
  const double excess = Excess(evidence);
  const double shrunk = std::max(
      0.0, (regional + excess) / (around.degrees_of_freedom + freedom));
  if (freedom < 1.0 || excess <= 0.0) return shrunk;
  // Chi-square of `freedom` has std sqrt(2 freedom): beyond three of them the
  // excess is no chance and stands by itself.
  const double beyond_chance = std::min(
      1.0, (evidence.scatter - freedom) / (3.0 * std::sqrt(2.0 * freedom)));
  const double own = std::max(shrunk, excess / freedom);
  return shrunk + beyond_chance * (own - shrunk);
}

double MeanVarianceOf(const Evidence& evidence, double variability_m2) {
  return 1.0 / evidence.weight + variability_m2 / evidence.count;
}

MeanVariance FusePrior(const MeanVariance& evidence, std::uint32_t soundings,
                       double prior_mean_m, double prior_variance_m2) {
  if (std::isinf(prior_variance_m2)) return evidence;
  const double apart_m = evidence.mean_m - prior_mean_m;
  const double apart2 = apart_m * apart_m;
  const double widened =
      std::max(prior_variance_m2, apart2 - evidence.variance_m2);
  const double k = Gain(widened, evidence.variance_m2);
  MeanVariance fused = {.mean_m = CorrectMean(k, prior_mean_m, evidence.mean_m),
                        .variance_m2 = FuseVarianceKalman(k, widened)};
  if (soundings == 1 &&
      apart2 > 9.0 * (prior_variance_m2 + evidence.variance_m2)) {
    const double stated_k = Gain(prior_variance_m2, evidence.variance_m2);
    fused.variance_m2 += stated_k * (1.0 - stated_k) * apart2;
  }
  return fused;
}

MeanVariance ReadAdaptive(const Neighbourhood& cells, const CellPrior& prior,
                          double cell_size_m) {
  const Evidence& evidence = *cells[kCenter];
  const double variability_m2 =
      VariabilityInside(evidence, VariabilityAround(cells, cell_size_m));
  const bool usable =
      prior.kind != EvidenceKind::kNone && prior.kind != EvidenceKind::kLand;
  const double prior_variance_m2 =
      usable ? static_cast<double>(prior.std_m) * prior.std_m
             : std::numeric_limits<double>::infinity();
  MeanVariance read =
      FusePrior({.mean_m = evidence.mean_m,
                 .variance_m2 = MeanVarianceOf(evidence, variability_m2)},
                evidence.count, prior.depth_m, prior_variance_m2);
  read.variance_m2 += variability_m2;
  return read;
}

}  // namespace fathom::map
