// The innovation gate and beginning anew behind it.

#include "map/contacts/tracker.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "map/contacts/contact_map.h"
#include "tests/map/contacts/contact_testing.h"

namespace fathom::map {
namespace {

// A vessel 1 km north that stands still, heard every 10 s.
void Track(ContactMap& map, int reports) {
  for (int i = 0; i < reports; ++i) {
    ASSERT_TRUE(map.Apply(Heard("a", 10 * i, kBay, 1000, 0)).applied);
  }
}

TEST(Gate, OneOutlierIsRefusedAndChangesNoAnswer) {
  ContactMap map(ContactMapOptions{});
  Track(map, 10);
  const ContactEstimate before = *map.View().At(Key("a"), AtS(100));
  const ContactOutcome outcome = map.Apply(Heard("a", 100, kBay, 3000, 90));
  EXPECT_FALSE(outcome.applied);
  EXPECT_EQ(outcome.reason, RejectReason::kGated);
  EXPECT_TRUE(outcome.estimates.empty());
  EXPECT_EQ(*map.View().At(Key("a"), AtS(100)), before);
  // The track goes on as if it had never been.
  ContactMap without(ContactMapOptions{});
  Track(without, 10);
  const ContactReport next = Heard("a", 110, kBay, 1005, 0.5);
  EXPECT_EQ(map.Apply(next).estimate, without.Apply(next).estimate);
  EXPECT_EQ(map.View().At(Key("a"), AtS(110))->report_count, 11u);
}

TEST(Gate, IsAtFiveSigma) {
  // A fix 10 m and 0.5 m/s sure at once heard along its ray: S = 10^2 + 20^2
  // + a little (the bend of the ray), so 5 sigma are 112 m.
  for (const double off_m : {-113.5, -110.0, 110.0, 113.5}) {
    ContactMap map(ContactMapOptions{});
    map.Apply(Fix("a", 0, Direct(kBay, 0, 5000)));
    EXPECT_EQ(map.Apply(Heard("a", 0, kBay, 5000 + off_m, 0)).applied,
              std::fabs(off_m) < 112)
        << off_m;
  }
}

TEST(Gate, BearingIsJudgedAlongTheArc) {
  // 4 sigma of 10 degrees off at 10 km is 2.3 km short of the arc's chord,
  // which north and east alone is 20 sigma of the 20 m of the range.
  ContactMap map(ContactMapOptions{});
  map.Apply(Fix("a", 0, Direct(kBay, 0, 10'000)));
  ContactReport report = Heard("a", 1, kBay, 10'000, 40);
  std::get<RangeBearing>(report.observation).bearing_std_deg = 10;
  EXPECT_TRUE(map.Apply(report).applied);
}

TEST(Gate, SecondOutlierThatAgreesBeginsTheTrackAnew) {
  ContactMap map(ContactMapOptions{});
  Track(map, 10);
  EXPECT_FALSE(map.Apply(Heard("a", 100, kBay, 3000, 90)).applied);
  const ContactOutcome anew = map.Apply(Heard("a", 110, kBay, 3050, 90));
  ASSERT_TRUE(anew.applied);
  ASSERT_EQ(anew.estimates.size(), 2u);
  EXPECT_EQ(anew.estimates[0].time, AtS(100));
  EXPECT_EQ(anew.estimates[0].status, ContactStatus::kNew);
  EXPECT_EQ(anew.estimates[1], anew.estimate);
  EXPECT_EQ(anew.estimate->report_count, 2u);
  EXPECT_EQ(anew.estimate->track_start, AtS(100));
  EXPECT_NEAR(DistanceM(anew.estimate->Position(), kBay), 3050, 20);
  // 5 m/s, drawn towards 0 by (20^2 + 20^2) / 10^2 / 8^2 = 1 / 8 or so.
  EXPECT_NEAR(anew.estimate->x(3), 4.5, 0.2);
  // Until the first of the two the old track answers.
  const ContactsView view = map.View();
  EXPECT_NEAR(DistanceM(view.At(Key("a"), AtS(99))->Position(), kBay), 1000,
              20);
  EXPECT_NEAR(DistanceM(view.At(Key("a"), AtS(100))->Position(), kBay), 3000,
              20);
  EXPECT_EQ(view.live_count(), 1u);
}

TEST(Gate, OutliersThatDisagreeKeepTheTrack) {
  ContactMap map(ContactMapOptions{});
  Track(map, 10);
  // 60 degrees apart at 3 km in a second: no vessel.
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(map.Apply(Heard("a", 100 + i, kBay, 3000, 60 + 60 * i)).reason,
              RejectReason::kGated);
  }
  EXPECT_TRUE(map.Apply(Heard("a", 110, kBay, 1000, 0)).applied);
  EXPECT_EQ(map.View().At(Key("a"), AtS(110))->report_count, 11u);
}

TEST(Gate, AnOutlierBetweenGoodReportsIsForgotten) {
  ContactMap map(ContactMapOptions{});
  Track(map, 10);
  EXPECT_FALSE(map.Apply(Heard("a", 100, kBay, 3000, 90)).applied);
  EXPECT_TRUE(map.Apply(Heard("a", 110, kBay, 1000, 0)).applied);
  // It would agree with the one before the good report; that is gone.
  EXPECT_FALSE(map.Apply(Heard("a", 120, kBay, 3000, 90)).applied);
}

TEST(Gate, FixIsTakenWhereTheContactCanHaveGot) {
  // From 10 m to 10 m in 60 s, a vessel's first velocity 8 m/s:
  // 5 (10 + 10 + 8 * 60) = 2500 m.
  for (const double off_m : {2480.0, 2520.0}) {
    ContactMap map(ContactMapOptions{});
    map.Apply(Fix("a", 0, kBay));
    EXPECT_EQ(map.Apply(Fix("a", 60, Direct(kBay, 30, off_m))).applied,
              off_m < 2500);
  }
  // The other side of the Earth, and the first report was the wrong one.
  ContactMap map(ContactMapOptions{});
  const GeodeticPoint wrong{.latitude_deg = 41.5, .longitude_deg = 54.83};
  map.Apply(Fix("a", 0, wrong));
  EXPECT_EQ(map.Apply(Fix("a", 10, kBay)).reason, RejectReason::kGated);
  EXPECT_TRUE(map.Apply(Fix("a", 20, kBay)).applied);
  EXPECT_EQ(map.View().At(Key("a"), AtS(20))->Position(), kBay);
}

TEST(Gate, RefusesHardlyAnyTrueReport) {
  // 5 sigma of a Gaussian: 3.7e-6. 200 tracks of 50 reports at 2 and 10
  // degrees, a vessel's motion.
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  int refused = 0;
  for (int track = 0; track < 200; ++track) {
    ContactMap map(ContactMapOptions{});
    const double bearing_std_deg = track % 2 == 0 ? 2 : 10;
    const double north_m_s = 5 * normal(random);
    const double east_m_s = 5 * normal(random);
    for (int i = 0; i < 50; ++i) {
      const double north_m = 4000 + north_m_s * 10 * i;
      const double east_m = 3000 + east_m_s * 10 * i;
      ContactReport report = Heard(
          "a", 10 * i, kBay,
          std::max(1.0, std::hypot(north_m, east_m) + 20 * normal(random)),
          std::atan2(east_m, north_m) * 57.29577951308232 +
              bearing_std_deg * normal(random));
      std::get<RangeBearing>(report.observation).bearing_std_deg =
          bearing_std_deg;
      refused += map.Apply(report).applied ? 0 : 1;
    }
  }
  EXPECT_LE(refused, 3);
}

}  // namespace
}  // namespace fathom::map
