// The places of a plane within a distance of a segment: what a disc sweeps that
// moves along it.
//
// Plain geometry, metres north and east; inline, pure, thread-safe.

#ifndef FATHOM_MAP_QUERY_STADIUM_H_
#define FATHOM_MAP_QUERY_STADIUM_H_

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace fathom::map {

struct PlanePoint {
  double north_m = 0;
  double east_m = 0;

  friend PlanePoint operator+(const PlanePoint& a, const PlanePoint& b) {
    return {a.north_m + b.north_m, a.east_m + b.east_m};
  }
  friend PlanePoint operator-(const PlanePoint& a, const PlanePoint& b) {
    return {a.north_m - b.north_m, a.east_m - b.east_m};
  }
  friend PlanePoint operator*(double s, const PlanePoint& a) {
    return {s * a.north_m, s * a.east_m};
  }
};

inline double Dot(const PlanePoint& a, const PlanePoint& b) {
  return a.north_m * b.north_m + a.east_m * b.east_m;
}
inline double Cross(const PlanePoint& a, const PlanePoint& b) {
  return a.north_m * b.east_m - a.east_m * b.north_m;
}

// Distance of a point from the segment a b.
inline double DistanceToSegment(const PlanePoint& p, const PlanePoint& a,
                                const PlanePoint& b) {
  const PlanePoint along = b - a;
  const double length2 = Dot(along, along);
  const double share =
      length2 > 0 ? std::clamp(Dot(p - a, along) / length2, 0.0, 1.0) : 0.0;
  const PlanePoint off = p - (a + share * along);
  return std::sqrt(Dot(off, off));
}

// Distance of two segments; 0 where they cross.
inline double DistanceOfSegments(const PlanePoint& a, const PlanePoint& b,
                                 const PlanePoint& c, const PlanePoint& d) {
  const double side_c = Cross(b - a, c - a);
  const double side_d = Cross(b - a, d - a);
  const double side_a = Cross(d - c, a - c);
  const double side_b = Cross(d - c, b - c);
  if (side_c * side_d < 0 && side_a * side_b < 0) return 0;
  return std::min({DistanceToSegment(a, c, d), DistanceToSegment(b, c, d),
                   DistanceToSegment(c, a, b), DistanceToSegment(d, a, b)});
}

// Corners in order, either way round.
using PlaneQuad = std::array<PlanePoint, 4>;

// Whether a convex quadrilateral holds the point; its border counts.
inline bool Holds(const PlaneQuad& quad, const PlanePoint& p) {
  bool left = false;
  bool right = false;
  for (std::size_t k = 0; k < 4; ++k) {
    const double side = Cross(quad[(k + 1) % 4] - quad[k], p - quad[k]);
    left = left || side > 0;
    right = right || side < 0;
  }
  return !(left && right);
}

struct Stadium {
  PlanePoint from;
  PlanePoint to;
  double half_width_m = 0;

  double length_m() const {
    const PlanePoint along = to - from;
    return std::sqrt(Dot(along, along));
  }
  double DistanceTo(const PlanePoint& p) const {
    return DistanceToSegment(p, from, to);
  }
  // How far along the segment's line, from `from`, p lies; may be negative or
  // beyond the end. 0 if the segment has no length.
  double Along(const PlanePoint& p) const {
    const double length = length_m();
    return length > 0 ? Dot(p - from, to - from) / length : 0.0;
  }
  // Whether a convex quadrilateral, widened by `margin_m`, has a point of it.
  bool Touches(const PlaneQuad& quad, double margin_m) const {
    if (Holds(quad, from)) return true;
    for (std::size_t k = 0; k < 4; ++k) {
      if (DistanceOfSegments(from, to, quad[k], quad[(k + 1) % 4]) <=
          half_width_m + margin_m) {
        return true;
      }
    }
    return false;
  }
  // The corners of the rectangle around it.
  PlaneQuad Box() const {
    const double length = length_m();
    const PlanePoint ahead =
        length > 0 ? (half_width_m / length) * (to - from)
                   : PlanePoint{.north_m = half_width_m, .east_m = 0};
    const PlanePoint left = {.north_m = ahead.east_m, .east_m = -ahead.north_m};
    return {from - ahead - left, from - ahead + left, to + ahead + left,
            to + ahead - left};
  }
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_QUERY_STADIUM_H_
