#include "map/contacts/contact.h"

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

// Whether `next`, the estimate after `point`, is of the same life and plain to
// smooth from: not a marker of a drop.
bool GoesOn(const ContactPoint& point, const ContactPoint& next) {
  return point.status != ContactStatus::kDropped &&
         next.status != ContactStatus::kDropped &&
         next.track_start == point.track_start;
}

// `point` after what `next`, an estimate later or at the same time, tells.
ContactPoint SmoothedBy(const ContactPoint& point, const ContactPoint& next,
                        const ContactClassTable& classes) {
  const ContactPoint predicted = PredictPoint(point, next.time, classes);
  const ContactPoint there = InPlaneAt(next, point.frame_origin);
  const TrackState state = SmoothBack(
      {.x = point.x, .P = point.P}, ToSeconds(next.time - point.time),
      {.x = predicted.x, .P = predicted.P}, {.x = there.x, .P = there.P});
  ContactPoint smoothed = point;
  smoothed.x = state.x;
  smoothed.P = state.P;
  return smoothed;
}

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

std::optional<std::size_t> TrackHistory::NewestAtOrBefore(Time t) const {
  // The usual question is about now or later.
  if (empty()) return std::nullopt;
  if (newest().time <= t) return size() - 1;
  std::size_t low = 0;  // Points below are at or before t.
  std::size_t high = size() - 1;
  while (low < high) {
    const std::size_t middle = low + (high - low) / 2;
    if ((*this)[middle].time <= t) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  if (low == 0) return std::nullopt;
  return low - 1;
}

Time Contact::LastTime() const {
  const Time last = newest().time;
  return recent_.empty() ? last : std::max(last, recent_.newest().report.time);
}

ContactPoint Contact::Smoothed(std::size_t index,
                               const ContactClassTable& classes) const {
  std::size_t last = index;
  while (last + 1 < history_.size() && last - index < kSmoothedAhead &&
         GoesOn(history_[last], history_[last + 1])) {
    ++last;
  }
  ContactPoint smoothed = history_[last];
  while (last > index) {
    --last;
    smoothed = SmoothedBy(history_[last], smoothed, classes);
  }
  return smoothed;
}

std::optional<ContactPoint> Contact::At(
    Time t, const ContactClassTable& classes) const {
  const std::optional<std::size_t> index = history_.NewestAtOrBefore(t);
  if (!index.has_value()) {
    if (history_.empty()) return std::nullopt;
    const ContactPoint& oldest = history_[0];
    // What came before the oldest kept estimate is forgotten here; that there
    // was a contact is not.
    if (t < oldest.track_start) return std::nullopt;
    ContactPoint point = PredictPoint(oldest, t, classes);
    point.status = ContactStatus::kActive;
    point.report_time = t;
    return point;
  }
  const ContactPoint& base = history_[*index];
  if (base.status == ContactStatus::kDropped) return std::nullopt;
  ContactPoint point = PredictPoint(base, t, classes);
  if (*index + 1 < history_.size() && GoesOn(base, history_[*index + 1])) {
    return SmoothedBy(point, Smoothed(*index + 1, classes), classes);
  }
  const double stale_after_s =
      classes[static_cast<std::size_t>(base.contact_class)].stale_after_s;
  if (ToSeconds(t - base.report_time) > stale_after_s) {
    point.status = ContactStatus::kStale;
  }
  return point;
}

std::optional<ContactEstimate> Contact::EstimateAt(
    Time t, const ContactClassTable& classes) const {
  const std::optional<ContactPoint> point = At(t, classes);
  if (!point.has_value()) return std::nullopt;
  return Named(*point);
}

ContactEstimate Contact::Named(const ContactPoint& point) const {
  ContactEstimate estimate;
  static_cast<ContactPoint&>(estimate) = point;
  estimate.key = key_;
  if (links_ != nullptr) estimate.linked = links_->names;
  return estimate;
}

StoredContact Contact::ToStored() const {
  StoredContact stored{.key = key_, .estimates = {}, .recent = {}, .links = {}};
  if (links_ != nullptr) stored.links = *links_;
  stored.estimates.reserve(history_.size());
  for (std::size_t i = 0; i < history_.size(); ++i) {
    ContactEstimate& estimate = stored.estimates.emplace_back();
    static_cast<ContactPoint&>(estimate) = history_[i];
    estimate.key = key_;
  }
  stored.recent.reserve(recent_.size());
  for (std::size_t i = 0; i < recent_.size(); ++i) {
    stored.recent.push_back(recent_[i]);
  }
  return stored;
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

}  // namespace fathom::map
