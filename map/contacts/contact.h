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
// 1445-1450): it grows surer as reports come in after it.
//
// Each estimate lives in the north-east plane of its own frame_origin: the
// place of the first report, moved along when the contact has gone further
// than kReanchorM, or of the last fix. Everything is doubles, so that storing
// and restoring gives the same answers, bit for bit.
//
// A Contact is immutable once published in a ContactsView; thread-safe.

#ifndef FATHOM_MAP_CONTACTS_CONTACT_H_
#define FATHOM_MAP_CONTACTS_CONTACT_H_

#include <Eigen/Core>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "base/time.h"
#include "map/contacts/contact_class.h"
#include "map/contacts/contact_report.h"
#include "map/contacts/shared_log.h"
#include "map/geodesy/ids.h"
#include "map/geodesy/points.h"

namespace fathom::map {

// The numbers are those of fathom.v1.ContactStatus; stored: never reuse one.
enum class ContactStatus : std::uint8_t {
  kNew = 1,      // Reported once; its velocity is not yet known.
  kActive = 2,   // Tracked.
  kStale = 3,    // Silent too long; still predicted. Never stored.
  kDropped = 4,  // Gone; only its history answers.
};

// Estimates kept per contact; older ones are in the mission file only.
inline constexpr std::size_t kRecentEstimates = 256;

// A contact's plane is laid anew when the contact is further than this from
// its origin: lengths on the plane are short by 0.5 m there.
inline constexpr double kReanchorM = 50'000;

// The motion and size of a contact at one time, without its name.
struct ContactPoint {
  ContactClass contact_class = ContactClass::kUnknown;
  ContactStatus status = ContactStatus::kNew;
  // The moment that the estimate is for.
  Time time;
  // The last report behind it; equals `time` in what is stored.
  Time report_time;
  // The first report of this life of the contact.
  Time track_start;
  // Where the plane of x and P touches the Earth.
  GeodeticPoint frame_origin;
  // [n, e, vn, ve], metres and m/s, and covariance; P symmetric.
  Eigen::Vector4d x = Eigen::Vector4d::Zero();
  Eigen::Matrix4d P = Eigen::Matrix4d::Zero();
  // The depths it occupies below the mission's datum (0: from the surface),
  // and 1 sigma of both together; 0 where they go by class.
  double top_depth_m = 0;
  double keel_depth_m = 0;
  double depth_std_m = 0;
  // Radius of the disc that holds it.
  double radius_m = 0;
  // Reports fused in this life.
  std::uint64_t report_count = 0;

  // Where x is, on the Earth; sound at any distance from the origin.
  GeodeticPoint Position() const;

  friend bool operator==(const ContactPoint&, const ContactPoint&) = default;
};

// A contact's estimate with its name: what is told, stored and restored.
struct ContactEstimate : ContactPoint {
  ContactKey key;
  // Its other names at that time, as C4I linked them; in order.
  std::vector<ContactKey> linked;

  friend bool operator==(const ContactEstimate&,
                         const ContactEstimate&) = default;
};

// The newest estimates of one contact, oldest first, at most kRecentEstimates.
class TrackHistory : public SharedLog<ContactPoint, kRecentEstimates> {
 public:
  // Index of the newest point with time <= t; nullopt if all are later. Of
  // several at t the last. O(log size).
  std::optional<std::size_t> NewestAtOrBefore(Time t) const;
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
// kRecentEstimates of them (of more, the newest are taken), and the reports of
// late behind them.
struct StoredContact {
  ContactKey key;
  // Without `linked`: see links.
  std::vector<ContactEstimate> estimates;
  // In order of time, at most kRecentReports.
  std::vector<RecentReport> recent;
  std::optional<ContactLinks> links = std::nullopt;
};

// See file comment.
class Contact {
 public:
  explicit Contact(ContactKey key) : key_(std::move(key)) {}

  const ContactKey& key() const { return key_; }
  // Never empty in a published contact.
  const TrackHistory& history() const { return history_; }
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
  // what was heard before and after (at most kSmoothedAhead estimates after).
  // Absent before the first report and from a drop to the next report. Before
  // the oldest estimate that is kept, if that life was running: predicted
  // back from it. O(log kept); the past up to 15 us.
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
  TrackHistory& history() { return history_; }
  RecentReports& recent() { return recent_; }
  void set_links(std::shared_ptr<const ContactLinks> links) {
    links_ = std::move(links);
  }

 private:
  // What is believed of history_[index] after up to kSmoothedAhead later ones
  // of the same life, in its own plane.
  ContactPoint Smoothed(std::size_t index,
                        const ContactClassTable& classes) const;

  ContactKey key_;
  TrackHistory history_;
  RecentReports recent_;
  std::shared_ptr<const ContactLinks> links_;
};

// What lies further ahead than so many estimates does not help the past.
inline constexpr std::size_t kSmoothedAhead = 32;

// The point in a plane that touches the Earth at `origin`: the same place,
// velocity and uncertainty. REQUIRES: within 3000 km of it.
ContactPoint InPlaneAt(const ContactPoint& point, const GeodeticPoint& origin);

// The point moved on (or back) to `t` under its class's process noise;
// `time` becomes t, the rest stays.
ContactPoint PredictPoint(const ContactPoint& point, Time t,
                          const ContactClassTable& classes);

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_CONTACT_H_
