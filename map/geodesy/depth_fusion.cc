#include "map/geodesy/depth_fusion.h"

#include <algorithm>

namespace fathom::map {

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

}  // namespace fathom::map
