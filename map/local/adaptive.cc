#include "map/local/adaptive.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "map/local/estimator.h"
#include "map/local/hazard.h"

namespace fathom::map {
namespace {

// Keeps a witness that saw nothing from being certain of it: (1 cm)^2.
constexpr double kLeastM2 = 1e-4;
// A plane that steps g varies by g^2 / 12 inside a cell only if it is one: the
// share of the estimate by which a real floor departs from that.
constexpr double kStepDiscrepancy = 0.4;
// How much the variability of neighbours differs from the cell's own.
constexpr double kNeighbourDiscrepancy = 0.6;
// kTypicalSlope is a guess within a factor.
constexpr double kTypicalDiscrepancy = 1.6;
// The twelve steps of a neighbourhood share their nine ends.
constexpr double kIndependentSteps = 0.5;

double Square(double x) { return x * x; }

// What one witness says of tau^2 (m^2) and how far it may be off (m^4).
struct Witness {
  double variability_m2 = 0.0;
  double variance_m4 = 0.0;
};

// Witnesses weighed by their precision.
class Hearing {
 public:
  void Add(const Witness& witness) {
    const double precision = 1.0 / witness.variance_m4;
    precision_ += precision;
    weighted_ += precision * witness.variability_m2;
  }
  Witness Verdict() const { return {weighted_ / precision_, 1.0 / precision_}; }

 private:
  double precision_ = 0.0;
  double weighted_ = 0.0;
};

// (S - (n - 1)) s_h^2: excess scatter, an estimate of (n - 1) tau^2, where
// s_h^2 = n / W is the typical stated variance.
double Excess(const Evidence& evidence) {
  const double n = evidence.count;
  return (evidence.scatter - (n - 1.0)) * n / evidence.weight;
}

// The mean of a normal cut off below 0, in units of its std x + phi(x) /
// Phi(x); never 0. That function solves g (g - x) = c / 4 with a c that falls
// from 4 to 0; c is approximated, which costs one exp instead of exp and erfc
// and leaves g right to 1.5 % (tested).
double MeanAboveZero(const Witness& witness) {
  const auto std_m2 = static_cast<float>(std::sqrt(witness.variance_m4));
  const float x = static_cast<float>(witness.variability_m2) / std_m2;
  if (x > 4.0f) return witness.variability_m2;
  const float y = std::max(x, -20.0f);
  const float bend = y > 0.0f ? 0.2164f : 0.0433f;
  const float c = 4.0f / (1.0f + 0.5708f * std::exp(y * (0.8749f + bend * y)));
  // For x < 0 the sum of two numbers that nearly cancel is avoided.
  const float root = std::sqrt(x * x + c);
  const float g = x > 0.0f ? 0.5f * (x + root) : 0.5f * c / (root - x);
  return double{std_m2} * double{g};
}

// Squared steps between neighbours along one axis.
struct Steps {
  float square_sum = 0.0f;  // Their noise taken off.
  float noise_sum = 0.0f;   // The noise, m^2.
  float share_sum = 0.0f;   // 1 / n of both ends, averaged.
  float count = 0.0f;

