// Messages for the keeper's tests: one activity, pings into its middle and
// fixes of ships, each determined by its number.

#ifndef FATHOM_TESTS_SERVER_KEEPER_MESSAGES_H_
#define FATHOM_TESTS_SERVER_KEEPER_MESSAGES_H_

#include <cstdint>
#include <string>
#include <utility>

#include "base/time.h"
#include "map/obstacle_map/events.h"
#include "server/ingest.h"

namespace fathom::server {

inline constexpr Time kStart = TimeFromUnixMicros(1'022'198'400'000'000);
inline const map::ActivityId kLeg = {"leg-1"};
// In the middle of the activity's area.
inline constexpr map::GeodeticPoint kMiddle = {41.502, -71.397};

inline map::StartActivity Leg() {
  map::StartActivity event;
  event.id = kLeg;
  event.start = kStart;
  event.options.south_west = {41.5, -71.4};
  event.options.north_extent_m = 500;
  event.options.east_extent_m = 500;
  event.options.cell_size_m = 5;
  return event;
}

inline IngestMessage PingMessage(uint64_t sequence,
                                 std::string source = "auv-1",
                                 uint64_t epoch = 1) {
  map::Ping ping;
  ping.activity = kLeg;
  ping.time = kStart + Duration(static_cast<int64_t>(sequence) * 1000);
  ping.pose.position = kMiddle;
  for (int i = 0; i < 11; ++i) {
    ping.beams.push_back(
        {.range_m = 50.0F + 3.0F * static_cast<float>(sequence % 30),
         .bearing_rad = 0.2F * static_cast<float>(i - 5),
         .depth_m = 20.0F + 0.1F * static_cast<float>(i),
         .std_m = 0.5F});
  }
  return {.kind = StreamKind::kPings,
          .source = {std::move(source)},
          .number = {epoch, sequence},
          .content = std::move(ping)};
}

inline IngestMessage FixMessage(uint64_t sequence, const std::string& contact) {
  map::ContactReport report;
  report.key = {.source = {"ais"}, .contact = {contact}};
  report.contact_class = map::ContactClass::kVessel;
  report.time = kStart + Duration(static_cast<int64_t>(sequence) * 1'000'000);
  report.observation =
      map::ContactFix{.position = {41.5, -71.4}, .velocity_north_m_s = 3};
  return {.kind = StreamKind::kContacts,
          .source = {"ais"},
          .number = {1, sequence},
          .content = std::move(report)};
}

}  // namespace fathom::server

#endif  // FATHOM_TESTS_SERVER_KEEPER_MESSAGES_H_
