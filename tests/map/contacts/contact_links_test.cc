// Contacts that several sources report under names of their own: what C4I
// links is one track.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "map/contacts/contact_map.h"
#include "tests/map/contacts/contact_testing.h"
#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

using fathom::testing::IsOk;
using ::testing::ElementsAre;

const ContactKey kTrack{.source = {"c4i"}, .contact = {"T9"}};
const ContactKey kSonar{.source = {"sonar"}, .contact = {"S1"}};
const ContactKey kRadar{.source = {"radar"}, .contact = {"R4"}};

ContactReport At(ContactReport report, const ContactKey& key) {
  report.key = key;
  return report;
}

ContactReport HeardBy(const ContactKey& key, double at_s, double range_m,
                      double bearing_deg) {
  return At(Heard("", at_s, kBay, range_m, bearing_deg), key);
}

// C4I: the contact is there, and known under these names too.
ContactReport Told(double at_s, const GeodeticPoint& position,
                   std::vector<ContactKey> names) {
  ContactReport report = At(Fix("", at_s, position), kTrack);
  report.same_as = std::move(names);
  return report;
}

// C4I: these are one, wherever they are.
ContactReport Said(double at_s, std::vector<ContactKey> names) {
  ContactReport report = Told(at_s, kBay, std::move(names));
  report.observation = NothingObserved{};
  return report;
}

TEST(ContactLinks, ReportsOfAllNamesFeedOneTrack) {
  ContactMap linked({});
  ContactMap alone({});
  ASSERT_TRUE(linked.Apply(HeardBy(kSonar, 0, 1000, 0)).applied);
  ASSERT_TRUE(linked.Apply(HeardBy(kRadar, 1, 1010, 0.5)).applied);
  const GeodeticPoint there{.latitude_deg = 41.509, .longitude_deg = -71.4};
  ASSERT_TRUE(linked.Apply(Told(2, there, {kSonar, kRadar})).applied);
  EXPECT_EQ(linked.live_count(), 1u);
  // What comes then is as if C4I's contact had been reported by one source.
  ASSERT_TRUE(alone.Apply(Told(2, there, {})).applied);
  for (int i = 0; i < 20; ++i) {
    const ContactKey& source = i % 2 == 0 ? kSonar : kRadar;
    const double bearing_deg = 0.1 * i;
    ContactReport report = HeardBy(source, 3 + i, 1000 + i, bearing_deg);
    // The class that C4I gave stays.
    report.contact_class = ContactClass::kUnknown;
    const ContactOutcome outcome = linked.Apply(report);
    ASSERT_TRUE(outcome.applied);
    EXPECT_TRUE(outcome.joint);
    ASSERT_TRUE(
        alone.Apply(HeardBy(kTrack, 3 + i, 1000 + i, bearing_deg)).applied);
  }
  const ContactEstimate estimate = *linked.View().At(kTrack, AtS(30));
  const ContactPoint& point = estimate;
  EXPECT_EQ(point, static_cast<const ContactPoint&>(
                       *alone.View().At(kTrack, AtS(30))));
  EXPECT_THAT(estimate.linked, ElementsAre(kRadar, kSonar));
  EXPECT_EQ(linked.View().At(kSonar, AtS(30)), std::nullopt);
  // Before the link there were two.
  EXPECT_TRUE(linked.View().At(kSonar, AtS(1.5)).has_value());
  EXPECT_EQ(linked.View().At(kTrack, AtS(1.5)), std::nullopt);
}

TEST(ContactLinks, WithoutAFixTheTrackBeginsWhereTheSurestIs) {
  ContactMap map({});
  for (int i = 0; i <= 10; ++i) {
    ASSERT_TRUE(map.Apply(HeardBy(kSonar, i, 1000, 0)).applied);
  }
  ASSERT_TRUE(map.Apply(HeardBy(kRadar, 10, 1400, 0)).applied);
  const ContactEstimate sonar = *map.View().At(kSonar, AtS(12));
  const ContactOutcome outcome = map.Apply(Said(12, {kRadar, kSonar}));
  ASSERT_TRUE(outcome.applied);
  ASSERT_EQ(outcome.estimates.size(), 1u);
  EXPECT_EQ(outcome.estimates[0].x, sonar.x);
  EXPECT_EQ(outcome.estimates[0].P, sonar.P);
  ASSERT_EQ(outcome.ended.size(), 2u);
  EXPECT_EQ(outcome.ended[0].key, kRadar);
  EXPECT_EQ(outcome.ended[0].status, ContactStatus::kDropped);
  EXPECT_THAT(outcome.ended[0].linked, ElementsAre(kTrack));
  EXPECT_EQ(map.live_count(), 1u);
}

