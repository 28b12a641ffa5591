#include "sim_feeder/scenario_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/testing/status_matchers.h"

namespace fathom::feeder {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr char kGood[] =
    "title: a day\n"                                   // 1
    "seed: 7\n"                                        // 2
    "start_time: 2026-05-01T06:00:00Z\n"               // 3
    "activity: {id: bay, cell_size_m: 5}\n"            // 4
    "area: {auto_side_m: 600}\n"                       // 5
    "sonar:\n"                                         // 6
    "  beam_std_m: 0.25\n"                             // 7
    "  ghost_share: 0.02\n"                            // 8
    "expect:\n"                                        // 9
    "  - {figure: /measured/rmse_m, at_most: 0.5}\n";  // 10

std::string MessageOf(const std::string& text) {
  const auto file = ParseScenario(text, "day.yaml");
  return file.ok() ? "" : std::string(file.status().message());
}

// kGood with one line, counted from 1, replaced.
std::string With(int line, const std::string& text) {
  std::string out;
  std::string rest = kGood;
  for (int n = 1; !rest.empty(); ++n) {
    const std::size_t end = rest.find('\n') + 1;
    out += n == line ? text + "\n" : rest.substr(0, end);
    rest.erase(0, end);
  }
  return out;
}

TEST(ParseScenario, ReadsWhatIsStatedAndKeepsTheRest) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const ScenarioFile file,
                              ParseScenario(kGood, "day.yaml"));
  EXPECT_EQ(file.title, "a day");
  const Scenario& scenario = file.run.scenario;
  EXPECT_EQ(scenario.seed, 7U);
  EXPECT_EQ(scenario.activity_id, "bay");
  EXPECT_EQ(file.run.auto_area_side_m, 600);
  EXPECT_EQ(scenario.sonar.beam_std_m, 0.25);
  EXPECT_EQ(scenario.faults.ghost_share, 0.02);
  // The map's, since no other is stated.
  EXPECT_EQ(scenario.sonar.sonar_cell_m, 5);
  EXPECT_EQ(scenario.sonar.fan.beam_count, 101);
  EXPECT_TRUE(scenario.navigation.exact());
  ASSERT_EQ(file.expectations.size(), 1U);
  EXPECT_EQ(file.expectations[0].at_most, 0.5);
  EXPECT_EQ(file.expectations[0].place, "day.yaml:10");
}

TEST(ParseScenario, NamesFileLineKeyAndRange) {
  EXPECT_EQ(MessageOf(With(7, "  beam_std_m: -1")),
            "day.yaml:7: sonar.beam_std_m=-1 must be in [0, 100]");
  EXPECT_EQ(MessageOf(With(7, "  beam_std_m: often")),
            "day.yaml:7: sonar.beam_std_m must be a number");
  EXPECT_EQ(MessageOf(With(7, "  beam_std_m: .nan")),
            "day.yaml:7: sonar.beam_std_m=nan must be in [0, 100]");
  EXPECT_THAT(MessageOf(With(8, "  gost_share: 0.02")),
              HasSubstr("day.yaml:8: unknown key sonar.gost_share; known here: "
                        "beam_count, "));
  EXPECT_THAT(MessageOf(With(1, "titel: a day")),
              HasSubstr("day.yaml:1: unknown key titel"));
  EXPECT_EQ(MessageOf(With(4, "activity: {cell_size_m: 5}")),
            "day.yaml:4: activity needs an id");
  EXPECT_THAT(MessageOf(With(4, "activity: {id: bay, estimator: best}")),
              HasSubstr("day.yaml:4: activity.estimator is 'best', not one of: "
                        "default, nervegna, kalman, adaptive"));
  EXPECT_THAT(MessageOf(With(4, "activity: {id: bay, prior_std_m: 5}")),
              HasSubstr("needs prior_depth_m and prior_std_m both"));
  EXPECT_THAT(MessageOf(With(5, "area: {}")),
              HasSubstr("one of both must be stated"));
  EXPECT_THAT(MessageOf(With(3, "start_time: noon")),
              HasSubstr("day.yaml:3: start_time"));
  EXPECT_THAT(
      MessageOf(With(10, "  - {figure: measured, at_most: 1}")),
      HasSubstr("day.yaml:10: expect[0].figure must be a JSON pointer"));
  EXPECT_THAT(MessageOf(With(10, "  - {figure: /points}")),
              HasSubstr("needs at_least or at_most"));
  EXPECT_THAT(MessageOf(With(10, "  - 5")),
              HasSubstr("day.yaml:10: expect[0] must be a map"));
  EXPECT_THAT(MessageOf(With(6, "sonar: loud\nx:")),
              HasSubstr("day.yaml:6: sonar must be a map"));
  EXPECT_THAT(MessageOf("a: [1"), HasSubstr("day.yaml:"));
  EXPECT_EQ(MessageOf("- 1"), "day.yaml:1: is no map of keys and values");
  EXPECT_EQ(MessageOf(""), "day.yaml:1: is no map of keys and values");
}

