#include "map/contacts/contact.h"

#include <algorithm>
#include <array>

namespace fathom::map {

void Contact::Append(const ContactPoint& point,
                     const ContactClassTable& classes) {
  older_.Next(history_, point, classes);
  history_.Append(point);
}

void Contact::Truncate(std::size_t size) {
  older_.Truncate(size);
  history_.Truncate(size);
}

void Contact::Restore(const StoredContact& stored,
                      const ContactClassTable& classes) {
  for (const ContactPoint& point : stored.older) older_.Append(point);
  for (const ContactPoint& point : stored.estimates) Append(point, classes);
  for (const RecentReport& recent : stored.recent) recent_.Append(recent);
}

Time Contact::LastTime() const {
  const Time last = newest().time;
  return recent_.empty() ? last : std::max(last, recent_.newest().report.time);
}

std::size_t Contact::After(std::size_t index,
                           const ContactClassTable& classes) const {
  const ContactPoint& from = (*this)[index];
  std::size_t after = index + 1;
  // What a fix overwrote is in no later estimate.
  while (!IsFixAlone((*this)[after]) && after + 1 < size()) {
    const ContactPoint& next = (*this)[after + 1];
    if (!GoesOn(from, next) || IsFixAlone(next) ||
        !MaySkip(from, next, classes)) {
      break;
    }
    ++after;
  }
  return after;
}

ContactPoint Contact::Smoothed(std::size_t index,
                               const ContactClassTable& classes) const {
  // A fix is the truth: another after it says nothing more of it.
  const auto goes_on = [this](std::size_t i) {
    return i + 1 < size() && GoesOn((*this)[i], (*this)[i + 1]) &&
           !(IsFixAlone((*this)[i]) && IsFixAlone((*this)[i + 1]));
  };
  std::array<std::size_t, kSmoothedAhead + 1> steps;
  std::size_t count = 0;
  steps[0] = index;
  while (count < kSmoothedAhead && goes_on(steps[count])) {
    steps[count + 1] = steps[count] + 1;
    ++count;
  }
  if (count == kSmoothedAhead) {
    count = 0;
    while (count < kSmoothedAhead && goes_on(steps[count])) {
      steps[count + 1] = After(steps[count], classes);
      ++count;
    }
  }
  ContactPoint smoothed = (*this)[steps[count]];
  while (count > 0) {
    const bool apart = IsFixAlone((*this)[steps[count]]);
    smoothed = SmoothedBy((*this)[steps[--count]], smoothed, apart, classes);
  }
  return smoothed;
}

std::optional<ContactPoint> Contact::At(
    Time t, const ContactClassTable& classes) const {
  if (history_.empty()) return std::nullopt;
  std::size_t index = 0;
  if (const auto newer = history_.NewestAtOrBefore(t)) {
    index = older_.size() + *newer;
  } else if (const auto older = older_.NewestAtOrBefore(t)) {
    index = *older;
  } else {
    const ContactPoint& oldest = (*this)[0];
    // What came before the oldest kept estimate is forgotten here; that there
    // was a contact is not.
    if (t < oldest.track_start) return std::nullopt;
    ContactPoint point = PredictPoint(oldest, t, classes);
    point.status = ContactStatus::kActive;
    point.report_time = t;
    return point;
  }
  const ContactPoint& base = (*this)[index];
  if (base.status == ContactStatus::kDropped) return std::nullopt;
  ContactPoint point = PredictPoint(base, t, classes);
  if (index + 1 < size() && GoesOn(base, (*this)[index + 1])) {
    return SmoothedBy(point, Smoothed(index + 1, classes),
                      IsFixAlone((*this)[index + 1]), classes);
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
  StoredContact stored{.key = key_, .estimates = {}, .recent = {}};
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
  stored.older.reserve(older_.size());
  for (std::size_t i = 0; i < older_.size(); ++i) {
    stored.older.push_back(older_[i]);
  }
  return stored;
}

}  // namespace fathom::map
