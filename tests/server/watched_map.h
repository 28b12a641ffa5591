// A map that changes at random in every way a map can change, with the log
// that watches it: what the tests of the watches are driven by.

#ifndef FATHOM_TESTS_SERVER_WATCHED_MAP_H_
#define FATHOM_TESTS_SERVER_WATCHED_MAP_H_

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "map/obstacle_map/obstacle_map.h"
#include "server/change_log.h"
#include "tests/server/sample_map.h"
#include "tests/server/sample_messages.h"

namespace fathom::server {

inline constexpr uint64_t kRun = 77;
inline constexpr Time kWatchStart =
    TimeFromUnixMicros(kSampleSeconds * 1'000'000);

// See file comment. Not thread-safe.
class WatchedMap {
 public:
  explicit WatchedMap(uint64_t seed, ChangeLogOptions options = {})
      : map_(SampleOptions()), log_(kRun, options), random_(seed) {
    log_.Restart(map_.View());
  }

  map::ObstacleMap& map() { return map_; }
  const ChangeLog& log() const { return log_; }
  std::mt19937_64& random() { return random_; }
  double Unit() {
    return std::uniform_real_distribution<double>(0, 1)(random_);
  }

  // Shows the log the map as it is.
  void Show() { log_.Show(map_.View()); }

  // A new activity of 200 to 600 m somewhere about (41.502, -71.398).
  void Start() {
    map::StartActivity start;
    start.id.value = "leg-" + std::to_string(++activities_);
    start.options.south_west = {41.5 + 0.003 * Unit(), -71.4 + 0.003 * Unit()};
    start.options.north_extent_m = 200 + 400 * Unit();
    start.options.east_extent_m = 200 + 400 * Unit();
    start.options.cell_size_m = 2 + 10 * Unit();
    constexpr map::EstimatorKind kKinds[] = {map::EstimatorKind::kNervegna,
                                             map::EstimatorKind::kKalman,
                                             map::EstimatorKind::kAdaptive};
    start.options.estimator = kKinds[random_() % 3];
    if (Unit() < 0.7) {
      start.options.smoothing_distance_m =
          start.options.cell_size_m * 12 * Unit();
      start.options.smoothing_scale = 0.9;
    }
    if (Unit() < 0.3) {
      start.options.default_depth_m = 25;
      start.options.default_std_m = 5;
    }
    if (map_.Start(start).ok()) open_.push_back(start.id);
  }

  void Ping() {
    if (open_.empty()) return Start();
    map::Ping ping;
    ping.activity = open_[random_() % open_.size()];
    ping.time = kWatchStart + Duration(static_cast<int64_t>(1e6 * Unit()));
    ping.pose.position = {41.5 + 0.006 * Unit(), -71.4 + 0.006 * Unit()};
    for (int beam = 0; beam < 15; ++beam) {
      ping.beams.push_back(
          {.range_m = static_cast<float>(2 + 100 * Unit()),
           .bearing_rad = static_cast<float>(6.28 * Unit()),
           .depth_m = static_cast<float>(Unit() < 0.1 ? 3 : 18 + 4 * Unit()),
           .std_m = 0.3F});
    }
    EXPECT_TRUE(map_.ApplyPing(ping).ok());
  }

  void Report(const std::string& contact) {
    map::ContactReport report;
    report.key = {.source = {"ais"}, .contact = {contact}};
    report.contact_class = map::ContactClass::kVessel;
    report.time = kWatchStart + Duration(1'000'000 * ++reports_);
    // Lies still but for some decimetres, so that no report is gated: a gated
    // one is noted with the contact, which then is told anew as it was.
    report.observation = map::ContactFix{
        .position = {41.503 + 1e-6 * Unit(),
                     -71.4 + 1e-5 * static_cast<double>(contact.size()) +
                         1e-6 * Unit()}};
    map_.ApplyContact(report);
  }

  // Any change; now and then a great one. Shows nothing.
  void Change() {
    const double what = Unit();
    if (what < 0.6) {
      Ping();
    } else if (what < 0.8) {
      Report("ship" + std::to_string(random_() % 20));
    } else if (what < 0.86) {
      Start();
    } else if (what < 0.9) {
      map::RasterBlock chart = SampleChart();
      chart.north_west = {41.5 + 0.008 * Unit(), -71.402 + 0.008 * Unit()};
      chart.rows = chart.columns = 3;
      chart.depth_m.assign(9, static_cast<float>(15 + 10 * Unit()));
      EXPECT_TRUE(map_.Import(chart, /*last=*/Unit() < 0.5).ok());
    } else if (!open_.empty()) {
      const size_t which = random_() % open_.size();
      const map::ActivityId id = open_[which];
      if (what < 0.95) {
        EXPECT_TRUE(map_.Transfer(id).ok());
      } else {
        EXPECT_TRUE(map_.Complete(id, /*discard=*/Unit() < 0.3).ok());
        open_.erase(open_.begin() + static_cast<std::ptrdiff_t>(which));
      }
    }
  }

 private:
  map::ObstacleMap map_;
  ChangeLog log_;
  std::mt19937_64 random_;
  std::vector<map::ActivityId> open_;
  int activities_ = 0;
  int64_t reports_ = 0;
};

}  // namespace fathom::server

#endif  // FATHOM_TESTS_SERVER_WATCHED_MAP_H_
