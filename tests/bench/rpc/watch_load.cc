// watch_load: how long a change takes to those who watch.
//
//   watch_*   50 clients watch the contacts while 1000 reports a second about
//             100 contacts come in on one stream: from a report's sending
//             (which is its time) to its estimate's arrival, milliseconds
//   alert_*   one client watches a trajectory while all that goes on: from the
//             sending of the report that makes it unsafe to the alert, and from
//             the drop of that contact to its end
//
// Prints one JSON document. Clients and server share the machine.
#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "base/clock.h"
#include "base/mutex.h"
#include "base/status_macros.h"
#include "client/client.h"
#include "client/proto_time.h"
#include "tests/bench/rpc/bench_rpc_scene.h"
#include "tests/bench/rpc/measure.h"

namespace fathom::bench {
namespace {

using client::Client;

constexpr int kContacts = 100;

double Milliseconds(Duration span) {
  return static_cast<double>(span.count()) * 1e-3;
}

v1::ContactReport ReportOf(const std::string& contact, double latitude_deg,
                           double longitude_deg) {
  v1::ContactReport report;
  report.set_contact_id(contact);
  report.set_contact_class(v1::CONTACT_CLASS_VESSEL);
  *report.mutable_time() = client::ToProto(SystemClock().Now());
  report.mutable_fix()->mutable_position()->set_latitude_deg(latitude_deg);
  report.mutable_fix()->mutable_position()->set_longitude_deg(longitude_deg);
  return report;
}

// One who watches the contacts, on a thread and a connection of its own.
class Subscriber {
 public:
  explicit Subscriber(std::unique_ptr<Client> server)
      : server_(std::move(server)), watch_(server_->WatchContacts()) {
    thread_ = std::thread([this] { Run(); });
  }
  void Stop() {
    watch_->Cancel();
    thread_.join();
  }
  std::vector<double> latencies_ms;
  std::size_t resyncs = 0;
  // Events count from here on.
  static std::atomic<bool> counting;

 private:
  void Run() {
    const SystemClock clock;
    while (true) {
      const auto event = watch_->Next();
      if (!event.ok()) return;
      if (event->has_resync()) ++resyncs;
      if (!event->has_estimate() || !counting) continue;
      latencies_ms.push_back(Milliseconds(
          clock.Now() - client::FromProto(event->estimate().time())));
    }
  }

  std::unique_ptr<Client> server_;
  std::unique_ptr<client::ContactsWatch> watch_;
  std::thread thread_;
};
std::atomic<bool> Subscriber::counting{false};

// Reports until `stop`, `per_s` a second; counts them.
absl::Status Feed(const Client& server, int per_s,
                  const std::atomic<bool>& stop, std::uint64_t& sent) {
  FATHOM_ASSIGN_OR_RETURN(const auto stream,
                          server.OpenContactStream({.source_id = "feed"}));
  const auto start = SteadyClock::now();
  while (!stop) {
    v1::ContactReport report = ReportOf(
        "ship-" + std::to_string(sent % kContacts), kLatitudeDeg + 0.05,
        kLongitudeDeg + 1e-3 * static_cast<double>(sent % kContacts));
    FATHOM_RETURN_IF_ERROR(stream->Send(report).status());
    ++sent;
    std::this_thread::sleep_until(start + std::chrono::microseconds(1'000'000) *
                                              static_cast<std::int64_t>(sent) /
                                              per_s);
  }
  return stream->Finish();
}

// Across the surveyed area at 3 m depth within the next 20 s: a contact half
// way is predicted so far ahead with metres of uncertainty.
v1::WatchTrajectoryRequest Path() {
  v1::WatchTrajectoryRequest request;
  v1::Trajectory* trajectory = request.mutable_trajectory();
  trajectory->set_confidence(0.9);
  trajectory->set_radius_m(2);
  trajectory->set_treat_unknown_as(v1::UNKNOWN_TREATMENT_FREE);
  for (int k = 0; k <= 100; ++k) {
    v1::Waypoint* waypoint = trajectory->add_waypoints();
    waypoint->mutable_position()->set_latitude_deg(kLatitudeDeg + 0.004);
    waypoint->mutable_position()->set_longitude_deg(kLongitudeDeg + 1e-4 * k);
    waypoint->set_depth_m(3);
    *waypoint->mutable_time() = client::ToProto(
        SystemClock().Now() + std::chrono::milliseconds(200 * k));
  }
  return request;
}

// Waits until the alert stands, or not; milliseconds since `start`.
absl::StatusOr<double> AwaitAlert(client::TrajectoryWatch& watch, bool alert,
                                  SteadyClock::time_point start) {
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const auto event, watch.Next());
    if (event.alert() == alert) {
      return std::chrono::duration<double, std::milli>(SteadyClock::now() -
                                                       start)
          .count();
    }
  }
}

