#include "map/obstacle_map/obstacle_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"

namespace fathom::map {
namespace {

absl::Status NotOpen(const ActivityId& id, bool was_started) {
  if (was_started) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "activity_id=%s has ended; start a new activity under a new id",
        id.value));
  }
  return absl::NotFoundError(absl::StrFormat(
      "activity_id=%s was never started; start it first", id.value));
}

// Whether any corner cell of the area lies in the square.
bool Overlaps(const RootSquare& root, const LocalMapView& area) {
  const int32_t north = static_cast<int32_t>(area.cells_north()) - 1;
  const int32_t east = static_cast<int32_t>(area.cells_east()) - 1;
  const std::array<CellIndex, 4> corners = {
      CellIndex{0, 0}, CellIndex{north, 0}, CellIndex{0, east},
      CellIndex{north, east}};
  return std::any_of(
      corners.begin(), corners.end(), [&](const CellIndex& corner) {
        return root.Locate(area.CellCenter(corner), 0).has_value();
      });
}

// Side of the leaves to which local cells of this size are written.
double LeafSizeM(const RootSquare& root, double cell_size_m) {
  return root.cell_size_m(root.LevelFor(cell_size_m));
}

// Areas of the size of blocks, by row and column of blocks from the map's
// south-west corner; they go on beyond its borders.
class BlockAreas {
 public:
  explicit BlockAreas(const LocalMapView& local) : local_(local) {}

  using Index = std::pair<int64_t, int64_t>;
  using Set = std::set<Index>;

  // The block with this south-west corner.
  Index IndexOf(const GeodeticPoint& south_west) const {
    const NedPoint corner = local_.frame().ToNed(south_west);
    const double block_m = local_.options().cell_size_m * kBlockSide;
    return {std::llround(corner.north_m / block_m),
            std::llround(corner.east_m / block_m)};
  }

  // What lies beside `blocks` within three quarters (half a diagonal) of
  // `leaf_cells` local cells, of which leaves hear kMaxSamplesPerSide.
  static Set Around(const Set& blocks, double leaf_cells) {
    const double heard =
        std::min(leaf_cells, double{GlobalMap::kMaxSamplesPerSide});
    const auto reach =
        static_cast<int64_t>(std::ceil(0.75 * heard / kBlockSide));
    Set around;
    for (const auto& [row, col] : blocks) {
      for (int64_t r = row - reach; r <= row + reach; ++r) {
        for (int64_t c = col - reach; c <= col + reach; ++c) {
          if (!blocks.contains({r, c})) around.emplace(r, c);
        }
      }
    }
    return around;
  }

  AreaCorners Corners(int64_t row, int64_t col) const {
    return {Corner(row, col), Corner(row + 1, col), Corner(row + 1, col + 1),
            Corner(row, col + 1)};
  }

 private:
  // The last row and column are cut at the map's border, as its blocks are.
  static double Line(int64_t index, int64_t cells) {
    const int64_t blocks = (cells + kBlockSide - 1) / kBlockSide;
    return static_cast<double>(index < blocks
                                   ? index * kBlockSide
                                   : cells + (index - blocks) * kBlockSide);
  }
  GeodeticPoint Corner(int64_t row, int64_t col) const {
    const double cell_m = local_.options().cell_size_m;
    return local_.frame().ToGeodetic(Line(row, local_.cells_north()) * cell_m,
                                     Line(col, local_.cells_east()) * cell_m);
  }

  const LocalMapView& local_;
};

}  // namespace

ObstacleMap::ObstacleMap(MissionOptions options)
    : options_(options),
      global_(options_.global),
      global_view_(global_.View()),
      contacts_(options_.contacts) {}

