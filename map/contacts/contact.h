// One contact: what is believed of it now, and what was believed after each
// of its recent reports, so that questions about the past can be answered.
//
// Life (Nervegna 2002, section 5.5): the first report makes it kNew; further
// ones kActive; silence longer than its class's stale_after_s makes it kStale
// (it is still predicted, ever less surely); a report that says so, or a drop,
// makes it kDropped. A report about a contact that is stale or dropped starts
// the track anew; the former life stays in the history.
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
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "base/time.h"
#include "map/contacts/contact_class.h"
#include "map/contacts/filter.h"
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

  friend bool operator==(const ContactEstimate&,
                         const ContactEstimate&) = default;
};

// The newest estimates of one contact, oldest first, at most
// kRecentEstimates. Copying shares them: copies cost O(kRecentEstimates / 16).
//
// Chunks of 16 are shared between all copies and filled from the front; a
// copy reads only below its own size, so the writer may fill the slots above
// while readers read. REQUIRES therefore: of all copies of a history only the
// longest is ever appended to (the writer's, which published the others).
class TrackHistory {
 public:
  std::size_t size() const { return end_ - begin_; }
  bool empty() const { return end_ == begin_; }
  // REQUIRES: i < size(). 0 is the oldest.
  const ContactPoint& operator[](std::size_t i) const {
    const std::size_t slot = begin_ + i;
    return chunks_[slot / kChunk]->points[slot % kChunk];
  }
  const ContactPoint& newest() const { return (*this)[size() - 1]; }
  // Adds one behind the newest; forgets the oldest beyond kRecentEstimates.
  void Append(const ContactPoint& point);
  // Index of the newest point with time <= t; nullopt if all are later. Of
  // several at t the last. O(log size).
  std::optional<std::size_t> NewestAtOrBefore(Time t) const;

 private:
  static constexpr std::size_t kChunk = 16;
  struct Chunk {
    std::array<ContactPoint, kChunk> points;
  };
  std::vector<std::shared_ptr<Chunk>> chunks_;
  // Slots [begin_, end_) counted from the first chunk held.
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
};

// A contact as stored: its newest estimates, oldest first, 1 to
// kRecentEstimates of them (of more, the newest are taken).
struct StoredContact {
  ContactKey key;
  std::vector<ContactEstimate> estimates;
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

  // The contact at `t`: the newest estimate at or before it, predicted on.
  // Absent before the first report and from a drop to the next report. Before
  // the oldest estimate that is kept, if that life was running: predicted
  // back from it. kStale if silent too long at `t`. O(log kept).
  std::optional<ContactPoint> At(Time t,
                                 const ContactClassTable& classes) const;

  // The same with the name.
  std::optional<ContactEstimate> EstimateAt(
      Time t, const ContactClassTable& classes) const;
  // newest() with the name.
  ContactEstimate NewestEstimate() const;
  StoredContact ToStored() const;

  void Append(const ContactPoint& point) { history_.Append(point); }

 private:
  ContactKey key_;
  TrackHistory history_;
};

// The point moved on (or back) to `t` under its class's process noise;
// `time` becomes t, the rest stays.
ContactPoint PredictPoint(const ContactPoint& point, Time t,
                          const ContactClassTable& classes);

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_CONTACT_H_
