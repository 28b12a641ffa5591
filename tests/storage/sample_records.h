// Seeded events and map pieces for the tests of this room.

#ifndef FATHOM_TESTS_STORAGE_SAMPLE_RECORDS_H_
#define FATHOM_TESTS_STORAGE_SAMPLE_RECORDS_H_

#include <bit>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "storage/mission_records.h"

namespace fathom::storage {

inline MissionMetadata SampleMetadata() {
  return {.mission_id = "0123-abc",
          .name = "Woods Hole, second leg",
          .vertical_datum = "MLLW",
          .created = TimeFromUnixMicros(1'000'000'000'123'456),
          .root_south_west = {.latitude_deg = 41.0, .longitude_deg = -71.1},
          .root_north_west = {.latitude_deg = 41.7, .longitude_deg = -71.1},
          .min_cell_m = 10,
          .max_cells = 50'000'000,
          .tolerance_m = 0.5,
          .ageing_rate_m2_s = 1e-9,
          .max_contacts = 1000,
          .contact_filter = "four_state"};
}

// An area of 500 m x 500 m at 10 m around (41.5, -70.65).
inline map::StartActivity SampleStart(const std::string& id) {
  map::StartActivity start;
  start.id = {id};
  start.vehicle_id = "auv-1";
  start.start = TimeFromUnixMicros(1'000'000'100'000'000);
  start.options.south_west = {.latitude_deg = 41.5, .longitude_deg = -70.65};
  start.options.north_extent_m = 500;
  start.options.east_extent_m = 500;
  start.options.cell_size_m = 10;
  start.options.default_depth_m = 20.0f;
  start.options.default_std_m = 5.0f;
  return start;
}

// A ping of `beams` beams over -75..75 degrees from the middle of that area.
inline map::Ping SamplePing(std::mt19937& random, const std::string& activity,
                            int number, int beams = 101) {
  std::normal_distribution<float> noise(0.0f, 0.3f);
  map::Ping ping;
  ping.activity = {activity};
  ping.time = TimeFromUnixMicros(1'000'000'200'000'000 + number * 100'000ll);
  ping.pose = {.position = {.latitude_deg = 41.502 + 1e-7 * number,
                            .longitude_deg = -70.647},
               .depth_m = 3.0,
               .heading_deg = 0.01 * number,
               .position_std_m = 0.0};
  for (int i = 0; i < beams; ++i) {
    const float across = static_cast<float>(i) / 100.0f;
    ping.beams.push_back({.range_m = 60.0f + 40.0f * across + noise(random),
                          .bearing_rad = -1.309f + 2.618f * across,
                          .depth_m = 18.0f + 4.0f * across + noise(random),
                          .std_m = 0.3f});
  }
  return ping;
}

inline map::ContactReport SampleReport(int number, const std::string& contact) {
  map::ContactReport report;
  report.key = {.source = {"c4i"}, .contact = {contact}};
  report.contact_class = map::ContactClass::kVessel;
  report.time =
      TimeFromUnixMicros(1'000'000'200'000'000 + number * 1'000'000ll);
  report.observation =
      map::ContactFix{.position = {.latitude_deg = 41.51 + 1e-4 * number,
                                   .longitude_deg = -70.6},
                      .velocity_north_m_s = 3.0,
                      .velocity_east_m_s = -0.5};
  return report;
}

// Every field different, odd values included.
inline map::ContactPoint SampleContactPoint(int number) {
  map::ContactPoint point;
  point.contact_class = map::ContactClass::kSubmerged;
  point.status = map::ContactStatus::kActive;
  point.time = TimeFromUnixMicros(number);
  point.report_time = TimeFromUnixMicros(number + 1);
  point.track_start = TimeFromUnixMicros(-number);
  point.frame_origin = {.latitude_deg = 41.5 + number, .longitude_deg = -0.0};
  for (int i = 0; i < 4; ++i) {
    point.x(i) = 0.1 * number + i;
    for (int j = 0; j < 4; ++j) point.P(i, j) = 1.0 / (1 + i + j + number);
  }
  point.top_depth_m = 40.25;
  point.keel_depth_m = 60.5;
  point.depth_std_m = 1.0 / 3.0;
  point.radius_m = 60;
  point.report_count = std::numeric_limits<std::uint64_t>::max();
  return point;
}

// What was believed at a second after the first.
inline Time HistoryTime(int s) {
  return TimeFromUnixMicros(1'000'000'000'000'000 + s * 1'000'000ll);
}

inline ContactHistoryRow SampleHistoryRow(int s, std::uint64_t revision,
                                          bool revises = false) {
  ContactHistoryRow row{
      .revision = revision, .estimate = {}, .revises = revises};
  static_cast<map::ContactPoint&>(row.estimate) = SampleContactPoint(1);
  row.estimate.time = HistoryTime(s);
  return row;
}

}  // namespace fathom::storage

#endif  // FATHOM_TESTS_STORAGE_SAMPLE_RECORDS_H_
