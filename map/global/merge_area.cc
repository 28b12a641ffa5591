// GlobalMap::MergeArea: the transfer of local evidence.

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "map/global/area_writer.h"
#include "map/global/global_map.h"

namespace fathom::map {
namespace {

// A convex quadrilateral in (u, v). Neighbours that share a side, corner for
// corner, divide the plane between them without gap or overlap: which side of
// a line a point is on is computed from the line's ends in a fixed order, so
// both get the same answer, ties too.
class Quadrilateral {
 public:
  explicit Quadrilateral(const std::array<SquarePoint, 4>& corners) {
    double twice_area = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      const SquarePoint& a = corners[i];
      const SquarePoint& b = corners[(i + 1) % 4];
      twice_area += a.v * b.u - b.v * a.u;
    }
    for (std::size_t i = 0; i < 4; ++i) {
      Side& side = sides_[i];
      side.from = corners[i];
      side.to = corners[(i + 1) % 4];
      side.inside = twice_area > 0;
      if (std::tie(side.to.u, side.to.v) < std::tie(side.from.u, side.from.v)) {
        std::swap(side.from, side.to);
        side.inside = !side.inside;
      }
    }
  }

  bool Contains(const SquarePoint& p) const {
    return std::all_of(sides_.begin(), sides_.end(), [&p](const Side& side) {
      const double cross = (side.to.v - side.from.v) * (p.u - side.from.u) -
                           (side.to.u - side.from.u) * (p.v - side.from.v);
      return (cross > 0) == side.inside;
    });
  }

 private:
  struct Side {
    SquarePoint from;  // The end that comes first in order.
    SquarePoint to;
    bool inside = false;  // Whether the inside has cross > 0.
  };
  std::array<Side, 4> sides_;
};

bool HoldsDepth(const Leaf& leaf) {
  return leaf.kind() == LeafKind::kPrior || leaf.kind() == LeafKind::kMeasured;
}

// Measurements of one area, fused with what the leaf holds; or their shoals.
class TransferRule final : public CellRule {
 public:
  TransferRule(const Quadrilateral& area, const GlobalMap::CellSource& source,
               bool shoals_only)
      : area_(area), source_(source), shoals_only_(shoals_only) {}

  std::optional<CellEvidence> Sample(
      const SquarePoint& center, std::span<const Vector3> row_planes,
      std::span<const Vector3> col_planes) override {
    if (!area_.Contains(center)) return std::nullopt;
    if (row_planes.size() == 1) {
      return Ask(ToGeodetic(RootSquare::Meet(row_planes[0], col_planes[0])));
    }
    EvidenceSum sum;
    for (const Vector3& row : row_planes) {
      for (const Vector3& col : col_planes) {
        if (const auto evidence = Ask(ToGeodetic(RootSquare::Meet(row, col)))) {
          sum.Add(*evidence);
        }
      }
    }
    if (sum.empty()) return std::nullopt;
    return shoals_only_ ? sum.Shoalest() : sum.Join(1.0);
  }

  bool MayDivide(const Leaf& leaf) const override {
    return !shoals_only_ || HoldsDepth(leaf);
  }

  bool Apply(const CellEvidence& evidence, Leaf& leaf) const override {
    if (shoals_only_) return HoldsDepth(leaf) && AddShoal(evidence, leaf);
    if (HoldsDepth(leaf)) {
      FuseLeaf(evidence, LeafKind::kMeasured, leaf);
    } else {
      // Unknown; or charted land on which a vehicle found water.
      leaf = MakeLeaf(LeafKind::kMeasured, evidence);
    }
    return true;
  }

  std::uint64_t ignored() const { return ignored_; }