TEST(ParseScenario, LegsOfAShipFollowEachOther) {
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const ScenarioFile file,
      ParseScenario(std::string(kGood) +
                        "contacts:\n"
                        "  scripted:\n"
                        "    - id: ferry\n"
                        "      class: small_craft\n"
                        "      north_m: 100\n"
                        "      legs:\n"
                        "        - {speed_m_s: 5, course_deg: 90, duration_s: "
                        "60}\n"
                        "        - {duration_s: 40}\n"
                        "        - {speed_m_s: 2, course_deg: 0, duration_s: "
                        "10}\n",
                    "day.yaml"));
  ASSERT_EQ(file.run.scenario.scripted_ships.size(), 1U);
  const Ship& ferry = file.run.scenario.scripted_ships[0];
  EXPECT_EQ(ferry.contact_class, v1::CONTACT_CLASS_SMALL_CRAFT);
  // 5 m/s east for 60 s, still for 40 s, 2 m/s north for good.
  EXPECT_NEAR(ferry.PlaceAt(30).east_m, 150, 1e-9);
  EXPECT_NEAR(ferry.PlaceAt(80).east_m, 300, 1e-9);
  EXPECT_NEAR(ferry.PlaceAt(80).north_m, 100, 1e-9);
  EXPECT_NEAR(ferry.PlaceAt(130).north_m, 160, 1e-9);
  EXPECT_NEAR(ferry.MotionAt(130).north_m_s, 2, 1e-9);
  EXPECT_EQ(ferry.MotionAt(80).east_m_s, 0);
}

TEST(ParseScenario, AWayOfItsOwn) {
  const std::string way =
      std::string(kGood) +
      "vehicle:\n"                                                   // 11
      "  waypoints:\n"                                               // 12
      "    - {north_m: 10, east_m: 20}\n"                            // 13
      "    - {north_m: 300, loiter_radius_m: 30, loiter_s: 120}\n";  // 14
  FATHOM_ASSERT_OK_AND_ASSIGN(const ScenarioFile file,
                              ParseScenario(way, "day.yaml"));
  const std::vector<Waypoint>& waypoints = file.run.scenario.waypoints;
  ASSERT_EQ(waypoints.size(), 2U);
  EXPECT_EQ(waypoints[0].place.east_m, 20);
  EXPECT_EQ(waypoints[0].loiter_s, 0);
  EXPECT_EQ(waypoints[1].place.north_m, 300);
  EXPECT_EQ(waypoints[1].loiter_radius_m, 30);
  EXPECT_EQ(waypoints[1].loiter_s, 120);
  EXPECT_THAT(MessageOf(way + "    - {north: 5}\n"),
              HasSubstr("day.yaml:15: unknown key vehicle.waypoints[2].north; "
                        "known here: east_m, "));
  EXPECT_THAT(MessageOf(way + "    - {loiter_s: 5}\n"),
              HasSubstr("day.yaml:15: vehicle.waypoints[2].loiter_s needs "
                        "loiter_radius_m and loiter_s both"));
  EXPECT_THAT(MessageOf(way + "  track_spacing_m: 30\n"),
              HasSubstr("day.yaml:15: vehicle.track_spacing_m is of a "
                        "lawnmower"));
}

TEST(ParseScenario, AShipThatChasesTheVehicle) {
  const std::string ship = std::string(kGood) +
                           "contacts:\n"
                           "  scripted:\n"
                           "    - id: hunter\n"
                           "      legs:\n"
                           "        - {speed_m_s: 5, duration_s: 60}\n";
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const ScenarioFile file,
      ParseScenario(ship + "      chase_speed_m_s: 7\n", "day.yaml"));
  ASSERT_EQ(file.run.scenario.pursuits.size(), 1U);
  const Pursuit& pursuit = file.run.scenario.pursuits[0];
  EXPECT_EQ(pursuit.ship_id, "hunter");
  EXPECT_EQ(pursuit.from_s, 60);
  EXPECT_EQ(pursuit.speed_m_s, 7);
  EXPECT_EQ(pursuit.interval_s, 10);
  EXPECT_THAT(MessageOf(ship + "      chase_interval_s: 7\n"),
              HasSubstr("day.yaml:16: contacts.scripted[0].chase_interval_s "
                        "needs chase_speed_m_s"));
}

TEST(LoadScenario, TheShippedOnesAreGood) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(
           std::string(FATHOM_SOURCE_DIR) + "/sim_feeder/scenarios")) {
    if (entry.path().extension() != ".yaml") continue;
    SCOPED_TRACE(entry.path().string());
    FATHOM_ASSERT_OK_AND_ASSIGN(const ScenarioFile file,
                                LoadScenario(entry.path().string()));
    EXPECT_FALSE(file.title.empty());
    EXPECT_FALSE(file.expectations.empty());
    ++files;
  }
  EXPECT_EQ(files, 7);
}

TEST(Missed, SaysWhichAndByHowMuch) {
  const std::string evaluation = R"({"a": {"b": 2.5}, "name": "x"})";
  const auto missed = [&](const Expectation& expectation) {
    return Missed({expectation}, evaluation);
  };
  EXPECT_THAT(*missed({.figure = "/a/b", .at_least = 2.5, .at_most = 2.5}),
              IsEmpty());
  EXPECT_THAT(*missed({.figure = "/a/b", .at_least = 3, .place = "day.yaml:4"}),
              ElementsAre("day.yaml:4: /a/b is 2.5, expected at least 3"));
  EXPECT_THAT(*missed({.figure = "/a/b", .at_most = 2, .place = "day.yaml:4"}),
              ElementsAre("day.yaml:4: /a/b is 2.5, expected at most 2"));
  EXPECT_FALSE(missed({.figure = "/a/c", .at_most = 2}).ok());
  EXPECT_FALSE(missed({.figure = "/name", .at_most = 2}).ok());
}

}  // namespace
}  // namespace fathom::feeder
