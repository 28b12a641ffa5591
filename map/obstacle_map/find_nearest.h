// "What is the nearest thing that I must not run into?": the nearest place that
// is not passable at depth z, or contact, within a radius.
//
// What counts:
//   - a place that is OCCUPIED by the seabed: P_static >= c at z + h;
//   - a place with a point hazard (a rock narrower than its cell) at or above
//     z + h, however small P is there;
//   - a place that is UNKNOWN, unless unknown counts as free. Beyond the
//     mission's square everything is, where no activity reaches;
//   - a contact whose depths, widened by kDepthSigmas of their standard
//     deviation, meet [z - h, z + h]: however uncertain its place, it is where
//     it is predicted, a disc of its radius.
// Other UNCERTAIN places do not count: ask with a lower confidence for those.
//
// Places are the cells of the finest layers, each judged by what
// ObstacleMapView::SeabedAt says of its middle, and as far away as their
// nearest point: every cell of an open activity, and every cell of the global
// map's finest level at whose middle no activity speaks. Tests hold the answer
// to a search through all of them. Leaves far from any activity are judged
// whole, and parts of the global map whose shoalest depth is below z + h are
// not opened (c > 0.5, so OCCUPIED needs a mean no deeper than z + h).
//
// Distances are geodesics to a point of the cell's border that is good to 1e-9
// of the square of its side (metres; 0.1 m for a cell of 10 km).
//
// Best first: cost grows with what lies nearer than the answer. About 1 us a
// leaf, 0.3 us a cell of an activity. Pure; thread-safe.

#ifndef FATHOM_MAP_OBSTACLE_MAP_FIND_NEAREST_H_
#define FATHOM_MAP_OBSTACLE_MAP_FIND_NEAREST_H_

#include <atomic>
#include <cstdint>
#include <optional>

#include "absl/status/statusor.h"
#include "map/geodesy/ids.h"
#include "map/geodesy/points.h"
#include "map/obstacle_map/obstacle_map_view.h"
#include "map/query/obstacle_query.h"

namespace fathom::map {

// The longest search radius, metres.
inline constexpr double kMaxSearchRadiusM = 50'000;

// Three sigma: a depth beyond them is one in 740.
inline constexpr double kDepthSigmas = 3;

struct NearestQuestion {
  // From where, how deep, when, c and h. radius_m is not looked at.
  ObstacleQuery query;
  // In (0, kMaxSearchRadiusM], metres.
  double search_radius_m = 0;
  // A place without evidence counts as FREE; else as OCCUPIED.
  bool unknown_is_free = false;
};

struct NearestSearch {
  // Cells and parts of the map that may be looked at: about 4 s at most.
  std::uint64_t most_cells = 4'000'000;
  // Ends the work within 0.1 ms after it becomes true; null: never.
  const std::atomic<bool>* stop = nullptr;
};

struct NearestObstacle {
  // The nearest point of the cell, or of the contact's disc.
  GeodeticPoint position;
  // From the place asked, along the geodesic. 0: it lies inside.
  double distance_m = 0;
  // True bearing there at the place asked, in [0, 360); 0 at no distance.
  double bearing_deg = 0;
  // Why it counts: the answer at the cell's middle, or at the contact's
  // predicted place. Reasons point into the view.
  ObstacleAnswer answer;
  // The contact, if it is one.
  std::optional<ContactKey> contact;
};

// The nearest; nullopt: none within the radius. Errors: INVALID_ARGUMENT
// (ValidateQuery; the radius); RESOURCE_EXHAUSTED past most_cells; CANCELLED
// (stop).
absl::StatusOr<std::optional<NearestObstacle>> FindNearestObstacle(
    const ObstacleMapView& view, const NearestQuestion& question,
    const NearestSearch& search = {});

}  // namespace fathom::map

#endif  // FATHOM_MAP_OBSTACLE_MAP_FIND_NEAREST_H_
