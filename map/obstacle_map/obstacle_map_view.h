// ObstacleMapView: the whole map - open activities, global quadtree, contacts
// - as it was at one revision.
//
// Immutable; any number of threads may read it, for as long as they hold it,
// while the writer goes on. Holding one keeps the pieces alive that the
// writer has replaced since, so hold it for a question, not for an hour.
#ifndef FATHOM_MAP_OBSTACLE_MAP_OBSTACLE_MAP_VIEW_H_
#define FATHOM_MAP_OBSTACLE_MAP_OBSTACLE_MAP_VIEW_H_

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/time.h"
#include "map/contacts/contact_map.h"
#include "map/geodesy/ids.h"
#include "map/geodesy/points.h"
#include "map/global/global_map.h"
#include "map/local/local_map.h"
#include "map/query/obstacle_query.h"

namespace fathom::map {

// One activity: its parameters, its counters and, while it is open, its map.
struct ActivityView {
  ActivityId id;
  std::string vehicle_id;
  Time start;
  LocalMapOptions options;
  // Cells to the north and to the east.
  uint32_t cells_north = 0;
  uint32_t cells_east = 0;
  // Measurements fused and refused since its start.
  uint64_t measurements_accepted = 0;
  RejectCounts rejects;
  // Cells with evidence; of an ended activity: at its end.
  uint64_t cells_measured = 0;
  // Absent once the activity has ended.
  std::optional<LocalMapView> local;

  bool open() const { return local.has_value(); }
};

// What the map has counted since the mission began; stored with it.
struct MissionCounters {
  // Updates of the global map that went to a coarser leaf because max_cells
  // was reached.
  uint64_t degraded = 0;
  // Contact reports that the tracker refused.
  RejectCounts contact_rejects;

  friend bool operator==(const MissionCounters&,
                         const MissionCounters&) = default;
};

// Which layers a seabed estimate may come from.
enum class LayerChoice { kJoined, kLocalOnly, kGlobalOnly };

// See file comment.
class ObstacleMapView {
 public:
  // What a view is made of; ObstacleMap fills it.
  struct Parts {
    uint64_t revision = 0;
    Time as_of{};
    GlobalMapView global;
    // In the order of their start; ended ones included.
    std::vector<std::shared_ptr<const ActivityView>> activities;
    ContactsView contacts;
    // Variance added per second of age of the evidence, m^2/s, >= 0
    // (domain.md section 1, "time"); 0: the thesis's map, which never ages.
    double ageing_rate_m2_s = 0;
    MissionCounters counters;
  };

  explicit ObstacleMapView(Parts parts);

  // The same for who keeps it for long, to compare a later one with it and to
  // ask nothing else: see GlobalMapView::AtRest.
  std::shared_ptr<const ObstacleMapView> AtRest() const;

  // Grows by one with every applied event.
  uint64_t revision() const { return parts_.revision; }
  // Time of the newest evidence; the epoch if there is none.
  Time as_of() const { return parts_.as_of; }
  const GlobalMapView& global() const { return parts_.global; }
  const std::vector<std::shared_ptr<const ActivityView>>& activities() const {
    return parts_.activities;
  }
  // The open ones, the newest first: the order in which points ask them.
  const std::vector<const ActivityView*>& open_newest_first() const {
    return open_newest_first_;
  }
  const ContactsView& contacts() const { return parts_.contacts; }
  double ageing_rate_m2_s() const { return parts_.ageing_rate_m2_s; }
  const MissionCounters& counters() const { return parts_.counters; }

  // The activity, open or ended; nullptr if there never was one.
  const ActivityView* FindActivity(const ActivityId& id) const;

  // The seabed under `point`. With kJoined the layers are joined so: a
  // measured cell of an open activity (the newest activity first), else a
  // measured leaf of the global map, else the surest smoothed cell, else the
  // chart in the global map, else an activity's default prior. nullopt:
  // nothing covers the point (the answer is UNKNOWN).
  //
  // The returned reason points into this view: do not outlive it.
  std::optional<SeabedEstimate> SeabedAt(
      const GeodeticPoint& point,
      LayerChoice layers = LayerChoice::kJoined) const;

  // The seabed in one open activity's local map alone (its default prior
  // included); nullopt where that map says nothing.
  std::optional<SeabedEstimate> SeabedInActivity(
      const ActivityView& activity, const GeodeticPoint& point) const;

  // "Is there an obstacle at this location, at this time, with this level of
  // certainty?" (domain.md section 1).
  ObstacleAnswer Answer(const ObstacleQuery& query) const;

  // 16 hexadecimal digits over everything that answers depend on, in an order
  // that does not depend on how the map came about; equal maps have equal
  // digests. The revision is left out. O(size of the map).
  std::string Digest() const;

  // Heap memory of the maps, bytes (approximate; pieces shared with other
  // views count here too, and of the global map those that only they hold).
  uint64_t memory_bytes() const;

 private:
  // SeabedAt without the soundings that wait.
  std::optional<SeabedEstimate> JoinLayers(const GeodeticPoint& point,
                                           LayerChoice layers) const;

  Parts parts_;
  std::vector<const ActivityView*> open_newest_first_;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_OBSTACLE_MAP_OBSTACLE_MAP_VIEW_H_