TEST(ContactLinks, ALaterReportTakesNamesAwayAndUndoesAll) {
  ContactMap map({});
  ASSERT_TRUE(map.Apply(Told(0, kBay, {kSonar, kRadar})).applied);
  // The same again changes nothing of the links.
  const auto links = map.View().Find(kTrack)->links();
  ASSERT_TRUE(map.Apply(Told(5, kBay, {kRadar, kSonar})).applied);
  EXPECT_EQ(map.View().Find(kTrack)->links(), links);
  ASSERT_TRUE(map.Apply(Told(10, kBay, {kRadar})).applied);
  // The sonar's is a contact of its own again.
  EXPECT_EQ(map.Apply(HeardBy(kSonar, 11, 300, 90)).estimate->key, kSonar);
  EXPECT_EQ(map.Apply(HeardBy(kRadar, 12, 10, 90)).estimate->key, kTrack);
  EXPECT_EQ(map.live_count(), 2u);
  ASSERT_TRUE(map.Apply(Said(20, {})).applied);
  EXPECT_EQ(map.View().Find(kTrack)->links(), nullptr);
  EXPECT_EQ(map.Apply(HeardBy(kRadar, 21, 10, 90)).estimate->key, kRadar);
  EXPECT_EQ(map.live_count(), 3u);
}

TEST(ContactLinks, ASourceThatLostItLeavesTheLinkAndTheTrackGoesOn) {
  ContactMap map({});
  ASSERT_TRUE(map.Apply(Told(0, kBay, {kSonar, kRadar})).applied);
  ContactReport lost = HeardBy(kSonar, 5, 10, 0);
  lost.inactive = true;
  EXPECT_TRUE(map.Apply(lost).applied);
  EXPECT_EQ(map.live_count(), 1u);
  EXPECT_THAT(map.View().At(kTrack, AtS(6))->linked, ElementsAre(kRadar));
}

TEST(ContactLinks, TheEndOfTheTrackEndsTheLink) {
  ContactMap map({});
  ASSERT_TRUE(map.Apply(Told(0, kBay, {kSonar})).applied);
  // Dropped by a name of it.
  const ContactOutcome end = map.Drop(kSonar, AtS(5));
  ASSERT_TRUE(end.applied);
  EXPECT_EQ(end.estimate->key, kTrack);
  EXPECT_TRUE(end.joint);
  EXPECT_EQ(map.live_count(), 0u);
  EXPECT_EQ(map.Apply(HeardBy(kSonar, 6, 300, 90)).estimate->key, kSonar);
}

TEST(ContactLinks, ReportsOfBeforeTheLinkAreTooLate) {
  ContactMap map({});
  ASSERT_TRUE(map.Apply(HeardBy(kSonar, 5, 300, 90)).applied);
  ASSERT_TRUE(map.Apply(Told(4, kBay, {kSonar})).applied);
  // The sonar's own track ended at 5 s, its newest report.
  EXPECT_EQ(map.View().Find(kTrack)->links()->since, AtS(5));
  EXPECT_EQ(map.Apply(HeardBy(kSonar, 4.5, 300, 90)).reason,
            RejectReason::kTooLate);
  EXPECT_EQ(map.Apply(HeardBy(kRadar, 4.5, 300, 90)).applied, true);
}

