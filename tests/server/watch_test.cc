// The watches, driven by hand over random histories of a map: whenever one says
// that everything was told, what it told is the map.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/convert_common.h"
#include "server/watch_contacts.h"
#include "server/watch_region.h"
#include "server/watch_trajectory.h"
#include "tests/server/watched_map.h"
#include "tests/testing/fake_clock.h"
#include "tests/testing/status_matchers.h"

namespace fathom::server {
namespace {

using ::fathom::testing::FakeClock;
using ::fathom::testing::IsOk;

const std::atomic<bool> kNever{false};
constexpr SteadyTime kStart{std::chrono::hours(1)};

// All that a cell says but its age, bit for bit.
using Cell = std::vector<uint32_t>;
using Cells = std::map<std::pair<uint32_t, uint32_t>, Cell>;

void Lay(const v1::RegionTile& tile, Cells& cells) {
  for (uint32_t i = 0; i < tile.rows() * tile.columns(); ++i) {
    const int k = static_cast<int>(i);
    const auto word = [k](const auto& values) {
      return values.empty() ? 0x7fc00000u
                            : std::bit_cast<uint32_t>(values.Get(k));
    };
    cells[{tile.first_row() + i / tile.columns(),
           tile.first_column() + i % tile.columns()}] = {
        word(tile.depth_m()),
        word(tile.std_m()),
        word(tile.age_s()),
        word(tile.shoalest_m()),
        word(tile.hazard_m()),
        static_cast<uint32_t>(tile.kind()[i]),
        static_cast<uint32_t>(tile.layer()[i])};
  }
}

// What GetRegion answers from the log's view.
Cells RegionNow(const v1::GetRegionRequest& request, const ChangeLog& log,
                const Clock& clock) {
  Region region = *Region::Create(request, clock.Now());
  EXPECT_THAT(region.Open(log.view()), IsOk());
  Cells cells;
  v1::GetRegionResponse response;
  while (region.Next(kNever, &response) == Region::Step::kBlock) {
    Lay(response.tile(), cells);
  }
  return cells;
}

v1::WatchRegionRequest RegionRequest(double south, double west, double north,
                                     double east, double resolution_m) {
  v1::WatchRegionRequest request;
  v1::GetRegionRequest* region = request.mutable_region();
  region->mutable_south_west()->set_latitude_deg(south);
  region->mutable_south_west()->set_longitude_deg(west);
  region->mutable_north_east()->set_latitude_deg(north);
  region->mutable_north_east()->set_longitude_deg(east);
  region->set_resolution_m(resolution_m);
  return request;
}

// A client of a region watch.
class RegionClient {
 public:
  RegionClient(v1::WatchRegionRequest request, const ChangeLog& log,
               const Clock& clock)
      : request_(std::move(request)), log_(log), clock_(clock) {
    Connect();
  }
  void Connect() {
    watch_.emplace(*RegionWatch::Create(request_, log_, clock_));
  }
  // Cut, and on from the last progress.
  void Resume() {
    request_.set_from_revision(revision_);
    request_.set_run_id(run_);
    Connect();
  }
  // Takes one message; false if there is none.
  bool TakeOne() {
    v1::WatchRegionResponse response;
    const auto step = watch_->Next(now_, kNever, &response);
    EXPECT_THAT(step, IsOk());
    if (*step != WatchStep::kMessage) return false;
    EXPECT_GE(response.stamp().map_revision(), newest_stamp_);
    newest_stamp_ = response.stamp().map_revision();
    if (response.has_tile()) {
      Lay(response.tile(), cells_);
      tiles_ += 1;
    } else if (response.has_resync()) {
      cells_.clear();
      resyncs_.push_back(response.resync().updates_lost());
    } else {
      revision_ = response.stamp().map_revision();
      run_ = response.progress().run_id();
      EXPECT_EQ(cells_, RegionNow(request_.region(), log_, clock_));
      progresses_ += 1;
    }
    return true;
  }
  // Also what is told once a second only.
  void TakeAll() {
    now_ += kWatchProgressInterval;
    while (TakeOne()) {
    }
  }

  uint64_t revision() const { return revision_; }
  int tiles() const { return tiles_; }
  int progresses() const { return progresses_; }
  const std::vector<uint64_t>& resyncs() const { return resyncs_; }

