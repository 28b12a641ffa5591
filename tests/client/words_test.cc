// The words of the command line, geometry for areas, CSV of points.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <sstream>

#include "client/cli/arguments.h"
#include "client/cli/exit_code.h"
#include "client/cli/geo_math.h"
#include "client/cli/import_id.h"
#include "client/cli/points_file.h"
#include "client/cli/progress_bar.h"
#include "client/cli/text.h"
#include "client/cli/value_scale.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client::cli {
namespace {

using ::fathom::testing::IsOkAndHolds;
using ::fathom::testing::StatusIs;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// 2002-05-24T00:00:00Z.
constexpr Time kNow = TimeFromUnixMicros(1'022'198'400'000'000);

v1::GeodeticPoint Point(double latitude_deg, double longitude_deg) {
  v1::GeodeticPoint point;
  point.set_latitude_deg(latitude_deg);
  point.set_longitude_deg(longitude_deg);
  return point;
}

TEST(ParsePoint, TakesLatitudeThenLongitude) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::GeodeticPoint point,
                              ParsePoint("-33.85, 151.25"));
  EXPECT_EQ(point.latitude_deg(), -33.85);
  EXPECT_EQ(point.longitude_deg(), 151.25);
  for (const char* bad : {"", "41.6", "41.6,", "91,0", "0,181", "nan,0",
                          "41.6,-71.4,3", "41.6;-71.4", "inf,0", "1e999,0"}) {
    const absl::Status status = ParsePoint(bad).status();
    EXPECT_THAT(status, StatusIs(absl::StatusCode::kInvalidArgument)) << bad;
    EXPECT_EQ(ExitCodeOf(status), ExitCode::kUsage);
  }
}

TEST(ParseMoment, TakesNowOffsetsAndRfc3339) {
  EXPECT_THAT(ParseMoment("now", kNow), IsOkAndHolds(kNow));
  EXPECT_THAT(ParseMoment("+10min", kNow),
              IsOkAndHolds(kNow + std::chrono::minutes(10)));
  EXPECT_THAT(ParseMoment("-1.5h", kNow),
              IsOkAndHolds(kNow - std::chrono::minutes(90)));
  EXPECT_THAT(ParseMoment("-2d", kNow),
              IsOkAndHolds(kNow - std::chrono::hours(48)));
  EXPECT_THAT(ParseMoment("2002-05-24T00:00:01Z", kNow),
              IsOkAndHolds(kNow + std::chrono::seconds(1)));
  for (const char* bad : {"", "10min", "+10", "+min", "+1e400s", "+9999999d",
                          "yesterday", "+5y"}) {
    EXPECT_THAT(ParseMoment(bad, kNow),
                StatusIs(absl::StatusCode::kInvalidArgument))
        << bad;
  }
}

