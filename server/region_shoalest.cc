#include "server/region_shoalest.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "map/local/hazard.h"
#include "map/local/local_block.h"

namespace fathom::server {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kNothing = std::numeric_limits<float>::infinity();

// Quadtree cells remembered: 2 MB. Past it they are forgotten and read again.
constexpr size_t kMaxRemembered = 1 << 16;

// Least and greatest of four.
struct Span {
  double low;
  double high;
};
Span Of(double a, double b, double c, double d) {
  return {.low = std::min({a, b, c, d}), .high = std::max({a, b, c, d})};
}

// Indices in [0, count) that [low, high] touches; none if first > last.
struct IndexRange {
  int64_t first;
  int64_t last;
  // The span lies wholly between 0 and count.
  bool inside;
};

IndexRange Touched(double low, double high, uint32_t count) {
  const double end = count;
  const bool inside = low >= 0 && high <= end;
  if (!(high >= 0 && low <= end)) return {1, 0, false};  // NaN too.
  return {.first = static_cast<int64_t>(std::max(0.0, std::floor(low))),
          .last = static_cast<int64_t>(std::min(end - 1, std::floor(high))),
          .inside = inside};
}

// Whether a reading of the cell may hold something shoaler than `known_m`
// that its soundings and their mean do not show: a prior that draws the
// estimate upwards (which lies between both), or a hazard, which begins above
// its sounding.
bool MayHoldShoaler(const map::LocalBlock& block, size_t k,
                    const map::Evidence& evidence, float known_m) {
  const map::CellPrior prior = block.prior(k);
  if (prior.kind != map::EvidenceKind::kNone &&
      prior.kind != map::EvidenceKind::kLand && prior.depth_m < known_m) {
    return true;
  }
  return map::HazardDepth(evidence) < known_m;
}

// The least of what a cell holds, if it is below `known_m`; what is not below
// need not be exact. REQUIRES: the cell was measured.
float ShoalestOf(const map::LocalMapView& local, const map::LocalBlock& block,
                 map::CellIndex cell, size_t k, float known_m) {
  const map::Evidence evidence = block.evidence.All(k);
  // fmin passes over a NaN, "none".
  float shoalest_m = std::fmin(evidence.mean_m, evidence.shoalest_m);
  if (!block.nervegna.empty()) {
    return std::min(shoalest_m, block.nervegna[k].mean_m);
  }
  if (MayHoldShoaler(block, k, evidence, std::min(shoalest_m, known_m))) {
    if (const auto estimate = local.AtCell(cell)) {
      shoalest_m = std::fmin(shoalest_m,
                             std::fmin(estimate->depth_m, estimate->hazard_m));
    }
  }
  return shoalest_m;
}

}  // namespace

RegionShoalest::RegionShoalest(const map::ObstacleMapView& view,
                               ShoalestOptions options)
    : view_(view), options_(options) {
  if (options_.activity != nullptr) {
    activities_.push_back(options_.activity);
  } else if (options_.layers != map::LayerChoice::kGlobalOnly) {
    activities_ = view.open_newest_first();
  }
  const map::RootSquare& root = view.global().root();
  level_ = root.LevelFor(options_.resolution_m);
  bow_uv_ = options_.bow_m / root.cell_size_m(0);
}

RegionShoalest::GlobalNode RegionShoalest::NodeAt(
    const map::GeodeticPoint& point) const {
  GlobalNode node;
  node.place = view_.global().root().Project(point);
  if (node.place.has_value()) {
    if (const auto leaf = view_.global().LeafAt(point)) node.leaf = leaf->first;
  }
  return node;
}

float RegionShoalest::BoundOf(const map::CellKey& cell) {
  const uint64_t key = uint64_t{cell.level} << 56 | uint64_t{cell.row} << 28 |
                       uint64_t{cell.col};
  const auto found = bounds_.find(key);
  if (found != bounds_.end()) return found->second;
  if (bounds_.size() >= kMaxRemembered) bounds_.clear();
  const auto bounds = view_.global().Bounds(cell);
  const float shoalest_m = bounds.has_value() ? bounds->shoalest_m : kNothing;
  bounds_.emplace(key, shoalest_m);
  return shoalest_m;
}

float RegionShoalest::InGlobal(size_t column) {
  const GlobalNode& nw = north_nodes_[column];
  const GlobalNode& ne = north_nodes_[column + 1];
  const GlobalNode& sw = south_nodes_[column];
  const GlobalNode& se = south_nodes_[column + 1];
  // The other side of the Earth.
  if (!nw.place || !ne.place || !sw.place || !se.place) return kNothing;
  if (nw.leaf.has_value() && nw.leaf == ne.leaf && nw.leaf == sw.leaf &&
      nw.leaf == se.leaf) {
    return BoundOf(*nw.leaf);
  }
  const uint32_t side = 1u << level_;
  const Span u = Of(nw.place->u, ne.place->u, sw.place->u, se.place->u);
  const Span v = Of(nw.place->v, ne.place->v, sw.place->v, se.place->v);
  const IndexRange rows =
      Touched((u.low - bow_uv_) * side, (u.high + bow_uv_) * side, side);
  const IndexRange cols =
      Touched((v.low - bow_uv_) * side, (v.high + bow_uv_) * side, side);
  float shoalest_m = kNothing;
  for (int64_t row = rows.first; row <= rows.last; ++row) {
    for (int64_t col = cols.first; col <= cols.last; ++col) {
      shoalest_m =
          std::min(shoalest_m, BoundOf({.level = static_cast<uint8_t>(level_),
                                        .row = static_cast<uint32_t>(row),
                                        .col = static_cast<uint32_t>(col)}));
    }
  }
  return shoalest_m;
}

