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

constexpr double Square(double x) { return x * x; }

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
  Witness Verdict() const {
    const double variance_m4 = 1.0 / precision_;
    return {weighted_ * variance_m4, variance_m4};
  }

 private:
  double precision_ = 0.0;
  double weighted_ = 0.0;
};

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

// Four floats that one instruction works on; GCC and clang know them on every
// processor. A row of three cells and an empty fourth lane.
using Lanes [[gnu::vector_size(16)]] = float;

float Sum(Lanes lanes) { return (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]); }

// The lanes moved one to the west; the fourth stays.
Lanes OneEast(Lanes lanes) {
  return __builtin_shufflevector(lanes, lanes, 1, 2, 3, 3);
}

// A cell without evidence has present 0 and numbers that add nothing.
struct Row {
  Lanes mean_m;
  Lanes scatter;
  Lanes count;
  Lanes present;   // 0 or 1.
  Lanes noise_m2;  // Variance of the mean from stated noise alone.
  Lanes share;     // 1 / n: a mean holds that share of its variability.
};

Row RowOf(const PackedEvidence* west, const PackedEvidence* middle,
          const PackedEvidence* east) {
  static constexpr PackedEvidence kNothing = {.weight = 1.0f,
                                              .time_count = 1u << 16};
  const PackedEvidence& a = west == nullptr ? kNothing : *west;
  const PackedEvidence& b = middle == nullptr ? kNothing : *middle;
  const PackedEvidence& c = east == nullptr ? kNothing : *east;
  const Lanes weight = {a.weight, b.weight, c.weight, 1.0f};
  Row row = {
      .mean_m = {a.mean_m, b.mean_m, c.mean_m, 0.0f},
      .scatter = {a.scatter, b.scatter, c.scatter, 0.0f},
      .count = {static_cast<float>(CountOf(a)), static_cast<float>(CountOf(b)),
                static_cast<float>(CountOf(c)), 1.0f},
      .present = {west == nullptr ? 0.0f : 1.0f,
                  middle == nullptr ? 0.0f : 1.0f,
                  east == nullptr ? 0.0f : 1.0f, 0.0f},
      .noise_m2 = {},
      .share = {}};
  row.noise_m2 = row.present / weight;
  row.share = row.present / row.count;
  return row;
}

// Squared steps between neighbours along one axis.
class Steps {
 public:
  // From cells to those beside them; `both` 1 where both are there.
  void Add(Lanes step_m, Lanes noise_m2, Lanes share, Lanes both) {
    noise_m2 *= both;
    square_ += both * step_m * step_m - noise_m2;
    noise_ += noise_m2;
    share_ += both * share;
    count_ += both;
  }
  float count() const { return Sum(count_); }
  // 1 / n of both ends, averaged.
  float share() const { return 0.5f * Sum(share_); }

  // The mean square step, its noise taken off, as a witness of itself: a
  // squared normal of variance v has the variance 2 v^2.
  Witness Mean() const {
    const double per_count = 1.0 / double{count()};
    const double step_m2 = std::max(0.0, double{Sum(square_)} * per_count);
    const double noise_m2 = double{Sum(noise_)} * per_count;
    return {step_m2,
            2.0 / kIndependentSteps * Square(step_m2 + noise_m2) * per_count};
  }

 private:
  Lanes square_ = {};
  Lanes noise_ = {};
  Lanes share_ = {};
  Lanes count_ = {};
};

}  // namespace

