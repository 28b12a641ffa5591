#include "map/local/smoothed_reading.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "map/local/adaptive.h"

namespace fathom::map {
namespace {

// The guess of kTypicalSlope weighs as one pair, and counts for no more than
// this many times what the pairs say.
constexpr float kTypicalPairs = 0.5f;
// A variogram from m steps is off by a factor that has a long tail: R is raised
// by 1 + 16 / m^2, which holds the share beyond three std on five terrains.
constexpr float kFewPairs = 16.0f;
constexpr float kMostTypical = 4.0f;
// E |x - x'|^1.5 between random points of a unit square is 0.399; half of it
// is the variance inside.
constexpr float kInsideUnitSquare = 0.2f;

// The loops over all lanes are plain and of fixed length, so that the compiler
// does four lanes at once (it needs -fno-math-errno for the roots).
constexpr std::size_t kLanes = kMaxMeasuredNear;
using Lanes = MeasuredNear::Lanes;

// Lanes twice over: lane k + s is the cell s further round the ring. Each pair
// of cells meets once as s goes from 1 to kHalf, those at kHalf itself twice.
using Ring = std::array<float, 2 * kLanes>;
constexpr std::size_t kHalf = kLanes / 2;
static_assert(kLanes % 2 == 0);

Ring Twice(const Lanes& lanes) {
  Ring ring;
  for (std::size_t k = 0; k < kLanes; ++k) ring[k] = lanes[k];
  for (std::size_t k = 0; k < kLanes; ++k) ring[k + kLanes] = lanes[k];
  return ring;
}

float Sum(const Lanes& lanes) {
  std::array<float, 4> sum;
  for (std::size_t k = 0; k < 4; ++k) {
    sum[k] = lanes[k] + lanes[k + 4] + lanes[k + 8];
  }
  return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}
static_assert(kLanes == 12);

// h^1.5 of a vector of cells.
float Power(float north, float east) {
  const float square = north * north + east * east;
  return std::sqrt(square * std::sqrt(square));
}

// What the scatter of the soundings in the cells says of the variability
// there; what chance alone may bring about is not taken for it.
float ScatterVariance(const MeasuredNear& near, const Lanes& noise_m2) {
  Lanes excess_m2;
  Lanes stated_m2;
  Lanes freedom;
  for (std::size_t k = 0; k < kLanes; ++k) {
    const float one_m2 = near.count[k] * noise_m2[k];
    freedom[k] = near.count[k] - 1.0f;
    stated_m2[k] = freedom[k] * one_m2;
    excess_m2[k] = (near.scatter[k] - freedom[k]) * one_m2;
  }
  const float all = Sum(freedom);
  if (!(all > 0.0f)) return 0.0f;
  return (Sum(excess_m2) - Sum(stated_m2) * std::sqrt(2.0f / all)) / all;
}

}  // namespace

std::optional<DepthEstimate> ReadSmoothed(const MeasuredNear& near,
                                          double scale, double cell_size_m) {
  if (near.size == 0 || !(scale > 0.0)) return std::nullopt;
  Lanes noise_m2;  // Of the means.
  Lanes apart;     // h_k^1.5
  for (std::size_t k = 0; k < kLanes; ++k) {
    noise_m2[k] = near.used[k] / near.weight[k];
    apart[k] = Power(near.north[k], near.east[k]);
  }
  const float scatter_m2 = ScatterVariance(near, noise_m2);

  // R from the pairs, the stated noise taken off.
  const Ring north = Twice(near.north);
  const Ring east = Twice(near.east);
  const Ring mean_m = Twice(near.mean_m);
  const Ring noise = Twice(noise_m2);
  const Ring used = Twice(near.used);
  std::array<Lanes, kHalf> between;  // h^1.5; 0 where there is no pair.
  Lanes roughs = {};
  Lanes noises = {};
  for (std::size_t s = 1; s <= kHalf; ++s) {
    const float share = s < kHalf ? 1.0f : 0.5f;
    for (std::size_t k = 0; k < kLanes; ++k) {
      const float power = Power(north[k] - north[k + s], east[k] - east[k + s]);
      const float pair = share * used[k] * used[k + s];
      const float per = pair / power;
      const float step_m = mean_m[k] - mean_m[k + s];
      const float both_m2 = noise[k] + noise[k + s];
      between[s - 1][k] = pair * power;
      roughs[k] += (step_m * step_m - both_m2) * per;
      noises[k] += both_m2 * per;
    }
  }
  const auto typical_m = static_cast<float>(kTypicalSlope * cell_size_m);
  float rough_m2 = typical_m * typical_m;  // R.
  if (near.size > 1) {
    const auto count = static_cast<float>(near.size);
    const float steps = count - 1.0f;  // Pairs share their ends.
    const float per_pair = 1.0f / (0.5f * count * steps);
    // Not below a part of what the noise could hide.
    const float hidden = 0.15f * std::sqrt(2.0f / steps) * per_pair;
    const float by_pairs =
        std::max(hidden * Sum(noises), per_pair * Sum(roughs));
    const float guess = std::min(rough_m2, kMostTypical * by_pairs + kMinStdM);
    rough_m2 = (steps * by_pairs + kTypicalPairs * guess) *
               ((1.0f + kFewPairs / (steps * steps)) / (steps + kTypicalPairs));
  }
  const float variability_m2 =
      std::max(scatter_m2, kInsideUnitSquare * rough_m2);

  Lanes gain;  // w_k before they are normalised.
  for (std::size_t k = 0; k < kLanes; ++k) {
    noise_m2[k] += variability_m2 * (1.0f / near.count[k]);
    gain[k] = near.used[k] / (noise_m2[k] + rough_m2 * apart[k]);
  }
  const Ring gains = Twice(gain);
  const float per_gain = 1.0f / Sum(gain);
  Lanes means;
  Lanes errors;
  const float first_m = near.mean_m[0];  // Differences round less.
  for (std::size_t k = 0; k < kLanes; ++k) {
    const float others =
        (between[0][k] * gains[k + 1] + between[1][k] * gains[k + 2]) +
        (between[2][k] * gains[k + 3] + between[3][k] * gains[k + 4]) +
        (between[4][k] * gains[k + 5] + between[5][k] * gains[k + 6]);
    const float weight = gain[k] * per_gain;
    means[k] = weight * (near.mean_m[k] - first_m);
    errors[k] = weight * (rough_m2 * (apart[k] - others * per_gain) +
                          weight * noise_m2[k]);
  }
  static_assert(kHalf == 6);
  const float variance_m2 = (std::max(Sum(errors), 0.0f) + variability_m2) *
                            static_cast<float>(1.0 / scale);
  return DepthEstimate{.depth_m = first_m + Sum(means),
                       .std_m = std::max(kMinStdM, std::sqrt(variance_m2)),
                       .kind = EvidenceKind::kSmoothed,
                       .time_s = near.oldest_s,
                       .cell_size_m = static_cast<float>(cell_size_m),
                       .variability_m = std::sqrt(variability_m2)};
}

}  // namespace fathom::map
