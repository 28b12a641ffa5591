// Reliability of obstacle answers: ReliabilityFigures.

#include <array>
#include <cmath>

#include "map/contacts/contacts_view.h"
#include "map/query/obstacle_query.h"
#include "tests/accuracy/figures.h"
#include "tests/accuracy/survey.h"

namespace fathom::accuracy {
namespace {

using map::EstimatorKind;

struct Bin {
  double stated = 0;
  double observed = 0;
  double answers = 0;
};

struct Tally {
  std::array<Bin, 10> bins = {};
  double brier = 0;
  double answers = 0;
  double free = 0;
  double free_wrong = 0;
  double occupied = 0;
  double occupied_wrong = 0;

  void Add(const map::ObstacleAnswer& answer, bool solid) {
    const double p = answer.probability;
    Bin& bin = bins[std::min<std::size_t>(9, static_cast<std::size_t>(10 * p))];
    bin.stated += p;
    bin.observed += solid;
    bin.answers += 1;
    brier += (p - solid) * (p - solid);
    answers += 1;
    if (answer.state == map::ObstacleState::kFree) {
      free += 1;
      free_wrong += solid;
    }
    if (answer.state == map::ObstacleState::kOccupied) {
      occupied += 1;
      occupied_wrong += !solid;
    }
  }
};

nlohmann::json ToRow(const std::string& scene, EstimatorKind estimator,
                     const Tally& tally) {
  auto bins = nlohmann::json::array();
  double worst = 0;
  for (const Bin& bin : tally.bins) {
    if (bin.answers == 0) continue;
    const double stated = bin.stated / bin.answers;
    const double observed = bin.observed / bin.answers;
    bins.push_back(
        {{"answers", bin.answers}, {"stated", stated}, {"observed", observed}});
    if (bin.answers >= 1000) {
      worst = std::max(worst, std::abs(stated - observed));
    }
  }
  return {
      {"scene", scene},
      {"estimator", EstimatorName(estimator)},
      {"answers", tally.answers},
      {"brier", tally.brier / tally.answers},
      {"worst_bin", worst},
      {"free_percent", 100 * tally.free / tally.answers},
      {"free_wrong_percent", 100 * tally.free_wrong / tally.free},
      {"occupied_wrong_percent", 100 * tally.occupied_wrong / tally.occupied},
      {"bins", bins}};
}

}  // namespace

nlohmann::json ReliabilityFigures(const std::vector<Scene>& scenes, int seeds) {
  constexpr std::array kEstimators = {EstimatorKind::kAdaptive,
                                      EstimatorKind::kNervegna,
                                      EstimatorKind::kKalman};
  const map::ContactsView no_contacts;
  auto rows = nlohmann::json::array();
  std::array<Tally, 3> all;
  for (const Scene& scene : scenes) {
    std::array<Tally, 3> tallies;
    for (int seed = 1; seed <= seeds; ++seed) {
      for (const int hits : {1, 3, 10}) {
        for (std::size_t e = 0; e < kEstimators.size(); ++e) {
          // Each estimator gets the same window, soundings and questions.
          Random random(static_cast<std::uint64_t>(1000 * seed + hits));
          const auto window =
              PickWindow(scene.terrain, scene.cell_m, scene.cells, random);
          if (!window) continue;
          const SurveyPlan plan{
              .estimator = kEstimators[e], .std_m = scene.std_m, .hits = hits};
          map::LocalMap map = MakeSurvey(*window, plan, random);
          ForEachQuestion(
              *window, map.View(), scene.std_m, random,
              [&](const Question& question) {
                map::ObstacleQuery query;
                query.depth_m = question.depth_m;
                const map::ObstacleAnswer answer = map::Answer(
                    query,
                    map::SeabedEstimate{.estimate = question.estimate,
                                        .local = true},
                    no_contacts);
                const bool solid = question.truth_m <= question.depth_m;
                tallies[e].Add(answer, solid);
                all[e].Add(answer, solid);
              });
        }
      }
    }
    for (std::size_t e = 0; e < kEstimators.size(); ++e) {
      rows.push_back(ToRow(scene.name, kEstimators[e], tallies[e]));
    }
  }
  for (std::size_t e = 0; e < kEstimators.size(); ++e) {
    rows.push_back(ToRow("all", kEstimators[e], all[e]));
  }
  return rows;
}

}  // namespace fathom::accuracy