absl::Status ObstacleMap::Start(const StartActivity& event) {
  if (activity_slot_.contains(event.id)) {
    return absl::AlreadyExistsError(
        absl::StrFormat("activity_id=%s was used before in this mission; "
                        "choose a new id",
                        event.id.value));
  }
  if (open_.size() >= options_.max_open_activities) {
    return absl::ResourceExhaustedError(absl::StrFormat(
        "%u activities are open, max_open_activities=%u; complete one first",
        static_cast<unsigned>(open_.size()), options_.max_open_activities));
  }
  if (activities_.size() >= options_.max_activities) {
    return absl::ResourceExhaustedError(absl::StrFormat(
        "the mission has had %u activities, max_activities=%u; start a new "
        "mission",
        static_cast<unsigned>(activities_.size()), options_.max_activities));
  }
  FATHOM_ASSIGN_OR_RETURN(LocalMap local, LocalMap::Create(event.options));
  const LocalMapView empty = local.View();
  const uint64_t cells =
      uint64_t{empty.cells_north()} * uint64_t{empty.cells_east()};
  if (cells > options_.max_local_cells) {
    return absl::ResourceExhaustedError(absl::StrFormat(
        "the area has %u cells, max_local_cells=%u; make it smaller or its "
        "cells larger",
        cells, options_.max_local_cells));
  }
  if (!Overlaps(options_.global.root, empty)) {
    return absl::OutOfRangeError(
        "no corner of the activity's area lies in the mission's square; "
        "GetMissionStatus states the square");
  }
  ActivityView view;
  view.id = event.id;
  view.vehicle_id = event.vehicle_id;
  view.start = event.start;
  view.options = event.options;
  view.cells_north = empty.cells_north();
  view.cells_east = empty.cells_east();
  activity_slot_.emplace(event.id, activities_.size());
  activities_.push_back(nullptr);  // Filled by View().
  open_.emplace(event.id, OpenActivity{std::move(local), std::move(view)});
  Advance(Time{});
  return absl::OkStatus();
}

absl::StatusOr<LocalMap::UpdateResult> ObstacleMap::ApplyPing(
    const Ping& ping) {
  const auto found = open_.find(ping.activity);
  if (found == open_.end()) {
    return absl::NotFoundError(
        absl::StrFormat("activity_id=%s is not open", ping.activity.value));
  }
  OpenActivity& open = found->second;
  LocalMap::UpdateResult result = open.local.Update(
      ping,
      [this](const GeodeticPoint& point) { return global_view_.At(point); });
  open.view.measurements_accepted += result.accepted;
  open.view.rejects.Merge(result.rejects);
  open.changed = true;
  Advance(result.accepted > 0 ? ping.time : Time{});
  return result;
}

ContactOutcome ObstacleMap::ApplyContact(const ContactReport& report) {
  ContactOutcome outcome = contacts_.Apply(report);
  if (!outcome.applied && outcome.reason.has_value()) {
    counters_.contact_rejects.Add(*outcome.reason);
  }
  Advance(outcome.applied ? report.time : Time{});
  return outcome;
}

absl::StatusOr<ContactOutcome> ObstacleMap::Drop(const DropContact& event) {
  ContactOutcome outcome = contacts_.Drop(event.key, event.time);
  if (!outcome.applied) {
    return absl::NotFoundError(
        absl::StrFormat("no live contact contact_id=%s of source_id=%s",
                        event.key.contact.value, event.key.source.value));
  }
  Advance(Time{});
  return outcome;
}

TransferResult ObstacleMap::TransferEvidence(OpenActivity& open) {
  TransferResult result;
  result.leaves_before = global_view_.known_leaf_count();
  const LocalMapView local = open.local.View();
  const GlobalMap::CellSource evidence = [&local](const GeodeticPoint& center) {
    return local.EvidenceAt(center);
  };
  const BlockAreas areas(local);
  BlockAreas::Set measured;
  local.ForEachMeasuredArea(
      [&](const AreaCorners& corners, size_t measured_cells) {
        measured.insert(areas.IndexOf(corners[0]));
        result.local_cells += measured_cells;
        const GlobalMap::WriteSummary written =
            global_.MergeArea(corners, open.view.options.cell_size_m, evidence);
        result.leaves_written += written.leaves_written;
        result.degraded += written.degraded;
      });
  // Larger leaves reach into the measured areas from beside them.
  const double cell_m = open.view.options.cell_size_m;
  const double leaf_m = LeafSizeM(options_.global.root, cell_m);
  if (leaf_m > cell_m) {
    for (const auto& [row, col] : areas.Around(measured, leaf_m / cell_m)) {
      result.leaves_written +=
          global_.MergeShoals(areas.Corners(row, col), cell_m, evidence)
              .leaves_written;
    }
  }
  result.leaves_after_write = global_.CountKnownLeaves();
  global_.Conglomerate(MergeRule::kRange, OpenAreas(&open));
  global_view_ = global_.View();
  result.leaves_after = global_view_.known_leaf_count();
  counters_.degraded += result.degraded;
  return result;
}

