#include "server/convert_trajectory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <vector>

#include "server/limits.h"
#include "tests/server/sample_messages.h"
#include "tests/server/violation_matcher.h"
#include "tests/testing/status_matchers.h"

namespace fathom::server {
namespace {

using ::fathom::testing::StatusIs;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr auto kInvalid = v1::REJECT_REASON_INVALID_MESSAGE;
constexpr auto kNotFinite = v1::REJECT_REASON_NOT_FINITE;
constexpr auto kBadDepth = v1::REJECT_REASON_BAD_DEPTH;
constexpr Time kNow = TimeFromUnixMicros(kSampleSeconds * 1'000'000);

// `count` places 0.001 degree apart northward, 10 s each.
v1::Trajectory SampleTrajectory(int count = 3) {
  v1::Trajectory trajectory;
  for (int i = 0; i < count; ++i) {
    v1::Waypoint* waypoint = trajectory.add_waypoints();
    SetPoint(41.5 + 0.001 * (i % 500), -71.4, waypoint->mutable_position());
    waypoint->set_depth_m(10 + i % 3);
    waypoint->mutable_time()->set_seconds(kSampleSeconds + 10 * i);
  }
  trajectory.set_radius_m(2);
  trajectory.set_vertical_clearance_m(3);
  trajectory.set_position_std_m(4);
  trajectory.set_confidence(0.9);
  return trajectory;
}

absl::StatusOr<map::Trajectory> Convert(const v1::Trajectory& trajectory) {
  const FieldPath root;
  return ConvertTrajectory(trajectory, FieldPath(root, "trajectory"));
}

TEST(ConvertTrajectory, TakesEveryFieldAndReferstoDatum) {
  v1::Trajectory trajectory = SampleTrajectory();
  trajectory.mutable_vertical_reference()->set_reference(
      v1::DEPTH_REFERENCE_WATER_SURFACE);
  trajectory.mutable_vertical_reference()->set_water_level_m(1.5);
  trajectory.set_treat_unknown_as(v1::UNKNOWN_TREATMENT_FREE);
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::Trajectory out, Convert(trajectory));
  ASSERT_EQ(out.waypoints.size(), 3u);
  EXPECT_EQ(out.waypoints[1].depth_m, 9.5);  // 11 - 1.5
  EXPECT_EQ(out.waypoints[1].position.latitude_deg, 41.501);
  EXPECT_EQ(out.waypoints[1].time, kNow + std::chrono::seconds(10));
  EXPECT_EQ(out.radius_m, 2);
  EXPECT_EQ(out.vertical_clearance_m, 3);
  EXPECT_EQ(out.position_std_m, 4);
  EXPECT_EQ(out.confidence, 0.9);
  EXPECT_TRUE(out.unknown_is_free);
}

TEST(ConvertTrajectory, UnknownIsAnObstacleUnlessItIsSaid) {
  v1::Trajectory trajectory = SampleTrajectory();
  EXPECT_FALSE(Convert(trajectory)->unknown_is_free);
  trajectory.set_treat_unknown_as(v1::UNKNOWN_TREATMENT_OCCUPIED);
  EXPECT_FALSE(Convert(trajectory)->unknown_is_free);
}

TEST(ConvertTrajectory, NamesEveryBadField) {
  struct Spoiled {
    const char* path;
    v1::RejectReason reason;
    std::function<void(v1::Trajectory&)> spoil;
  };
  const std::vector<Spoiled> cases = {
      {"trajectory.waypoints", kInvalid, [](auto& t) { t.clear_waypoints(); }},
      {"trajectory.waypoints", kInvalid,
       [](auto& t) {
         t.mutable_waypoints()->RemoveLast();
         t.mutable_waypoints()->RemoveLast();
       }},
      {"trajectory.waypoints[1].position", kInvalid,
       [](auto& t) { t.mutable_waypoints(1)->clear_position(); }},
      {"trajectory.waypoints[2].position.latitude_deg", kInvalid,
       [](auto& t) {
         t.mutable_waypoints(2)->mutable_position()->set_latitude_deg(91);
       }},
      {"trajectory.waypoints[0].position.longitude_deg", kNotFinite,
       [](auto& t) {
         t.mutable_waypoints(0)->mutable_position()->set_longitude_deg(kNaN);
       }},
      // 1 degree of latitude is 111 km.
      {"trajectory.waypoints[1].position", kInvalid,
       [](auto& t) {
         t.mutable_waypoints(1)->mutable_position()->set_latitude_deg(42.5);
       }},
      {"trajectory.waypoints[1].depth_m", kBadDepth,
       [](auto& t) { t.mutable_waypoints(1)->set_depth_m(12'001); }},
      {"trajectory.waypoints[1].depth_m", kNotFinite,
       [](auto& t) { t.mutable_waypoints(1)->set_depth_m(kNaN); }},
      {"trajectory.waypoints[1].time", kInvalid,
       [](auto& t) { t.mutable_waypoints(1)->clear_time(); }},
      {"trajectory.waypoints[1].time", kInvalid,
       [](auto& t) { t.mutable_waypoints(1)->mutable_time()->set_nanos(-1); }},
      // Not later; and earlier.
      {"trajectory.waypoints[2].time", kInvalid,
       [](auto& t) {
         *t.mutable_waypoints(2)->mutable_time() = t.waypoints(1).time();
       }},
      {"trajectory.waypoints[1].time", kInvalid,
       [](auto& t) {
         t.mutable_waypoints(1)->mutable_time()->set_seconds(kSampleSeconds -
                                                             1);
       }},
      {"trajectory.vertical_reference.water_level_m", kInvalid,
       [](auto& t) {
         t.mutable_vertical_reference()->set_reference(
             v1::DEPTH_REFERENCE_WATER_SURFACE);
       }},
      {"trajectory.radius_m", kInvalid, [](auto& t) { t.set_radius_m(-1); }},
      {"trajectory.radius_m", kInvalid,
       [](auto& t) { t.set_radius_m(1000.1); }},
      {"trajectory.vertical_clearance_m", kInvalid,
       [](auto& t) { t.set_vertical_clearance_m(-1); }},
      {"trajectory.vertical_clearance_m", kNotFinite,
       [](auto& t) { t.set_vertical_clearance_m(kNaN); }},
      {"trajectory.position_std_m", kInvalid,
       [](auto& t) { t.set_position_std_m(1000.1); }},
      {"trajectory.position_std_m", kNotFinite,
       [](auto& t) { t.set_position_std_m(kNaN); }},
      {"trajectory.confidence", kInvalid,
       [](auto& t) { t.clear_confidence(); }},
      {"trajectory.confidence", kInvalid, [](auto& t) { t.set_confidence(1); }},
      {"trajectory.treat_unknown_as", kInvalid,
       [](auto& t) {
         t.set_treat_unknown_as(static_cast<v1::UnknownTreatment>(3));
       }},
  };
  for (const auto& spoiled : cases) {
    v1::Trajectory trajectory = SampleTrajectory();
    spoiled.spoil(trajectory);
    EXPECT_THAT(Convert(trajectory), Violates(spoiled.path, spoiled.reason));
  }
}

TEST(ConvertTrajectory, TakesAsManyWaypointsAsAreAllowedAndNoMore) {
  const int limit = static_cast<int>(kMaxWaypoints);
  EXPECT_TRUE(Convert(SampleTrajectory(limit)).ok());
  EXPECT_THAT(Convert(SampleTrajectory(limit + 1)),
              StatusIs(absl::StatusCode::kResourceExhausted));
}

v1::FindNearestObstacleRequest SampleSearch() {
  v1::FindNearestObstacleRequest request;
  SetPoint(41.5, -71.4, request.mutable_position());
  request.set_depth_m(10);
  request.set_confidence(0.95);
  request.set_search_radius_m(50'000);
  return request;
}

TEST(ConvertNearest, AbsentTimeIsNowAndSurfaceDepthIsReferredToDatum) {
  v1::FindNearestObstacleRequest request = SampleSearch();
  request.set_vertical_clearance_m(2);
  request.mutable_vertical_reference()->set_reference(
      v1::DEPTH_REFERENCE_WATER_SURFACE);
  request.mutable_vertical_reference()->set_water_level_m(1.5);
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::NearestQuestion out,
                              ConvertNearest(request, kNow));
  EXPECT_EQ(out.query.depth_m, 8.5);  // 10 - 1.5
  EXPECT_EQ(out.query.time, kNow);
  EXPECT_EQ(out.query.vertical_clearance_m, 2);
  EXPECT_EQ(out.query.confidence, 0.95);
  EXPECT_EQ(out.search_radius_m, 50'000);
  EXPECT_FALSE(out.unknown_is_free);
  request.mutable_time()->set_seconds(kSampleSeconds + 5);
  request.set_treat_unknown_as(v1::UNKNOWN_TREATMENT_FREE);
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::NearestQuestion timed,
                              ConvertNearest(request, kNow));
  EXPECT_EQ(timed.query.time, kNow + std::chrono::seconds(5));
  EXPECT_TRUE(timed.unknown_is_free);
}

TEST(ConvertNearest, NamesEveryBadField) {
  struct Spoiled {
    const char* path;
    v1::RejectReason reason;
    std::function<void(v1::FindNearestObstacleRequest&)> spoil;
  };
  const std::vector<Spoiled> cases = {
      {"position", kInvalid, [](auto& r) { r.clear_position(); }},
      {"position.longitude_deg", kInvalid,
       [](auto& r) { r.mutable_position()->set_longitude_deg(-181); }},
      {"depth_m", kBadDepth, [](auto& r) { r.set_depth_m(-101); }},
      {"depth_m", kNotFinite, [](auto& r) { r.set_depth_m(kNaN); }},
      {"time", kInvalid, [](auto& r) { r.mutable_time()->set_seconds(-5); }},
      {"confidence", kInvalid, [](auto& r) { r.set_confidence(0.5); }},
      {"vertical_clearance_m", kInvalid,
       [](auto& r) { r.set_vertical_clearance_m(12'001); }},
      {"search_radius_m", kInvalid, [](auto& r) { r.clear_search_radius_m(); }},
      {"search_radius_m", kInvalid,
       [](auto& r) { r.set_search_radius_m(50'000.1); }},
      {"search_radius_m", kNotFinite,
       [](auto& r) { r.set_search_radius_m(kNaN); }},
      {"treat_unknown_as", kInvalid,
       [](auto& r) {
         r.set_treat_unknown_as(static_cast<v1::UnknownTreatment>(-1));
       }},
      {"vertical_reference.water_level_m", kInvalid,
       [](auto& r) {
         r.mutable_vertical_reference()->set_reference(
             v1::DEPTH_REFERENCE_WATER_SURFACE);
       }},
  };
  for (const auto& spoiled : cases) {
    v1::FindNearestObstacleRequest request = SampleSearch();
    spoiled.spoil(request);
    EXPECT_THAT(ConvertNearest(request, kNow),
                Violates(spoiled.path, spoiled.reason));
  }
}

TEST(WriteVerdict, WritesConflictLegsAndApproaches) {
  map::TrajectoryVerdict verdict;
  verdict.state = map::ObstacleState::kOccupied;
  verdict.legs.resize(2);
  verdict.legs[0].state = map::ObstacleState::kFree;
  verdict.legs[0].worst_probability = 0.01;
  verdict.legs[0].least_clearance_m = 4.5;
  verdict.legs[1].state = map::ObstacleState::kOccupied;
  verdict.legs[1].worst_probability = 0.99;
  map::Conflict conflict;
  conflict.leg = 1;
  conflict.position = {.latitude_deg = 41.5, .longitude_deg = -71.4};
  conflict.depth_m = 12;
  conflict.time = kNow;
  conflict.answer.state = map::ObstacleState::kOccupied;
  conflict.answer.probability = 0.99;
  verdict.first_conflict = conflict;
  verdict.approaches = {{.key = {.source = {"ais"}, .contact = {"ship"}},
                         .time = kNow,
                         .distance_m = 70,
                         .probability = 0.2}};
  v1::CheckTrajectoryResponse out;
  WriteVerdict(verdict, &out);
  EXPECT_EQ(out.state(), v1::OBSTACLE_STATE_OCCUPIED);
  EXPECT_EQ(out.first_conflict().leg_index(), 1u);
  EXPECT_EQ(out.first_conflict().position().longitude_deg(), -71.4);
  EXPECT_EQ(out.first_conflict().depth_m(), 12);
  EXPECT_EQ(out.first_conflict().time().seconds(), kSampleSeconds);
  EXPECT_EQ(out.first_conflict().answer().probability(), 0.99);
  ASSERT_EQ(out.legs_size(), 2);
  EXPECT_EQ(out.legs(0).least_clearance_m(), 4.5);
  EXPECT_EQ(out.legs(0).worst_probability(), 0.01);
  EXPECT_FALSE(out.legs(1).has_least_clearance_m());
  EXPECT_EQ(out.legs(1).state(), v1::OBSTACLE_STATE_OCCUPIED);
  ASSERT_EQ(out.approaches_size(), 1);
  EXPECT_EQ(out.approaches(0).source_id(), "ais");
  EXPECT_EQ(out.approaches(0).contact_id(), "ship");
  EXPECT_EQ(out.approaches(0).time().seconds(), kSampleSeconds);
  EXPECT_EQ(out.approaches(0).distance_m(), 70);
  EXPECT_EQ(out.approaches(0).probability(), 0.2);
}

}  // namespace
}  // namespace fathom::server
