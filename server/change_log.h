// ChangeLog: where and what the map has changed of late, for those who watch.
//
// It is shown one view of the map after the other and compares each with the
// one before: blocks of local maps, tiles of the global map and contacts are
// copy-on-write, so that what was not touched is not looked at. What changed is
// kept once a piece, in the order of its last change (change_order.h); of the
// views only the newest.
//
// Watchers hold a ChangeNumber each and no view: they ask what changed behind
// it and read that from the newest view. So a slow one costs nothing but the
// number, and neither does the writer of the map, who knows nothing of this.
//
// Thread-safe; one mutex, held for some hundred microseconds at most.

#ifndef FATHOM_SERVER_CHANGE_LOG_H_
#define FATHOM_SERVER_CHANGE_LOG_H_

#include <compare>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/functional/function_ref.h"
#include "base/mutex.h"
#include "map/geodesy/ids.h"
#include "map/obstacle_map/obstacle_map_view.h"
#include "server/change_order.h"
#include "server/geo_box.h"
#include "server/limits.h"

namespace fathom::server {

// Bounds of a log; the defaults are the server's, tests take smaller ones.
struct ChangeLogOptions {
  size_t most_areas = kMaxKeptChanges;
  size_t most_contacts = kMaxKeptChanges;
  size_t most_areas_at_once = kMaxAreasAtOnce;
  // Contacts that have a number, those that are gone too.
  size_t most_names = 4 * kMaxKeptChanges;
};

// See file comment.
class ChangeLog {
 public:
  using ViewPtr = std::shared_ptr<const map::ObstacleMapView>;

  // `run` names this log to readers: a number of another run means nothing
  // here. Not 0.
  ChangeLog(uint64_t run, ChangeLogOptions options)
      : run_(run),
        options_(options),
        areas_(options.most_areas),
        contacts_(options.most_contacts) {}

  uint64_t run() const { return run_; }

  // Begins with this view: what was before it is past.
  void Restart(ViewPtr view);
  // The next view of the same map; an older one is passed over, and of one of
  // the same revision only the view is kept. REQUIRES: Restart; one call at a
  // time.
  void Show(ViewPtr view);
  // Lets go of the view. Restart before the next use.
  void Rest();

  // The newest view. REQUIRES of this and all below: Restart.
  ViewPtr view() const;

  // What a reader who has seen `seen` is told.
  struct Read {
    // What to read from.
    ViewPtr view;
    // Changes behind `seen` were forgotten: start anew.
    bool lost = false;
    // What has been told: the next `seen`.
    ChangeNumber seen;
  };

  // Calls `visit` for each area in which the map's seabed has changed since.
  Read ReadAreas(ChangeNumber seen,
                 absl::FunctionRef<void(const GeoBox&)> visit) const;

  // Calls `visit` for each contact that has changed since, or is no longer
  // held: a small number that stands for it.
  Read ReadContacts(ChangeNumber seen,
                    absl::FunctionRef<void(uint32_t)> visit) const;
  // The same for every contact of the view.
  Read ReadAllContacts(absl::FunctionRef<void(uint32_t)> visit) const;
  // The contact that such a number stands for; nullopt if what was read up to
  // `seen` has been lost since.
  std::optional<map::ContactKey> ContactOf(uint32_t number,
                                           ChangeNumber seen) const;

 private:
  // A block of an activity, a tile of the global map, or (with no block) a
  // whole activity: small numbers that tell them apart.
  struct AreaKey {
    // Index of the activity; kGlobal, kEverywhere.
    int64_t owner = 0;
    uint64_t piece = 0;

    friend bool operator==(const AreaKey&, const AreaKey&) = default;
    template <typename H>
    friend H AbslHashValue(H hash, const AreaKey& key) {
      return H::combine(std::move(hash), key.owner, key.piece);
    }
  };
  uint32_t NumberOf(const map::ContactKey& key) FATHOM_REQUIRES(mutex_);
  void RestartContacts(const map::ObstacleMapView& view)
      FATHOM_REQUIRES(mutex_);
  std::vector<AreaKey> AreasChanged(const map::ObstacleMapView& before,
                                    const map::ObstacleMapView& now) const;
  static GeoBox BoxOf(const AreaKey& area, const map::ObstacleMapView& before,
                      const map::ObstacleMapView& now);

  const uint64_t run_;
  const ChangeLogOptions options_;

  mutable Mutex mutex_;
  ViewPtr view_ FATHOM_GUARDED_BY(mutex_);
  ChangeOrder<AreaKey, GeoBox> areas_ FATHOM_GUARDED_BY(mutex_);
  // Contacts by number; it needs no place.
  struct Empty {};
  ChangeOrder<uint32_t, Empty> contacts_ FATHOM_GUARDED_BY(mutex_);
  std::vector<map::ContactKey> names_ FATHOM_GUARDED_BY(mutex_);
  absl::flat_hash_map<map::ContactKey, uint32_t> numbers_
      FATHOM_GUARDED_BY(mutex_);
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_CHANGE_LOG_H_