std::vector<LatticeBox> ObstacleMap::OpenAreas(const OpenActivity* but) {
  std::vector<LatticeBox> areas;
  for (auto& [id, open] : open_) {
    if (&open == but) continue;
    const LocalMapView local = open.local.View();
    const double cell_m = open.view.options.cell_size_m;
    // A cell more to each side: a global cell may stand out of the area.
    const double rim_m =
        std::max(cell_m, LeafSizeM(options_.global.root, cell_m));
    const double north_m = cell_m * local.cells_north() + rim_m;
    const double east_m = cell_m * local.cells_east() + rim_m;
    const NedFrame& frame = local.frame();
    const auto box = options_.global.root.BoxAround(
        {frame.ToGeodetic(-rim_m, -rim_m), frame.ToGeodetic(north_m, -rim_m),
         frame.ToGeodetic(north_m, east_m), frame.ToGeodetic(-rim_m, east_m)});
    if (box.has_value()) areas.push_back(*box);
  }
  return areas;
}

absl::StatusOr<TransferResult> ObstacleMap::Transfer(const ActivityId& id) {
  const auto found = open_.find(id);
  if (found == open_.end()) {
    return NotOpen(id, activity_slot_.contains(id));
  }
  OpenActivity& open = found->second;
  const TransferResult result = TransferEvidence(open);
  open.local.MarkTransferred();
  open.changed = true;
  Advance(Time{});
  return result;
}

absl::StatusOr<TransferResult> ObstacleMap::Complete(const ActivityId& id,
                                                     bool discard) {
  const auto found = open_.find(id);
  if (found == open_.end()) {
    return NotOpen(id, activity_slot_.contains(id));
  }
  OpenActivity& open = found->second;
  TransferResult result;
  if (!discard) {
    result = TransferEvidence(open);
  } else {
    // What was kept for this activity need not be kept any more.
    global_.Conglomerate(MergeRule::kRange, OpenAreas(&open));
    global_view_ = global_.View();
  }
  open.view.cells_measured = open.local.View().cells_measured();
  open.view.local.reset();
  activities_[activity_slot_.at(id)] =
      std::make_shared<const ActivityView>(std::move(open.view));
  open_.erase(found);
  Advance(Time{});
  return result;
}

absl::StatusOr<ImportResult> ObstacleMap::Import(const RasterBlock& block,
                                                 bool last) {
  ImportResult result;
  result.leaves_before = global_view_.known_leaf_count();
  FATHOM_ASSIGN_OR_RETURN(const GlobalMap::ImportSummary imported,
                          global_.ImportRaster(block));
  result.cells_with_depth = imported.cells_with_depth;
  result.cells_land = imported.cells_land;
  result.cells_unknown = imported.cells_unknown;
  result.cells_outside = imported.cells_outside;
  result.degraded = imported.degraded;
  counters_.degraded += imported.degraded;
  if (last) {
    global_.Conglomerate(MergeRule::kRange, OpenAreas(nullptr));
  }
  global_view_ = global_.View();
  result.leaves_after = global_view_.known_leaf_count();
  Advance(Time{});
  return result;
}

