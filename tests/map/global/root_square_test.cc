#include "map/global/root_square.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "map/global/thesis_planes.h"
#include "tests/map/global/scene.h"
#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

constexpr double kDegPerRad = 180.0 / std::numbers::pi;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

TEST(RootSquare, CornersFollowFigure413) {
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const RootSquare root,
      RootSquare::Create({.latitude_deg = -10, .longitude_deg = 0},
                         {.latitude_deg = 10, .longitude_deg = 0}, 1000));
  const auto corners = root.Corners(CellKey{});
  // psi = 20 degrees; alpha = 2 asin(tan 10) = 2 * 10.15589 = 20.31178. The
  // axis is the Earth's, so NE keeps its latitude and moves east by alpha.
  EXPECT_NEAR(corners[0].latitude_deg, -10, 1e-12);
  EXPECT_NEAR(corners[0].longitude_deg, 0, 1e-12);
  EXPECT_NEAR(corners[1].latitude_deg, 10, 1e-12);
  EXPECT_NEAR(corners[1].longitude_deg, 0, 1e-12);
  EXPECT_NEAR(corners[2].latitude_deg, 10, 1e-12);
  EXPECT_NEAR(corners[2].longitude_deg, 20.31177886859912, 1e-12);
  EXPECT_NEAR(corners[3].latitude_deg, -10, 1e-12);
  EXPECT_NEAR(corners[3].longitude_deg, 20.31177886859912, 1e-12);
}

TEST(RootSquare, SidesAreEqualAndNearlyPerpendicular) {
  const RootSquare root = ThesisSquare();
  const auto corners = root.Corners(CellKey{});
  std::array<Vector3, 4> c;
  for (std::size_t i = 0; i < 4; ++i) c[i] = FromGeodetic(corners[i]);
  const double side = AngleBetween(c[0], c[1]);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(AngleBetween(c[i], c[(i + 1) % 4]), side, 1e-13);
  }
  // A right spherical quadrilateral's angles exceed 90 degrees by a quarter of
  // the spherical excess, near side^2 / 4 = 0.37^2 / 4 = 1.9 degrees.
  EXPECT_NEAR(
      std::acos(Dot(root.west_normal(), root.north_normal())) * kDegPerRad, 90,
      2.1);
}

TEST(RootSquare, NormalsPointInward) {
  const RootSquare root = ThesisSquare();
  const Vector3 middle = FromGeodetic(kNarragansett);
  EXPECT_GT(Dot(root.north_normal(), middle), 0);
  EXPECT_GT(Dot(root.east_normal(), middle), 0);
  EXPECT_GT(Dot(root.south_normal(), middle), 0);
  EXPECT_GT(Dot(root.west_normal(), middle), 0);
}

TEST(RootSquare, ThesisRootHasEighteenLevels) {
  const RootSquare root = ThesisSquare();
  // 1267 nmi / 2^18 = 2346484 m / 262144 = 8.951 m along the west side.
  EXPECT_EQ(root.max_level(), 18);
  EXPECT_NEAR(DistanceM(root.south_west(), root.north_west()), 2346484, 0.001);
  // At the middle 1 / cos(10.5 degrees) = 1.017 times that, and east-west
  // 0.4 % more, because the ellipsoid is flatter there: 9.14 m.
  EXPECT_NEAR(root.cell_size_m(18), 9.14, 0.01);
  EXPECT_LE(root.cell_size_m(18), 10.0);
  EXPECT_GT(root.cell_size_m(17), 10.0);
}

TEST(RootSquare, CenteredOnPutsItsMiddleThere) {
  for (const double side_m : {100.0, 2e4, 2.346484e6, 5e6}) {
    const RootSquare root = SquareOf(side_m, side_m / 100);
    const GeodeticPoint middle = root.Center(CellKey{});
    EXPECT_NEAR(middle.latitude_deg, 41.5, 1e-9);
    EXPECT_NEAR(middle.longitude_deg, -71.3, 1e-9);
    EXPECT_NEAR(DistanceM(root.south_west(), root.north_west()), side_m, 1e-3);
  }
}

TEST(RootSquare, IsMadeAgainFromItsStoredCorners) {
  const RootSquare root = ThesisSquare();
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const RootSquare again,
      RootSquare::Create(root.south_west(), root.north_west(),
                         root.min_cell_m()));
  std::mt19937 random(3);
  std::uniform_real_distribution<double> spread(-9, 9);
  for (int i = 0; i < 1000; ++i) {
    const GeodeticPoint p{.latitude_deg = 41.5 + spread(random),
                          .longitude_deg = -71.3 + spread(random)};
    EXPECT_EQ(root.Locate(p, 24), again.Locate(p, 24));
  }
}

TEST(RootSquare, LevelMatchesTheCellSizeAskedFor) {
  const RootSquare root = SquareOf(1024, 1.01);
  EXPECT_EQ(root.max_level(), 10);
  EXPECT_EQ(root.LevelFor(1024.0 * 1.01), 0);
  EXPECT_EQ(root.LevelFor(16.1), 6);    // 1024 / 2^6 = 16 m.
  EXPECT_EQ(root.LevelFor(15.9), 7);    // 16 m would be larger.
  EXPECT_EQ(root.LevelFor(0.001), 10);  // Bounded by max_level.
}

