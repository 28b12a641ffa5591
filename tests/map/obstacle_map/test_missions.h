// A small mission near Narragansett Bay for tests of the integrated map:
// a 16 km square, one 500 m x 500 m activity at 10 m cells, flat seabed.
#ifndef FATHOM_TESTS_MAP_OBSTACLE_MAP_TEST_MISSIONS_H_
#define FATHOM_TESTS_MAP_OBSTACLE_MAP_TEST_MISSIONS_H_

#include <cmath>
#include <numbers>
#include <string>

#include "map/geodesy/ned_frame.h"
#include "map/obstacle_map/obstacle_map.h"

namespace fathom::map {

inline constexpr GeodeticPoint kAreaSouthWest{.latitude_deg = 41.5,
                                              .longitude_deg = -71.4};

// 2026-01-01T00:00:00Z plus `seconds`.
inline Time At(int seconds) {
  return Time(std::chrono::seconds(1'767'225'600 + seconds));
}

inline MissionOptions SmallMission() {
  MissionOptions options;
  options.global.root =
      RootSquare::Create({.latitude_deg = 41.45, .longitude_deg = -71.5},
                         {.latitude_deg = 41.60, .longitude_deg = -71.5}, 10.0)
          .value();
  return options;
}

inline StartActivity Survey(const std::string& id,
                            EstimatorKind estimator = EstimatorKind::kKalman) {
  StartActivity start;
  start.id = ActivityId{id};
  start.start = At(0);
  start.options = {.south_west = kAreaSouthWest,
                   .north_extent_m = 500,
                   .east_extent_m = 500,
                   .cell_size_m = 10,
                   .estimator = estimator};
  return start;
}

// A place in the area, metres from its south-west corner.
inline GeodeticPoint Place(double north_m, double east_m) {
  return NedFrame(kAreaSouthWest).ToGeodetic(north_m, east_m);
}

// One ping from the middle of the area that hits (north_m, east_m).
inline Ping HitAt(const std::string& activity, double north_m, double east_m,
                  float depth_m, float std_m, int seconds) {
  Ping ping;
  ping.activity = ActivityId{activity};
  ping.time = At(seconds);
  ping.pose.position = Place(250, 250);
  const double dn = north_m - 250;
  const double de = east_m - 250;
  ping.beams = {Beam{.range_m = static_cast<float>(std::hypot(dn, de)),
                     .bearing_rad = static_cast<float>(std::atan2(de, dn)),
                     .depth_m = depth_m,
                     .std_m = std_m}};
  return ping;
}

// A chart of one depth over the whole mission.
inline RasterBlock FlatChart(float depth_m, float std_m) {
  RasterBlock block;
  block.north_west = {.latitude_deg = 41.7, .longitude_deg = -71.6};
  block.latitude_step_deg = 0.01;
  block.longitude_step_deg = 0.01;
  block.rows = 40;
  block.columns = 60;
  block.depth_m.assign(40 * 60, depth_m);
  block.std_m = {std_m};
  return block;
}

}  // namespace fathom::map

#endif  // FATHOM_TESTS_MAP_OBSTACLE_MAP_TEST_MISSIONS_H_
