#include "map/contacts/contact.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "map/geodesy/ned_frame.h"

namespace fathom::map {
namespace {

// Beyond this the plane's place of a point is read as azimuth and distance
// along the Earth: for a contact predicted that far the difference is nothing
// beside its uncertainty, and it is defined at any distance.
constexpr double kPlaneReachM = 500'000;

ContactEstimate WithKey(const ContactPoint& point, const ContactKey& key) {
  ContactEstimate estimate;
  static_cast<ContactPoint&>(estimate) = point;
  estimate.key = key;
  return estimate;
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

void TrackHistory::Append(const ContactPoint& point) {
  if (size() == kRecentEstimates) ++begin_;
  if (begin_ == kChunk) {
    chunks_.erase(chunks_.begin());
    begin_ -= kChunk;
    end_ -= kChunk;
  }
  if (end_ == chunks_.size() * kChunk) {
    chunks_.push_back(std::make_shared<Chunk>());
  }
  chunks_[end_ / kChunk]->points[end_ % kChunk] = point;
  ++end_;
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
  return WithKey(*point, key_);
}

ContactEstimate Contact::NewestEstimate() const {
  return WithKey(newest(), key_);
}

StoredContact Contact::ToStored() const {
  StoredContact stored{.key = key_, .estimates = {}};
  stored.estimates.reserve(history_.size());
  for (std::size_t i = 0; i < history_.size(); ++i) {
    stored.estimates.push_back(WithKey(history_[i], key_));
  }
  return stored;
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
