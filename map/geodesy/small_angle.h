// Sines, cosines and arcs of small angles by their series, at a third of the
// cost of the library's: nearly every point that is asked about lies within
// kSmallRad of the origin of its frame or the middle of its map.
//
// Inline, pure, thread-safe. REQUIRES everywhere: |argument| <= 1.5 kSmallRad,
// a NaN gives NaN.

#ifndef FATHOM_MAP_GEODESY_SMALL_ANGLE_H_
#define FATHOM_MAP_GEODESY_SMALL_ANGLE_H_

#include <numbers>

#include "map/geodesy/points.h"

namespace fathom::map {

inline constexpr double kSmallRad = 0.02;  // 127 km on the Earth.

struct SineCosine {
  double sine = 0;
  double cosine = 1;
};

// Left out is below 0.03^9 / 9! = 5e-20 of the sine's 0.03 and
// 0.03^10 / 10! = 2e-22.
inline SineCosine SineCosineOfSmall(double x) {
  const double x2 = x * x;
  return {
      .sine =
          x * (1.0 - x2 * (1.0 / 6.0) *
                         (1.0 - x2 * (1.0 / 20.0) * (1.0 - x2 * (1.0 / 42.0)))),
      .cosine = 1.0 - x2 * 0.5 *
                          (1.0 - x2 * (1.0 / 12.0) *
                                     (1.0 - x2 * (1.0 / 30.0) *
                                                (1.0 - x2 * (1.0 / 56.0))))};
}

// Left out is below 0.03^11 / 11 = 2e-18.
inline double ArcTangentOfSmall(double x) {
  const double x2 = x * x;
  return x *
         (1.0 - x2 * (1.0 / 3.0 -
                      x2 * (1.0 / 5.0 - x2 * (1.0 / 7.0 - x2 * (1.0 / 9.0)))));
}

// Longitude of `point` east of `origin`, in [-pi, pi]. Subtracting before
// turning to radians keeps all digits of small differences.
inline double EastOfRad(const GeodeticPoint& origin,
                        const GeodeticPoint& point) {
  double delta_deg = point.longitude_deg - origin.longitude_deg;
  if (delta_deg > 180.0 || delta_deg < -180.0) {
    delta_deg = NormalizeLongitudeDeg(delta_deg);
  }
  return delta_deg * (std::numbers::pi / 180.0);
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_GEODESY_SMALL_ANGLE_H_
