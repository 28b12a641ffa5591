// ObstacleMap: the integrated mapping system (Nervegna 2002, fig. 1-2) - the
// local maps of the open activities, the global quadtree and the contacts
// behind one writer interface. This is what the server drives.
//
// One thread writes; readers use View(), which is immutable. Everything is
// deterministic: the same events in the same order give the same map, bit for
// bit, whether they come from the wire or are replayed from the journal
// behind restored pieces. No I/O, no clock.
//
// Restore order: RestoreTile for each tile, RestoreActivity (with blocks),
// RestoreContact, RestoreRevision; then the journal's events by the ordinary
// calls.
#ifndef FATHOM_MAP_OBSTACLE_MAP_OBSTACLE_MAP_H_
#define FATHOM_MAP_OBSTACLE_MAP_OBSTACLE_MAP_H_

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"
#include "map/contacts/contact_map.h"
#include "map/contacts/contact_report.h"
#include "map/geodesy/ids.h"
#include "map/geodesy/ping.h"
#include "map/global/global_map.h"
#include "map/local/local_map.h"
#include "map/obstacle_map/events.h"
#include "map/obstacle_map/obstacle_map_view.h"

namespace fathom::map {

// Bounds and parameters of a mission's map.
struct MissionOptions {
  GlobalMapOptions global;
  ContactMapOptions contacts;
  // See ObstacleMapView::Parts.
  double ageing_rate_m2_s = 0;
  // One activity per vehicle; a shore server may have a small fleet.
  uint32_t max_open_activities = 64;
  // 100 M: four areas of 5 km x 5 km at 1 m (domain.md section 4).
  uint64_t max_local_cells = 100'000'000;
  // Ended activities stay listed; past this the mission refuses a new one.
  uint32_t max_activities = 10'000;
};

// What transferring a local map did.
struct TransferResult {
  // Local cells with evidence.
  uint64_t local_cells = 0;
  uint64_t leaves_written = 0;
  // Updates that went to a coarser leaf because max_cells was reached.
  uint64_t degraded = 0;
  // Leaves of the global map before, after writing, after conglomeration.
  uint64_t leaves_before = 0;
  uint64_t leaves_after_write = 0;
  uint64_t leaves_after = 0;
};

// What loading one block of a chart did.
struct ImportResult {
  uint64_t cells_with_depth = 0;
  uint64_t cells_land = 0;
  uint64_t cells_unknown = 0;
  uint64_t cells_outside = 0;
  uint64_t degraded = 0;
  uint64_t leaves_before = 0;
  uint64_t leaves_after = 0;
};

// What merging another mission's map did.
struct MergeResult {
  uint64_t leaves_written = 0;
  // Places where what was here stayed: measured under a chart.
  uint64_t leaves_kept = 0;
  uint64_t leaves_before = 0;
  uint64_t leaves_after = 0;
};

// An activity as stored; blocks follow by RestoreBlock.
struct StoredActivity {
  StartActivity start;
  bool open = false;
  uint64_t measurements_accepted = 0;
  RejectCounts rejects;
  uint64_t cells_measured = 0;
};

// See file comment.
class ObstacleMap {
 public:
  explicit ObstacleMap(MissionOptions options);

  // Opens an activity. Errors: ALREADY_EXISTS (the id was used before),
  // RESOURCE_EXHAUSTED (a bound of MissionOptions), OUT_OF_RANGE (no corner
  // of the area lies in the mission's square), INVALID_ARGUMENT (options).
  absl::Status Start(const StartActivity& event);

  // Fuses one ping into its activity's local map; measurements that the
  // thresholds refuse are counted, the others count. Errors: NOT_FOUND if the
  // activity is not open (nothing changed).
  absl::StatusOr<LocalMap::UpdateResult> ApplyPing(const Ping& ping);

  // Fuses or refuses one contact report; a refusal is not an error and
  // changes only counters.
  ContactOutcome ApplyContact(const ContactReport& report);

  // Closes a track; the outcome holds the marker for the history. Errors:
  // NOT_FOUND.
  absl::StatusOr<ContactOutcome> Drop(const DropContact& event);

