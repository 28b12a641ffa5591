#include "map/contacts/contact_map.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <functional>
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
  recent.report.same_as.reset();
  return recent;
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

// Finite numbers may still lie beyond the Earth, where places are NaN.
bool IsEstimate(const ContactPoint& point) {
  return IsContactClass(point.contact_class) && IsFinite(point) &&
         ValidateGeodetic(point.Position()).ok();
}

// Whether the covariance is one, but for rounding; of a sensor that says it is
// exact it may be 0.
bool IsCovariance(const Eigen::Matrix4d& P) {
  constexpr double kLeastVariance = 1e-12;
  Eigen::Matrix4d raised = P;
  raised.diagonal() *= 1 + 1e-6;
  raised.diagonal().array() += kLeastVariance;
  return P == P.transpose() && raised.llt().info() == Eigen::Success;
}

bool AreOlderEstimates(const std::vector<ContactPoint>& older,
                       const ContactPoint& oldest_newer) {
  if (older.size() > kOlderEstimates) return false;
  for (std::size_t i = 0; i < older.size(); ++i) {
    const ContactPoint& next =
        i + 1 < older.size() ? older[i + 1] : oldest_newer;
    if (!IsEstimate(older[i]) || !IsCovariance(older[i].P) ||
        older[i].time > next.time || older[i].track_start > older[i].time) {
      return false;
    }
  }
  return true;
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
  const ContactSet::Place place = set_->Find(key);
  const Contact& before =
      *set_->blocks[place.block]->contacts[place.slot].contact;
  if (before.dropped()) gone_.erase({before.newest().time, key});
  const Contact& held = Own().Change(place, kind, change);
  if (held.dropped()) {
    gone_.insert({held.newest().time, key});
    SetLinks(key, {}, {});
    ForgetLongestGone();
  } else {
    none_stale_until_ = std::min(none_stale_until_, StaleFrom(held.newest()));
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
  if (const auto reason = CheckContactReport(report)) {
    ContactOutcome refused;
    refused.reason = reason;
    if (const Contact* held = set_->Get(report.key)) {
      refused.estimate = held->NewestEstimate();
    }
    return refused;
  }
  if (report.same_as.has_value()) return ApplyLinking(report);
  if (!names_.empty()) {
    const auto name = names_.find(report.key);
    if (name != names_.end()) return ApplyLinked(name->second, report);
  }
  return ApplyOwn(report, 0);
}

ContactOutcome ContactMap::ApplyOwn(const ContactReport& report,
                                    std::size_t room) {
  const Contact* held = set_->Get(report.key);
  if (held == nullptr) return ApplyFirst(report, room);
  ContactOutcome outcome;
  if (held->links() != nullptr && report.time < held->links()->since) {
    outcome.reason = RejectReason::kTooLate;
  } else if (report.time < held->LastTime()) {
    return ApplyLate(*held, report);
  } else if (!held->dropped() || report.inactive) {
    return ApplyNext(*held, report);
  } else if (MakeRoom(report.time, room, outcome.ended)) {
    // The contact may have been forgotten for it.
    held = set_->Get(report.key);
    ContactOutcome back =
        held == nullptr ? ApplyFirst(report, room) : ApplyNext(*held, report);
    back.ended = std::move(outcome.ended);
    return back;
  } else {
    outcome.reason = RejectReason::kContactsFull;
  }
  outcome.estimate = held->NewestEstimate();
  return outcome;
}

ContactOutcome ContactMap::ApplyFirst(const ContactReport& report,
                                      std::size_t room) {
  ContactOutcome outcome;
  if (report.inactive) {
    outcome.applied = true;
    return outcome;
  }
  const TrackStep step = Step({}, report, options_->filter, options_->classes);
  outcome.reason = step.refused;
  if (!step.refused.has_value() &&
      !MakeRoom(report.time, room, outcome.ended)) {
    outcome.reason = RejectReason::kContactsFull;
  }
  if (outcome.reason.has_value()) return outcome;
  auto contact = std::make_shared<Contact>(report.key);
  contact->Append(step.points[0], options_->classes);
  contact->recent().Append(Remembered(report, step));
  outcome.applied = true;
  outcome.estimate = contact->NewestEstimate();
  outcome.estimates = {*outcome.estimate};
  none_stale_until_ = std::min(none_stale_until_, StaleFrom(contact->newest()));
  Own().Add(std::move(contact));
  return outcome;
}

Time ContactMap::StaleFrom(const ContactPoint& newest) const {
  const double stale_after_s =
      options_->classes[static_cast<std::size_t>(newest.contact_class)]
          .stale_after_s;
  // A century is never; stamps of any size come from a file.
  const Duration span(
      static_cast<std::int64_t>(std::min(stale_after_s, 3.2e9) * 1e6));
  return newest.report_time > Time::max() - span ? Time::max()
                                                 : newest.report_time + span;
}

bool ContactMap::MakeRoom(Time time, std::size_t room,
                          std::vector<ContactEstimate>& ended) {
  if (set_->live_count < options_->max_contacts + room) return true;
  if (time <= none_stale_until_) return false;
  const Contact* longest = nullptr;
  Time first = Time::max();
  Time second = Time::max();
  for (const auto& block : set_->blocks) {
    for (const HeldContact& held : block->contacts) {
      if (held.contact->dropped()) continue;
      const Time until = StaleFrom(held.contact->newest());
      if (until < first) {
        second = std::exchange(first, until);
        longest = held.contact.get();
      } else {
        second = std::min(second, until);
      }
    }
  }
  none_stale_until_ = first;
  if (longest == nullptr || time <= first) return false;
  none_stale_until_ = second;
  const ContactOutcome end = Drop(longest->key(), time);
  ended.insert(ended.end(), end.estimates.begin(), end.estimates.end());
  return true;
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
                         .joint = held.links() != nullptr,
                         .ended = {},
                         .nis = step.nis};
  if (outcome.applied || *outcome.reason == RejectReason::kGated) {
    const auto kind = step.count == 0   ? ContactChange::kReports
                      : step.count == 1 ? ContactChange::kAppend
                                        : ContactChange::kRevise;
    Change(report.key, kind, [&](Contact& contact) {
      for (std::size_t i = 0; i < step.count; ++i) {
        contact.Append(step.points[i], options_->classes);
        outcome.estimates.push_back(contact.Named(step.points[i]));
      }
      contact.recent().Append(Remembered(report, step));
      outcome.estimate = contact.NewestEstimate();
    });
  } else {
    outcome.estimate = held.NewestEstimate();
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
    outcome.joint = held.links() != nullptr;
    // From the one before on: no matter what stood at one time with it.
    if (points > 0) {
      outcome.estimates.push_back(held.Named(held.history()[points - 1]));
    }
    for (const ContactPoint& point : made) {
      outcome.estimates.push_back(held.Named(point));
    }
  }
  Change(report.key, ContactChange::kRevise, [&](Contact& contact) {
    contact.Truncate(points);
    for (const ContactPoint& point : made) {
      contact.Append(point, options_->classes);
    }
    contact.recent().Truncate(kept);
    for (RecentReport& one : taken) contact.recent().Append(std::move(one));
  });
  if (const Contact* now = set_->Get(report.key)) {
    outcome.estimate = now->NewestEstimate();
  }
  return outcome;
}

