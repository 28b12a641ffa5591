// The rectangle that a vehicle surveys, and how to find a good one.

#ifndef FATHOM_SIM_FEEDER_SURVEY_AREA_H_
#define FATHOM_SIM_FEEDER_SURVEY_AREA_H_

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "map/geodesy/points.h"
#include "sim_feeder/terrain.h"

namespace fathom::feeder {

// As fathom.v1.ActivityParameters has it: extents along the axes of the plane
// that touches the Earth at the south-west corner.
struct SurveyArea {
  map::GeodeticPoint south_west = {};
  double north_extent_m = 0.0;
  double east_extent_m = 0.0;
  // Side of a cell of the activity's local map.
  double cell_size_m = 10.0;
};

// Errors: INVALID_ARGUMENT naming what is not finite, not positive or smaller
// than two cells.
absl::Status ValidateArea(const SurveyArea& area);

struct AreaPickOptions {
  // Side of the square, metres, > 0.
  double side_m = 1'000.0;
  double cell_size_m = 10.0;
  // Depths in which the vehicle can work.
  double min_depth_m = 4.0;
  double max_depth_m = 500.0;
  // Search about this place and no farther than this; absent (0): the whole
  // raster about its middle.
  map::GeodeticPoint near = {};
  double search_radius_m = 0.0;
};

struct PickedArea {
  SurveyArea area;
  // Part of it with a depth in the range, in (0, 1].
  double usable_share = 0.0;
};

// The square with the most water in the depth range; of those with the same
// whole per cent, the one nearest to the middle (then the southernmost, then
// the westernmost: the result is repeatable). Corners are tried at a quarter
// of the side, the terrain is looked up at a sixteenth of it.
//
// Errors: INVALID_ARGUMENT (side); NOT_FOUND when no square has a tenth of
// usable water; RESOURCE_EXHAUSTED when the raster is more than 4000 sixteenths
// of the side across: state a place to search about.
absl::StatusOr<PickedArea> PickArea(const Terrain& terrain,
                                    const AreaPickOptions& options);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_SURVEY_AREA_H_
