#include "map/global/fuse.h"

#include <algorithm>
#include <cmath>

namespace fathom::map {

void EvidenceSum::Add(const CellEvidence& evidence) {
  time_s_ = std::max(time_s_, evidence.time_s);
  if (evidence.land) {
    ++land_count_;
    return;
  }
  if (count_ == 0) origin_m_ = evidence.mean_m;
  const double offset = evidence.mean_m - origin_m_;
  ++count_;
  sum_ += offset;
  sum_squares_ += offset * offset;
  sum_variances_ += evidence.variance_m2;
}

CellEvidence EvidenceSum::Join(double land_share) const {
  CellEvidence joined;
  joined.time_s = time_s_;
  const double all = static_cast<double>(count_) + land_count_;
  if (count_ == 0 || (land_count_ > 0 && land_count_ >= land_share * all)) {
    joined.land = true;
    return joined;
  }
  const double n = count_;
  const double offset = sum_ / n;
  joined.mean_m = origin_m_ + offset;
  joined.variance_m2 =
      sum_variances_ / n + std::max(0.0, sum_squares_ / n - offset * offset);
  return joined;
}

Leaf MakeLeaf(LeafKind kind, const CellEvidence& evidence) {
  if (evidence.land) {
    return {.depth_m = kLandDepthM,
            .time_s = evidence.time_s,
            .std_code = MakeStdCode(LeafKind::kLand, kMinLeafStdM)};
  }
  return {.depth_m = static_cast<float>(evidence.mean_m),
          .time_s = evidence.time_s,
          .std_code = MakeStdCode(
              kind, static_cast<float>(std::sqrt(evidence.variance_m2)))};
}

void FuseLeaf(const CellEvidence& evidence, LeafKind kind, Leaf& leaf) {
  const double std_m = leaf.std_m();
  const double variance_m2 = std_m * std_m;
  const double gain = variance_m2 / (variance_m2 + evidence.variance_m2);
  const double mean_m = leaf.depth_m + gain * (evidence.mean_m - leaf.depth_m);
  leaf.depth_m = static_cast<float>(mean_m);
  leaf.std_code = MakeStdCode(
      kind, static_cast<float>(std::sqrt((1 - gain) * variance_m2)));
  leaf.time_s = std::max(leaf.time_s, evidence.time_s);
  leaf.residual_code =
      static_cast<std::uint8_t>(std::ceil((1 - gain) * leaf.residual_code));
}

}  // namespace fathom::map
