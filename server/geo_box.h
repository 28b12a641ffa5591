// GeoBox: a piece of the Earth between two parallels and two meridians, and
// "do these two touch?": how changes of the map find those who watch.
//
// Plain values and pure functions; thread-safe.

#ifndef FATHOM_SERVER_GEO_BOX_H_
#define FATHOM_SERVER_GEO_BOX_H_

#include <span>

#include "map/geodesy/points.h"

namespace fathom::server {

// Degrees. From `west_deg` (any turn) `width_deg` to the east, so that a box
// may cross the antimeridian; width_deg in [0, 360].
struct GeoBox {
  double south_deg = -90;
  double north_deg = 90;
  double west_deg = -180;
  double width_deg = 360;
};

// A box that holds the polygon with these corners and all within `margin_m` of
// it. Sides are geodesics, or straight in a NedFrame: both bow from the chord
// by L^2 / (8 R) tan(latitude) at most, which is added. Of corners more than
// 1000 km apart: the whole Earth. REQUIRES: at least one corner.
GeoBox BoxAround(std::span<const map::GeodeticPoint> corners, double margin_m);

// Degrees from `from_deg` eastward to `to_deg`, in [0, 360).
double EastwardDeg(double from_deg, double to_deg);

// Whether they share a place.
bool Touch(const GeoBox& a, const GeoBox& b);

}  // namespace fathom::server

#endif  // FATHOM_SERVER_GEO_BOX_H_
