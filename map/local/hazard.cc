#include "map/local/hazard.h"

#include <cmath>
#include <limits>

#include "map/geodesy/depth_fusion.h"

namespace fathom::map {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

}  // namespace

bool Confirms(const PendingShoal& pending, float depth_m, float std_m) {
  constexpr float kSameShoalM = 2.0f;
  const float noise_m = 3.0f * std::hypot(pending.std_m, std_m);
  return IsCredible(depth_m, std_m) &&
         std::fabs(depth_m - pending.depth_m) <= std::max(kSameShoalM, noise_m);
}

float HazardDepth(const Evidence& evidence) {
  // Nothing credible yet is NaN and fails here too.
  if (!(evidence.shoalest_m <= evidence.mean_m)) return kNone;
  const float n = evidence.count;
  const float stated_m = std::sqrt(n / evidence.weight);
  if (evidence.count > 2) {
    // mean' - z_s = (mean - z_s) n / (n - 1).
    const float above_m =
        (evidence.mean_m - evidence.shoalest_m) * n / (n - 1.0f);
    // LeastOfNormals is never below 2.5: most cells need no logarithm.
    if (above_m <= 2.5f * stated_m) return kNone;
    if (above_m <= static_cast<float>(LeastOfNormals(n)) * stated_m) {
      return kNone;
    }
  }
  return evidence.shoalest_m - kHazardMarginStd * stated_m;
}

}  // namespace fathom::map
