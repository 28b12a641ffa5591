// The survey record, the questions and the progress line: what others read.

#include "sim_feeder/survey_record.h"

#include <gtest/gtest.h>

#include "sim_feeder/progress_bar.h"
#include "sim_feeder/questions_command.h"
#include "tests/testing/status_matchers.h"

namespace fathom::feeder {
namespace {

using ::fathom::testing::StatusIs;

SurveyRecord Example() {
  SurveyRecord record;
  record.activity_id = "bay";
  record.source_id = "feeder";
  record.seed = 7;
  record.truth = "test";
  record.start_time = *ParseTime("2026-01-01T12:00:00Z");
  record.end_time = *ParseTime("2026-01-01T12:10:00.5Z");
  record.area = {.south_west = {41.5, -70.7},
                 .north_extent_m = 500.0,
                 .east_extent_m = 300.0,
                 .cell_size_m = 5.0};
  record.ships = {{.id = "ship-1",
                   .contact_class = v1::CONTACT_CLASS_SMALL_CRAFT,
                   .start = {.north_m = 10.0, .east_m = -20.0},
                   .north_m_s = 1.5,
                   .east_m_s = -2.5,
                   .changes = {{.at_s = 20, .north_m_s = 0, .east_m_s = 1}}}};
  record.pings = 600;
  record.measurements = 9000;
  record.pings_durable = 600;
  record.rejects = {{"OUTSIDE_AREA", 12}};
  record.seconds = 2.0;
  return record;
}

TEST(SurveyRecord, ComesBackAsItWas) {
  const SurveyRecord record = Example();
  const std::string json = ToJson(record);
  EXPECT_EQ(json.find('\n'), std::string::npos);
  // 600 pings in 2 s.
  EXPECT_NE(json.find("\"pings_per_s\":300.0"), std::string::npos);
  FATHOM_ASSERT_OK_AND_ASSIGN(const SurveyRecord back, ParseSurveyRecord(json));
  EXPECT_EQ(ToJson(back), json);
  EXPECT_EQ(back.ships[0].PlaceAt(10.0).north_m, 25.0);
  EXPECT_EQ(back.ships[0].PlaceAt(30.0).north_m,
            back.ships[0].PlaceAt(20.0).north_m);
  EXPECT_EQ(back.end_time, record.end_time);
}

TEST(SurveyRecord, RefusesOtherText) {
  EXPECT_THAT(ParseSurveyRecord("{}"),
              StatusIs(absl::StatusCode::kInvalidArgument));
  EXPECT_THAT(ParseSurveyRecord("not json"),
              StatusIs(absl::StatusCode::kInvalidArgument));
  EXPECT_THAT(LoadSurveyRecord("/nowhere/survey.json"),
              StatusIs(absl::StatusCode::kNotFound));
}

TEST(MakeQuestions, SameSeedSameQuestions) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::string first,
                              MakeQuestions(Example(), 3, 100));
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::string second,
                              MakeQuestions(Example(), 3, 100));
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::string other,
                              MakeQuestions(Example(), 4, 100));
  EXPECT_EQ(first, second);
  EXPECT_NE(first, other);
  EXPECT_EQ(std::count(first.begin(), first.end(), '\n'), 101);
  EXPECT_THAT(MakeQuestions(Example(), 3, 0),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST(FormatProgress, ShowsShareRateAndTimeLeft) {
  // 500 of 2000 in 10 s: 25 %, 50 a second, 1500 left: 30 s.
  EXPECT_EQ(FormatProgress(500, 2000, "pings", 10.0, "note"),
            "[#####...............]  25 %  500/2000 pings  50/s  ETA 0:30  "
            "note");
}

}  // namespace
}  // namespace fathom::feeder
