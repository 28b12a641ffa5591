// Where the truth comes from, as the command line states it: a raster, or
// ETOPO5 with seeded relief about a stated centre.
//
// `run` and `evaluate` build the same seabed from the same statement; the
// seed of the relief is its own, so that runs with different seeds survey one
// seabed. Not thread-safe (PROJ).

#ifndef FATHOM_SIM_FEEDER_TRUTH_SOURCE_H_
#define FATHOM_SIM_FEEDER_TRUTH_SOURCE_H_

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "sim_feeder/local_terrain.h"
#include "sim_feeder/raster_terrain.h"
#include "sim_feeder/shapes.h"
#include "sim_feeder/survey_area.h"

namespace fathom::feeder {

struct TruthOptions {
  // A raster; empty: ETOPO5 with relief.
  std::string path;
  Positive positive = Positive::kAuto;
  // ETOPO5's file, and where relief and search for an area have their centre.
  std::string etopo_path = std::string(kEtopo5Path);
  map::GeodeticPoint center = {.latitude_deg = 41.2, .longitude_deg = -71.4};
  double fine_cell_m = 10.0;
  ReliefOptions relief;
  // A level seabed of this depth in place of either; the area must be stated.
  std::optional<double> flat_depth_m;
  // Set on whichever seabed it is, with cells of shape_cell_m.
  std::vector<Shape> shapes;
  double shape_cell_m = 2.0;
};

class TruthSource {
 public:
  // Errors: as LoadRasterTerrain.
  static absl::StatusOr<TruthSource> Load(const TruthOptions& options);

  // The best square for a survey (survey_area.h); with ETOPO5 within 20 km of
  // the centre. Errors: as PickArea; FAILED_PRECONDITION for a level seabed.
  absl::StatusOr<PickedArea> Pick(double side_m, double cell_size_m,
                                  double min_depth_m) const;

  // The seabed about an area, with the margin that a sonar of that reach
  // needs. Errors: as RefineTerrain and LocalTerrain::Create.
  absl::StatusOr<std::shared_ptr<const LocalTerrain>> SeabedAbout(
      const SurveyArea& area, double max_slant_range_m) const;

  // What it is, for people.
  std::string Describe() const;

 private:
  explicit TruthSource(const TruthOptions& options) : options_(options) {}
  TruthSource(const TruthOptions& options, Terrain terrain);

  absl::StatusOr<std::shared_ptr<const LocalTerrain>> WithoutShapes(
      const SurveyArea& area, const PlaneBox& box) const;

  TruthOptions options_;
  std::shared_ptr<const Terrain> terrain_;  // Null: level.
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_TRUTH_SOURCE_H_
