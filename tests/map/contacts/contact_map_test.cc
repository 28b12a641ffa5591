#include "map/contacts/contact_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <variant>

#include "map/geodesy/ned_frame.h"
#include "tests/map/contacts/contact_testing.h"
#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kRadPerDeg = std::numbers::pi / 180.0;

TEST(ContactMap, FirstReportStandsWhereItWasHeard) {
  ContactMap map(ContactMapOptions{.filter = FilterKind::kPerAxis});
  ContactReport report = Heard("a", 0, kBay, 1000, 60);
  std::get<RangeBearing>(report.observation).pose.heading_deg = 30;
  const ContactOutcome outcome = map.Apply(report);
  ASSERT_TRUE(outcome.applied);
  const ContactEstimate& estimate = outcome.estimate.value();
  // Fig. 5-4 line 2: 30 + 60 is due east.
  const RangeAzimuth place = Inverse(kBay, estimate.Position());
  EXPECT_NEAR(place.distance_m, 1000, 1e-3);
  EXPECT_NEAR(place.azimuth_deg, 90, 1e-4);
  EXPECT_EQ(estimate.status, ContactStatus::kNew);
  EXPECT_EQ(estimate.report_count, 1u);
  EXPECT_EQ(estimate.x(2), 0);
  // North is across the ray: (1000 * 1 degree)^2; east along: 20^2.
  const double across_m = 1000 * kRadPerDeg;
  EXPECT_NEAR(estimate.P(0, 0), across_m * across_m, 0.1);
  EXPECT_NEAR(estimate.P(1, 1), 400, 0.1);
  // The wide prior of a vessel's velocity: 8 m/s.
  EXPECT_EQ(estimate.P(2, 2), 64);
  EXPECT_EQ(estimate.P(3, 3), 64);
  EXPECT_EQ(estimate.radius_m, 100);
  EXPECT_EQ(estimate.top_depth_m, 0);
  EXPECT_EQ(estimate.keel_depth_m, 10);
}

