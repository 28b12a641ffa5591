#include "map/global/conglomerate.h"

#include <algorithm>
#include <cmath>

#include "map/global/fuse.h"

namespace fathom::map {
namespace {

// The smallest code that stands for at least `distance_m`; 256 if none does.
int ResidualCodeFor(double distance_m, float tolerance_m) {
  int code = static_cast<int>(
      std::min(256.0, std::ceil(distance_m * 255.0 / tolerance_m)));
  // Rounding of the division, of either sign.
  while (code > 0 && code <= 255 &&
         DecodeResidualM(static_cast<std::uint8_t>(code - 1), tolerance_m) >=
             distance_m) {
    --code;
  }
  while (code <= 255 && DecodeResidualM(static_cast<std::uint8_t>(code),
                                        tolerance_m) < distance_m) {
    ++code;
  }
  return code;
}

// The depth from which upward the leaf's answers are FREE.
double FreeAboveM(const Leaf& leaf) {
  return leaf.depth_m - kFreeSigmas * leaf.std_m();
}

std::optional<Leaf> JoinByRange(const std::array<Leaf, 4>& four,
                                float tolerance_m) {
  double low = four[0].depth_m;
  double high = four[0].depth_m;
  double free_above_m = low;
  for (const Leaf& leaf : four) {
    const double residual_m = DecodeResidualM(leaf.residual_code, tolerance_m);
    low = std::min(low, leaf.depth_m - residual_m);
    high = std::max(high, leaf.depth_m + residual_m);
    free_above_m = std::min(free_above_m, FreeAboveM(leaf) - residual_m);
  }
  Leaf joined;
  joined.depth_m = static_cast<float>(0.5 * (low + high));
  int code = ResidualCodeFor(
      std::max(high - joined.depth_m, joined.depth_m - low), tolerance_m);
  if (code > 255) return std::nullopt;
  CellEvidence moments;
  for (const Leaf& leaf : four) {
    const CellEvidence part = EvidenceOf(leaf);
    const double offset_m = leaf.depth_m - joined.depth_m;
    // Where a part's mean lies is not known any more: that is no variability
    // inside it.
    moments.variance_m2 += 0.25 * (part.variance_m2 + offset_m * offset_m);
    moments.variability_m2 += 0.25 * part.variability_m2;
    joined.hazard_m = std::min(joined.hazard_m, leaf.hazard_m);
  }
  const Leaf coded = MakeLeaf(four[0].kind(), moments);
  joined.std_code = coded.std_code;
  joined.spread_code = coded.spread_code;
  // Nor may answers be FREE deeper than that: a part of a large std beside
  // surer ones is a shoal that their common std would not tell of.
  const double deeper_m = FreeAboveM(joined) - free_above_m;
  if (deeper_m >
      DecodeResidualM(static_cast<std::uint8_t>(code), tolerance_m)) {
    code = ResidualCodeFor(deeper_m, tolerance_m);
  }
  if (code > 255) return std::nullopt;
  joined.residual_code = static_cast<std::uint8_t>(code);
  return joined;
}

std::optional<Leaf> JoinPairwise(const std::array<Leaf, 4>& four,
                                 float tolerance_m) {
  double mean_m = 0;
  double std_m = 0;
  int residual = 0;
  float hazard_m = kNoHazard;
  for (const Leaf& leaf : four) {
    for (const Leaf& other : four) {
      if (std::abs(leaf.depth_m - other.depth_m) > tolerance_m) {
        return std::nullopt;
      }
    }
    mean_m += leaf.depth_m / 4.0;
    std_m += leaf.std_m() / 4.0;
  }
  // Kept as far as the code reaches: this rule promises no bound.
  for (const Leaf& leaf : four) {
    hazard_m = std::min(hazard_m, leaf.hazard_m);
    residual = std::max(
        residual,
        leaf.residual_code +
            ResidualCodeFor(std::abs(leaf.depth_m - mean_m), tolerance_m));
  }
  return Leaf{
      .depth_m = static_cast<float>(mean_m),
      .std_code = MakeStdCode(four[0].kind(), static_cast<float>(std_m)),
      .residual_code = static_cast<std::uint8_t>(std::min(residual, 255)),
      .hazard_m = hazard_m};
}

class Conglomerator {
 public:
  Conglomerator(WorkTree& tree, MergeRule rule,
                std::span<const LatticeBox> kept)
      : tree_(tree), rule_(rule), kept_(kept) {}

