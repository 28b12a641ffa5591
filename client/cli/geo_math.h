// Small geometry on WGS 84 for the command line: offsets of a few kilometres,
// metres per degree, and the outline of the mission's root square. The server
// decides everything that matters with exact geodesy; this is for choosing
// areas, grids and picture scales. Thread-safe.

#ifndef FATHOM_CLIENT_CLI_GEO_MATH_H_
#define FATHOM_CLIENT_CLI_GEO_MATH_H_

#include "client/cli/arguments.h"
#include "fathom/v1/types.pb.h"

namespace fathom::client::cli {

// Length of one degree of latitude and of longitude at a latitude, metres, on
// the ellipsoid (meridian and prime-vertical radii of curvature).
struct MetersPerDegree {
  double latitude = 0;
  double longitude = 0;
};
MetersPerDegree MetersPerDegreeAt(double latitude_deg);

// The place `north_m` and `east_m` away; good to 1 m within 20 km below 70
// degrees of latitude.
v1::GeodeticPoint Offset(const v1::GeodeticPoint& from, double north_m,
                         double east_m);

// `longitude_deg` plus or minus whole turns, in [-180, 180).
double WrapLongitude(double longitude_deg);

// The box around the mission's root square with these western corners
// (Nervegna 2002, fig. 4-13), widened by 1 % of its side. A square that
// holds a pole gives all longitudes.
GeoBox MissionBox(const v1::GeodeticPoint& south_west,
                  const v1::GeodeticPoint& north_west);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_GEO_MATH_H_
