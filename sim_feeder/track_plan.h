// A lawnmower over a survey area that stays over navigable water.
//
// Parallel legs along the longer side, one track spacing apart, driven to and
// fro. Where land or shoal water cuts a leg, its wet pieces are driven and
// joined by the shortest way over water (A* on a grid, then pulled straight).
// Only the largest connected water of the area is used, so that every piece
// can be reached.

#ifndef FATHOM_SIM_FEEDER_TRACK_PLAN_H_
#define FATHOM_SIM_FEEDER_TRACK_PLAN_H_

#include <vector>

#include "absl/status/statusor.h"
#include "sim_feeder/local_terrain.h"
#include "sim_feeder/survey_area.h"

namespace fathom::feeder {

// A place in the plane about the area's south-west corner, metres.
struct PlanePoint {
  double north_m = 0.0;
  double east_m = 0.0;
};

struct TrackPlanOptions {
  // Between neighbouring legs, metres, > 0.
  double spacing_m = 50.0;
  // Least depth of water in which the vehicle goes, metres.
  double min_water_m = 4.0;
  // How often the area is covered, 1 to 1000; every second time the legs run
  // across the first ones.
  int passes = 1;
};

// The corners of the track, in order; at least two, no two in a row equal.
//
// Errors: INVALID_ARGUMENT (options, or more than 4000 legs); NOT_FOUND when
// the area has no leg over water of min_water_m.
absl::StatusOr<std::vector<PlanePoint>> PlanTrack(
    const LocalTerrain& terrain, const SurveyArea& area,
    const TrackPlanOptions& options);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_TRACK_PLAN_H_
