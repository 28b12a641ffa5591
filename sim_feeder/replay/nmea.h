// Sentences of NMEA 0183, one a line, as loggers write them: "$" and "!"
// sentences with their checksum, an NMEA 4.10 tag block before them or not.
//
// Source: NMEA 0183 as described in E. S. Raymond, "NMEA Revealed" and
// "AIVDM/AIVDO protocol decoding" (gpsd project). Pure functions.

#ifndef FATHOM_SIM_FEEDER_REPLAY_NMEA_H_
#define FATHOM_SIM_FEEDER_REPLAY_NMEA_H_

#include <optional>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "base/time.h"
#include "map/geodesy/points.h"

namespace fathom::feeder {

// Views into the line: valid as long as it is.
struct NmeaSentence {
  // Talker and type: "GPRMC", "AIVDM".
  std::string_view address;
  // What follows the address, split at commas, without the checksum.
  std::vector<std::string_view> fields;
  // When it was received: "c:" of the tag block, seconds or milliseconds since
  // 1970. A tag block is used only if its own checksum holds.
  std::optional<Time> tag_time;

  // The type without the talker: "RMC"; "VDM".
  std::string_view type() const {
    return address.size() < 3 ? address : address.substr(address.size() - 3);
  }
  // Field n, from 0; empty where there is none.
  std::string_view field(std::size_t n) const {
    return n < fields.size() ? fields[n] : std::string_view();
  }
};

// Whether the line holds no sentence at all and is to be passed over: empty, or
// a comment ("#").
bool IsNmeaComment(std::string_view line);

// Errors: INVALID_ARGUMENT whose message is the reason, one of a few words, so
// that they can be counted: "not a sentence", "no checksum", "bad checksum",
// "line too long" (above 1024 characters).
absl::StatusOr<NmeaSentence> ParseNmea(std::string_view line);

// A number; absent where the field is empty or no number.
std::optional<double> NmeaNumber(std::string_view field);

// A place from four fields: ddmm.mm, N|S, dddmm.mm, E|W; absent where one is
// empty or out of range.
std::optional<map::GeodeticPoint> NmeaPlace(std::string_view latitude,
                                            std::string_view north_south,
                                            std::string_view longitude,
                                            std::string_view east_west);

// The time of day from hhmmss or hhmmss.ss; absent where it is none (hour 24,
// second 60 and more).
std::optional<Duration> NmeaTimeOfDay(std::string_view field);

// The day from ddmmyy: years 70 to 99 are of the last century.
std::optional<Time> NmeaDate(std::string_view field);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_REPLAY_NMEA_H_
