// Rocks narrower than a cell: HazardFigures.

#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>

#include "map/contacts/contacts_view.h"
#include "map/query/obstacle_query.h"
#include "tests/accuracy/figures.h"
#include "tests/accuracy/survey.h"

namespace fathom::accuracy {
namespace {

struct ChartedHazard {
  double least_m = 0;  // Least depth.
  double floor_m = 0;  // Depth of the nearest charted sounding.
};

std::vector<std::vector<std::string>> ReadCsv(const std::string& path) {
  std::vector<std::vector<std::string>> rows;
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::vector<std::string>& fields = rows.emplace_back();
    std::istringstream text(line);
    std::string field;
    while (std::getline(text, field, ',')) fields.push_back(field);
    fields.resize(7);
  }
  return rows;
}

// All hazards of the chart. One without a least depth (S-57 VALSOU) gets what
// its WATLEV says: covers and uncovers or awash, the datum; always under
// water, half of the depth around. Every one stands at least `height_m` above
// its floor.
std::vector<ChartedHazard> ReadHazards(const std::string& folder,
                                       double height_m) {
  const auto soundings = ReadCsv(folder + "/US5HA57M_soundg.csv");
  std::vector<ChartedHazard> hazards;
  for (const auto& row : ReadCsv(folder + "/US5HA57M_hazards.csv")) {
    const double lon = std::stod(row[1]);
    const double lat = std::stod(row[2]);
    double nearest = 1e9;
    ChartedHazard hazard;
    for (const auto& sounding : soundings) {
      const double apart =
          std::hypot((std::stod(sounding[0]) - lon) * std::cos(lat / 57.3),
                     std::stod(sounding[1]) - lat);
      if (apart >= nearest) continue;
      nearest = apart;
      hazard.floor_m = std::stod(sounding[2]);
    }
    if (!row[3].empty()) {
      hazard.least_m = std::stod(row[3]);
    } else {
      hazard.least_m = row[4] == "3" ? 0.5 * hazard.floor_m : 0;
    }
    hazard.floor_m = std::max(hazard.floor_m, hazard.least_m + height_m);
    hazards.push_back(hazard);
  }
  return hazards;
}

// What hazards cost in one survey without rocks: counts of cells, and of
// questions about water at depths about the seabed.
struct Cost {
  int cells = 0;
  int with_hazard = 0;
  int water = 0;
  int free = 0;
  int lost = 0;  // Free but for the hazard.

  Cost& operator+=(const Cost& other) {
    cells += other.cells;
    with_hazard += other.with_hazard;
    water += other.water;
    free += other.free;
    lost += other.lost;
    return *this;
  }
};

bool IsFree(const map::DepthEstimate& estimate, double depth_m) {
  map::ObstacleQuery query;
  query.depth_m = depth_m;
  const map::SeabedEstimate seabed = {.estimate = estimate, .local = true};
  return map::Answer(query, seabed, map::ContactsView()).state ==
         map::ObstacleState::kFree;
}

Cost CostOf(const Scene& scene, int hits, int seed) {
  Cost cost;
  Random random(static_cast<std::uint64_t>(1000 * seed + hits));
  const auto window =
      PickWindow(scene.terrain, scene.cell_m, scene.cells, random);
  if (!window) return cost;
  const SurveyPlan plan{.std_m = scene.std_m, .hits = hits};
  map::LocalMap map = MakeSurvey(*window, plan, random);
  const map::LocalMapView view = map.View();
  for (int i = 0; i < window->cells; ++i) {
    for (int j = 0; j < window->cells; ++j) {
      const auto estimate = view.AtCell({.i = i, .j = j});
      if (!estimate) continue;
      ++cost.cells;
      cost.with_hazard += !std::isnan(estimate->hazard_m);
    }
  }
  ForEachQuestion(
      *window, view, scene.std_m, random, [&cost](const Question& question) {
        if (question.truth_m <= question.depth_m) return;
        ++cost.water;
        map::DepthEstimate plain = question.estimate;
        plain.hazard_m = std::numeric_limits<float>::quiet_NaN();
        if (!IsFree(plain, question.depth_m)) return;
        ++(IsFree(question.estimate, question.depth_m) ? cost.free : cost.lost);
      });
  return cost;
}

nlohmann::json ToRow(const std::string& scene, int hits, const Cost& cost) {
  const double cells = std::max(1, cost.cells);
  const double water = std::max(1, cost.water);
  return {{"scene", scene},
          {"hits", hits},
          {"cells_with_hazard_percent", 100 * cost.with_hazard / cells},
          {"water_free_percent", 100 * cost.free / water},
          {"free_lost_to_hazards_percent", 100 * cost.lost / water}};
}

}  // namespace