// The property that lets the map keep no planes: fig. 4-15's descent and the
// two angles find the same leaf, 20 000 random points, 18 levels.
TEST(RootSquare, AnglesAndThesisPlanesFindTheSameCell) {
  const RootSquare root = ThesisSquare();
  std::mt19937_64 random(20020524);
  std::uniform_real_distribution<double> latitude(30, 53);
  std::uniform_real_distribution<double> longitude(-89, -54);
  int inside = 0;
  for (int i = 0; i < 20000; ++i) {
    const GeodeticPoint p{.latitude_deg = latitude(random),
                          .longitude_deg = longitude(random)};
    const auto by_planes = ThesisSearch(root, p, 18);
    const auto by_angles = root.Locate(p, 18);
    ASSERT_EQ(by_planes, by_angles) << p.latitude_deg << " " << p.longitude_deg;
    inside += by_planes.has_value();
  }
  // The box is half as large again as the square.
  EXPECT_GT(inside, 10000);
  EXPECT_LT(inside, 20000);
}

TEST(RootSquare, AnglesAndPlanesAgreeInASmallSquareToo) {
  const RootSquare root = SquareOf(5000, 0.5);
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> spread(-0.03, 0.03);
  for (int i = 0; i < 2000; ++i) {
    const GeodeticPoint p{.latitude_deg = 41.5 + spread(random),
                          .longitude_deg = -71.3 + spread(random)};
    ASSERT_EQ(ThesisSearch(root, p, 14), root.Locate(p, 14));
  }
}

// Near its middle the series are used, further out the library's functions:
// places are the same to 1e-13 of a side on both sides of the seam, and across
// the antimeridian.
TEST(RootSquare, SeriesAndFunctionsMeet) {
  for (const double longitude_deg : {-71.3, 179.9, -179.95}) {
    FATHOM_ASSERT_OK_AND_ASSIGN(
        const RootSquare root,
        RootSquare::CenteredOn(
            {.latitude_deg = 41.5, .longitude_deg = longitude_deg}, 400e3, 10));
    const double seam_deg = kSmallRad * 180 / std::numbers::pi;
    for (const double north : {-1.0, 0.0, 1.0}) {
      for (const double east : {-1.0, 0.0, 1.0}) {
        const auto at = [&](double share) {
          return root
              .Project({.latitude_deg = 41.5 + north * seam_deg * share,
                        .longitude_deg = NormalizeLongitudeDeg(
                            longitude_deg + east * seam_deg * share)})
              .value();
        };
        const SquarePoint inside = at(1 - 1e-14);
        const SquarePoint outside = at(1 + 1e-14);
        EXPECT_NEAR(inside.u, outside.u, 1e-13);
        EXPECT_NEAR(inside.v, outside.v, 1e-13);
      }
    }
  }
}

TEST(RootSquare, EveryCellHoldsItsMiddle) {
  const RootSquare root = ThesisSquare();
  std::mt19937 random(5);
  for (int i = 0; i < 5000; ++i) {
    const int level = static_cast<int>(random() % 25);
    const std::uint32_t mask = (1u << level) - 1;
    const CellKey cell{.level = static_cast<std::uint8_t>(level),
                       .row = static_cast<std::uint32_t>(random()) & mask,
                       .col = static_cast<std::uint32_t>(random()) & mask};
    ASSERT_EQ(root.Locate(root.Center(cell), level), cell);
  }
}

TEST(RootSquare, CornersAreInsideAndBeyondIsNot) {
  const RootSquare root = SquareOf(20000, 10);
  for (const GeodeticPoint& corner : root.Corners(CellKey{})) {
    EXPECT_TRUE(root.Locate(corner, 0));
    // A metre further from the middle.
    const RangeAzimuth out = Inverse(kNarragansett, corner);
    EXPECT_FALSE(root.Locate(
        Direct(kNarragansett, out.azimuth_deg, out.distance_m + 1), 0));
  }
}

TEST(RootSquare, NonsenseIsNowhere) {
  const RootSquare root = ThesisSquare();
  EXPECT_FALSE(root.Locate({.latitude_deg = kNaN, .longitude_deg = 0}, 0));
  EXPECT_FALSE(root.Locate({.latitude_deg = 41.5, .longitude_deg = kNaN}, 0));
  EXPECT_FALSE(
      root.Locate({.latitude_deg = std::numeric_limits<double>::infinity(),
                   .longitude_deg = 0},
                  0));
  // Straight through the Earth.
  EXPECT_FALSE(root.Locate({.latitude_deg = -41.5, .longitude_deg = 108.7}, 0));
  EXPECT_FALSE(RootSquare().Locate(kNarragansett, 0));
}

TEST(RootSquare, RefusesWhatItCannotDivide) {
  const GeodeticPoint sw{.latitude_deg = 41, .longitude_deg = -71};
  const GeodeticPoint nw{.latitude_deg = 42, .longitude_deg = -71};
  const auto invalid = [](const char* text) {
    return StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(text));
  };
  EXPECT_THAT(RootSquare::Create(sw, nw, 0), invalid("min_cell_m=0"));
  EXPECT_THAT(RootSquare::Create(sw, nw, kNaN), invalid("min_cell_m"));
  EXPECT_THAT(RootSquare::Create(sw, sw, 10), invalid("apart"));
  // 111 km / 2^24 = 6.6 mm.
  EXPECT_THAT(RootSquare::Create(sw, nw, 0.005), invalid("too small"));
  EXPECT_THAT(RootSquare::Create(sw, {.latitude_deg = 91}, 10),
              invalid("latitude"));
  EXPECT_THAT(RootSquare::Create({.latitude_deg = -31, .longitude_deg = 0},
                                 {.latitude_deg = 30, .longitude_deg = 0}, 10),
              invalid("60 degrees"));
  EXPECT_THAT(RootSquare::CenteredOn({.latitude_deg = 89}, 1e6, 10),
              invalid("pole"));
  EXPECT_THAT(RootSquare::CenteredOn(kNarragansett, kNaN, 10),
              invalid("side_m"));
}

}  // namespace
}  // namespace fathom::map
