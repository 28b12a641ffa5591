// bench_rpc: the same calls to fathomd and to the null server, turn by turn in
// one run; prints one JSON document with the raw figures and their ratios.
//
// Each figure is the median over rounds, and each ratio the median of the
// rounds' ratios: a machine that slows down slows both sides of a round.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <functional>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "base/status_macros.h"
#include "client/client.h"
#include "tests/bench/rpc/bench_rpc_scene.h"
#include "tests/bench/rpc/measure.h"

namespace fathom::bench {
namespace {

using client::Client;

constexpr int kUnaryCallsPerRound = 1000;
constexpr int kRateThreads = 4;
constexpr int kRateCallsPerThread = 2000;
constexpr int kPlacesAhead = 16;
constexpr int kBatchPoints = 1000;
constexpr int kBatchesPerRound = 200;

// What one side of one round yields: a duration or a rate.
using Measure = std::function<absl::StatusOr<double>(const Client&, int round)>;

// Median latency of one caller, microseconds.
absl::StatusOr<double> UnaryP50Us(const Client& server, int round) {
  std::mt19937_64 random(static_cast<uint64_t>(round));
  v1::QueryObstacleRequest query;
  FillQuery(random, query);
  std::vector<double> times_us;
  times_us.reserve(kUnaryCallsPerRound);
  for (int i = 0; i < kUnaryCallsPerRound; ++i) {
    const auto start = SteadyClock::now();
    FATHOM_RETURN_IF_ERROR(server.QueryObstacle(query).status());
    times_us.push_back(SecondsSince(start) * 1e6);
  }
  return Median(std::move(times_us));
}

// Median latency of a planner in a loop, microseconds: it asks about the places
// ahead of it, goes to the freest, and asks again from there; one connection,
// each question behind the answer to the last.
absl::StatusOr<double> PlannerP50Us(const Client& server, int round) {
  std::mt19937_64 random(static_cast<uint64_t>(round));
  v1::QueryObstaclesRequest ahead;
  FillBatch(random, kPlacesAhead, ahead);
  std::vector<double> times_us;
  times_us.reserve(kUnaryCallsPerRound);
  for (int i = 0; i < kUnaryCallsPerRound; ++i) {
    const auto start = SteadyClock::now();
    FATHOM_ASSIGN_OR_RETURN(const v1::QueryObstaclesResponse answers,
                            server.QueryObstacles(ahead));
    times_us.push_back(SecondsSince(start) * 1e6);
    const auto freest = std::min_element(answers.probability().begin(),
                                         answers.probability().end());
    const auto chosen =
        static_cast<int>(freest - answers.probability().begin());
    MoveBatch(random, chosen, ahead);
  }
  return Median(std::move(times_us));
}

// Calls per second of several callers on one channel.
absl::StatusOr<double> UnaryRate(const Client& server, int round) {
  std::vector<absl::Status> results(kRateThreads);
  const auto start = SteadyClock::now();
  std::vector<std::thread> callers;
  for (int t = 0; t < kRateThreads; ++t) {
    callers.emplace_back([&server, &results, round, t] {
      std::mt19937_64 random(static_cast<uint64_t>(round * kRateThreads + t));
      v1::QueryObstacleRequest query;
      FillQuery(random, query);
      absl::Status& result = results[static_cast<size_t>(t)];
      for (int i = 0; i < kRateCallsPerThread && result.ok(); ++i) {
        result.Update(server.QueryObstacle(query).status());
      }
    });
  }
  for (std::thread& caller : callers) {
    caller.join();
  }
  const double seconds = SecondsSince(start);
  for (const absl::Status& result : results) {
    FATHOM_RETURN_IF_ERROR(result);
  }
  return kRateThreads * kRateCallsPerThread / seconds;
}

// Points per second in batches, one caller.
absl::StatusOr<double> BatchPoints(const Client& server, int round) {
  std::mt19937_64 random(static_cast<uint64_t>(round));
  v1::QueryObstaclesRequest batch;
  FillBatch(random, kBatchPoints, batch);
  const auto start = SteadyClock::now();
  for (int i = 0; i < kBatchesPerRound; ++i) {
    FATHOM_RETURN_IF_ERROR(server.QueryObstacles(batch).status());
  }
  return kBatchPoints * kBatchesPerRound / SecondsSince(start);
}

// Pings per second until all are durable, one stream.
absl::StatusOr<double> IngestPings(const Client& server, int round, int pings) {
  std::mt19937_64 random(static_cast<uint64_t>(round));
  std::vector<v1::Ping> distinct(256);
  for (v1::Ping& ping : distinct) {
    FillPing(random, ping);
  }
  FATHOM_ASSIGN_OR_RETURN(
      const auto stream,
      server.OpenPingStream({.source_id = "round-" + std::to_string(round)}));
  const auto start = SteadyClock::now();
  for (int i = 0; i < pings; ++i) {
    FATHOM_RETURN_IF_ERROR(
        stream->Send(distinct[static_cast<size_t>(i) % distinct.size()])
            .status());
  }
  FATHOM_RETURN_IF_ERROR(stream->Finish());
  return pings / SecondsSince(start);
}

// Contact reports per second until all are durable, one stream: ranges and
// bearings of kContacts vessels, each once a second.
absl::StatusOr<double> IngestContacts(const Client& server, int round,
                                      int reports) {
  constexpr int kContacts = 100;
  std::mt19937_64 random(static_cast<uint64_t>(round));
  std::vector<v1::ContactReport> distinct(1000);
  for (size_t i = 0; i < distinct.size(); ++i) {
    FillReport(random, static_cast<int>(i) % kContacts, distinct[i]);
  }
  FATHOM_ASSIGN_OR_RETURN(
      const auto stream,
      server.OpenContactStream({.source_id = "contacts",
                                .epoch = static_cast<uint64_t>(round) + 1}));
  const int64_t begin_s =
      distinct[0].time().seconds() + round * (reports / kContacts + 1);
  const auto start = SteadyClock::now();
  for (int i = 0; i < reports; ++i) {
    v1::ContactReport& report =
        distinct[static_cast<size_t>(i) % distinct.size()];
    report.mutable_time()->set_seconds(begin_s + i / kContacts);
    FATHOM_RETURN_IF_ERROR(stream->Send(report).status());
  }
  FATHOM_RETURN_IF_ERROR(stream->Finish());
  return reports / SecondsSince(start);
}

// Runs `measure` against both sides in turn and reports medians.
absl::Status Compare(const Client& fathom, const Client& null, int rounds,
                     const std::string& key, const std::string& unit,
                     const Measure& measure, nlohmann::json& report) {
  std::vector<double> ours, floor, ratios;
  for (int round = 0; round <= rounds; ++round) {
    FATHOM_ASSIGN_OR_RETURN(const double a, measure(fathom, round));
    FATHOM_ASSIGN_OR_RETURN(const double b, measure(null, round));
    if (round == 0) {
      continue;  // Warms caches and connections.
    }
    ours.push_back(a);
    floor.push_back(b);
    ratios.push_back(a / b);
  }
  report[key] = {{"ratio", Median(ratios)},
                 {"fathomd", Median(ours)},
                 {"null", Median(floor)},
                 {"unit", unit},
                 {"rounds", rounds}};
  return absl::OkStatus();
}

// `only`: the one key to measure; empty: all.
absl::Status Run(const std::string& server, const std::string& null, int rounds,
                 int pings, const std::string& only) {
  FATHOM_ASSIGN_OR_RETURN(const auto fathom, Client::Connect(server, {}));
  FATHOM_ASSIGN_OR_RETURN(const auto floor, Client::Connect(null, {}));
  FATHOM_RETURN_IF_ERROR(PrepareScene(*fathom, 2000));
  nlohmann::json report;
  const auto compare = [&](const std::string& key, const std::string& unit,
                           const Measure& measure) {
    if (!only.empty() && only != key) return absl::OkStatus();
    return Compare(*fathom, *floor, rounds, key, unit, measure, report);
  };
  FATHOM_RETURN_IF_ERROR(compare("unary_p50_ratio", "us", UnaryP50Us));
  FATHOM_RETURN_IF_ERROR(compare("unary_rate_ratio", "calls/s", UnaryRate));
  FATHOM_RETURN_IF_ERROR(compare("planner_p50_ratio", "us", PlannerP50Us));
  FATHOM_RETURN_IF_ERROR(
      compare("batch_points_ratio", "points/s", BatchPoints));
  FATHOM_RETURN_IF_ERROR(compare("ingest_pings_ratio", "pings/s",
                                 [pings](const Client& side, int round) {
                                   return IngestPings(side, round, pings);
                                 }));
  FATHOM_RETURN_IF_ERROR(compare("ingest_contacts_ratio", "reports/s",
                                 [pings](const Client& side, int round) {
                                   return IngestContacts(side, round, pings);
                                 }));
  std::cout << report.dump(2) << "\n";
  return absl::OkStatus();
}

int Main(int argc, char** argv) {
  CLI::App app{"Measures RPCs to fathomd against a null server."};
  std::string server;
  std::string null;
  int rounds = 5;
  int pings = 20'000;
  std::string only;
  app.add_option("--server", server, "fathomd, host:port")->required();
  app.add_option("--null", null, "fathom-null-server, host:port")->required();
  app.add_option("--rounds", rounds, "Rounds of each measure")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--pings", pings,
                 "Pings, and contact reports, in each round of ingest")
      ->check(CLI::Range(100, 10'000'000))
      ->capture_default_str();
  app.add_option("--only", only, "Measure this key alone");
  CLI11_PARSE(app, argc, argv);
  return ExitCode("bench_rpc", Run(server, null, rounds, pings, only));
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) { return fathom::bench::Main(argc, argv); }
