// Single soundings as pings: those near in place and time go together.
//
// A ping holds ranges from one place, and a range of 0 is discarded (Nervegna
// 2002, 4.3.3.1), so the ping's place is set 1 m south of the southernmost of
// its soundings: ranges are 1 m and more, places exact to 1 mm.

#ifndef FATHOM_SIM_FEEDER_REPLAY_SOUNDING_PINGS_H_
#define FATHOM_SIM_FEEDER_REPLAY_SOUNDING_PINGS_H_

#include <chrono>
#include <optional>
#include <vector>

#include "base/time.h"
#include "fathom/v1/ingest_service.pb.h"
#include "sim_feeder/replay/recording.h"

namespace fathom::feeder {

// Not thread-safe.
class SoundingPings {
 public:
  // Soundings of one ping: so many at most, so near the first in both axes, and
  // at most so much later or earlier.
  static constexpr std::size_t kMaxSoundings = 128;
  static constexpr double kReachM = 100;
  static constexpr std::chrono::seconds kReach{1};

  // The ping that is whole because this sounding does not belong to it, if
  // there is one. The ping's time is its newest sounding's.
  std::optional<RecordedEvent> Add(Time time, const Sounding& sounding);

  // The ping of what was added last.
  std::optional<RecordedEvent> Finish();

 private:
  struct Held {
    Time time;
    Sounding sounding;
  };

  bool Belongs(Time time, const Sounding& sounding) const;

  std::vector<Held> held_;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_REPLAY_SOUNDING_PINGS_H_
