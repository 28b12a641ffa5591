#include "map/global/fuse.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "map/geodesy/depth_fusion.h"

namespace fathom::map {
namespace {

// Distances up to this many sigma are taken for chance.
constexpr double kChanceSigmas = 2.0;

// A little less than kFreeSigmas, so that a rounded std does not matter.
constexpr double kNotFreeSigmas = 1.6;

// The depth from which downward an answer from this alone is not FREE; at the
// least what a leaf may hold, far above every vehicle.
float NotFreeFrom(const CellEvidence& part) {
  return std::max(
      kMinChartDepthM,
      static_cast<float>(
          part.mean_m -
          kFreeSigmas * std::sqrt(part.variance_m2 + part.variability_m2)));
}

// Where the hazard of the shoalest of n parts begins; kNoHazard if the joined
// normal tells of it. `between_m2`: the variance of the parts' means.
float HazardOfPart(const CellEvidence& part, double joined_mean_m,
                   double between_m2, double n) {
  const double above_m = joined_mean_m - part.mean_m;
  const double told_m2 = kNotFreeSigmas * kNotFreeSigmas * between_m2;
  // LeastOfNormals is never below 2.5 for two and more: most need no logarithm.
  if (above_m * above_m <= 6.25 * part.variance_m2 + told_m2) return kNoHazard;
  const double bound = LeastOfNormals(n);
  if (above_m * above_m <= bound * bound * part.variance_m2 + told_m2) {
    return kNoHazard;
  }
  return NotFreeFrom(part);
}

// The codes of a mean's variance and a variability.
void PutVariances(LeafKind kind, const CellEvidence& evidence, Leaf& leaf) {
  double mean_std_m = std::sqrt(evidence.variance_m2);
  leaf.spread_code = 0;
  if (evidence.variability_m2 > 0) {
    const double std_m =
        std::sqrt(evidence.variance_m2 + evidence.variability_m2);
    // More spread than the code can tell, or a mean surer than it can: the
    // predictive std is kept and the mean is less sure.
    mean_std_m =
        std::clamp(mean_std_m, double{kMinLeafStdM}, double{kMaxLeafStdM});
    mean_std_m = std::max(mean_std_m, std_m / kSpreadRatios.back());
    leaf.std_code = MakeStdCode(kind, static_cast<float>(mean_std_m));
    leaf.spread_code = EncodeSpread(std_m / leaf.mean_std_m());
    return;
  }
  leaf.std_code = MakeStdCode(kind, static_cast<float>(mean_std_m));
}

}  // namespace

void EvidenceSum::Add(const CellEvidence& evidence) {
  time_s_ = std::max(time_s_, evidence.time_s);
  if (evidence.land) {
    ++land_count_;
    return;
  }
  if (count_ == 0) origin_m_ = evidence.mean_m;
  if (count_ == 0 || evidence.mean_m < shoalest_.mean_m) shoalest_ = evidence;
  const double offset = evidence.mean_m - origin_m_;
  ++count_;
  sum_ += offset;
  sum_squares_ += offset * offset;
  sum_variances_ += evidence.variance_m2;
  sum_variabilities_ += evidence.variability_m2;
  soundings_ += evidence.soundings;
  hazard_m_ = std::min(hazard_m_, evidence.hazard_m);
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
  joined.variance_m2 = sum_variances_ / n;
  const double between_m2 = std::max(0.0, sum_squares_ / n - offset * offset);
  joined.variability_m2 = sum_variabilities_ / n + between_m2;
  joined.soundings =
      static_cast<std::uint32_t>(std::min<std::uint64_t>(soundings_, 0xffff));
  joined.hazard_m = std::min(
      hazard_m_, HazardOfPart(shoalest_, joined.mean_m, between_m2, n));
  return joined;
}

CellEvidence EvidenceSum::Shoalest() const {
  CellEvidence part = shoalest_;
  part.hazard_m = hazard_m_;
  return part;
}

CellEvidence FuseEvidence(const CellEvidence& one, const CellEvidence& other) {
  // One order of the two, whichever came first.
  const auto rank = [](const CellEvidence& e) {
    return std::tie(e.mean_m, e.variance_m2, e.variability_m2);
  };
  const bool swapped = rank(other) < rank(one);
  const CellEvidence& a = swapped ? other : one;
  const CellEvidence& b = swapped ? one : other;
  CellEvidence fused;
  const double k = Gain(a.variance_m2, b.variance_m2);
  const double apart_m = b.mean_m - a.mean_m;
  const double chance_m2 =
      kChanceSigmas * kChanceSigmas * (a.variance_m2 + b.variance_m2);
  fused.mean_m = CorrectMean(k, a.mean_m, b.mean_m);
  fused.variance_m2 = FuseVarianceKalman(k, a.variance_m2);
  fused.variability_m2 =
      (1 - k) * a.variability_m2 + k * b.variability_m2 +
      k * (1 - k) * std::max(0.0, apart_m * apart_m - chance_m2);
  fused.soundings = a.soundings + b.soundings;
  fused.hazard_m = std::min(a.hazard_m, b.hazard_m);
  fused.time_s = std::max(a.time_s, b.time_s);
  return fused;
}

CellEvidence FuseWithPrior(const CellEvidence& prior,
                           const CellEvidence& evidence) {
  const MeanVariance fused = FusePrior(
      {.mean_m = evidence.mean_m, .variance_m2 = evidence.variance_m2},
      evidence.soundings, prior.mean_m,
      prior.variance_m2 + prior.variability_m2);
  CellEvidence result = evidence;
  result.mean_m = fused.mean_m;
  result.variance_m2 = fused.variance_m2;
  result.hazard_m = std::min(prior.hazard_m, evidence.hazard_m);
  result.time_s = std::max(prior.time_s, evidence.time_s);
  return result;
}

Leaf MakeLeaf(LeafKind kind, const CellEvidence& evidence) {
  if (evidence.land) {
    return {.depth_m = kLandDepthM,
            .time_s = evidence.time_s,
            .std_code = MakeStdCode(LeafKind::kLand, kMinLeafStdM)};
  }
  Leaf leaf{.depth_m = static_cast<float>(evidence.mean_m),
            .time_s = evidence.time_s,
            .hazard_m = evidence.hazard_m};
  PutVariances(kind, evidence, leaf);
  return leaf;
}

CellEvidence EvidenceOf(const Leaf& leaf) {
  const double mean_std_m = leaf.mean_std_m();
  const double variability_m = leaf.variability_m();
  return {.mean_m = leaf.depth_m,
          .variance_m2 = mean_std_m * mean_std_m,
          .variability_m2 = variability_m * variability_m,
          .hazard_m = leaf.hazard_m,
          .time_s = leaf.time_s};
}

void FuseLeaf(const CellEvidence& evidence, LeafKind kind, Leaf& leaf) {
  const CellEvidence held = EvidenceOf(leaf);
  const bool first_measured =
      leaf.kind() == LeafKind::kPrior && kind == LeafKind::kMeasured;
  const double held_m2 =
      held.variance_m2 + (first_measured ? held.variability_m2 : 0);
  const double kept = 1 - Gain(held_m2, evidence.variance_m2);
  const std::uint8_t residual_code = leaf.residual_code;
  leaf = MakeLeaf(
      kind, first_measured
                ? FuseWithPrior(held, evidence)
                : FuseEvidence(held, EvidenceOf(MakeLeaf(kind, evidence))));
  leaf.residual_code =
      static_cast<std::uint8_t>(std::ceil(kept * residual_code));
}

bool AddShoal(const CellEvidence& part, Leaf& leaf) {
  float hazard_m = part.hazard_m;
  if (part.mean_m < leaf.depth_m - kFreeSigmas * leaf.std_m()) {
    hazard_m = std::min(hazard_m, NotFreeFrom(part));
  }
  if (hazard_m >= std::min(leaf.hazard_m, leaf.depth_m)) return false;
  leaf.hazard_m = hazard_m;
  return true;
}

Leaf DividedLeaf(const Leaf& leaf) {
  if (leaf.spread_code == 0 || !leaf.known()) return leaf;
  CellEvidence evidence = EvidenceOf(leaf);
  evidence.variance_m2 += 0.75 * evidence.variability_m2;
  evidence.variability_m2 *= 0.25;
  Leaf part = leaf;
  PutVariances(leaf.kind(), evidence, part);
  return part;
}

CellEvidence DividedEvidence(const CellEvidence& evidence, int levels) {
  if (evidence.variability_m2 == 0 || levels <= 0) return evidence;
  Leaf leaf = MakeLeaf(LeafKind::kMeasured, evidence);
  for (int level = 0; level < levels; ++level) leaf = DividedLeaf(leaf);
  CellEvidence divided = EvidenceOf(leaf);
  divided.soundings = evidence.soundings;
  return divided;
}

}  // namespace fathom::map
