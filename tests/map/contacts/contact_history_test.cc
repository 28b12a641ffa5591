// The recent past of a contact, and putting stored contacts back.

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <variant>
#include <vector>

#include "map/contacts/contact_map.h"
#include "tests/map/contacts/contact_testing.h"
#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

using ::fathom::testing::StatusIs;

TEST(TrackHistory, KeepsTheNewestEstimates) {
  TrackHistory history;
  EXPECT_FALSE(history.NewestAtOrBefore(AtS(0)).has_value());
  ContactPoint point;
  for (int i = 0; i < 1000; ++i) {
    point.time = AtS(i);
    history.Append(point);
    const std::size_t size = std::min<std::size_t>(
        static_cast<std::size_t>(i) + 1, kRecentEstimates);
    ASSERT_EQ(history.size(), size);
    EXPECT_EQ(history.newest().time, AtS(i));
    EXPECT_EQ(history[0].time, AtS(i + 1 - static_cast<int>(size)));
  }
  // 744 to 999 are kept.
  EXPECT_FALSE(history.NewestAtOrBefore(AtS(743.5)).has_value());
  for (int i = 744; i < 1000; ++i) {
    const std::size_t index = static_cast<std::size_t>(i - 744);
    EXPECT_EQ(history.NewestAtOrBefore(AtS(i)), index);
    EXPECT_EQ(history.NewestAtOrBefore(AtS(i + 0.5)), index);
  }
}

TEST(TrackHistory, OfSeveralAtOneTimeTheLastCounts) {
  TrackHistory history;
  ContactPoint point;
  for (const double at_s : {0, 1, 1, 1, 2}) {
    point.time = AtS(at_s);
    history.Append(point);
  }
  EXPECT_EQ(history.NewestAtOrBefore(AtS(1)), 3u);
}

TEST(TrackHistory, CopiesDoNotSeeWhatComesLater) {
  TrackHistory history;
  ContactPoint point;
  point.time = AtS(0);
  history.Append(point);
  const TrackHistory before = history;
  point.time = AtS(1);
  history.Append(point);
  EXPECT_EQ(before.size(), 1u);
  EXPECT_EQ(before.newest().time, AtS(0));
  EXPECT_EQ(history.newest().time, AtS(1));
}

// As of a mission of a format that had no older estimates.
TEST(Contact, PastBeyondWhatIsKeptIsPredictedBackToTheTracksStart) {
  ContactMap source(ContactMapOptions{});
  for (int i = 0; i < 300; ++i) {
    source.Apply(Fix("a", 10 * i, Direct(kBay, 0, 50.0 * i), 5, 0));
  }
  StoredContact stored = source.View().Find(Key("a"))->ToStored();
  stored.older.clear();
  ContactMap map(source.options());
  FATHOM_ASSERT_OK(map.Restore(stored));
  const ContactsView view = map.View();
  // 44 to 299 are kept; 44 was at 440 s.
  EXPECT_NEAR(view.At(Key("a"), AtS(440))->x(0), 0, 1e-6);
  const ContactEstimate back = *view.At(Key("a"), AtS(400));
  EXPECT_NEAR(back.x(0), -200, 1e-9);
  EXPECT_NEAR(DistanceM(back.Position(), Direct(kBay, 0, 2000)), 0, 0.01);
  // 100 + 40^2 * 0.25 + 2e-3 * 40^3 / 3: as unsure as forwards.
  EXPECT_NEAR(back.P(0, 0), 542.666666666667, 1e-9);
  EXPECT_EQ(back.status, ContactStatus::kActive);
  EXPECT_TRUE(view.At(Key("a"), AtS(0)).has_value());
  EXPECT_FALSE(view.At(Key("a"), AtS(-1)).has_value());
}

