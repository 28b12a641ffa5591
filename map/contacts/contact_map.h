// ContactMap: the dynamic obstacle map, a bounded list of moving obstacles
// (Nervegna 2002, chapter 5; algorithm UPDATE-DYNAMIC-MAP, fig. 5-4, whose
// "else" of lines 16 and 40 belongs to the C4I test).
//
// One thread writes; readers use View(). Deterministic: the same reports in
// the same order give the same contacts, bit for bit, and so does Restore
// followed by the rest of the reports. No clock: time is the reports'.

#ifndef FATHOM_MAP_CONTACTS_CONTACT_MAP_H_
#define FATHOM_MAP_CONTACTS_CONTACT_MAP_H_

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "base/time.h"
#include "map/contacts/contact.h"
#include "map/contacts/contact_class.h"
#include "map/contacts/contact_report.h"
#include "map/contacts/contacts_view.h"
#include "map/contacts/filter.h"
#include "map/contacts/tracker.h"
#include "map/geodesy/ids.h"
#include "map/geodesy/ping.h"

namespace fathom::map {

struct ContactMapOptions {
  // Most contacts that are not dropped. One more takes the place of the one
  // that is stale longest as of its report; if none is, it is refused (section
  // 5.5): what is heard now matters more than what is silent and inactive. As
  // many dropped ones are remembered; beyond, the longest gone is forgotten
  // (the mission file still has it). 1 to 100 000.
  std::uint32_t max_contacts = 1000;
  FilterKind filter = FilterKind::kFourState;
  ContactClassTable classes = DefaultContactClasses();
};

// What became of a report.
struct ContactOutcome {
  // Fused (or the track was closed).
  bool applied = false;
  // Why not; absent when applied, and when a contact to drop is not held.
  std::optional<RejectReason> reason;
  // The contact's newest estimate after the call, if it is held. Unchanged if
  // not applied.
  std::optional<ContactEstimate> estimate;
  // What the history gains, oldest first: one estimate, two where the track
  // began anew; more after a late report, if `revised`.
  std::vector<ContactEstimate> estimates;
  // `estimates` take the place of all that the history held of this contact
  // at the time of the first of them and later.
  bool revised = false;
  // `estimates` belong to the history of their linked names as well.
  bool joint = false;
  // The markers of other tracks that ended: linked to this one, or stale and in
  // a new contact's way.
  std::vector<ContactEstimate> ended;
  // Of a range and bearing that came in its turn: see TrackStep.
  std::optional<double> nis;
};

enum class ContactChange;  // contact_set.h.

class ContactMap {
 public:
  // REQUIRES: options in the ranges stated (ValidateContactClasses).
  explicit ContactMap(ContactMapOptions options);
  ContactMap(ContactMap&&) noexcept;
  ContactMap& operator=(ContactMap&&) noexcept;
  ~ContactMap();

  // Fuses one report, or refuses it. Refused, with nothing changed:
  //   as CheckContactReport says,
  //   kTooLate       older than kLateWindow, or than kRecentReports reports,
  //                  or than the last Drop by command,
  //   kContactsFull  a new contact, no room and none that is stale,
  //   kBadLink       same_as makes more than kMaxLinkedNames names of one, or
  //                  nothing is observed and none of them has a live track.
  // kGated: as tracker.h says; the report is remembered, and if the next ones
  // bear it out the track begins anew with it.
  //
  // A report within the window that comes late gives what it would have given
  // in its turn, to the bit: the track is made again from the estimate before
  // it with all reports since, fused or gated, in order of time (at one time:
  // in order of arrival). About 0.4 us for each of them.
  //
  // A report with same_as links names (contact_links.cc): tracks of their own
  // that these have end, what their sources report from now on goes to the
  // contact that the report names, as reports of its class, and what was
  // linked to them before is linked along. Where nothing is observed and the
  // contact is not live it begins where the surest of them is. An inactive
  // report about a linked name only takes that name out of the link; the end
  // of the track ends the link.
  //
  // A fix overwrites position, velocity and covariance (its stds not below
  // 0.01 m and 0.001 m/s, so that the covariance stays positive). An inactive
  // report about a contact that is not held or gone already is applied and
  // changes nothing. About 1 us.
  ContactOutcome Apply(const ContactReport& report);

