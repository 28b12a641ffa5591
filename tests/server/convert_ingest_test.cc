#include "server/convert_ingest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <numbers>
#include <string>
#include <variant>
#include <vector>

#include "server/limits.h"
#include "tests/server/sample_messages.h"
#include "tests/server/violation_matcher.h"
#include "tests/testing/status_matchers.h"

namespace fathom::server {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr auto kInvalid = v1::REJECT_REASON_INVALID_MESSAGE;
constexpr auto kNotFinite = v1::REJECT_REASON_NOT_FINITE;
constexpr auto kBadStd = v1::REJECT_REASON_BAD_STD;
constexpr auto kBadDepth = v1::REJECT_REASON_BAD_DEPTH;

// One way to spoil a message, and the error that must come of it.
template <typename Message>
struct Spoiled {
  const char* path;
  v1::RejectReason reason;
  std::function<void(Message&)> spoil;
};

absl::StatusOr<map::Ping> Convert(const v1::Ping& ping) {
  const FieldPath root;
  return ConvertPing(ping, FieldPath(root, "ping"));
}

absl::StatusOr<map::ContactReport> Convert(const v1::ContactReport& report) {
  const FieldPath root;
  return ConvertReport(report, FieldPath(root, "report"));
}

TEST(ConvertPing, TurnsDegreesAndSurfaceDepthsIntoRadiansAndDatumDepths) {
  v1::Ping ping = SamplePing();
  ping.mutable_time()->set_nanos(1'999);
  ping.mutable_pose()->set_position_std_m(2);
  ping.mutable_vertical_reference()->set_reference(
      v1::DEPTH_REFERENCE_WATER_SURFACE);
  ping.mutable_vertical_reference()->set_water_level_m(0.52);
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::Ping converted, Convert(ping));
  EXPECT_EQ(converted.activity.value, "leg-1");
  // 1 999 ns are cut to 1 us.
  EXPECT_EQ(ToUnixMicros(converted.time), kSampleSeconds * 1'000'000 + 1);
  EXPECT_EQ(converted.pose.position.latitude_deg, 41.5);
  // Below datum = below surface - level above datum: 3 - 0.52 and 20 - 0.52.
  EXPECT_DOUBLE_EQ(converted.pose.depth_m, 2.48);
  EXPECT_EQ(converted.pose.heading_deg, 90);
  EXPECT_EQ(converted.pose.position_std_m, 2);
  ASSERT_EQ(converted.beams.size(), 2U);
  EXPECT_FLOAT_EQ(converted.beams[1].bearing_rad, std::numbers::pi_v<float>);
  EXPECT_FLOAT_EQ(converted.beams[1].depth_m, 19.48F);
  EXPECT_EQ(converted.beams[1].range_m, 50);
  EXPECT_EQ(converted.beams[1].std_m, 0.5F);
}

TEST(ConvertPing, LeavesBadMeasurementsToTheMapWhichCountsThem) {
  v1::Ping ping = SamplePing();
  ping.set_depth_m(0, static_cast<float>(kNaN));
  ping.set_std_m(1, -1);
  EXPECT_THAT(Convert(ping), IsOk());
}

TEST(ConvertPing, NamesEveryBadField) {
  const std::vector<Spoiled<v1::Ping>> cases = {
      {"ping.activity_id", kInvalid, [](auto& p) { p.clear_activity_id(); }},
      {"ping.activity_id", kInvalid,
       [](auto& p) { p.set_activity_id("leg 1"); }},
      {"ping.activity_id", kInvalid,
       [](auto& p) { p.set_activity_id("leg:1"); }},
      {"ping.activity_id", kInvalid,
       [](auto& p) { p.set_activity_id(std::string(65, 'a')); }},
      {"ping.time", kInvalid, [](auto& p) { p.clear_time(); }},
      {"ping.time", kInvalid,
       [](auto& p) { p.mutable_time()->set_seconds(-1); }},
      {"ping.time", kInvalid,
       [](auto& p) { p.mutable_time()->set_seconds(4'291'747'200); }},
      {"ping.time", kInvalid,
       [](auto& p) { p.mutable_time()->set_nanos(1'000'000'000); }},
      {"ping.time", kInvalid, [](auto& p) { p.mutable_time()->set_nanos(-1); }},
      {"ping.pose", kInvalid, [](auto& p) { p.clear_pose(); }},
      {"ping.pose.position", kInvalid,
       [](auto& p) { p.mutable_pose()->clear_position(); }},
      {"ping.pose.position.latitude_deg", kNotFinite,
       [](auto& p) {
         p.mutable_pose()->mutable_position()->set_latitude_deg(kNaN);
       }},
      {"ping.pose.position.latitude_deg", kInvalid,
       [](auto& p) {
         p.mutable_pose()->mutable_position()->set_latitude_deg(90.001);
       }},
      {"ping.pose.position.longitude_deg", kInvalid,
       [](auto& p) {
         p.mutable_pose()->mutable_position()->set_longitude_deg(-180.001);
       }},
      {"ping.pose.position.longitude_deg", kNotFinite,
       [](auto& p) {
         p.mutable_pose()->mutable_position()->set_longitude_deg(-kInf);
       }},
      {"ping.pose.depth_m", kBadDepth,
       [](auto& p) { p.mutable_pose()->set_depth_m(12'000.5); }},
      {"ping.pose.depth_m", kBadDepth,
       [](auto& p) { p.mutable_pose()->set_depth_m(-100.5); }},
      {"ping.pose.depth_m", kNotFinite,
       [](auto& p) { p.mutable_pose()->set_depth_m(kInf); }},
      {"ping.pose.heading_deg", kInvalid,
       [](auto& p) { p.mutable_pose()->set_heading_deg(361); }},
      {"ping.pose.roll_deg", kInvalid,
       [](auto& p) { p.mutable_pose()->set_roll_deg(181); }},
      {"ping.pose.pitch_deg", kInvalid,
       [](auto& p) { p.mutable_pose()->set_pitch_deg(-91); }},
      {"ping.pose.position_std_m", kBadStd,
       [](auto& p) { p.mutable_pose()->set_position_std_m(-0.1); }},
      {"ping.vertical_reference.water_level_m", kInvalid,
       [](auto& p) {
         p.mutable_vertical_reference()->set_reference(
             v1::DEPTH_REFERENCE_WATER_SURFACE);
       }},
      {"ping.vertical_reference.water_level_m", kInvalid,
       [](auto& p) {
         p.mutable_vertical_reference()->set_reference(
             v1::DEPTH_REFERENCE_WATER_SURFACE);
         p.mutable_vertical_reference()->set_water_level_m(50.5);
       }},
      {"ping.vertical_reference.reference", kInvalid,
       [](auto& p) {
         p.mutable_vertical_reference()->set_reference(
             static_cast<v1::DepthReference>(9));
       }},
      {"ping.range_m", kInvalid,
       [](auto& p) {
         p.clear_range_m();
         p.clear_bearing_deg();
         p.clear_depth_m();
         p.clear_std_m();
       }},
      {"ping.bearing_deg", kInvalid, [](auto& p) { p.add_bearing_deg(0); }},
      {"ping.depth_m", kInvalid, [](auto& p) { p.clear_depth_m(); }},
      {"ping.std_m", kInvalid, [](auto& p) { p.add_std_m(1); }},
  };
  for (const auto& spoiled : cases) {
    v1::Ping ping = SamplePing();
    spoiled.spoil(ping);
    EXPECT_THAT(Convert(ping), Violates(spoiled.path, spoiled.reason));
  }
}

v1::Ping PingWithBeams(size_t count) {
  v1::Ping ping = SamplePing();
  const int size = static_cast<int>(count);
  ping.mutable_range_m()->Resize(size, 50);
  ping.mutable_bearing_deg()->Resize(size, 0);
  ping.mutable_depth_m()->Resize(size, 20);
  ping.mutable_std_m()->Resize(size, 1);
  return ping;
}

TEST(ConvertPing, TakesTheMostBeamsAndNotOneMore) {
  EXPECT_THAT(Convert(PingWithBeams(kMaxBeamsPerPing)), IsOk());
  EXPECT_THAT(Convert(PingWithBeams(kMaxBeamsPerPing + 1)),
              Violates("ping.range_m"));
}

TEST(CheckNumbering, NeedsSourceEpochAndSequence) {
  const FieldPath root;
  const FieldPath path(root, "ping");
  EXPECT_THAT(CheckNumbering(SamplePing(), path), IsOk());
  v1::Ping ping = SamplePing();
  ping.set_source_id("");
  EXPECT_THAT(CheckNumbering(ping, path), Violates("ping.source_id"));
  ping = SamplePing();
  ping.set_epoch(0);
  EXPECT_THAT(CheckNumbering(ping, path), Violates("ping.epoch"));
  ping = SamplePing();
  ping.set_sequence(0);
  EXPECT_THAT(CheckNumbering(ping, path), Violates("ping.sequence"));
  // 64 characters are the most; 65 fail above.
  ping = SamplePing();
  ping.set_source_id(std::string(64, 'Z'));
  EXPECT_THAT(CheckNumbering(ping, path), IsOk());
}

TEST(ConvertReport, KeepsEveryNumberOfAFix) {
  v1::ContactReport report = SampleFix();
  report.mutable_fix()->set_velocity_east_m_s(-4);
  report.set_depth_m(30);
  report.set_depth_std_m(5);
  report.mutable_vertical_reference()->set_reference(
      v1::DEPTH_REFERENCE_WATER_SURFACE);
  report.mutable_vertical_reference()->set_water_level_m(-1);
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::ContactReport converted,
                              Convert(report));
  EXPECT_EQ(converted.key.source.value, "ais");
  EXPECT_EQ(converted.key.contact.value, "MMSI:367000001");
  EXPECT_EQ(converted.contact_class, map::ContactClass::kVessel);
  EXPECT_EQ(*converted.depth_m, 31);  // 30 - (-1)
  EXPECT_EQ(*converted.depth_std_m, 5);
  const auto& fix = std::get<map::ContactFix>(converted.observation);
  EXPECT_EQ(fix.position.longitude_deg, -71.4);
  EXPECT_EQ(fix.velocity_north_m_s, 3);
  EXPECT_EQ(fix.velocity_east_m_s, -4);
  // Absent: the contract's defaults.
  EXPECT_EQ(fix.position_std_m, 10);
  EXPECT_EQ(fix.velocity_std_m_s, 0.5);
}

TEST(ConvertReport, KeepsEveryNumberOfARangeAndBearing) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::ContactReport converted,
                              Convert(SampleRangeBearing()));
  const auto& observation = std::get<map::RangeBearing>(converted.observation);
  EXPECT_EQ(observation.range_m, 1000);
  EXPECT_EQ(observation.bearing_deg, 30);
  EXPECT_EQ(observation.range_std_m, 10);
  EXPECT_EQ(observation.bearing_std_deg, 1);
}

TEST(ConvertReport, AnInactiveReportNeedsNoObservation) {
  v1::ContactReport report = SampleFix();
  report.clear_observation();
  EXPECT_THAT(Convert(report), Violates("report.observation"));
  report.set_inactive(true);
  EXPECT_THAT(Convert(report), IsOk());
}

TEST(ConvertReport, LinksNamesBesideAFixOrAlone) {
  v1::ContactReport report = SampleFix();
  EXPECT_EQ(Convert(report)->same_as, std::nullopt);
  report.mutable_same_as();
  EXPECT_EQ(Convert(report)->same_as, std::vector<map::ContactKey>{});
  v1::ContactName* name = report.mutable_same_as()->add_names();
  name->set_source_id("sonar");
  name->set_contact_id("S:1");
  const std::vector<map::ContactKey> names = {{{"sonar"}, {"S:1"}}};
  EXPECT_EQ(Convert(report)->same_as, names);
  // Nothing is observed.
  report.clear_observation();
  const auto alone = Convert(report);
  EXPECT_EQ(alone->same_as, names);
  EXPECT_TRUE(std::holds_alternative<map::NothingObserved>(alone->observation));

  const auto refused = [&report](auto spoil) {
    v1::ContactReport bad = report;
    spoil(bad);
    return Convert(bad);
  };
  EXPECT_THAT(refused([](auto& r) { r.set_inactive(true); }),
              Violates("report.same_as"));
  EXPECT_THAT(refused([](auto& r) {
                *r.mutable_range_bearing() =
                    SampleRangeBearing().range_bearing();
              }),
              Violates("report.same_as"));
  EXPECT_THAT(refused([](auto& r) {
                r.mutable_same_as()->mutable_names(0)->clear_source_id();
              }),
              Violates("report.same_as.names[0].source_id"));
  EXPECT_THAT(refused([](auto& r) {
                *r.mutable_same_as()->add_names() = r.same_as().names(0);
              }),
              Violates("report.same_as.names[1]", v1::REJECT_REASON_BAD_LINK));
  EXPECT_THAT(refused([](auto& r) {
                auto* own = r.mutable_same_as()->mutable_names(0);
                own->set_source_id(r.source_id());
                own->set_contact_id(r.contact_id());
              }),
              Violates("report.same_as.names[0]", v1::REJECT_REASON_BAD_LINK));
  EXPECT_FALSE(refused([](auto& r) {
                 for (int i = 0; i < 8; ++i) r.mutable_same_as()->add_names();
               }).ok());
}

TEST(ConvertReport, NamesEveryBadField) {
  const std::vector<Spoiled<v1::ContactReport>> fixes = {
      {"report.contact_id", kInvalid, [](auto& r) { r.clear_contact_id(); }},
      {"report.contact_id", kInvalid, [](auto& r) { r.set_contact_id("a/b"); }},
      {"report.contact_class", kInvalid,
       [](auto& r) { r.clear_contact_class(); }},
      {"report.contact_class", kInvalid,
       [](auto& r) { r.set_contact_class(static_cast<v1::ContactClass>(99)); }},
      {"report.time", kInvalid, [](auto& r) { r.clear_time(); }},
      {"report.fix.position", kInvalid,
       [](auto& r) { r.mutable_fix()->clear_position(); }},
      {"report.fix.position.latitude_deg", kInvalid,
       [](auto& r) {
         r.mutable_fix()->mutable_position()->set_latitude_deg(-91);
       }},
      {"report.fix.velocity_north_m_s", kInvalid,
       [](auto& r) { r.mutable_fix()->set_velocity_north_m_s(60.1); }},
      {"report.fix.velocity_east_m_s", kNotFinite,
       [](auto& r) { r.mutable_fix()->set_velocity_east_m_s(kNaN); }},
      {"report.fix.position_std_m", kBadStd,
       [](auto& r) { r.mutable_fix()->set_position_std_m(-1); }},
      {"report.fix.velocity_std_m_s", kBadStd,
       [](auto& r) { r.mutable_fix()->set_velocity_std_m_s(-1); }},
      {"report.depth_m", kBadDepth, [](auto& r) { r.set_depth_m(-101); }},
      {"report.depth_std_m", kBadStd, [](auto& r) { r.set_depth_std_m(0); }},
      {"report.vertical_reference.water_level_m", kNotFinite,
       [](auto& r) {
         r.mutable_vertical_reference()->set_reference(
             v1::DEPTH_REFERENCE_WATER_SURFACE);
         r.mutable_vertical_reference()->set_water_level_m(kNaN);
       }},
  };
  for (const auto& spoiled : fixes) {
    v1::ContactReport report = SampleFix();
    spoiled.spoil(report);
    EXPECT_THAT(Convert(report), Violates(spoiled.path, spoiled.reason));
  }
  const std::vector<Spoiled<v1::ContactReport>> bearings = {
      {"report.range_bearing.pose", kInvalid,
       [](auto& r) { r.mutable_range_bearing()->clear_pose(); }},
      {"report.range_bearing.pose.heading_deg", kNotFinite,
       [](auto& r) {
         r.mutable_range_bearing()->mutable_pose()->set_heading_deg(kNaN);
       }},
      {"report.range_bearing.range_m", v1::REJECT_REASON_ABOVE_MAX_RANGE,
       [](auto& r) { r.mutable_range_bearing()->set_range_m(200'001); }},
      {"report.range_bearing.range_m", v1::REJECT_REASON_ABOVE_MAX_RANGE,
       [](auto& r) { r.mutable_range_bearing()->set_range_m(0); }},
      {"report.range_bearing.bearing_deg", kInvalid,
       [](auto& r) { r.mutable_range_bearing()->set_bearing_deg(-361); }},
      {"report.range_bearing.range_std_m", kBadStd,
       [](auto& r) { r.mutable_range_bearing()->set_range_std_m(0); }},
      {"report.range_bearing.bearing_std_deg", kBadStd,
       [](auto& r) { r.mutable_range_bearing()->set_bearing_std_deg(60.1); }},
  };
  for (const auto& spoiled : bearings) {
    v1::ContactReport report = SampleRangeBearing();
    spoiled.spoil(report);
    EXPECT_THAT(Convert(report), Violates(spoiled.path, spoiled.reason));
  }
}

// A day after the samples' time.
const Time kNow =
    TimeFromUnixMicros((SampleFix().time().seconds() + 86'400) * 1'000'000);

TEST(ConvertReports, RefusesWhatIsFromTheFuture) {
  v1::ReportContactsRequest request;
  *request.add_reports() = SampleFix();
  const int64_t now_s = SampleFix().time().seconds() + 86'400;
  request.mutable_reports(0)->mutable_time()->set_seconds(now_s + 86'400 - 1);
  EXPECT_THAT(ConvertReports(request, kNow), IsOk());
  request.mutable_reports(0)->mutable_time()->set_seconds(now_s + 86'400 + 1);
  EXPECT_THAT(ConvertReports(request, kNow), Violates("reports[0].time"));
}

TEST(ConvertReports, NamesTheReportThatIsWrong) {
  v1::ReportContactsRequest request;
  for (int i = 0; i < 5; ++i) *request.add_reports() = SampleFix();
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto messages,
                              ConvertReports(request, kNow));
  EXPECT_EQ(messages.size(), 5U);
  request.mutable_reports(3)->clear_time();
  EXPECT_THAT(ConvertReports(request, kNow), Violates("reports[3].time"));
  request.mutable_reports(2)->set_sequence(0);
  EXPECT_THAT(ConvertReports(request, kNow), Violates("reports[2].sequence"));
  request.clear_reports();
  EXPECT_THAT(ConvertReports(request, kNow), Violates("reports"));
}

TEST(ConvertReports, TakesTheMostReportsAndNotOneMore) {
  v1::ReportContactsRequest request;
  for (size_t i = 0; i < kMaxReportsPerRequest; ++i) {
    *request.add_reports() = SampleFix();
  }
  EXPECT_THAT(ConvertReports(request, kNow), IsOk());
  *request.add_reports() = SampleFix();
  EXPECT_THAT(ConvertReports(request, kNow),
              StatusIs(absl::StatusCode::kResourceExhausted));
}

TEST(ToIngest, AMalformedMessageKeepsItsPlaceAsARefusal) {
  const FieldPath root;
  v1::Ping ping = SamplePing();
  ping.set_sequence(8);
  ping.mutable_pose()->set_heading_deg(kNaN);
  const IngestMessage message = ToIngest(ping, FieldPath(root, "ping"));
  EXPECT_EQ(message.kind, StreamKind::kPings);
  EXPECT_EQ(message.source.value, "auv-1");
  EXPECT_EQ(message.number, (MessageNumber{.epoch = 1, .sequence = 8}));
  const auto& refusal = std::get<Refusal>(message.content);
  EXPECT_EQ(refusal.reason, map::RejectReason::kNotFinite);
  EXPECT_EQ(refusal.field, "ping.pose.heading_deg");
  v1::Rejection rejection;
  WriteRejection(8, refusal, &rejection);
  EXPECT_EQ(rejection.sequence(), 8U);
  EXPECT_EQ(rejection.reason(), v1::REJECT_REASON_NOT_FINITE);
  EXPECT_EQ(rejection.field(), "ping.pose.heading_deg");
}

}  // namespace
}  // namespace fathom::server
