// Trajectories from CSV and GeoJSON.
#include "client/cli/trajectory_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "client/cli/exit_code.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client::cli {
namespace {

using ::testing::HasSubstr;

// 2002-05-24T00:00:00Z.
constexpr Time kNow = TimeFromUnixMicros(1'022'198'400'000'000);

TrajectoryDefaults Defaults() { return {.start = kNow, .now = kNow}; }

std::string ErrorOf(const std::string& text,
                    const TrajectoryDefaults& defaults = Defaults()) {
  const auto points = ParseTrajectory(text, defaults);
  EXPECT_FALSE(points.ok()) << text;
  EXPECT_EQ(ExitCodeOf(points.status()), ExitCode::kBadFile);
  return std::string(points.status().message());
}

TEST(ParseTrajectory, CsvWithTimes) {
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto points,
      ParseTrajectory("lat,lon,depth,time\n41.5,-71.4,10,now\n"
                      "41.6,-71.3,12,+10min\n",
                      Defaults()));
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[1].latitude_deg, 41.6);
  EXPECT_EQ(points[1].longitude_deg, -71.3);
  EXPECT_EQ(points[1].depth_m, 12);
  EXPECT_EQ(points[0].time, kNow);
  EXPECT_EQ(points[1].time, kNow + std::chrono::minutes(10));
}

TEST(ParseTrajectory, SpeedMakesTimesFromTheStart) {
  TrajectoryDefaults defaults = Defaults();
  defaults.start = kNow + std::chrono::hours(1);
  defaults.speed_m_s = 2;
  defaults.depth_m = 20;
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto points, ParseTrajectory("0,179.999\n0,-179.999\n", defaults));
  EXPECT_EQ(points[0].time, defaults.start);
  EXPECT_EQ(points[0].depth_m, 20);
  // Over the antimeridian: 0.002 degree of the equator (6378137 m) is
  // 222.639 m, at 2 m/s 111.32 s.
  const double takes_s =
      std::chrono::duration<double>(*points[1].time - *points[0].time).count();
  EXPECT_NEAR(takes_s, 111.32, 0.01);
}

TEST(ParseTrajectory, GeoJsonInAllItsWrappings) {
  const std::string line =
      R"({"type":"LineString","coordinates":[[-71.4,41.5,-10],[-71.3,41.6]]})";
  TrajectoryDefaults defaults = Defaults();
  defaults.depth_m = 7;
  defaults.speed_m_s = 1;
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto bare, ParseTrajectory(line, defaults));
  ASSERT_EQ(bare.size(), 2u);
  EXPECT_EQ(bare[0].latitude_deg, 41.5);
  EXPECT_EQ(bare[0].longitude_deg, -71.4);
  // A height of -10 m is 10 m deep.
  EXPECT_EQ(bare[0].depth_m, 10);
  EXPECT_EQ(bare[1].depth_m, 7);
  const std::string feature =
      R"({"type":"Feature","properties":{"times":["now","+1h"]},"geometry":)" +
      line + "}";
  for (const std::string& text :
       {feature,
        R"({"type":"FeatureCollection","features":[)" + feature + "]}"}) {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto points,
                                ParseTrajectory("\n " + text, defaults));
    ASSERT_EQ(points.size(), 2u);
    EXPECT_EQ(points[1].time, kNow + std::chrono::hours(1));
  }
}

TEST(ParseTrajectory, SaysWhatIsWrong) {
  EXPECT_THAT(ErrorOf("41.5,-71.4,10,now\n"), HasSubstr("at least 2"));
  EXPECT_THAT(ErrorOf("41.5,-71.4,10,now\n41.6,-71.4,10\n"),
              HasSubstr("waypoint 1 has no time"));
  EXPECT_THAT(ErrorOf("41.5,-71.4\n41.6,-71.4\n"), HasSubstr("no depth"));
  EXPECT_THAT(ErrorOf(""), HasSubstr("no point"));
  EXPECT_THAT(ErrorOf("{"), HasSubstr("not valid JSON"));
  EXPECT_THAT(ErrorOf("{}"), HasSubstr("no LineString"));
  EXPECT_THAT(ErrorOf(R"({"type":"FeatureCollection","features":[]})"),
              HasSubstr("without features"));
  EXPECT_THAT(ErrorOf(R"({"type":"Feature","geometry":null})"),
              HasSubstr("no LineString"));
  const auto line = [](const std::string& coordinates) {
    return R"({"type":"LineString","coordinates":[)" + coordinates + "]}";
  };
  EXPECT_THAT(ErrorOf(line("[-71.4,41.5,-1],[41.5]")),
              HasSubstr("coordinates[1]"));
  EXPECT_THAT(ErrorOf(line("[-71.4,41.5,-1],[-71.4,\"x\"]")),
              HasSubstr("no number"));
  EXPECT_THAT(ErrorOf(line("[41.5,-91.4,-1],[41.5,-71.4]")),
              HasSubstr("longitude comes first"));
  EXPECT_THAT(ErrorOf(line("[-71.4,41.5],[-71.4,41.6]")),
              HasSubstr("no depth"));
  EXPECT_THAT(
      ErrorOf(
          R"({"type":"Feature","properties":{"times":["now"]},"geometry":)" +
          line("[-71.4,41.5,-1],[-71.4,41.6,-1]") + "}"),
      HasSubstr("one time for each"));
  EXPECT_THAT(
      ErrorOf(
          R"({"type":"Feature","properties":{"times":["now",5]},"geometry":)" +
          line("[-71.4,41.5,-1],[-71.4,41.6,-1]") + "}"),
      HasSubstr("times[1]"));
}

TEST(ReadTrajectory, AFileThatIsNotThere) {
  const auto points = ReadTrajectory("/nonexistent/plan.csv", Defaults());
  EXPECT_EQ(points.status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(ExitCodeOf(points.status()), ExitCode::kBadFile);
}

}  // namespace
}  // namespace fathom::client::cli
