#include "map/contacts/contacts_view.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "map/contacts/contact_map.h"
#include "map/geodesy/ned_frame.h"
#include "tests/map/contacts/contact_testing.h"

namespace fathom::map {
namespace {

std::vector<std::string> NearNames(const ContactsView& view,
                                   const GeodeticPoint& point, double reach_m,
                                   Time t) {
  std::vector<std::string> names;
  view.ForEachNear(point, reach_m, t, [&](const NearContact& near) {
    names.push_back(near.contact->key().contact.value);
  });
  return names;
}

TEST(ContactsView, EmptyOneAnswers) {
  const ContactsView view;
  EXPECT_EQ(view.size(), 0u);
  EXPECT_EQ(view.Find(Key("a")), nullptr);
  EXPECT_FALSE(view.At(Key("a"), AtS(0)).has_value());
  EXPECT_TRUE(NearNames(view, kBay, 1e6, AtS(0)).empty());
}

TEST(ContactsView, StaysAsItWasWhileTheMapGoesOn) {
  ContactMap map(ContactMapOptions{});
  map.Apply(Fix("a", 0, kBay, 5, 0));
  const ContactsView before = map.View();
  map.Apply(Fix("a", 10, kBay, -5, 0));
  map.Apply(Fix("b", 10, kBay));
  EXPECT_EQ(before.size(), 1u);
  EXPECT_EQ(before.At(Key("a"), AtS(10))->x(2), 5);
  EXPECT_EQ(NearNames(before, kBay, 100, AtS(10)),
            std::vector<std::string>{"a"});
  EXPECT_EQ(map.View().At(Key("a"), AtS(10))->x(2), -5);
}

TEST(ContactsView, IsInOrderOfSourceThenContact) {
  ContactMap map(ContactMapOptions{});
  std::mt19937_64 random(1);
  std::set<ContactKey> expected;
  for (int i = 0; i < 700; ++i) {
    ContactReport report = Fix(std::to_string(random() % 5000), 0, kBay);
    report.key.source.value = std::to_string(random() % 3);
    map.Apply(report);
    expected.insert(report.key);
  }
  std::vector<ContactKey> keys;
  map.View().ForEach(
      [&](const Contact& contact) { keys.push_back(contact.key()); });
  EXPECT_EQ(keys, std::vector<ContactKey>(expected.begin(), expected.end()));
}

TEST(ContactsView, TellsTheOffsetFromThePlaceToTheContact) {
  ContactMap map(ContactMapOptions{});
  map.Apply(Fix("a", 0, kBay, 5, 0));
  int calls = 0;
  map.View().ForEachNear(
      Direct(kBay, 90, 300), 1000, AtS(20), [&](const NearContact& near) {
        ++calls;
        EXPECT_NEAR(near.north_m, 100, 0.02);  // 20 s at 5 m/s.
        EXPECT_NEAR(near.east_m, -300, 0.02);
        EXPECT_EQ(near.predicted.time, AtS(20));
      });
  EXPECT_EQ(calls, 1);
}

TEST(ContactsView, NearCrossesTheAntimeridian) {
  ContactMap map(ContactMapOptions{});
  map.Apply(Fix("a", 0, {.latitude_deg = 52, .longitude_deg = 179.9999}));
  EXPECT_EQ(
      NearNames(map.View(), {.latitude_deg = 52, .longitude_deg = -179.9999}, 0,
                AtS(0)),
      std::vector<std::string>{"a"});
}

TEST(ContactsView, OtherSideOfTheEarthIsNotNear) {
  // On the plane of a contact its antipodes would coincide with it.
  ContactMap map(ContactMapOptions{});
  map.Apply(Fix("a", 0, kBay));
  EXPECT_TRUE(NearNames(map.View(),
                        {.latitude_deg = -41.5, .longitude_deg = 108.6}, 1e5,
                        AtS(0))
                  .empty());
}

TEST(ContactsView, LongSilentContactIsNearNowhere) {
  ContactMap map(ContactMapOptions{});
  map.Apply(Fix("a", 0, kBay));
  // R^2 / (2 q T^3 / 3) = 1e-10 with R = 100 m, q = 2e-3: T = 4.2e5 s.
  EXPECT_EQ(NearNames(map.View(), kBay, 0, AtS(2e5)).size(), 1u);
  EXPECT_TRUE(NearNames(map.View(), kBay, 0, AtS(5e5)).empty());
}

// ForEachNear's definition, asked of every contact without the index.
std::vector<std::string> NearByDefinition(const ContactsView& view,
                                          const GeodeticPoint& point,
                                          double reach_m, Time t) {
  std::vector<std::string> names;
  view.ForEach([&](const Contact& contact) {
    const auto predicted = contact.At(t, view.classes());
    if (!predicted.has_value()) return;
    if (DistanceM(predicted->frame_origin, point) > 1.1 * kFarthestM) return;
    const NedPoint place = NedFrame(predicted->frame_origin).ToNed(point);
    const Eigen::Vector2d offset =
        predicted->x.head<2>() - Eigen::Vector2d(place.north_m, place.east_m);
    const Eigen::Matrix2d P = predicted->P.topLeftCorner<2, 2>();
    const double mean = P.trace() / 2;
    const double greatest = std::sqrt(
        mean + std::sqrt(std::max(0.0, mean * mean - P.determinant())));
    if (offset.norm() <=
        reach_m + predicted->radius_m + kNearSigmas * greatest) {
      names.push_back(contact.key().contact.value);
    }
  });
  return names;
}

TEST(ContactsView, IndexMissesNothingAtAnyTime) {
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> unit(0, 1);
  ContactMap map(ContactMapOptions{.max_contacts = 2000});
  std::vector<GeodeticPoint> ports;
  for (int i = 0; i < 12; ++i) {
    ports.push_back({.latitude_deg = 170 * unit(random) - 85,
                     .longitude_deg = 360 * unit(random) - 180});
  }
  ports.push_back({.latitude_deg = 0.01, .longitude_deg = 179.99});
  ports.push_back({.latitude_deg = 89.5, .longitude_deg = 20});
  const auto somewhere = [&] {
    const auto port = static_cast<std::size_t>(
        unit(random) * static_cast<double>(ports.size()));
    return Direct(ports[port], 360 * unit(random),
                  80'000 * unit(random) * unit(random));
  };
  double at_s = 0;
  std::size_t found = 0;
  for (int i = 0; i < 8000; ++i) {
    at_s += unit(random);
    const std::string name =
        std::to_string(static_cast<int>(1500 * unit(random)));
    // Most go on from where they were; some turn up elsewhere.
    const auto known = map.View().At(Key(name), AtS(at_s));
    GeodeticPoint place = known.has_value() && unit(random) < 0.9
                              ? known->Position()
                              : somewhere();
    place.latitude_deg = std::clamp(place.latitude_deg, -89.0, 89.0);
    ContactReport report =
        unit(random) < 0.5 ? Fix(name, at_s, place, 20 * unit(random) - 10,
                                 20 * unit(random) - 10)
                           : Heard(name, at_s, place, 5000 * unit(random) + 1,
                                   360 * unit(random));
    report.inactive = unit(random) < 0.05;
    map.Apply(report);
    if (i % 20 != 0) continue;
    const ContactsView view = map.View();
    // The past, the present, hours ahead.
    const double t = unit(random) < 0.5
                         ? at_s * unit(random)
                         : at_s + 20'000 * std::pow(unit(random), 4);
    const double reach_m = std::pow(10, 5 * unit(random));
    const GeodeticPoint point = somewhere();
    const auto expected = NearByDefinition(view, point, reach_m, AtS(t));
    ASSERT_EQ(NearNames(view, point, reach_m, AtS(t)), expected)
        << "step " << i << " t " << t << " reach " << reach_m;
    found += expected.size();
  }
  EXPECT_GT(found, 5000u);
}

// The index hears of a contact once a view: of one report, of several, of more
// than are kept, of late ones, ends, new lives, and of contacts that were
// forgotten meanwhile.
TEST(ContactsView, IndexMissesNothingAfterAnyNumberOfReports) {
  std::mt19937_64 random(31);
  std::uniform_real_distribution<double> unit(0, 1);
  constexpr int kNames = 200;
  ContactMap map(ContactMapOptions{.max_contacts = 25});
  std::vector<GeodeticPoint> places(kNames);
  for (GeodeticPoint& place : places) {
    place = Direct(kBay, 360 * unit(random), 50'000 * unit(random));
  }
  double at_s = 0;
  std::size_t found = 0;
  for (int round = 0; round < 150; ++round) {
    // Bursts of one contact, or a few reports of many.
    const int bursts = 1 + static_cast<int>(6 * unit(random));
    std::vector<std::size_t> touched;
    for (int burst = 0; burst < bursts; ++burst) {
      const auto i = static_cast<std::size_t>(kNames * unit(random));
      const std::string name = std::to_string(i);
      touched.push_back(i);
      const double most = unit(random) < 0.05 ? 600 : 100;
      const int reports = static_cast<int>(most * unit(random)) + 1;
      // Out and back again, at 20 m/s or so.
      const double course_deg = 360 * unit(random);
      for (int report = 0; report < reports; ++report) {
        const double step_s = 5 * unit(random);
        at_s += step_s;
        const double now_deg = course_deg + (2 * report > reports ? 180 : 0);
        places[i] = Direct(places[i], now_deg, 20 * step_s);
        const double late_s = unit(random) < 0.003 ? 40 * unit(random) : 0;
        const double course_rad = now_deg * std::numbers::pi / 180;
        ContactReport next =
            unit(random) < 0.3
                ? Fix(name, at_s - late_s, places[i], 20 * std::cos(course_rad),
                      20 * std::sin(course_rad))
                : Heard(name, at_s - late_s, places[i], 50, 0);
        next.inactive = unit(random) < 0.002;
        map.Apply(next);
      }
      // All that are alive are stale: then they make room and are forgotten.
      if (unit(random) < 0.05) at_s += 5000;
    }
    const ContactsView view = map.View();
    for (std::size_t question = 0; question < 6; ++question) {
      const double t = unit(random) < 0.7 ? at_s - 2000 * unit(random)
                                          : at_s + 2000 * unit(random);
      const auto i = touched[question % touched.size()];
      const auto there = view.At(Key(std::to_string(i)), AtS(t));
      const GeodeticPoint point =
          Direct(there.has_value() ? there->Position() : places[i],
                 360 * unit(random), 300 * unit(random));
      const double reach_m = std::pow(10, 2 * unit(random));
      const auto expected = NearByDefinition(view, point, reach_m, AtS(t));
      ASSERT_EQ(NearNames(view, point, reach_m, AtS(t)), expected)
          << "round " << round << " t " << t - at_s << " reach " << reach_m;
      found += expected.size();
    }
  }
  EXPECT_GT(found, 300u);
}

TEST(DiffContacts, TellsExactlyWhatChanged) {
  std::mt19937_64 random(4);
  ContactMap map(ContactMapOptions{.max_contacts = 400});
  ContactsView before = map.View();
  double at_s = 0;
  for (int round = 0; round < 200; ++round) {
    std::set<ContactKey> touched;
    const int reports = static_cast<int>(random() % 30);
    for (int i = 0; i < reports; ++i) {
      const std::string name = std::to_string(random() % 1500);
      ContactReport report = Fix(name, ++at_s, kBay);
      report.inactive = random() % 3 == 0;
      const ContactOutcome outcome = map.Apply(report);
      // An inactive report about a stranger changes nothing.
      if (outcome.estimate.has_value() && outcome.applied) {
        touched.insert(report.key);
      }
      // What was stale made room.
      for (const ContactEstimate& end : outcome.ended) touched.insert(end.key);
    }
    const ContactsView now = map.View();
    std::set<ContactKey> changed;
    std::set<ContactKey> gone;
    DiffContacts(
        before, now,
        [&](const Contact& contact) {
          EXPECT_EQ(now.Find(contact.key()), &contact);
          EXPECT_TRUE(changed.insert(contact.key()).second);
        },
        [&](const ContactKey& key) { EXPECT_TRUE(gone.insert(key).second); });
    // Touched and still held; held before and no longer.
    std::set<ContactKey> expected_changed;
    for (const ContactKey& key : touched) {
      if (now.Find(key) != nullptr) expected_changed.insert(key);
    }
    std::set<ContactKey> expected_gone;
    before.ForEach([&](const Contact& contact) {
      if (now.Find(contact.key()) == nullptr) {
        expected_gone.insert(contact.key());
      }
    });
    EXPECT_EQ(changed, expected_changed) << round;
    EXPECT_EQ(gone, expected_gone) << round;
    before = now;
  }
}

}  // namespace
}  // namespace fathom::map