nlohmann::json HazardFigures(const std::string& chart_folder,
                             const Terrain& terrain, int seeds) {
  constexpr double kStdM = 0.1;
  constexpr double kLeastHeightM = 0.8;
  const std::vector<ChartedHazard> hazards =
      ReadHazards(chart_folder, kLeastHeightM);
  const map::ContactsView no_contacts;
  auto rows = nlohmann::json::array();
  for (const int hits : {1, 2, 3, 10, 30, 100}) {
    std::array<int, 4> states = {};
    int rocks = 0;
    // What the rock costs elsewhere: cells without one that are not free 1 m
    // above their shoalest truth.
    int clean = 0;
    int clean_free = 0;
    for (int seed = 1; seed <= seeds; ++seed) {
      Random random(static_cast<std::uint64_t>(seed));
      for (const ChartedHazard& hazard : hazards) {
        // Real relief, lowered so that its middle is the charted floor.
        const auto window = PickWindow(terrain, 10, 3, random);
        if (!window) continue;
        const double lower_m = hazard.floor_m - window->DepthAt(15, 15).value();
        std::vector<Sounding> soundings;
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) {
            for (int hit = 0; hit < hits; ++hit) {
              Sounding sounding = SoundAt(
                  *window, RandomPlace(*window, i, j, random), kStdM, random);
              sounding.depth_m += lower_m;
              if (i == 1 && j == 1 && hit == hits / 2) {
                std::normal_distribution<double> noise(0, kStdM);
                sounding.depth_m = hazard.least_m + noise(random);
              }
              soundings.push_back(sounding);
            }
          }
        }
        const SurveyPlan plan{.std_m = kStdM, .hits = hits};
        map::LocalMap map = MakeMap(*window, plan);
        Feed(soundings, nullptr, map);
        const map::LocalMapView view = map.View();
        const auto ask = [&](int i, int j, double depth_m) {
          map::ObstacleQuery query;
          query.depth_m = depth_m;
          std::optional<map::SeabedEstimate> seabed;
          if (const auto estimate = view.AtCell({.i = i, .j = j})) {
            seabed = map::SeabedEstimate{.estimate = *estimate, .local = true};
          }
          return map::Answer(query, seabed, no_contacts).state;
        };
        ++rocks;
        ++states[static_cast<std::size_t>(ask(1, 1, hazard.least_m)) - 1];
        for (const int k : {0, 2}) {
          double shoalest_m = 1e9;
          for (int n = 0; n < 100; ++n) {
            const Place at = RandomPlace(*window, k, k, random);
            shoalest_m = std::min(
                shoalest_m,
                lower_m + window->DepthAt(at.north_m, at.east_m).value());
          }
          ++clean;
          clean_free += ask(k, k, shoalest_m - 1) == map::ObstacleState::kFree;
        }
      }
    }
    rows.push_back({{"hits", hits},
                    {"charted", hazards.size()},
                    {"rocks", rocks},
                    {"free", states[0]},
                    {"occupied", states[1]},
                    {"uncertain", states[2]},
                    {"unknown", states[3]},
                    {"clean_cells_free_1m_above_percent",
                     100.0 * clean_free / std::max(1, clean)}});
  }
  return rows;
}

nlohmann::json HazardCostFigures(const std::vector<Scene>& scenes, int seeds) {
  constexpr std::array kHits = {1, 3, 10, 100};
  auto rows = nlohmann::json::array();
  std::array<Cost, kHits.size()> all;
  for (const Scene& scene : scenes) {
    for (std::size_t h = 0; h < kHits.size(); ++h) {
      Cost cost;
      for (int seed = 1; seed <= seeds; ++seed) {
        cost += CostOf(scene, kHits[h], seed);
      }
      rows.push_back(ToRow(scene.name, kHits[h], cost));
      all[h] += cost;
    }
  }
  for (std::size_t h = 0; h < kHits.size(); ++h) {
    rows.push_back(ToRow("all", kHits[h], all[h]));
  }
  return rows;
}

}  // namespace fathom::accuracy
