// GlobalMap::MergeMap: another mission's map into this one.

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

#include "map/global/area_writer.h"
#include "map/global/global_map.h"

namespace fathom::map {
namespace {

// Mean radius of the Earth, for margins alone.
constexpr double kEarthRadiusM = 6.371e6;

// What the other map knows in a cell of ours.
class OtherMapRule final : public CellRule {
 public:
  OtherMapRule(const GlobalMapView& other, const RootSquare& root,
               bool same_square, float tolerance_m,
               const GlobalMap::MapMergeOptions& options)
      : other_(other), options_(options) {
    for (int level = 0; level <= other.root().max_level(); ++level) {
      // Ours that a leaf of theirs of this level would have; in the same
      // square also beyond our finest.
      levels_[static_cast<std::size_t>(level)] =
          same_square ? level : root.LevelFor(other.root().cell_size_m(level));
    }
    residual_scale_ = other.tolerance_m() / tolerance_m;
  }

  // Our level that matches theirs.
  int LevelOf(int other_level) const {
    return levels_[static_cast<std::size_t>(other_level)];
  }

  // The level of the cells that are asked for from here on.
  void SetLevel(int level) { level_ = level; }

  std::optional<CellEvidence> Sample(
      const SquarePoint& /*center*/, std::span<const Vector3> row_planes,
      std::span<const Vector3> col_planes) override {
    residual_code_ = 0;
    EvidenceSum measured;
    EvidenceSum charted;
    bool land = false;
    for (const Vector3& row : row_planes) {
      for (const Vector3& col : col_planes) {
        const auto found =
            other_.LeafAt(ToGeodetic(RootSquare::Meet(row, col)));
        if (!found || !found->second.known()) continue;
        const auto& [cell, leaf] = *found;
        residual_code_ = std::max(residual_code_, Residual(leaf));
        if (leaf.kind() == LeafKind::kLand) {
          land = true;
          charted.Add({.time_s = leaf.time_s, .land = true});
        } else {
          (IsMeasured(leaf) ? measured : charted)
              .Add(DividedEvidence(Aged(leaf), level_ - LevelOf(cell.level)));
        }
      }
    }
    if (measured.empty() && charted.empty()) return std::nullopt;
    kind_ = measured.empty() ? LeafKind::kPrior : LeafKind::kMeasured;
    // Any land makes a charted cell land, as in ImportRaster.
    CellEvidence evidence = (measured.empty() ? charted : measured).Join(0.0);
    if (evidence.land) {
      kind_ = LeafKind::kLand;
    } else if (land) {
      // A shore in a measured cell must not be averaged away.
      evidence.hazard_m = std::min(evidence.hazard_m, kLandDepthM);
    }
    return evidence;
  }

  bool MayDivide(const Leaf& leaf) const override {
    switch (kind_) {
      case LeafKind::kMeasured:
        return true;
      case LeafKind::kLand:
        return !leaf.known() || leaf.kind() == LeafKind::kPrior;
      default:
        return !leaf.known();
    }
  }

  bool Apply(const CellEvidence& evidence, Leaf& leaf) const override {
    if (!MayDivide(leaf)) return false;
    if (leaf.kind() == LeafKind::kMeasured ||
        (leaf.kind() == LeafKind::kPrior && kind_ == LeafKind::kMeasured)) {
      FuseLeaf(evidence, LeafKind::kMeasured, leaf);
      return true;
    }
    leaf = MakeLeaf(kind_, evidence);
    if (!evidence.land) leaf.residual_code = residual_code_;
    return true;
  }

 private:
  bool IsMeasured(const Leaf& leaf) const {
    return leaf.kind() == LeafKind::kMeasured && !options_.as_chart;
  }

  // What the leaf says, widened by what its age adds.
  CellEvidence Aged(const Leaf& leaf) const {
    CellEvidence evidence = EvidenceOf(leaf);
    const std::uint32_t from_s =
        leaf.time_s != 0 ? leaf.time_s : options_.unknown_time_s;
    if (from_s < options_.now_s) {
      evidence.variance_m2 +=
          options_.widening_m2_s * (options_.now_s - from_s);
    }
    return evidence;
  }

  // The leaf's residual in steps of our tolerance.
  std::uint8_t Residual(const Leaf& leaf) const {
    return static_cast<std::uint8_t>(
        std::min(255.0, std::ceil(leaf.residual_code * residual_scale_)));
  }

  const GlobalMapView& other_;
  const GlobalMap::MapMergeOptions& options_;
  std::array<int, kMaxLevel + 1> levels_{};
  double residual_scale_ = 1;
  int level_ = 0;
  LeafKind kind_ = LeafKind::kUnknown;
  std::uint8_t residual_code_ = 0;
};

// Descends our cells as far as the other map's leaves are finer.
class MapMerger {
 public:
  MapMerger(const RootSquare& root, WorkTree& tree, const GlobalMapView& other,
            const GlobalMap::MapMergeOptions& options)
      : root_(root),
        tree_(tree),
        other_(other),
        same_square_(root.south_west() == other.root().south_west() &&
                     root.north_west() == other.root().north_west()),
        rule_(other, root, same_square_, tree.tolerance_m(), options) {}

