// The feeder against a real fathomd on a free port: survey, questions, truth.

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "sim_feeder/evaluate_command.h"
#include "sim_feeder/run_command.h"
#include "tests/sim_feeder/plane_terrain.h"
#include "tests/testing/status_matchers.h"

extern char** environ;

namespace fathom::feeder {
namespace {

// A fathomd on a new mission of 20 nautical miles about kTestOrigin; killed
// with SIGKILL at the end.
class Fathomd {
 public:
  Fathomd() {
    std::string name =
        (std::filesystem::path(::testing::TempDir()) / "fathom-feeder.XXXXXX")
            .string();
    folder_ = mkdtemp(name.data());
    std::vector<std::string> words = {FATHOMD_PATH,
                                      "--mission",
                                      folder_ + "/m.fathom",
                                      "--create",
                                      "--center",
                                      "41.5,-70.7",
                                      "--side-nmi",
                                      "20",
                                      "--min-cell-m",
                                      "10",
                                      "--listen",
                                      "127.0.0.1:0",
                                      "--port-file",
                                      folder_ + "/port"};
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    const std::string log = folder_ + "/log";
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    for (const int fd : {STDOUT_FILENO, STDERR_FILENO}) {
      posix_spawn_file_actions_addopen(&actions, fd, log.c_str(),
                                       O_WRONLY | O_CREAT | O_APPEND, 0600);
    }
    if (posix_spawn(&pid_, FATHOMD_PATH, &actions, nullptr, argv.data(),
                    environ) != 0) {
      pid_ = -1;
    }
    posix_spawn_file_actions_destroy(&actions);
  }

  ~Fathomd() {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    std::filesystem::remove_all(folder_);
  }

  // Waits until the port is told; empty if the server died or kept silent.
  std::string Address() const {
    for (int i = 0; i < 600; ++i) {
      std::ifstream file(folder_ + "/port");
      std::string port;
      if (file >> port) return "127.0.0.1:" + port;
      if (pid_ <= 0 || waitpid(pid_, nullptr, WNOHANG) != 0) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    std::ifstream log(folder_ + "/log");
    std::cerr << log.rdbuf();
    return "";
  }

 private:
  std::string folder_;
  pid_t pid_ = -1;
};

// A slope of 1 in 40 with ripples of 0.5 m, 20 to 30 m deep.
double Ripples(double north_m, double east_m) {
  return 25.0 + north_m / 40.0 + 0.5 * std::sin(east_m / 20.0);
}

TEST(LiveServer, MapAgreesWithTheTruthThatItNeverSaw) {
  const Fathomd server;
  const std::string address = server.Address();
  ASSERT_FALSE(address.empty());
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::unique_ptr<client::Client> client,
                              client::Client::Connect(address, {}));

  Scenario scenario;
  scenario.seed = 9;
  scenario.activity_id = "live";
  scenario.area = {.south_west = kTestOrigin,
                   .north_extent_m = 300.0,
                   .east_extent_m = 300.0,
                   .cell_size_m = 10.0};
  scenario.start_time = *ParseTime("2026-01-01T12:00:00Z");
  scenario.pings = 1500;
  const auto seabed = MakePlaneSeabed(Ripples, 5.0);
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::unique_ptr<Simulation> simulation,
                              Simulation::Create(scenario, seabed));

  v1::StartActivityRequest start;
  start.set_activity_id(scenario.activity_id);
  v1::ActivityParameters& parameters = *start.mutable_parameters();
  parameters.mutable_south_west()->set_latitude_deg(kTestOrigin.latitude_deg);
  parameters.mutable_south_west()->set_longitude_deg(kTestOrigin.longitude_deg);
  parameters.set_north_extent_m(300.0);
  parameters.set_east_extent_m(300.0);
  parameters.set_cell_size_m(10.0);
  FATHOM_ASSERT_OK(client->StartActivity(start));

  FATHOM_ASSERT_OK_AND_ASSIGN(
      const std::unique_ptr<StreamSink> sink,
      StreamSink::Open(*client, {.source_id = "feeder"}));
  PreparedMessages messages(*simulation, 0);
  SurveyRecord record;
  record.source_id = "feeder";
  record.area = scenario.area;
  record.start_time = scenario.start_time;
  record.end_time = simulation->TimeAt(simulation->duration_s());
  record.ships = simulation->ships();
  FATHOM_ASSERT_OK(DriveSurvey(messages, *sink, 0.0, false, nullptr, record));
  EXPECT_EQ(record.pings, 1500u);
  EXPECT_EQ(record.pings_durable, 1500u);
  EXPECT_EQ(record.reports_durable, record.contact_reports);
  // Nothing vanishes: every measurement is fused or counted with its reason.
  std::uint64_t refused = 0;
  for (const auto& [reason, count] : record.rejects) refused += count;
  EXPECT_EQ(record.measurements_accepted + refused, record.measurements);
  EXPECT_TRUE(record.report_rejects.empty());

  FATHOM_ASSERT_OK_AND_ASSIGN(
      const DepthEvaluation depth,
      EvaluateDepth(*client, *seabed, scenario.area, record.end_time, 1, 5000));
  const DepthScore& measured = depth.by_kind.at(v1::EVIDENCE_KIND_MEASURED);
  EXPECT_GT(measured.count(), 4500u);
  // In a 10 m cell the slope spreads the depths by 10 / 40 / sqrt(12) = 0.07
  // m, the ripples by at most 0.5 / 20 * 10 / sqrt(12) = 0.07 m; noise of 0.3
  // m over ten beams is 0.1 m. Together below 0.15 m.
  EXPECT_LT(measured.RmseM(), 0.15);
  EXPECT_LT(std::abs(measured.BiasM()), 0.02);
  EXPECT_GT(measured.ShareWithin(1), 0.55);
  EXPECT_LT(measured.ShareWithin(1), 0.85);
  EXPECT_GT(measured.ShareWithin(2), 0.88);
  // Always 1/2 would score 0.25; perfectly calibrated answers to depths spread
  // evenly over +-3 std score the mean of p (1 - p): 0.094.
  EXPECT_LT(depth.reliability.Brier(), 0.13);
  EXPECT_LT(depth.reliability.CalibrationError(), 0.08);

  FATHOM_ASSERT_OK_AND_ASSIGN(const ContactEvaluation contacts,
                              EvaluateContacts(*client, record));
  EXPECT_EQ(contacts.missing, 0u);
  // 1499 s, three ships, every 10 s but for the first minute.
  EXPECT_GT(contacts.during.count(), 400u);
  // A consistent filter has 95 %; process noise for ships that never turn
  // makes it cautious.
  EXPECT_GT(contacts.during.ShareWithin95(), 0.85);
}

}  // namespace
}  // namespace fathom::feeder
