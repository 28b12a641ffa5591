// mixed_load: a live fathomd under everything at once, window by window.
//
// Each window first asks alone (idle), then asks the same while one stream
// ingests pings, another reports contacts, and every second a transfer writes
// a checkpoint. One JSON document a window on a line of its own:
//
//   idle_p50_us idle_p99_us    of QueryObstacle, one caller, nothing else
//   query_p50_us query_p99_us  the same under the load
//   ack_p50_ms ack_p99_ms      from a ping's sending to its durable ack
//   pings_per_s reports_per_s transfers
//
// With --null the null server (null_server.cc) is then asked alone and beside
// one stream of pings at the rate that fathomd reached: what the same stream
// costs a question where nothing is done with it, on the same cores in the same
// minute.
//
//   null_idle_p50_us null_idle_p99_us null_query_p50_us null_query_p99_us
//   null_pings_per_s
//
// The caller waits a millisecond between questions, as a planner does: it
// measures latency, not how fast it can load the server itself.
#include <grpcpp/grpcpp.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <deque>
#include <iostream>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "base/status_macros.h"
#include "client/client.h"
#include "fathom/v1/ingest_service.grpc.pb.h"
#include "tests/bench/rpc/bench_rpc_scene.h"
#include "tests/bench/rpc/measure.h"