TEST(ParseBox, MayCrossTheAntimeridian) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const GeoBox box, ParseBox("-10,170,10,-170"));
  EXPECT_EQ(box.Width(), 20);
  EXPECT_THAT(ParseBox("10,0,-10,5"),
              StatusIs(absl::StatusCode::kInvalidArgument));
  EXPECT_THAT(ParseBox("1,2,3"), StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST(ExitCode, FollowsTheMarkAndThenTheCode) {
  EXPECT_EQ(ExitCodeOf(absl::OkStatus()), ExitCode::kOk);
  EXPECT_EQ(ExitCodeOf(absl::NotFoundError("x")), ExitCode::kRefused);
  EXPECT_EQ(ExitCodeOf(absl::UnavailableError("x")), ExitCode::kUnreachable);
  EXPECT_EQ(ExitCodeOf(FileError(absl::NotFoundError("x"))),
            ExitCode::kBadFile);
  EXPECT_EQ(ExitCodeOf(UsageError(absl::NotFoundError("x"))), ExitCode::kUsage);
  // The first mark stays.
  EXPECT_EQ(ExitCodeOf(FileError(UsageError(absl::NotFoundError("x")))),
            ExitCode::kUsage);
}

TEST(MetersPerDegree, MatchTheEllipsoid) {
  // WGS 84: a degree of latitude is 110 574.3 m at the equator, 111 693.9 m
  // at the pole; of longitude 111 319.5 m at the equator (2 pi a / 360).
  EXPECT_NEAR(MetersPerDegreeAt(0).latitude, 110'574.3, 0.1);
  EXPECT_NEAR(MetersPerDegreeAt(90).latitude, 111'693.9, 0.1);
  EXPECT_NEAR(MetersPerDegreeAt(0).longitude, 111'319.5, 0.1);
}

TEST(MissionBox, HoldsTheSquareOf1267NauticalMilesAtNarragansett) {
  // Half of 1267 nmi is 10.56 degrees of latitude: from 41.6 N the western
  // side's ends lie near 30.6 and 51.2 N.
  const GeoBox box = MissionBox(Point(30.3, -82.5), Point(51.2, -88.4));
  EXPECT_LT(box.south_deg, 30.3);
  EXPECT_GT(box.south_deg, 29);
  EXPECT_GT(box.north_deg, 51.2);
  EXPECT_LT(box.west_deg, -88.4);
  EXPECT_GT(box.west_deg, -90);
  // The square is about as far east of Narragansett Bay as west of it.
  EXPECT_NEAR(box.east_deg, -54.5, 2);
}

TEST(MissionBox, CrossesTheAntimeridianAndHoldsThePole) {
  const GeoBox box = MissionBox(Point(-1, 179.5), Point(1, 179.5));
  EXPECT_NEAR(box.Width(), 2.0, 0.1);
  EXPECT_GT(box.west_deg, box.east_deg);
  // A square of 40 degrees around the north pole: its western side from
  // (64 N, -135) to (64 N, 135).
  const GeoBox polar = MissionBox(Point(64, -135), Point(64, 135));
  EXPECT_EQ(polar.north_deg, 90);
  EXPECT_EQ(polar.Width(), 360);
}

TEST(ReadPoints, TakesPlainNumbersOrNamedColumns) {
  std::istringstream plain("# a comment\n41.6,-71.4,20\n\n41.5,-71.3,35\n");
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::vector<QuestionPoint> points,
                              ReadPoints(plain, std::nullopt, kNow));
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[1].depth_m, 35);
  EXPECT_FALSE(points[0].time.has_value());
  std::istringstream named(
      "time,lon,lat\n2002-05-24T00:00:00Z,-71.4,41.6\n,-71.3,41.5\n");
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::vector<QuestionPoint> timed,
                              ReadPoints(named, 7, kNow));
  EXPECT_EQ(timed[0].latitude_deg, 41.6);
  EXPECT_EQ(timed[0].depth_m, 7);
  EXPECT_EQ(timed[0].time, kNow);
  EXPECT_FALSE(timed[1].time.has_value());
}

TEST(ReadPoints, ErrorNamesTheLine) {
  std::istringstream bad("41.6,-71.4,20\n41.6,-171.4x,20\n");
  const absl::Status status = ReadPoints(bad, std::nullopt, kNow).status();
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kInvalidArgument,
                               HasSubstr("line 2")));
  EXPECT_EQ(ExitCodeOf(status), ExitCode::kBadFile);
  std::istringstream shallow("41.6,-71.4\n");
  EXPECT_THAT(
      ReadPoints(shallow, std::nullopt, kNow),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--depth-m")));
  std::istringstream empty("lat,lon,depth\n");
  EXPECT_THAT(ReadPoints(empty, std::nullopt, kNow),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST(Text, CountsSpansAndSizes) {
  EXPECT_EQ(CountText(7), "7");
  EXPECT_EQ(CountText(1000), "1 000");
  EXPECT_EQ(CountText(1'234'567), "1 234 567");
  EXPECT_EQ(SpanText(90), "90 s");
  EXPECT_EQ(SpanText(600), "10.0 min");
  EXPECT_EQ(BytesText(1536), "1.5 KB");
  EXPECT_EQ(StateText(v1::OBSTACLE_STATE_FREE), "FREE");
  EXPECT_EQ(ClassText(v1::CONTACT_CLASS_SMALL_CRAFT), "small_craft");
}

TEST(ProgressLine, TellsShareRateAndTimeLeft) {
  // A quarter of 4000 cells in 2 s: 500 a second, 6 s left.
  const std::string line = ProgressLine("import", "cells", 1000, 4000, 2);
  EXPECT_THAT(line, HasSubstr(" 25 %"));
  EXPECT_THAT(line, HasSubstr("500 cells/s"));
  EXPECT_THAT(line, HasSubstr("6 s left"));
}

TEST(ValueScale, TicksAreRound) {
  EXPECT_THAT(ValueScale(0, 25, ValueScale::Kind::kLinear).Ticks(8),
              ElementsAre(0, 5, 10, 15, 20, 25));
  EXPECT_THAT(ValueScale(0.1, 10, ValueScale::Kind::kLogarithmic).Ticks(2),
              ElementsAre(DoubleNear(0.1, 1e-9), DoubleNear(0.5, 1e-9),
                          DoubleNear(2, 1e-9), DoubleNear(10, 1e-9)));
  EXPECT_EQ(RoundStep(7.3), 5);
  EXPECT_EQ(RoundStep(2), 2);
  EXPECT_DOUBLE_EQ(RoundStep(0.019), 0.01);
}

TEST(ValueScale, PlacesRunFromZeroToOne) {
  // sqrt(100 / 400), log(10 / 1) / log(100 / 1), 100 / 400.
  EXPECT_DOUBLE_EQ(ValueScale(0, 400, ValueScale::Kind::kRoot).Place(100), 0.5);
  EXPECT_DOUBLE_EQ(ValueScale(1, 100, ValueScale::Kind::kLogarithmic).Place(10),
                   0.5);
  EXPECT_DOUBLE_EQ(ValueScale(0, 400, ValueScale::Kind::kLinear).Place(100),
                   0.25);
}

TEST(ValueScale, CoversTheQuantilesAndSkipsNan) {
  std::vector<float> values(100, std::nanf(""));
  for (int i = 0; i < 50; ++i) {
    values[static_cast<std::size_t>(i)] = static_cast<float>(i);
  }
  const ValueScale scale =
      ValueScale::Covering(values, 0, 1, ValueScale::Kind::kLogarithmic);
  EXPECT_EQ(scale.kind(), ValueScale::Kind::kLinear);
  EXPECT_EQ(scale.low(), 0);
  EXPECT_EQ(scale.high(), 50);
  EXPECT_DOUBLE_EQ(scale.Place(25), 0.5);
  // All equal: still a scale, with the value inside.
  const ValueScale flat =
      ValueScale::Covering({3, 3, 3}, 0, 1, ValueScale::Kind::kLinear);
  EXPECT_LT(flat.low(), 3);
  EXPECT_GT(flat.high(), 3);
  // Nothing known.
  EXPECT_EQ(ValueScale::Covering({}, 0, 1, ValueScale::Kind::kRoot).high(), 1);
}

TEST(ImportId, DigestTellsEveryBitAndOrderApart) {
  const auto of = [](const std::vector<std::string>& fields) {
    Digest digest;
    for (const std::string& field : fields) digest.AddField(field);
    return digest.Hex();
  };
  EXPECT_EQ(of({"abc"}), of({"abc"}));
  std::set<std::string> seen = {of({}),
                                of({""}),
                                of({"a"}),
                                of({"b"}),
                                of({"ab", "c"}),
                                of({"a", "bc"}),
                                of({"abc"}),
                                of({"c", "ab"}),
                                of({std::string(1, '\0')}),
                                of({std::string(8, '\0')})};
  EXPECT_EQ(seen.size(), 10u);
  // Each single bit of 1000 bytes.
  std::string bytes(1000, 'x');
  for (std::size_t bit = 0; bit < 8000; ++bit) {
    bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << (bit % 8)));
    seen.insert(of({bytes}));
    bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << (bit % 8)));
  }
  EXPECT_EQ(seen.size(), 8010u);
}

}  // namespace
}  // namespace fathom::client::cli
