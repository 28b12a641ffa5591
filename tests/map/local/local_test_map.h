// A small local map and soundings at chosen places, for the tests here.

#ifndef FATHOM_TESTS_MAP_LOCAL_LOCAL_TEST_MAP_H_
#define FATHOM_TESTS_MAP_LOCAL_LOCAL_TEST_MAP_H_

#include <cmath>
#include <optional>
#include <utility>

#include "map/local/local_map.h"

namespace fathom::map {

inline constexpr GeodeticPoint kTestSouthWest = {41.5, -71.3};

// 500 m x 500 m at 10 m, prior 20 +- 5 m.
inline LocalMapOptions TestOptions(EstimatorKind estimator) {
  LocalMapOptions options;
  options.south_west = kTestSouthWest;
  options.north_extent_m = 500.0;
  options.east_extent_m = 500.0;
  options.cell_size_m = 10.0;
  options.estimator = estimator;
  options.default_depth_m = 20.0f;
  options.default_std_m = 5.0f;
  return options;
}

// REQUIRES: valid options.
inline LocalMap MakeMap(const LocalMapOptions& options) {
  return *LocalMap::Create(options);
}

// A ping whose one beam falls on (north_m, east_m) of the map's plane: the
// vehicle lies 5 m south of it and looks north.
inline Ping PingAt(const LocalMapOptions& options, double north_m,
                   double east_m, float depth_m, float std_m,
                   int time_s = 1'000) {
  const NedFrame frame(options.south_west);
  Ping ping;
  ping.time = Time(std::chrono::seconds(time_s));
  ping.pose.position = frame.ToGeodetic(north_m - 5.0, east_m);
  ping.beams = {{.range_m = 5.0f,
                 .bearing_rad = 0.0f,
                 .depth_m = depth_m,
                 .std_m = std_m}};
  return ping;
}

// As PingAt, on the middle of a cell.
inline Ping PingOn(const LocalMapOptions& options, CellIndex cell,
                   float depth_m, float std_m, int time_s = 1'000) {
  return PingAt(options, (cell.i + 0.5) * options.cell_size_m,
                (cell.j + 0.5) * options.cell_size_m, depth_m, std_m, time_s);
}

}  // namespace fathom::map

#endif  // FATHOM_TESTS_MAP_LOCAL_LOCAL_TEST_MAP_H_
