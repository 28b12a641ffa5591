#include "server/convert_query.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "server/limits.h"
#include "server/region.h"
#include "tests/server/sample_map.h"
#include "tests/server/sample_messages.h"
#include "tests/server/violation_matcher.h"
#include "tests/testing/status_matchers.h"

namespace fathom::server {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr auto kInvalid = v1::REJECT_REASON_INVALID_MESSAGE;
constexpr auto kNotFinite = v1::REJECT_REASON_NOT_FINITE;
constexpr auto kBadDepth = v1::REJECT_REASON_BAD_DEPTH;
constexpr Time kNow = TimeFromUnixMicros(kSampleSeconds * 1'000'000);

template <typename Message>
struct Spoiled {
  const char* path;
  v1::RejectReason reason;
  std::function<void(Message&)> spoil;
};

TEST(ConvertQuery, AbsentTimeIsNowAndSurfaceDepthIsReferredToDatum) {
  v1::QueryObstacleRequest request = SampleQuery();
  request.set_radius_m(7);
  request.set_vertical_clearance_m(2);
  request.mutable_vertical_reference()->set_reference(
      v1::DEPTH_REFERENCE_WATER_SURFACE);
  request.mutable_vertical_reference()->set_water_level_m(1.5);
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::ObstacleQuery query,
                              ConvertQuery(request, kNow));
  EXPECT_EQ(query.time, kNow);
  EXPECT_EQ(query.depth_m, 8.5);  // 10 - 1.5
  EXPECT_EQ(query.confidence, 0.95);
  EXPECT_EQ(query.radius_m, 7);
  EXPECT_EQ(query.vertical_clearance_m, 2);
  EXPECT_EQ(query.position.longitude_deg, -71.4);
}

