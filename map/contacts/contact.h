// One contact: what is believed of it now, and what was believed after each
// of its recent reports, so that questions about the past can be answered.
//
// Life (Nervegna 2002, section 5.5): the first report makes it kNew; further
// ones kActive; silence longer than its class's stale_after_s makes it kStale
// (it is still predicted, ever less surely); a report that says so, or a drop,
// makes it kDropped. A report about a contact that is stale or dropped starts
// the track anew; the former life stays in the history.
//
// The past between reports is smoothed, not extrapolated (Rauch, Tung, Striebel
// 1965, "Maximum likelihood estimates of linear dynamic systems", AIAA J. 3(8),
// 1445-1450): it grows surer as reports come in after it. Back to the newest
// kRecentEstimates by each of them, before by some of them (track_history.h).
//
// Everything is doubles, so that storing and restoring gives the same answers,
// bit for bit.
//
// A Contact is immutable once published in a ContactsView; thread-safe.

#ifndef FATHOM_MAP_CONTACTS_CONTACT_H_
#define FATHOM_MAP_CONTACTS_CONTACT_H_

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "base/time.h"
#include "map/contacts/contact_class.h"
#include "map/contacts/contact_point.h"
#include "map/contacts/contact_report.h"
#include "map/contacts/shared_log.h"
#include "map/contacts/track_history.h"
#include "map/geodesy/ids.h"
#include "map/geodesy/points.h"

namespace fathom::map {

// A contact's estimate with its name: what is told, stored and restored.
struct ContactEstimate : ContactPoint {
  ContactKey key;
  // Its other names at that time, as C4I linked them; in order.
  std::vector<ContactKey> linked;

  friend bool operator==(const ContactEstimate&,
                         const ContactEstimate&) = default;
};

// Late reports are taken if they are not older than this beside the newest
// report about the contact: what a slow link or a second receiver delays. An
// hour-old report would rewrite what was answered to planners for an hour.
inline constexpr std::chrono::seconds kLateWindow{60};

// And not older than the newest so many reports, which must be kept.
inline constexpr std::size_t kRecentReports = 64;

// A report that was fused or gated, kept so that an earlier one that comes
// late can be put before it and the track be made anew.
struct RecentReport {
  // `key` is empty: it is the contact's.
  ContactReport report;
  // Refused by the innovation gate; it is then no part of the track yet.
  bool gated = false;
  // Points of the history that came of it: 0 (gated, or a contact that was
  // gone already), 1, or 2 where the track began anew (tracker.h).
  std::uint8_t points = 0;

  friend bool operator==(const RecentReport&, const RecentReport&) = default;
};
using RecentReports = SharedLog<RecentReport, kRecentReports>;

// Names that C4I said are one contact with another (ContactReport::same_as).
struct ContactLinks {
  // From when on; reports of before are not taken any more.
  Time since;
  // In order, 1 to kMaxLinkedNames, without the contact's own.
  std::vector<ContactKey> names;

  friend bool operator==(const ContactLinks&, const ContactLinks&) = default;
};

// A contact as stored: its newest estimates, oldest first, 1 to
// kRecentEstimates of them (of more, the newest are taken), the reports of
// late behind them, and those kept of the estimates before.
struct StoredContact {
  ContactKey key;
  // Without `linked`: see links.
  std::vector<ContactEstimate> estimates;
  // In order of time, at most kRecentReports.
  std::vector<RecentReport> recent;
  std::optional<ContactLinks> links = std::nullopt;
  // In order of time, not later than estimates, at most kOlderEstimates. Of a
  // mission of an older format there are none.
  std::vector<ContactPoint> older = {};
};

// See file comment.
class Contact {
 public:
  explicit Contact(ContactKey key) : key_(std::move(key)) {}

  const ContactKey& key() const { return key_; }
  // Never empty in a published contact.
  const TrackHistory& history() const { return history_; }
  // What is kept of the estimates before.
  const OlderEstimates& older() const { return older_; }
  // The estimate after the newest report, or the marker of its drop.
  const ContactPoint& newest() const { return history_.newest(); }
  bool dropped() const { return newest().status == ContactStatus::kDropped; }

  // The reports of late, in order of time; REQUIRES of them what
  // RecentReport says. Since the last Drop by command only.
  const RecentReports& recent() const { return recent_; }
  // The time of the newest report or drop. REQUIRES: a history.
  Time LastTime() const;
  // Its other names; nullptr: none. Lives with the contact and its copies.
  const std::shared_ptr<const ContactLinks>& links() const { return links_; }

  // The contact at `t`. After the newest estimate: that one predicted on;
  // kStale if silent too long. Between two of one life: smoothed, that is by
  // what was heard before and after (at most kSmoothedAhead estimates after);
  // of `older` its report_time and report_count are those of the one kept
  // before. Absent before the first report and from a drop to the next report.
  // Before the oldest estimate that is kept, if that life was running (a
  // mission of an older format, or hundreds of lives): predicted back from it.
  // O(log kept); the past up to 15 us.
  std::optional<ContactPoint> At(Time t,
                                 const ContactClassTable& classes) const;

  // The same with the name.
  std::optional<ContactEstimate> EstimateAt(
      Time t, const ContactClassTable& classes) const;
  // newest() with the name.
  ContactEstimate NewestEstimate() const { return Named(newest()); }
  // A point of it with its names.
  ContactEstimate Named(const ContactPoint& point) const;
  StoredContact ToStored() const;

  // For the holder (ContactSet).
  void Append(const ContactPoint& point, const ContactClassTable& classes);
  // Keeps the oldest `size` of history() only.
  void Truncate(std::size_t size);
  // REQUIRES: nothing is held; as StoredContact says.
  void Restore(const StoredContact& stored, const ContactClassTable& classes);
  RecentReports& recent() { return recent_; }
  void set_links(std::shared_ptr<const ContactLinks> links) {
    links_ = std::move(links);
  }
  // Where the spatial index has it (SpatialEntry::code).
  std::uint64_t index_code() const { return index_code_; }
  void set_index_code(std::uint64_t code) { index_code_ = code; }

 private:
  // All estimates in memory, oldest first.
  std::size_t size() const { return older_.size() + history_.size(); }
  const ContactPoint& operator[](std::size_t index) const {
    return index < older_.size() ? older_[index]
                                 : history_[index - older_.size()];
  }
  // The estimate after (*this)[index] that smoothing steps to. REQUIRES: there
  // is one of the same life.
  std::size_t After(std::size_t index, const ContactClassTable& classes) const;
  // What is believed of (*this)[index] after up to kSmoothedAhead later ones
  // of the same life, in its own plane.
  ContactPoint Smoothed(std::size_t index,
                        const ContactClassTable& classes) const;

  ContactKey key_;
  OlderEstimates older_;
  TrackHistory history_;
  RecentReports recent_;
  std::shared_ptr<const ContactLinks> links_;
  std::uint64_t index_code_ = 0;
};

// Estimates ahead that the past is smoothed by. Where there are more of the
// same life, those that may be skipped without loss are: else so many would
// reach less far than they help where reports are frequent and vague.
inline constexpr std::size_t kSmoothedAhead = 32;

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_CONTACT_H_
