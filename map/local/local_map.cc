#include "map/local/local_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/time.h"
#include "map/local/block_directory.h"
#include "map/local/estimator.h"
#include "map/local/local_grid.h"
#include "map/local/placement.h"

namespace fathom::map {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;

std::uint32_t ToUnixSeconds(Time time) {
  const std::int64_t seconds =
      std::chrono::floor<std::chrono::seconds>(time).time_since_epoch().count();
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(
      seconds, 0, std::numeric_limits<std::uint32_t>::max()));
}

bool IsFinite(const Pose& pose) {
  return std::isfinite(pose.position.latitude_deg) &&
         std::isfinite(pose.position.longitude_deg) &&
         std::isfinite(pose.depth_m) && std::isfinite(pose.heading_deg) &&
         std::isfinite(pose.position_std_m);
}

bool IsFinite(const Beam& beam) {
  return std::isfinite(beam.range_m) && std::isfinite(beam.bearing_rad) &&
         std::isfinite(beam.depth_m) && std::isfinite(beam.std_m);
}

// 4.3.3.1 and domain section 4: the reason to refuse a beam, place aside.
std::optional<RejectReason> Threshold(const Beam& beam,
                                      const LocalMapOptions& options) {
  if (!IsFinite(beam)) return RejectReason::kNotFinite;
  if (beam.range_m <= options.min_range_m) return RejectReason::kBelowMinRange;
  if (beam.range_m >= options.max_range_m) return RejectReason::kAboveMaxRange;
  if (beam.std_m <= 0.0f || beam.std_m > kMaxStdM) return RejectReason::kBadStd;
  if (beam.depth_m < kMinDepthM || beam.depth_m > kMaxDepthM) {
    return RejectReason::kBadDepth;
  }
  return std::nullopt;
}

// Whether Threshold passes the beam, in one test without branches; NaN fails
// it.
bool Passes(const Beam& beam, const LocalMapOptions& options) {
  return static_cast<int>(beam.range_m > options.min_range_m) &
         static_cast<int>(beam.range_m < options.max_range_m) &
         static_cast<int>(beam.std_m > 0.0f) &
         static_cast<int>(beam.std_m <= kMaxStdM) &
         static_cast<int>(beam.depth_m >= kMinDepthM) &
         static_cast<int>(beam.depth_m <= kMaxDepthM) &
         static_cast<int>(std::fabs(beam.bearing_rad) <
                          std::numeric_limits<float>::infinity());
}

// A prior that may stand in the map: known, finite, a std above 0.
CellPrior ToCellPrior(const std::optional<DepthEstimate>& estimate) {
  if (!estimate.has_value() || estimate->kind == EvidenceKind::kNone) return {};
  if (estimate->kind == EvidenceKind::kLand) {
    return {.kind = EvidenceKind::kLand};
  }
  if (!std::isfinite(estimate->depth_m) || !std::isfinite(estimate->std_m) ||
      estimate->std_m <= 0.0f) {
    return {};
  }
  CellPrior prior = {.depth_m = estimate->depth_m,
                     .std_m = std::max(estimate->std_m, kMinStdM),
                     .kind = estimate->kind};
  if (std::isfinite(estimate->hazard_m)) prior.hazard_m = estimate->hazard_m;
  return prior;
}

bool HasDepth(const CellPrior& prior) {
  return prior.kind != EvidenceKind::kNone && prior.kind != EvidenceKind::kLand;
}

NervegnaCell StartOf(const CellPrior& prior) {
  if (!HasDepth(prior)) {
    return {.mean_m = 0.0f,
            .variance_m2 = std::numeric_limits<float>::infinity()};
  }
  return {.mean_m = prior.depth_m, .variance_m2 = prior.std_m * prior.std_m};
}

// 4.18 + 4.21 with gain k. A cell of which nothing is known takes the new
// value with `first_variance_m2`.
void FuseNervegna(double k, double mean_m, double first_variance_m2,
                  NervegnaCell& cell) {
  if (std::isinf(cell.variance_m2)) {
    cell.mean_m = static_cast<float>(mean_m);
    cell.variance_m2 = static_cast<float>(first_variance_m2);
    return;
  }
  cell.variance_m2 = static_cast<float>(
      FuseVarianceNervegna(k, cell.variance_m2, cell.mean_m, mean_m));
  cell.mean_m = static_cast<float>(CorrectMean(k, cell.mean_m, mean_m));
}

