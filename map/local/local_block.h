// A square of 16 x 16 cells: the piece in which a local map is allocated,
// copied on write and stored.
//
// Plain data: the storage codec writes each field as it is and reading it back
// gives the same map, bit for bit. A block exists from the first time one of
// its cells is touched; until then its area costs nothing.
//
// Cell k of a block is (k / 16 cells north, k % 16 cells east) of the block's
// south-west corner. Cells beyond the map's north or east border exist in the
// last blocks and are never touched.

#ifndef FATHOM_MAP_LOCAL_LOCAL_BLOCK_H_
#define FATHOM_MAP_LOCAL_LOCAL_BLOCK_H_

#include <algorithm>
#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "map/geodesy/depth_estimate.h"
#include "map/local/estimator.h"
#include "map/local/evidence.h"
#include "map/local/evidence_cells.h"
#include "map/local/hazard.h"

namespace fathom::map {

// A block of the map: counted northward and eastward from the south-west.
struct BlockIndex {
  std::uint32_t row = 0;  // North.
  std::uint32_t col = 0;  // East.

  friend bool operator==(const BlockIndex&, const BlockIndex&) = default;
  friend auto operator<=>(const BlockIndex&, const BlockIndex&) = default;
};

// What was believed of one cell before this activity measured it.
// kind kNone: nothing; kLand: dry, the numbers mean nothing.
struct CellPrior {
  float depth_m = 0.0f;
  float std_m = 0.0f;
  EvidenceKind kind = EvidenceKind::kNone;
  // A point hazard that was known before (DepthEstimate::hazard_m): not to be
  // lost because this activity has not hit it yet. Infinite: none.
  float hazard_m = std::numeric_limits<float>::infinity();

  friend bool operator==(const CellPrior&, const CellPrior&) = default;
};

// The priors of a block cell by cell, where they differ.
struct PriorGrid {
  std::array<float, kBlockCells> depth_m = {};
  std::array<float, kBlockCells> std_m = {};
  std::array<EvidenceKind, kBlockCells> kind = {};
  // Empty where all are infinite; else 256.
  std::vector<float> hazard_m;

  friend bool operator==(const PriorGrid&, const PriorGrid&) = default;
};

// `nervegna` only: the estimate itself, prior and smoothing fused in.
struct NervegnaCell {
  float mean_m = 0.0f;
  // Infinite: nothing is known of the cell (no prior, nothing written).
  float variance_m2 = 0.0f;

  friend bool operator==(const NervegnaCell&, const NervegnaCell&) = default;
};

struct LocalBlock {
  // What soundings say. All estimators fill it. Touched are the cells that were
  // measured and, with `nervegna`, those that smoothing wrote to: the flags of
  // fig. 4-4. Readers use all of a cell's evidence, so a transfer changes no
  // answer of this map; the next transfer moves what is fresh alone.
  EvidenceCells evidence;

  // Asked for once, when the block was first touched, and kept with it: so a
  // replay gives the same map whatever the global map has become.
  CellPrior uniform_prior;  // Of every cell, when prior_grid is null.
  // Never changed once made, and so shared by all copies of the block.
  std::shared_ptr<const PriorGrid> prior_grid;

  // `nervegna`: 256 cells; other estimators: empty.
  std::vector<NervegnaCell> nervegna;

  // `adaptive` only: soundings that wait for a second one (map/local/hazard.h),
  // at most one a cell, in order of cell. Nearly always empty.
  std::vector<PendingShoal> pending;

  CellPrior prior(std::size_t k) const {
    if (prior_grid == nullptr) return uniform_prior;
    CellPrior here = {.depth_m = prior_grid->depth_m[k],
                      .std_m = prior_grid->std_m[k],
                      .kind = prior_grid->kind[k]};
    if (!prior_grid->hazard_m.empty()) here.hazard_m = prior_grid->hazard_m[k];
    return here;
  }
  // Null: none waits in the cell.
  const PendingShoal* PendingAt(std::size_t k) const {
    if (pending.empty()) return nullptr;
    const auto found = std::find_if(
        pending.begin(), pending.end(),
        [k](const PendingShoal& shoal) { return shoal.cell == k; });
    return found == pending.end() ? nullptr : &*found;
  }
  bool measured(std::size_t k) const { return evidence.measured(k); }
};

// Whether a map of this estimator can hold such a block: its arrays fit, the
// evidence is of soundings that the map takes, priors are finite. A reader
// reckons without looking again.
// Errors: INVALID_ARGUMENT with the first cell that is not so.
absl::Status ValidateBlock(const LocalBlock& block, EstimatorKind estimator);

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_LOCAL_BLOCK_H_
