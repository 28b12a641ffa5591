#include "map/local/hazard.h"

#include <cmath>
#include <limits>

namespace fathom::map {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

// How much of the surroundings' tau is taken for the cell's own slope. A plane
// reaches 1.73 tau along an axis; less, because an answer is FREE from 1.645
// std upward, and what was sounded there must not be.
constexpr double kSlopeShare = 1.3;

// The normal quantile of 1 - 0.01 / n: within 0.03 for n from 2 to 1000.
double LeastOfNormals(double n) {
  return std::sqrt(2.0 * std::log(50.0 * n)) - 0.45;
}

}  // namespace

bool Confirms(const PendingShoal& pending, float depth_m, float std_m) {
  constexpr float kSameShoalM = 2.0f;
  const float noise_m = 3.0f * std::hypot(pending.std_m, std_m);
  return IsCredible(depth_m, std_m) &&
         std::fabs(depth_m - pending.depth_m) <= std::max(kSameShoalM, noise_m);
}

float HazardDepth(const Evidence& evidence, double variability_m2) {
  // Nothing credible yet is NaN and fails here too.
  if (!(evidence.shoalest_m <= evidence.mean_m)) return kNone;
  const double n = evidence.count;
  const double stated_m2 = n / double{evidence.weight};
  if (evidence.count <= 2) {
    return evidence.shoalest_m -
           4.0f * static_cast<float>(std::sqrt(stated_m2));
  }
  const double others = n / (n - 1.0);
  // mean' - z_s = (mean - z_s) n / (n - 1).
  const double above_m =
      (double{evidence.mean_m} - double{evidence.shoalest_m}) * others;
  // LeastOfNormals is never below 2.5: most cells need no logarithm.
  if (above_m * above_m <= 6.25 * stated_m2 * others) return kNone;
  const double bound = LeastOfNormals(n);
  const double explained_m2 =
      (bound * bound * stated_m2 + kSlopeShare * kSlopeShare * variability_m2) *
      others;
  if (above_m * above_m <= explained_m2) return kNone;
  return evidence.shoalest_m - 4.0f * static_cast<float>(std::sqrt(stated_m2));
}

}  // namespace fathom::map
