// Points on and near the Earth, and distances along it.
//
// Geodetic points are WGS84 latitude and longitude in degrees: the only place
// inside the map where degrees occur. Horizontal metres inside are
// north-east-down (NED) at a stated origin, z positive down. A value of these
// types is plain and may be shared freely; the functions are pure and
// thread-safe.
//
// Distances are geodesics on the ellipsoid (Karney 2013, "Algorithms for
// geodesics", doi:10.1007/s00190-012-0578-z), accurate to 15 nanometres.

#ifndef FATHOM_MAP_GEODESY_POINTS_H_
#define FATHOM_MAP_GEODESY_POINTS_H_

#include "absl/status/status.h"

namespace fathom::map {

// A point on the WGS84 ellipsoid. Latitude in [-90, 90], positive north.
// Longitude in [-180, 180], positive east; functions here accept [-360, 360]
// and return [-180, 180].
struct GeodeticPoint {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;

  friend bool operator==(const GeodeticPoint&, const GeodeticPoint&) = default;
};

// A point in metres from the origin of a north-east-down frame: the thesis's
// (x, y, z). The frame's origin is stated by whoever hands the point out.
struct NedPoint {
  double north_m = 0.0;
  double east_m = 0.0;
  double down_m = 0.0;

  friend bool operator==(const NedPoint&, const NedPoint&) = default;
};

// Whether the point may enter the map.
// Errors: INVALID_ARGUMENT naming the coordinate and its value when it is not
// finite, the latitude is outside [-90, 90] or the longitude outside
// [-180, 180].
absl::Status ValidateGeodetic(const GeodeticPoint& point);

// How far and in which direction.
struct RangeAzimuth {
  double distance_m = 0.0;   // >= 0.
  double azimuth_deg = 0.0;  // At the first point, clockwise from north,
                             // in [-180, 180].
};

// The shortest way over the ellipsoid from `from` to `to`. About 1 us.
RangeAzimuth Inverse(const GeodeticPoint& from, const GeodeticPoint& to);

// The length of that way, >= 0. About 1 us.
double DistanceM(const GeodeticPoint& a, const GeodeticPoint& b);

// The point `distance_m` from `from` when one sets out on `azimuth_deg`
// (clockwise from north) and goes straight on. About 0.5 us.
GeodeticPoint Direct(const GeodeticPoint& from, double azimuth_deg,
                     double distance_m);

// Adds or takes off whole turns so that the result is in [-180, 180].
double NormalizeLongitudeDeg(double longitude_deg);

}  // namespace fathom::map

#endif  // FATHOM_MAP_GEODESY_POINTS_H_