  // Copies the evidence gathered since the last transfer into the global map
  // and conglomerates it (section 4.4.4; departures: domain.md section 5).
  // Errors: NOT_FOUND (no such open activity).
  absl::StatusOr<TransferResult> Transfer(const ActivityId& id);

  // Ends an activity: transfers unless `discard`, then frees the local map.
  // Errors: NOT_FOUND (never started), FAILED_PRECONDITION (has ended).
  absl::StatusOr<TransferResult> Complete(const ActivityId& id, bool discard);

  // Loads one block of an a-priori chart (section 4.4.3); `last` conglomerates
  // the global map behind it. Errors: INVALID_ARGUMENT (sizes, steps).
  absl::StatusOr<ImportResult> Import(const RasterBlock& block, bool last);

  // Takes over the global map of another mission (GlobalMap::MergeMap) and
  // conglomerates. Its open activities must have been completed, its contacts
  // are not taken. `other_as_of` is the time of its newest evidence. Errors:
  // RESOURCE_EXHAUSTED (max_cells is too small for both; this map is then to be
  // thrown away).
  absl::StatusOr<MergeResult> MergeMap(
      const GlobalMapView& other, Time other_as_of,
      const GlobalMap::MapMergeOptions& options);

  uint64_t revision() const { return revision_; }

  // The map as it is. O(open activities + changed pieces).
  std::shared_ptr<const ObstacleMapView> View();

  // Whether readers have unpacked so many tiles of the global map that a view
  // should be taken, and be read in the place of the last, to pack some.
  bool over_budget() const { return global_.over_budget(); }
  TileUse tile_use() const { return global_view_.tile_use(); }

  const MissionOptions& options() const { return options_; }

  // ---- Restoring a stored map; before any other change. ----
  absl::Status RestoreTile(TileKey key, TileContent content);
  absl::Status RestoreTile(RestoredTile tile);
  absl::Status RestoreActivity(const StoredActivity& stored);
  absl::Status RestoreBlock(const ActivityId& id, BlockIndex index,
                            LocalBlock block);
  absl::Status RestoreContact(StoredContact stored);
  void RestoreCounters(const MissionCounters& counters) {
    counters_ = counters;
  }
  // Ends the restoring; must be called, and last. Errors: DATA_LOSS (tiles
  // are missing or hang on none).
  absl::Status RestoreRevision(uint64_t revision, Time as_of);
  // While a journal is replayed behind the restored pieces: makes the revision
  // at least `revision`. Events that were refused took a revision and left no
  // record; what comes after them must get the numbers it had.
  void AdvanceRevision(uint64_t revision) {
    if (revision_ < revision) revision_ = revision;
  }

 private:
  struct OpenActivity {
    LocalMap local;
    // Parameters and counters; its `local` is filled by View().
    ActivityView view;
    // Whether anything changed since the last View().
    bool changed = true;
  };

  // Moves the evidence of `open` into the global map.
  TransferResult TransferEvidence(OpenActivity& open);
  // Where activities but `but` (none: null) are open: there the global map is
  // not conglomerated, so that their evidence meets what was measured, and two
  // vehicles' surveys of one place merge to the same map in either order.
  std::vector<LatticeBox> OpenAreas(const OpenActivity* but);
  // Counts one applied event, with evidence of the given time.
  void Advance(Time evidence_time);
  // The activity's slot in activities_ takes the present view.
  void Refresh(OpenActivity& open);

  MissionOptions options_;
  GlobalMap global_;
  // The global map as of its last change: where local priors come from.
  GlobalMapView global_view_;
  ContactMap contacts_;
  MissionCounters counters_;
  std::map<ActivityId, OpenActivity> open_;
  // All activities in the order of their start.
  std::vector<std::shared_ptr<const ActivityView>> activities_;
  std::map<ActivityId, size_t> activity_slot_;
  uint64_t revision_ = 0;
  Time as_of_{};
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_OBSTACLE_MAP_OBSTACLE_MAP_H_