namespace fathom::bench {
namespace {

using Seconds = std::chrono::duration<double>;

// Of a window's parts.
struct Lengths {
  double idle_s = 2;
  double loaded_s = 5;
  double null_loaded_s = 0;  // 0: as loaded_s.
};

// Latencies of questions for `seconds`, microseconds.
absl::StatusOr<std::vector<double>> AskFor(const client::Client& server,
                                           double seconds) {
  std::mt19937_64 random(7);
  v1::QueryObstacleRequest query;
  std::vector<double> times_us;
  const auto start = SteadyClock::now();
  while (SecondsSince(start) < seconds) {
    FillQuery(random, query);
    const auto asked = SteadyClock::now();
    FATHOM_RETURN_IF_ERROR(server.QueryObstacle(query).status());
    times_us.push_back(SecondsSince(asked) * 1e6);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return times_us;
}

// One ping stream at a steady rate, or as fast as the server takes it.
class PingLoad {
 public:
  // `rate` 0: as fast as it goes, with at most `kMostWaiting` not durable.
  PingLoad(const std::shared_ptr<grpc::Channel>& channel, double rate,
           std::uint64_t epoch)
      : stub_(v1::IngestService::NewStub(channel)), rate_(rate), epoch_(epoch) {
    writer_ = std::thread([this] { Write(); });
  }
  ~PingLoad() { Stop(); }

  // Ends the stream; all that was sent is durable then.
  void Stop() {
    stop_ = true;
    if (writer_.joinable()) writer_.join();
  }

  // After Stop.
  std::vector<double>& ack_ms() { return ack_ms_; }
  std::uint64_t sent() const { return sent_; }
  // How the stream ended.
  absl::Status End() const {
    if (status_.ok()) return absl::OkStatus();
    return absl::InternalError("pings: " + status_.error_message());
  }

 private:
  // About what a quick stream has under way between two commits; more would
  // measure our own queue.
  static constexpr std::size_t kMostWaiting = 1000;

  void Write() {
    grpc::ClientContext context;
    const auto stream = stub_->StreamPings(&context);
    std::thread reader([this, &stream] { Read(*stream); });
    std::mt19937_64 random(epoch_);
    std::vector<v1::StreamPingsRequest> distinct(64);
    for (auto& request : distinct) {
      FillPing(random, *request.mutable_ping());
      request.mutable_ping()->set_source_id("mixed");
      request.mutable_ping()->set_epoch(epoch_);
    }
    const auto start = SteadyClock::now();
    while (!stop_) {
      if (rate_ > 0) {
        std::this_thread::sleep_until(
            start + std::chrono::duration_cast<SteadyClock::duration>(
                        Seconds(static_cast<double>(sent_) / rate_)));
      } else if (Waiting() >= kMostWaiting) {
        std::this_thread::sleep_for(std::chrono::microseconds(200));
        continue;
      }
      v1::StreamPingsRequest& request = distinct[sent_ % distinct.size()];
      request.mutable_ping()->set_sequence(sent_ + 1);
      {
        const std::lock_guard lock(mutex_);
        waiting_.emplace_back(sent_ + 1, SteadyClock::now());
      }
      if (!stream->Write(request)) break;
      ++sent_;
    }
    stream->WritesDone();
    reader.join();
    status_ = stream->Finish();
  }

  std::size_t Waiting() {
    const std::lock_guard lock(mutex_);
    return waiting_.size();
  }

  void Read(grpc::ClientReaderWriter<v1::StreamPingsRequest,
                                     v1::StreamPingsResponse>& stream) {
    v1::StreamPingsResponse ack;
    while (stream.Read(&ack)) {
      const auto now = SteadyClock::now();
      const std::lock_guard lock(mutex_);
      while (!waiting_.empty() &&
             waiting_.front().first <= ack.durable_sequence()) {
        ack_ms_.push_back(Seconds(now - waiting_.front().second).count() * 1e3);
        waiting_.pop_front();
      }
    }
  }

  const std::unique_ptr<v1::IngestService::Stub> stub_;
  const double rate_;
  const std::uint64_t epoch_;
  std::atomic<bool> stop_{false};
  std::mutex mutex_;
  // Sent, not yet durable: number and when.
  std::deque<std::pair<std::uint64_t, SteadyClock::time_point>> waiting_;
  std::vector<double> ack_ms_;
  std::uint64_t sent_ = 0;
  grpc::Status status_;
  std::thread writer_;
};

// Contact reports and transfers until told to stop.
class SideLoad {
 public:
  SideLoad(const client::Client& server, const client::Client& other,
           std::uint64_t epoch)
      : reports_([this, &server, epoch] { Report(server, epoch); }),
        transfers_([this, &other] { Transfer(other); }) {}

  absl::Status Stop() {
    stop_ = true;
    reports_.join();
    transfers_.join();
    report_status_.Update(transfer_status_);
    return report_status_;
  }
  std::uint64_t reports() const { return reported_; }
  int transfers() const { return transferred_; }

 private:
  void Report(const client::Client& server, std::uint64_t epoch) {
    constexpr int kContacts = 50;
    constexpr std::chrono::milliseconds kBetween{20};
    std::uint64_t sequence = 0;
    while (!stop_ && report_status_.ok()) {
      v1::ReportContactsRequest request;
      for (int i = 0; i < 10; ++i) {
        v1::ContactReport& report = *request.add_reports();
        report.set_source_id("mixed");
        report.set_epoch(epoch);
        report.set_sequence(++sequence);
        report.set_contact_id("ship-" + std::to_string(sequence % kContacts));
        report.set_contact_class(v1::CONTACT_CLASS_VESSEL);
        // Since 2026-01-01; later in each window, so that none is late.
        report.mutable_time()->set_seconds(
            1'767'225'600 + static_cast<std::int64_t>(10 * epoch) +
            static_cast<std::int64_t>(sequence / kContacts));
        v1::GeodeticPoint& place = *report.mutable_fix()->mutable_position();
        place.set_latitude_deg(kLatitudeDeg +
                               1e-5 * static_cast<double>(sequence % 5000));
        place.set_longitude_deg(kLongitudeDeg);
        report.mutable_fix()->set_velocity_north_m_s(3);
      }
      report_status_.Update(server.ReportContacts(request).status());
      reported_ += 10;
      std::this_thread::sleep_for(kBetween);
    }
  }

  void Transfer(const client::Client& server) {
    v1::TransferLocalMapRequest request;
    request.set_activity_id("bench");
    auto next = SteadyClock::now();
    while (!stop_ && transfer_status_.ok()) {
      next += std::chrono::seconds(1);
      while (!stop_ && SteadyClock::now() < next) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
      }
      if (stop_) return;
      transfer_status_.Update(server.TransferLocalMap(request).status());
      ++transferred_;
    }
  }

  std::atomic<bool> stop_{false};
  absl::Status report_status_;
  absl::Status transfer_status_;
  std::uint64_t reported_ = 0;
  int transferred_ = 0;
  std::thread reports_;
  std::thread transfers_;
};

// Asks the null server alone, then beside a stream of `rate` pings a second;
// adds what it measures to `window`.
absl::Status AskNull(const client::Client& null,
                     const std::shared_ptr<grpc::Channel>& channel, double rate,
                     std::uint64_t epoch, const Lengths& lengths,
                     nlohmann::json& window) {
  FATHOM_ASSIGN_OR_RETURN(std::vector<double> idle,
                          AskFor(null, lengths.idle_s));
  const auto start = SteadyClock::now();
  PingLoad pings(channel, rate, epoch);
  auto loaded = AskFor(null, lengths.null_loaded_s);
  pings.Stop();
  const double lasted_s = SecondsSince(start);
  FATHOM_RETURN_IF_ERROR(loaded.status());
  FATHOM_RETURN_IF_ERROR(pings.End());
  window["null_idle_p50_us"] = Quantile(idle, 0.5);
  window["null_idle_p99_us"] = Quantile(idle, 0.99);
  window["null_query_p50_us"] = Quantile(*loaded, 0.5);
  window["null_query_p99_us"] = Quantile(*loaded, 0.99);
  window["null_pings_per_s"] = static_cast<double>(pings.sent()) / lasted_s;
  return absl::OkStatus();
}

absl::Status Run(const std::string& address, const std::string& null_address,
                 double rate, const Lengths& lengths, int windows) {
  FATHOM_ASSIGN_OR_RETURN(const auto planner,
                          client::Client::Connect(address, {}));
  FATHOM_ASSIGN_OR_RETURN(const auto other,
                          client::Client::Connect(address, {}));
  const auto channel =
      grpc::CreateChannel(address, grpc::InsecureChannelCredentials());
  std::unique_ptr<client::Client> null;
  std::shared_ptr<grpc::Channel> null_channel;
  if (!null_address.empty()) {
    FATHOM_ASSIGN_OR_RETURN(null, client::Client::Connect(null_address, {}));
    null_channel =
        grpc::CreateChannel(null_address, grpc::InsecureChannelCredentials());
  }
  FATHOM_RETURN_IF_ERROR(PrepareScene(*planner, 2000));
  FATHOM_RETURN_IF_ERROR(AskFor(*planner, 0.2).status());
  for (int window = 1; window <= windows; ++window) {
    FATHOM_ASSIGN_OR_RETURN(std::vector<double> idle,
                            AskFor(*planner, lengths.idle_s));
    const auto start = SteadyClock::now();
    const auto epoch = static_cast<std::uint64_t>(window);
    PingLoad pings(channel, rate, epoch);
    SideLoad side(*other, *other, epoch);
    auto loaded = AskFor(*planner, lengths.loaded_s);
    pings.Stop();
    const double lasted_s = SecondsSince(start);
    FATHOM_RETURN_IF_ERROR(side.Stop());
    FATHOM_RETURN_IF_ERROR(loaded.status());
    FATHOM_RETURN_IF_ERROR(pings.End());
    const double reached_per_s = static_cast<double>(pings.sent()) / lasted_s;
    nlohmann::json row = {
        {"window", window},
        {"idle_p50_us", Quantile(idle, 0.5)},
        {"idle_p99_us", Quantile(idle, 0.99)},
        {"query_p50_us", Quantile(*loaded, 0.5)},
        {"query_p99_us", Quantile(*loaded, 0.99)},
        {"ack_p50_ms", Quantile(pings.ack_ms(), 0.5)},
        {"ack_p99_ms", Quantile(pings.ack_ms(), 0.99)},
        {"pings", pings.sent()},
        {"pings_per_s", reached_per_s},
        {"reports_per_s", static_cast<double>(side.reports()) / lasted_s},
        {"transfers", side.transfers()}};
    if (null != nullptr) {
      FATHOM_RETURN_IF_ERROR(
          AskNull(*null, null_channel, reached_per_s, epoch, lengths, row));
    }
    std::cout << row << std::endl;
  }
  return absl::OkStatus();
}

int Main(int argc, char** argv) {
  CLI::App app{"Loads a live fathomd with everything at once."};
  std::string server;
  std::string null;
  double rate = 0;
  Lengths lengths;
  int windows = 1;
  app.add_option("--server", server, "fathomd, host:port")->required();
  app.add_option("--null", null, "fathom-null-server, host:port");
  app.add_option("--pings-per-s", rate, "0: as fast as it takes them")
      ->capture_default_str();
  app.add_option("--seconds", lengths.loaded_s, "Of load in each window")
      ->capture_default_str();
  app.add_option("--idle-seconds", lengths.idle_s,
                 "Before the load in each window")
      ->capture_default_str();
  app.add_option("--windows", windows, "How many")->capture_default_str();
  app.add_option("--null-seconds", lengths.null_loaded_s,
                 "Of load on the null server (0: as --seconds)")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  if (lengths.null_loaded_s == 0) lengths.null_loaded_s = lengths.loaded_s;
  return ExitCode("mixed_load", Run(server, null, rate, lengths, windows));
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) { return fathom::bench::Main(argc, argv); }
