// What ships say of themselves by AIS: sentences AIVDM and AIVDO to positions
// and to what a ship is.
//
// Source: ITU-R M.1371-5, annex 8; layouts as in E. S. Raymond, "AIVDM/AIVDO
// protocol decoding". Of the 27 types those that tell where a vessel is (1, 2,
// 3, 18, 19, 27) and what it is (5, 19, 24 B) are decoded; the rest (base
// stations, aids to navigation, aircraft, texts) is none of the map's business
// and counted. A value that AIS calls "not available" is absent.
//
// Our own decoder, since no C or C++ library is at hand that keeps a message
// together with its line and time; held against gpsd's golden decodings.

#ifndef FATHOM_SIM_FEEDER_REPLAY_AIS_H_
#define FATHOM_SIM_FEEDER_REPLAY_AIS_H_

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "map/geodesy/points.h"
#include "sim_feeder/replay/nmea.h"

namespace fathom::feeder {

struct AisPosition {
  map::GeodeticPoint place = {};
  // Over ground; 102.2 knots stands for that or more.
  std::optional<double> speed_kn = {};
  // Over ground, degrees clockwise from true north, [0, 360).
  std::optional<double> course_deg = {};
  // Second of the minute of the fix, 0 to 59.
  std::optional<int> utc_second = {};
  // Better than 10 m, as the ship says.
  bool accurate = false;
  // Told in steps of a tenth of a minute of arc (type 27), not 1/10 000.
  bool coarse = false;
};

struct AisShip {
  // Code of table 53: 30 fishing, 36 sailing, 37 pleasure craft, 60 passenger,
  // 70 cargo, 80 tanker, ...; 0 not available.
  int ship_type = 0;
  // Metres; 0 not available.
  int length_m = 0;
  int beam_m = 0;
  // Metres, absent: not available. Type 5 alone.
  std::optional<double> draught_m = {};
};

struct AisMessage {
  // 1 to 27.
  int type = 0;
  std::uint32_t mmsi = 0;
  // Absent where the type has none or the ship does not know.
  std::optional<AisPosition> position = {};
  std::optional<AisShip> ship = {};
};

// One complete message from its payload, armoured six bits a character.
// Errors: INVALID_ARGUMENT with the reason in a few words, as ParseNmea:
// "bad payload", "message too short".
absl::StatusOr<AisMessage> DecodeAis(std::string_view payload, int fill_bits);

// Puts the parts of a message together. Not thread-safe.
class AisAssembler {
 public:
  // Takes a VDM or VDO sentence; a message when it was its last part, absent
  // while parts are missing. Parts may come mixed with those of others, told
  // apart by message id and channel; of messages that are never completed the
  // oldest is dropped when kMaxPending wait. Errors: as DecodeAis, and "bad
  // fragment" for a part that fits no message begun.
  absl::StatusOr<std::optional<AisMessage>> Take(const NmeaSentence& sentence);

  // Messages that wait for parts.
  std::size_t pending() const { return pending_.size(); }

  static constexpr std::size_t kMaxPending = 16;

 private:
  struct Pending {
    std::string id;  // Message id and channel.
    int count = 0;
    std::vector<std::string> parts;
  };

  std::deque<Pending> pending_;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_REPLAY_AIS_H_
