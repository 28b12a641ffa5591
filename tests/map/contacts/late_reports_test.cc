// Reports that come late or out of order.

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "map/contacts/contact_map.h"
#include "tests/map/contacts/contact_testing.h"
#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

std::vector<ContactPoint> PointsOf(ContactMap& map, const std::string& name) {
  const ContactsView view = map.View();
  const Contact* contact = view.Find(Key(name));
  std::vector<ContactPoint> points;
  if (contact == nullptr) return points;
  for (std::size_t i = 0; i < contact->history().size(); ++i) {
    points.push_back(contact->history()[i]);
  }
  return points;
}

TEST(LateReport, GivesTheEstimateOfTheOrderedSequence) {
  const ContactReport reports[] = {
      Heard("a", 0, kBay, 1000, 0), Heard("a", 10, kBay, 1050, 1),
      Heard("a", 20, kBay, 1100, 0), Heard("a", 30, kBay, 1150, -1)};
  ContactMap ordered(ContactMapOptions{});
  for (const ContactReport& report : reports) ordered.Apply(report);
  ContactMap mixed(ContactMapOptions{});
  for (const int i : {1, 3, 0, 2}) {
    EXPECT_TRUE(mixed.Apply(reports[i]).applied) << i;
  }
  EXPECT_EQ(PointsOf(mixed, "a"), PointsOf(ordered, "a"));
  EXPECT_EQ(mixed.View().Find(Key("a"))->ToStored().recent,
            ordered.View().Find(Key("a"))->ToStored().recent);
}

TEST(LateReport, TellsWhatTheHistoryMustNowHold) {
  ContactMap map(ContactMapOptions{});
  for (const double at_s : {0, 10, 30}) map.Apply(Fix("a", at_s, kBay));
  const ContactOutcome outcome = map.Apply(Heard("a", 20, kBay, 5, 0));
  EXPECT_TRUE(outcome.applied);
  EXPECT_TRUE(outcome.revised);
  // The one before it, itself, and the one after.
  ASSERT_EQ(outcome.estimates.size(), 3u);
  EXPECT_EQ(outcome.estimates[0].time, AtS(10));
  EXPECT_EQ(outcome.estimates[1].time, AtS(20));
  EXPECT_EQ(outcome.estimates[2].time, AtS(30));
  EXPECT_EQ(outcome.estimates[2], outcome.estimate);
  EXPECT_EQ(outcome.estimate->report_count, 4u);
}

TEST(LateReport, BeyondTheWindowIsTooLateAndChangesNothing) {
  ContactMap map(ContactMapOptions{});
  for (int i = 0; i <= 12; ++i) map.Apply(Heard("a", 10 * i, kBay, 1000, 0));
  const std::vector<ContactPoint> before = PointsOf(map, "a");
  // The newest is at 120 s: the window of 60 s goes back to 60.
  const ContactOutcome late = map.Apply(Heard("a", 59.999999, kBay, 1000, 0));
  EXPECT_FALSE(late.applied);
  EXPECT_EQ(late.reason, RejectReason::kTooLate);
  EXPECT_EQ(PointsOf(map, "a"), before);
  EXPECT_TRUE(map.Apply(Heard("a", 60, kBay, 1000, 0)).applied);
}

TEST(LateReport, BeforeTheReportsThatAreKeptIsTooLate) {
  ContactMap map(ContactMapOptions{});
  for (int i = 0; i < 70; ++i) {
    map.Apply(Heard("a", 0.1 * i, kBay, 1000, 0));
  }
  // 6 to 69 are kept.
  EXPECT_EQ(map.Apply(Heard("a", 0.55, kBay, 1000, 0)).reason,
            RejectReason::kTooLate);
  EXPECT_TRUE(map.Apply(Heard("a", 0.65, kBay, 1000, 0)).applied);
}

TEST(LateReport, BeforeADropByCommandIsTooLate) {
  ContactMap map(ContactMapOptions{});
  map.Apply(Fix("a", 10, kBay));
  map.Drop(Key("a"), AtS(20));
  EXPECT_EQ(map.Apply(Fix("a", 15, kBay)).reason, RejectReason::kTooLate);
  EXPECT_FALSE(map.View().At(Key("a"), AtS(20)).has_value());
}

