#include "map/local/adaptive.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>

#include "map/local/estimator.h"
#include "map/local/hazard.h"

namespace fathom::map {
namespace {

// Keeps a witness that saw nothing from being certain of it: (1 cm)^2.
constexpr float kLeastM2 = 1e-4f;
// A plane that steps g varies by g^2 / 12 inside a cell only if it is one: the
// share of the estimate by which a real floor departs from that.
constexpr float kStepDiscrepancy = 0.4f;
// How much the variability of neighbours differs from the cell's own.
constexpr float kNeighbourDiscrepancy = 0.6f;
// kTypicalSlope is a guess within a factor.
constexpr float kTypicalDiscrepancy = 1.6f;
// The twelve steps of a neighbourhood share their nine ends.
constexpr float kIndependentSteps = 0.5f;

constexpr float Square(float x) { return x * x; }

// Four floats that one instruction works on; GCC and clang know them on every
// processor.
using Lanes [[gnu::vector_size(16)]] = float;
using IntLanes [[gnu::vector_size(16)]] = std::int32_t;

// What one witness says of tau^2 (m^2) and how far it may be off (m^4).
struct Witness {
  float variability_m2 = 0.0f;
  float variance_m4 = 0.0f;
};

// Witnesses weighed by their precision.
class Hearing {
 public:
  void Add(const Witness& witness) {
    AddPrecise(witness.variability_m2, 1.0f / witness.variance_m4);
  }
  // The same with the reciprocal of the variance.
  void AddPrecise(float variability_m2, float precision) {
    precision_ += precision;
    weighted_ += precision * variability_m2;
  }
  float precision() const { return precision_; }
  // The sum of each witness's word times its precision.
  float weighted() const { return weighted_; }

 private:
  float precision_ = 0.0f;
  float weighted_ = 0.0f;
};

// The mean of a normal with std 1 cut off below 0: x + phi(x) / Phi(x), never
// 0. Right to 2e-4 of itself above -20; what is below counts as -20.
class AboveZero {
 public:
  AboveZero() {
    for (std::size_t k = 0; k < means_.size(); ++k) {
      const double x = double{kLow} + static_cast<double>(k) / double{kPerUnit};
      const double density = std::exp(-0.5 * x * x) * 0.5 *
                             std::numbers::inv_sqrtpi * std::numbers::sqrt2;
      means_[k] = static_cast<float>(
          x + density / (0.5 * std::erfc(-0.5 * std::numbers::sqrt2 * x)));
    }
  }
  float Mean(float x) const {
    const float y = std::clamp(x, kLow, kHigh);
    const float steps = (y - kLow) * kPerUnit;
    const int k = static_cast<int>(steps);
    const float low = means_[static_cast<std::size_t>(k)];
    const float high = means_[static_cast<std::size_t>(k) + 1];
    const float beyond = std::max(0.0f, x - y);
    return low + (steps - static_cast<float>(k)) * (high - low) + beyond;
  }

 private:
  static constexpr float kLow = -20.0f;
  static constexpr float kHigh = 8.0f;
  static constexpr float kPerUnit = 16.0f;
  std::array<float, static_cast<std::size_t>((kHigh - kLow) * kPerUnit) + 2>
      means_;
};

// What a hearing leaves of tau^2: the mean of the normal it ends with, cut off
// below 0.
float MeanAboveZero(const Hearing& hearing) {
  static const AboveZero above_zero;
  const float std_m2 = 1.0f / std::sqrt(hearing.precision());
  return std_m2 * above_zero.Mean(hearing.weighted() * std_m2);
}

// The sum of the lanes of each.
Lanes Sums(Lanes a, Lanes b, Lanes c, Lanes d) {
  const Lanes ab = __builtin_shufflevector(a, b, 0, 4, 1, 5) +
                   __builtin_shufflevector(a, b, 2, 6, 3, 7);
  const Lanes cd = __builtin_shufflevector(c, d, 0, 4, 1, 5) +
                   __builtin_shufflevector(c, d, 2, 6, 3, 7);
  return __builtin_shufflevector(ab, cd, 0, 1, 4, 5) +
         __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}

// The lanes moved one to the west; the fourth stays.
Lanes OneEast(Lanes lanes) {
  return __builtin_shufflevector(lanes, lanes, 1, 2, 3, 3);
}

// Three cells and an empty fourth lane.
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
  static constexpr PackedEvidence kNothing;
  const PackedEvidence& a = west == nullptr ? kNothing : *west;
  const PackedEvidence& b = middle == nullptr ? kNothing : *middle;
  const PackedEvidence& c = east == nullptr ? kNothing : *east;
  const IntLanes count = {CountOf(a), CountOf(b), CountOf(c), 0};
  // A comparison gives -1 where it holds.
  const Lanes absent = __builtin_convertvector(-(count == 0), Lanes);
  const Lanes weight = Lanes{a.weight, b.weight, c.weight, 0.0f} + absent;
  Row row = {.mean_m = {a.mean_m, b.mean_m, c.mean_m, 0.0f},
             .scatter = {a.scatter, b.scatter, c.scatter, 0.0f},
             .count = __builtin_convertvector(count, Lanes) + absent,
             .present = 1.0f - absent,
             .noise_m2 = {},
             .share = {}};
  row.noise_m2 = row.present / weight;
  row.share = row.present / row.count;
  return row;
}

// Sums over the steps between neighbours along one axis.
struct StepSums {
  float square_m2;  // Squared steps, their noise taken off.
  float noise_m2;
  float share;  // 1 / n of both ends.
  float count;

