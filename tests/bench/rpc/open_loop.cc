// open_loop: how long an answer takes when questions come at their own times,
// whether the last was answered or not, as they come to a server from many
// clients. One JSON document:
//
//   saturated_per_s   QueryObstacle with kUnderWay under way all the time
//   rate_per_s        half of it (--share): questions fall due at even
//                     intervals
//   busy_share        of all processors in that time, by /proc/stat: more than
//                     half, for a question that comes alone pays for its own
//                     wake-ups and at saturation one serves many
//   p50_us p99_us worst_us  from when a question fell due to its answer. One
//                     that is asked late, because the asking thread or the
//                     server was late before, counts from when it fell due:
//                     no coordinated omission
//
// of fathomd and of the null server, window by window in turn; of each figure
// the median of the windows. Client and server share the machine.
#include <grpcpp/grpcpp.h>
#include <sys/prctl.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "base/mutex.h"
#include "base/status_macros.h"
#include "client/client.h"
#include "fathom/v1/obstacle_service.grpc.pb.h"
#include "tests/bench/rpc/bench_rpc_scene.h"
#include "tests/bench/rpc/measure.h"

namespace fathom::bench {
namespace {

using SteadyTime = SteadyClock::time_point;

// Enough to keep two cores busy; more lengthens the queue only.
constexpr int kUnderWay = 64;

// Counts calls under way; waits until all have come back.
class Calls {
 public:
  void Begin() {
    MutexLock lock(mutex_);
    ++under_way_;
  }
  void End(const grpc::Status& status) {
    MutexLock lock(mutex_);
    if (!status.ok()) error_ = status.error_message();
    if (--under_way_ == 0) none_.NotifyAll();
  }
  absl::Status Wait() {
    MutexLock lock(mutex_);
    while (under_way_ > 0) none_.Wait(mutex_);
    return error_.empty() ? absl::OkStatus() : absl::UnknownError(error_);
  }

 private:
  Mutex mutex_;
  CondVar none_;
  int under_way_ FATHOM_GUARDED_BY(mutex_) = 0;
  std::string error_ FATHOM_GUARDED_BY(mutex_);
};

// Asks one server over one connection.
class Asker {
 public:
  explicit Asker(const std::string& address)
      : stub_(v1::ObstacleService::NewStub(
            grpc::CreateChannel(address, grpc::InsecureChannelCredentials()))),
        queries_(256) {
    std::mt19937_64 random(11);
    for (v1::QueryObstacleRequest& query : queries_) FillQuery(random, query);
  }

  // Answers a second with kUnderWay questions always under way.
  absl::StatusOr<double> Saturate(double seconds) {
    std::atomic<bool> stop{false};
    std::atomic<std::uint64_t> answered{0};
    Calls calls;
    const auto start = SteadyClock::now();
    for (int i = 0; i < kUnderWay; ++i) {
      calls.Begin();
      AskAgain(static_cast<std::size_t>(i), stop, answered, calls);
    }
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    const auto total = static_cast<double>(answered.load());
    const double took_s =
        std::chrono::duration<double>(SteadyClock::now() - start).count();
    stop = true;
    FATHOM_RETURN_IF_ERROR(calls.Wait());
    return total / took_s;
  }

  // From due to answered, microseconds, of each question in `seconds`.
  absl::StatusOr<std::vector<double>> AskEvenly(double per_s, double seconds) {
    std::vector<double> latencies_us(static_cast<std::size_t>(per_s * seconds));
    Calls calls;
    const auto start = SteadyClock::now();
    for (std::size_t i = 0; i < latencies_us.size(); ++i) {
      const SteadyTime due =
          start +
          std::chrono::duration_cast<SteadyClock::duration>(
              std::chrono::duration<double>(static_cast<double>(i) / per_s));
      std::this_thread::sleep_until(due);
      calls.Begin();
      Ask(i, [due, &calls,
              &latency_us = latencies_us[i]](const grpc::Status& status) {
        latency_us =
            std::chrono::duration<double, std::micro>(SteadyClock::now() - due)
                .count();
        calls.End(status);
      });
    }
    FATHOM_RETURN_IF_ERROR(calls.Wait());
    return latencies_us;
  }

 private:
  struct Call {
    grpc::ClientContext context;
    v1::QueryObstacleResponse response;
  };

  template <typename Done>
  void Ask(std::size_t index, Done done) {
    const auto call = std::make_shared<Call>();
    stub_->async()->QueryObstacle(
        &call->context, &queries_[index % queries_.size()], &call->response,
        [call, done](const grpc::Status& status) { done(status); });
  }