// The floor that a sounding of cell k is held against: the mean of its own
// soundings; while these are few the shoalest of its measured neighbours in
// the block; NaN where these are few too.
float FloorAround(const LocalBlock& block, std::size_t k) {
  const Evidence own = block.evidence.All(k);
  if (own.count >= kGateSoundings) return own.mean_m;
  const std::size_t row = k / kBlockSide;
  const std::size_t col = k % kBlockSide;
  float shoalest_m = std::numeric_limits<float>::infinity();
  std::uint32_t neighbours = 0;
  for (std::size_t i = row == 0 ? 0 : row - 1;
       i <= std::min<std::size_t>(row + 1, kBlockSide - 1); ++i) {
    for (std::size_t j = col == 0 ? 0 : col - 1;
         j <= std::min<std::size_t>(col + 1, kBlockSide - 1); ++j) {
      const std::size_t near = i * kBlockSide + j;
      if (near == k || !block.measured(near)) continue;
      shoalest_m = std::min(shoalest_m, block.evidence.All(near).mean_m);
      ++neighbours;
    }
  }
  return neighbours >= kGateNeighbours
             ? shoalest_m
             : std::numeric_limits<float>::quiet_NaN();
}

// A beam and where it falls.
struct Hit {
  const Beam* beam = nullptr;
  CellIndex cell;
  LocalBlock* block = nullptr;  // The cell's, mutable while this view lasts.
};

// Some beams of a ping: all are placed, then all are looked up, then all are
// added, so that the memory of one is fetched while others are reckoned.
struct Hits {
  std::array<Hit, kBeamsAtOnce> hits;
  std::size_t count = 0;
  BeamFloats range_m = BeamFloats::Zero();
  BeamFloats bearing_rad = BeamFloats::Zero();

  std::span<Hit> all() { return std::span(hits).first(count); }
  // The beams that pass the thresholds. REQUIRES: at most kBeamsAtOnce.
  void Take(std::span<const Beam> beams, const LocalMapOptions& options,
            RejectCounts& rejects) {
    count = 0;
    for (const Beam& beam : beams) {
      if (!Passes(beam, options)) {
        if (const auto bad = Threshold(beam, options)) {
          rejects.Add(*bad);
          continue;
        }
      }
      hits[count].beam = &beam;
      const auto lane = static_cast<Eigen::Index>(count);
      range_m[lane] = beam.range_m;
      bearing_rad[lane] = beam.bearing_rad;
      ++count;
    }
  }
};

}  // namespace

struct LocalMap::State {
  explicit State(const LocalMapOptions& options)
      : grid(std::make_shared<const LocalGrid>(options)),
        directory(std::make_shared<BlockDirectory>(grid->blocks_north,
                                                   grid->blocks_east)) {}

  // The directory, copied if a view may see it.
  BlockDirectory& MutableDirectory() {
    if (directory->epoch() != epoch) {
      directory = std::make_shared<BlockDirectory>(*directory);
      directory->set_epoch(epoch);
    }
    return *directory;
  }

  // A block of `mine`, the mutable directory, mutable and with its prior.
  LocalBlock& MutableBlock(BlockDirectory& mine, BlockIndex index,
                           const PriorSource& prior) {
    bool created = false;
    LocalBlock& block = mine.Mutable(index, epoch, created);
    if (created) [[unlikely]] {
      FillPrior(index, prior, block);
      mine.CountArrays(block, +1);
    }
    return block;
  }
  // Places the hits and finds their blocks; those outside the grid go.
  void Locate(const NedPoint& vehicle, double heading_rad,
              const PriorSource& prior, Hits& hits, RejectCounts& rejects);
  void FillPrior(BlockIndex index, const PriorSource& prior,
                 LocalBlock& block) const;
  // False: held back as a gross shoal. `last_m`: the depth of the ping's
  // accepted beam before, NaN at its first.
  bool AddSounding(const Hit& hit, std::uint32_t time_s, float last_m,
                   const PriorSource& prior);
  // Whether the sounding has to wait for a second one; brings in the one that
  // waited if this is the second.
  bool HoldBack(LocalBlock& block, std::size_t k, const Beam& beam,
                std::uint32_t time_s);
  void AddTo(LocalBlock& block, std::size_t k, float depth_m, float std_m,
             std::uint32_t time_s);
  void Smooth(CellIndex cell, const NervegnaCell& updated, std::uint32_t time_s,
              const PriorSource& prior);

