#include "sim_feeder/simulation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "client/proto_time.h"
#include "sim_feeder/run_command.h"
#include "tests/sim_feeder/plane_terrain.h"
#include "tests/testing/status_matchers.h"

namespace fathom::feeder {
namespace {

using ::fathom::testing::StatusIs;

double Rough(double north_m, double east_m) {
  return 25.0 + 5.0 * std::sin(north_m / 60.0) + 3.0 * std::cos(east_m / 45.0);
}

Scenario SmallScenario() {
  Scenario scenario;
  scenario.seed = 42;
  scenario.activity_id = "test";
  scenario.area = {.south_west = kTestOrigin,
                   .north_extent_m = 200.0,
                   .east_extent_m = 200.0,
                   .cell_size_m = 10.0};
  scenario.start_time = *ParseTime("2026-01-01T12:00:00Z");
  scenario.pings = 300;
  return scenario;
}

// Everything that a run sends, as bytes: pings and reports apart.
struct Bytes {
  std::string pings;
  std::string reports;
};

Bytes RunBytes(const Scenario& scenario) {
  const auto simulation = *Simulation::Create(scenario, MakePlaneSeabed(Rough));
  Bytes bytes;
  while (const auto message = simulation->Next()) {
    if (v1::Ping* const* ping = std::get_if<v1::Ping*>(&*message)) {
      bytes.pings += (*ping)->SerializeAsString();
    } else {
      bytes.reports +=
          std::get<v1::ContactReport*>(*message)->SerializeAsString();
    }
  }
  return bytes;
}

TEST(Simulation, SameSeedGivesTheSameBytes) {
  const Bytes first = RunBytes(SmallScenario());
  const Bytes second = RunBytes(SmallScenario());
  EXPECT_GT(first.pings.size(), 10'000u);
  EXPECT_GT(first.reports.size(), 1'000u);
  EXPECT_EQ(first.pings, second.pings);
  EXPECT_EQ(first.reports, second.reports);
}

TEST(Simulation, WaypointsAreGoneRoundWhileTheRunLasts) {
  Scenario scenario = SmallScenario();
  // 100 m out and 100 m back at 2 m/s, and two turns of 12 s: 124 s a round.
  scenario.waypoints = {{.place = {50, 50}}, {.place = {150, 50}}};
  scenario.ships = 0;
  scenario.scripted_ships = {{.id = "hunter", .start = {.east_m = -300}}};
  scenario.pursuits = {{.ship_id = "hunter", .speed_m_s = 6}};
  const auto simulation = *Simulation::Create(scenario, MakePlaneSeabed(Rough));
  EXPECT_GE(simulation->vehicle().duration_s(), 299.0);
  EXPECT_NEAR(simulation->vehicle().StateAt(50).north_m, 150.0, 1e-9);
  EXPECT_NEAR(simulation->vehicle().StateAt(112).north_m, 50.0, 1e-9);
  EXPECT_NEAR(simulation->vehicle().StateAt(174).north_m, 150.0, 1e-9);
  // The ship has caught up in 5 minutes; it lies where the vehicle was at its
  // last look but one at most: 20 s and 40 m.
  const PlanePoint ship = simulation->ships()[0].PlaceAt(250);
  const VehicleState vehicle = simulation->vehicle().StateAt(250);
  EXPECT_LE(
      std::hypot(ship.north_m - vehicle.north_m, ship.east_m - vehicle.east_m),
      40.0);
}

TEST(Simulation, OtherSeedGivesOtherBytes) {
  Scenario other = SmallScenario();
  other.seed = 43;
  EXPECT_NE(RunBytes(SmallScenario()).pings, RunBytes(other).pings);
  EXPECT_NE(RunBytes(SmallScenario()).reports, RunBytes(other).reports);
}

TEST(Simulation, ShipsDoNotChangeTheSonarsNoise) {
  Scenario without = SmallScenario();
  without.ships = 0;
  const Bytes bytes = RunBytes(without);
  EXPECT_EQ(bytes.pings, RunBytes(SmallScenario()).pings);
  EXPECT_TRUE(bytes.reports.empty());
}

TEST(Simulation, MessagesComeInOrderOfTimeAndAreComplete) {
  const Scenario scenario = SmallScenario();
  const auto simulation = *Simulation::Create(scenario, MakePlaneSeabed(Rough));
  Time before = scenario.start_time;
  std::uint64_t pings = 0;
  std::uint64_t heard = 0;
  std::uint64_t fixes = 0;
  while (const auto message = simulation->Next()) {
    Time time;
    if (v1::Ping* const* pointer = std::get_if<v1::Ping*>(&*message)) {
      const v1::Ping& ping = **pointer;
      ++pings;
      time = client::FromProto(ping.time());
      EXPECT_EQ(ping.activity_id(), "test");
      ASSERT_GT(ping.range_m_size(), 0);
      ASSERT_EQ(ping.bearing_deg_size(), ping.range_m_size());
      ASSERT_EQ(ping.depth_m_size(), ping.range_m_size());
      ASSERT_EQ(ping.std_m_size(), ping.range_m_size());
      for (int i = 0; i < ping.range_m_size(); ++i) {
        ASSERT_GE(ping.range_m(i), 0.0f);
        ASSERT_LE(std::abs(ping.bearing_deg(i)), 180.0f);
        // The seabed lies between 17 and 33 m; noise 0.3 m at most 6 sigma.
        ASSERT_GT(ping.depth_m(i), 15.0f);
        ASSERT_LT(ping.depth_m(i), 35.0f);
        ASSERT_GT(ping.std_m(i), 0.0f);
      }
    } else {
      const v1::ContactReport& report = *std::get<v1::ContactReport*>(*message);
      time = client::FromProto(report.time());
      ++(report.has_fix() ? fixes : heard);
      EXPECT_NE(report.contact_class(), v1::CONTACT_CLASS_UNSPECIFIED);
    }
    ASSERT_GE(time, before);
    before = time;
  }
  EXPECT_EQ(pings, 300u);
  // 299 s, three ships, every 10 s from turns of 0, 3.3 and 6.7 s: 30 each.
  EXPECT_EQ(heard, 90u);
  // Fixes every 300 s from half, two thirds and five sixths: one each.
  EXPECT_EQ(fixes, 3u);
}

// Reads a ping as a map does (eq. 4.1 to 4.4) and finds the seabed there.
TEST(Simulation, APingPutsDepthsWhereTheSeabedHasThem) {
  Scenario scenario = SmallScenario();
  scenario.sonar.beam_std_m = 0.0;
  scenario.sonar.sonar_cell_m = 1.0;
  scenario.pings = 50;
  const auto seabed = MakePlaneSeabed(Rough);
  const auto simulation = *Simulation::Create(scenario, seabed);
  const map::NedFrame frame(kTestOrigin);
  while (const auto message = simulation->Next()) {
    v1::Ping* const* pointer = std::get_if<v1::Ping*>(&*message);
    if (pointer == nullptr) continue;
    const v1::Ping& ping = **pointer;
    const map::GeodeticPoint position = {
        .latitude_deg = ping.pose().position().latitude_deg(),
        .longitude_deg = ping.pose().position().longitude_deg()};
    const map::NedPoint vehicle = frame.ToNed(position);
    const double course_rad =
        ping.pose().heading_deg() * std::numbers::pi / 180.0 +
        frame.NorthAzimuthRad(position);
    for (int i = 0; i < ping.range_m_size(); ++i) {
      const double theta =
          course_rad + ping.bearing_deg(i) * std::numbers::pi / 180.0;
      const double north_m =
          vehicle.north_m + ping.range_m(i) * std::cos(theta);
      const double east_m = vehicle.east_m + ping.range_m(i) * std::sin(theta);
      // Centres lie half a metre off whole ones (float: 1e-4 m).
      ASSERT_NEAR(north_m - std::floor(north_m), 0.5, 1e-3);
      ASSERT_NEAR(east_m - std::floor(east_m), 0.5, 1e-3);
      // The beam met the cell within 0.71 m of its centre; the seabed slopes
      // by 5/60 + 3/45 = 0.15 at most: 0.11 m.
      ASSERT_NEAR(ping.depth_m(i), *seabed->DepthAt(north_m, east_m), 0.11);
    }
  }
}

TEST(Simulation, TheFirstShipCrossesNearTheVehicle) {
  const auto simulation =
      *Simulation::Create(SmallScenario(), MakePlaneSeabed(Rough));
  const double crossing_s = 0.4 * simulation->duration_s();
  const VehicleState vehicle = simulation->vehicle().StateAt(crossing_s);
  const PlanePoint ship = simulation->ships()[0].PlaceAt(crossing_s);
  EXPECT_NEAR(
      std::hypot(ship.north_m - vehicle.north_m, ship.east_m - vehicle.east_m),
      120.0, 1e-6);
}

TEST(Simulation, TheLastShipIsNearTheAreaAtTheEnd) {
  const auto simulation =
      *Simulation::Create(SmallScenario(), MakePlaneSeabed(Rough));
  const PlanePoint ship =
      simulation->ships().back().PlaceAt(simulation->duration_s());
  // Within a fifth of its 200 m.
  EXPECT_GE(ship.north_m, -40.0);
  EXPECT_LE(ship.north_m, 240.0);
  EXPECT_GE(ship.east_m, -40.0);
  EXPECT_LE(ship.east_m, 240.0);
}

TEST(Simulation, CoversTheAreaOnceWhenNoNumberOfPingsIsGiven) {
  Scenario scenario = SmallScenario();
  scenario.pings = 0;
  const auto simulation = *Simulation::Create(scenario, MakePlaneSeabed(Rough));
  EXPECT_NEAR(simulation->duration_s(), simulation->vehicle().duration_s(),
              scenario.ping_interval_s);
}

TEST(Simulation, RefusesWhatItCannotSail) {
  Scenario scenario = SmallScenario();
  scenario.ping_interval_s = 0.0;
  EXPECT_THAT(Simulation::Create(scenario, MakePlaneSeabed(Rough)),
              StatusIs(absl::StatusCode::kInvalidArgument));
  scenario = SmallScenario();
  EXPECT_THAT(Simulation::Create(scenario, MakePlaneSeabed([](double, double) {
                                   return -1.0;
                                 })),
              StatusIs(absl::StatusCode::kNotFound));
}

// A sink that counts, and fails when told.
class CountingSink final : public MessageSink {
 public:
  absl::Status SendPing(v1::Ping&) override {
    ++pings;
    return pings == fail_at ? absl::UnavailableError("cut") : absl::OkStatus();
  }
  absl::Status SendReport(v1::ContactReport&) override {
    ++reports;
    return absl::OkStatus();
  }
  absl::Status Finish() override {
    finished = true;
    return absl::OkStatus();
  }
  SinkState State() const override {
    SinkState state;
    state.pings.durable_sequence = pings;
    state.reports.durable_sequence = reports;
    v1::RejectCount& reject = state.pings.rejects.emplace_back();
    reject.set_reason(v1::REJECT_REASON_OUTSIDE_AREA);
    reject.set_count(17);
    return state;
  }

  std::uint64_t pings = 0;
  std::uint64_t reports = 0;
  std::uint64_t fail_at = 0;
  bool finished = false;
};

TEST(DriveSurvey, SendsEverythingAndCountsAcksAndRejects) {
  const auto simulation =
      *Simulation::Create(SmallScenario(), MakePlaneSeabed(Rough));
  PreparedMessages messages(*simulation, 0);
  CountingSink sink;
  SurveyRecord record;
  FATHOM_ASSERT_OK(DriveSurvey(messages, sink, 0.0, false, nullptr, record));
  EXPECT_TRUE(sink.finished);
  EXPECT_EQ(record.pings, 300u);
  EXPECT_EQ(sink.pings, 300u);
  EXPECT_EQ(record.contact_reports, 93u);
  EXPECT_EQ(record.pings_durable, 300u);
  EXPECT_EQ(record.reports_durable, 93u);
  EXPECT_EQ(record.rejects.at("OUTSIDE_AREA"), 17u);
  EXPECT_GT(record.measurements, 3000u);
}

TEST(DriveSurvey, StopsAtTheStreamsError) {
  const auto simulation =
      *Simulation::Create(SmallScenario(), MakePlaneSeabed(Rough));
  PreparedMessages messages(*simulation, 0);
  CountingSink sink;
  sink.fail_at = 5;
  SurveyRecord record;
  EXPECT_THAT(DriveSurvey(messages, sink, 0.0, false, nullptr, record),
              StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_EQ(sink.pings, 5u);
  EXPECT_EQ(record.pings, 4u);
}

}  // namespace
}  // namespace fathom::feeder