  void Merge(const CellKey& cell) {
    const std::optional<LatticeBox> box = BoxOf(cell);
    if (!box) return;
    int finest = -1;
    other_.ForEachLeafIn(*box, [&](const CellKey& theirs, const Leaf& leaf) {
      if (leaf.known()) finest = std::max(finest, int{theirs.level});
    });
    if (finest < 0) return;
    if (cell.level < std::min(rule_.LevelOf(finest), root_.max_level())) {
      for (std::uint32_t child = 0; child < 4; ++child) {
        Merge({.level = static_cast<std::uint8_t>(cell.level + 1),
               .row = 2 * cell.row + (child >> 1),
               .col = 2 * cell.col + (child & 1)});
      }
      return;
    }
    Write(cell, SamplesPerSide(cell.level, finest));
  }

  AreaCounts Finish() {
    AreaCounts sum;
    for (auto& [key, writer] : writers_) {
      rule_.SetLevel(key.first);
      const AreaCounts counts = writer.Finish();
      sum.written += counts.written;
      sum.degraded += counts.degraded;
      sum.refused += counts.refused;
    }
    return sum;
  }

 private:
  // Where the cell lies in the other map, a little more rather than less.
  std::optional<LatticeBox> BoxOf(const CellKey& cell) const {
    if (same_square_) {
      const int up = kMaxLevel - cell.level;
      return LatticeBox{.row_first = cell.row << up,
                        .row_last = ((cell.row + 1) << up) - 1,
                        .col_first = cell.col << up,
                        .col_last = ((cell.col + 1) << up) - 1};
    }
    SquarePoint low{.u = 1, .v = 1};
    SquarePoint high{.u = 0, .v = 0};
    for (const GeodeticPoint& corner : root_.Corners(cell)) {
      const std::optional<SquarePoint> place = other_.root().Project(corner);
      // Behind the Earth's limb as they see it: the cell is vast.
      if (!place) return Box({.u = 0, .v = 0}, {.u = 1, .v = 1});
      low = {.u = std::min(low.u, place->u), .v = std::min(low.v, place->v)};
      high = {.u = std::max(high.u, place->u), .v = std::max(high.v, place->v)};
    }
    // A side of length s leaves the chord between its ends by s^2 / 8 R.
    const double bulge = root_.cell_size_m(cell.level) / kEarthRadiusM;
    const double margin_u = bulge * (high.u - low.u);
    const double margin_v = bulge * (high.v - low.v);
    return Box({.u = low.u - margin_u, .v = low.v - margin_v},
               {.u = high.u + margin_u, .v = high.v + margin_v});
  }

  static std::optional<LatticeBox> Box(const SquarePoint& low,
                                       const SquarePoint& high) {
    if (high.u < 0 || high.v < 0 || low.u > 1 || low.v > 1) {
      return std::nullopt;
    }
    constexpr double kCells = 1 << kMaxLevel;
    const auto index = [](double fraction) {
      return static_cast<std::uint32_t>(
          std::clamp(fraction * kCells, 0.0, kCells - 1));
    };
    return LatticeBox{.row_first = index(low.u),
                      .row_last = index(high.u),
                      .col_first = index(low.v),
                      .col_last = index(high.v)};
  }

  // So many that every leaf of theirs that is no smaller than `finest` is met
  // in one of our cells. Cells of the same square lie in one another; else two
  // a side of their smallest leaf, turned by any angle, leave none out.
  int SamplesPerSide(int level, int finest) const {
    const double ratio =
        root_.cell_size_m(level) / other_.root().cell_size_m(finest);
    const double wanted =
        same_square_ ? std::round(ratio) : std::ceil(2 * ratio);
    return static_cast<int>(
        std::clamp(wanted, 1.0, double{GlobalMap::kMaxSamplesPerSide}));
  }

  void Write(const CellKey& cell, int samples) {
    const auto writer = writers_
                            .try_emplace({int{cell.level}, samples}, root_,
                                         tree_, int{cell.level}, samples, rule_)
                            .first;
    rule_.SetLevel(cell.level);
    writer->second.WriteRange({.row_begin = cell.row,
                               .row_last = cell.row,
                               .col_begin = cell.col,
                               .col_last = cell.col});
  }

  const RootSquare& root_;
  WorkTree& tree_;
  const GlobalMapView& other_;
  const bool same_square_;
  OtherMapRule rule_;
  // By level and samples a side.
  std::map<std::pair<int, int>, AreaWriter> writers_;
};

}  // namespace

GlobalMap::WriteSummary GlobalMap::MergeMap(const GlobalMapView& other,
                                            const MapMergeOptions& options) {
  if (other.known_leaf_count() == 0) return {};
  MapMerger merger(options_.root, *tree_, other, options);
  merger.Merge(CellKey{});
  const AreaCounts counts = merger.Finish();
  return {.leaves_written = counts.written,
          .degraded = counts.degraded,
          .kept_measured = counts.refused,
          .ignored = 0};
}

}  // namespace fathom::map
