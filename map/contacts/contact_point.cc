#include "map/contacts/contact_point.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "map/contacts/filter.h"
#include "map/geodesy/ned_frame.h"

namespace fathom::map {
namespace {

// Beyond this the plane's place of a point is read as azimuth and distance
// along the Earth: for a contact predicted that far the difference is nothing
// beside its uncertainty, and it is defined at any distance.
constexpr double kPlaneReachM = 500'000;

}  // namespace

GeodeticPoint ContactPoint::Position() const {
  const double distance_m = std::hypot(x(0), x(1));
  if (distance_m == 0.0) return frame_origin;
  if (distance_m <= kPlaneReachM) {
    return NedFrame(frame_origin).ToGeodetic(x(0), x(1));
  }
  const double azimuth_deg = std::atan2(x(1), x(0)) * 180.0 / std::numbers::pi;
  // Half round the Earth is as far as there is.
  return Direct(frame_origin, azimuth_deg, std::min(distance_m, 2e7));
}

ContactPoint InPlaneAt(const ContactPoint& point, const GeodeticPoint& origin) {
  if (point.frame_origin == origin) return point;
  const NedFrame from(point.frame_origin);
  const NedFrame to(origin);
  const GeodeticPoint place = point.Position();
  const NedPoint there = to.ToNed(place);
  // A direction is turned by the difference of what north is in both planes.
  const double turn_rad =
      to.NorthAzimuthRad(place) - from.NorthAzimuthRad(place);
  const double c = std::cos(turn_rad);
  const double s = std::sin(turn_rad);
  Eigen::Matrix2d turn;
  turn << c, -s, s, c;
  Eigen::Matrix4d both = Eigen::Matrix4d::Zero();
  both.topLeftCorner<2, 2>() = turn;
  both.bottomRightCorner<2, 2>() = turn;
  ContactPoint moved = point;
  moved.frame_origin = origin;
  moved.x.head<2>() = Eigen::Vector2d(there.north_m, there.east_m);
  moved.x.tail<2>() = turn * Eigen::Vector2d(point.x.tail<2>());
  const Eigen::Matrix4d turned = both * point.P * both.transpose();
  moved.P = 0.5 * (turned + turned.transpose());
  return moved;
}

ContactPoint PredictPoint(const ContactPoint& point, Time t,
                          const ContactClassTable& classes) {
  ContactPoint predicted = point;
  predicted.time = t;
  if (t == point.time) return predicted;
  const double q = classes[static_cast<std::size_t>(point.contact_class)]
                       .process_noise_m2_s3;
  const TrackState state =
      Predict({.x = point.x, .P = point.P}, ToSeconds(t - point.time), q);
  predicted.x = state.x;
  predicted.P = state.P;
  return predicted;
}

bool GoesOn(const ContactPoint& point, const ContactPoint& next) {
  return point.status != ContactStatus::kDropped &&
         next.status != ContactStatus::kDropped &&
         next.track_start == point.track_start;
}

bool IsFixAlone(const ContactPoint& point) {
  return point.x(0) == 0.0 && point.x(1) == 0.0;
}

ContactPoint SmoothedBy(const ContactPoint& point, const ContactPoint& next,
                        bool apart, const ContactClassTable& classes) {
  const ContactPoint moved = PredictPoint(point, next.time, classes);
  const ContactPoint there = InPlaneAt(next, point.frame_origin);
  const TrackState predicted{.x = moved.x, .P = moved.P};
  TrackState believed{.x = there.x, .P = there.P};
  if (apart) believed = Fuse(predicted, believed);
  const TrackState state =
      SmoothBack({.x = point.x, .P = point.P},
                 ToSeconds(next.time - point.time), predicted, believed);
  ContactPoint smoothed = point;
  smoothed.x = state.x;
  smoothed.P = state.P;
  return smoothed;
}

}  // namespace fathom::map
