#include "map/local/local_map_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "absl/base/macros.h"
#include "map/local/adaptive.h"
#include "map/local/block_directory.h"
#include "map/local/local_grid.h"
#include "map/local/reading_cache.h"
#include "map/local/smoothed_reading.h"

namespace fathom::map {
namespace {

// Where a cell lies in the tree; block null when never touched.
struct Place {
  const LocalBlock* block = nullptr;
  std::size_t k = 0;
};

Place PlaceOf(const BlockDirectory& directory, CellIndex cell) {
  return {.block = directory.Find(LocalGrid::BlockOf(cell)),
          .k = LocalGrid::OffsetOf(cell)};
}

// Room for cells of which a part was transferred.
using Merged = std::array<PackedEvidence, 9>;

// The evidence of a cell and its neighbours, in the map or in `merged`.
Neighbourhood Around(const LocalGrid& grid, const BlockDirectory& directory,
                     CellIndex cell, Merged& merged) {
  Neighbourhood cells = {};
  const std::uint32_t row = static_cast<std::uint32_t>(cell.i) % kBlockSide;
  const std::uint32_t col = static_cast<std::uint32_t>(cell.j) % kBlockSide;
  if (row > 0 && col > 0 && row + 1 < kBlockSide && col + 1 < kBlockSide) {
    const Place south_west =
        PlaceOf(directory, {.i = cell.i - 1, .j = cell.j - 1});
    const EvidenceCells& evidence = south_west.block->evidence;
    if (!evidence.any_transferred()) {
      for (std::size_t n = 0; n < 9; n += 3) {
        const auto three =
            evidence.FindThree(south_west.k + n / 3 * kBlockSide);
        std::copy(three.begin(), three.end(), cells.begin() + n);
      }
      return cells;
    }
  }
  for (std::size_t n = 0; n < 9; ++n) {
    const CellIndex at = {.i = cell.i + static_cast<std::int32_t>(n / 3) - 1,
                          .j = cell.j + static_cast<std::int32_t>(n % 3) - 1};
    if (!grid.Contains(at)) continue;
    const Place place = PlaceOf(directory, at);
    if (place.block == nullptr) continue;
    cells[n] = place.block->evidence.Find(place.k);
    if (cells[n] != nullptr && place.block->evidence.any_transferred()) {
      merged[n] = PackMoments(place.block->evidence.All(place.k));
      cells[n] = &merged[n];
    }
  }
  return cells;
}

MeanVariance ReadKalman(const Evidence& evidence, const CellPrior& prior) {
  const double variance_m2 = 1.0 / evidence.weight;
  if (prior.kind == EvidenceKind::kNone || prior.kind == EvidenceKind::kLand) {
    return {.mean_m = evidence.mean_m, .variance_m2 = variance_m2};
  }
  const double prior_m2 = static_cast<double>(prior.std_m) * prior.std_m;
  const double k = Gain(prior_m2, variance_m2);
  return {.mean_m = CorrectMean(k, prior.depth_m, evidence.mean_m),
          .variance_m2 = FuseVarianceKalman(k, prior_m2)};
}

DepthEstimate ToEstimate(const MeanVariance& read, EvidenceKind kind,
                         const Evidence& evidence, double cell_size_m) {
  const float std_m = std::sqrt(static_cast<float>(read.variance_m2));
  return {.depth_m = static_cast<float>(read.mean_m),
          .std_m = std::max(std_m, kMinStdM),
          .kind = kind,
          .soundings = evidence.count,
          .time_s = evidence.time_s,
          .shoalest_m = evidence.shoalest_m,
          .cell_size_m = static_cast<float>(cell_size_m)};
}

// `known_hazard_m`: from before this activity; infinite or NaN: none.
DepthEstimate FromAdaptive(const AdaptiveReading& read,
                           const Evidence& evidence,
                           const PendingShoal* pending, float known_hazard_m,
                           double cell_size_m) {
  DepthEstimate estimate = ToEstimate(read.predictive, EvidenceKind::kMeasured,
                                      evidence, cell_size_m);
  estimate.variability_m = std::sqrt(static_cast<float>(read.variability_m2));
  estimate.hazard_m = read.hazard_m;
  if (std::isfinite(known_hazard_m)) {
    estimate.hazard_m = std::fmin(estimate.hazard_m, known_hazard_m);
  }
  if (pending != nullptr) {
    // fmin: of a NaN and a number the number.
    estimate.hazard_m = std::fmin(estimate.hazard_m, HazardDepth(*pending));
  }
  return estimate;
}

MeanVariance FromNervegna(const NervegnaCell& cell) {
  return {.mean_m = cell.mean_m, .variance_m2 = cell.variance_m2};
}

// The newest epoch among the blocks of a cell and its neighbours.
// REQUIRES: the cell lies in the grid.
std::uint64_t NewestEpochAround(const LocalGrid& grid,
                                const BlockDirectory& directory,
                                CellIndex cell) {
  // They lie in the blocks of the four corners, which the border cuts off.
  const BlockIndex south_west = LocalGrid::BlockOf(
      {.i = std::max(cell.i - 1, 0), .j = std::max(cell.j - 1, 0)});
  const BlockIndex north_east = LocalGrid::BlockOf(
      {.i = std::min(cell.i + 1,
                     static_cast<std::int32_t>(grid.cells_north) - 1),
       .j = std::min(cell.j + 1,
                     static_cast<std::int32_t>(grid.cells_east) - 1)});
  std::uint64_t newest = 0;
  for (std::uint32_t row = south_west.row; row <= north_east.row; ++row) {
    for (std::uint32_t col = south_west.col; col <= north_east.col; ++col) {
      const BlockNode* const node =
          directory.FindNode({.row = row, .col = col});
      if (node != nullptr) newest = std::max(newest, node->epoch);
    }
  }
  return newest;
}

// What `adaptive` says of a measured cell.
DepthEstimate ReadByAdaptive(const LocalGrid& grid,
                             const BlockDirectory& directory, CellIndex cell,
                             const Place& place) {
  const ReadingName name = {.map = grid.id,
                            .epoch = NewestEpochAround(grid, directory, cell),
                            .cell = cell};
  ReadingCache::Place& kept = ReadingCache::OfThisThread().At(name);
  if (kept.name == name) return kept.estimate;
  const double cell_size_m = grid.options.cell_size_m;
  const Evidence evidence = place.block->evidence.All(place.k);
  const CellPrior prior = place.block->prior(place.k);
  Merged merged;
  kept.estimate = FromAdaptive(
      ReadAdaptive(evidence, Around(grid, directory, cell, merged), prior,
                   cell_size_m),
      evidence, place.block->PendingAt(place.k), prior.hazard_m, cell_size_m);
  kept.name = name;
  return kept.estimate;
}

// The reading of a measured cell. REQUIRES: the cell lies in the grid.
std::optional<DepthEstimate> ReadMeasured(const LocalGrid& grid,
                                          const BlockDirectory& directory,
                                          CellIndex cell) {
  const Place place = PlaceOf(directory, cell);
  if (place.block == nullptr || !place.block->measured(place.k)) {
    return std::nullopt;
  }
  const double cell_size_m = grid.options.cell_size_m;
  MeanVariance read;
  Evidence evidence;
  switch (grid.options.estimator) {
    case EstimatorKind::kNervegna:
      evidence = place.block->evidence.All(place.k);
      read = FromNervegna(place.block->nervegna[place.k]);
      break;
    case EstimatorKind::kKalman:
      evidence = place.block->evidence.All(place.k);
      read = ReadKalman(evidence, place.block->prior(place.k));
      break;
    case EstimatorKind::kAdaptive:
      return ReadByAdaptive(grid, directory, cell, place);
  }
  return ToEstimate(read, EvidenceKind::kMeasured, evidence, cell_size_m);
}

// Rings beyond smoothing's reach that still tell how rough the floor is: a
// variogram from one or two pairs is nearly a guess.
constexpr std::int32_t kRoughnessRings = 4;

// Cells in the first `rings` rings about a cell.
constexpr std::size_t CellsWithin(std::int32_t rings) {
  const std::size_t side = 2 * static_cast<std::size_t>(rings) + 1;
  return side * side - 1;
}

// The cells about a cell in the order in which they are looked at: ring by ring
// outward, south and north sides first.
struct Offset {
  std::int8_t north = 0;
  std::int8_t east = 0;
};
constexpr std::int32_t kMostRings = kMaxSmoothReach + kRoughnessRings;
constexpr auto kOutward = [] {
  std::array<Offset, CellsWithin(kMostRings)> offsets = {};
  std::size_t next = 0;
  const auto add = [&](std::int32_t north, std::int32_t east) {
    offsets[next++] = {.north = static_cast<std::int8_t>(north),
                       .east = static_cast<std::int8_t>(east)};
  };
  for (std::int32_t ring = 1; ring <= kMostRings; ++ring) {
    for (std::int32_t along = -ring; along <= ring; ++along) {
      add(-ring, along);
      add(ring, along);
    }
    for (std::int32_t along = 1 - ring; along < ring; ++along) {
      add(along, -ring);
      add(along, ring);
    }
  }
  return offsets;
}();

// The measured cells about `cell`, outward until there are kMaxMeasuredNear;
// none if none lies within smoothing's reach.
MeasuredNear MeasuredAround(const LocalGrid& grid,
                            const BlockDirectory& directory, CellIndex cell) {
  MeasuredNear near;
  const auto reach = static_cast<std::int32_t>(grid.reach);
  const std::size_t within = CellsWithin(reach);
  const std::size_t most = CellsWithin(reach + kRoughnessRings);
  for (std::size_t n = 0; n < most && !near.full(); ++n) {
    if (n == within && near.size == 0) break;
    const Offset to = kOutward[n];
    const CellIndex at = {.i = cell.i + to.north, .j = cell.j + to.east};
    if (!grid.Contains(at)) continue;
    const Place place = PlaceOf(directory, at);
    if (place.block == nullptr || !place.block->measured(place.k)) continue;
    near.Add(to.north, to.east, place.block->evidence.All(place.k));
  }
  return near;
}

// What the measured cells near it say of a cell, if that is more certain than
// the prior at `place`. One variable is returned throughout: it is built where
// the caller wants it.
std::optional<DepthEstimate> ReadNear(const LocalGrid& grid,
                                      const BlockDirectory& directory,
                                      CellIndex cell, const Place& place) {
  const MeasuredNear near = MeasuredAround(grid, directory, cell);
  std::optional<DepthEstimate> smoothed = ReadSmoothed(
      near, grid.options.smoothing_scale, grid.options.cell_size_m);
  if (!smoothed.has_value() || place.block == nullptr) return smoothed;
  if (const PendingShoal* shoal = place.block->PendingAt(place.k)) {
    smoothed->hazard_m = HazardDepth(*shoal);
  }
  const CellPrior prior = place.block->prior(place.k);
  const bool prior_is_better =
      prior.kind == EvidenceKind::kLand ||
      (prior.kind != EvidenceKind::kNone && prior.std_m <= smoothed->std_m);
  if (prior_is_better) smoothed.reset();
  return smoothed;
}

// What smoothing wrote (nervegna) or reads (the others) for a cell that was
// never measured.
std::optional<DepthEstimate> ReadUnmeasured(const LocalGrid& grid,
                                            const BlockDirectory& directory,
                                            CellIndex cell) {
  const Place place = PlaceOf(directory, cell);
  if (grid.options.estimator == EstimatorKind::kNervegna) {
    if (place.block == nullptr || !place.block->evidence.touched(place.k)) {
      return std::nullopt;
    }
    return ToEstimate(
        FromNervegna(place.block->nervegna[place.k]), EvidenceKind::kSmoothed,
        place.block->evidence.Fresh(place.k), grid.options.cell_size_m);
  }
  if (grid.reach == 0) return std::nullopt;
  return ReadNear(grid, directory, cell, place);
}

}  // namespace

LocalMapView::LocalMapView() = default;

LocalMapView::LocalMapView(std::shared_ptr<const LocalGrid> grid,
                           std::shared_ptr<const BlockDirectory> directory)
    : grid_(std::move(grid)), directory_(std::move(directory)) {}

std::optional<CellIndex> LocalMapView::CellAt(
    const GeodeticPoint& point) const {
  if (grid_ == nullptr) return std::nullopt;
  const NedPoint at = grid_->frame.ToNed(point);
  const double size_m = grid_->options.cell_size_m;
  CellIndex cell;
  if (!grid_->Locate(at.north_m / size_m, at.east_m / size_m, cell)) {
    return std::nullopt;
  }
  return cell;
}

GeodeticPoint LocalMapView::CellCenter(CellIndex cell) const {
  return grid_->Center(cell);
}

bool LocalMapView::Contains(const GeodeticPoint& point) const {
  return CellAt(point).has_value();
}

std::optional<DepthEstimate> LocalMapView::At(
    const GeodeticPoint& point) const {
  const std::optional<CellIndex> cell = CellAt(point);
  if (!cell.has_value()) return std::nullopt;
  return AtCell(*cell);
}

std::optional<DepthEstimate> LocalMapView::AtCell(CellIndex cell) const {
  if (grid_ == nullptr || !grid_->Contains(cell)) return std::nullopt;
  // One variable, built where the caller wants it.
  std::optional<DepthEstimate> estimate =
      ReadMeasured(*grid_, *directory_, cell);
  if (!estimate.has_value()) {
    estimate = ReadUnmeasured(*grid_, *directory_, cell);
  }
  return estimate;
}

std::optional<DepthEstimate> LocalMapView::EvidenceAt(
    const GeodeticPoint& point) const {
  const std::optional<CellIndex> cell = CellAt(point);
  if (!cell.has_value()) return std::nullopt;
  const Place place = PlaceOf(*directory_, *cell);
  if (place.block == nullptr) return std::nullopt;
  const Evidence evidence = place.block->evidence.Fresh(place.k);
  if (evidence.empty()) return std::nullopt;
  const double cell_size_m = grid_->options.cell_size_m;
  MeanVariance read = {.mean_m = evidence.mean_m,
                       .variance_m2 = 1.0 / evidence.weight};
  switch (grid_->options.estimator) {
    case EstimatorKind::kNervegna:
      read.variance_m2 = place.block->nervegna[place.k].variance_m2;
      break;
    case EstimatorKind::kKalman:
      break;
    case EstimatorKind::kAdaptive: {
      // The neighbours tell of the terrain, not of this cell's depth, so all
      // they know may be used; of the cell itself only what is new.
      Merged merged;
      Neighbourhood cells = Around(*grid_, *directory_, *cell, merged);
      cells[kCenter] = place.block->evidence.Find(place.k);
      return FromAdaptive(
          ReadAdaptive(evidence, cells, CellPrior{}, cell_size_m), evidence,
          nullptr, CellPrior{}.hazard_m, cell_size_m);
    }
  }
  return ToEstimate(read, EvidenceKind::kMeasured, evidence, cell_size_m);
}

float LocalMapView::PendingHazardAt(const GeodeticPoint& point) const {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  if (!any_pending()) return kNone;
  const std::optional<CellIndex> cell = CellAt(point);
  if (!cell.has_value()) return kNone;
  const Place place = PlaceOf(*directory_, *cell);
  if (place.block == nullptr) return kNone;
  const PendingShoal* shoal = place.block->PendingAt(place.k);
  return shoal == nullptr ? kNone : HazardDepth(*shoal);
}

bool LocalMapView::any_pending() const {
  return directory_ != nullptr && directory_->pending_count() > 0;
}

void LocalMapView::ForEachMeasuredArea(
    const std::function<void(const AreaCorners& corners,
                             std::size_t measured_cells)>& visit) const {
  ForEachBlock([&](BlockIndex index, const LocalBlock& block) {
    const std::size_t measured = block.evidence.CountFresh();
    if (measured == 0) return;
    const std::uint32_t south = index.row * kBlockSide;
    const std::uint32_t west = index.col * kBlockSide;
    const std::uint32_t north =
        std::min(south + kBlockSide, grid_->cells_north);
    const std::uint32_t east = std::min(west + kBlockSide, grid_->cells_east);
    visit({grid_->Corner(south, west), grid_->Corner(north, west),
           grid_->Corner(north, east), grid_->Corner(south, east)},
          measured);
  });
}

void LocalMapView::ForEachBlock(
    const std::function<void(BlockIndex, const LocalBlock&)>& visit) const {
  if (directory_ != nullptr) directory_->ForEachNotIn(nullptr, visit);
}

const LocalBlock* LocalMapView::Block(BlockIndex index) const {
  if (grid_ == nullptr || !grid_->Contains(index)) return nullptr;
  return directory_->Find(index);
}

std::optional<DepthEstimate> LocalMapView::DefaultPrior() const {
  if (grid_ == nullptr || !grid_->options.default_depth_m.has_value()) {
    return std::nullopt;
  }
  return DepthEstimate{
      .depth_m = *grid_->options.default_depth_m,
      .std_m = *grid_->options.default_std_m,
      .kind = EvidenceKind::kPrior,
      .cell_size_m = static_cast<float>(grid_->options.cell_size_m)};
}

std::uint32_t LocalMapView::cells_north() const {
  return grid_ == nullptr ? 0 : grid_->cells_north;
}

std::uint32_t LocalMapView::cells_east() const {
  return grid_ == nullptr ? 0 : grid_->cells_east;
}

std::uint64_t LocalMapView::cells_measured() const {
  return directory_ == nullptr ? 0 : directory_->cells_measured();
}

std::uint64_t LocalMapView::block_count() const {
  return directory_ == nullptr ? 0 : directory_->block_count();
}

std::uint64_t LocalMapView::memory_bytes() const {
  return directory_ == nullptr ? 0
                               : sizeof(LocalGrid) + directory_->memory_bytes();
}

const LocalMapOptions& LocalMapView::options() const {
  ABSL_ASSERT(grid_ != nullptr);
  return grid_->options;
}

const NedFrame& LocalMapView::frame() const {
  ABSL_ASSERT(grid_ != nullptr);
  return grid_->frame;
}

void DiffBlocks(
    const LocalMapView& old_view, const LocalMapView& now,
    const std::function<void(BlockIndex, const LocalBlock&)>& visit) {
  if (now.directory_ == nullptr || now.directory_ == old_view.directory_) {
    return;
  }
  now.directory_->ForEachNotIn(old_view.directory_.get(), visit);
}

}  // namespace fathom::map