TEST(ConvertQuery, NamesEveryBadField) {
  const std::vector<Spoiled<v1::QueryObstacleRequest>> cases = {
      {"position", kInvalid, [](auto& q) { q.clear_position(); }},
      {"position.latitude_deg", kInvalid,
       [](auto& q) { q.mutable_position()->set_latitude_deg(91); }},
      {"position.latitude_deg", kNotFinite,
       [](auto& q) { q.mutable_position()->set_latitude_deg(kNaN); }},
      {"position.longitude_deg", kInvalid,
       [](auto& q) { q.mutable_position()->set_longitude_deg(181); }},
      {"depth_m", kBadDepth, [](auto& q) { q.set_depth_m(12'001); }},
      {"depth_m", kNotFinite, [](auto& q) { q.set_depth_m(kNaN); }},
      {"time", kInvalid, [](auto& q) { q.mutable_time()->set_seconds(-5); }},
      {"confidence", kInvalid, [](auto& q) { q.clear_confidence(); }},
      {"confidence", kInvalid, [](auto& q) { q.set_confidence(0.5); }},
      {"confidence", kInvalid, [](auto& q) { q.set_confidence(1); }},
      {"confidence", kNotFinite, [](auto& q) { q.set_confidence(kNaN); }},
      {"vertical_clearance_m", kInvalid,
       [](auto& q) { q.set_vertical_clearance_m(-1); }},
      {"radius_m", kInvalid, [](auto& q) { q.set_radius_m(-1); }},
      {"radius_m", kInvalid, [](auto& q) { q.set_radius_m(50'001); }},
      {"vertical_reference.water_level_m", kInvalid,
       [](auto& q) {
         q.mutable_vertical_reference()->set_reference(
             v1::DEPTH_REFERENCE_WATER_SURFACE);
       }},
  };
  for (const auto& spoiled : cases) {
    v1::QueryObstacleRequest request = SampleQuery();
    spoiled.spoil(request);
    EXPECT_THAT(ConvertQuery(request, kNow),
                Violates(spoiled.path, spoiled.reason));
  }
}

TEST(AnswerBatch, NamesEveryBadFieldAndPoint) {
  const std::vector<Spoiled<v1::QueryObstaclesRequest>> cases = {
      {"latitude_deg", kInvalid,
       [](auto& q) {
         q.clear_latitude_deg();
         q.clear_longitude_deg();
         q.clear_depth_m();
       }},
      {"longitude_deg", kInvalid, [](auto& q) { q.add_longitude_deg(0); }},
      {"depth_m", kInvalid, [](auto& q) { q.clear_depth_m(); }},
      {"time_offset_us", kInvalid, [](auto& q) { q.add_time_offset_us(1); }},
      {"latitude_deg[2]", kInvalid, [](auto& q) { q.set_latitude_deg(2, 91); }},
      {"longitude_deg[1]", kNotFinite,
       [](auto& q) { q.set_longitude_deg(1, kNaN); }},
      {"depth_m[0]", kBadDepth, [](auto& q) { q.set_depth_m(0, -101); }},
      {"time_offset_us[1]", kInvalid,
       [](auto& q) {
         q.add_time_offset_us(0);
         q.add_time_offset_us(kMaxTimeOffsetUs + 1);
         q.add_time_offset_us(0);
       }},
      {"confidence", kInvalid, [](auto& q) { q.set_confidence(0.2); }},
  };
  const auto view = SampleMap().View();
  for (const auto& spoiled : cases) {
    v1::QueryObstaclesRequest request = SampleBatch();
    spoiled.spoil(request);
    v1::QueryObstaclesResponse response;
    EXPECT_THAT(AnswerBatch(request, kNow, *view, &response),
                Violates(spoiled.path, spoiled.reason));
    EXPECT_THAT(CheckBatch(request), Violates(spoiled.path, spoiled.reason));
  }
}

TEST(AnswerBatch, TakesTheMostPointsAndNotOneMore) {
  EXPECT_THAT(CheckBatch(SampleBatch(static_cast<int>(kMaxPointsPerQuery))),
              IsOk());
  EXPECT_THAT(CheckBatch(SampleBatch(static_cast<int>(kMaxPointsPerQuery) + 1)),
              StatusIs(absl::StatusCode::kResourceExhausted));
}

TEST(AnswerBatch, EndsSoonAfterNobodyWantsIt) {
  const auto view = SampleMap().View();
  v1::QueryObstaclesResponse response;
  int looks = 0;
  EXPECT_EQ(AnswerBatch(SampleBatch(100'000), kNow, *view, &response,
                        [&looks] { return ++looks == 3; })
                .code(),
            absl::StatusCode::kCancelled);
  EXPECT_EQ(looks, 3);
  const auto& states = response.state();
  EXPECT_LE(states.size() - std::count(states.begin(), states.end(),
                                       v1::OBSTACLE_STATE_UNSPECIFIED),
            3 * 128);
  // Whichever thread looks.
  Workers helpers(3);
  std::atomic<int> looked = 0;
  EXPECT_EQ(AnswerBatch(
                SampleBatch(100'000), kNow, *view, &response,
                [&looked] { return ++looked >= 3; }, &helpers)
                .code(),
            absl::StatusCode::kCancelled);
  EXPECT_LE(looked, 3 + 3);
}

TEST(AnswerBatch, HelpersChangeNoAnswer) {
  const auto view = SampleMap().View();
  v1::QueryObstaclesRequest request;
  request.set_confidence(0.9);
  for (int i = 0; i < 10'000; ++i) {
    // Over the chart and beyond it, above the floor and below.
    request.add_latitude_deg(41.45 + 1e-5 * i);
    request.add_longitude_deg(-71.395);
    request.add_depth_m(static_cast<float>(i % 30));
  }
  v1::QueryObstaclesResponse alone;
  FATHOM_ASSERT_OK(AnswerBatch(request, kNow, *view, &alone));
  Workers helpers(3);
  for (int round = 0; round < 20; ++round) {
    v1::QueryObstaclesResponse helped;
    FATHOM_ASSERT_OK(AnswerBatch(
        request, kNow, *view, &helped, [] { return false; }, &helpers));
    ASSERT_EQ(helped.SerializeAsString(), alone.SerializeAsString());
  }
  request.set_with_reasons(true);
  v1::QueryObstaclesResponse told;
  FATHOM_ASSERT_OK(AnswerBatch(
      request, kNow, *view, &told, [] { return false; }, &helpers));
  EXPECT_EQ(told.mean_depth_m_size(), 10'000);
  EXPECT_THAT(told.probability(),
              ::testing::ElementsAreArray(alone.probability()));
}

TEST(AnswerBatch, GivesTheSameAnswersAsOneByOne) {
  map::ObstacleMap map = SampleMap();
  const auto view = map.View();
  v1::QueryObstaclesRequest request;
  request.set_confidence(0.9);
  request.set_with_reasons(true);
  // Over the chart (20 m, see SampleMap): below, at and above it; then a place
  // that the chart does not cover.
  const double latitudes[] = {41.505, 41.505, 41.505, 41.45};
  const float depths[] = {30, 20, 10, 10};
  for (int i = 0; i < 4; ++i) {
    request.add_latitude_deg(latitudes[i]);
    request.add_longitude_deg(-71.395);
    request.add_depth_m(depths[i]);
  }
  v1::QueryObstaclesResponse response;
  FATHOM_ASSERT_OK(AnswerBatch(request, kNow, *view, &response));
  ASSERT_EQ(response.state_size(), 4);
  EXPECT_EQ(response.state(0), v1::OBSTACLE_STATE_OCCUPIED);
  EXPECT_EQ(response.state(1), v1::OBSTACLE_STATE_UNCERTAIN);
  EXPECT_EQ(response.state(2), v1::OBSTACLE_STATE_FREE);
  EXPECT_EQ(response.state(3), v1::OBSTACLE_STATE_UNKNOWN);
  // Phi((20 - 20) / 2) = 0.5.
  EXPECT_FLOAT_EQ(response.probability(1), 0.5F);
  EXPECT_FLOAT_EQ(response.mean_depth_m(0), 20);
  EXPECT_NEAR(response.std_m(0), 2, 0.001);  // 14-bit code: 0.1 %
  EXPECT_EQ(response.kind(0), v1::EVIDENCE_KIND_PRIOR);
  EXPECT_TRUE(std::isnan(response.mean_depth_m(3)));
  EXPECT_EQ(response.kind(3), v1::EVIDENCE_KIND_UNSPECIFIED);
  EXPECT_EQ(response.stamp().map_revision(), view->revision());
  for (int i = 0; i < 4; ++i) {
    const auto answer = view->Answer({.position = {latitudes[i], -71.395},
                                      .depth_m = depths[i],
                                      .time = kNow,
                                      .confidence = 0.9});
    EXPECT_FLOAT_EQ(response.probability(i),
                    static_cast<float>(answer.probability));
    v1::ObstacleAnswer single;
    WriteAnswer(answer, &single);
    EXPECT_EQ(single.state(), response.state(i));
    EXPECT_EQ(single.has_seabed(), i < 3);
  }
}

const std::atomic<bool> kNever{false};

// 0.01 deg of latitude and 0.02 deg of longitude, 100 m cells.
v1::GetRegionRequest SampleRegion() {
  v1::GetRegionRequest request;
  SetPoint(41.50, -71.40, request.mutable_south_west());
  SetPoint(41.51, -71.38, request.mutable_north_east());
  request.set_resolution_m(100);
  return request;
}

TEST(Region, IsSquareAtItsMiddleAndCoversTheArea) {
  map::ObstacleMap map = SampleMap();
  FATHOM_ASSERT_OK_AND_ASSIGN(Region region,
                              Region::Create(SampleRegion(), kNow));
  // A degree at 41.505 N: 111 068 m of latitude and 83 488 m of longitude (WGS
  // 84), so 1110.7 m / 100 m -> 12 rows and 1669.8 m / 100 m -> 17 columns.
  EXPECT_EQ(region.rows(), 12U);
  EXPECT_EQ(region.columns(), 17U);
  FATHOM_ASSERT_OK(region.Open(map.View()));
  v1::GetRegionResponse response;
  ASSERT_EQ(region.Next(kNever, &response), Region::Step::kBlock);
  EXPECT_EQ(response.total_rows(), 12U);
  const v1::RegionTile& tile = response.tile();
  EXPECT_EQ(tile.rows(), 12U);
  EXPECT_EQ(tile.columns(), 17U);
  EXPECT_EQ(tile.north_west().latitude_deg(), 41.51);
  EXPECT_EQ(tile.north_west().longitude_deg(), -71.40);
  EXPECT_NEAR(tile.latitude_step_deg() * 111'068, 100, 0.01);
  EXPECT_NEAR(tile.longitude_step_deg() * 83'488, 100, 0.01);
  ASSERT_EQ(tile.depth_m_size(), 12 * 17);
  // The chart covers -71.40..-71.39: the western half of the area.
  EXPECT_FLOAT_EQ(tile.depth_m(5 * 17 + 1), 20);
  EXPECT_FLOAT_EQ(tile.shoalest_m(5 * 17 + 1), 20);
  EXPECT_EQ(tile.kind()[5 * 17 + 1], v1::EVIDENCE_KIND_PRIOR);
  EXPECT_TRUE(std::isnan(tile.depth_m(5 * 17 + 15)));
  EXPECT_TRUE(std::isnan(tile.std_m(5 * 17 + 15)));
  EXPECT_EQ(tile.kind()[5 * 17 + 15], v1::EVIDENCE_KIND_UNSPECIFIED);
  EXPECT_EQ(region.Next(kNever, &response), Region::Step::kEnd);
}

TEST(Region, LargeAreasComeInTilesThatFitTogether) {
  v1::GetRegionRequest request = SampleRegion();
  request.set_resolution_m(3);
  FATHOM_ASSERT_OK_AND_ASSIGN(Region region, Region::Create(request, kNow));
  FATHOM_ASSERT_OK(region.Open(SampleMap().View()));
  std::vector<int> seen(size_t{region.rows()} * region.columns());
  v1::GetRegionResponse response;
  while (region.Next(kNever, &response) == Region::Step::kBlock) {
    const v1::RegionTile& tile = response.tile();
    EXPECT_LE(tile.rows(), kRegionTileSide);
    EXPECT_LE(tile.columns(), kRegionTileSide);
    EXPECT_NEAR(tile.north_west().latitude_deg(),
                41.51 - tile.first_row() * tile.latitude_step_deg(), 1e-12);
    for (uint32_t row = 0; row < tile.rows(); ++row) {
      for (uint32_t column = 0; column < tile.columns(); ++column) {
        seen.at((tile.first_row() + row) * region.columns() +
                tile.first_column() + column) += 1;
      }
    }
  }
  // 371 rows and 557 columns: 2 x 3 tiles, every cell once.
  EXPECT_EQ(region.rows(), 371U);
  EXPECT_EQ(region.columns(), 557U);
  EXPECT_THAT(seen, ::testing::Each(1));
}

TEST(Region, NamesEveryBadField) {
  const std::vector<Spoiled<v1::GetRegionRequest>> cases = {
      {"south_west", kInvalid, [](auto& r) { r.clear_south_west(); }},
      {"north_east", kInvalid, [](auto& r) { r.clear_north_east(); }},
      {"north_east.latitude_deg", kInvalid,
       [](auto& r) { r.mutable_north_east()->set_latitude_deg(41.5); }},
      {"north_east.longitude_deg", kInvalid,
       [](auto& r) { r.mutable_north_east()->set_longitude_deg(-71.4); }},
      {"south_west.latitude_deg", kNotFinite,
       [](auto& r) { r.mutable_south_west()->set_latitude_deg(kNaN); }},
      {"resolution_m", kInvalid, [](auto& r) { r.set_resolution_m(0.05); }},
      {"resolution_m", kInvalid, [](auto& r) { r.clear_resolution_m(); }},
      {"resolution_m", kInvalid, [](auto& r) { r.set_resolution_m(1.1e5); }},
      {"resolution_m", kNotFinite, [](auto& r) { r.set_resolution_m(kNaN); }},
      {"activity_id", kInvalid, [](auto& r) { r.set_activity_id("a b"); }},
      {"layer", kInvalid,
       [](auto& r) { r.set_layer(static_cast<v1::MapLayer>(7)); }},
      {"layer", kInvalid,
       [](auto& r) {
         r.set_layer(v1::MAP_LAYER_GLOBAL);
         r.set_activity_id("leg-1");
       }},
  };
  for (const auto& spoiled : cases) {
    v1::GetRegionRequest request = SampleRegion();
    spoiled.spoil(request);
    EXPECT_THAT(Region::Create(request, kNow),
                Violates(spoiled.path, spoiled.reason));
  }
}

TEST(Region, RefusesMoreCellsThanTheLimitAndUnknownActivities) {
  v1::GetRegionRequest request = SampleRegion();
  request.mutable_north_east()->set_latitude_deg(42.5);
  request.set_resolution_m(1);  // 111 km x 1.7 km / 1 m2 = 185 M cells
  EXPECT_THAT(Region::Create(request, kNow),
              StatusIs(absl::StatusCode::kResourceExhausted));
  request = SampleRegion();
  request.set_activity_id("leg-9");
  FATHOM_ASSERT_OK_AND_ASSIGN(Region region, Region::Create(request, kNow));
  EXPECT_THAT(region.Open(SampleMap().View()),
              StatusIs(absl::StatusCode::kNotFound));
}

TEST(Region, MayCrossTheAntimeridian) {
  v1::GetRegionRequest request = SampleRegion();
  request.mutable_south_west()->set_longitude_deg(179.99);
  request.mutable_north_east()->set_longitude_deg(-179.99);
  FATHOM_ASSERT_OK_AND_ASSIGN(const Region region,
                              Region::Create(request, kNow));
  EXPECT_EQ(region.columns(), 17U);  // 0.02 deg, as in SampleRegion
}

TEST(Region, StopsInTheMiddleOfABlock) {
  FATHOM_ASSERT_OK_AND_ASSIGN(Region region,
                              Region::Create(SampleRegion(), kNow));
  FATHOM_ASSERT_OK(region.Open(SampleMap().View()));
  const std::atomic<bool> stop{true};
  v1::GetRegionResponse response;
  EXPECT_EQ(region.Next(stop, &response), Region::Step::kStopped);
}

}  // namespace
}  // namespace fathom::server
