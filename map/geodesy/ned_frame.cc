#include "map/geodesy/ned_frame.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "map/geodesy/small_angle.h"

namespace fathom::map {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;

// WGS84 (NIMA TR8350.2): equatorial radius, first eccentricity squared.
constexpr double kEquatorialM = 6378137.0;
constexpr double kFlattening = 1.0 / 298.257223563;
constexpr double kEccentricity2 = kFlattening * (2.0 - kFlattening);

}  // namespace

NedFrame::NedFrame(const GeodeticPoint& origin)
    : origin_(origin),
      sin_lat_(std::sin(origin.latitude_deg * kRadPerDeg)),
      cos_lat_(std::cos(origin.latitude_deg * kRadPerDeg)) {
  const double squeezed = 1.0 - kEccentricity2 * sin_lat_ * sin_lat_;
  normal_m_ = kEquatorialM / std::sqrt(squeezed);
  stretch_ = kEccentricity2 / squeezed;
  axis_m_ = normal_m_ * cos_lat_;
  height_m_ = normal_m_ * (1.0 - kEccentricity2) * sin_lat_;
}

NedPoint NedFrame::ToNed(const GeodeticPoint& point) const {
  // Earth-fixed axes turned about the pole so that the origin has longitude
  // 0: a towards the origin's meridian, b east, c north pole.
  const double north_rad =
      (point.latitude_deg - origin_.latitude_deg) * kRadPerDeg;
  const double east_rad = EastOfRad(origin_, point);
  double sin_lat;
  double cos_lat;
  double normal_m;  // N at the point.
  SineCosine east;
  if (std::fabs(north_rad) < kSmallRad && std::fabs(east_rad) < kSmallRad) {
    // Nearly every point that is asked about: a third of the time of libm's.
    const SineCosine north = SineCosineOfSmall(north_rad);
    sin_lat = sin_lat_ * north.cosine + cos_lat_ * north.sine;
    cos_lat = cos_lat_ * north.cosine - sin_lat_ * north.sine;
    east = SineCosineOfSmall(east_rad);
    // N = N0 (1 - x)^(-1/2), x = e^2 (sin^2 - sin0^2) / (1 - e^2 sin0^2), by
    // its series: |x| < 1.4e-4, so what is left out is below 35/128 x^4 =
    // 1e-16.
    const double x = stretch_ * (sin_lat - sin_lat_) * (sin_lat + sin_lat_);
    normal_m = normal_m_ * (1.0 + x * (0.5 + x * (0.375 + x * 0.3125)));
  } else {
    const double lat_rad = point.latitude_deg * kRadPerDeg;
    sin_lat = std::sin(lat_rad);
    cos_lat = std::cos(lat_rad);
    east = {.sine = std::sin(east_rad), .cosine = std::cos(east_rad)};
    normal_m =
        kEquatorialM / std::sqrt(1.0 - kEccentricity2 * sin_lat * sin_lat);
  }
  const double a_m = normal_m * cos_lat * east.cosine;
  const double b_m = normal_m * cos_lat * east.sine;
  const double c_m = normal_m * (1.0 - kEccentricity2) * sin_lat;
  return {.north_m = cos_lat_ * (c_m - height_m_) - sin_lat_ * (a_m - axis_m_),
          .east_m = b_m,
          .down_m = 0.0};
}

bool NedFrame::Covers(const GeodeticPoint& point) const {
  const double north_deg = point.latitude_deg - origin_.latitude_deg;
  double east_deg = std::fabs(point.longitude_deg - origin_.longitude_deg);
  if (east_deg > 180) east_deg = 360 - east_deg;
  return std::fabs(north_deg) < 10 &&
         (east_deg < 60 || std::fabs(origin_.latitude_deg) > 75);
}

GeodeticPoint NedFrame::ToGeodetic(double north_m, double east_m) const {
  // The line through (north, east) along the origin's vertical meets the
  // ellipsoid (a^2 + b^2) + c^2 / (1 - e^2) = R^2 at depth d below the plane:
  // a quadratic A d^2 - 2 B d + C = 0 of which the root near 0 is wanted.
  const double flat = 1.0 / (1.0 - kEccentricity2);
  const double a0 = axis_m_ - sin_lat_ * north_m;
  const double c0 = height_m_ + cos_lat_ * north_m;
  const double qa = cos_lat_ * cos_lat_ + flat * sin_lat_ * sin_lat_;
  const double qb = a0 * cos_lat_ + flat * c0 * sin_lat_;
  // C with the origin's own terms (they cancel to 0) left out: no digits lost.
  const double qc =
      north_m * north_m * (sin_lat_ * sin_lat_ + flat * cos_lat_ * cos_lat_) +
      2.0 * north_m * (flat * height_m_ * cos_lat_ - axis_m_ * sin_lat_) +
      east_m * east_m;
  const double root = std::sqrt(std::max(0.0, qb * qb - qa * qc));
  const double down_m = qc / (qb + root);
  const double a_m = a0 - cos_lat_ * down_m;
  const double c_m = c0 - sin_lat_ * down_m;
  const double lat_rad =
      std::atan2(c_m, (1.0 - kEccentricity2) * std::hypot(a_m, east_m));
  const double east_rad = std::atan2(east_m, a_m);
  return {.latitude_deg = lat_rad / kRadPerDeg,
          .longitude_deg = NormalizeLongitudeDeg(origin_.longitude_deg +
                                                 east_rad / kRadPerDeg)};
}

double NedFrame::NorthAzimuthRad(const GeodeticPoint& point) const {
  const double lat_rad = point.latitude_deg * kRadPerDeg;
  const double east_rad = EastOfRad(origin_, point);
  // The unit vector that points north at `point`, in this frame's axes.
  const double east = -std::sin(lat_rad) * std::sin(east_rad);
  const double north = sin_lat_ * std::sin(lat_rad) * std::cos(east_rad) +
                       cos_lat_ * std::cos(lat_rad);
  return std::atan2(east, north);
}

NedPoint SphericalNorthEast(const GeodeticPoint& reference,
                            const GeodeticPoint& point) {
  return {.north_m = (point.latitude_deg - reference.latitude_deg) *
                     kRadPerDeg * kEquatorialM,
          .east_m = (point.longitude_deg - reference.longitude_deg) *
                    kRadPerDeg * kEquatorialM *
                    std::cos(reference.latitude_deg * kRadPerDeg),
          .down_m = 0.0};
}

}  // namespace fathom::map