  // Closes a track, named by any of its names, at `time` (or at its newest
  // estimate, if that is later), and ends its links; no
  // report of before is taken any more. Not applied: the contact is not held or
  // was dropped before.
  ContactOutcome Drop(const ContactKey& key, Time time);

  // The contacts as they are. Free if nothing changed since the last call;
  // else O(size / 64).
  ContactsView View();

  // Puts a stored contact back. Errors: ALREADY_EXISTS (its key is held),
  // INVALID_ARGUMENT (no estimates, not in order of time, not finite, keys
  // that differ, links that are none, a covariance of an older estimate that is
  // none), RESOURCE_EXHAUSTED (beyond max_contacts
  // live ones).
  absl::Status Restore(StoredContact stored);

  // Contacts held and not dropped.
  std::size_t live_count() const;
  const ContactMapOptions& options() const { return *options_; }

 private:
  // A report about the contact named, whatever it says of links. `room`: how
  // many live contacts there may be beyond max_contacts.
  ContactOutcome ApplyOwn(const ContactReport& report, std::size_t room);
  ContactOutcome ApplyFirst(const ContactReport& report, std::size_t room);
  ContactOutcome ApplyNext(const Contact& held, const ContactReport& report);
  ContactOutcome ApplyLate(const Contact& held, const ContactReport& report);
  // A report about another name of `contact`, which is a copy: the link that
  // the report may end holds the one it was found by.
  ContactOutcome ApplyLinked(ContactKey contact, const ContactReport& report);
  // A report with same_as.
  ContactOutcome ApplyLinking(const ContactReport& report);
  // The names that the report makes other names of its contact, in order.
  std::vector<ContactKey> AllNames(const ContactReport& report) const;
  // The surest of the contacts named that are live; nullptr: none is.
  const Contact* SurestOf(const std::vector<ContactKey>& names,
                          Time time) const;
  // Begins the contact where `other` is.
  ContactOutcome BeginAs(const ContactReport& report, const Contact& other);
  // From `since` on `names` are the contact's other names; empty: none are.
  void SetLinks(const ContactKey& contact, Time since,
                std::vector<ContactKey> names);
  // Takes `name` out of the link that it is in, if it is in one.
  void Unlink(const ContactKey& name);
  // What is known of the contact after its first `points` points and
  // `reports` recent reports.
  static TrackMemory MemoryOf(const Contact& held, std::size_t points,
                              std::size_t reports);
  // The set, which this epoch may change.
  ContactSet& Own();
  // Changes a contact that is held and keeps the account of those gone.
  void Change(const ContactKey& key, ContactChange kind,
              absl::FunctionRef<void(Contact&)> change);
  void ForgetLongestGone();
  // When a track whose newest point this is becomes stale.
  Time StaleFrom(const ContactPoint& newest) const;
  // Whether there is room for one more; else ends the track that is stale
  // longest at `time`, if one is, and adds its marker. O(1), or O(size) where a
  // contact may have become stale since the last time.
  bool MakeRoom(Time time, std::size_t room,
                std::vector<ContactEstimate>& ended);

  std::shared_ptr<const ContactMapOptions> options_;
  // Shared with the last view until the next change.
  std::shared_ptr<ContactSet> set_;
  // Grows with each View(): pieces of this epoch are not yet shared.
  std::uint64_t epoch_ = 1;
  // Dropped contacts by the time of their drop.
  std::set<std::pair<Time, ContactKey>> gone_;
  // Other names of contacts, each with the contact's own.
  std::map<ContactKey, ContactKey> names_;
  // No live contact is stale at this time or before. Saves looking; answers do
  // not depend on it.
  Time none_stale_until_ = Time::min();
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_CONTACT_MAP_H_
