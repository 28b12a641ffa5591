// A simulated survey of one window of terrain into a LocalMap, cell by cell
// with a known number of hits.

#ifndef FATHOM_TESTS_ACCURACY_SURVEY_H_
#define FATHOM_TESTS_ACCURACY_SURVEY_H_

#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "map/local/local_map.h"
#include "map/local/local_map_view.h"
#include "tests/accuracy/terrain.h"

namespace fathom::accuracy {

using Random = std::mt19937_64;

// A square of `cells` x `cells` cells of `cell_m` on a terrain; its south-west
// corner lies at (north_m, east_m) of it.
struct Window {
  const Terrain* terrain = nullptr;
  double north_m = 0;
  double east_m = 0;
  double cell_m = 10;
  int cells = 16;

  // Truth at metres north and east of the window's corner.
  std::optional<double> DepthAt(double north, double east) const {
    return terrain->DepthAt(north_m + north, east_m + east);
  }
};

// A random window all of whose terrain has a depth (checked at each node);
// nullopt if 2000 tries find none.
std::optional<Window> PickWindow(const Terrain& terrain, double cell_m,
                                 int cells, Random& random);

// A uniformly random place in cell (i, j) of a window: metres north and east
// of the window's corner.
struct Place {
  double north_m = 0;
  double east_m = 0;
};
Place RandomPlace(const Window& window, int i, int j, Random& random);

struct Sounding {
  Place place;
  double depth_m = 0;
  double std_m = 0;
};

// One exact-position sounding with noise N(0, std_m^2), stated as std_m.
Sounding SoundAt(const Window& window, const Place& place, double std_m,
                 Random& random);

// How a survey is made.
struct SurveyPlan {
  map::EstimatorKind estimator = map::EstimatorKind::kAdaptive;
  double std_m = 0.3;
  int hits = 1;
  // Share of cells that get their hits; the others get none.
  double covered = 1.0;
  double smoothing_distance_cells = 0;
  double smoothing_scale = 0;
  map::PriorSource prior = nullptr;
};

// An empty map of the window's grid, made for `plan`.
map::LocalMap MakeMap(const Window& window, const SurveyPlan& plan);

// Feeds soundings as the beams of pings whose vehicle is at the window's
// corner. Returns the beams that the map accepted.
std::uint32_t Feed(const std::vector<Sounding>& soundings,
                   const map::PriorSource& prior, map::LocalMap& map);

// Makes the map, gives each covered cell its hits at random places.
map::LocalMap MakeSurvey(const Window& window, const SurveyPlan& plan,
                         Random& random);

// A depth that is asked about at a place of known truth; metres.
struct Question {
  map::DepthEstimate estimate;  // Of the place's cell.
  double truth_m = 0;
  double depth_m = 0;
};

// Asks four questions about each cell that the map has an estimate of: at
// random places, at depths up to four stated std and half a metre above and
// below the floor elsewhere in the cell - independent of the map and of the
// place.
void ForEachQuestion(const Window& window, const map::LocalMapView& view,
                     double std_m, Random& random,
                     const std::function<void(const Question&)>& ask);

}  // namespace fathom::accuracy

#endif  // FATHOM_TESTS_ACCURACY_SURVEY_H_