TEST(LateReport, BeforeAReportOfItsEndIsTakenAndItStaysEnded) {
  ContactMap map(ContactMapOptions{});
  map.Apply(Fix("a", 10, kBay));
  ContactReport gone = Fix("a", 20, kBay);
  gone.inactive = true;
  map.Apply(gone);
  const ContactOutcome outcome = map.Apply(Fix("a", 15, kBay, 2, 0));
  EXPECT_TRUE(outcome.applied);
  EXPECT_EQ(outcome.estimate->status, ContactStatus::kDropped);
  EXPECT_EQ(outcome.estimate->x(0), 10);  // 5 s at 2 m/s.
  EXPECT_EQ(map.live_count(), 0u);
}

TEST(LateReport, AnswersOfBeforeStayForTheirReaders) {
  ContactMap map(ContactMapOptions{});
  for (int i = 0; i < 20; ++i) map.Apply(Heard("a", 3 * i, kBay, 1000, 0));
  const ContactsView before = map.View();
  const ContactEstimate then = *before.At(Key("a"), AtS(57));
  map.Apply(Heard("a", 5, kBay, 1020, 2));
  EXPECT_EQ(*before.At(Key("a"), AtS(57)), then);
  EXPECT_FALSE(*map.View().At(Key("a"), AtS(57)) == then);
}

// Any order within the window: the tracks are those of the ordered sequence,
// with outliers, ends and returns among the reports, also when the map is
// stored and restored on the way.
TEST(LateReport, AnyOrderWithinTheWindowGivesTheSameTracks) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(0, 1);
  int late = 0;
  int gated = 0;
  for (int round = 0; round < 60; ++round) {
    std::vector<ContactReport> reports;
    for (int i = 0; i < 120; ++i) {
      const double at_s = 2.0 * i;
      ContactReport report =
          unit(random) < 0.1
              ? Fix("a", at_s, Direct(kBay, 0, 1000 + 3 * at_s), 3, 0)
              : Heard("a", at_s, kBay, 1000 + 3 * at_s + 40 * unit(random),
                      2 * unit(random));
      if (unit(random) < 0.15) {
        std::get_if<RangeBearing>(&report.observation) != nullptr
            ? void(std::get<RangeBearing>(report.observation).bearing_deg += 70)
            : void(std::get<ContactFix>(report.observation)
                       .position.latitude_deg += 1);
      }
      report.inactive = i > 0 && unit(random) < 0.02;
      reports.push_back(report);
    }
    ContactMap ordered(ContactMapOptions{});
    for (const ContactReport& report : reports) {
      gated += ordered.Apply(report).reason == RejectReason::kGated ? 1 : 0;
    }
    // Each delayed by up to 25 s; the first comes first, since what is said
    // to be gone must be known.
    std::vector<std::pair<double, std::size_t>> arrivals;
    for (std::size_t i = 0; i < reports.size(); ++i) {
      arrivals.emplace_back(2.0 * static_cast<double>(i) + 25 * unit(random),
                            i);
    }
    arrivals[0].first = -1;
    std::sort(arrivals.begin(), arrivals.end());
    ContactMap mixed(ContactMapOptions{});
    Time newest = Time::min();
    std::size_t seen = 0;
    for (const auto& [at_s, i] : arrivals) {
      if (++seen == 60) {
        ContactMap restored(mixed.options());
        FATHOM_ASSERT_OK(
            restored.Restore(mixed.View().Find(Key("a"))->ToStored()));
        mixed = std::move(restored);
      }
      late += reports[i].time < newest ? 1 : 0;
      newest = std::max(newest, reports[i].time);
      EXPECT_NE(mixed.Apply(reports[i]).reason, RejectReason::kTooLate);
    }
    ASSERT_EQ(PointsOf(mixed, "a"), PointsOf(ordered, "a")) << round;
  }
  EXPECT_GT(late, 1000);
  EXPECT_GT(gated, 500);
}

}  // namespace
}  // namespace fathom::map