absl::Status Alerts(const Client& server, int rounds, nlohmann::json& report) {
  std::vector<double> raised_ms;
  std::vector<double> cleared_ms;
  for (int round = 0; round < rounds; ++round) {
    const auto watch = server.WatchTrajectory(Path());
    FATHOM_RETURN_IF_ERROR(
        AwaitAlert(*watch, false, SteadyClock::now()).status());
    const std::string contact = "intruder-" + std::to_string(round);
    v1::ReportContactsRequest reports;
    *reports.add_reports() =
        ReportOf(contact, kLatitudeDeg + 0.004, kLongitudeDeg + 5e-3);
    v1::ContactReport& intruder = *reports.mutable_reports(0);
    intruder.set_source_id("intruder");
    intruder.set_epoch(1);
    intruder.set_sequence(static_cast<std::uint64_t>(round) + 1);
    // Lies still, and well known.
    intruder.mutable_fix()->set_position_std_m(1);
    intruder.mutable_fix()->set_velocity_std_m_s(1e-3);
    const auto seen = SteadyClock::now();
    FATHOM_RETURN_IF_ERROR(server.ReportContacts(reports).status());
    FATHOM_ASSIGN_OR_RETURN(const double up, AwaitAlert(*watch, true, seen));
    raised_ms.push_back(up);
    v1::DropContactRequest drop;
    drop.set_source_id("intruder");
    drop.set_contact_id(contact);
    const auto dropped = SteadyClock::now();
    FATHOM_RETURN_IF_ERROR(server.DropContact(drop).status());
    FATHOM_ASSIGN_OR_RETURN(const double down,
                            AwaitAlert(*watch, false, dropped));
    cleared_ms.push_back(down);
  }
  report["alert_p50_ms"] = Quantile(raised_ms, 0.5);
  report["alert_worst_ms"] = Quantile(raised_ms, 1);
  report["alert_clear_worst_ms"] = Quantile(cleared_ms, 1);
  return absl::OkStatus();
}

absl::Status Run(const std::string& address, int subscribers, int per_s,
                 double seconds, int alerts) {
  FATHOM_ASSIGN_OR_RETURN(const auto server, Client::Connect(address, {}));
  FATHOM_RETURN_IF_ERROR(PrepareScene(*server, 500));
  std::vector<std::unique_ptr<Subscriber>> watching;
  for (int k = 0; k < subscribers; ++k) {
    FATHOM_ASSIGN_OR_RETURN(auto own, Client::Connect(address, {}));
    watching.push_back(std::make_unique<Subscriber>(std::move(own)));
  }
  std::atomic<bool> stop{false};
  std::uint64_t sent = 0;
  absl::Status fed;
  std::thread feed([&] { fed = Feed(*server, per_s, stop, sent); });
  std::this_thread::sleep_for(std::chrono::seconds(1));
  nlohmann::json report;
  Subscriber::counting = true;
  const auto start = SteadyClock::now();
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  Subscriber::counting = false;
  const double took_s =
      std::chrono::duration<double>(SteadyClock::now() - start).count();
  const absl::Status alerted = Alerts(*server, alerts, report);
  stop = true;
  feed.join();
  std::vector<double> all_ms;
  std::size_t resyncs = 0;
  for (const auto& subscriber : watching) {
    subscriber->Stop();
    resyncs += subscriber->resyncs;
    all_ms.insert(all_ms.end(), subscriber->latencies_ms.begin(),
                  subscriber->latencies_ms.end());
  }
  FATHOM_RETURN_IF_ERROR(fed);
  FATHOM_RETURN_IF_ERROR(alerted);
  report["watch_p50_ms"] = Quantile(all_ms, 0.5);
  report["watch_p99_ms"] = Quantile(all_ms, 0.99);
  report["watch_worst_ms"] = Quantile(all_ms, 1);
  report["watch_events_per_s"] = static_cast<double>(all_ms.size()) / took_s;
  report["reports_per_s"] = per_s;
  report["subscribers"] = subscribers;
  report["resyncs"] = resyncs;
  std::cout << report.dump() << "\n";
  return absl::OkStatus();
}

int Main(int argc, char** argv) {
  CLI::App app{"Measures how long a change takes to those who watch."};
  std::string server;
  int subscribers = 50;
  int per_s = 1000;
  double seconds = 5;
  int alerts = 30;
  app.add_option("--server", server, "fathomd, host:port")->required();
  app.add_option("--subscribers", subscribers, "Who watch the contacts")
      ->check(CLI::Range(1, 200))
      ->capture_default_str();
  app.add_option("--reports-per-s", per_s, "Reports of contacts")
      ->check(CLI::Range(1, 100'000))
      ->capture_default_str();
  app.add_option("--seconds", seconds, "How long events are counted")
      ->capture_default_str();
  app.add_option("--alerts", alerts, "Alerts that are raised and cleared")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return ExitCode("watch_load",
                  Run(server, subscribers, per_s, seconds, alerts));
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) { return fathom::bench::Main(argc, argv); }
