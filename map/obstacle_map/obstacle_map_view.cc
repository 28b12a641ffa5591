#include "map/obstacle_map/obstacle_map_view.h"

#include <cmath>
#include <limits>
#include <utility>

#include "map/obstacle_map/digest.h"

namespace fathom::map {
namespace {

SeabedEstimate FromActivity(const DepthEstimate& estimate,
                            const ActivityView& activity) {
  return {.estimate = estimate, .local = true, .activity = &activity.id};
}

void AddEvidence(const PackedEvidence* cell, Digest64& digest) {
  if (cell == nullptr) return;
  digest.Add(cell->weight);
  digest.Add(cell->mean_m);
  digest.Add(cell->scatter);
  digest.Add(uint64_t{cell->shoalest_time} << 32 | cell->time_count);
}

void AddBlock(BlockIndex index, const LocalBlock& block, Digest64& digest) {
  digest.Add(uint64_t{index.row} << 32 | index.col);
  digest.Add(uint64_t{block.evidence.window_s()} << 32 | block.evidence.size());
  for (std::size_t k = 0; k < kBlockCells; ++k) {
    AddEvidence(block.evidence.Find(k), digest);
    AddEvidence(block.evidence.FindTransferred(k), digest);
    const CellPrior prior = block.prior(k);
    digest.Add(prior.depth_m);
    digest.Add(prior.std_m);
    digest.Add(static_cast<uint64_t>(prior.kind));
    digest.Add(prior.hazard_m);
  }
  for (const NervegnaCell& cell : block.nervegna) {
    digest.Add(cell.mean_m);
    digest.Add(cell.variance_m2);
  }
  for (const PendingShoal& shoal : block.pending) {
    digest.Add(shoal.depth_m);
    digest.Add(shoal.std_m);
    digest.Add(uint64_t{shoal.time_s} << 32 | uint64_t{shoal.cell} << 16 |
               shoal.since);
  }
}

void AddPoint(const ContactPoint& point, Digest64& digest) {
  digest.Add(static_cast<uint64_t>(point.contact_class) << 8 |
             static_cast<uint64_t>(point.status));
  for (const Time time : {point.time, point.report_time, point.track_start}) {
    digest.Add(static_cast<uint64_t>(time.time_since_epoch().count()));
  }
  digest.Add(point.frame_origin.latitude_deg);
  digest.Add(point.frame_origin.longitude_deg);
  for (const double value : point.x) {
    digest.Add(value);
  }
  for (const double value : point.P.reshaped()) {
    digest.Add(value);
  }
  for (const double value : {point.top_depth_m, point.keel_depth_m,
                             point.depth_std_m, point.radius_m}) {
    digest.Add(value);
  }
  digest.Add(point.report_count);
}

void AddActivity(const ActivityView& activity, Digest64& digest) {
  digest.Add(std::string_view(activity.id.value));
  digest.Add(activity.measurements_accepted);
  digest.Add(activity.rejects.total());
  digest.Add(activity.cells_measured);
  if (activity.local.has_value()) {
    activity.local->ForEachBlock(
        [&digest](BlockIndex index, const LocalBlock& block) {
          AddBlock(index, block, digest);
        });
  }
}

void AddContact(const Contact& contact, Digest64& digest) {
  digest.Add(std::string_view(contact.key().source.value));
  digest.Add(std::string_view(contact.key().contact.value));
  const TrackHistory& history = contact.history();
  for (std::size_t i = 0; i < history.size(); ++i) {
    AddPoint(history[i], digest);
  }
  for (std::size_t i = 0; i < contact.older().size(); ++i) {
    AddPoint(contact.older()[i], digest);
  }
  for (std::size_t i = 0; i < contact.recent().size(); ++i) {
    const RecentReport& recent = contact.recent()[i];
    digest.Add(
        static_cast<uint64_t>(recent.report.time.time_since_epoch().count()));
    digest.Add(uint64_t{recent.points} << 1 | (recent.gated ? 1u : 0u));
  }
  if (contact.links() == nullptr) return;
  digest.Add(
      static_cast<uint64_t>(contact.links()->since.time_since_epoch().count()));
  for (const ContactKey& name : contact.links()->names) {
    digest.Add(std::string_view(name.source.value));
    digest.Add(std::string_view(name.contact.value));
  }
}

}  // namespace

ObstacleMapView::ObstacleMapView(Parts parts) : parts_(std::move(parts)) {
  for (auto it = parts_.activities.rbegin(); it != parts_.activities.rend();
       ++it) {
    if ((*it)->open()) {
      open_newest_first_.push_back(it->get());
    }
  }
}

const ActivityView* ObstacleMapView::FindActivity(const ActivityId& id) const {
  for (const auto& activity : parts_.activities) {
    if (activity->id == id) {
      return activity.get();
    }
  }
  return nullptr;
}

std::optional<SeabedEstimate> ObstacleMapView::SeabedAt(
    const GeodeticPoint& point, LayerChoice layers) const {
  std::optional<SeabedEstimate> seabed = JoinLayers(point, layers);
  if (!seabed.has_value() || layers == LayerChoice::kGlobalOnly) return seabed;
  // What waits for a second sounding where nothing was measured yet.
  for (const ActivityView* activity : open_newest_first_) {
    if (!activity->local->any_pending()) continue;
    // fmin: of a NaN and a number the number.
    seabed->estimate.hazard_m = std::fmin(
        seabed->estimate.hazard_m, activity->local->PendingHazardAt(point));
  }
  return seabed;
}

std::optional<SeabedEstimate> ObstacleMapView::JoinLayers(
    const GeodeticPoint& point, LayerChoice layers) const {
  // One variable on all ways out, filled where it stands: a copy would wait for
  // its parts to leave the store buffer.
  std::optional<SeabedEstimate> seabed;
  std::optional<SeabedEstimate> smoothed;
  if (layers != LayerChoice::kGlobalOnly) {
    for (const ActivityView* activity : open_newest_first_) {
      const std::optional<DepthEstimate> local = activity->local->At(point);
      if (!local.has_value()) continue;
      if (local->kind == EvidenceKind::kMeasured) {
        seabed = FromActivity(*local, *activity);
        return seabed;
      }
      if (!smoothed.has_value() || local->std_m < smoothed->estimate.std_m) {
        smoothed = FromActivity(*local, *activity);
      }
    }
  }
  if (layers != LayerChoice::kLocalOnly) {
    DepthEstimate& chart = seabed.emplace().estimate;
    // Smoothing may know less of a place than a good chart does.
    if (parts_.global.Read(point, chart) &&
        (!smoothed.has_value() || chart.kind == EvidenceKind::kMeasured ||
         chart.kind == EvidenceKind::kLand ||
         chart.std_m < smoothed->estimate.std_m)) {
      return seabed;
    }
    seabed.reset();
  }
  if (smoothed.has_value()) {
    seabed = smoothed;
    return seabed;
  }
  if (layers == LayerChoice::kGlobalOnly) return seabed;
  for (const ActivityView* activity : open_newest_first_) {
    const std::optional<DepthEstimate> prior = activity->local->DefaultPrior();
    if (prior.has_value() && activity->local->Contains(point)) {
      seabed = FromActivity(*prior, *activity);
      return seabed;
    }
  }
  return seabed;
}

std::optional<SeabedEstimate> ObstacleMapView::SeabedInActivity(
    const ActivityView& activity, const GeodeticPoint& point) const {
  if (!activity.open() || !activity.local->Contains(point)) {
    return std::nullopt;
  }
  std::optional<DepthEstimate> local = activity.local->At(point);
  if (!local.has_value()) {
    local = activity.local->DefaultPrior();
  }
  if (!local.has_value()) {
    return std::nullopt;
  }
  return FromActivity(*local, activity);
}

ObstacleAnswer ObstacleMapView::Answer(const ObstacleQuery& query) const {
  return map::Answer(query, SeabedAt(query.position), parts_.contacts,
                     {.ageing_rate_m2_s = parts_.ageing_rate_m2_s});
}

std::string ObstacleMapView::Digest() const {
  Digest64 digest;
  parts_.global.ForEachLeaf([&digest](const CellKey& key, const Leaf& leaf) {
    digest.Add(uint64_t{key.level} << 56 ^ uint64_t{key.row} << 28 ^ key.col);
    digest.Add(leaf.depth_m);
    digest.Add(uint64_t{leaf.time_s} << 32 | uint64_t{leaf.spread_code} << 24 |
               uint64_t{leaf.residual_code} << 16 | leaf.std_code);
    digest.Add(leaf.hazard_m);
  });
  for (const auto& activity : parts_.activities) {
    AddActivity(*activity, digest);
  }
  parts_.contacts.ForEach(
      [&digest](const Contact& contact) { AddContact(contact, digest); });
  return digest.Hex();
}

std::shared_ptr<const ObstacleMapView> ObstacleMapView::AtRest() const {
  Parts parts = parts_;
  parts.global = parts.global.AtRest();
  return std::make_shared<const ObstacleMapView>(std::move(parts));
}

uint64_t ObstacleMapView::memory_bytes() const {
  uint64_t bytes = parts_.global.tile_use().memory_bytes;
  for (const ActivityView* activity : open_newest_first_) {
    bytes += activity->local->memory_bytes();
  }
  return bytes;
}

}  // namespace fathom::map
