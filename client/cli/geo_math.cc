#include "client/cli/geo_math.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace fathom::client::cli {
namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180;
constexpr double kEquatorialRadiusM = 6'378'137.0;      // WGS 84.
constexpr double kEccentricity2 = 6.694'379'990'14e-3;  // WGS 84.

using Vector = std::array<double, 3>;

Vector UnitOf(const v1::GeodeticPoint& point) {
  const double latitude = point.latitude_deg() * kRadiansPerDegree;
  const double longitude = point.longitude_deg() * kRadiansPerDegree;
  return {std::cos(latitude) * std::cos(longitude),
          std::cos(latitude) * std::sin(longitude), std::sin(latitude)};
}

double Dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

Vector Cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
          a[0] * b[1] - a[1] * b[0]};
}

Vector Combine(double p, const Vector& a, double q, const Vector& b) {
  return {p * a[0] + q * b[0], p * a[1] + q * b[1], p * a[2] + q * b[2]};
}

Vector Normalized(const Vector& a) {
  const double scale = 1 / std::sqrt(Dot(a, a));
  return {a[0] * scale, a[1] * scale, a[2] * scale};
}

// Rodrigues' rotation of `v` about the unit vector `axis`.
Vector Rotated(const Vector& v, const Vector& axis, double angle) {
  const double c = std::cos(angle);
  Vector result = Combine(c, v, std::sin(angle), Cross(axis, v));
  return Combine(1, result, (1 - c) * Dot(axis, v), axis);
}

}  // namespace

MetersPerDegree MetersPerDegreeAt(double latitude_deg) {
  const double latitude = latitude_deg * kRadiansPerDegree;
  const double s = std::sin(latitude);
  const double w2 = 1 - kEccentricity2 * s * s;
  const double prime_vertical_m = kEquatorialRadiusM / std::sqrt(w2);
  const double meridian_m = prime_vertical_m * (1 - kEccentricity2) / w2;
  return {meridian_m * kRadiansPerDegree,
          prime_vertical_m * std::cos(latitude) * kRadiansPerDegree};
}

double WrapLongitude(double longitude_deg) {
  const double turned = std::fmod(longitude_deg + 180, 360);
  return turned < 0 ? turned + 180 : turned - 180;
}

v1::GeodeticPoint Offset(const v1::GeodeticPoint& from, double north_m,
                         double east_m) {
  v1::GeodeticPoint to;
  const double north_deg =
      north_m / MetersPerDegreeAt(from.latitude_deg()).latitude;
  to.set_latitude_deg(from.latitude_deg() + north_deg);
  // Longitude at the destination's latitude: where the area begins.
  const double meters_per_degree =
      std::max(1.0, MetersPerDegreeAt(to.latitude_deg()).longitude);
  to.set_longitude_deg(
      WrapLongitude(from.longitude_deg() + east_m / meters_per_degree));
  return to;
}

GeoBox MissionBox(const v1::GeodeticPoint& south_west,
                  const v1::GeodeticPoint& north_west) {
  const Vector sw = UnitOf(south_west);
  const Vector nw = UnitOf(north_west);
  // Nervegna 2002, fig. 4-13: b bisects NW and SW, r = unit(unit(NW x SW) x b)
  // is the axis, psi the angle between them, alpha = 2 asin(tan(psi / 2)).
  const Vector b = Normalized(Combine(1, nw, 1, sw));
  const Vector r = Normalized(Cross(Normalized(Cross(nw, sw)), b));
  const double psi = std::acos(std::clamp(Dot(nw, sw), -1.0, 1.0));
  const double alpha = 2 * std::asin(std::min(1.0, std::tan(psi / 2)));
  // The rotation that leads east of the western side.
  const double turn =
      Dot(Cross(b, Rotated(b, r, alpha)), {0, 0, 1}) > 0 ? alpha : -alpha;
  const std::array<Vector, 5> corners = {sw, nw, Rotated(nw, r, turn),
                                         Rotated(sw, r, turn), sw};
  double south = 90, north = -90, west = 0, east = 0;
  bool holds_pole[2] = {true, true};  // South, north.
  for (std::size_t side = 0; side + 1 < corners.size(); ++side) {
    const Vector inward = Cross(corners[side + 1], corners[side]);
    if (inward[2] < 0) holds_pole[1] = false;
    if (inward[2] > 0) holds_pole[0] = false;
    constexpr int kSteps = 64;
    for (int i = 0; i <= kSteps; ++i) {
      const double t = static_cast<double>(i) / kSteps;
      const Vector v =
          Normalized(Combine(1 - t, corners[side], t, corners[side + 1]));
      const double latitude = std::asin(v[2]) / kRadiansPerDegree;
      const double relative =
          WrapLongitude(std::atan2(v[1], v[0]) / kRadiansPerDegree -
                        south_west.longitude_deg());
      south = std::min(south, latitude);
      north = std::max(north, latitude);
      west = std::min(west, relative);
      east = std::max(east, relative);
    }
  }
  const double margin = 0.01 * psi / kRadiansPerDegree;
  if (holds_pole[0] || holds_pole[1]) {
    return {holds_pole[0] ? -90.0 : std::max(-90.0, south - margin), -180,
            holds_pole[1] ? 90.0 : std::min(90.0, north + margin), 180};
  }
  const double margin_longitude =
      margin / std::max(0.01, std::cos(std::max(std::abs(south), north) *
                                       kRadiansPerDegree));
  if (east - west + 2 * margin_longitude >= 360) {
    return {std::max(-90.0, south - margin), -180,
            std::min(90.0, north + margin), 180};
  }
  return {std::max(-90.0, south - margin),
          WrapLongitude(south_west.longitude_deg() + west - margin_longitude),
          std::min(90.0, north + margin),
          WrapLongitude(south_west.longitude_deg() + east + margin_longitude)};
}

}  // namespace fathom::client::cli