  std::shared_ptr<const LocalGrid> grid;
  std::shared_ptr<BlockDirectory> directory;
  // Raised by each View(); see block_directory.h.
  std::uint64_t epoch = 0;
};

void LocalMap::State::FillPrior(BlockIndex index, const PriorSource& prior,
                                LocalBlock& block) const {
  const LocalMapOptions& options = grid->options;
  CellPrior fallback;
  if (options.default_depth_m.has_value()) {
    fallback = {.depth_m = *options.default_depth_m,
                .std_m = *options.default_std_m,
                .kind = EvidenceKind::kPrior};
  }
  block.uniform_prior = fallback;
  if (prior) {
    auto cells = std::make_shared<PriorGrid>();
    bool uniform = true;
    CellPrior first;
    for (std::size_t k = 0; k < kBlockCells; ++k) {
      const CellIndex cell = {.i = static_cast<std::int32_t>(
                                  index.row * kBlockSide + k / kBlockSide),
                              .j = static_cast<std::int32_t>(
                                  index.col * kBlockSide + k % kBlockSide)};
      CellPrior here = ToCellPrior(prior(grid->Center(cell)));
      if (here.kind == EvidenceKind::kNone) here = fallback;
      cells->depth_m[k] = here.depth_m;
      cells->std_m[k] = here.std_m;
      cells->kind[k] = here.kind;
      if (std::isfinite(here.hazard_m)) {
        cells->hazard_m.resize(kBlockCells,
                               std::numeric_limits<float>::infinity());
        cells->hazard_m[k] = here.hazard_m;
      }
      if (k == 0) first = here;
      uniform = uniform && here == first;
    }
    block.uniform_prior = first;
    if (!uniform) block.prior_grid = std::move(cells);
  }
  if (options.estimator == EstimatorKind::kNervegna) {
    block.nervegna.resize(kBlockCells);
    for (std::size_t k = 0; k < kBlockCells; ++k) {
      block.nervegna[k] = StartOf(block.prior(k));
    }
  }
}

void LocalMap::State::Locate(const NedPoint& vehicle, double heading_rad,
                             const PriorSource& prior, Hits& hits,
                             RejectCounts& rejects) {
  const BeamPlaces at = ObstaclePosition(
      vehicle,
      BeamOffset(hits.range_m, BeamAzimuthRad(heading_rad, hits.bearing_rad)));
  const BeamDoubles north = at.north / grid->options.cell_size_m;
  const BeamDoubles east = at.east / grid->options.cell_size_m;
  BlockDirectory& mine = MutableDirectory();
  std::size_t inside = 0;
  for (std::size_t n = 0; n < hits.count; ++n) {
    const auto lane = static_cast<Eigen::Index>(n);
    CellIndex cell;
    if (!grid->Locate(north[lane], east[lane], cell)) {
      rejects.Add(RejectReason::kOutsideArea);
      continue;
    }
    LocalBlock& block = MutableBlock(mine, LocalGrid::BlockOf(cell), prior);
    block.evidence.PrefetchPlace(LocalGrid::OffsetOf(cell));
    hits.hits[inside++] = {
        .beam = hits.hits[n].beam, .cell = cell, .block = &block};
  }
  hits.count = inside;
  for (const Hit& hit : hits.all()) {
    hit.block->evidence.PrefetchCell(LocalGrid::OffsetOf(hit.cell));
  }
}

inline void LocalMap::State::AddTo(LocalBlock& block, std::size_t k,
                                   float depth_m, float std_m,
                                   std::uint32_t time_s) {
  const std::size_t before = block.evidence.size();
  if (!block.evidence.Add(k, depth_m, std_m, time_s)) [[likely]]
    return;
  directory->CountMeasured(+1);
  directory->CountBytes(block.evidence.memory_bytes() -
                        block.evidence.MemoryBytesOf(before));
}