RegionShoalest::LocalPart RegionShoalest::InActivity(
    const map::LocalMapView& local, const std::vector<map::NedPoint>& north,
    const std::vector<map::NedPoint>& south, size_t column,
    const std::atomic<bool>& stop) const {
  LocalPart part{.shoalest_m = kNothing};
  const double cell_m = local.options().cell_size_m;
  const map::NedPoint& nw = north[column];
  const map::NedPoint& ne = north[column + 1];
  const map::NedPoint& sw = south[column];
  const map::NedPoint& se = south[column + 1];
  const Span n = Of(nw.north_m, ne.north_m, sw.north_m, se.north_m);
  const Span e = Of(nw.east_m, ne.east_m, sw.east_m, se.east_m);
  const IndexRange rows =
      Touched((n.low - options_.bow_m) / cell_m,
              (n.high + options_.bow_m) / cell_m, local.cells_north());
  const IndexRange cols =
      Touched((e.low - options_.bow_m) / cell_m,
              (e.high + options_.bow_m) / cell_m, local.cells_east());
  if (rows.first > rows.last || cols.first > cols.last) return part;
  part.complete = rows.inside && cols.inside;
  constexpr int64_t kSide = map::kBlockSide;
  for (int64_t south_row = rows.first; south_row <= rows.last;) {
    const int64_t last_row =
        std::min(rows.last, (south_row / kSide + 1) * kSide - 1);
    if (stop.load(std::memory_order_relaxed)) return part;
    for (int64_t west = cols.first; west <= cols.last;) {
      const int64_t last_col =
          std::min(cols.last, (west / kSide + 1) * kSide - 1);
      const map::LocalBlock* block =
          local.Block({.row = static_cast<uint32_t>(south_row / kSide),
                       .col = static_cast<uint32_t>(west / kSide)});
      part.complete = part.complete && block != nullptr;
      if (block != nullptr) {
        // Few or none; those outside the cell make it no less safe.
        for (const map::PendingShoal& shoal : block->pending) {
          part.shoalest_m = std::min(part.shoalest_m, map::HazardDepth(shoal));
        }
      }
      for (int64_t row = south_row; block != nullptr && row <= last_row;
           ++row) {
        for (int64_t col = west; col <= last_col; ++col) {
          const auto k = static_cast<size_t>(row % kSide * kSide + col % kSide);
          if (!block->measured(k)) {
            part.complete = false;
            continue;
          }
          const float held_m = ShoalestOf(
              local, *block,
              {.i = static_cast<int32_t>(row), .j = static_cast<int32_t>(col)},
              k, part.shoalest_m);
          part.shoalest_m = std::min(part.shoalest_m, held_m);
        }
      }
      west = last_col + 1;
    }
    south_row = last_row + 1;
  }
  return part;
}

bool RegionShoalest::NextRow(const std::vector<map::GeodeticPoint>& north,
                             const std::vector<map::GeodeticPoint>& south,
                             const std::atomic<bool>& stop,
                             std::vector<float>& shoalest_m) {
  const size_t cells = north.size() - 1;
  shoalest_m.assign(cells, kNothing);
  std::vector<bool> complete(cells, false);
  for (const map::ActivityView* activity : activities_) {
    const map::LocalMapView& local = *activity->local;
    const map::NedFrame& frame = local.frame();
    north_ned_.clear();
    south_ned_.clear();
    for (const auto& corner : north) north_ned_.push_back(frame.ToNed(corner));
    for (const auto& corner : south) south_ned_.push_back(frame.ToNed(corner));
    for (size_t column = 0; column < cells; ++column) {
      if (stop.load(std::memory_order_relaxed)) return false;
      if (!frame.Covers(north[column])) continue;
      const LocalPart part =
          InActivity(local, north_ned_, south_ned_, column, stop);
      shoalest_m[column] = std::min(shoalest_m[column], part.shoalest_m);
      complete[column] = complete[column] || part.complete;
    }
  }
  const bool with_global = options_.activity == nullptr &&
                           options_.layers != map::LayerChoice::kLocalOnly;
  if (with_global) {
    // The southern corners of the last row are the northern ones of this.
    if (south_nodes_.empty()) {
      for (const auto& corner : north) south_nodes_.push_back(NodeAt(corner));
    }
    north_nodes_.swap(south_nodes_);
    south_nodes_.clear();
    for (const auto& corner : south) south_nodes_.push_back(NodeAt(corner));
    for (size_t column = 0; column < cells; ++column) {
      if (stop.load(std::memory_order_relaxed)) return false;
      if (complete[column]) continue;
      shoalest_m[column] = std::min(shoalest_m[column], InGlobal(column));
    }
  }
  for (float& depth_m : shoalest_m) {
    if (depth_m == kNothing) depth_m = kNaN;
  }
  return true;
}

}  // namespace fathom::server
