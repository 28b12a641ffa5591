#include "map/geodesy/points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

TEST(ValidateGeodetic, TakesTheBorders) {
  EXPECT_THAT(ValidateGeodetic({90.0, 180.0}), IsOk());
  EXPECT_THAT(ValidateGeodetic({-90.0, -180.0}), IsOk());
}

TEST(ValidateGeodetic, RefusesBeyondTheBordersAndNamesTheCoordinate) {
  EXPECT_THAT(ValidateGeodetic({90.000001, 0.0}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("latitude_deg=90")));
  EXPECT_THAT(ValidateGeodetic({0.0, -180.5}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("longitude_deg=-180.5")));
}

TEST(ValidateGeodetic, RefusesNotFinite) {
  for (const double bad : {kNaN, kInf, -kInf}) {
    EXPECT_FALSE(ValidateGeodetic({bad, 0.0}).ok());
    EXPECT_FALSE(ValidateGeodetic({0.0, bad}).ok());
  }
}

// WGS84's quarter meridian is 10 001 965.729 m (Karney 2013).
TEST(DistanceM, EquatorToPoleIsTheQuarterMeridian) {
  EXPECT_NEAR(DistanceM({0.0, 20.0}, {90.0, 20.0}), 10'001'965.729, 0.001);
}

// One degree of the equator: 2 pi 6 378 137 / 360 = 111 319.4908 m.
TEST(DistanceM, DegreeOfTheEquator) {
  EXPECT_NEAR(DistanceM({0.0, 179.5}, {0.0, -179.5}), 111'319.4908, 1e-3);
}

TEST(Inverse, AzimuthIsClockwiseFromNorth) {
  const RangeAzimuth east = Inverse({0.0, 10.0}, {0.0, 11.0});
  EXPECT_NEAR(east.azimuth_deg, 90.0, 1e-9);
  const RangeAzimuth south = Inverse({10.0, 10.0}, {9.0, 10.0});
  EXPECT_NEAR(std::abs(south.azimuth_deg), 180.0, 1e-9);
}

TEST(Direct, UndoesInverse) {
  const GeodeticPoint from = {41.5, -71.3};
  const GeodeticPoint to = {41.53, -71.22};
  const RangeAzimuth way = Inverse(from, to);
  const GeodeticPoint back = Direct(from, way.azimuth_deg, way.distance_m);
  EXPECT_LT(DistanceM(back, to), 1e-7);
}

TEST(NormalizeLongitudeDeg, TakesOffWholeTurns) {
  EXPECT_EQ(NormalizeLongitudeDeg(190.0), -170.0);
  EXPECT_EQ(NormalizeLongitudeDeg(-190.0), 170.0);
  EXPECT_EQ(NormalizeLongitudeDeg(360.0), 0.0);
}

}  // namespace
}  // namespace fathom::map
