// What a sensor or a C4I link tells about one moving obstacle.
//
// Inputs of the dynamic obstacle map (Nervegna 2002, section 5.2). Departure:
// the thesis sends one record in which velocity 0 means "none"; here a report
// says by its type whether it is a range and bearing (goes through the filter)
// or a fix (taken as truth, overwrites). Plain values; depths are already
// below the mission's datum.

#ifndef FATHOM_MAP_CONTACTS_CONTACT_REPORT_H_
#define FATHOM_MAP_CONTACTS_CONTACT_REPORT_H_

#include <cstddef>
#include <optional>
#include <variant>
#include <vector>

#include "base/time.h"
#include "map/contacts/contact_class.h"
#include "map/geodesy/ids.h"
#include "map/geodesy/ping.h"
#include "map/geodesy/points.h"
#include "map/geodesy/pose.h"

namespace fathom::map {

// Bounds of a report; beyond them it is refused with the reason beside.
inline constexpr double kMaxContactRangeM = 200'000;       // kAboveMaxRange
inline constexpr double kMaxBearingStdDeg = 60;            // kBadStd
inline constexpr double kMaxContactStdM = 100'000;         // kBadStd
inline constexpr double kMaxContactSpeedMPerS = 60;        // kInvalidMessage
inline constexpr double kMaxContactVelocityStdMPerS = 60;  // kBadStd
inline constexpr double kMinContactDepthM = -100;          // kBadDepth
inline constexpr double kMaxContactDepthM = 12'000;        // kBadDepth
// Other names of one contact at once.
inline constexpr std::size_t kMaxLinkedNames = 8;  // kBadLink
// A north is needed: reports nearer to a pole are refused (kOutsideArea).
inline constexpr double kMaxContactLatitudeDeg = 89.9;

// Range and bearing heard on board (thesis fig. 5-4 lines 2-5).
struct RangeBearing {
  // Where the sensor was; position_std_m widens the measurement.
  Pose pose;
  // Horizontal, metres, in (0, kMaxContactRangeM].
  double range_m = 0;
  // From the bow, degrees clockwise, any finite value.
  double bearing_deg = 0;
  // 1 sigma, metres, in (0, kMaxContactStdM].
  double range_std_m = 0;
  // 1 sigma, degrees, in (0, kMaxBearingStdDeg].
  double bearing_std_deg = 0;

  friend bool operator==(const RangeBearing&, const RangeBearing&) = default;
};

// Position and velocity from C4I, "considered to be the truth" (thesis 5.2).
struct ContactFix {
  GeodeticPoint position;
  // True north and east, m/s, each within +-kMaxContactSpeedMPerS.
  double velocity_north_m_s = 0;
  double velocity_east_m_s = 0;
  // Per axis, 1 sigma, metres, in [0, kMaxContactStdM].
  double position_std_m = 10;
  // Per axis, 1 sigma, m/s, in [0, kMaxContactVelocityStdMPerS].
  double velocity_std_m_s = 0.5;

  friend bool operator==(const ContactFix&, const ContactFix&) = default;
};

// The report only says `same_as`: two names are one contact.
struct NothingObserved {
  friend bool operator==(const NothingObserved&,
                         const NothingObserved&) = default;
};

// One report about one contact.
struct ContactReport {
  ContactKey key;
  ContactClass contact_class = ContactClass::kUnknown;
  // When it was observed.
  Time time;
  std::variant<RangeBearing, ContactFix, NothingObserved> observation;
  // Depth of the middle of a submerged contact. For the other classes it only
  // deepens the keel: a surface contact always reaches the surface.
  std::optional<double> depth_m;
  // 1 sigma, metres, > 0; absent beside a depth: kDefaultDepthStdM.
  std::optional<double> depth_std_m;
  // The contact is gone: closes the track at `time`; the observation is not
  // looked at (thesis 5.5).
  bool inactive = false;
  // C4I knows under what other names sources report this contact: from here
  // on all of them are one track (ContactMap::Apply). Not in a RangeBearing
  // nor an inactive report. Empty: none, whatever was said before. nullopt: as
  // before.
  std::optional<std::vector<ContactKey>> same_as = std::nullopt;

  friend bool operator==(const ContactReport&, const ContactReport&) = default;
};

// Uncertainty of a stated depth that comes without one.
inline constexpr double kDefaultDepthStdM = 10;

// Why the map would refuse the report whatever it holds; nullopt: it is well
// formed. REQUIRES nothing; NaN and infinity give kNotFinite. The observation
// of an inactive report is not checked.
std::optional<RejectReason> CheckContactReport(const ContactReport& report);

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_CONTACT_REPORT_H_
