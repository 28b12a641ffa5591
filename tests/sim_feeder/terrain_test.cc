#include "sim_feeder/terrain.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/sim_feeder/plane_terrain.h"
#include "tests/testing/status_matchers.h"

namespace fathom::feeder {
namespace {

using ::fathom::testing::StatusIs;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// 3 x 3 cells of one degree; outer corner at 60 N, 10 E:
//    1  2  4
//    8 16 32
//    - 64 90      ("-" has no value)
Terrain MakeSmall() {
  return *Terrain::Create(
      {.rows = 3,
       .columns = 3,
       .depth_m = {1, 2, 4, 8, 16, 32, kNan, 64, 90},
       .cell_size_m = 1.0e5,
       .name = "small"},
      GeographicReference({.latitude_deg = 60, .longitude_deg = 10}, 1.0, 1.0));
}

TEST(Terrain, IsBilinearBetweenCellCentres) {
  const Terrain terrain = MakeSmall();
  // The centre of the first cell itself: 59.5 N 10.5 E.
  EXPECT_DOUBLE_EQ(*terrain.DepthAt({59.5, 10.5}), 1.0);
  // A quarter of the way east and half of the way south of it:
  // top 0.75*1 + 0.25*2 = 1.25, bottom 0.75*8 + 0.25*16 = 10,
  // mean (1.25 + 10) / 2 = 5.625.
  EXPECT_DOUBLE_EQ(*terrain.DepthAt({59.0, 10.75}), 5.625);
  // The last centres of the first row: the border itself still counts.
  EXPECT_DOUBLE_EQ(*terrain.DepthAt({59.5, 12.5}), 4.0);
}

TEST(Terrain, KnowsNothingWhereAValueIsMissing) {
  const Terrain terrain = MakeSmall();
  // Row 2 column 0 has no value: the square to its north-east needs it.
  EXPECT_FALSE(terrain.DepthAt({58.0, 11.0}).has_value());
  // The square of 16, 32, 64 and 90 does not: (16 + 32 + 64 + 90) / 4 = 50.5.
  EXPECT_DOUBLE_EQ(*terrain.DepthAt({58.0, 12.0}), 50.5);
}

TEST(Terrain, KnowsNothingOutsideTheOutermostCentres) {
  const Terrain terrain = MakeSmall();
  EXPECT_FALSE(terrain.DepthAt({59.6, 11.0}).has_value());
  EXPECT_FALSE(terrain.DepthAt({59.0, 10.4}).has_value());
  EXPECT_FALSE(terrain.DepthAt({59.0, 12.6}).has_value());
  EXPECT_FALSE(terrain.DepthAt({57.4, 12.0}).has_value());
}

TEST(Terrain, UnderstandsLongitudesOfBothKinds) {
  // 0..360 as ETOPO5 has them: 289.5 E is 70.5 W.
  const Terrain terrain = *Terrain::Create(
      {.rows = 2,
       .columns = 2,
       .depth_m = {1, 2, 3, 4},
       .cell_size_m = 1.0e5,
       .name = "east"},
      GeographicReference({.latitude_deg = 42, .longitude_deg = 289}, 1.0,
                          1.0));
  EXPECT_DOUBLE_EQ(*terrain.DepthAt({41.5, -70.5}), 1.0);
  EXPECT_DOUBLE_EQ(*terrain.DepthAt({41.5, -69.5}), 2.0);
}

TEST(Terrain, WrapsAroundTheEarth) {
  // Four columns of 90 degrees from 0 E: centres at 45, 135, 225, 315 E.
  const Terrain terrain = *Terrain::Create(
      {.rows = 2,
       .columns = 4,
       .depth_m = {10, 20, 30, 50, 10, 20, 30, 50},
       .cell_size_m = 1.0e7,
       .wraps_east = true,
       .name = "globe"},
      GeographicReference({.latitude_deg = 90, .longitude_deg = 0}, 90.0,
                          90.0));
  // On the meridian of Greenwich, half way between 315 E and 45 E.
  EXPECT_DOUBLE_EQ(*terrain.DepthAt({0.0, 0.0}), 30.0);
  // 22.5 W: a quarter of the way from 315 E: 0.75*50 + 0.25*10 = 40.
  EXPECT_DOUBLE_EQ(*terrain.DepthAt({0.0, -22.5}), 40.0);
}

TEST(Terrain, RefusesAGridThatDoesNotFit) {
  const Georeference reference = GeographicReference({60, 10}, 1.0, 1.0);
  EXPECT_THAT(Terrain::Create({.rows = 2,
                               .columns = 2,
                               .depth_m = {1, 2, 3},
                               .cell_size_m = 1.0,
                               .name = "short"},
                              reference),
              StatusIs(absl::StatusCode::kInvalidArgument));
  EXPECT_THAT(Terrain::Create({.rows = 1,
                               .columns = 2,
                               .depth_m = {1, 2},
                               .cell_size_m = 1.0,
                               .name = "thin"},
                              reference),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST(LocalTerrain, AgreesWithTheTerrainItTabulates) {
  const auto depth = [](double north_m, double east_m) {
    return 50.0 + 10.0 * std::sin(north_m / 70.0) * std::cos(east_m / 90.0);
  };
  const auto seabed = MakePlaneSeabed(depth);
  const map::NedFrame frame(kTestOrigin);
  for (int i = 0; i < 1000; ++i) {
    const double north_m = -480.0 + (i * 37) % 960;
    const double east_m = -480.0 + (i * 91) % 960;
    ASSERT_NEAR(*seabed->DepthAt(north_m, east_m),
                *seabed->terrain().DepthAt(frame.ToGeodetic(north_m, east_m)),
                1e-6);
  }
  EXPECT_FALSE(seabed->DepthAt(501.0, 0.0).has_value());
}

}  // namespace
}  // namespace fathom::feeder
