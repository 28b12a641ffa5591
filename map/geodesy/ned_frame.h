// A north-east plane that touches the ellipsoid at an origin.
//
// The thesis maps latitude and longitude to metres as if the Earth were a
// sphere of the equatorial radius (Nervegna 2002, eq. 4.3). At 41.5 N that is
// 0.23 % too long north-south and 0.15 % too short east-west: 7 to 12 m at
// 5 km, about a cell. Deviation: we project onto the plane that touches the
// WGS84 ellipsoid at the origin. `SphericalNorthEast` keeps the thesis's rule
// under its own name for tests and comparison.
//
// The projection is of the point *on the ellipsoid*, along the origin's
// vertical; depth is measured along each place's own vertical and never mixed
// in, so the Earth's curvature does not leak into depth. On the plane,
// lengths are those of the geodesic to d^3 / (6 R^2): 0.5 mm at 5 km, 4 m at
// 100 km.
//
// This is GeographicLib::LocalCartesian's east and north written out for
// height 0 and turned to our order of axes (the flip from east-north-up
// happens in this file only). Tests hold it to LocalCartesian within 1 um
// out to 100 km; it is about four times as quick.

#ifndef FATHOM_MAP_GEODESY_NED_FRAME_H_
#define FATHOM_MAP_GEODESY_NED_FRAME_H_

#include "map/geodesy/points.h"

namespace fathom::map {

// Immutable after construction: copy it and share it between threads freely.
class NedFrame {
 public:
  // The frame touches the ellipsoid at `origin`. REQUIRES: a valid point that
  // is not within 1e-6 degree of a pole (its north would be undefined).
  explicit NedFrame(const GeodeticPoint& origin);
  NedFrame() : NedFrame(GeodeticPoint{}) {}

  // The point in metres from the origin. down_m is 0 (see above). A longitude
  // on the other side of the antimeridian is understood. NaN in, NaN out.
  // Accurate to 10 nm within 1000 km; beyond a quarter of the Earth the plane
  // folds back and the result means nothing.
  NedPoint ToNed(const GeodeticPoint& point) const;

  // Whether the point is near enough for ToNed to be one to one: within 10
  // degrees of the origin's latitude and 60 of its longitude (any, near a
  // pole), short of where the plane folds back.
  bool Covers(const GeodeticPoint& point) const;

  // The point of the ellipsoid that ToNed projects to (north_m, east_m): the
  // exact inverse, to 10 nm. REQUIRES: both within 3000 km of 0.
  GeodeticPoint ToGeodetic(double north_m, double east_m) const;

  // The direction of true north at `point`, as an angle in this plane
  // (radians clockwise from the plane's north axis). Meridians converge, so
  // east of a northern origin it is negative: about -sin(lat) * dlon, 0.04
  // degree 5 km east of an origin at 41.5 N. A heading at `point` plus this
  // angle is the heading in the plane.
  double NorthAzimuthRad(const GeodeticPoint& point) const;

  const GeodeticPoint& origin() const { return origin_; }

 private:
  GeodeticPoint origin_;
  double sin_lat_;  // Of the origin.
  double cos_lat_;
  double axis_m_;    // Distance of the origin from the Earth's axis.
  double height_m_;  // And from the plane of the equator, positive north.
  double normal_m_;  // N: radius of curvature in the prime vertical there.
  double stretch_;   // e^2 / (1 - e^2 sin^2), of the origin's latitude.
};

// Nervegna 2002, eq. 4.3, as printed: x = (lat - lat_ref) R,
// y = (lon - lon_ref) R cos(lat_ref), R the equatorial radius. For comparison
// only; the map does not use it.
NedPoint SphericalNorthEast(const GeodeticPoint& reference,
                            const GeodeticPoint& point);

}  // namespace fathom::map

#endif  // FATHOM_MAP_GEODESY_NED_FRAME_H_
