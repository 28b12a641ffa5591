// ContactMap's part about contacts that several sources report under names of
// their own and that C4I linked: one track, named by whoever linked them.
//
// names_ leads from each other name to the contact; the contact's links() say
// the same the other way about. Neither end of a link is itself linked on.

#include <algorithm>
#include <iterator>
#include <limits>
#include <utility>
#include <variant>

#include "map/contacts/contact_map.h"
#include "map/contacts/contact_set.h"

namespace fathom::map {

ContactOutcome ContactMap::ApplyLinked(ContactKey contact,
                                       const ContactReport& report) {
  if (report.inactive) {
    // This source has lost it; the track goes on with the others.
    ContactOutcome outcome;
    Unlink(report.key);
    outcome.applied = true;
    outcome.estimate = set_->Get(contact)->NewestEstimate();
    return outcome;
  }
  ContactReport theirs = report;
  // What C4I says of the class is the truth.
  theirs.contact_class = set_->Get(contact)->newest().contact_class;
  theirs.key = std::move(contact);
  return ApplyOwn(theirs, 0);
}

std::vector<ContactKey> ContactMap::AllNames(
    const ContactReport& report) const {
  std::vector<ContactKey> names = *report.same_as;
  for (const ContactKey& name : *report.same_as) {
    const Contact* held = set_->Get(name);
    if (held == nullptr || held->links() == nullptr) continue;
    for (const ContactKey& along : held->links()->names) {
      if (along != report.key) names.push_back(along);
    }
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

const Contact* ContactMap::SurestOf(const std::vector<ContactKey>& names,
                                    Time time) const {
  const Contact* surest = nullptr;
  double least_m4 = std::numeric_limits<double>::infinity();
  for (const ContactKey& name : names) {
    const Contact* held = set_->Get(name);
    if (held == nullptr || held->dropped()) continue;
    const ContactPoint there = PredictPoint(
        held->newest(), std::max(time, held->LastTime()), options_->classes);
    const double area_m4 =
        there.P(0, 0) * there.P(1, 1) - there.P(0, 1) * there.P(1, 0);
    if (surest == nullptr || area_m4 < least_m4) {
      surest = held;
      least_m4 = area_m4;
    }
  }
  return surest;
}

ContactOutcome ContactMap::BeginAs(const ContactReport& report,
                                   const Contact& other) {
  const Time time = std::max(report.time, other.LastTime());
  ContactPoint point = PredictPoint(other.newest(), time, options_->classes);
  point.track_start = time;
  ContactOutcome outcome;
  const Contact* held = set_->Get(report.key);
  if (held == nullptr) {
    auto contact = std::make_shared<Contact>(report.key);
    contact->Append(point, options_->classes);
    none_stale_until_ = std::min(none_stale_until_, StaleFrom(point));
    Own().Add(std::move(contact));
  } else if (held->LastTime() > time) {
    outcome.reason = RejectReason::kTooLate;
    return outcome;
  } else {
    Change(report.key, ContactChange::kAppend, [&](Contact& contact) {
      contact.Append(point, options_->classes);
      contact.recent() = {};
    });
  }
  outcome.applied = true;
  outcome.estimate = set_->Get(report.key)->NewestEstimate();
  outcome.estimates = {*outcome.estimate};
  return outcome;
}

ContactOutcome ContactMap::ApplyLinking(const ContactReport& report) {
  ContactOutcome outcome;
  const std::vector<ContactKey> names = AllNames(report);
  const Contact* held = set_->Get(report.key);
  // A name that is linked itself has no live track of its own.
  const bool live = held != nullptr && !held->dropped();
  const Contact* surest = SurestOf(names, report.time);
  const bool observed =
      !std::holds_alternative<NothingObserved>(report.observation);
  if (names.size() > kMaxLinkedNames ||
      (!observed && !live && surest == nullptr)) {
    outcome.reason = RejectReason::kBadLink;
    if (held != nullptr) outcome.estimate = held->NewestEstimate();
    return outcome;
  }
  const bool said_before =
      held != nullptr &&
      (held->links() == nullptr ? names.empty() && names_.count(report.key) == 0
                                : names == held->links()->names);
  if (said_before && observed) return ApplyOwn(report, 0);
  if (observed) {
    // A track that ends for it makes room.
    outcome = ApplyOwn(report, surest != nullptr ? 1 : 0);
  } else if (live) {
    outcome.applied = true;
  } else {
    outcome = BeginAs(report, *surest);
  }
  if (!outcome.applied) return outcome;

  Time since = std::max(report.time, set_->Get(report.key)->LastTime());
  for (const ContactKey& name : names) {
    const Contact* other = set_->Get(name);
    if (other != nullptr && !other->dropped()) {
      since = std::max(since, other->LastTime());
    }
  }
  SetLinks(report.key, {}, {});
  Unlink(report.key);
  for (const ContactKey& name : names) {
    Unlink(name);
    const ContactOutcome end = Drop(name, since);
    std::move(end.estimates.begin(), end.estimates.end(),
              std::back_inserter(outcome.ended));
  }
  // Whose history ends here says where it goes on.
  for (ContactEstimate& estimate : outcome.ended) {
    estimate.linked = {report.key};
  }
  SetLinks(report.key, since, names);
  outcome.estimate = set_->Get(report.key)->NewestEstimate();
  outcome.joint = outcome.joint && !names.empty();
  if (!outcome.joint) {
    for (ContactEstimate& estimate : outcome.estimates) {
      estimate.linked = names;
    }
  }
  return outcome;
}

void ContactMap::SetLinks(const ContactKey& contact, Time since,
                          std::vector<ContactKey> names) {
  const Contact* held = set_->Get(contact);
  if (held->links() != nullptr) {
    for (const ContactKey& name : held->links()->names) names_.erase(name);
  } else if (names.empty()) {
    return;
  }
  for (const ContactKey& name : names) names_.emplace(name, contact);
  std::shared_ptr<const ContactLinks> links;
  if (!names.empty()) {
    links = std::make_shared<const ContactLinks>(
        ContactLinks{.since = since, .names = std::move(names)});
  }
  ContactSet& set = Own();
  set.Change(set.Find(contact), ContactChange::kReports,
             [&links](Contact& changed) { changed.set_links(links); });
}

void ContactMap::Unlink(const ContactKey& name) {
  const auto found = names_.find(name);
  if (found == names_.end()) return;
  const ContactKey contact = found->second;
  const ContactLinks links = *set_->Get(contact)->links();
  std::vector<ContactKey> rest;
  std::copy_if(links.names.begin(), links.names.end(), std::back_inserter(rest),
               [&name](const ContactKey& other) { return other != name; });
  SetLinks(contact, links.since, std::move(rest));
}

}  // namespace fathom::map
