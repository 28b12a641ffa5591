#include "tests/accuracy/survey.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <utility>

namespace fathom::accuracy {
namespace {

// Where the plane lies on the Earth: nothing depends on it.
constexpr map::GeodeticPoint kCorner = {.latitude_deg = 41.5,
                                        .longitude_deg = -70.7};
constexpr Time kSurveyTime{std::chrono::seconds(1'790'000'000)};

}  // namespace

std::optional<Window> PickWindow(const Terrain& terrain, double cell_m,
                                 int cells, Random& random) {
  const double side_m = cell_m * cells;
  const double room_north_m = terrain.north_extent_m() - side_m;
  const double room_east_m = terrain.east_extent_m() - side_m;
  if (room_north_m <= 0 || room_east_m <= 0) return std::nullopt;
  std::uniform_real_distribution<double> share;
  for (int attempt = 0; attempt < 2000; ++attempt) {
    const Window window{.terrain = &terrain,
                        .north_m = room_north_m * share(random),
                        .east_m = room_east_m * share(random),
                        .cell_m = cell_m,
                        .cells = cells};
    bool full = true;
    const double step_m = std::min(terrain.pixel_m(), side_m);
    for (double north = 0; north <= side_m && full; north += step_m) {
      for (double east = 0; east <= side_m && full; east += step_m) {
        full = window.DepthAt(north, east).has_value();
      }
    }
    if (full) return window;
  }
  return std::nullopt;
}

Place RandomPlace(const Window& window, int i, int j, Random& random) {
  // A little inside, so that rounding never puts it next door.
  std::uniform_real_distribution<double> share(0.001, 0.999);
  const double north = share(random);
  const double east = share(random);
  return {.north_m = (i + north) * window.cell_m,
          .east_m = (j + east) * window.cell_m};
}

Sounding SoundAt(const Window& window, const Place& place, double std_m,
                 Random& random) {
  std::normal_distribution<double> noise(0, std_m);
  return {.place = place,
          .depth_m = window.DepthAt(place.north_m, place.east_m).value() +
                     noise(random),
          .std_m = std_m};
}

map::LocalMap MakeMap(const Window& window, const SurveyPlan& plan) {
  auto map = map::LocalMap::Create(
      {.south_west = kCorner,
       .north_extent_m = window.cells * window.cell_m,
       .east_extent_m = window.cells * window.cell_m,
       .cell_size_m = window.cell_m,
       .estimator = plan.estimator,
       .max_range_m = 1e5,
       .smoothing_distance_m = plan.smoothing_distance_cells * window.cell_m,
       .smoothing_scale = plan.smoothing_scale});
  if (!map.ok()) {
    std::fprintf(stderr, "accuracy: %s\n", map.status().ToString().c_str());
    std::abort();
  }
  return *std::move(map);
}

std::uint32_t Feed(const std::vector<Sounding>& soundings,
                   const map::PriorSource& prior, map::LocalMap& map) {
  map::Ping ping;
  ping.time = kSurveyTime;
  ping.pose.position = kCorner;
  for (const Sounding& sounding : soundings) {
    ping.beams.push_back({.range_m = static_cast<float>(std::hypot(
                              sounding.place.north_m, sounding.place.east_m)),
                          .bearing_rad = static_cast<float>(std::atan2(
                              sounding.place.east_m, sounding.place.north_m)),
                          .depth_m = static_cast<float>(sounding.depth_m),
                          .std_m = static_cast<float>(sounding.std_m)});
  }
  return map.Update(ping, prior).accepted;
}

map::LocalMap MakeSurvey(const Window& window, const SurveyPlan& plan,
                         Random& random) {
  map::LocalMap map = MakeMap(window, plan);
  std::bernoulli_distribution covered(plan.covered);
  std::vector<Sounding> soundings;
  for (int i = 0; i < window.cells; ++i) {
    for (int j = 0; j < window.cells; ++j) {
      if (!covered(random)) continue;
      for (int hit = 0; hit < plan.hits; ++hit) {
        soundings.push_back(SoundAt(window, RandomPlace(window, i, j, random),
                                    plan.std_m, random));
      }
    }
  }
  // In random order, as a survey's passes would come: `nervegna` smooths.
  std::shuffle(soundings.begin(), soundings.end(), random);
  Feed(soundings, plan.prior, map);
  return map;
}

void ForEachQuestion(const Window& window, const map::LocalMapView& view,
                     double std_m, Random& random,
                     const std::function<void(const Question&)>& ask) {
  constexpr int kQuestionsPerCell = 4;
  const double most_m = 4 * std_m + 0.5;
  std::uniform_real_distribution<double> above_m(-most_m, most_m);
  for (int i = 0; i < window.cells; ++i) {
    for (int j = 0; j < window.cells; ++j) {
      const auto estimate = view.AtCell({.i = i, .j = j});
      if (!estimate) continue;
      for (int n = 0; n < kQuestionsPerCell; ++n) {
        const Place at = RandomPlace(window, i, j, random);
        const Place level = RandomPlace(window, i, j, random);
        const double truth_m = window.DepthAt(at.north_m, at.east_m).value();
        const double floor_m =
            window.DepthAt(level.north_m, level.east_m).value();
        ask({.estimate = *estimate,
             .truth_m = truth_m,
             .depth_m = floor_m + above_m(random)});
      }
    }
  }
}

}  // namespace fathom::accuracy
