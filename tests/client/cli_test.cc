// The `fathom` executable as scripts see it: exit codes, one JSON document on
// standard output, what it sends. It runs against the fake server.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/wait.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/client/fake_server.h"

namespace fathom::client {
namespace {

using ::testing::HasSubstr;

struct Outcome {
  int code = -1;
  std::string out;
};

class CliTest : public ::testing::Test {
 protected:
  // Runs `fathom --server <fake> <arguments>`; standard error is dropped
  // unless the arguments say otherwise.
  Outcome Run(const std::string& arguments) {
    return RunAgainst(server_.address(), arguments);
  }
  static Outcome RunAgainst(const std::string& address,
                            const std::string& arguments) {
    // The redirection comes first: arguments may end with a here-document.
    const std::string command = "2>/dev/null " + std::string(FATHOM_CLI) +
                                " --server " + address + " " + arguments;
    Outcome outcome;
    FILE* pipe = popen(command.c_str(), "r");
    char buffer[4096];
    while (const std::size_t n = fread(buffer, 1, sizeof buffer, pipe)) {
      outcome.out.append(buffer, n);
    }
    outcome.code = WEXITSTATUS(pclose(pipe));
    return outcome;
  }
  static nlohmann::json Json(const Outcome& outcome) {
    return nlohmann::json::parse(outcome.out);  // Throws: the test fails.
  }

