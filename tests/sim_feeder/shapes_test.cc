#include "sim_feeder/shapes.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sim_feeder/truth_source.h"
#include "tests/sim_feeder/plane_terrain.h"
#include "tests/testing/status_matchers.h"

namespace fathom::feeder {
namespace {

double At(const Shape& shape, double north_m, double east_m) {
  return RaisedM({shape}, north_m, east_m);
}

TEST(RaisedM, EachKindByHand) {
  // 5 m up on each 100 m to the east.
  const Shape slope = {.kind = ShapeKind::kSlope, .azimuth_deg = 90};
  EXPECT_NEAR(At(slope, 7, 200), 10, 1e-9);
  EXPECT_NEAR(At(slope, 7, -100), -5, 1e-9);
  // 100 m long to the north, 1 sigma 5 m across: at 5 m 5 exp(-1/2).
  const Shape ridge = {.kind = ShapeKind::kRidge};
  EXPECT_NEAR(At(ridge, 50, 0), 5, 1e-9);
  EXPECT_NEAR(At(ridge, -20, 5), 5 * std::exp(-0.5), 1e-9);
  EXPECT_NEAR(At(ridge, 55, 0), 5 * std::exp(-0.5), 1e-9);
  Shape channel = ridge;
  channel.kind = ShapeKind::kChannel;
  EXPECT_NEAR(At(channel, -20, 5), -5 * std::exp(-0.5), 1e-9);
  const Shape pinnacle = {.north_m = 10, .east_m = 20, .width_m = 4};
  EXPECT_NEAR(At(pinnacle, 10, 20), 5, 1e-9);
  EXPECT_NEAR(At(pinnacle, 12, 20), 5 * std::exp(-0.5), 1e-9);
  // 30 m by 6 m, turned to the east.
  const Shape wreck = {.kind = ShapeKind::kWreck,
                       .azimuth_deg = 90,
                       .length_m = 30,
                       .width_m = 6};
  EXPECT_EQ(At(wreck, 2.9, 14.9), 5);
  EXPECT_EQ(At(wreck, 3.1, 0), 0);
  EXPECT_EQ(At(wreck, 0, 15.1), 0);
}

TEST(RaisedM, TheHighestCountsAndSlopesAddUp) {
  const std::vector<Shape> shapes = {{.kind = ShapeKind::kSlope, .height_m = 2},
                                     {.kind = ShapeKind::kWreck, .height_m = 3},
                                     {.kind = ShapeKind::kWall, .height_m = 4}};
  // On the slope at 25 m north: 2 x 25 / 100.
  EXPECT_NEAR(RaisedM(shapes, 25, 0), 4.5, 1e-9);
}

TEST(ShapedTerrain, IsTheSeabedLessWhatRises) {
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const Terrain terrain,
      ShapedTerrain([](double north_m, double) { return 30 + north_m / 100; },
                    {{.kind = ShapeKind::kWreck, .length_m = 20}}, kTestOrigin,
                    {-100, 100, -100, 100}, 1.0));
  const map::NedFrame frame(kTestOrigin);
  EXPECT_NEAR(terrain.DepthAt(frame.ToGeodetic(5, 2)).value_or(0), 25.05, 1e-4);
  EXPECT_NEAR(terrain.DepthAt(frame.ToGeodetic(50, 2)).value_or(0), 30.5, 1e-4);
  EXPECT_FALSE(terrain.DepthAt(frame.ToGeodetic(150, 2)).has_value());
  const auto large = ShapedTerrain([](double, double) { return 30.0; }, {},
                                   kTestOrigin, {0, 10'000, 0, 10'000}, 1.0);
  // 1e8 cells: the root of 100 / 16 is 2.5 m.
  EXPECT_TRUE(absl::IsResourceExhausted(large.status()));
  EXPECT_NE(large.status().message().find("2.5 m would do"), std::string::npos)
      << large.status();
}

TEST(TruthSource, ALevelSeabedWithAWall) {
  TruthOptions options;
  options.flat_depth_m = 25;
  options.shapes = {{.kind = ShapeKind::kWall,
                     .north_m = 100,
                     .east_m = 100,
                     .length_m = 50,
                     .width_m = 4}};
  FATHOM_ASSERT_OK_AND_ASSIGN(const TruthSource truth,
                              TruthSource::Load(options));
  EXPECT_FALSE(truth.Pick(100, 10, 4).ok());
  EXPECT_EQ(truth.Describe(), "level at 25 m + 1 shapes");
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto seabed,
                              truth.SeabedAbout({.south_west = kTestOrigin,
                                                 .north_extent_m = 200,
                                                 .east_extent_m = 200},
                                                50));
  EXPECT_NEAR(seabed->DepthAt(100, 100).value_or(0), 20, 1e-3);
  EXPECT_NEAR(seabed->DepthAt(100, 110).value_or(0), 25, 1e-3);
}

}  // namespace
}  // namespace fathom::feeder