  // The mean square step as a witness of itself: a squared normal of variance
  // v has the variance 2 v^2.
  Witness Mean() const {
    const double step_m2 = std::max(0.0f, square_sum / count);
    const double noise_m2 = noise_sum / count;
    return {step_m2,
            2.0 * Square(step_m2 + noise_m2) / (kIndependentSteps * count)};
  }
};

}  // namespace

RegionalVariability VariabilityAround(const Neighbourhood& cells,
                                      double cell_size_m) {
  // Absent cells take part with weight 0 in what follows, so that the loop
  // over the twelve pairs is free of branches.
  float mean_m[9];
  float noise_m2[9];  // Variance of the mean from stated noise alone.
  float present[9];
  float share[9];  // 1 / n: its mean holds that share of its variability.
  float excess = 0.0f;
  float stated_m2 = 0.0f;  // Sum over neighbours of (n - 1) s_h^2.
  float scatter_freedom = 0.0f;
  for (std::size_t k = 0; k < 9; ++k) {
    const Evidence* cell = cells[k];
    if (cell == nullptr) {
      mean_m[k] = noise_m2[k] = present[k] = share[k] = 0.0f;
      continue;
    }
    mean_m[k] = cell->mean_m;
    noise_m2[k] = 1.0f / cell->weight;
    present[k] = 1.0f;
    const float n = cell->count;
    share[k] = 1.0f / n;
    if (k == kCenter) continue;
    // Summed over the neighbours, each with its freedom: (n - 1) tau^2.
    excess += (cell->scatter - (n - 1.0f)) * n * noise_m2[k];
    stated_m2 += (n - 1.0f) * n * noise_m2[k];
    scatter_freedom += n - 1.0f;
  }
  const auto add = [&](std::size_t a, std::size_t b, Steps& steps) {
    const float both = present[a] * present[b];
    const float step_m = mean_m[b] - mean_m[a];
    const float noise = noise_m2[a] + noise_m2[b];
    steps.square_sum += both * (step_m * step_m - noise);
    steps.noise_sum += both * noise;
    steps.share_sum += both * 0.5f * (share[a] + share[b]);
    steps.count += both;
  };
  Steps north;
  Steps east;
  for (std::size_t k = 0; k < 6; ++k) add(k, k + 3, north);
  for (std::size_t k = 0; k < 9; k += 3) {
    add(k, k + 1, east);
    add(k + 1, k + 2, east);
  }

  const double typical_m2 = Square(kTypicalSlope * cell_size_m) / 12.0;
  std::optional<Witness> by_steps;
  if (north.count + east.count > 0.0f) {
    // An axis without a pair is taken to step as the other one does.
    const Witness up = (north.count > 0.0f ? north : east).Mean();
    const Witness right = (east.count > 0.0f ? east : north).Mean();
    // g^2 / 12 along each axis; and as each end's mean is off by tau^2 / n, the
    // sum of both squares holds 4 tau^2 / n beside 12 tau^2.
    const double twelve = 12.0 + 4.0 * (north.share_sum + east.share_sum) /
                                     (north.count + east.count);
    by_steps = {(up.variability_m2 + right.variability_m2) / twelve,
                (up.variance_m4 + right.variance_m4) / Square(twelve)};
  }
  // One scale for all discrepancies: a witness that happens to say little
  // would else be taken for a precise one.
  const double scale_m2 =
      kLeastM2 + (by_steps ? by_steps->variability_m2 : typical_m2);
  Hearing hearing;
  hearing.Add({std::min(typical_m2, kTypicalDiscrepancy * scale_m2),
               Square(kTypicalDiscrepancy * scale_m2)});
  if (by_steps) {
    by_steps->variance_m4 += Square(kStepDiscrepancy * scale_m2);
    hearing.Add(*by_steps);
  }
  if (scatter_freedom > 0.0f) {
    hearing.Add({excess / scatter_freedom,
                 2.0 * Square(scale_m2 + stated_m2 / scatter_freedom) /
                         double{scatter_freedom} +
                     Square(kNeighbourDiscrepancy * scale_m2)});
  }
  const Witness verdict = hearing.Verdict();
  return {.variance_m2 = verdict.variability_m2,
          .uncertainty_m4 = verdict.variance_m4};
}

double VariabilityInside(const Evidence& evidence,
                         const RegionalVariability& around) {
  const Witness region = {around.variance_m2, around.uncertainty_m4};
  const double freedom = evidence.count - 1.0;
  if (freedom < 1.0) return MeanAboveZero(region);
  const double excess = Excess(evidence);
  const double own_m2 = excess / freedom;
  const double noise_m2 = evidence.count / double{evidence.weight};
  // What tau^2 may be, for the error of the own scatter: a rough value will do.
  const double expected_m2 =
      std::max(region.variability_m2, 0.8 * std::sqrt(region.variance_m4));
  Hearing hearing;
  hearing.Add(region);
  hearing.Add({own_m2, 2.0 * Square(noise_m2 + expected_m2) / freedom});
  const double shrunk = MeanAboveZero(hearing.Verdict());
  // Chi-square of `freedom` has std sqrt(2 freedom): the excess between two
  // and four of them stands more and more by itself.
  const double deviation =
      (evidence.scatter - freedom) / std::sqrt(2.0 * freedom);
  const double beyond_chance = std::clamp(0.5 * (deviation - 2.0), 0.0, 1.0);
  return shrunk + beyond_chance * std::max(0.0, own_m2 - shrunk);
}

double MeanVarianceOf(const Evidence& evidence, double variability_m2) {
  return 1.0 / evidence.weight + variability_m2 / evidence.count;
}

AdaptiveReading ReadAdaptive(const Neighbourhood& cells, const CellPrior& prior,
                             double cell_size_m) {
  const Evidence& evidence = *cells[kCenter];
  const RegionalVariability around = VariabilityAround(cells, cell_size_m);
  const double variability_m2 = VariabilityInside(evidence, around);
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
  return {.predictive = read,
          .variability_m2 = variability_m2,
          .hazard_m = HazardDepth(evidence)};
}

}  // namespace fathom::map