 private:
  v1::WatchRegionRequest request_;
  const ChangeLog& log_;
  const Clock& clock_;
  std::optional<RegionWatch> watch_;
  Cells cells_;
  uint64_t newest_stamp_ = 0;
  SteadyTime now_ = kStart;
  uint64_t revision_ = 0;
  uint64_t run_ = 0;
  int tiles_ = 0;
  int progresses_ = 0;
  std::vector<uint64_t> resyncs_;
};

TEST(RegionWatch, StateAndChangesAreTheRegionAtEveryProgress) {
  const FakeClock clock(kWatchStart);
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    WatchedMap map(seed);
    // Finer and coarser than the map; the last has one cell for most of it.
    std::vector<RegionClient> clients;
    for (const double resolution_m : {9.0, 31.0, 400.0}) {
      clients.emplace_back(
          RegionRequest(41.4995, -71.4005, 41.507, -71.393, resolution_m),
          map.log(), clock);
    }
    for (int step = 0; step < 60; ++step) {
      for (uint64_t n = map.random()() % 3; n > 0; --n) map.Change();
      map.Show();
      for (RegionClient& client : clients) {
        // One that reads all, one that reads some, one that is cut.
        const double how = map.Unit();
        if (how < 0.3) {
          client.TakeAll();
        } else if (how < 0.9) {
          for (int n = 0; n < 20 && client.TakeOne(); ++n) {
          }
        } else if (client.revision() > 0) {
          client.Resume();
        }
      }
    }
    for (RegionClient& client : clients) {
      client.TakeAll();
      EXPECT_EQ(client.revision(), map.log().view()->revision()) << seed;
      EXPECT_EQ(client.resyncs().size(), 0u);
      EXPECT_GT(client.progresses(), 5);
    }
  }
}

TEST(RegionWatch, OneWhoLostChangesIsToldAndSentTheStateAnew) {
  const FakeClock clock(kWatchStart);
  WatchedMap map(3, {.most_areas = 4});
  map.Start();
  map.Show();
  RegionClient client(RegionRequest(41.4995, -71.4005, 41.507, -71.393, 20),
                      map.log(), clock);
  client.TakeAll();
  const uint64_t seen = client.revision();
  for (int n = 0; n < 30; ++n) {
    map.Ping();
    map.Show();
  }
  client.TakeAll();
  ASSERT_EQ(client.resyncs().size(), 1u);
  EXPECT_EQ(client.resyncs()[0], map.log().view()->revision() - seen);
  EXPECT_EQ(client.revision(), map.log().view()->revision());
}

TEST(RegionWatch, SeesAcrossTheAntimeridian) {
  const FakeClock clock(kWatchStart);
  map::MissionOptions options;
  options.global.root =
      *map::RootSquare::CenteredOn({10.5, 179.999}, 20 * 1852.0, 10);
  map::ObstacleMap map(options);
  ChangeLog log(kRun, {});
  log.Restart(map.View());
  RegionClient client(RegionRequest(10.49, 179.99, 10.51, -179.99, 40), log,
                      clock);
  client.TakeAll();
  const int state = client.tiles();
  for (const double longitude_deg : {179.995, -179.995}) {
    map::StartActivity start;
    start.id.value = longitude_deg > 0 ? "west" : "east";
    start.options.south_west = {10.5, longitude_deg};
    start.options.north_extent_m = 100;
    start.options.east_extent_m = 100;
    start.options.cell_size_m = 5;
    start.options.default_depth_m = 20;
    start.options.default_std_m = 2;
    ASSERT_THAT(map.Start(start), IsOk());
    log.Show(map.View());
    const int before = client.tiles();
    client.TakeAll();  // Holds the cells to the region.
    EXPECT_GT(client.tiles(), before);
    EXPECT_LT(client.tiles() - before, state / 2);
  }
}

TEST(RegionWatch, MoreAtOnceThanIsNotedSendsEverything) {
  const FakeClock clock(kWatchStart);
  WatchedMap map(5, {.most_areas_at_once = 3});
  map.Start();
  map.Show();
  RegionClient client(RegionRequest(41.4995, -71.4005, 41.507, -71.393, 20),
                      map.log(), clock);
  client.TakeAll();
  const int state = client.tiles();
  for (int n = 0; n < 30; ++n) map.Ping();
  map.Show();
  client.TakeAll();
  EXPECT_EQ(client.tiles(), 2 * state);
  EXPECT_TRUE(client.resyncs().empty());
}

// A client of a contacts watch.
class ContactsClient {
 public:
  explicit ContactsClient(const ChangeLog& log, bool batched = false)
      : log_(log) {
    request_.set_batched(batched);
    Connect();
  }
  void Connect() { watch_.emplace(request_, log_); }
  void Resume() {
    request_.set_from_revision(revision_);
    request_.set_run_id(run_);
    Connect();
  }
  bool TakeOne() {
    v1::WatchContactsResponse response;
    const auto step = watch_->Next(now_, kNever, &response);
    if (*step != WatchStep::kMessage) return false;
    messages_ += 1;
    if (response.has_estimate()) {
      EXPECT_FALSE(request_.batched());
      Take(response.estimate());
    } else if (response.has_resync()) {
      told_.clear();
      resyncs_ += 1;
    } else if (response.has_batch()) {
      EXPECT_TRUE(request_.batched());
      EXPECT_GT(response.batch().estimates_size(), 0);
      EXPECT_LE(response.batch().estimates_size(), 100);
      for (const auto& estimate : response.batch().estimates()) Take(estimate);
      if (response.batch().has_progress()) {
        TakeProgress(response.stamp(), response.batch().progress());
      }
    } else {
      TakeProgress(response.stamp(), response.progress());
    }
    return true;
  }
  // Also what is told once a second only.
  void TakeAll() {
    now_ += kWatchProgressInterval;
    while (TakeOne()) {
    }
  }
  int events() const { return events_; }
  int messages() const { return messages_; }
  int resyncs() const { return resyncs_; }
  uint64_t revision() const { return revision_; }