  // True if the tile has become a single leaf, which then is open.
  bool Visit(WorkNode& node) {
    const TileKey key = node.key();
    const bool free = !IsKept(key.Root());
    // A tile that touches a kept area may have more to join when that is free.
    const bool settles = rule_ == MergeRule::kRange && free;
    if (rule_ == MergeRule::kRange &&
        (node.work != nullptr ? node.work->settled : node.frozen->settled())) {
      return false;
    }
    const bool was_frozen = node.work == nullptr;
    WorkTile& tile = tree_.Open(node);
    for (std::uint32_t start = 0; start < kTileCells;) {
      const std::uint32_t span = SpanOf(tile.levels[start]);
      if (tile.leaves[start].std_code == kChildCode) {
        WorkNode& child = tile.ChildAt(start);
        if (Visit(child)) {
          const Leaf leaf = child.work->leaves[0];
          tree_.Discard(child);
          tile.RemoveChild(start, leaf);
        }
      }
      start += span;
    }
    for (int level = kTileLevels - 1; level >= 0; --level) {
      JoinLevel(tile, level, free);
    }
    tile.settled = settles;
    const bool single = tile.levels[0] == 0 && tile.key.level > 0;
    if (was_frozen && !single) tree_.FreezeNode(node);
    return single;
  }

  std::uint64_t merges() const { return merges_; }

 private:
  // Joins, in one tile, the leaves of `level` + 1 that can be joined.
  void JoinLevel(WorkTile& tile, int level, bool free) {
    const std::uint32_t span = SpanOf(level);
    const std::uint32_t part = span / 4;
    for (std::uint32_t start = 0; start < kTileCells; start += span) {
      std::array<Leaf, 4> four;
      bool all_leaves = true;
      for (std::uint32_t i = 0; i < 4; ++i) {
        four[i] = tile.leaves[start + i * part];
        all_leaves = all_leaves && tile.levels[start + i * part] == level + 1 &&
                     four[i].std_code != kChildCode;
      }
      if (!all_leaves) continue;
      if (!free && IsKept(CellInTile(tile.key, start, level))) continue;
      if (const auto joined = JoinFour(four, rule_, tree_.tolerance_m())) {
        tile.Merge(start, level, *joined);
        ++merges_;
      }
    }
  }

  bool IsKept(const CellKey& cell) const {
    const int up = kMaxLevel - cell.level;
    const std::uint32_t last = (std::uint32_t{1} << up) - 1;
    const std::uint32_t row = cell.row << up;
    const std::uint32_t col = cell.col << up;
    return std::any_of(kept_.begin(), kept_.end(), [&](const LatticeBox& box) {
      return row <= box.row_last && row + last >= box.row_first &&
             col <= box.col_last && col + last >= box.col_first;
    });
  }

  WorkTree& tree_;
  const MergeRule rule_;
  const std::span<const LatticeBox> kept_;
  std::uint64_t merges_ = 0;
};

}  // namespace

std::optional<Leaf> JoinFour(const std::array<Leaf, 4>& four, MergeRule rule,
                             float tolerance_m) {
  std::uint32_t oldest_s = four[0].time_s;
  for (const Leaf& leaf : four) {
    if (leaf.kind() != four[0].kind()) return std::nullopt;
    // A hazard does not spread over a place where it is not.
    if (leaf.has_hazard() != four[0].has_hazard()) return std::nullopt;
    oldest_s = std::min(oldest_s, leaf.time_s);
  }
  if (!four[0].known()) return Leaf{};
  std::optional<Leaf> joined = rule == MergeRule::kRange
                                   ? JoinByRange(four, tolerance_m)
                                   : JoinPairwise(four, tolerance_m);
  // The oldest: an answer must not look fresher than a part of it is.
  if (joined) joined->time_s = oldest_s;
  return joined;
}

std::uint64_t ConglomerateTree(WorkTree& tree, MergeRule rule,
                               std::span<const LatticeBox> kept) {
  Conglomerator conglomerator(tree, rule, kept);
  conglomerator.Visit(tree.root());
  tree.CountMerges(conglomerator.merges());
  return conglomerator.merges();
}

}  // namespace fathom::map
