// Reports for the tests of this folder.

#ifndef FATHOM_TESTS_MAP_CONTACTS_CONTACT_TESTING_H_
#define FATHOM_TESTS_MAP_CONTACTS_CONTACT_TESTING_H_

#include <cstdint>
#include <string>

#include "base/time.h"
#include "map/contacts/contact_report.h"

namespace fathom::map {

// `seconds` after the tests' start, 2002-05-24T12:00:00Z.
inline Time AtS(double seconds) {
  return TimeFromUnixMicros(1'022'241'600'000'000 +
                            static_cast<std::int64_t>(seconds * 1e6));
}

inline ContactKey Key(const std::string& contact) {
  return {.source = {"auv"}, .contact = {contact}};
}

// Narragansett Bay.
inline constexpr GeodeticPoint kBay{.latitude_deg = 41.5,
                                    .longitude_deg = -71.4};

// A vessel told by C4I.
inline ContactReport Fix(const std::string& contact, double at_s,
                         const GeodeticPoint& position, double north_m_s = 0,
                         double east_m_s = 0) {
  return {.key = Key(contact),
          .contact_class = ContactClass::kVessel,
          .time = AtS(at_s),
          .observation = ContactFix{.position = position,
                                    .velocity_north_m_s = north_m_s,
                                    .velocity_east_m_s = east_m_s},
          .depth_m = {},
          .depth_std_m = {}};
}

// A vessel heard from `sensor`, whose bow points north.
inline ContactReport Heard(const std::string& contact, double at_s,
                           const GeodeticPoint& sensor, double range_m,
                           double bearing_deg) {
  return {.key = Key(contact),
          .contact_class = ContactClass::kVessel,
          .time = AtS(at_s),
          .observation = RangeBearing{.pose = {.position = sensor},
                                      .range_m = range_m,
                                      .bearing_deg = bearing_deg,
                                      .range_std_m = 20,
                                      .bearing_std_deg = 1},
          .depth_m = {},
          .depth_std_m = {}};
}

}  // namespace fathom::map

#endif  // FATHOM_TESTS_MAP_CONTACTS_CONTACT_TESTING_H_
