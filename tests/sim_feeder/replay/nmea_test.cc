#include "sim_feeder/replay/nmea.h"

#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "tests/testing/status_matchers.h"

namespace fathom::feeder {
namespace {

std::string ReasonOf(std::string_view line) {
  return std::string(ParseNmea(line).status().message());
}

TEST(ParseNmea, ReadsAPublishedSentence) {
  // The RMC of the NMEA handbook's example; its checksum is 6A.
  const absl::StatusOr<NmeaSentence> sentence = ParseNmea(
      "$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A\r");
  FATHOM_ASSERT_OK(sentence);
  EXPECT_EQ(sentence->address, "GPRMC");
  EXPECT_EQ(sentence->type(), "RMC");
  ASSERT_EQ(sentence->fields.size(), 11U);
  EXPECT_EQ(sentence->field(1), "A");
  EXPECT_EQ(sentence->field(10), "W");
  EXPECT_EQ(sentence->field(11), "");
  EXPECT_FALSE(sentence->tag_time.has_value());
}

TEST(ParseNmea, NamesWhyNot) {
  EXPECT_EQ(ReasonOf("$GPRMC,123519,A*00"), "bad checksum");
  EXPECT_EQ(ReasonOf("$GPRMC,123519,A*6"), "bad checksum");
  EXPECT_EQ(ReasonOf("$GPRMC,123519,A*ZZ"), "bad checksum");
  EXPECT_EQ(ReasonOf("$GPRMC,123519,A"), "no checksum");
  EXPECT_EQ(ReasonOf("hello"), "not a sentence");
  EXPECT_EQ(ReasonOf("\\c:1"), "not a sentence");
  EXPECT_EQ(ReasonOf("$" + std::string(1024, 'A')), "line too long");
  // "A" xor "B" is 3.
  EXPECT_EQ(ReasonOf("$AB*03"), "not a sentence");
}

TEST(ParseNmea, TakesTheTimeOfATagBlockWhoseChecksumHolds) {
  const std::string body = "!AIVDM,1,1,,B,13F?Vv700<DJuLEtvep`iToV0<00,0*78";
  // The sentence is a view: its line must live as long.
  const std::string good =
      "\\s:rORBCOMM104,q:u,c:1418172113,T:2014-12-10 00.41.53*55\\" + body;
  const absl::StatusOr<NmeaSentence> told = ParseNmea(good);
  FATHOM_ASSERT_OK(told);
  EXPECT_EQ(told->tag_time, Time(std::chrono::seconds(1'418'172'113)));
  EXPECT_EQ(told->field(4), "13F?Vv700<DJuLEtvep`iToV0<00");

  const std::string bad =
      "\\s:rORBCOMM104,q:u,c:1418172113,T:2014-12-10 00.41.53*56\\" + body;
  const absl::StatusOr<NmeaSentence> untold = ParseNmea(bad);
  FATHOM_ASSERT_OK(untold);
  EXPECT_FALSE(untold->tag_time.has_value());
}

TEST(IsNmeaComment, IsTrueOfWhatHoldsNothing) {
  EXPECT_TRUE(IsNmeaComment(""));
  EXPECT_TRUE(IsNmeaComment(" \r"));
  EXPECT_TRUE(IsNmeaComment("# a log"));
  EXPECT_FALSE(IsNmeaComment("$GPRMC"));
}

TEST(NmeaPlace, CountsDegreesAndMinutes) {
  // 48 degrees 7.038 minutes: 48 + 7.038 / 60.
  const auto place = NmeaPlace("4807.038", "N", "01131.000", "W");
  ASSERT_TRUE(place.has_value());
  EXPECT_NEAR(place->latitude_deg, 48.1173, 1e-9);
  EXPECT_NEAR(place->longitude_deg, -(11 + 31.0 / 60), 1e-9);
  EXPECT_FALSE(NmeaPlace("", "N", "01131.000", "E").has_value());
  EXPECT_FALSE(NmeaPlace("4860.000", "N", "01131.000", "E").has_value());
  EXPECT_FALSE(NmeaPlace("9000.001", "N", "01131.000", "E").has_value());
  EXPECT_FALSE(NmeaPlace("4807.038", "X", "01131.000", "E").has_value());
  EXPECT_FALSE(NmeaPlace("4807.038", "N", "nan", "E").has_value());
}

TEST(NmeaTimeOfDay, KnowsTheClock) {
  // 12:35:19.25 is 45319.25 s.
  EXPECT_EQ(NmeaTimeOfDay("123519.25"), Duration(45'319'250'000));
  EXPECT_EQ(NmeaTimeOfDay("000000"), Duration(0));
  EXPECT_FALSE(NmeaTimeOfDay("240000").has_value());
  EXPECT_FALSE(NmeaTimeOfDay("126000").has_value());
  EXPECT_FALSE(NmeaTimeOfDay("123560").has_value());
  EXPECT_FALSE(NmeaTimeOfDay("12:35").has_value());
  EXPECT_FALSE(NmeaTimeOfDay("").has_value());
}

TEST(NmeaDate, KnowsTheCalendar) {
  EXPECT_EQ(NmeaDate("230394"),
            Time(std::chrono::sys_days(std::chrono::year(1994) / 3 / 23)));
  EXPECT_EQ(NmeaDate("290220"),
            Time(std::chrono::sys_days(std::chrono::year(2020) / 2 / 29)));
  EXPECT_FALSE(NmeaDate("290221").has_value());
  EXPECT_FALSE(NmeaDate("001301").has_value());
  EXPECT_FALSE(NmeaDate("").has_value());
}

}  // namespace
}  // namespace fathom::feeder
