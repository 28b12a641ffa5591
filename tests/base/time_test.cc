#include "base/time.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <random>

#include "tests/testing/status_matchers.h"

namespace fathom {
namespace {

using ::fathom::testing::IsOkAndHolds;
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

// `date -ud 2002-05-24T16:05:09Z +%s` is 1022256309.
constexpr Time kMoment = TimeFromUnixMicros(1'022'256'309'000'000);

TEST(ParseTime, ReadsRfc3339) {
  EXPECT_THAT(ParseTime("2002-05-24T16:05:09Z"), IsOkAndHolds(kMoment));
  EXPECT_THAT(ParseTime("2002-05-24t16:05:09z"), IsOkAndHolds(kMoment));
  EXPECT_THAT(ParseTime("2002-05-24 16:05:09Z"), IsOkAndHolds(kMoment));
  EXPECT_THAT(ParseTime("1970-01-01T00:00:00Z"),
              IsOkAndHolds(TimeFromUnixMicros(0)));
}

// The examples of RFC 3339, section 5.8, that name the same or a known moment.
TEST(ParseTime, ReadsTheExamplesOfTheStandard) {
  // `date -ud 1985-04-12T23:20:50Z +%s` is 482196050.
  EXPECT_THAT(ParseTime("1985-04-12T23:20:50.52Z"),
              IsOkAndHolds(TimeFromUnixMicros(482'196'050'520'000)));
  // 16:39:57 at -08:00 is 00:39:57 UTC of the next day.
  EXPECT_EQ(*ParseTime("1996-12-19T16:39:57-08:00"),
            *ParseTime("1996-12-20T00:39:57Z"));
  // Netherlands in 1937: 20 minutes ahead of UTC.
  EXPECT_EQ(*ParseTime("1937-01-01T12:00:27.87+00:20"),
            *ParseTime("1937-01-01T11:40:27.870Z"));
}

TEST(ParseTime, CutsDigitsBelowAMicrosecond) {
  EXPECT_THAT(ParseTime("2002-05-24T16:05:09.000001999Z"),
              IsOkAndHolds(kMoment + Duration(1)));
  // Before 1970 cutting still means "earlier": -1 us + 0.9 us cut away.
  EXPECT_THAT(ParseTime("1969-12-31T23:59:59.9999999Z"),
              IsOkAndHolds(TimeFromUnixMicros(-1)));
}

TEST(ParseTime, KnowsTheCalendar) {
  EXPECT_THAT(ParseTime("2000-02-29T00:00:00Z"), testing::IsOk());
  EXPECT_THAT(
      ParseTime("1900-02-29T00:00:00Z"),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no such date")));
}

class ParseTimeRejects : public ::testing::TestWithParam<const char*> {};

TEST_P(ParseTimeRejects, WithInvalidArgumentAndTheText) {
  EXPECT_THAT(
      ParseTime(GetParam()),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(GetParam())));
}

INSTANTIATE_TEST_SUITE_P(
    Malformed, ParseTimeRejects,
    ::testing::Values("", "2002", "2002-05-24", "2002-5-24T16:05:09Z",
                      "2002-13-01T00:00:00Z", "2002-00-01T00:00:00Z",
                      "2002-05-24T24:00:00Z", "2002-05-24T16:60:00Z",
                      "2016-12-31T23:59:60Z", "2002-05-24T16:05:09",
                      "2002-05-24T16:05:09.Z", "2002-05-24T16:05:09,5Z",
                      "2002-05-24T16:05:09.0123456789Z",
                      "2002-05-24T16:05:09+0400", "2002-05-24T16:05:09+24:00",
                      "2002-05-24T16:05:09Z ", " 2002-05-24T16:05:09Z",
                      "-002-05-24T16:05:09Z", "+002-05-24T16:05:09Z"));

TEST(FormatTime, WritesOnlyTheDigitsThatCount) {
  EXPECT_EQ(FormatTime(kMoment), "2002-05-24T16:05:09Z");
  EXPECT_EQ(FormatTime(kMoment + Duration(250'000)),
            "2002-05-24T16:05:09.250Z");
  EXPECT_EQ(FormatTime(kMoment + Duration(1)), "2002-05-24T16:05:09.000001Z");
  EXPECT_EQ(FormatTime(TimeFromUnixMicros(-1)), "1969-12-31T23:59:59.999999Z");
}

TEST(FormatTime, ClampsWhatRfc3339CannotName) {
  constexpr auto kMin = std::numeric_limits<std::int64_t>::min();
  constexpr auto kMax = std::numeric_limits<std::int64_t>::max();
  EXPECT_EQ(FormatTime(TimeFromUnixMicros(kMin)), "0000-01-01T00:00:00Z");
  EXPECT_EQ(FormatTime(TimeFromUnixMicros(kMax)),
            "9999-12-31T23:59:59.999999Z");
}

TEST(FormatTime, IsReadBackToTheMicrosecond) {
  std::mt19937_64 random(20020524);
  // 1970 +- 1900 years: inside the years 0 to 9999. 6e16 us = 1901 years.
  std::uniform_int_distribution<std::int64_t> micros(-60'000'000'000'000'000,
                                                     60'000'000'000'000'000);
  for (int i = 0; i < 10'000; ++i) {
    const Time time = TimeFromUnixMicros(micros(random));
    EXPECT_THAT(ParseTime(FormatTime(time)), IsOkAndHolds(time));
  }
}

TEST(ToSeconds, KeepsFractions) {
  EXPECT_EQ(ToSeconds(Duration(1'500'000)), 1.5);
  EXPECT_EQ(ToSeconds(Duration(-250'000)), -0.25);
}

}  // namespace
}  // namespace fathom
