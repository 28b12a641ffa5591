#include "map/geodesy/points.h"

#include <GeographicLib/Geodesic.hpp>
#include <cmath>

#include "absl/strings/str_format.h"

namespace fathom::map {

absl::Status ValidateGeodetic(const GeodeticPoint& point) {
  // Written so that NaN fails the comparison and is refused.
  if (!(std::fabs(point.latitude_deg) <= 90.0)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "latitude_deg=%g must be in [-90, 90]", point.latitude_deg));
  }
  if (!(std::fabs(point.longitude_deg) <= 180.0)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "longitude_deg=%g must be in [-180, 180]", point.longitude_deg));
  }
  return absl::OkStatus();
}

RangeAzimuth Inverse(const GeodeticPoint& from, const GeodeticPoint& to) {
  RangeAzimuth result;
  double azimuth_at_end_deg = 0.0;
  GeographicLib::Geodesic::WGS84().Inverse(
      from.latitude_deg, from.longitude_deg, to.latitude_deg, to.longitude_deg,
      result.distance_m, result.azimuth_deg, azimuth_at_end_deg);
  return result;
}

double DistanceM(const GeodeticPoint& a, const GeodeticPoint& b) {
  double distance_m = 0.0;
  GeographicLib::Geodesic::WGS84().Inverse(a.latitude_deg, a.longitude_deg,
                                           b.latitude_deg, b.longitude_deg,
                                           distance_m);
  return distance_m;
}

GeodeticPoint Direct(const GeodeticPoint& from, double azimuth_deg,
                     double distance_m) {
  GeodeticPoint to;
  GeographicLib::Geodesic::WGS84().Direct(from.latitude_deg, from.longitude_deg,
                                          azimuth_deg, distance_m,
                                          to.latitude_deg, to.longitude_deg);
  return to;
}

double NormalizeLongitudeDeg(double longitude_deg) {
  return std::remainder(longitude_deg, 360.0);
}

}  // namespace fathom::map