ContactOutcome ContactMap::Drop(const ContactKey& named, Time time) {
  const auto name = names_.find(named);
  const ContactKey key = name == names_.end() ? named : name->second;
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
  outcome.estimate = held->Named(point);
  outcome.estimates = {*outcome.estimate};
  outcome.joint = held->links() != nullptr;
  Change(key, ContactChange::kAppend, [&](Contact& contact) {
    contact.Append(point, options_->classes);
    contact.recent() = {};
  });
  return outcome;
}

ContactsView ContactMap::View() {
  if (set_->epoch == epoch_) set_->Settle();
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
    if (!IsEstimate(estimate)) {
      return invalid("an estimate is not finite, nowhere, or has no class");
    }
    if (i > 0 && estimate.time < stored.estimates[i - 1].time) {
      return invalid("estimates are not in order of time");
    }
  }
  for (std::size_t i = 0; i < stored.recent.size(); ++i) {
    const RecentReport& recent = stored.recent[i];
    if (CheckContactReport(recent.report).has_value() || recent.points > 2 ||
        (recent.gated && recent.points > 0) ||
        (i > 0 && recent.report.time < stored.recent[i - 1].report.time)) {
      return invalid("a recent report is malformed or out of order");
    }
  }
  if (!AreOlderEstimates(stored.older, stored.estimates.front())) {
    return invalid("its older estimates are not in order, or are none");
  }
  contact->Restore(stored, options_->classes);
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
  if (stored.links.has_value()) {
    const std::vector<ContactKey>& names = stored.links->names;
    const auto taken = [&](const ContactKey& name) {
      return name == stored.key || names_.count(name) != 0;
    };
    if (contact->dropped() || names.empty() || names.size() > kMaxLinkedNames ||
        std::adjacent_find(names.begin(), names.end(), std::greater_equal()) !=
            names.end() ||
        std::any_of(names.begin(), names.end(), taken)) {
      return invalid("its other names are none or another's");
    }
    for (const ContactKey& name : names) names_.emplace(name, stored.key);
    contact->set_links(
        std::make_shared<const ContactLinks>(*std::move(stored.links)));
  }
  Own();
  if (contact->dropped()) gone_.insert({contact->newest().time, stored.key});
  set_->Add(std::move(contact));
  ForgetLongestGone();
  return absl::OkStatus();
}

}  // namespace fathom::map