  FakeServer server_;
};

TEST_F(CliTest, QuerySendsWhatItWasAskedAndPrintsTheAnswer) {
  const Outcome outcome =
      Run("query --at -33.5,151.25 --depth-m 20 --confidence 0.99 "
          "--clearance-m 2 --radius-m 5 --time 2026-01-01T12:00:00Z");
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out, HasSubstr("FREE at 99 % confidence"));
  const v1::QueryObstacleRequest& sent = server_.last_query;
  EXPECT_EQ(sent.position().latitude_deg(), -33.5);
  EXPECT_EQ(sent.position().longitude_deg(), 151.25);
  EXPECT_EQ(sent.depth_m(), 20);
  EXPECT_EQ(sent.confidence(), 0.99);
  EXPECT_EQ(sent.vertical_clearance_m(), 2);
  EXPECT_EQ(sent.radius_m(), 5);
  // date -ud 2026-01-01T12:00:00 +%s
  EXPECT_EQ(sent.time().seconds(), 1'767'268'800);
  EXPECT_EQ(sent.vertical_reference().reference(),
            v1::DEPTH_REFERENCE_MISSION_DATUM);
}

TEST_F(CliTest, EveryVerbPrintsOneJsonDocumentAlsoForErrors) {
  server_.mission.set_name("m");
  for (const char* verb :
       {"status", "mission info", "mission verify", "mission save x",
        "activity list", "activity start a --center 1,2 --size-m 10",
        "activity complete a", "activity transfer a",
        "query --at 1,2 --depth-m 3", "contacts list", "contacts history s/c",
        "contacts report s/c --at 1,2", "contacts drop s/c",
        "prior import /nonexistent --std-m 1", "render --out /dev/null",
        "export --out /dev/null"}) {
    const Outcome outcome = Run(std::string("--json ") + verb);
    EXPECT_TRUE(nlohmann::json::accept(outcome.out)) << verb << outcome.out;
    // What failed says so in both.
    if (outcome.code != 0) {
      EXPECT_THAT(outcome.out, HasSubstr("\"error\"")) << verb;
    }
  }
}

TEST_F(CliTest, PointsComeFromStandardInputAndAnswersAreInTheirOrder) {
  const Outcome outcome =
      Run("--json query --points-file - <<'EOF'\n"
          "depth,lat,lon\n5,41.5,-71.25\n6,41.75,-71.5\nEOF\n");
  ASSERT_EQ(outcome.code, 0);
  const nlohmann::json answers = Json(outcome).at("answers");
  ASSERT_EQ(answers.size(), 2u);
  EXPECT_EQ(answers[1].at("latitude_deg"), 41.75);
  EXPECT_EQ(answers[1].at("state"), "OBSTACLE_STATE_UNCERTAIN");
  EXPECT_TRUE(answers[1].at("mean_depth_m").is_null());
  EXPECT_EQ(server_.last_batch.depth_m(0), 5);
}

TEST_F(CliTest, ManyPointsAreAskedInPartsThatTheServerTakes) {
  server_.mission.mutable_limits()->set_max_points_per_query(2);
  const Outcome outcome =
      Run("--json query --depth-m 1 --points-file - <<'EOF'\n"
          "1,1\n2,2\n3,3\n4,4\n5,5\nEOF\n");
  ASSERT_EQ(outcome.code, 0);
  EXPECT_EQ(Json(outcome).at("answers").size(), 5u);
  EXPECT_EQ(server_.calls("QueryObstacles"), 3);  // 2 + 2 + 1.
}

TEST_F(CliTest, RefusalIsTwoAndNamesTheField) {
  server_.FailNext("StartActivity", 1, BadField("parameters.cell_size_m", "0"));
  const Outcome outcome =
      Run("--json activity start a --center 1,2 --size-m 10");
  EXPECT_EQ(outcome.code, 2);
  const nlohmann::json error = Json(outcome).at("error");
  EXPECT_EQ(error.at("code"), "INVALID_ARGUMENT");
  EXPECT_EQ(error.at("fields")[0].at("field"), "parameters.cell_size_m");
}

TEST_F(CliTest, UsageIsOneAndNothingIsSent) {
  for (const char* wrong :
       {"", "frobnicate", "query", "query --at 91,0 --depth-m 1",
        "query --at 1,2", "query --at 1,2 --depth-m x",
        "query --at 1,2 --depth-m 3 --time yesterday",
        "activity start a --size-m 5", "contacts drop nameless", "export",
        "export -o x --bands salt", "export -o x --format png",
        "render --show salt", "render --show difference",
        "--tls-cert /dev/null status"}) {
    EXPECT_EQ(Run(wrong).code, 1) << wrong;
  }
  EXPECT_EQ(server_.calls("QueryObstacle"), 0);
  EXPECT_EQ(server_.calls("StartActivity"), 0);
}

TEST_F(CliTest, NobodyThereIsThree) {
  const std::string address = server_.address();
  server_.Stop();
  EXPECT_EQ(RunAgainst(address, "--timeout-s 0.2 status").code, 3);
}

TEST_F(CliTest, BadFileIsFour) {
  EXPECT_EQ(Run("prior import /nonexistent.tif --std-m 1").code, 4);
  EXPECT_EQ(Run("query --points-file /nonexistent.csv").code, 4);
  EXPECT_EQ(Run("query --points-file - <<'EOF'\n1,x,3\nEOF\n").code, 4);
  EXPECT_EQ(Run("render --track /nonexistent.csv").code, 4);
}

TEST_F(CliTest, TlsFilesAreReadAndAPlainServerDoesNotAnswerThem) {
  EXPECT_EQ(Run("--tls-ca /nonexistent.pem status").code, 4);
  EXPECT_EQ(Run("--tls-ca " FATHOM_CLI " status").code, 4);
  std::string folder =
      std::filesystem::temp_directory_path() / "fathom_cli_tls.XXXXXX";
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  std::ofstream(folder + "/ca.pem")
      << "-----BEGIN CERTIFICATE-----\n-----END CERTIFICATE-----\n";
  EXPECT_EQ(Run("--timeout-s 0.3 --tls-ca " + folder + "/ca.pem status").code,
            3);
  std::filesystem::remove_all(folder);
}

TEST_F(CliTest, HelpTeachesWithExamplesAndExitCodes) {
  const Outcome help = Run("--help");
  EXPECT_EQ(help.code, 0);
  for (const char* wanted : {"Exit codes:", "FATHOM_SERVER", "fathom query",
                             "prior", "render", "activity"}) {
    EXPECT_THAT(help.out, HasSubstr(wanted));
  }
  for (const char* verb :
       {"query", "activity start", "prior import", "export", "render"}) {
    const Outcome verb_help = Run(std::string(verb) + " --help");
    EXPECT_EQ(verb_help.code, 0);
    EXPECT_THAT(verb_help.out, HasSubstr("Example")) << verb;
  }
}

TEST_F(CliTest, ChartIsClippedToTheMissionAndLandIsSentAsLand) {
  // The fake mission: a square of 2 degrees with its west side on 72 W.
  v1::GlobalMapStatus& map = *server_.mission.mutable_global_map();
  map.mutable_south_west()->set_latitude_deg(40);
  map.mutable_south_west()->set_longitude_deg(-72);
  map.mutable_north_west()->set_latitude_deg(42);
  map.mutable_north_west()->set_longitude_deg(-72);
  std::string folder =
      std::filesystem::temp_directory_path() / "fathom_cli_test.XXXXXX";
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  const std::string path = folder + "/chart.asc";
  // An ASCII grid of 4 x 2 cells of 10 degrees; only the cell -80..-70,
  // 40..50 and the one east of it touch the mission.
  std::ofstream(path) << "ncols 4\nnrows 2\nxllcorner -90\nyllcorner 30\n"
                         "cellsize 10\nNODATA_value -9999\n"
                         "-1 -2 25 -4\n-5 -6 -9999 -8\n";
  const std::string command = "--json prior import " + path +
                              " --positive up --std-m 3 --crs EPSG:4326";
  const Outcome outcome = Run(command);
  EXPECT_EQ(server_.header.first_tile(), 1u);
  // A mission that holds all of it is sent nothing.
  server_.tiles_held = 1;
  const Outcome again = Run(command);
  EXPECT_EQ(again.code, 0);
  EXPECT_EQ(Json(again).at("already_loaded"), true);
  EXPECT_EQ(server_.calls("ImportPrior"), 1);
  std::filesystem::remove_all(folder);
  ASSERT_EQ(outcome.code, 0) << outcome.out;
  const nlohmann::json chart = Json(outcome).at("chart");
  // Rows 0 and 1 touch 39.98..42.02; columns 1 (-80..-70) and 2 (-70..-60)
  // touch -72.03..-69.3: depths 2 and 6, land 25, one nodata.
  EXPECT_EQ(chart.at("cells_with_depth"), 2);
  EXPECT_EQ(chart.at("cells_land"), 1);
  EXPECT_EQ(chart.at("cells_unknown"), 1);
  ASSERT_EQ(server_.tiles.size(), 1u);
  const v1::DepthTile& tile = server_.tiles[0];
  EXPECT_EQ(tile.depth_m(0), 2);
  EXPECT_EQ(tile.land(), std::string({0, 1, 0, 0}));
  EXPECT_EQ(tile.depth_m(2), 6);
  EXPECT_EQ(tile.std_m(0), 3);
  EXPECT_EQ(server_.header.name(), "chart.asc");
  EXPECT_EQ(server_.header.import_id(), Json(again).at("import_id"));
  EXPECT_TRUE(server_.header.replace());
}

}  // namespace
}  // namespace fathom::client
