#include "server/geo_box.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fathom::server {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180;
// The least length of a degree of latitude (at the equator) and of longitude
// per cosine of the latitude, metres, WGS 84.
constexpr double kLatitudeM = 110'500;
constexpr double kLongitudeM = 111'300;
// The least radius of curvature, metres: rounds bows up.
constexpr double kRadiusM = 6'330'000;
constexpr double kFarthestM = 1'000'000;
// Beyond it a box is a cap about the pole.
constexpr double kPolarDeg = 89;

}  // namespace

double EastwardDeg(double from_deg, double to_deg) {
  const double turns = (to_deg - from_deg) / 360;
  return (turns - std::floor(turns)) * 360;
}

GeoBox BoxAround(std::span<const map::GeodeticPoint> corners, double margin_m) {
  const double middle_deg = corners.front().longitude_deg;
  GeoBox box = {.south_deg = 90, .north_deg = -90};
  double west_deg = 0;
  double east_deg = 0;
  for (const map::GeodeticPoint& corner : corners) {
    box.south_deg = std::min(box.south_deg, corner.latitude_deg);
    box.north_deg = std::max(box.north_deg, corner.latitude_deg);
    const double east =
        EastwardDeg(middle_deg - 180, corner.longitude_deg) - 180;
    west_deg = std::min(west_deg, east);
    east_deg = std::max(east_deg, east);
  }
  const double highest_deg =
      std::max(std::fabs(box.south_deg), std::fabs(box.north_deg));
  if (highest_deg > kPolarDeg) {
    // Meridians are close: no bow in longitude matters, all of them are in.
    box.west_deg = -180;
    box.width_deg = 360;
  }
  const double high_m = (box.north_deg - box.south_deg) * kLatitudeM;
  const double wide_m =
      (east_deg - west_deg) * kLongitudeM *
      std::cos(std::min(std::fabs(box.south_deg), std::fabs(box.north_deg)) *
               kRadPerDeg);
  const double across_m = std::hypot(high_m, wide_m);
  if (across_m > kFarthestM) return {};
  const double slope = std::tan(std::min(highest_deg, kPolarDeg) * kRadPerDeg);
  const double rim_m =
      margin_m + across_m * across_m / (8 * kRadiusM) * std::max(1.0, slope);
  const double rim_deg = rim_m / kLatitudeM;
  box.south_deg = std::max(-90.0, box.south_deg - rim_deg);
  box.north_deg = std::min(90.0, box.north_deg + rim_deg);
  if (highest_deg + rim_deg > kPolarDeg) {
    if (box.north_deg > kPolarDeg) box.north_deg = 90;
    if (box.south_deg < -kPolarDeg) box.south_deg = -90;
    box.west_deg = -180;
    box.width_deg = 360;
    return box;
  }
  const double side_deg =
      rim_m / (kLongitudeM * std::cos((highest_deg + rim_deg) * kRadPerDeg));
  box.west_deg = middle_deg + west_deg - side_deg;
  box.width_deg = std::min(360.0, east_deg - west_deg + 2 * side_deg);
  return box;
}

bool Touch(const GeoBox& a, const GeoBox& b) {
  if (a.north_deg < b.south_deg || b.north_deg < a.south_deg) return false;
  const double eastward = EastwardDeg(a.west_deg, b.west_deg);
  return eastward <= a.width_deg || eastward + b.width_deg >= 360;
}

}  // namespace fathom::server
