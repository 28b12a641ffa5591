// The accuracy figures: what the static map says against truth that it has
// never seen. Each function makes its surveys from seeds 1..`seeds`, measures
// and returns rows for the report; the same seeds give the same figures.

#ifndef FATHOM_TESTS_ACCURACY_FIGURES_H_
#define FATHOM_TESTS_ACCURACY_FIGURES_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/accuracy/terrain.h"

namespace fathom::accuracy {

// Fine truth and the coarser cells that it is surveyed with.
struct Scene {
  std::string name;
  Terrain terrain;
  double cell_m = 10;
  int cells = 16;
  double std_m = 0.3;
};

// rmse of the mean against truth in units of sigma / sqrt(hits), on a flat
// floor, after 1, 10 and 100 hits, for each estimator.
nlohmann::json OptimalFigures(int seeds);

// Share of truth depths inside directly measured cells within 1, 2, 3
// predictive std, after 1, 3, 10, 100 hits a cell.
nlohmann::json CoverageFigures(const std::vector<Scene>& scenes, int seeds);

// The same for cells that were never measured: a third of the cells are.
nlohmann::json SmoothedFigures(const std::vector<Scene>& scenes, int seeds);

// Stated probability of an obstacle against observed frequency, ten bins, for
// each estimator on the same surveys and questions; Brier score; how many of
// the answers FREE at 0.95 were wrong.
nlohmann::json ReliabilityFigures(const std::vector<Scene>& scenes, int seeds);

// rmse of the cell means with a prior 15 m off, against no prior, after one,
// two and three hits a cell.
nlohmann::json BadPriorFigures(const std::vector<Scene>& scenes, int seeds);

// The rocks, wrecks and obstructions of a chart set into real relief, 10 m
// cells, `hits` soundings of 0.1 m of which one falls on the rock: how many
// are answered FREE at 0.95 at their charted depth.
nlohmann::json HazardFigures(const std::string& chart_folder,
                             const Terrain& terrain, int seeds);

// What hazards cost where there is no rock: of the water at depths about the
// seabed, the share that is answered FREE at 0.95 and the share that would be
// but for hazard_m; after 1, 3, 10, 100 hits a cell, estimator `adaptive`.
nlohmann::json HazardCostFigures(const std::vector<Scene>& scenes, int seeds);

// A recorded multibeam survey: odd pings fused, even pings verify.
nlohmann::json RecordedFigures(const std::string& soundings_csv_gz);

}  // namespace fathom::accuracy

#endif  // FATHOM_TESTS_ACCURACY_FIGURES_H_
