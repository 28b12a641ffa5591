// GetRegion's shoalest_m against the map itself: no point in an answer cell
// may hold anything shoaler, at resolutions finer and coarser than the map.
#include "server/region_shoalest.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>

#include "server/region.h"
#include "tests/server/sample_map.h"
#include "tests/server/sample_messages.h"
#include "tests/testing/status_matchers.h"

namespace fathom::server {
namespace {

using ::fathom::testing::IsOk;

constexpr Time kNow = TimeFromUnixMicros(kSampleSeconds * 1'000'000);
const std::atomic<bool> kNever{false};
constexpr double kLatitudeDeg = 41.5;
constexpr double kLongitudeDeg = -71.4;

// A chart of random depths on 0.001 degree, and on a part of it an activity
// with random soundings, some of them spikes.
std::shared_ptr<const map::ObstacleMapView> RoughMap(
    map::EstimatorKind estimator, bool transfer) {
  std::mt19937_64 random(20021);
  std::uniform_real_distribution<double> unit(0, 1);
  map::ObstacleMap map(SampleOptions());
  map::RasterBlock chart = SampleChart();
  for (float& depth_m : chart.depth_m) {
    depth_m = static_cast<float>(15 + 10 * unit(random));
  }
  EXPECT_THAT(map.Import(chart, /*last=*/true).status(), IsOk());
  map::StartActivity start;
  start.id.value = "leg";
  start.options.south_west = {kLatitudeDeg + 0.002, kLongitudeDeg + 0.002};
  start.options.north_extent_m = 400;
  start.options.east_extent_m = 300;
  start.options.cell_size_m = 10;
  start.options.estimator = estimator;
  start.options.smoothing_distance_m = 20;
  start.options.smoothing_scale = 0.5;
  EXPECT_THAT(map.Start(start), IsOk());
  for (int i = 0; i < 60; ++i) {
    map::Ping ping;
    ping.activity.value = "leg";
    ping.time = kNow;
    ping.pose.position = {kLatitudeDeg + 0.002 + 0.003 * unit(random),
                          kLongitudeDeg + 0.002 + 0.003 * unit(random)};
    for (int beam = 0; beam < 40; ++beam) {
      ping.beams.push_back(
          {.range_m = static_cast<float>(2 + 100 * unit(random)),
           .bearing_rad = static_cast<float>(6.28 * unit(random)),
           .depth_m =
               static_cast<float>(unit(random) < 0.02 ? 3 + 5 * unit(random)
                                                      : 18 + 4 * unit(random)),
           .std_m = 0.3F});
    }
    EXPECT_THAT(map.ApplyPing(ping).status(), IsOk());
  }
  if (transfer) {
    EXPECT_THAT(map.Complete({"leg"}, /*discard=*/false).status(), IsOk());
  }
  return map.View();
}

float ShoalestAt(const map::SeabedEstimate& seabed) {
  const map::DepthEstimate& estimate = seabed.estimate;
  return std::fmin(std::fmin(estimate.depth_m, estimate.shoalest_m),
                   estimate.hazard_m);
}

struct Case {
  double resolution_m;
  map::EstimatorKind estimator;
  bool transfer;
};

class RegionShoalestTest : public ::testing::TestWithParam<Case> {};

TEST_P(RegionShoalestTest, NothingInACellIsShoaler) {
  const auto view = RoughMap(GetParam().estimator, GetParam().transfer);
  v1::GetRegionRequest request;
  SetPoint(kLatitudeDeg + 0.001, kLongitudeDeg + 0.001,
           request.mutable_south_west());
  SetPoint(kLatitudeDeg + 0.007, kLongitudeDeg + 0.008,
           request.mutable_north_east());
  request.set_resolution_m(GetParam().resolution_m);
  FATHOM_ASSERT_OK_AND_ASSIGN(Region region, Region::Create(request, kNow));
  ASSERT_THAT(region.Open(view), IsOk());
  v1::GetRegionResponse response;
  int cells = 0;
  int close = 0;
  while (region.Next(kNever, &response) == Region::Step::kBlock) {
    const v1::RegionTile& tile = response.tile();
    // Every 13th cell, so that fine answers take no longer than coarse ones.
    const int step = GetParam().resolution_m < 20 ? 13 : 1;
    for (int i = 0; i < tile.depth_m_size(); i += step) {
      const int row = i / static_cast<int>(tile.columns());
      const int column = i % static_cast<int>(tile.columns());
      float least_m = std::numeric_limits<float>::infinity();
      for (int n = 0; n < 16; ++n) {
        for (int e = 0; e < 16; ++e) {
          const auto seabed = view->SeabedAt(
              {.latitude_deg =
                   tile.north_west().latitude_deg() -
                   (row + (n + 0.5) / 16) * tile.latitude_step_deg(),
               .longitude_deg =
                   tile.north_west().longitude_deg() +
                   (column + (e + 0.5) / 16) * tile.longitude_step_deg()});
          if (!seabed.has_value()) continue;
          const bool smoothed =
              seabed->estimate.kind == map::EvidenceKind::kSmoothed;
          least_m = std::fmin(least_m, smoothed ? seabed->estimate.hazard_m
                                                : ShoalestAt(*seabed));
        }
      }
      if (std::isinf(least_m)) continue;
      ++cells;
      ASSERT_LE(tile.shoalest_m(i), least_m + 1e-4F)
          << "row " << row << " column " << column;
      ASSERT_LE(tile.shoalest_m(i), tile.depth_m(i));
      close += tile.shoalest_m(i) > least_m - 0.01F;
    }
  }
  EXPECT_GT(cells, 10);
  // It is a bound, yet not an idle one: some cells are told exactly.
  EXPECT_GT(close, 0);
}

INSTANTIATE_TEST_SUITE_P(
    Resolutions, RegionShoalestTest,
    ::testing::Values(Case{2, map::EstimatorKind::kAdaptive, false},
                      Case{10, map::EstimatorKind::kAdaptive, false},
                      Case{10, map::EstimatorKind::kNervegna, false},
                      Case{10, map::EstimatorKind::kAdaptive, true},
                      Case{37, map::EstimatorKind::kKalman, false},
                      Case{37, map::EstimatorKind::kAdaptive, true},
                      Case{150, map::EstimatorKind::kNervegna, false},
                      Case{150, map::EstimatorKind::kAdaptive, true}));

TEST(RegionShoalest, ASpikeBetweenTheCentresOfACoarseAnswerIsTold) {
  map::ObstacleMap map(SampleOptions());
  ASSERT_THAT(map.Import(SampleChart(), /*last=*/true).status(), IsOk());
  map::StartActivity start;
  start.id.value = "leg";
  start.options.south_west = {kLatitudeDeg, kLongitudeDeg};
  start.options.north_extent_m = 500;
  start.options.east_extent_m = 500;
  start.options.cell_size_m = 10;
  ASSERT_THAT(map.Start(start), IsOk());
  map::Ping ping;
  ping.activity.value = "leg";
  ping.time = kNow;
  // 111 m north, 84 m east of the corner; one sounding 5 m ahead (north).
  ping.pose.position = {kLatitudeDeg + 0.001, kLongitudeDeg + 0.001};
  ping.beams = {{.range_m = 5, .bearing_rad = 0, .depth_m = 4, .std_m = 0.2F}};
  ASSERT_THAT(map.ApplyPing(ping).status(), IsOk());

  v1::GetRegionRequest request;
  SetPoint(kLatitudeDeg, kLongitudeDeg, request.mutable_south_west());
  SetPoint(kLatitudeDeg + 0.01, kLongitudeDeg + 0.01,
           request.mutable_north_east());
  request.set_resolution_m(1200);  // One cell: its centre is 500 m north.
  FATHOM_ASSERT_OK_AND_ASSIGN(Region region, Region::Create(request, kNow));
  ASSERT_THAT(region.Open(map.View()), IsOk());
  v1::GetRegionResponse response;
  ASSERT_EQ(region.Next(kNever, &response), Region::Step::kBlock);
  ASSERT_EQ(response.tile().depth_m_size(), 1);
  // The chart says 20 m at the centre, the sounding 4 m elsewhere; alone it is
  // a hazard from 4.5 of its stds above: 4 - 4.5 * 0.2.
  EXPECT_FLOAT_EQ(response.tile().depth_m(0), 20);
  EXPECT_FLOAT_EQ(response.tile().shoalest_m(0), 3.1F);
  EXPECT_EQ(response.tile().layer()[0], v1::MAP_LAYER_GLOBAL);
}

TEST(RegionShoalest, ACellWhoseCentreIsUnknownTellsWhatItHolds) {
  // The chart of 20 m ends at 71.39 W; the cell reaches 4 times as far east.
  v1::GetRegionRequest request;
  SetPoint(kLatitudeDeg, kLongitudeDeg + 0.009, request.mutable_south_west());
  SetPoint(kLatitudeDeg + 0.003, kLongitudeDeg + 0.013,
           request.mutable_north_east());
  request.set_resolution_m(334);
  FATHOM_ASSERT_OK_AND_ASSIGN(Region region, Region::Create(request, kNow));
  ASSERT_THAT(region.Open(SampleMap().View()), IsOk());
  v1::GetRegionResponse response;
  ASSERT_EQ(region.Next(kNever, &response), Region::Step::kBlock);
  EXPECT_TRUE(std::isnan(response.tile().depth_m(0)));
  EXPECT_FLOAT_EQ(response.tile().shoalest_m(0), 20);
}

TEST(RegionShoalest, ALocalLayerAloneKnowsNothingOfTheChart) {
  v1::GetRegionRequest request;
  SetPoint(kLatitudeDeg, kLongitudeDeg, request.mutable_south_west());
  SetPoint(kLatitudeDeg + 0.003, kLongitudeDeg + 0.003,
           request.mutable_north_east());
  request.set_resolution_m(100);
  request.set_layer(v1::MAP_LAYER_LOCAL);
  FATHOM_ASSERT_OK_AND_ASSIGN(Region region, Region::Create(request, kNow));
  ASSERT_THAT(region.Open(SampleMap().View()), IsOk());
  v1::GetRegionResponse response;
  ASSERT_EQ(region.Next(kNever, &response), Region::Step::kBlock);
  for (const float depth_m : response.tile().shoalest_m()) {
    EXPECT_TRUE(std::isnan(depth_m));
  }
}

}  // namespace
}  // namespace fathom::server
