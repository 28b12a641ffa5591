// The motion and size of a contact at one time, and how it moves on.
//
// Each estimate lives in the north-east plane of its own frame_origin: the
// place of the first report, moved along when the contact has gone further
// than kReanchorM, or of the last fix. Thread-safe: no state.

#ifndef FATHOM_MAP_CONTACTS_CONTACT_POINT_H_
#define FATHOM_MAP_CONTACTS_CONTACT_POINT_H_

#include <Eigen/Core>
#include <cstdint>

#include "base/time.h"
#include "map/contacts/contact_class.h"
#include "map/geodesy/points.h"

namespace fathom::map {

// The numbers are those of fathom.v1.ContactStatus; stored: never reuse one.
enum class ContactStatus : std::uint8_t {
  kNew = 1,      // Reported once; its velocity is not yet known.
  kActive = 2,   // Tracked.
  kStale = 3,    // Silent too long; still predicted. Never stored.
  kDropped = 4,  // Gone; only its history answers.
};

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

// The point in a plane that touches the Earth at `origin`: the same place,
// velocity and uncertainty. REQUIRES: within 3000 km of it.
ContactPoint InPlaneAt(const ContactPoint& point, const GeodeticPoint& origin);

// The point moved on (or back) to `t` under its class's process noise;
// `time` becomes t, the rest stays.
ContactPoint PredictPoint(const ContactPoint& point, Time t,
                          const ContactClassTable& classes);

// Whether `next`, the estimate after `point`, is of the same life and plain to
// smooth from: not a marker of a drop.
bool GoesOn(const ContactPoint& point, const ContactPoint& next);

// Whether the estimate is a fix and nothing else, which overwrote what was
// believed: the contact is where its plane touches the Earth.
bool IsFixAlone(const ContactPoint& point);

// `point` after what `next` tells, an estimate of the same life, later or at
// the same time (SmoothBack): in the plane of `point`. `apart`: `next` owes
// nothing to `point`, since a fix overwrote it; both are then of use.
ContactPoint SmoothedBy(const ContactPoint& point, const ContactPoint& next,
                        bool apart, const ContactClassTable& classes);

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_CONTACT_POINT_H_
