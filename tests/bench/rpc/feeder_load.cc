// feeder_load: how fast the feeder is flat out (run --prepare-mib 256), beside
// a bare stream of 256 such pings again and again, both into the null server,
// turn by turn in one run; prints one JSON document. `live` is the feeder
// without preparation, `simulation_alone` without a server too.
//
// The scene: 1 km by 1 km of ripples 20 to 30 m deep, the 101 beams of the
// default sonar 15 m above them in cells of 1 m, so that almost every beam is a
// measurement of its own: the dearest pings that the sonar makes.
#include <CLI/CLI.hpp>
#include <cmath>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "base/status_macros.h"
#include "client/client.h"
#include "sim_feeder/message_sink.h"
#include "sim_feeder/run_command.h"
#include "sim_feeder/simulation.h"
#include "tests/bench/rpc/measure.h"
#include "tests/sim_feeder/plane_terrain.h"

namespace fathom::bench {
namespace {

using feeder::Simulation;

absl::StatusOr<std::unique_ptr<Simulation>> MakeSimulation(
    std::shared_ptr<const feeder::LocalTerrain> seabed, int round, int pings) {
  feeder::Scenario scenario;
  scenario.seed = static_cast<std::uint64_t>(round) + 1;
  scenario.activity_id = "bench";
  scenario.area = {.south_west = feeder::kTestOrigin,
                   .north_extent_m = 1000,
                   .east_extent_m = 1000,
                   .cell_size_m = 1};
  scenario.sonar.sonar_cell_m = 1;
  scenario.ships = 0;
  scenario.pings = static_cast<std::uint64_t>(pings);
  return Simulation::Create(scenario, std::move(seabed));
}

// Pings per second of the feeder's own loop into `sink`, to the last ack.
absl::StatusOr<double> Drive(Simulation& simulation, feeder::MessageSink& sink,
                             std::uint64_t prepare_bytes) {
  feeder::SurveyRecord record;
  feeder::PreparedMessages messages(simulation, prepare_bytes);
  FATHOM_RETURN_IF_ERROR(
      feeder::DriveSurvey(messages, sink, 0.0, false, nullptr, record));
  return static_cast<double>(record.pings) / record.seconds;
}

// The same of pings that are there already.
absl::StatusOr<double> SendMade(const client::Client& server,
                                std::vector<v1::Ping>& made, int round,
                                int pings) {
  FATHOM_ASSIGN_OR_RETURN(
      const auto stream,
      server.OpenPingStream({.source_id = "made-" + std::to_string(round)}));
  const auto start = SteadyClock::now();
  for (int i = 0; i < pings; ++i) {
    FATHOM_RETURN_IF_ERROR(
        stream->Send(made[static_cast<std::size_t>(i) % made.size()]).status());
  }
  FATHOM_RETURN_IF_ERROR(stream->Finish());
  return pings / SecondsSince(start);
}

absl::Status Run(const std::string& null, int rounds, int pings) {
  FATHOM_ASSIGN_OR_RETURN(const auto server, client::Client::Connect(null, {}));
  const auto seabed = feeder::MakePlaneSeabed(
      [](double north_m, double east_m) {
        return 25 + 5 * std::sin(north_m / 40) * std::cos(east_m / 30);
      },
      10.0, 1500.0);
  std::vector<v1::Ping> made;
  {
    FATHOM_ASSIGN_OR_RETURN(const auto simulation,
                            MakeSimulation(seabed, 0, 256));
    while (const auto message = simulation->Next()) {
      made.push_back(*std::get<v1::Ping*>(*message));
    }
  }
  double measurements = 0;
  for (const v1::Ping& ping : made) measurements += ping.range_m_size();
  const auto drive = [&](const std::string& name, int round,
                         std::uint64_t bytes) -> absl::StatusOr<double> {
    FATHOM_ASSIGN_OR_RETURN(const auto simulation,
                            MakeSimulation(seabed, round, pings));
    FATHOM_ASSIGN_OR_RETURN(
        const auto sink,
        feeder::StreamSink::Open(
            *server, {.source_id = name + "-" + std::to_string(round)}));
    return Drive(*simulation, *sink, bytes);
  };
  std::vector<double> ours, floor, ratios, live, alone;
  for (int round = 0; round <= rounds; ++round) {
    FATHOM_ASSIGN_OR_RETURN(const double a,
                            drive("prepared", round, 256u << 20));
    FATHOM_ASSIGN_OR_RETURN(const double b,
                            SendMade(*server, made, round, pings));
    FATHOM_ASSIGN_OR_RETURN(const double c, drive("live", round, 0));
    FATHOM_ASSIGN_OR_RETURN(const auto simulation,
                            MakeSimulation(seabed, round, pings));
    FATHOM_ASSIGN_OR_RETURN(const auto nowhere,
                            feeder::RecordSink::Open("", "", "feeder"));
    FATHOM_ASSIGN_OR_RETURN(const double d, Drive(*simulation, *nowhere, 0));
    if (round == 0) continue;  // Warms caches and connections.
    ours.push_back(a);
    floor.push_back(b);
    ratios.push_back(a / b);
    live.push_back(c);
    alone.push_back(d);
  }
  const nlohmann::json report = {
      {"feeder_flat_out_ratio",
       {{"ratio", Median(ratios)},
        {"feeder", Median(ours)},
        {"null", Median(floor)},
        {"unit", "pings/s"},
        {"ratios", ratios},
        {"live", Median(live)},
        {"simulation_alone", Median(alone)},
        {"measurements_per_ping",
         measurements / static_cast<double>(made.size())},
        {"rounds", rounds}}}};
  std::cout << report.dump(2) << "\n";
  return absl::OkStatus();
}

int Main(int argc, char** argv) {
  CLI::App app{"Measures the feeder flat out against a stream of made pings."};
  std::string null;
  int rounds = 5;
  int pings = 20'000;
  app.add_option("--null", null, "fathom-null-server, host:port")->required();
  app.add_option("--rounds", rounds, "Rounds")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--pings", pings, "Pings in each round")
      ->check(CLI::Range(100, 10'000'000))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return ExitCode("feeder_load", Run(null, rounds, pings));
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) { return fathom::bench::Main(argc, argv); }
