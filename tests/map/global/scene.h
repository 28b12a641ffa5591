// Small worlds for the tests of the global map.

#ifndef FATHOM_TESTS_MAP_GLOBAL_SCENE_H_
#define FATHOM_TESTS_MAP_GLOBAL_SCENE_H_

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "map/geodesy/ned_frame.h"
#include "map/global/global_map.h"
#include "map/global/root_square.h"

namespace fathom::map {

inline constexpr GeodeticPoint kNarragansett{.latitude_deg = 41.5,
                                             .longitude_deg = -71.3};

// A square of `side_m` about Narragansett Bay.
inline RootSquare SquareOf(double side_m, double min_cell_m) {
  return RootSquare::CenteredOn(kNarragansett, side_m, min_cell_m).value();
}

// The thesis's root (section 6.1.2): 1267 nmi, cells of at least 10 m.
inline RootSquare ThesisSquare() { return SquareOf(1267 * 1852.0, 10.0); }

inline DepthEstimate Measured(float depth_m, float std_m,
                              std::uint32_t time_s = 100) {
  return {.depth_m = depth_m,
          .std_m = std_m,
          .kind = EvidenceKind::kMeasured,
          .time_s = time_s};
}

// Corners SW, NW, NE, SE of a rectangle in a local frame.
inline std::array<GeodeticPoint, 4> Rectangle(const NedFrame& frame,
                                              double south_m, double north_m,
                                              double west_m, double east_m) {
  return {frame.ToGeodetic(south_m, west_m), frame.ToGeodetic(north_m, west_m),
          frame.ToGeodetic(north_m, east_m), frame.ToGeodetic(south_m, east_m)};
}

// A block of rows x columns cells about a point, all of one depth.
inline RasterBlock FlatRaster(const GeodeticPoint& north_west, double step_deg,
                              std::uint32_t rows, std::uint32_t columns,
                              float depth_m, float std_m) {
  RasterBlock block;
  block.north_west = north_west;
  block.latitude_step_deg = step_deg;
  block.longitude_step_deg = step_deg;
  block.rows = rows;
  block.columns = columns;
  block.depth_m.assign(std::size_t{rows} * columns, depth_m);
  block.std_m = {std_m};
  block.time_s = 50;
  return block;
}

// A map of the given max_level in whose middle a square of `side_cells` finest
// cells is surveyed: a gentle floor with ripples, so that no two depths are
// alike, `seconds` different times. For counting bytes.
inline GlobalMap SurveyedMap(int max_level, int side_cells,
                             std::uint32_t seconds) {
  // Cells of 10 m while the square stays within 1267 nmi, else finer.
  const double side_m =
      std::min(10.0 * std::ldexp(1.0, max_level), 1267 * 1852.0);
  const double cell_m = SquareOf(side_m, side_m).cell_size_m(max_level);
  GlobalMap map({.root = SquareOf(side_m, cell_m)});
  const NedFrame frame(kNarragansett);
  const double half_m = 0.5 * side_cells * cell_m;
  map.MergeArea(
      Rectangle(frame, -half_m, half_m, -half_m, half_m), cell_m,
      [&](const GeodeticPoint& p) {
        const NedPoint ned = frame.ToNed(p);
        const double north = ned.north_m / cell_m;
        const double east = ned.east_m / cell_m;
        const auto time_s = static_cast<std::uint32_t>(
            1'000'000 + std::abs(std::floor(7 * north) + std::floor(3 * east)));
        return Measured(
            static_cast<float>(30 + 0.02 * north + std::sin(0.7 * east)), 0.4f,
            time_s % seconds + 1'000'000);
      });
  return map;
}

using Leaves = std::map<CellKey, Leaf>;

inline Leaves LeavesOf(const GlobalMapView& view) {
  Leaves leaves;
  view.ForEachLeaf([&](const CellKey& cell, const Leaf& leaf) {
    leaves.emplace(cell, leaf);
  });
  return leaves;
}

}  // namespace fathom::map

#endif  // FATHOM_TESTS_MAP_GLOBAL_SCENE_H_