TEST(ContactLinks, WhatWasLinkedIsLinkedAlong) {
  const ContactKey other{.source = {"c4i-2"}, .contact = {"X1"}};
  ContactMap map({});
  ContactReport first = Told(0, kBay, {kSonar});
  first.key = other;
  ASSERT_TRUE(map.Apply(first).applied);
  ASSERT_TRUE(map.Apply(Told(1, kBay, {other})).applied);
  EXPECT_THAT(map.View().At(kTrack, AtS(2))->linked,
              ElementsAre(other, kSonar));
  EXPECT_EQ(map.Apply(HeardBy(kSonar, 3, 20, 90)).estimate->key, kTrack);
  // The other one links the first: now it gives the name.
  ContactReport back = Told(4, kBay, {kTrack});
  back.key = other;
  ASSERT_TRUE(map.Apply(back).applied);
  EXPECT_EQ(map.Apply(HeardBy(kSonar, 5, 20, 90)).estimate->key, other);
  EXPECT_EQ(map.live_count(), 1u);
}

TEST(ContactLinks, WhatCannotBeLinkedIsRefusedAndChangesNothing) {
  ContactMap map({});
  // Nothing observed, nobody live.
  EXPECT_EQ(map.Apply(Said(0, {kSonar})).reason, RejectReason::kBadLink);
  // Itself; twice the same; nine names.
  EXPECT_EQ(map.Apply(Told(0, kBay, {kTrack})).reason, RejectReason::kBadLink);
  EXPECT_EQ(map.Apply(Told(0, kBay, {kSonar, kSonar})).reason,
            RejectReason::kBadLink);
  std::vector<ContactKey> nine;
  for (char c = 'a'; c <= 'i'; ++c) nine.push_back(Key(std::string(1, c)));
  EXPECT_EQ(map.Apply(Told(0, kBay, nine)).reason, RejectReason::kBadLink);
  nine.pop_back();
  EXPECT_TRUE(map.Apply(Told(0, kBay, nine)).applied);
  // Eight, and the one that has eight.
  ContactReport more = Told(1, kBay, {kTrack});
  more.key = kSonar;
  EXPECT_EQ(map.Apply(more).reason, RejectReason::kBadLink);
  EXPECT_EQ(map.View().Find(kSonar), nullptr);
  // A sonar does not know.
  ContactReport heard = HeardBy(kSonar, 1, 300, 90);
  heard.same_as = {kRadar};
  EXPECT_EQ(map.Apply(heard).reason, RejectReason::kInvalidMessage);
  EXPECT_EQ(map.live_count(), 1u);
}

TEST(ContactLinks, AFullListLinksWhatItHolds) {
  ContactMap map({.max_contacts = 2});
  ASSERT_TRUE(map.Apply(HeardBy(kSonar, 0, 300, 90)).applied);
  ASSERT_TRUE(map.Apply(HeardBy(kRadar, 0, 300, 91)).applied);
  EXPECT_EQ(map.Apply(Told(1, kBay, {})).reason, RejectReason::kContactsFull);
  EXPECT_TRUE(map.Apply(Told(1, kBay, {kSonar})).applied);
  EXPECT_EQ(map.live_count(), 2u);
}

TEST(ContactLinks, RestoredLinksGoOnAlike) {
  ContactMap map({});
  ASSERT_TRUE(map.Apply(HeardBy(kSonar, 0, 300, 90)).applied);
  ASSERT_TRUE(map.Apply(Told(1, kBay, {kSonar})).applied);
  ContactMap back({});
  map.View().ForEach([&back](const Contact& contact) {
    ASSERT_THAT(back.Restore(contact.ToStored()), IsOk());
  });
  const ContactReport next = HeardBy(kSonar, 10, 20, 90);
  EXPECT_EQ(back.Apply(next).estimate, map.Apply(next).estimate);

  StoredContact bad = map.View().Find(kTrack)->ToStored();
  bad.links->names = {};
  ContactMap empty({});
  EXPECT_FALSE(empty.Restore(bad).ok());
  bad.links->names = {kTrack};
  EXPECT_FALSE(empty.Restore(bad).ok());
  bad.links->names = {kSonar, kRadar};  // Not in order.
  EXPECT_FALSE(empty.Restore(bad).ok());
  EXPECT_EQ(empty.live_count(), 0u);
}

}  // namespace
}  // namespace fathom::map