 private:
  void Take(const v1::ContactEstimate& estimate) {
    const std::string& id = estimate.contact_id();
    std::string words = estimate.SerializeAsString();
    // Nothing is told twice on one connection.
    EXPECT_NE(told_[id], words) << id;
    told_[id] = words;
    events_ += 1;
  }
  void TakeProgress(const v1::MapStamp& stamp,
                    const v1::WatchProgress& progress) {
    revision_ = stamp.map_revision();
    run_ = progress.run_id();
    EXPECT_EQ(told_, Now());
  }
  std::map<std::string, std::string> Now() const {
    std::map<std::string, std::string> now;
    log_.view()->contacts().ForEach([&](const map::Contact& contact) {
      v1::ContactEstimate estimate;
      WriteContact(contact.NewestEstimate(), &estimate);
      now[estimate.contact_id()] = estimate.SerializeAsString();
    });
    return now;
  }

  v1::WatchContactsRequest request_;
  const ChangeLog& log_;
  std::optional<ContactsWatch> watch_;
  std::map<std::string, std::string> told_;
  SteadyTime now_ = kStart;
  uint64_t revision_ = 0;
  uint64_t run_ = 0;
  int events_ = 0;
  int messages_ = 0;
  int resyncs_ = 0;
};

TEST(ContactsWatch, StateAndChangesAreTheListAndNothingIsToldTwice) {
  WatchedMap map(9);
  // More than one batch of names.
  for (int k = 0; k < 600; ++k) map.Report("ship" + std::to_string(k));
  map.Show();
  ContactsClient quick(map.log());
  ContactsClient slow(map.log());
  ContactsClient quick_batched(map.log(), /*batched=*/true);
  ContactsClient slow_batched(map.log(), /*batched=*/true);
  for (int step = 0; step < 4000; ++step) {
    map.Report("ship" + std::to_string(map.random()() % 700));
    if (step % 3 == 0) map.Show();
    quick.TakeAll();
    quick_batched.TakeAll();
    if (map.Unit() < 0.5) slow.TakeOne();
    if (map.Unit() < 0.02) slow_batched.TakeOne();
  }
  map.Show();
  for (ContactsClient* client :
       {&quick, &slow, &quick_batched, &slow_batched}) {
    client->TakeAll();
    EXPECT_EQ(client->revision(), map.log().view()->revision());
    EXPECT_EQ(client->resyncs(), 0);
  }
  // The slow ones were told less: changes coalesced.
  EXPECT_LT(slow.events(), quick.events());
  EXPECT_LT(slow_batched.events(), quick_batched.events());
  EXPECT_EQ(quick_batched.events(), quick.events());
}

TEST(ContactsWatch, ABatchHoldsAHundredAndSaysWhenItWasAll) {
  WatchedMap map(14);
  for (int k = 0; k < 250; ++k) map.Report("ship" + std::to_string(k));
  map.Show();
  ContactsClient client(map.log(), /*batched=*/true);
  client.TakeAll();
  // 100, 100 and 50, the last with the progress.
  EXPECT_EQ(client.messages(), 3);
  EXPECT_EQ(client.events(), 250);
  EXPECT_EQ(client.revision(), map.log().view()->revision());
  for (const int changed : {1, 100, 101}) {
    const int before = client.messages();
    for (int k = 0; k < changed; ++k) map.Report("ship" + std::to_string(k));
    map.Show();
    client.TakeAll();
    EXPECT_EQ(client.messages() - before, changed > 100 ? 2 : 1) << changed;
    EXPECT_EQ(client.revision(), map.log().view()->revision());
  }
}

TEST(ContactsWatch, AHotContactStarvesNobodyAndIsNotStarved) {
  WatchedMap map(10);
  for (int k = 0; k < 300; ++k) map.Report("ship" + std::to_string(k));
  map.Show();
  ContactsWatch watch({}, map.log());
  std::map<std::string, int> told;
  // Every contact changes between any two messages.
  for (int message = 0; message < 3000; ++message) {
    for (int k = message % 10; k < 300; k += 10) {
      map.Report("ship" + std::to_string(k));
    }
    map.Report("ship0");
    map.Show();
    v1::WatchContactsResponse response;
    ASSERT_EQ(*watch.Next(kStart, kNever, &response), WatchStep::kMessage);
    told[response.estimate().contact_id()] += 1;
  }
  EXPECT_EQ(told.size(), 300u);
  // 3000 messages over 300 contacts: ten each, were all alike.
  for (const auto& [id, times] : told) EXPECT_GE(times, 4) << id;
}

TEST(ContactsWatch, ResumesOrIsResynchronised) {
  WatchedMap map(12, {.most_contacts = 50});
  for (int k = 0; k < 40; ++k) map.Report("ship" + std::to_string(k));
  map.Show();
  ContactsClient client(map.log());
  client.TakeAll();
  EXPECT_EQ(client.events(), 40);
  for (int k = 0; k < 10; ++k) map.Report("ship" + std::to_string(k));
  map.Show();
  client.Resume();
  client.TakeAll();
  EXPECT_EQ(client.events(), 50);
  EXPECT_EQ(client.resyncs(), 0);
  // Fifty others change: the bound. One more, and he has lost it.
  for (int k = 100; k < 150; ++k) map.Report("ship" + std::to_string(k));
  map.Show();
  client.Resume();
  client.TakeAll();
  EXPECT_EQ(client.resyncs(), 0);
  EXPECT_EQ(client.events(), 100);
  for (int k = 0; k < 51; ++k) map.Report("tug" + std::to_string(k));
  map.Show();
  client.Resume();
  client.TakeAll();
  EXPECT_EQ(client.resyncs(), 1);
  // 40 + 50 + 51 contacts are the state.
  EXPECT_EQ(client.events(), 100 + 141);
}

TEST(ContactsWatch, NamesOfContactsLongGoneAreForgottenAndTheStateComesAnew) {
  WatchedMap map(13, {.most_names = 60});
  ContactsClient client(map.log());
  for (int k = 0; k < 60; ++k) map.Report("ship" + std::to_string(k));
  map.Show();
  client.TakeAll();
  EXPECT_EQ(client.resyncs(), 0);
  // None of the sixty is gone: as many names as there are contacts are kept.
  map.Report("ship60");
  map.Show();
  client.TakeAll();
  EXPECT_EQ(client.resyncs(), 0);
  EXPECT_EQ(client.events(), 61);
}

TEST(TrajectoryWatch, AlertsAreClearedWithHysteresis) {
  const auto verdict = [](double worst, bool conflict) {
    map::TrajectoryVerdict made;
    made.legs.resize(2);
    made.legs[0].worst_probability = 0.1;
    made.legs[1].worst_probability = worst;
    if (conflict) made.first_conflict.emplace();
    return made;
  };
  const auto stands = [&](double worst, bool conflict, bool stood) {
    return AlertStands(verdict(worst, conflict), 0.9, 0.25, stood);
  };
  EXPECT_TRUE(stands(0.9, true, false));
  EXPECT_FALSE(stands(0.89, false, false));
  // 0.9 - 0.25 = 0.65: above it the alert stands on.
  EXPECT_TRUE(stands(0.89, false, true));
  EXPECT_TRUE(stands(0.66, false, true));
  EXPECT_FALSE(stands(0.64, false, true));
  // A hazard or an unknown place is a conflict, however small P is.
  EXPECT_TRUE(stands(0.01, true, true));
  EXPECT_TRUE(stands(0.01, true, false));
}

v1::WatchTrajectoryRequest PathRequest() {
  v1::WatchTrajectoryRequest request;
  v1::Trajectory* trajectory = request.mutable_trajectory();
  trajectory->set_confidence(0.95);
  trajectory->set_radius_m(20);
  trajectory->set_treat_unknown_as(v1::UNKNOWN_TREATMENT_FREE);
  for (int k = 0; k < 2; ++k) {
    v1::Waypoint* waypoint = trajectory->add_waypoints();
    waypoint->mutable_position()->set_latitude_deg(41.503);
    waypoint->mutable_position()->set_longitude_deg(-71.3995 + 0.005 * k);
    waypoint->set_depth_m(10);
    waypoint->mutable_time()->set_seconds(kSampleSeconds + 100 * k);
  }
  return request;
}

TEST(TrajectoryWatch, ItsVerdictIsAlwaysTheOneOfTheNewestMap) {
  std::set<bool> alerts;
  for (uint64_t seed = 1; seed <= 2; ++seed) {
    WatchedMap map(seed);
    auto watch = TrajectoryWatch::Create(PathRequest(), map.log());
    ASSERT_THAT(watch, IsOk());
    SteadyTime now = kStart;
    std::string told;
    for (int step = 0; step < 80; ++step) {
      map.Change();
      map.Show();
      now += kWatchProgressInterval;
      v1::WatchTrajectoryResponse response;
      ASSERT_EQ(*watch->Next(now, kNever, &response), WatchStep::kMessage);
      if (response.has_verdict()) {
        response.mutable_verdict()->clear_stamp();
        told = response.verdict().SerializeAsString();
      }
      alerts.insert(response.alert());
      // A watch that begins now judges the map as it is.
      auto fresh = TrajectoryWatch::Create(PathRequest(), map.log());
      v1::WatchTrajectoryResponse expected;
      ASSERT_EQ(*fresh->Next(now, kNever, &expected), WatchStep::kMessage);
      expected.mutable_verdict()->clear_stamp();
      ASSERT_EQ(told, expected.verdict().SerializeAsString()) << seed << step;
      EXPECT_EQ(response.alert(), expected.alert());
      // Nothing changed since: silence.
      EXPECT_EQ(*watch->Next(now, kNever, &response), WatchStep::kIdle);
    }
  }
  EXPECT_EQ(alerts.size(), 2u) << "the histories never met the path";
}

TEST(TrajectoryWatch, TellsAlertsAtOnceAndOtherVerdictsOnceASecond) {
  WatchedMap map(1);
  map::RasterBlock chart = SampleChart();
  ASSERT_TRUE(map.map().Import(chart, true).ok());
  map.Show();
  auto watch = TrajectoryWatch::Create(PathRequest(), map.log());
  SteadyTime now = kStart;
  v1::WatchTrajectoryResponse response;
  const auto next = [&] { return *watch->Next(now, kNever, &response); };
  const auto raise = [&](float depth_m, float std_m) {
    chart.depth_m.assign(100, depth_m);
    chart.std_m = {std_m};
    ASSERT_TRUE(map.map().Import(chart, true).ok());
    map.Show();
  };
  ASSERT_EQ(next(), WatchStep::kMessage);
  EXPECT_FALSE(response.alert());
  // Shoaler, but safe: a verdict that waits for its second.
  raise(15, 0.5F);
  now += kTrajectoryInterval / 2;
  EXPECT_EQ(next(), WatchStep::kSoon);
  now += kTrajectoryInterval;
  EXPECT_EQ(next(), WatchStep::kIdle);
  now += kWatchProgressInterval;
  ASSERT_EQ(next(), WatchStep::kMessage);
  EXPECT_TRUE(response.has_verdict());
  EXPECT_FALSE(response.alert());
  // Not safe: at once.
  raise(9, 0.05F);
  now += kTrajectoryInterval;
  ASSERT_EQ(next(), WatchStep::kMessage);
  EXPECT_TRUE(response.alert());
  EXPECT_TRUE(response.verdict().has_first_conflict());
  EXPECT_EQ(response.stamp().map_revision(), map.map().revision());
}

}  // namespace
}  // namespace fathom::server
