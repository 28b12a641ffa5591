#include "map/local/local_block.h"

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "map/local/evidence.h"
#include "map/local/evidence_cells.h"
#include "map/local/hazard.h"
#include "map/local/local_map_options.h"

namespace fathom::map {
namespace {

// What rounding adds to a mean at the end of the range.
constexpr float kDepthSlackM = 1.0f;
// Weights of kMaxCount soundings of least and of most stated std, with room
// for the halving at kMaxCount.
constexpr float kLeastWeight = 0.25f / (kMaxStdM * kMaxStdM);
constexpr float kMostWeight =
    2.0f * static_cast<float>(kMaxCount) / (kMinStdM * kMinStdM);
// A prior may come from a chart and from joined and aged evidence: no more is
// asked of it than that a reader can reckon with it.
constexpr float kMostPriorDepthM = 1e5f;
constexpr float kMostPriorStdM = 1e6f;

// False for a NaN, as every comparison here.
bool IsDepth(float depth_m) {
  return depth_m >= kMinDepthM - kDepthSlackM &&
         depth_m <= kMaxDepthM + kDepthSlackM;
}

// Soundings within the range scatter no wider than it.
bool IsSound(const PackedEvidence& cell) {
  if (CountOf(cell) == 0) {
    return cell.weight == 0.0f && cell.scatter == 0.0f && cell.mean_m == 0.0f;
  }
  constexpr float kRangeM = kMaxDepthM - kMinDepthM;
  return IsDepth(cell.mean_m) && cell.weight >= kLeastWeight &&
         cell.weight <= kMostWeight &&
         std::abs(cell.scatter) <= kRangeM * kRangeM * cell.weight;
}

bool IsPriorDepth(float depth_m) {
  return std::abs(depth_m) <= kMostPriorDepthM;
}

bool IsSound(const CellPrior& prior) {
  if (prior.kind == EvidenceKind::kNone || prior.kind == EvidenceKind::kLand) {
    return true;
  }
  return IsPriorDepth(prior.depth_m) && prior.std_m > 0.0f &&
         prior.std_m <= kMostPriorStdM &&
         (IsPriorDepth(prior.hazard_m) ||
          prior.hazard_m == CellPrior{}.hazard_m);
}

// The prior is fused in.
bool IsSound(const NervegnaCell& cell) {
  return cell.variance_m2 >= 0.0f && IsPriorDepth(cell.mean_m);
}

bool IsSound(const PendingShoal& shoal) {
  return IsDepth(shoal.depth_m) && shoal.std_m > 0.0f &&
         shoal.std_m <= kMaxStdM;
}

// Measured is where soundings were counted, and nowhere else.
bool IsSoundAt(const LocalBlock& block, std::size_t k) {
  const PackedEvidence* const fresh = block.evidence.Find(k);
  const PackedEvidence* const moved = block.evidence.FindTransferred(k);
  const bool counted = (fresh != nullptr && CountOf(*fresh) > 0) ||
                       (moved != nullptr && CountOf(*moved) > 0);
  return block.measured(k) == counted &&
         (fresh == nullptr || IsSound(*fresh)) &&
         (moved == nullptr || IsSound(*moved)) && IsSound(block.prior(k)) &&
         (block.nervegna.empty() || IsSound(block.nervegna[k]));
}

}  // namespace

absl::Status ValidateBlock(const LocalBlock& block, EstimatorKind estimator) {
  const std::size_t nervegna_cells =
      estimator == EstimatorKind::kNervegna ? kBlockCells : 0;
  if (block.nervegna.size() != nervegna_cells) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "nervegna cells=%u must be %u", block.nervegna.size(), nervegna_cells));
  }
  for (std::size_t k = 0; k < kBlockCells; ++k) {
    if (!IsSoundAt(block, k)) {
      return absl::InvalidArgumentError(
          absl::StrFormat("cell %u holds numbers that no sounding leaves", k));
    }
  }
  if (estimator != EstimatorKind::kAdaptive && !block.pending.empty()) {
    return absl::InvalidArgumentError("soundings wait only under adaptive");
  }
  for (std::size_t n = 0; n < block.pending.size(); ++n) {
    const std::uint16_t cell = block.pending[n].cell;
    if (cell >= kBlockCells || (n > 0 && cell <= block.pending[n - 1].cell)) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "pending[%u].cell=%u must be below 256 and in order", n, cell));
    }
    if (!IsSound(block.pending[n])) {
      return absl::InvalidArgumentError(
          absl::StrFormat("pending[%u] depth_m=%g std_m=%g is no sounding", n,
                          block.pending[n].depth_m, block.pending[n].std_m));
    }
  }
  return absl::OkStatus();
}

}  // namespace fathom::map
