// Directions from the Earth's centre, Earth-fixed (x to 0 N 0 E, y to 0 N
// 90 E, z to the north pole), as in Nervegna 2002, section 4.4.2.
//
// A geodetic point stands for the normal of the ellipsoid there (the
// "n-vector"), not for the geocentric direction: no series, no loss, and the
// quadtree needs only that the mapping is one to one. Its price is that cells
// of equal angle differ by up to 0.7 % in metres north-south and east-west.
//
// Pure functions, thread-safe.

#ifndef FATHOM_MAP_GLOBAL_UNIT_VECTOR_H_
#define FATHOM_MAP_GLOBAL_UNIT_VECTOR_H_

#include <cmath>
#include <numbers>

#include "map/geodesy/points.h"

namespace fathom::map {

struct Vector3 {
  double x = 0;
  double y = 0;
  double z = 0;

  friend Vector3 operator+(const Vector3& a, const Vector3& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  friend Vector3 operator-(const Vector3& a) { return {-a.x, -a.y, -a.z}; }
  friend Vector3 operator*(double s, const Vector3& a) {
    return {s * a.x, s * a.y, s * a.z};
  }
};

inline double Dot(const Vector3& a, const Vector3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

inline Vector3 Cross(const Vector3& a, const Vector3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// REQUIRES: a is not zero.
inline Vector3 Unit(const Vector3& a) {
  return (1.0 / std::sqrt(Dot(a, a))) * a;
}

// The angle between two vectors in [0, pi]; accurate near 0 and pi, where an
// arc cosine is not.
inline double AngleBetween(const Vector3& a, const Vector3& b) {
  const Vector3 c = Cross(a, b);
  return std::atan2(std::sqrt(Dot(c, c)), Dot(a, b));
}

// Turns `a` about the unit vector `axis` by `angle_rad`, right-handed
// (Rodrigues).
inline Vector3 Rotate(const Vector3& a, const Vector3& axis, double angle_rad) {
  const double c = std::cos(angle_rad);
  const double s = std::sin(angle_rad);
  return c * a + s * Cross(axis, a) + ((1 - c) * Dot(axis, a)) * axis;
}

// About 25 ns.
inline Vector3 FromGeodetic(const GeodeticPoint& point) {
  constexpr double kRadPerDeg = std::numbers::pi / 180.0;
  const double latitude_rad = point.latitude_deg * kRadPerDeg;
  const double longitude_rad = point.longitude_deg * kRadPerDeg;
  const double equatorial = std::cos(latitude_rad);
  return {equatorial * std::cos(longitude_rad),
          equatorial * std::sin(longitude_rad), std::sin(latitude_rad)};
}

// `direction` may have any length but zero.
inline GeodeticPoint ToGeodetic(const Vector3& direction) {
  constexpr double kDegPerRad = 180.0 / std::numbers::pi;
  return {.latitude_deg =
              std::atan2(direction.z, std::sqrt(direction.x * direction.x +
                                                direction.y * direction.y)) *
              kDegPerRad,
          .longitude_deg = std::atan2(direction.y, direction.x) * kDegPerRad};
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_UNIT_VECTOR_H_