 private:
  std::optional<CellEvidence> Ask(const GeodeticPoint& point) {
    const std::optional<DepthEstimate> answer = source_(point);
    if (!answer) return std::nullopt;
    if (answer->kind != EvidenceKind::kMeasured ||
        !(answer->depth_m >= kMinChartDepthM &&
          answer->depth_m <= kMaxChartDepthM) ||
        !std::isfinite(answer->std_m) || answer->std_m <= 0) {
      ++ignored_;
      return std::nullopt;
    }
    const double std_m = answer->std_m;
    // Written so that NaN is none.
    const double variability_m =
        answer->variability_m > 0
            ? std::min(double{answer->variability_m}, std_m)
            : 0.0;
    CellEvidence evidence{
        .mean_m = answer->depth_m,
        .variance_m2 = std::max(std_m * std_m - variability_m * variability_m,
                                double{kMinLeafStdM} * kMinLeafStdM),
        .variability_m2 = variability_m * variability_m,
        .soundings = answer->soundings,
        .time_s = answer->time_s};
    // NaN fails too; a hazard below the seabed is none.
    if (answer->hazard_m >= kMinChartDepthM &&
        answer->hazard_m < answer->depth_m) {
      evidence.hazard_m = answer->hazard_m;
    }
    return evidence;
  }

  const Quadrilateral& area_;
  const GlobalMap::CellSource& source_;
  const bool shoals_only_;
  std::uint64_t ignored_ = 0;
};

// How close samples must lie to miss no local cell, in a global cell of `ratio`
// local ones: a local cell of side 1 that is turned by t against the grid of
// samples holds one if their distance is at most 1 / (cos t + sin t).
int SamplesPerSide(double ratio, const std::array<SquarePoint, 4>& corners) {
  // A twentieth of a cell more is no reason for four times the samples.
  if (ratio <= 1.05) return 1;
  const double side_u = std::abs(corners[1].u - corners[0].u);
  const double side_v = std::abs(corners[1].v - corners[0].v);
  const double turned = (side_u + side_v) / std::hypot(side_u, side_v);
  return static_cast<int>(std::clamp(std::ceil(ratio * turned - 0.01), 1.0,
                                     double{GlobalMap::kMaxSamplesPerSide}));
}

}  // namespace

GlobalMap::WriteSummary GlobalMap::MergeArea(
    const std::array<GeodeticPoint, 4>& corners, double cell_size_m,
    const CellSource& source) {
  return WriteEvidence(corners, cell_size_m, source, /*shoals_only=*/false);
}

GlobalMap::WriteSummary GlobalMap::MergeShoals(
    const std::array<GeodeticPoint, 4>& corners, double cell_size_m,
    const CellSource& source) {
  return WriteEvidence(corners, cell_size_m, source, /*shoals_only=*/true);
}

GlobalMap::WriteSummary GlobalMap::WriteEvidence(
    const std::array<GeodeticPoint, 4>& corners, double cell_size_m,
    const CellSource& source, bool shoals_only) {
  const RootSquare& root = options_.root;
  std::array<SquarePoint, 4> places;
  SquarePoint low{.u = 1, .v = 1};
  SquarePoint high{.u = 0, .v = 0};
  for (std::size_t i = 0; i < 4; ++i) {
    const std::optional<SquarePoint> place = root.Project(corners[i]);
    // On the other side of the Earth.
    if (!place) return {};
    places[i] = *place;
    low = {.u = std::min(low.u, place->u), .v = std::min(low.v, place->v)};
    high = {.u = std::max(high.u, place->u), .v = std::max(high.v, place->v)};
  }
  if (high.u < 0 || high.v < 0 || low.u >= 1 || low.v >= 1) return {};

  const int level = root.LevelFor(cell_size_m);
  const double cells = std::ldexp(1.0, level);
  const auto index = [cells](double fraction) {
    return static_cast<std::uint32_t>(
        std::clamp(std::floor(fraction * cells), 0.0, cells - 1));
  };
  const int samples =
      SamplesPerSide(root.cell_size_m(level) / cell_size_m, places);

  if (shoals_only && samples == 1) return {};

  const Quadrilateral area(places);
  TransferRule rule(area, source, shoals_only);
  AreaWriter writer(root, *tree_, level, samples, rule);
  writer.WriteRange({.row_begin = index(low.u),
                     .row_last = index(high.u),
                     .col_begin = index(low.v),
                     .col_last = index(high.v)});
  const AreaCounts counts = writer.Finish();
  return {.leaves_written = counts.written,
          .degraded = counts.degraded,
          .kept_measured = 0,
          .ignored = rule.ignored()};
}

}  // namespace fathom::map
