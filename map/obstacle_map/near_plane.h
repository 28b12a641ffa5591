// A plane at a place on which great circles are straight and circles about the
// place are circles (the gnomonic projection, on a sphere of the Earth's mean
// radius): what is nearest on it is nearest.
//
// Immutable; thread-safe. Good within some 600 km; the sphere puts a distance
// of 50 km wrong by 1 cm at most, so who needs it exactly asks Inverse() anew.

#ifndef FATHOM_MAP_OBSTACLE_MAP_NEAR_PLANE_H_
#define FATHOM_MAP_OBSTACLE_MAP_NEAR_PLANE_H_

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "map/geodesy/ned_frame.h"
#include "map/geodesy/points.h"

namespace fathom::map {

// See file comment.
class NearPlane {
 public:
  explicit NearPlane(const GeodeticPoint& from)
      // Within 0.2 m of a pole, where the plane has no north, 0.2 m beside it:
      // distances are worked out anew in the end.
      : frame_({.latitude_deg =
                    std::clamp(from.latitude_deg, -89.999998, 89.999998),
                .longitude_deg = from.longitude_deg}) {}

  // A point of the plane, metres, and how far it is on the Earth.
  struct Nearest {
    double distance_m = 0;
    double north_m = 0;
    double east_m = 0;
  };

  // The nearest point of a convex quadrilateral; distance 0 inside.
  Nearest Of(const std::array<GeodeticPoint, 4>& corners) const {
    std::array<NedPoint, 4> plane;
    for (std::size_t k = 0; k < 4; ++k) plane[k] = ToPlane(corners[k]);
    bool left = true;
    bool right = true;
    Nearest nearest{.distance_m = std::numeric_limits<double>::infinity()};
    for (std::size_t k = 0; k < 4; ++k) {
      const NedPoint& a = plane[k];
      const NedPoint& b = plane[(k + 1) % 4];
      const double dn = b.north_m - a.north_m;
      const double de = b.east_m - a.east_m;
      const double turn = a.north_m * de - a.east_m * dn;
      left = left && turn >= 0;
      right = right && turn <= 0;
      const double length2 = dn * dn + de * de;
      double part = 0;
      if (length2 > 0) {
        part =
            std::clamp(-(a.north_m * dn + a.east_m * de) / length2, 0.0, 1.0);
      }
      const double north_m = a.north_m + part * dn;
      const double east_m = a.east_m + part * de;
      const double distance_m = std::hypot(north_m, east_m);
      if (distance_m < nearest.distance_m) {
        nearest = {
            .distance_m = distance_m, .north_m = north_m, .east_m = east_m};
      }
    }
    if (left || right) return {};
    nearest.distance_m =
        kEarthRadiusM * std::atan(nearest.distance_m / kEarthRadiusM);
    return nearest;
  }

  GeodeticPoint ToGeodetic(const Nearest& nearest) const {
    const double scale = 1.0 / std::sqrt(1.0 + Ratio2(nearest));
    return frame_.ToGeodetic(nearest.north_m * scale, nearest.east_m * scale);
  }

 private:
  // Mean radius (IUGG).
  static constexpr double kEarthRadiusM = 6'371'000;

  static double Ratio2(const Nearest& at) {
    return (at.north_m * at.north_m + at.east_m * at.east_m) /
           (kEarthRadiusM * kEarthRadiusM);
  }
  NedPoint ToPlane(const GeodeticPoint& point) const {
    NedPoint ned = frame_.ToNed(point);
    const double ratio2 =
        (ned.north_m * ned.north_m + ned.east_m * ned.east_m) /
        (kEarthRadiusM * kEarthRadiusM);
    const double scale = 1.0 / std::sqrt(1.0 - std::min(ratio2, 0.9));
    ned.north_m *= scale;
    ned.east_m *= scale;
    return ned;
  }

  NedFrame frame_;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_OBSTACLE_MAP_NEAR_PLANE_H_