// One seeded report of a small fleet, now and then dropped, absent or false.
ContactReport RandomReport(std::mt19937_64& random, double at_s) {
  std::uniform_real_distribution<double> unit(0, 1);
  const std::string name = std::to_string(static_cast<int>(20 * unit(random)));
  const GeodeticPoint place =
      Direct(kBay, 360 * unit(random), 30'000 * unit(random));
  ContactReport report =
      unit(random) < 0.2
          ? Fix(name, at_s, place, 10 * unit(random), -10 * unit(random))
          : Heard(name, at_s, place, 20'000 * unit(random), 360 * unit(random));
  report.contact_class =
      static_cast<ContactClass>(1 + static_cast<int>(6 * unit(random)));
  if (unit(random) < 0.1) report.depth_m = 200 * unit(random);
  report.inactive = unit(random) < 0.03;
  return report;
}

TEST(ContactMap, RestoredContactsGoOnBitForBit) {
  std::mt19937_64 random(42);
  ContactMap first(ContactMapOptions{.max_contacts = 15});
  double at_s = 0;
  const auto feed = [&](int reports, const std::vector<ContactMap*>& maps) {
    for (int i = 0; i < reports; ++i) {
      at_s += i % 500 == 0 ? 2000 : 3;
      const ContactReport report = RandomReport(random, at_s);
      std::optional<ContactOutcome> outcome;
      for (ContactMap* map : maps) {
        const ContactOutcome now = map->Apply(report);
        if (!outcome.has_value()) outcome = now;
        EXPECT_EQ(now.applied, outcome->applied);
        EXPECT_EQ(now.reason, outcome->reason);
        EXPECT_EQ(now.estimate, outcome->estimate);
      }
    }
  };
  feed(7000, {&first});
  ContactMap second(first.options());
  first.View().ForEach([&](const Contact& contact) {
    FATHOM_EXPECT_OK(second.Restore(contact.ToStored()));
  });
  EXPECT_EQ(second.View().size(), first.View().size());
  EXPECT_EQ(second.live_count(), first.live_count());
  feed(3000, {&first, &second});
  // Every answer, past and future, is the same.
  int compared = 0;
  const ContactsView a = first.View();
  const ContactsView b = second.View();
  for (double t = 0; t < at_s + 5000; t += 97.3) {
    a.ForEach([&](const Contact& contact) {
      const auto expected = a.At(contact.key(), AtS(t));
      EXPECT_EQ(b.At(contact.key(), AtS(t)), expected);
      compared += expected.has_value() ? 1 : 0;
    });
  }
  EXPECT_GT(compared, 1000);
}

// A review's find: the first estimate of such a track has a covariance of 0,
// and is kept for ever; the mission could not be opened again.
TEST(ContactMap, AnExactSensorsTrackIsRestored) {
  ContactMap map(ContactMapOptions{});
  for (int i = 0; i < 300; ++i) {
    ContactReport report = Heard("a", 2.0 * i, kBay, 1000 + i, 90);
    auto& heard = std::get<RangeBearing>(report.observation);
    if (i == 0) heard.range_std_m = heard.bearing_std_deg = 1e-200;
    EXPECT_TRUE(map.Apply(report).applied) << i;
  }
  const ContactsView view = map.View();
  const Contact& contact = *view.Find(Key("a"));
  ASSERT_GT(contact.older().size(), 0u);
  ASSERT_EQ(contact.older()[0].P(0, 0), 0);
  ContactMap second(map.options());
  FATHOM_EXPECT_OK(second.Restore(contact.ToStored()));
  StoredContact bad = contact.ToStored();
  bad.older[0].P(0, 0) = -1;
  EXPECT_FALSE(ContactMap(map.options()).Restore(bad).ok());
}

TEST(ContactMap, RestoreRefusesWhatIsNotAContact) {
  ContactMap source(ContactMapOptions{});
  source.Apply(Fix("a", 0, kBay));
  source.Apply(Fix("a", 1, kBay));
  const StoredContact good = source.View().Find(Key("a"))->ToStored();
  constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

  ContactMap map(ContactMapOptions{.max_contacts = 1});
  EXPECT_THAT(map.Restore({.key = Key("a"), .estimates = {}, .recent = {}}),
              StatusIs(kInvalid));
  StoredContact bad = good;
  bad.key = Key("b");
  EXPECT_THAT(map.Restore(bad), StatusIs(kInvalid));
  bad = good;
  std::swap(bad.estimates[0], bad.estimates[1]);
  EXPECT_THAT(map.Restore(bad), StatusIs(kInvalid));
  bad = good;
  bad.estimates[1].P(2, 3) = std::nan("");
  EXPECT_THAT(map.Restore(bad), StatusIs(kInvalid));
  bad = good;
  bad.estimates[0].contact_class = static_cast<ContactClass>(0);
  EXPECT_THAT(map.Restore(bad), StatusIs(kInvalid));
  EXPECT_EQ(map.View().size(), 0u);

  FATHOM_EXPECT_OK(map.Restore(good));
  EXPECT_THAT(map.Restore(good), StatusIs(absl::StatusCode::kAlreadyExists));
  StoredContact other = good;
  other.key = Key("b");
  for (ContactEstimate& estimate : other.estimates) estimate.key = Key("b");
  EXPECT_THAT(map.Restore(other),
              StatusIs(absl::StatusCode::kResourceExhausted));
}

}  // namespace
}  // namespace fathom::map
