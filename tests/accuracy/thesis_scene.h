// The scene of Nervegna 2002, section 6.1.2, on real relief: a root square of
// 1267 nmi with cells of at least 10 m, one local map of 500 m x 500 m at 10 m
// transferred and conglomerated with a tolerance of 0.5 m. The thesis reports
// some 220 cells and 28.2 kB on a terrain that it does not state.

#ifndef FATHOM_TESTS_ACCURACY_THESIS_SCENE_H_
#define FATHOM_TESTS_ACCURACY_THESIS_SCENE_H_

#include <array>
#include <cstdint>
#include <optional>

#include "map/geodesy/ned_frame.h"
#include "map/geodesy/points.h"
#include "map/global/global_map_view.h"
#include "tests/accuracy/terrain.h"

namespace fathom::accuracy {

// Over all windows. Leaves count unknown ones too (what max_cells bounds).
struct ThesisScene {
  int windows = 0;
  // By range with the mid-range as value, the map's own rule.
  std::uint64_t median_leaves = 0;
  std::uint64_t median_bytes = 0;  // The whole global map in RAM.
  std::uint64_t most_bytes = 0;
  // Greatest distance of a fine mean from the mean that replaced it, metres.
  double worst_m = 0;
  // Fig. 4-18 as printed, for comparison.
  std::uint64_t pairwise_median_leaves = 0;
  double pairwise_worst_m = 0;
  // A flat floor in the same place: what the border alone costs.
  std::uint64_t flat_median_leaves = 0;
};

// Surveys up to `windows` windows of 50 x 50 nodes of a terrain of 10 m, all
// wet, drawn evenly from all that there are by a fixed seed; each stands where
// it lies (the terrain's south-west corner at 41.5 N, 71.3 W), so that no two
// meet the quadtree alike, and is sounded in lines, every cell at its own time.
// About 5 ms a window.
ThesisScene MeasureThesisScene(const Terrain& terrain, int windows);

// The first of these windows, transferred and conglomerated.
struct ThesisWindow {
  map::GlobalMapView view;
  // Leaves before conglomeration.
  std::uint64_t fine_leaves = 0;
  // Of the terrain, and the window's corners: south-west, north-west,
  // north-east, south-east.
  map::NedFrame frame;
  std::array<map::GeodeticPoint, 4> corners;
};
// nullopt: the terrain has no wet window.
std::optional<ThesisWindow> FirstThesisWindow(const Terrain& terrain);

}  // namespace fathom::accuracy

#endif  // FATHOM_TESTS_ACCURACY_THESIS_SCENE_H_
