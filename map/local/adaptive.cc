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

// Squared steps between neighbours along one axis, their noise taken off.
struct Steps {
  float square_sum = 0.0f;
  float count = 0.0f;
};

}  // namespace

RegionalVariability VariabilityAround(const Neighbourhood& cells,
                                      double cell_size_m) {
  // Absent cells take part with weight 0 in what follows, so that the loop
  // over the twelve pairs is free of branches.
  float mean_m[9];
  float noise_m2[9];  // Variance of the mean from stated noise alone.
  float present[9];
  float excess = 0.0f;
  float scatter_freedom = 0.0f;
  for (std::size_t k = 0; k < 9; ++k) {
    const Evidence* cell = cells[k];
    if (cell == nullptr) {
      mean_m[k] = noise_m2[k] = present[k] = 0.0f;
      continue;
    }
    mean_m[k] = cell->mean_m;
    noise_m2[k] = 1.0f / cell->weight;
    present[k] = 1.0f;
    if (k == kCenter) continue;
    const float n = cell->count;
    // Summed over the neighbours, each with its freedom: (n - 1) tau^2.
    excess += (cell->scatter - (n - 1.0f)) * n * noise_m2[k];
    scatter_freedom += n - 1.0f;
  }
  const auto add = [&](std::size_t a, std::size_t b, Steps& steps) {
    const float both = present[a] * present[b];
    const float step_m = mean_m[b] - mean_m[a];
    steps.square_sum += both * (step_m * step_m - noise_m2[a] - noise_m2[b]);
    steps.count += both;
  };
  Steps north;
  Steps east;
  for (std::size_t k = 0; k < 6; ++k) add(k, k + 3, north);
  for (std::size_t k = 0; k < 9; k += 3) {
    add(k, k + 1, east);
    add(k + 1, k + 2, east);
  }

  const double typical_m = kTypicalSlope * cell_size_m;
  double weighted = kTypicalFreedom * typical_m * typical_m / 12.0;
  double freedom = kTypicalFreedom;
  const float count = north.count + east.count;
  if (count > 0.0f) {
    // An axis without a pair is taken to step as the other one does.
    const Steps& for_north = north.count > 0.0f ? north : east;
    const Steps& for_east = east.count > 0.0f ? east : north;
    const double step2_m2 =
        std::max(0.0f, for_north.square_sum / for_north.count) +
        std::max(0.0f, for_east.square_sum / for_east.count);
    const double step_freedom = std::min(kMaxStepFreedom, 0.5 * count);
    weighted += step_freedom * step2_m2 / 12.0;
    freedom += step_freedom;
  }
  if (scatter_freedom > 0.0f) {
    const double used = std::min(kMaxScatterFreedom, double{scatter_freedom});
    weighted += used * std::max(0.0f, excess / scatter_freedom);
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