  // The mean square step as a witness of itself: a squared normal of variance
  // v has the variance 2 v^2.
  Witness Mean() const {
    const float per_count = 1.0f / count;
    const float step_m2 = std::max(0.0f, square_m2 * per_count);
    const float square = Square(step_m2 + noise_m2 * per_count);
    return {step_m2, 2.0f / kIndependentSteps * square * per_count};
  }
};

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
  StepSums Sum() const {
    const Lanes sums = Sums(square_, noise_, share_, count_);
    return {sums[0], sums[1], sums[2], sums[3]};
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

  const float typical_m2 =
      Square(static_cast<float>(kTypicalSlope * cell_size_m)) / 12.0f;
  const StepSums north_sums = northward.Sum();
  const StepSums east_sums = eastward.Sum();
  const Lanes scatter = Sums(excess, stated, freedom, Lanes{});
  const float pairs = north_sums.count + east_sums.count;
  std::optional<Witness> by_steps;
  if (pairs > 0.0f) {
    // An axis without a pair is taken to step as the other one does.
    const Witness up =
        (north_sums.count > 0.0f ? north_sums : east_sums).Mean();
    const Witness right =
        (east_sums.count > 0.0f ? east_sums : north_sums).Mean();
    // g^2 / 12 along each axis; and as each end's mean is off by tau^2 / n, the
    // sum of both squares holds 4 tau^2 / n beside 12 tau^2, 1 / n averaged
    // over the ends.
    const float per_twelve =
        pairs / (12.0f * pairs + 2.0f * (north_sums.share + east_sums.share));
    by_steps = {(up.variability_m2 + right.variability_m2) * per_twelve,
                (up.variance_m4 + right.variance_m4) * Square(per_twelve)};
  }
  // One scale for all discrepancies: a witness that happens to say little
  // would else be taken for a precise one.
  const float scale_m2 =
      kLeastM2 + (by_steps ? by_steps->variability_m2 : typical_m2);
  Hearing hearing;
  hearing.Add({std::min(typical_m2, kTypicalDiscrepancy * scale_m2),
               Square(kTypicalDiscrepancy * scale_m2)});
  if (by_steps) {
    by_steps->variance_m4 += Square(kStepDiscrepancy * scale_m2);
    hearing.Add(*by_steps);
  }
  if (const float n = scatter[2]; n > 0.0f) {
    const float per_n = 1.0f / n;
    hearing.Add({scatter[0] * per_n,
                 2.0f * Square(scale_m2 + scatter[1] * per_n) * per_n +
                     Square(kNeighbourDiscrepancy * scale_m2)});
  }
  const float variance_m4 = 1.0f / hearing.precision();
  return {.variance_m2 = hearing.weighted() * variance_m4,
          .uncertainty_m4 = variance_m4};
}

float VariabilityInside(const Evidence& evidence,
                        const RegionalVariability& around) {
  Hearing hearing;
  hearing.Add({around.variance_m2, around.uncertainty_m4});
  const float count = evidence.count;
  const float freedom = count - 1.0f;
  if (freedom < 1.0f) return MeanAboveZero(hearing);
  const float per_freedom = 1.0f / freedom;
  const float noise_m2 = count / evidence.weight;
  // (S - (n - 1)) s_h^2: excess scatter, an estimate of (n - 1) tau^2, where
  // s_h^2 = n / W is the typical stated variance.
  const float own_m2 = (evidence.scatter - freedom) * noise_m2 * per_freedom;
  // What tau^2 may be, for the error of the own scatter: a rough value will do.
  const float expected_m2 =
      std::max(around.variance_m2, 0.8f * std::sqrt(around.uncertainty_m4));
  hearing.AddPrecise(own_m2, freedom / (2.0f * Square(noise_m2 + expected_m2)));
  const float shrunk_m2 = MeanAboveZero(hearing);
  // Chi-square of `freedom` has std sqrt(2 freedom): the excess between two
  // and four of them stands more and more by itself.
  const float deviation =
      (evidence.scatter - freedom) * std::sqrt(0.5f * per_freedom);
  const float beyond_chance = std::clamp(0.5f * (deviation - 2.0f), 0.0f, 1.0f);
  return shrunk_m2 + beyond_chance * std::max(0.0f, own_m2 - shrunk_m2);
}

double MeanVarianceOf(const Evidence& evidence, double variability_m2) {
  // The reciprocal does not wait for tau^2.
  return 1.0 / evidence.weight + variability_m2 * (1.0 / evidence.count);
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
