#include "sim_feeder/survey_area.h"

#include <gtest/gtest.h>

#include "map/geodesy/ned_frame.h"
#include "tests/sim_feeder/plane_terrain.h"
#include "tests/testing/status_matchers.h"

namespace fathom::feeder {
namespace {

using ::fathom::testing::StatusIs;

TEST(PickArea, FindsTheOnlyWater) {
  // Land but for a bay, 200 to 500 m east and 100 to 400 m south.
  const auto terrain = MakePlaneTerrain(
      [](double north_m, double east_m) {
        return north_m < -100 && north_m > -400 && east_m > 200 ? 20.0 : -5.0;
      },
      10.0, 500.0);
  FATHOM_ASSERT_OK_AND_ASSIGN(const PickedArea picked,
                              PickArea(*terrain, {.side_m = 200.0}));
  const map::NedPoint corner =
      map::NedFrame(kTestOrigin).ToNed(picked.area.south_west);
  EXPECT_DOUBLE_EQ(picked.usable_share, 1.0);
  // The square [corner, corner + 200 m] lies in the bay (looks are 12.5 m
  // apart, so a border may be off by half of that).
  EXPECT_GE(corner.north_m, -400.0 - 6.25);
  EXPECT_LE(corner.north_m + 200.0, -100.0 + 6.25);
  EXPECT_GE(corner.east_m, 200.0 - 6.25);
  EXPECT_LE(corner.east_m + 200.0, 500.0);
  EXPECT_EQ(picked.area.north_extent_m, 200.0);
}

TEST(PickArea, TakesTheOneNearestToTheMiddle) {
  const auto terrain =
      MakePlaneTerrain([](double, double) { return 20.0; }, 10.0, 500.0);
  FATHOM_ASSERT_OK_AND_ASSIGN(const PickedArea picked,
                              PickArea(*terrain, {.side_m = 200.0}));
  const map::NedPoint corner =
      map::NedFrame(kTestOrigin).ToNed(picked.area.south_west);
  // 1000 m are 80 looks; corners at every fourth: -100 m is one of them.
  EXPECT_NEAR(corner.north_m, -100.0, 1e-3);
  EXPECT_NEAR(corner.east_m, -100.0, 1e-3);
}

TEST(PickArea, RefusesATerrainWithoutWater) {
  const auto terrain =
      MakePlaneTerrain([](double, double) { return -3.0; }, 10.0, 500.0);
  EXPECT_THAT(PickArea(*terrain, {.side_m = 200.0}),
              StatusIs(absl::StatusCode::kNotFound));
}

TEST(PickArea, RefusesASearchThatWouldNotEnd) {
  const auto terrain =
      MakePlaneTerrain([](double, double) { return 20.0; }, 100.0, 50'000.0);
  EXPECT_THAT(PickArea(*terrain, {.side_m = 200.0}),
              StatusIs(absl::StatusCode::kResourceExhausted));
}

TEST(ValidateArea, RefusesWhatIsNotAnArea) {
  const SurveyArea good = {.south_west = kTestOrigin,
                           .north_extent_m = 100.0,
                           .east_extent_m = 100.0};
  FATHOM_EXPECT_OK(ValidateArea(good));
  SurveyArea bad = good;
  bad.north_extent_m = 19.0;  // Less than two cells of 10 m.
  EXPECT_THAT(ValidateArea(bad), StatusIs(absl::StatusCode::kInvalidArgument));
  bad = good;
  bad.south_west.latitude_deg = 91.0;
  EXPECT_THAT(ValidateArea(bad), StatusIs(absl::StatusCode::kInvalidArgument));
}

}  // namespace
}  // namespace fathom::feeder