bool LocalMap::State::HoldBack(LocalBlock& block, std::size_t k,
                               const Beam& beam, std::uint32_t time_s) {
  auto waiting =
      std::find_if(block.pending.begin(), block.pending.end(),
                   [k](const PendingShoal& shoal) { return shoal.cell >= k; });
  const bool waits = waiting != block.pending.end() && waiting->cell == k;
  if (!IsGrossShoal(beam.depth_m, FloorAround(block, k))) {
    if (waits && ++waiting->since >= kPendingSoundings) {
      directory->CountArrays(block, -1);
      block.pending.erase(waiting);
      directory->CountArrays(block, +1);
    }
    return false;
  }
  directory->CountArrays(block, -1);
  const bool confirmed = waits && Confirms(*waiting, beam.depth_m, beam.std_m);
  const PendingShoal now = {.depth_m = beam.depth_m,
                            .std_m = std::max(beam.std_m, kMinStdM),
                            .time_s = time_s,
                            .cell = static_cast<std::uint16_t>(k)};
  if (confirmed) {
    const PendingShoal first = *waiting;
    block.pending.erase(waiting);
    AddTo(block, k, first.depth_m, first.std_m, first.time_s);
  } else if (waits) {
    // The shoaler of the two goes on waiting.
    if (now.depth_m < waiting->depth_m) *waiting = now;
  } else {
    block.pending.insert(waiting, now);
  }
  directory->CountArrays(block, +1);
  return !confirmed;
}

bool LocalMap::State::AddSounding(const Hit& hit, std::uint32_t time_s,
                                  float last_m, const PriorSource& prior) {
  const Beam& beam = *hit.beam;
  LocalBlock& block = *hit.block;
  const std::size_t k = LocalGrid::OffsetOf(hit.cell);
  if (grid->options.estimator == EstimatorKind::kAdaptive) {
    // Most soundings are like the beam before and need no look at the cell.
    const bool plain = !std::isnan(last_m) && block.pending.empty() &&
                       !IsGrossShoal(beam.depth_m, last_m);
    if (!plain && HoldBack(block, k, beam, time_s)) return false;
  }
  AddTo(block, k, beam.depth_m, beam.std_m, time_s);
  if (grid->options.estimator != EstimatorKind::kNervegna) return true;

  NervegnaCell& estimate = block.nervegna[k];
  const double std_m = std::max(beam.std_m, kMinStdM);
  const double variance_m2 = std_m * std_m;
  FuseNervegna(Gain(estimate.variance_m2, variance_m2), beam.depth_m,
               variance_m2, estimate);
  if (grid->reach > 0) Smooth(hit.cell, estimate, time_s, prior);
  return true;
}

// Eqs. 4.22 to 4.25, block by block so that each is looked up once.
void LocalMap::State::Smooth(CellIndex cell, const NervegnaCell& updated,
                             std::uint32_t time_s, const PriorSource& prior) {
  const NeighbourBounds bounds =
      SmoothBounds(cell, grid->reach, grid->cells_north, grid->cells_east);
  const double scale = grid->options.smoothing_scale;
  constexpr std::int32_t kSide = static_cast<std::int32_t>(kBlockSide);
  BlockDirectory& mine = MutableDirectory();
  for (std::int32_t south = bounds.south; south <= bounds.north;) {
    const std::int32_t next_south = (south / kSide + 1) * kSide;
    const std::int32_t north = std::min(bounds.north, next_south - 1);
    for (std::int32_t west = bounds.west; west <= bounds.east;) {
      const std::int32_t next_west = (west / kSide + 1) * kSide;
      const std::int32_t east = std::min(bounds.east, next_west - 1);
      LocalBlock& block = MutableBlock(
          mine, LocalGrid::BlockOf({.i = south, .j = west}), prior);
      const std::size_t before = block.evidence.memory_bytes();
      for (std::int32_t i = south; i <= north; ++i) {
        for (std::int32_t j = west; j <= east; ++j) {
          const CellIndex near = {.i = i, .j = j};
          const std::size_t k = LocalGrid::OffsetOf(near);
          if (block.measured(k)) continue;
          NervegnaCell& estimate = block.nervegna[k];
          const std::uint32_t apart = CellsApart(near, cell);
          FuseNervegna(SmoothGain(scale, estimate.variance_m2,
                                  updated.variance_m2, apart),
                       updated.mean_m, double{updated.variance_m2} + apart,
                       estimate);
          Evidence evidence = block.evidence.Fresh(k);
          evidence.time_s = std::max(evidence.time_s, time_s);
          block.evidence.Set(k, evidence, /*measured=*/false);
        }
      }
      directory->CountBytes(block.evidence.memory_bytes() - before);
      west = next_west;
    }
    south = next_south;
  }
}