TEST(ContactMap, DefaultFilterTakesTheBiasOut) {
  ContactMap map(ContactMapOptions{});
  ContactReport report = Heard("a", 0, kBay, 10'000, 0);
  std::get<RangeBearing>(report.observation).bearing_std_deg = 10;
  const ContactEstimate estimate = map.Apply(report).estimate.value();
  // e^(-s/2) with s = (10 degrees)^2 = 0.0304617: 0.984885... * 10 km.
  EXPECT_NEAR(DistanceM(kBay, estimate.Position()),
              10'000 * std::exp(-0.0304617419786709 / 2), 0.01);
}

TEST(ContactMap, OwnPositionUncertaintyWidensTheReport) {
  ContactMap map(ContactMapOptions{});
  ContactReport report = Heard("a", 0, kBay, 1000, 0);
  const double sharp = map.Apply(report).estimate->P(0, 0);
  report.key = Key("b");
  std::get<RangeBearing>(report.observation).pose.position_std_m = 30;
  EXPECT_NEAR(map.Apply(report).estimate->P(0, 0), sharp + 900, 1e-6);
}

TEST(ContactMap, SecondReportGivesAVelocity) {
  ContactMap map(ContactMapOptions{});
  map.Apply(Heard("a", 0, kBay, 1000, 0));
  const ContactEstimate estimate =
      map.Apply(Heard("a", 60, kBay, 1300, 0)).estimate.value();
  EXPECT_EQ(estimate.status, ContactStatus::kActive);
  EXPECT_EQ(estimate.report_count, 2u);
  // Two points: 300 m in 60 s is 5 m/s; the prior, 0 +- 8 m/s, draws it down
  // by (20^2 + 20^2) / 60^2 / 64 or so: 0.3 %.
  EXPECT_NEAR(estimate.x(2), 5, 0.05);
  EXPECT_NEAR(estimate.x(3), 0, 0.01);
}

TEST(ContactMap, FixOverwrites) {
  ContactMap map(ContactMapOptions{});
  map.Apply(Heard("a", 0, kBay, 1000, 0));
  const GeodeticPoint place = Direct(kBay, 10, 1100);
  ContactReport fix = Fix("a", 10, place, 3, -4);
  const ContactEstimate estimate = map.Apply(fix).estimate.value();
  EXPECT_EQ(estimate.Position(), place);
  EXPECT_EQ(estimate.x, Eigen::Vector4d(0, 0, 3, -4));
  // The default stds: 10 m and 0.5 m/s.
  EXPECT_EQ(estimate.P.diagonal(), Eigen::Vector4d(100, 100, 0.25, 0.25));
  EXPECT_EQ(estimate.P(0, 1), 0);
  // A fix said to be exact keeps a positive covariance.
  fix.time = AtS(20);
  std::get<ContactFix>(fix.observation).position_std_m = 0;
  std::get<ContactFix>(fix.observation).velocity_std_m_s = 0;
  EXPECT_GT(map.Apply(fix).estimate->P(0, 0), 0);
}

TEST(ContactMap, FirstFixIsTrackedAtOnce) {
  ContactMap map(ContactMapOptions{});
  EXPECT_EQ(map.Apply(Fix("a", 0, kBay)).estimate->status,
            ContactStatus::kActive);
}

TEST(ContactMap, ReportAtTheSameTimeIsAnotherLook) {
  ContactMap map(ContactMapOptions{});
  const ContactEstimate before =
      *map.Apply(Heard("a", 100, kBay, 1000, 0)).estimate;
  const ContactOutcome same = map.Apply(Heard("a", 100, kBay, 1010, 0));
  EXPECT_TRUE(same.applied);
  EXPECT_LT(same.estimate->P(0, 0), before.P(0, 0));
}

TEST(ContactMap, SilenceStartsTheTrackAnew) {
  ContactMap map(ContactMapOptions{});
  const double stale_s =
      DefaultContactClasses()[static_cast<std::size_t>(ContactClass::kVessel)]
          .stale_after_s;
  map.Apply(Fix("a", 0, kBay, 5, 0));
  EXPECT_EQ(map.View().At(Key("a"), AtS(stale_s))->status,
            ContactStatus::kActive);
  EXPECT_EQ(map.View().At(Key("a"), AtS(stale_s + 1))->status,
            ContactStatus::kStale);
  // At the limit the track goes on, past it a new one begins (section 5.5).
  map.Apply(Heard("a", stale_s, kBay, 3000, 0));
  EXPECT_EQ(map.View().At(Key("a"), AtS(stale_s))->report_count, 2u);
  const ContactEstimate anew =
      *map.Apply(Heard("a", 2 * stale_s + 1, kBay, 500, 90)).estimate;
  EXPECT_EQ(anew.report_count, 1u);
  EXPECT_EQ(anew.status, ContactStatus::kNew);
  EXPECT_EQ(anew.x(2), 0);
  EXPECT_EQ(anew.track_start, AtS(2 * stale_s + 1));
  // The former life still answers for its own time.
  EXPECT_NEAR(map.View().At(Key("a"), AtS(10))->x(2), 5, 0.01);
  EXPECT_EQ(map.live_count(), 1u);
}

TEST(ContactMap, InactiveReportClosesTheTrack) {
  ContactMap map(ContactMapOptions{});
  map.Apply(Fix("a", 0, kBay, 5, 0));
  ContactReport gone = Fix("a", 60, kBay);
  gone.inactive = true;
  const ContactOutcome outcome = map.Apply(gone);
  EXPECT_TRUE(outcome.applied);
  EXPECT_EQ(outcome.estimate->status, ContactStatus::kDropped);
  EXPECT_EQ(outcome.estimate->x(0), 300);  // 60 s at 5 m/s.
  const ContactsView view = map.View();
  EXPECT_TRUE(view.At(Key("a"), AtS(59)).has_value());
  EXPECT_FALSE(view.At(Key("a"), AtS(60)).has_value());
  EXPECT_FALSE(view.At(Key("a"), AtS(1000)).has_value());
  EXPECT_EQ(view.size(), 1u);
  EXPECT_EQ(view.live_count(), 0u);
  // Told again, or of a stranger: nothing to do, and no error.
  gone.time = AtS(61);
  EXPECT_TRUE(map.Apply(gone).applied);
  gone.key = Key("stranger");
  EXPECT_TRUE(map.Apply(gone).applied);
  EXPECT_EQ(map.View().size(), 1u);
  // It returns as a new track.
  EXPECT_EQ(map.Apply(Heard("a", 70, kBay, 100, 0)).estimate->report_count, 1u);
  EXPECT_TRUE(map.View().At(Key("a"), AtS(70)).has_value());
  EXPECT_FALSE(map.View().At(Key("a"), AtS(65)).has_value());
}

TEST(ContactMap, DropClosesTheTrackOnce) {
  ContactMap map(ContactMapOptions{});
  EXPECT_FALSE(map.Drop(Key("a"), AtS(0)).applied);
  map.Apply(Fix("a", 100, kBay));
  // A clock behind the reports': the track ends with its newest estimate.
  const ContactOutcome outcome = map.Drop(Key("a"), AtS(50));
  EXPECT_TRUE(outcome.applied);
  EXPECT_EQ(outcome.estimate->time, AtS(100));
  EXPECT_FALSE(map.View().At(Key("a"), AtS(100)).has_value());
  EXPECT_FALSE(map.Drop(Key("a"), AtS(200)).applied);
}

TEST(ContactMap, OneContactTooManyIsRefusedAndTheOthersGoOn) {
  ContactMap map(ContactMapOptions{.max_contacts = 2});
  EXPECT_TRUE(map.Apply(Fix("a", 0, kBay)).applied);
  EXPECT_TRUE(map.Apply(Fix("b", 0, kBay)).applied);
  const ContactOutcome full = map.Apply(Fix("c", 0, kBay));
  EXPECT_FALSE(full.applied);
  EXPECT_EQ(full.reason, RejectReason::kContactsFull);
  EXPECT_FALSE(full.estimate.has_value());
  EXPECT_EQ(map.View().Find(Key("c")), nullptr);
  EXPECT_TRUE(map.Apply(Fix("a", 1, kBay)).applied);
  EXPECT_TRUE(map.Apply(Fix("b", 1, kBay)).applied);
  EXPECT_TRUE(map.Drop(Key("a"), AtS(2)).applied);
  EXPECT_TRUE(map.Apply(Fix("c", 3, kBay)).applied);
  // A dropped one that returns needs a place as well.
  EXPECT_EQ(map.Apply(Fix("a", 4, kBay)).reason, RejectReason::kContactsFull);
}

TEST(ContactMap, TheOneThatIsStaleLongestMakesRoom) {
  // Vessels are stale after 600 s.
  ContactMap map(ContactMapOptions{.max_contacts = 2});
  ASSERT_TRUE(map.Apply(Fix("a", 0, kBay)).applied);
  ASSERT_TRUE(map.Apply(Fix("b", 100, kBay)).applied);
  EXPECT_EQ(map.Apply(Fix("c", 600, kBay)).reason, RejectReason::kContactsFull);
  const ContactOutcome outcome = map.Apply(Fix("c", 601, kBay));
  EXPECT_TRUE(outcome.applied);
  ASSERT_EQ(outcome.ended.size(), 1u);
  EXPECT_EQ(outcome.ended[0].key, Key("a"));
  EXPECT_EQ(outcome.ended[0].status, ContactStatus::kDropped);
  EXPECT_EQ(outcome.ended[0].time, AtS(601));
  EXPECT_EQ(map.live_count(), 2u);
  // Its past answers on, and the other is tracked on.
  EXPECT_TRUE(map.View().At(Key("a"), AtS(300)).has_value());
  EXPECT_TRUE(map.View().At(Key("b"), AtS(650)).has_value());
  // It returns when another is stale, and starts anew.
  EXPECT_EQ(map.Apply(Fix("a", 650, kBay)).reason, RejectReason::kContactsFull);
  const ContactOutcome back = map.Apply(Fix("a", 701, kBay));
  EXPECT_TRUE(back.applied);
  EXPECT_EQ(back.estimate->report_count, 1u);
  ASSERT_EQ(back.ended.size(), 1u);
  EXPECT_EQ(back.ended[0].key, Key("b"));
  // Nothing is stale before 1201 s; but an old report makes room that soon
  // falls free: what was known of that is known no more.
  EXPECT_FALSE(map.Apply(Fix("d", 800, kBay)).applied);
  ASSERT_TRUE(map.Drop(Key("a"), AtS(800)).applied);
  ASSERT_TRUE(map.Apply(Fix("e", 150, kBay)).applied);
  EXPECT_TRUE(map.Apply(Fix("d", 800, kBay)).applied);
}

TEST(ContactMap, RemembersAsManyDroppedOnesAsMayLive) {
  ContactMap map(ContactMapOptions{.max_contacts = 2});
  for (int i = 0; i < 5; ++i) {
    const std::string name = std::to_string(i);
    map.Apply(Fix(name, i, kBay));
    map.Drop(Key(name), AtS(i));
  }
  const ContactsView view = map.View();
  EXPECT_EQ(view.size(), 2u);
  EXPECT_EQ(view.Find(Key("2")), nullptr);
  EXPECT_NE(view.Find(Key("3")), nullptr);
  EXPECT_NE(view.Find(Key("4")), nullptr);
}

TEST(ContactMap, BadReportsAreRefusedByReasonAndChangeNothing) {
  ContactMap map(ContactMapOptions{});
  const auto reason = [&map](const ContactReport& report) {
    const ContactOutcome outcome = map.Apply(report);
    EXPECT_FALSE(outcome.applied);
    return outcome.reason;
  };
  const auto heard = [](auto&& change) {
    ContactReport report = Heard("a", 0, kBay, 1000, 0);
    change(std::get<RangeBearing>(report.observation));
    return report;
  };
  using R = RejectReason;
  using H = RangeBearing;
  EXPECT_EQ(reason(heard([](H& h) { h.range_m = kNaN; })), R::kNotFinite);
  EXPECT_EQ(reason(heard([](H& h) { h.bearing_deg = kNaN; })), R::kNotFinite);
  EXPECT_EQ(reason(heard([](H& h) { h.pose.heading_deg = kNaN; })),
            R::kNotFinite);
  EXPECT_EQ(reason(heard([](H& h) { h.pose.position.latitude_deg = kNaN; })),
            R::kNotFinite);
  EXPECT_EQ(reason(heard([](H& h) { h.pose.position.latitude_deg = 91; })),
            R::kInvalidMessage);
  EXPECT_EQ(reason(heard([](H& h) { h.pose.position.latitude_deg = 89.95; })),
            R::kOutsideArea);
  EXPECT_EQ(reason(heard([](H& h) { h.range_m = 0; })), R::kBelowMinRange);
  EXPECT_EQ(reason(heard([](H& h) { h.range_m = -5; })), R::kBelowMinRange);
  EXPECT_EQ(reason(heard([](H& h) { h.range_m = 200'001; })),
            R::kAboveMaxRange);
  EXPECT_EQ(reason(heard([](H& h) { h.range_std_m = 0; })), R::kBadStd);
  EXPECT_EQ(reason(heard([](H& h) { h.bearing_std_deg = 61; })), R::kBadStd);
  EXPECT_EQ(reason(heard([](H& h) { h.pose.position_std_m = -1; })),
            R::kBadStd);
  // Over the pole: the sensor stands at 89.8 N, the contact at 89.98 N.
  EXPECT_EQ(reason(heard([](H& h) {
              h.pose.position.latitude_deg = 89.8;
              h.range_m = 20'000;
            })),
            R::kOutsideArea);
  const auto fixed = [](auto&& change) {
    ContactReport report = Fix("a", 0, kBay);
    change(std::get<ContactFix>(report.observation));
    return report;
  };
  using F = ContactFix;
  EXPECT_EQ(reason(fixed([](F& f) { f.velocity_north_m_s = kNaN; })),
            R::kNotFinite);
  EXPECT_EQ(reason(fixed([](F& f) { f.velocity_east_m_s = 61; })),
            R::kInvalidMessage);
  EXPECT_EQ(reason(fixed([](F& f) { f.position_std_m = -1; })), R::kBadStd);
  ContactReport report = Fix("a", 0, kBay);
  report.contact_class = static_cast<ContactClass>(7);
  EXPECT_EQ(reason(report), R::kInvalidMessage);
  report = Fix("a", 0, kBay);
  report.depth_m = 12'001;
  EXPECT_EQ(reason(report), R::kBadDepth);
  report.depth_m = 100;
  report.depth_std_m = 0;
  EXPECT_EQ(reason(report), R::kBadStd);
  EXPECT_EQ(map.View().size(), 0u);
}

TEST(ContactMap, SubmergedContactStatesItsDepthAndKeepsIt) {
  ContactMap map(ContactMapOptions{});
  ContactReport report = Fix("a", 0, kBay);
  report.contact_class = ContactClass::kSubmerged;
  // Unknown depth: anywhere from the surface to 500 m.
  ContactEstimate estimate = *map.Apply(report).estimate;
  EXPECT_EQ(estimate.top_depth_m, 0);
  EXPECT_EQ(estimate.keel_depth_m, 500);
  // 100 m, 15 m high: 92.5 to 107.5.
  report.time = AtS(1);
  report.depth_m = 100;
  report.depth_std_m = 3;
  estimate = *map.Apply(report).estimate;
  EXPECT_EQ(estimate.top_depth_m, 92.5);
  EXPECT_EQ(estimate.keel_depth_m, 107.5);
  EXPECT_EQ(estimate.depth_std_m, 3);
  report.time = AtS(2);
  report.depth_m.reset();
  report.depth_std_m.reset();
  EXPECT_EQ(map.Apply(report).estimate->keel_depth_m, 107.5);
}

TEST(ContactMap, DepthOfASurfaceContactOnlyDeepensIt) {
  ContactMap map(ContactMapOptions{});
  ContactReport report = Fix("a", 0, kBay);
  report.depth_m = 4;
  EXPECT_EQ(map.Apply(report).estimate->keel_depth_m, 10);
  report.time = AtS(1);
  report.depth_m = 17;
  const ContactEstimate estimate = *map.Apply(report).estimate;
  EXPECT_EQ(estimate.keel_depth_m, 17);
  EXPECT_EQ(estimate.top_depth_m, 0);
  EXPECT_EQ(estimate.depth_std_m, 0);
}

TEST(ContactMap, SensorsFarApartAgreeOnThePlace) {
  // Meridians converge: 30 km east of the contact north differs by 0.24
  // degree, which at that range is 125 m.
  ContactMap map(ContactMapOptions{});
  const GeodeticPoint truth = Direct(kBay, 60, 4000);
  const GeodeticPoint sensors[] = {kBay, Direct(truth, 90, 30'000),
                                   Direct(truth, 200, 25'000)};
  double at_s = 0;
  for (const GeodeticPoint& sensor : sensors) {
    const RangeAzimuth seen = Inverse(sensor, truth);
    ContactReport report =
        Heard("a", at_s++, sensor, seen.distance_m, seen.azimuth_deg);
    auto& heard = std::get<RangeBearing>(report.observation);
    heard.range_std_m = 1;
    heard.bearing_std_deg = 0.002;
    const ContactEstimate estimate = *map.Apply(report).estimate;
    // What a plane shortens: 30 km^3 / (6 R^2) = 0.11 m.
    EXPECT_LT(DistanceM(estimate.Position(), truth), 0.2) << at_s;
  }
}

TEST(ContactMap, UncertaintyLiesAcrossTheTrueRayAtTheContact) {
  ContactMap map(ContactMapOptions{.filter = FilterKind::kPerAxis});
  const GeodeticPoint north{.latitude_deg = 65, .longitude_deg = 10};
  // 30 km east at 65 N the meridians differ by 0.58 degree.
  ContactReport report = Heard("a", 0, north, 30'000, 90);
  const ContactEstimate estimate = *map.Apply(report).estimate;
  // Across: 30 km * 1 degree = 524 m; along: 20 m. The minor axis points back
  // to the sensor.
  const double back_deg = Inverse(estimate.Position(), north).azimuth_deg;
  EXPECT_NEAR(back_deg, -89.42, 0.01);
  // The principal axis: tan 2a = 2 P01 / (P00 - P11), the minor one here.
  const double major_rad =
      0.5 *
      std::atan2(2 * estimate.P(0, 1), estimate.P(0, 0) - estimate.P(1, 1));
  EXPECT_NEAR(major_rad / kRadPerDeg, back_deg + 90, 0.005);
}

TEST(ContactMap, NewPlaneKeepsTheTrueCourse) {
  ContactMap map(ContactMapOptions{});
  const GeodeticPoint start{.latitude_deg = 70, .longitude_deg = 5};
  ContactReport fix = Fix("a", 0, start, 3, 20);
  fix.contact_class = ContactClass::kDrifting;  // Stale after an hour only.
  std::get<ContactFix>(fix.observation).velocity_std_m_s = 0.01;
  map.Apply(fix);
  const ContactEstimate before = *map.View().At(Key("a"), AtS(3600));
  const double north_rad =
      NedFrame(before.frame_origin).NorthAzimuthRad(before.Position());
  // 72 km east at 70 N: -72 / 6371 * tan(70) = -1.78 degrees.
  EXPECT_NEAR(north_rad / kRadPerDeg, -1.78, 0.02);
  // A report that says next to nothing.
  ContactReport vague = Heard("a", 3600, before.Position(), 1, 0);
  vague.contact_class = ContactClass::kDrifting;
  auto& heard = std::get<RangeBearing>(vague.observation);
  heard.range_std_m = 1e5;
  heard.pose.position_std_m = 1e5;
  const ContactEstimate after = *map.Apply(vague).estimate;
  ASSERT_NE(after.frame_origin, start);
  EXPECT_LT(DistanceM(after.frame_origin, before.Position()), 1e-3);
  const double course_rad = std::atan2(before.x(3), before.x(2)) - north_rad;
  EXPECT_NEAR(std::atan2(after.x(3), after.x(2)), course_rad, 1e-4);
  EXPECT_NEAR(after.x.tail<2>().norm(), before.x.tail<2>().norm(), 1e-2);
}

TEST(ContactMap, LongVoyageMovesThePlaneAlong) {
  for (const FilterKind filter :
       {FilterKind::kPerAxis, FilterKind::kFourState}) {
    ContactMap map(ContactMapOptions{.filter = filter});
    const GeodeticPoint start{.latitude_deg = 60, .longitude_deg = 5};
    GeodeticPoint truth = start;
    double course_deg = 0;
    int planes = 0;
    GeodeticPoint origin;
    // 20 m/s for 4 h is 288 km, on the geodesic that sets out north-east.
    for (int minute = 0; minute <= 240; ++minute) {
      truth = Direct(start, 45, 20.0 * 60 * minute);
      course_deg = minute == 0 ? 45 : Inverse(truth, start).azimuth_deg + 180;
      const GeodeticPoint sensor = Direct(truth, 180, 2000);
      const RangeAzimuth seen = Inverse(sensor, truth);
      ContactReport report =
          Heard("a", 60.0 * minute, sensor, seen.distance_m, seen.azimuth_deg);
      std::get<RangeBearing>(report.observation).bearing_std_deg = 0.1;
      const ContactEstimate estimate = *map.Apply(report).estimate;
      if (estimate.frame_origin != origin) ++planes;
      origin = estimate.frame_origin;
      if (minute < 10) continue;
      EXPECT_LT(std::hypot(estimate.x(0), estimate.x(1)), kReanchorM + 1300);
      EXPECT_LT(DistanceM(estimate.Position(), truth), 5) << minute;
      // The course in the plane differs from the true one by the convergence
      // at its edge, 50 km: 0.8 degree, and the velocity by 0.3 m/s.
      EXPECT_NEAR(estimate.x(2), 20 * std::cos(course_deg * kRadPerDeg), 0.4);
      EXPECT_NEAR(estimate.x(3), 20 * std::sin(course_deg * kRadPerDeg), 0.4);
    }
    // The first at 0, then after each 50 km of 288.
    EXPECT_EQ(planes, 6);
  }
}

TEST(ContactMap, AbsurdJumpsStayFinite) {
  ContactMap map(ContactMapOptions{});
  // A teleport of 200 km in a microsecond, one back after ten minutes, and one
  // round half the Earth, all agreeing with nothing.
  EXPECT_TRUE(map.Apply(Heard("a", 0, kBay, 200'000, 0)).applied);
  EXPECT_EQ(map.Apply(Heard("a", 1e-6, kBay, 200'000, 180)).reason,
            RejectReason::kGated);
  EXPECT_EQ(map.Apply(Heard("a", 599, kBay, 1, 0)).reason,
            RejectReason::kGated);
  const GeodeticPoint antipode{.latitude_deg = -41.5, .longitude_deg = 108.6};
  EXPECT_EQ(map.Apply(Heard("a", 599, antipode, 1, 0)).reason,
            RejectReason::kGated);
  EXPECT_EQ(map.Apply(Fix("a", 599, antipode)).estimate->report_count, 2u);
  const ContactEstimate estimate = *map.View().At(Key("a"), AtS(1e9));
  EXPECT_TRUE(estimate.x.allFinite());
  EXPECT_TRUE(estimate.P.allFinite());
  EXPECT_TRUE(std::isfinite(estimate.Position().latitude_deg));
}

TEST(ContactClasses, DefaultsAreValidAndBadOnesAreNamed) {
  FATHOM_EXPECT_OK(ValidateContactClasses(DefaultContactClasses()));
  ContactClassTable classes = DefaultContactClasses();
  classes[3].stale_after_s = 0;
  EXPECT_THAT(ValidateContactClasses(classes),
              testing::StatusIs(absl::StatusCode::kInvalidArgument,
                                ::testing::HasSubstr("vessel: stale_after_s")));
}

}  // namespace
}  // namespace fathom::map
