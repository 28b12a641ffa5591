#include "map/contacts/contact_map.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_format.h"
#include "map/contacts/contact_set.h"

namespace fathom::map {
namespace {

// A report without its key, as it is kept.
RecentReport Remembered(const ContactReport& report, const TrackStep& step) {
  RecentReport recent{.report = report,
                      .gated = step.refused.has_value(),
                      .points = static_cast<std::uint8_t>(step.count)};
  recent.report.key = {};
  return recent;
}

ContactEstimate WithKey(const ContactPoint& point, const ContactKey& key) {
  ContactEstimate estimate;
  static_cast<ContactPoint&>(estimate) = point;
  estimate.key = key;
  return estimate;
}

// Points of the history that came of these.
std::size_t PointsOf(const RecentReports& recent) {
  std::size_t points = 0;
  for (std::size_t i = 0; i < recent.size(); ++i) points += recent[i].points;
  return points;
}

// Whether `recent` holds every report since the contact was first heard of.
bool HoldsAll(const Contact& held) {
  return PointsOf(held.recent()) == held.history().size() &&
         held.recent().size() < kRecentReports;
}

}  // namespace

ContactMap::ContactMap(ContactMapOptions options)
    : options_(std::make_shared<const ContactMapOptions>(options)),
      set_(std::make_shared<ContactSet>()) {
  set_->epoch = epoch_;
  set_->max_contacts = options_->max_contacts;
  set_->classes =
      std::shared_ptr<const ContactClassTable>(options_, &options_->classes);
}

ContactMap::ContactMap(ContactMap&&) noexcept = default;
ContactMap& ContactMap::operator=(ContactMap&&) noexcept = default;
ContactMap::~ContactMap() = default;

std::size_t ContactMap::live_count() const { return set_->live_count; }

ContactSet& ContactMap::Own() {
  if (set_->epoch != epoch_) {
    set_ = std::make_shared<ContactSet>(*set_);
    set_->epoch = epoch_;
  }
  return *set_;
}

void ContactMap::Change(const ContactKey& key, ContactChange kind,
                        absl::FunctionRef<void(Contact&)> change) {
  const Contact* held = set_->Get(key);
  if (held->dropped()) gone_.erase({held->newest().time, key});
  Own().Change(key, kind, change);
  held = set_->Get(key);
  if (held->dropped()) {
    gone_.insert({held->newest().time, key});
    ForgetLongestGone();
  }
}

TrackMemory ContactMap::MemoryOf(const Contact& held, std::size_t points,
                                 std::size_t reports) {
  TrackMemory memory;
  if (points > 0) memory.newest = &held.history()[points - 1];
  if (reports > 0 && held.recent()[reports - 1].gated) {
    memory.gated = &held.recent()[reports - 1].report;
  }
  return memory;
}

void ContactMap::ForgetLongestGone() {
  while (gone_.size() > options_->max_contacts) {
    set_->Erase(gone_.begin()->second);
    gone_.erase(gone_.begin());
  }
}

ContactOutcome ContactMap::Apply(const ContactReport& report) {
  const Contact* held = set_->Get(report.key);
  ContactOutcome refused;
  refused.reason = CheckContactReport(report);
  if (!refused.reason.has_value()) {
    if (held == nullptr) return ApplyFirst(report);
    if (report.time < held->LastTime()) return ApplyLate(*held, report);
    if (!held->dropped() || report.inactive ||
        set_->live_count < options_->max_contacts) {
      return ApplyNext(*held, report);
    }
    refused.reason = RejectReason::kContactsFull;
  }
  if (held != nullptr) refused.estimate = held->NewestEstimate();
  return refused;
}

ContactOutcome ContactMap::ApplyFirst(const ContactReport& report) {
  ContactOutcome outcome;
  if (report.inactive) {
    outcome.applied = true;
    return outcome;
  }
  if (set_->live_count >= options_->max_contacts) {
    outcome.reason = RejectReason::kContactsFull;
    return outcome;
  }
  const TrackStep step = Step({}, report, options_->filter, options_->classes);
  outcome.reason = step.refused;
  if (step.refused.has_value()) return outcome;
  auto contact = std::make_shared<Contact>(report.key);
  contact->history().Append(step.points[0]);
  contact->recent().Append(Remembered(report, step));
  outcome.applied = true;
  outcome.estimate = contact->NewestEstimate();
  outcome.estimates = {*outcome.estimate};
  Own().Add(std::move(contact));
  return outcome;
}

ContactOutcome ContactMap::ApplyNext(const Contact& held,
                                     const ContactReport& report) {
  const TrackStep step =
      Step(MemoryOf(held, held.history().size(), held.recent().size()), report,
           options_->filter, options_->classes);
  ContactOutcome outcome{.applied = !step.refused.has_value(),
                         .reason = step.refused,
                         .estimate = {},
                         .estimates = {},
                         .revised = false,
                         .nis = step.nis};
  if (outcome.applied || *outcome.reason == RejectReason::kGated) {
    const auto kind = step.count == 0   ? ContactChange::kReports
                      : step.count == 1 ? ContactChange::kAppend
                                        : ContactChange::kRevise;
    Change(report.key, kind, [&](Contact& contact) {
      for (std::size_t i = 0; i < step.count; ++i) {
        contact.history().Append(step.points[i]);
        outcome.estimates.push_back(WithKey(step.points[i], report.key));
      }
      contact.recent().Append(Remembered(report, step));
    });
  }
  if (const Contact* now = set_->Get(report.key)) {
    outcome.estimate = now->NewestEstimate();
  }
  return outcome;
}

ContactOutcome ContactMap::ApplyLate(const Contact& held,
                                     const ContactReport& report) {
  ContactOutcome outcome;
  outcome.estimate = held.NewestEstimate();
  const RecentReports& recent = held.recent();
  // Where it belongs: behind those of its own time.
  std::size_t kept = recent.size();
  std::size_t points = held.history().size();
  while (kept > 0 && recent[kept - 1].report.time > report.time) {
    points -= recent[--kept].points;
  }
  if (held.LastTime() - report.time > kLateWindow ||
      (kept == 0 && !HoldsAll(held))) {
    outcome.reason = RejectReason::kTooLate;
    return outcome;
  }
  std::vector<ContactPoint> made;
  std::vector<RecentReport> taken;
  TrackMemory memory = MemoryOf(held, points, kept);
  ContactPoint newest;
  for (std::size_t i = kept; i <= recent.size(); ++i) {
    const ContactReport& next = i == kept ? report : recent[i - 1].report;
    const TrackStep step =
        Step(memory, next, options_->filter, options_->classes);
    const bool gated = step.refused == RejectReason::kGated;
    if (i == kept) {
      outcome.reason = step.refused;
      if (step.refused.has_value() && !gated) return outcome;
    } else if (step.refused.has_value() && !gated) {
      continue;  // In its turn it would not have been taken.
    }
    for (std::size_t j = 0; j < step.count; ++j) made.push_back(step.points[j]);
    taken.push_back(Remembered(next, step));
    if (!made.empty()) {
      newest = made.back();
      memory.newest = &newest;
    }
    memory.gated = gated ? &next : nullptr;
  }
  outcome.applied = !outcome.reason.has_value();
  bool same = points + made.size() == held.history().size();
  for (std::size_t i = 0; same && i < made.size(); ++i) {
    same = made[i] == held.history()[points + i];
  }
  if (!same) {
    outcome.revised = true;
    // From the one before on: no matter what stood at one time with it.
    if (points > 0) {
      outcome.estimates.push_back(
          WithKey(held.history()[points - 1], report.key));
    }
    for (const ContactPoint& point : made) {
      outcome.estimates.push_back(WithKey(point, report.key));
    }
  }
  Change(report.key, ContactChange::kRevise, [&](Contact& contact) {
    contact.history().Truncate(points);
    for (const ContactPoint& point : made) contact.history().Append(point);
    contact.recent().Truncate(kept);
    for (RecentReport& one : taken) contact.recent().Append(std::move(one));
  });
  if (const Contact* now = set_->Get(report.key)) {
    outcome.estimate = now->NewestEstimate();
  }
  return outcome;
}

ContactOutcome ContactMap::Drop(const ContactKey& key, Time time) {
  const Contact* held = set_->Get(key);
  ContactOutcome outcome;
  if (held == nullptr) return outcome;
  if (held->dropped()) {
    outcome.estimate = held->NewestEstimate();
    return outcome;
  }
  const ContactPoint point = DropPoint(
      held->newest(), std::max(time, held->LastTime()), options_->classes);
  outcome.applied = true;
  outcome.estimate = WithKey(point, key);
  outcome.estimates = {*outcome.estimate};
  Change(key, ContactChange::kAppend, [&point](Contact& contact) {
    contact.history().Append(point);
    contact.recent() = {};
  });
  return outcome;
}

ContactsView ContactMap::View() {
  ++epoch_;
  return ContactsView(set_);
}

absl::Status ContactMap::Restore(StoredContact stored) {
  const auto invalid = [&stored](const char* what) {
    return absl::InvalidArgumentError(
        absl::StrFormat("stored contact %s/%s: %s", stored.key.source.value,
                        stored.key.contact.value, what));
  };
  if (stored.estimates.empty()) return invalid("has no estimates");
  auto contact = std::make_shared<Contact>(stored.key);
  for (std::size_t i = 0; i < stored.estimates.size(); ++i) {
    const ContactEstimate& estimate = stored.estimates[i];
    if (estimate.key != stored.key) return invalid("an estimate of another");
    // Finite numbers may still lie beyond the Earth, where places are NaN.
    if (!IsContactClass(estimate.contact_class) || !IsFinite(estimate) ||
        !ValidateGeodetic(estimate.Position()).ok()) {
      return invalid("an estimate is not finite, nowhere, or has no class");
    }
    if (i > 0 && estimate.time < stored.estimates[i - 1].time) {
      return invalid("estimates are not in order of time");
    }
    contact->history().Append(estimate);
  }
  for (std::size_t i = 0; i < stored.recent.size(); ++i) {
    const RecentReport& recent = stored.recent[i];
    if (CheckContactReport(recent.report).has_value() || recent.points > 2 ||
        (recent.gated && recent.points > 0) ||
        (i > 0 && recent.report.time < stored.recent[i - 1].report.time)) {
      return invalid("a recent report is malformed or out of order");
    }
    contact->recent().Append(recent);
  }
  if (PointsOf(contact->recent()) > contact->history().size()) {
    return invalid("more came of its recent reports than it holds");
  }
  if (set_->Get(stored.key) != nullptr) {
    return absl::AlreadyExistsError(absl::StrFormat("contact %s/%s is held",
                                                    stored.key.source.value,
                                                    stored.key.contact.value));
  }
  if (!contact->dropped() && set_->live_count >= options_->max_contacts) {
    return absl::ResourceExhaustedError(absl::StrFormat(
        "max_contacts=%u are held; raise it", options_->max_contacts));
  }
  Own();
  if (contact->dropped()) gone_.insert({contact->newest().time, stored.key});
  set_->Add(std::move(contact));
  ForgetLongestGone();
  return absl::OkStatus();
}

}  // namespace fathom::map
