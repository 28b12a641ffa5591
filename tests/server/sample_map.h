// A map of 20 x 20 nautical miles around (41.5, -71.4) with a chart of 20 m
// +- 2 m over 41.50..41.51 N, 71.40..71.39 W.

#ifndef FATHOM_TESTS_SERVER_SAMPLE_MAP_H_
#define FATHOM_TESTS_SERVER_SAMPLE_MAP_H_

#include <gtest/gtest.h>

#include <memory>

#include "map/obstacle_map/obstacle_map.h"

namespace fathom::server {

inline map::MissionOptions SampleOptions() {
  map::MissionOptions options;
  options.global.root =
      *map::RootSquare::CenteredOn({41.5, -71.4}, 20 * 1852.0, 10);
  return options;
}

inline map::RasterBlock SampleChart() {
  map::RasterBlock block;
  block.north_west = {41.51, -71.40};
  block.latitude_step_deg = 0.001;
  block.longitude_step_deg = 0.001;
  block.rows = 10;
  block.columns = 10;
  block.depth_m.assign(100, 20.0F);
  block.std_m = {2.0F};
  return block;
}

inline map::ObstacleMap SampleMap() {
  map::ObstacleMap map(SampleOptions());
  EXPECT_TRUE(map.Import(SampleChart(), /*last=*/true).ok());
  return map;
}

}  // namespace fathom::server

#endif  // FATHOM_TESTS_SERVER_SAMPLE_MAP_H_
