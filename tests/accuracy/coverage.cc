// Coverage of the predictive std: OptimalFigures, CoverageFigures,
// SmoothedFigures, BadPriorFigures.

#include <array>
#include <cmath>

#include "tests/accuracy/figures.h"
#include "tests/accuracy/survey.h"

namespace fathom::accuracy {
namespace {

using map::EstimatorKind;

constexpr std::array kEstimators = {
    EstimatorKind::kAdaptive, EstimatorKind::kNervegna, EstimatorKind::kKalman};
constexpr int kTruthsPerCell = 20;

// Counts truths within 1, 2 and 3 std.
class Coverage {
 public:
  void Add(const map::DepthEstimate& estimate, double truth_m) {
    const double z = std::abs(truth_m - estimate.depth_m) / estimate.std_m;
    ++count_;
    for (std::size_t k = 0; k < 3; ++k) {
      within_[k] += z <= static_cast<double>(k) + 1;
    }
    square_ += z * z;
  }
  void WriteTo(nlohmann::json& row) const {
    row["truths"] = count_;
    row["within_1std_percent"] = 100.0 * within_[0] / count_;
    row["within_2std_percent"] = 100.0 * within_[1] / count_;
    row["within_3std_percent"] = 100.0 * within_[2] / count_;
    row["normalised_square"] = square_ / count_;
  }

 private:
  std::array<double, 3> within_ = {};
  double square_ = 0;
  double count_ = 0;
};

// Adds random truths of each cell of `kind`.
void Check(const Window& window, const map::LocalMapView& view,
           map::EvidenceKind kind, Random& random, Coverage& coverage) {
  for (int i = 0; i < window.cells; ++i) {
    for (int j = 0; j < window.cells; ++j) {
      const auto estimate = view.AtCell({.i = i, .j = j});
      if (!estimate || estimate->kind != kind) continue;
      for (int n = 0; n < kTruthsPerCell; ++n) {
        const Place at = RandomPlace(window, i, j, random);
        coverage.Add(*estimate, window.DepthAt(at.north_m, at.east_m).value());
      }
    }
  }
}

// rmse of the cells' depths against the mean of their truth.
double MeanRmse(const Window& window, const map::LocalMapView& view) {
  double square = 0;
  int count = 0;
  constexpr int kGrid = 8;
  for (int i = 0; i < window.cells; ++i) {
    for (int j = 0; j < window.cells; ++j) {
      const auto estimate = view.AtCell({.i = i, .j = j});
      if (!estimate) continue;
      double mean_m = 0;
      for (int row = 0; row < kGrid; ++row) {
        for (int col = 0; col < kGrid; ++col) {
          mean_m += window
                        .DepthAt((i + (row + 0.5) / kGrid) * window.cell_m,
                                 (j + (col + 0.5) / kGrid) * window.cell_m)
                        .value() /
                    (kGrid * kGrid);
        }
      }
      square += std::pow(estimate->depth_m - mean_m, 2);
      ++count;
    }
  }
  return std::sqrt(square / count);
}

// Calls visit(window, random) for each seed whose window the scene has.
template <typename Visit>
void ForEachWindow(const Scene& scene, int seeds, Visit visit) {
  for (int seed = 1; seed <= seeds; ++seed) {
    Random random(static_cast<std::uint64_t>(seed));
    const auto window =
        PickWindow(scene.terrain, scene.cell_m, scene.cells, random);
    if (window) visit(*window, random);
  }
}

}  // namespace

nlohmann::json OptimalFigures(int seeds) {
  const Terrain flat = Terrain::Flat(20);
  auto rows = nlohmann::json::array();
  for (const int hits : {1, 10, 100}) {
    nlohmann::json row = {{"hits", hits}};
    for (const EstimatorKind estimator : kEstimators) {
      double square = 0;
      for (int seed = 1; seed <= seeds; ++seed) {
        Random random(static_cast<std::uint64_t>(seed));
        const Window window{.terrain = &flat, .cell_m = 10, .cells = 32};
        const SurveyPlan plan{
            .estimator = estimator, .std_m = 0.5, .hits = hits};
        map::LocalMap map = MakeSurvey(window, plan, random);
        square += std::pow(MeanRmse(window, map.View()), 2) / seeds;
      }
      row[std::string(EstimatorName(estimator))] =
          std::sqrt(square) / (0.5 / std::sqrt(hits));
    }
    rows.push_back(row);
  }
  return rows;
}

nlohmann::json CoverageFigures(const std::vector<Scene>& scenes, int seeds) {
  auto rows = nlohmann::json::array();
  for (const Scene& scene : scenes) {
    for (const int hits : {1, 3, 10, 100}) {
      for (const EstimatorKind estimator : kEstimators) {
        Coverage coverage;
        ForEachWindow(scene, seeds, [&](const Window& window, Random& random) {
          const SurveyPlan plan{
              .estimator = estimator, .std_m = scene.std_m, .hits = hits};
          map::LocalMap map = MakeSurvey(window, plan, random);
          Check(window, map.View(), map::EvidenceKind::kMeasured, random,
                coverage);
        });
        nlohmann::json row = {{"scene", scene.name},
                              {"hits", hits},
                              {"estimator", EstimatorName(estimator)}};
        coverage.WriteTo(row);
        rows.push_back(row);
      }
    }
  }
  return rows;
}

nlohmann::json SmoothedFigures(const std::vector<Scene>& scenes, int seeds) {
  auto rows = nlohmann::json::array();
  for (const Scene& scene : scenes) {
    for (const double covered : {0.1, 0.33}) {
      Coverage coverage;
      ForEachWindow(scene, seeds, [&](const Window& window, Random& random) {
        const SurveyPlan plan{.std_m = scene.std_m,
                              .hits = 3,
                              .covered = covered,
                              .smoothing_distance_cells = 2,
                              .smoothing_scale = 0.9};
        map::LocalMap map = MakeSurvey(window, plan, random);
        Check(window, map.View(), map::EvidenceKind::kSmoothed, random,
              coverage);
      });
      nlohmann::json row = {{"scene", scene.name}, {"covered", covered}};
      coverage.WriteTo(row);
      rows.push_back(row);
    }
  }
  return rows;
}

nlohmann::json BadPriorFigures(const std::vector<Scene>& scenes, int seeds) {
  auto rows = nlohmann::json::array();
  for (const Scene& scene : scenes) {
    for (const int hits : {1, 2, 3}) {
      double with = 0;
      double without = 0;
      ForEachWindow(scene, seeds, [&](const Window& window, Random& random) {
        SurveyPlan plan{.std_m = scene.std_m, .hits = hits};
        Random same = random;
        map::LocalMap plain = MakeSurvey(window, plan, random);
        const double middle_m = window
                                    .DepthAt(0.5 * scene.cells * scene.cell_m,
                                             0.5 * scene.cells * scene.cell_m)
                                    .value();
        plan.prior = [middle_m](const map::GeodeticPoint&) {
          return map::DepthEstimate{
              .depth_m = static_cast<float>(middle_m + 15),
              .std_m = 5,
              .kind = map::EvidenceKind::kPrior};
        };
        map::LocalMap misled = MakeSurvey(window, plan, same);
        without += std::pow(MeanRmse(window, plain.View()), 2);
        with += std::pow(MeanRmse(window, misled.View()), 2);
      });
      rows.push_back({{"scene", scene.name},
                      {"hits", hits},
                      {"rmse_ratio", std::sqrt(with / without)}});
    }
  }
  return rows;
}

}  // namespace fathom::accuracy