RegionalVariability VariabilityAround(const Neighbourhood& cells,
                                      double cell_size_m) {
  const Row south = RowOf(cells[0], cells[1], cells[2]);
  const Row middle = RowOf(cells[3], cells[4], cells[5]);
  const Row north = RowOf(cells[6], cells[7], cells[8]);

  Steps northward;
  const auto add_northward = [&northward](const Row& from, const Row& to) {
    northward.Add(to.mean_m - from.mean_m, to.noise_m2 + from.noise_m2,
                  to.share + from.share, to.present * from.present);
  };
  add_northward(south, middle);
  add_northward(middle, north);
  Steps eastward;
  // The neighbours' excess scatter, summed with their freedom: (n - 1) tau^2.
  Lanes excess = {};
  Lanes stated = {};
  Lanes freedom = {};
  const auto add_row = [&](const Row& row, Lanes neighbours) {
    eastward.Add(
        OneEast(row.mean_m) - row.mean_m, OneEast(row.noise_m2) + row.noise_m2,
        OneEast(row.share) + row.share, OneEast(row.present) * row.present);
    const Lanes stated_m2 = row.count * row.noise_m2 * neighbours;  // s_h^2
    const Lanes more = (row.count - 1.0f) * neighbours;
    excess += (row.scatter - more) * stated_m2;
    stated += more * stated_m2;
    freedom += more;
  };
  constexpr Lanes kAll = {1.0f, 1.0f, 1.0f, 1.0f};
  constexpr Lanes kAllButTheMiddle = {1.0f, 0.0f, 1.0f, 1.0f};
  add_row(south, kAll);
  add_row(middle, kAllButTheMiddle);
  add_row(north, kAll);

  const double typical_m2 = Square(kTypicalSlope * cell_size_m) / 12.0;
  const float northward_count = northward.count();
  const float eastward_count = eastward.count();
  std::optional<Witness> by_steps;
  if (northward_count + eastward_count > 0.0f) {
    // An axis without a pair is taken to step as the other one does.
    const Witness up = (northward_count > 0.0f ? northward : eastward).Mean();
    const Witness right = (eastward_count > 0.0f ? eastward : northward).Mean();
    // g^2 / 12 along each axis; and as each end's mean is off by tau^2 / n, the
    // sum of both squares holds 4 tau^2 / n beside 12 tau^2.
    const double per_twelve =
        1.0 / (12.0 + 4.0 * double{northward.share() + eastward.share()} /
                          double{northward_count + eastward_count});
    by_steps = {(up.variability_m2 + right.variability_m2) * per_twelve,
                (up.variance_m4 + right.variance_m4) * Square(per_twelve)};
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
  if (const double n = Sum(freedom); n > 0.0) {
    const double per_n = 1.0 / n;
    hearing.Add({Sum(excess) * per_n,
                 2.0 * Square(scale_m2 + Sum(stated) * per_n) * per_n +
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
  const double per_freedom = 1.0 / freedom;
  const double noise_m2 = evidence.count / double{evidence.weight};
  // (S - (n - 1)) s_h^2: excess scatter, an estimate of (n - 1) tau^2, where
  // s_h^2 = n / W is the typical stated variance.
  const double own_m2 = (evidence.scatter - freedom) * noise_m2 * per_freedom;
  // What tau^2 may be, for the error of the own scatter: a rough value will do.
  const double expected_m2 =
      std::max(region.variability_m2, 0.8 * std::sqrt(region.variance_m4));
  Hearing hearing;
  hearing.Add(region);
  hearing.Add({own_m2, 2.0 * Square(noise_m2 + expected_m2) * per_freedom});
  const double shrunk = MeanAboveZero(hearing.Verdict());
  // Chi-square of `freedom` has std sqrt(2 freedom): the excess between two
  // and four of them stands more and more by itself.
  const double deviation =
      (evidence.scatter - freedom) * std::sqrt(0.5 * per_freedom);
  const double beyond_chance = std::clamp(0.5 * (deviation - 2.0), 0.0, 1.0);
  return shrunk + beyond_chance * std::max(0.0, own_m2 - shrunk);
}

double MeanVarianceOf(const Evidence& evidence, double variability_m2) {
  return 1.0 / evidence.weight + variability_m2 / evidence.count;
}

AdaptiveReading ReadAdaptive(const Evidence& evidence,
                             const Neighbourhood& cells, const CellPrior& prior,
                             double cell_size_m) {
  const RegionalVariability region = VariabilityAround(cells, cell_size_m);
  const double variability_m2 = VariabilityInside(evidence, region);
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