absl::StatusOr<MergeResult> ObstacleMap::MergeMap(
    const GlobalMapView& other, Time other_as_of,
    const GlobalMap::MapMergeOptions& options) {
  MergeResult result;
  result.leaves_before = global_view_.known_leaf_count();
  const GlobalMap::WriteSummary written = global_.MergeMap(other, options);
  if (written.degraded > 0) {
    return absl::ResourceExhaustedError(absl::StrFormat(
        "max_cells=%u is too small for both maps: %u cells found no leaf of "
        "their size",
        options_.global.max_cells, written.degraded));
  }
  result.leaves_written = written.leaves_written;
  result.leaves_kept = written.kept_measured;
  global_.Conglomerate(MergeRule::kRange, OpenAreas(nullptr));
  global_view_ = global_.View();
  result.leaves_after = global_view_.known_leaf_count();
  Advance(other_as_of);
  return result;
}

std::shared_ptr<const ObstacleMapView> ObstacleMap::View() {
  for (auto& [id, open] : open_) {
    if (open.changed) {
      Refresh(open);
    }
  }
  if (global_.over_budget()) global_view_ = global_.View();
  return std::make_shared<const ObstacleMapView>(ObstacleMapView::Parts{
      .revision = revision_,
      .as_of = as_of_,
      .global = global_view_,
      .activities = activities_,
      .contacts = contacts_.View(),
      .ageing_rate_m2_s = options_.ageing_rate_m2_s,
      .counters = counters_,
  });
}

absl::Status ObstacleMap::RestoreTile(TileKey key, TileContent content) {
  return global_.RestoreTile(key, std::move(content));
}

absl::Status ObstacleMap::RestoreTile(RestoredTile tile) {
  return global_.RestoreTile(std::move(tile));
}

absl::Status ObstacleMap::RestoreActivity(const StoredActivity& stored) {
  FATHOM_ASSIGN_OR_RETURN(LocalMap local,
                          LocalMap::Create(stored.start.options));
  ActivityView view;
  view.id = stored.start.id;
  view.vehicle_id = stored.start.vehicle_id;
  view.start = stored.start.start;
  view.options = stored.start.options;
  const LocalMapView empty = local.View();
  view.cells_north = empty.cells_north();
  view.cells_east = empty.cells_east();
  view.measurements_accepted = stored.measurements_accepted;
  view.rejects = stored.rejects;
  view.cells_measured = stored.cells_measured;
  if (!activity_slot_.emplace(view.id, activities_.size()).second) {
    return absl::DataLossError(
        absl::StrFormat("activity_id=%s is stored twice", view.id.value));
  }
  if (stored.open) {
    activities_.push_back(nullptr);
    open_.emplace(view.id, OpenActivity{std::move(local), view});
  } else {
    activities_.push_back(
        std::make_shared<const ActivityView>(std::move(view)));
  }
  return absl::OkStatus();
}

absl::Status ObstacleMap::RestoreBlock(const ActivityId& id, BlockIndex index,
                                       LocalBlock block) {
  const auto found = open_.find(id);
  if (found == open_.end()) {
    return absl::DataLossError(absl::StrFormat(
        "a stored block names activity_id=%s, which is not open", id.value));
  }
  return found->second.local.RestoreBlock(index, std::move(block));
}

absl::Status ObstacleMap::RestoreContact(StoredContact stored) {
  return contacts_.Restore(std::move(stored));
}

absl::Status ObstacleMap::RestoreRevision(uint64_t revision, Time as_of) {
  FATHOM_RETURN_IF_ERROR(global_.FinishRestore());
  global_view_ = global_.View();
  revision_ = revision;
  as_of_ = as_of;
  return absl::OkStatus();
}

void ObstacleMap::Advance(Time evidence_time) {
  ++revision_;
  as_of_ = std::max(as_of_, evidence_time);
}

void ObstacleMap::Refresh(OpenActivity& open) {
  open.view.local = open.local.View();
  open.view.cells_measured = open.view.local->cells_measured();
  activities_[activity_slot_.at(open.view.id)] =
      std::make_shared<const ActivityView>(open.view);
  open.changed = false;
}

}  // namespace fathom::map