  // One of `calls` until `stop`.
  void AskAgain(std::size_t index, const std::atomic<bool>& stop,
                std::atomic<std::uint64_t>& answered, Calls& calls) {
    Ask(index, [this, index, &stop, &answered, &calls](const auto& status) {
      ++answered;
      if (stop || !status.ok()) {
        calls.End(status);
      } else {
        AskAgain(index + 1, stop, answered, calls);
      }
    });
  }

  const std::unique_ptr<v1::ObstacleService::Stub> stub_;
  std::vector<v1::QueryObstacleRequest> queries_;
};

// Of all processors together since the start, in ticks (proc(5), /proc/stat).
struct ProcessorTime {
  double busy = 0;
  double all = 0;
};
ProcessorTime ReadProcessorTime() {
  std::ifstream stat("/proc/stat");
  std::string cpu;
  stat >> cpu;
  ProcessorTime time;
  double ticks = 0;
  // user nice system idle iowait irq softirq steal.
  for (int field = 0; field < 8 && stat >> ticks; ++field) {
    time.all += ticks;
    if (field != 3 && field != 4) time.busy += ticks;
  }
  return time;
}

// The figures of one server, a value a window.
class Figures {
 public:
  absl::Status Measure(Asker& asker, double share, double seconds) {
    FATHOM_ASSIGN_OR_RETURN(const double saturated,
                            asker.Saturate(seconds / 2));
    const ProcessorTime before = ReadProcessorTime();
    FATHOM_ASSIGN_OR_RETURN(const std::vector<double> latencies_us,
                            asker.AskEvenly(share * saturated, seconds));
    const ProcessorTime after = ReadProcessorTime();
    const double p50_us = Quantile(latencies_us, 0.5);
    const double p99_us = Quantile(latencies_us, 0.99);
    values_["saturated_per_s"].push_back(saturated);
    values_["rate_per_s"].push_back(share * saturated);
    values_["busy_share"].push_back((after.busy - before.busy) /
                                    std::max(1.0, after.all - before.all));
    values_["p50_us"].push_back(p50_us);
    values_["p99_us"].push_back(p99_us);
    values_["worst_us"].push_back(Quantile(latencies_us, 1));
    values_["p99_of_p50"].push_back(p99_us / p50_us);
    return absl::OkStatus();
  }
  nlohmann::json Report() const {
    nlohmann::json report;
    for (const auto& [key, values] : values_) {
      report[key] = Quantile(values, 0.5);
      report[key + "_raw"] = values;
    }
    return report;
  }

 private:
  std::map<std::string, std::vector<double>> values_;
};

absl::Status Run(const std::string& server, const std::string& null,
                 int windows, double share, double seconds) {
  {
    FATHOM_ASSIGN_OR_RETURN(const auto client,
                            client::Client::Connect(server, {}));
    FATHOM_RETURN_IF_ERROR(PrepareScene(*client, 2000));
  }
  Asker fathom(server);
  Asker floor(null);
  // Warms connections and caches.
  FATHOM_RETURN_IF_ERROR(fathom.Saturate(0.2).status());
  FATHOM_RETURN_IF_ERROR(floor.Saturate(0.2).status());
  Figures ours;
  Figures least;
  for (int window = 0; window < windows; ++window) {
    FATHOM_RETURN_IF_ERROR(ours.Measure(fathom, share, seconds));
    FATHOM_RETURN_IF_ERROR(least.Measure(floor, share, seconds));
  }
  std::cout << nlohmann::json{{"fathomd", ours.Report()},
                              {"null", least.Report()}}
                   .dump(2)
            << "\n";
  return absl::OkStatus();
}

int Main(int argc, char** argv) {
  CLI::App app{"Asks fathomd at even times, answered or not."};
  std::string server;
  std::string null;
  int windows = 5;
  double share = 0.5;
  double seconds = 4;
  app.add_option("--server", server, "fathomd, host:port")->required();
  app.add_option("--null", null, "fathom-null-server, host:port")->required();
  app.add_option("--windows", windows, "How many")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--share", share, "Of the saturation rate, to ask at")
      ->check(CLI::Range(0.01, 1.0))
      ->capture_default_str();
  app.add_option("--seconds", seconds, "Of even questions in each window")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  // Wakes when a question is due, not 50 us later.
  prctl(PR_SET_TIMERSLACK, 1UL, 0, 0, 0);
  return ExitCode("open_loop", Run(server, null, windows, share, seconds));
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) { return fathom::bench::Main(argc, argv); }
