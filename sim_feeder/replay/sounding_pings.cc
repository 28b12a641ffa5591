#include "sim_feeder/replay/sounding_pings.h"

#include <algorithm>
#include <cmath>

#include "client/proto_time.h"
#include "map/geodesy/ned_frame.h"
#include "sim_feeder/angles.h"

namespace fathom::feeder {

std::optional<RecordedEvent> SoundingPings::Add(Time time,
                                                const Sounding& sounding) {
  std::optional<RecordedEvent> whole;
  if (!held_.empty() && !Belongs(time, sounding)) whole = Finish();
  held_.push_back({.time = time, .sounding = sounding});
  return whole;
}

bool SoundingPings::Belongs(Time time, const Sounding& sounding) const {
  const Held& first = held_.front();
  if (held_.size() == kMaxSoundings ||
      std::chrono::abs(time - first.time) > kReach) {
    return false;
  }
  const map::NedPoint off =
      map::NedFrame(first.sounding.place).ToNed(sounding.place);
  return std::fabs(off.north_m) <= kReachM && std::fabs(off.east_m) <= kReachM;
}

std::optional<RecordedEvent> SoundingPings::Finish() {
  if (held_.empty()) return std::nullopt;
  const auto south = std::min_element(
      held_.begin(), held_.end(), [](const Held& a, const Held& b) {
        return a.sounding.place.latitude_deg < b.sounding.place.latitude_deg;
      });
  const map::GeodeticPoint from =
      map::NedFrame(south->sounding.place).ToGeodetic(-1.0, 0.0);
  const map::NedFrame frame(from);
  RecordedEvent event = {.time = held_.front().time, .what = v1::Ping()};
  v1::Ping& ping = std::get<v1::Ping>(event.what);
  v1::GeodeticPoint& position = *ping.mutable_pose()->mutable_position();
  position.set_latitude_deg(from.latitude_deg);
  position.set_longitude_deg(from.longitude_deg);
  for (const Held& held : held_) {
    event.time = std::max(event.time, held.time);
    const map::NedPoint at = frame.ToNed(held.sounding.place);
    ping.add_range_m(static_cast<float>(std::hypot(at.north_m, at.east_m)));
    ping.add_bearing_deg(static_cast<float>(std::atan2(at.east_m, at.north_m) *
                                            kDegreesPerRadian));
    ping.add_depth_m(static_cast<float>(held.sounding.depth_m));
    ping.add_std_m(static_cast<float>(held.sounding.std_m));
  }
  *ping.mutable_time() = client::ToProto(event.time);
  held_.clear();
  return event;
}

}  // namespace fathom::feeder
