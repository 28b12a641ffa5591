#include "tests/accuracy/thesis_local.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "map/local/local_map.h"
#include "map/local/local_map_view.h"
#include "tests/accuracy/line_chart.h"
#include "tests/accuracy/survey.h"

namespace fathom::accuracy {
namespace {

constexpr double kCellM = 10;
constexpr int kCells = 50;
constexpr int kHits = 5;

// Mean depth of a cell: of 25 places in it.
double TruthOf(const Window& window, int i, int j) {
  double sum_m = 0;
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 5; ++b) {
      sum_m += window
                   .DepthAt((i + 0.1 + 0.2 * a) * kCellM,
                            (j + 0.1 + 0.2 * b) * kCellM)
                   .value();
    }
  }
  return sum_m / 25;
}

// Window and survey of one seed; nullopt where the terrain has no such window.
std::optional<std::pair<Window, map::LocalMapView>> Survey(
    const Terrain& terrain, map::EstimatorKind estimator, int seed) {
  Random random(static_cast<std::uint64_t>(seed));
  const std::optional<Window> window =
      PickWindow(terrain, kCellM, kCells, random);
  if (!window.has_value()) return std::nullopt;
  map::LocalMap map =
      MakeSurvey(*window, {.estimator = estimator, .hits = kHits}, random);
  return std::pair(*window, map.View());
}

map::CellIndex At(int i, int j) { return {.i = i, .j = j}; }

}  // namespace

nlohmann::json ThesisLocalFigures(const Terrain& terrain, int seeds) {
  auto rows = nlohmann::json::array();
  for (const auto& [estimator, name] :
       {std::pair(map::EstimatorKind::kNervegna, "nervegna"),
        std::pair(map::EstimatorKind::kAdaptive, "adaptive")}) {
    double within = 0;
    double cells = 0;
    double square_m2 = 0;
    double worst_m = 0;
    for (int seed = 1; seed <= seeds; ++seed) {
      const auto survey = Survey(terrain, estimator, seed);
      if (!survey.has_value()) continue;
      const auto& [window, view] = *survey;
      for (int i = 0; i < kCells; ++i) {
        for (int j = 0; j < kCells; ++j) {
          const auto estimate = view.AtCell(At(i, j));
          if (!estimate.has_value()) continue;
          const double error_m =
              std::abs(estimate->depth_m - TruthOf(window, i, j));
          within += error_m <= 3 * estimate->std_m;
          square_m2 += error_m * error_m;
          worst_m = std::max(worst_m, error_m);
          cells += 1;
        }
      }
    }
    rows.push_back({{"estimator", name},
                    {"cells", cells},
                    {"within_3std_percent", 100 * within / cells},
                    {"rmse_m", std::sqrt(square_m2 / cells)},
                    {"worst_m", worst_m}});
  }
  return rows;
}

bool DrawThesisLocal(const Terrain& terrain, const std::string& path) {
  const auto survey = Survey(terrain, map::EstimatorKind::kAdaptive, 1);
  if (!survey.has_value()) return false;
  const auto& [window, view] = *survey;
  LineChart chart{.title =
                      "Fig. 6-1: error of the depth in a row of local "
                      "cells, five soundings each",
                  .x_label = "east, m",
                  .y_label = "m"};
  ChartSeries error{.name = "error", .red = 0.84, .green = 0.37};
  ChartSeries above{.name = "3 std", .green = 0.62, .blue = 0.45};
  ChartSeries below{.name = "", .green = 0.62, .blue = 0.45};
  for (int j = 0; j < kCells; ++j) {
    const auto estimate = view.AtCell(At(kCells / 2, j));
    if (!estimate.has_value()) return false;
    chart.x.push_back((j + 0.5) * kCellM);
    error.values.push_back(estimate->depth_m - TruthOf(window, kCells / 2, j));
    above.values.push_back(3 * estimate->std_m);
    below.values.push_back(-3 * estimate->std_m);
  }
  chart.series = {above, below, error};
  return DrawChart(chart, path);
}

}  // namespace fathom::accuracy