absl::StatusOr<LocalMap> LocalMap::Create(const LocalMapOptions& options) {
  const absl::Status valid = ValidateLocalMapOptions(options);
  if (!valid.ok()) return valid;
  return LocalMap(std::make_unique<State>(options));
}

LocalMap::LocalMap(std::unique_ptr<State> state) : state_(std::move(state)) {}
LocalMap::LocalMap(LocalMap&&) noexcept = default;
LocalMap& LocalMap::operator=(LocalMap&&) noexcept = default;
LocalMap::~LocalMap() = default;

LocalMap::UpdateResult LocalMap::Update(const Ping& ping,
                                        const PriorSource& prior) {
  UpdateResult result;
  if (!IsFinite(ping.pose)) {
    result.rejects.Add(RejectReason::kNotFinite, ping.beams.size());
    return result;
  }
  const LocalGrid& grid = *state_->grid;
  const NedPoint vehicle = grid.frame.ToNed(ping.pose.position);
  const double heading_rad =
      std::remainder(ping.pose.heading_deg, 360.0) * kRadPerDeg +
      grid.frame.NorthAzimuthRad(ping.pose.position);
  const std::uint32_t time_s = ToUnixSeconds(ping.time);
  float last_m = std::numeric_limits<float>::quiet_NaN();
  Hits hits;
  for (std::span<const Beam> rest(ping.beams); !rest.empty();) {
    const std::size_t most = std::min<std::size_t>(rest.size(), kBeamsAtOnce);
    hits.Take(rest.first(most), grid.options, result.rejects);
    rest = rest.subspan(most);
    state_->Locate(vehicle, heading_rad, prior, hits, result.rejects);
    for (const Hit& hit : hits.all()) {
      if (state_->AddSounding(hit, time_s, last_m, prior)) {
        last_m = hit.beam->depth_m;
        ++result.accepted;
      } else {
        result.rejects.Add(RejectReason::kGated);
      }
    }
  }
  return result;
}

void LocalMap::MarkTransferred() {
  const LocalMapView before = View();
  before.ForEachBlock([this](BlockIndex index, const LocalBlock& seen) {
    if (seen.evidence.CountFresh() == 0) return;
    BlockDirectory& mine = state_->MutableDirectory();
    LocalBlock& block = state_->MutableBlock(mine, index, nullptr);
    mine.CountArrays(block, -1);
    block.evidence.MarkTransferred();
    mine.CountArrays(block, +1);
  });
}

absl::Status LocalMap::RestoreBlock(BlockIndex index, LocalBlock block) {
  const LocalGrid& grid = *state_->grid;
  if (!grid.Contains(index)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("block row=%u col=%u must be below %u, %u", index.row,
                        index.col, grid.blocks_north, grid.blocks_east));
  }
  if (const absl::Status valid = ValidateBlock(block, grid.options.estimator);
      !valid.ok()) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "block row=%u col=%u: %s", index.row, index.col, valid.message()));
  }
  BlockDirectory& mine = state_->MutableDirectory();
  bool created = false;
  LocalBlock& here = mine.Mutable(index, state_->epoch, created);
  mine.CountMeasured(static_cast<std::int64_t>(block.evidence.CountMeasured()) -
                     static_cast<std::int64_t>(here.evidence.CountMeasured()));
  mine.CountArrays(here, -1);
  mine.CountArrays(block, +1);
  here = std::move(block);
  return absl::OkStatus();
}

LocalMapView LocalMap::View() {
  ++state_->epoch;
  return LocalMapView(state_->grid, state_->directory);
}

const LocalMapOptions& LocalMap::options() const {
  return state_->grid->options;
}

}  // namespace fathom::map
