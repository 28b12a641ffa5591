#include "map/geodesy/ned_frame.h"

#include <gtest/gtest.h>

#include <GeographicLib/Constants.hpp>
#include <GeographicLib/LocalCartesian.hpp>
#include <cmath>
#include <numbers>
#include <random>

namespace fathom::map {
namespace {

const GeodeticPoint kOrigin = {41.5, -71.3};
constexpr double kRadPerDeg = std::numbers::pi / 180.0;

// The oracle: GeographicLib's own projection, height 0.
NedPoint ByLocalCartesian(const GeodeticPoint& origin,
                          const GeodeticPoint& point) {
  const GeographicLib::LocalCartesian plane(origin.latitude_deg,
                                            origin.longitude_deg);
  NedPoint result;
  double up_m = 0.0;
  plane.Forward(point.latitude_deg, point.longitude_deg, 0.0, result.east_m,
                result.north_m, up_m);
  return result;
}

TEST(NedFrame, UsesTheEllipsoidOfGeographicLib) {
  // The constants written in ned_frame.cc.
  EXPECT_EQ(GeographicLib::Constants::WGS84_a(), 6378137.0);
  EXPECT_EQ(GeographicLib::Constants::WGS84_f(), 1.0 / 298.257223563);
}

TEST(NedFrame, AgreesWithLocalCartesianOutToAHundredKilometres) {
  std::mt19937_64 random(20020524);
  std::uniform_real_distribution<double> latitude(-85.0, 85.0);
  std::uniform_real_distribution<double> longitude(-180.0, 180.0);
  std::uniform_real_distribution<double> azimuth(0.0, 360.0);
  std::uniform_real_distribution<double> distance(0.0, 100'000.0);
  for (int trial = 0; trial < 2000; ++trial) {
    const GeodeticPoint origin = {latitude(random), longitude(random)};
    const NedFrame frame(origin);
    const GeodeticPoint point =
        Direct(origin, azimuth(random), distance(random));
    const NedPoint oracle = ByLocalCartesian(origin, point);
    const NedPoint got = frame.ToNed(point);
    // Both subtract numbers of 6.4e6 m: a few units of 1e-9 m each.
    EXPECT_NEAR(got.north_m, oracle.north_m, 1e-7);
    EXPECT_NEAR(got.east_m, oracle.east_m, 1e-7);
    EXPECT_EQ(got.down_m, 0.0);
  }
}

TEST(NedFrame, ToGeodeticUndoesToNed) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> latitude(-88.0, 88.0);
  std::uniform_real_distribution<double> longitude(-180.0, 180.0);
  std::uniform_real_distribution<double> metres(-100'000.0, 100'000.0);
  for (int trial = 0; trial < 2000; ++trial) {
    const NedFrame frame({latitude(random), longitude(random)});
    const double north_m = metres(random);
    const double east_m = metres(random);
    const NedPoint back = frame.ToNed(frame.ToGeodetic(north_m, east_m));
    EXPECT_NEAR(back.north_m, north_m, 1e-7);
    EXPECT_NEAR(back.east_m, east_m, 1e-7);
  }
}

TEST(NedFrame, OriginIsZero) {
  const NedPoint at = NedFrame(kOrigin).ToNed(kOrigin);
  EXPECT_NEAR(at.north_m, 0.0, 1e-9);
  EXPECT_EQ(at.east_m, 0.0);
}

// The projection shortens a geodesic of length d by d^3 / (6 R^2):
// 5000^3 / (6 * 6.37e6^2) = 0.51 mm, 10 000: 4.1 mm.
TEST(NedFrame, LengthsAreThoseOfTheGeodesicToHalfAMillimetreAtFiveKilometres) {
  const NedFrame frame(kOrigin);
  for (int azimuth_deg = 0; azimuth_deg < 360; azimuth_deg += 15) {
    const NedPoint at = frame.ToNed(Direct(kOrigin, azimuth_deg, 5000.0));
    const double length_m = std::hypot(at.north_m, at.east_m);
    EXPECT_NEAR(length_m, 5000.0 - 0.00051, 0.00003) << azimuth_deg;
  }
}

TEST(NedFrame, CrossesTheAntimeridian) {
  const NedFrame frame({0.0, 179.999});
  // 0.002 degree of the equator: 222.639 m, east.
  EXPECT_NEAR(frame.ToNed({0.0, -179.999}).east_m, 222.639, 1e-3);
  EXPECT_NEAR(frame.ToGeodetic(0.0, 222.638981).longitude_deg, -179.999, 1e-9);
}

TEST(NedFrame, NotANumberStaysOne) {
  const NedPoint at = NedFrame(kOrigin).ToNed({std::nan(""), -71.3});
  EXPECT_TRUE(std::isnan(at.north_m));
}

// Meridians converge by about -sin(41.5) * dlon; 5000 m east at 41.5 N is
// dlon = 5000 / (6 387 530 * 0.74896) = 0.0010452 rad, times -0.66262:
// -0.00069255 rad = -0.0397 degree.
TEST(NedFrame, NorthTurnsTowardsTheOriginsMeridian) {
  const NedFrame frame(kOrigin);
  const GeodeticPoint east = frame.ToGeodetic(0.0, 5000.0);
  EXPECT_NEAR(frame.NorthAzimuthRad(east), -0.00069255, 2e-8);
  const GeodeticPoint north = frame.ToGeodetic(5000.0, 0.0);
  EXPECT_NEAR(frame.NorthAzimuthRad(north), 0.0, 1e-12);
}

// The azimuth by which a geodesic leaves a far point, and the same line in
// the plane, agree once the convergence is added.
TEST(NedFrame, HeadingPlusConvergenceIsTheHeadingInThePlane) {
  const NedFrame frame(kOrigin);
  const GeodeticPoint vehicle = Direct(kOrigin, 70.0, 4000.0);
  for (int heading_deg = 0; heading_deg < 360; heading_deg += 30) {
    const NedPoint start = frame.ToNed(vehicle);
    const NedPoint end = frame.ToNed(Direct(vehicle, heading_deg, 1000.0));
    const double angle_rad =
        heading_deg * kRadPerDeg + frame.NorthAzimuthRad(vehicle);
    // Without the convergence (0.55 mrad here) this would be off by 0.5 m.
    EXPECT_NEAR(end.north_m - start.north_m, 1000.0 * std::cos(angle_rad),
                0.001);
    EXPECT_NEAR(end.east_m - start.east_m, 1000.0 * std::sin(angle_rad), 0.001);
  }
}

// Eq. 4.3 as printed: 0.01 degree is 0.01 * pi / 180 * 6 378 137 = 1113.1949 m
// north, and times cos(60) = 0.5 east: 556.5975 m.
TEST(SphericalNorthEast, IsEquation4_3) {
  const NedPoint at = SphericalNorthEast({60.0, 10.0}, {60.01, 10.01});
  EXPECT_NEAR(at.north_m, 1113.1949, 1e-4);
  EXPECT_NEAR(at.east_m, 556.5975, 1e-4);
}

// Why the map does not use it. At 41.5 N, sin^2 = 0.43907, w = 1 - e^2 sin^2 =
// 0.9970607: the meridian's radius is M = R (1 - e^2) / w^1.5 = 6 363 475 m,
// the prime vertical's N = R / w^0.5 = 6 387 531 m. Eq. 4.3 takes R =
// 6 378 137 for both: R / M - 1 = +0.23 %, R / N - 1 = -0.147 %.
TEST(SphericalNorthEast, ErrsByACellAtFiveKilometresWhereTheFrameDoesNot) {
  const NedFrame frame(kOrigin);
  const GeodeticPoint north = Direct(kOrigin, 0.0, 5000.0);
  const GeodeticPoint east = Direct(kOrigin, 90.0, 5000.0);

  const double north_error_m =
      SphericalNorthEast(kOrigin, north).north_m - 5000.0;
  const double east_error_m = SphericalNorthEast(kOrigin, east).east_m - 5000.0;
  RecordProperty("eq_4_3_north_error_m", std::to_string(north_error_m));
  RecordProperty("eq_4_3_east_error_m", std::to_string(east_error_m));
  EXPECT_NEAR(north_error_m, 11.5, 0.1);  // 5000 * 0.0023.
  EXPECT_NEAR(east_error_m, -7.35, 0.1);  // 5000 * -0.00147.

  EXPECT_NEAR(frame.ToNed(north).north_m, 5000.0, 0.001);
  EXPECT_NEAR(frame.ToNed(east).east_m, 5000.0, 0.001);
}

}  // namespace
}  // namespace fathom::map
