#include "map/local/smoothed_reading.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "map/local/adaptive.h"

namespace fathom::map {
namespace {

// The guess of kTypicalSlope weighs as one pair, and counts for no more than
// this many times what the pairs say.
constexpr double kTypicalPairs = 0.5;
// A variogram from m steps is off by a factor that has a long tail: R is raised
// by 1 + 16 / m^2, which holds the share beyond three std on five terrains.
constexpr double kFewPairs = 16.0;
constexpr double kMostTypical = 4.0;
// E |x - x'|^1.5 between random points of a unit square is 0.399; half of it
// is the variance inside.
constexpr double kInsideUnitSquare = 0.2;

// h^1.5 of a vector of cells.
float Power(std::int32_t north, std::int32_t east) {
  const auto square = static_cast<float>(north * north + east * east);
  return std::sqrt(square * std::sqrt(square));
}

}  // namespace

std::optional<DepthEstimate> ReadSmoothed(std::span<const MeasuredNear> near,
                                          double scale, double cell_size_m) {
  if (near.empty() || !(scale > 0.0)) return std::nullopt;
  const std::size_t count = std::min(near.size(), kMaxMeasuredNear);

  // Noise of the means, and what the cells' scatter says of variability.
  std::array<float, kMaxMeasuredNear> noise_m2;
  std::array<float, kMaxMeasuredNear> apart;  // h_k^1.5
  double excess = 0.0;
  double stated_m2 = 0.0;
  double freedom = 0.0;
  std::uint32_t oldest_s = std::numeric_limits<std::uint32_t>::max();
  for (std::size_t k = 0; k < count; ++k) {
    const Evidence& evidence = near[k].evidence;
    const double n = evidence.count;
    noise_m2[k] = 1.0f / evidence.weight;
    excess += (evidence.scatter - (n - 1.0)) * n * noise_m2[k];
    stated_m2 += (n - 1.0) * n * noise_m2[k];
    freedom += n - 1.0;
    oldest_s = std::min(oldest_s, evidence.time_s);
    apart[k] = Power(near[k].north, near[k].east);
  }
  // What chance alone may bring about is not taken for variability.
  const double scatter_m2 =
      freedom > 0.0 ? (excess - stated_m2 * std::sqrt(2.0 / freedom)) / freedom
                    : 0.0;

  // R from the pairs, the stated noise taken off.
  std::array<std::array<float, kMaxMeasuredNear>, kMaxMeasuredNear> between;
  float rough_sum = 0.0f;
  float noise_sum = 0.0f;
  for (std::size_t a = 0; a < count; ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      between[a][b] =
          Power(near[a].north - near[b].north, near[a].east - near[b].east);
      const float per = 1.0f / between[a][b];
      const float step_m = near[a].evidence.mean_m - near[b].evidence.mean_m;
      const float noise = noise_m2[a] + noise_m2[b];
      rough_sum += (step_m * step_m - noise) * per;
      noise_sum += noise * per;
    }
  }
  const double typical_m = kTypicalSlope * cell_size_m;
  double rough_m2 = typical_m * typical_m;
  if (count > 1) {
    // Pairs share their ends: `count` cells hold count - 1 steps.
    const double steps = static_cast<double>(count) - 1.0;
    const double pairs = 0.5 * static_cast<double>(count) * steps;
    // Not below a part of what the noise could hide.
    const double hidden = 0.15 * std::sqrt(2.0 / steps) * noise_sum / pairs;
    const double by_pairs = std::max(hidden, rough_sum / pairs);
    const double guess = std::min(rough_m2, kMostTypical * by_pairs + kMinStdM);
    rough_m2 =
        (steps * by_pairs + kTypicalPairs * guess) / (steps + kTypicalPairs);
    rough_m2 *= 1.0 + kFewPairs / (steps * steps);
  }

  const double variability_m2 =
      std::max(scatter_m2, kInsideUnitSquare * rough_m2);
  for (std::size_t k = 0; k < count; ++k) {
    noise_m2[k] += static_cast<float>(variability_m2) /
                   static_cast<float>(near[k].evidence.count);
  }
  const auto rough = static_cast<float>(rough_m2);
  std::array<float, kMaxMeasuredNear> weight;
  float weight_sum = 0.0f;
  for (std::size_t k = 0; k < count; ++k) {
    weight[k] = 1.0f / (noise_m2[k] + rough * apart[k]);
    weight_sum += weight[k];
  }
  double mean_m = 0.0;
  float error_m2 = 0.0f;
  for (std::size_t k = 0; k < count; ++k) {
    weight[k] /= weight_sum;
    mean_m += double{weight[k]} * double{near[k].evidence.mean_m};
    float others = 0.0f;
    for (std::size_t b = 0; b < k; ++b) others += weight[b] * between[k][b];
    error_m2 +=
        weight[k] * (rough * (apart[k] - others) + weight[k] * noise_m2[k]);
  }
  const double variance_m2 =
      (std::max(double{error_m2}, 0.0) + variability_m2) / scale;
  return DepthEstimate{
      .depth_m = static_cast<float>(mean_m),
      .std_m = std::max(kMinStdM, static_cast<float>(std::sqrt(variance_m2))),
      .kind = EvidenceKind::kSmoothed,
      .time_s = oldest_s,
      .cell_size_m = static_cast<float>(cell_size_m),
      .variability_m = static_cast<float>(std::sqrt(variability_m2))};
}

}  // namespace fathom::map
