#include "map/query/obstacle_query.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "map/contacts/contact_map.h"
#include "map/query/disc_probability.h"
#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

using ::fathom::testing::StatusIs;

constexpr GeodeticPoint kBay{.latitude_deg = 41.5, .longitude_deg = -71.4};
constexpr std::uint32_t kNowS = 1'022'241'600;
const Time kNow = TimeFromUnixMicros(std::int64_t{kNowS} * 1'000'000);

SeabedEstimate Seabed(float depth_m, float std_m,
                      EvidenceKind kind = EvidenceKind::kMeasured) {
  return {
      .estimate = {
          .depth_m = depth_m, .std_m = std_m, .kind = kind, .time_s = kNowS}};
}

ObstacleQuery At(double depth_m) {
  return {.position = kBay, .depth_m = depth_m, .time = kNow};
}

// A map with one contact at `position`, told 10 m and 0.5 m/s sharp at kNow.
ContactsView OneContact(const GeodeticPoint& position,
                        ContactClass contact_class = ContactClass::kVessel,
                        std::optional<double> depth_m = {},
                        std::optional<double> depth_std_m = {}) {
  ContactMap map(ContactMapOptions{});
  map.Apply({.key = {.source = {"c4i"}, .contact = {"ship"}},
             .contact_class = contact_class,
             .time = kNow,
             .observation = ContactFix{.position = position},
             .depth_m = depth_m,
             .depth_std_m = depth_std_m});
  return map.View();
}

TEST(Answer, StaticProbabilityIsTheNormalDistributions) {
  // Phi((17 + 1 - 20) / 2) = Phi(-1).
  ObstacleQuery query = At(17);
  query.vertical_clearance_m = 1;
  const ObstacleAnswer answer = Answer(query, Seabed(20, 2), {});
  EXPECT_NEAR(answer.probability, 0.158655253931457, 1e-14);
  EXPECT_EQ(answer.state, ObstacleState::kUncertain);
  ASSERT_TRUE(answer.seabed.has_value());
  EXPECT_EQ(answer.seabed->probability, answer.probability);
  EXPECT_EQ(answer.seabed->age_s, 0);
  EXPECT_TRUE(answer.contacts.empty());
}

TEST(Answer, GrowsWithDepthAndWithClearance) {
  double before = 0;
  for (double depth_m = 0; depth_m <= 40; depth_m += 0.25) {
    const double now = Answer(At(depth_m), Seabed(20, 3), {}).probability;
    EXPECT_GE(now, before);
    ObstacleQuery wary = At(depth_m);
    wary.vertical_clearance_m = 2;
    EXPECT_GE(Answer(wary, Seabed(20, 3), {}).probability, now);
    before = now;
  }
  EXPECT_GT(before, 0.999999);
}

TEST(Answer, SeabedWithoutUncertaintyIsAStep) {
  EXPECT_EQ(Answer(At(19.9), Seabed(20, 0), {}).probability, 0);
  // At or below the top it is solid.
  EXPECT_EQ(Answer(At(20), Seabed(20, 0), {}).probability, 1);
}

TEST(ClassifyProbability, BoundsBelongToOccupiedAndFree) {
  using S = ObstacleState;
  EXPECT_EQ(ClassifyProbability(0.95, 0.95, true), S::kOccupied);
  EXPECT_EQ(ClassifyProbability(std::nextafter(0.95, 0), 0.95, true),
            S::kUncertain);
  EXPECT_EQ(ClassifyProbability(1 - 0.95, 0.95, true), S::kFree);
  EXPECT_EQ(ClassifyProbability(std::nextafter(1 - 0.95, 1), 0.95, true),
            S::kUncertain);
  EXPECT_EQ(ClassifyProbability(0, 0.95, true), S::kFree);
  EXPECT_EQ(ClassifyProbability(1, 0.95, true), S::kOccupied);
  // Where the seabed is unknown nothing is free.
  EXPECT_EQ(ClassifyProbability(0, 0.95, false), S::kUnknown);
  EXPECT_EQ(ClassifyProbability(0.5, 0.95, false), S::kUnknown);
  EXPECT_EQ(ClassifyProbability(0.95, 0.95, false), S::kOccupied);
}

TEST(Answer, UnknownSeabedIsNeverFree) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const std::optional<SeabedEstimate>& seabed :
       {std::optional<SeabedEstimate>(),
        std::optional(Seabed(20, 2, EvidenceKind::kNone)),
        std::optional(Seabed(nan, 2)), std::optional(Seabed(20, nan))}) {
    const ObstacleAnswer answer = Answer(At(5), seabed, {});
    EXPECT_EQ(answer.state, ObstacleState::kUnknown);
    EXPECT_EQ(answer.probability, 0);
    EXPECT_FALSE(answer.seabed.has_value());
  }
}

TEST(Answer, ContactAloneMakesAnUnknownPlaceOccupied) {
  const ObstacleAnswer answer = Answer(At(5), std::nullopt, OneContact(kBay));
  EXPECT_EQ(answer.state, ObstacleState::kOccupied);
  // Radius 100 m, sigma 10 m: 1 - exp(-50).
  EXPECT_NEAR(answer.probability, 1, 1e-7);
  EXPECT_FALSE(answer.seabed.has_value());
}

TEST(Answer, VagueContactLeavesAnUnknownPlaceUnknown) {
  const ObstacleAnswer answer =
      Answer(At(5), std::nullopt, OneContact(Direct(kBay, 0, 100)));
  // Its edge is at the point: about one half.
  EXPECT_EQ(answer.state, ObstacleState::kUnknown);
  EXPECT_NEAR(answer.probability, 0.5, 0.03);
}

TEST(Answer, LandIsSolidAtEveryDepth) {
  const ObstacleAnswer answer =
      Answer(At(-50), Seabed(0, 0, EvidenceKind::kLand), {});
  EXPECT_EQ(answer.state, ObstacleState::kOccupied);
  EXPECT_EQ(answer.probability, 1);
  // Its depth means nothing, not even that it is no number.
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(
      Answer(At(0), Seabed(nan, nan, EvidenceKind::kLand), {}).probability, 1);
}

// A rock at 15 m, told with its margin as 14.5, in a floor of 20 +- 0.2 m.
TEST(Answer, IsNeverFreeAtAPointHazardOrBelow) {
  SeabedEstimate seabed = Seabed(20, 0.2f);
  seabed.estimate.hazard_m = 14.5f;
  const ObstacleAnswer above = Answer(At(14.4), seabed, {});
  EXPECT_EQ(above.state, ObstacleState::kFree);
  EXPECT_LT(above.probability, 1e-9);
  for (const double depth_m : {14.5, 15.0, 19.0}) {
    const ObstacleAnswer at = Answer(At(depth_m), seabed, {});
    EXPECT_EQ(at.state, ObstacleState::kUncertain) << depth_m;
    EXPECT_EQ(at.probability, 0.06) << depth_m;
  }
  // Nor for someone who calls 10 % free.
  ObstacleQuery bold = At(15);
  bold.confidence = 0.9;
  EXPECT_EQ(Answer(bold, seabed, {}).state, ObstacleState::kUncertain);
  // The clearance reaches it.
  ObstacleQuery wide = At(12);
  wide.vertical_clearance_m = 3;
  EXPECT_EQ(Answer(wide, seabed, {}).state, ObstacleState::kUncertain);
  EXPECT_EQ(Answer(At(21), seabed, {}).state, ObstacleState::kOccupied);
}

TEST(Answer, EvidenceFadesWithAgeInTheAnswerOnly) {
  ObstacleQuery query = At(18);
  query.time = kNow + std::chrono::seconds(1200);
  // 2^2 + 0.01 * 1200 = 16: Phi((18 - 20) / 4) = Phi(-0.5).
  const ObstacleAnswer answer =
      Answer(query, Seabed(20, 2), {}, {.ageing_rate_m2_s = 0.01});
  EXPECT_NEAR(answer.probability, 0.308537538725987, 1e-14);
  EXPECT_EQ(answer.seabed->age_s, 1200);
  EXPECT_EQ(answer.seabed->estimate.std_m, 2);
  // Rate 0 is the thesis's map.
  EXPECT_NEAR(Answer(query, Seabed(20, 2), {}).probability, 0.158655253931457,
              1e-14);
}

TEST(Answer, EvidenceFromLaterIsNotAgedAndUnknownAgeIsNotTold) {
  ObstacleQuery query = At(18);
  query.time = kNow - std::chrono::seconds(1200);
  const QueryModel model{.ageing_rate_m2_s = 0.01};
  ObstacleAnswer answer = Answer(query, Seabed(20, 2), {}, model);
  EXPECT_EQ(answer.seabed->age_s, 0);
  EXPECT_NEAR(answer.probability, 0.158655253931457, 1e-14);
  SeabedEstimate timeless = Seabed(20, 2);
  timeless.estimate.time_s = 0;
  answer = Answer(query, timeless, {}, model);
  EXPECT_FALSE(answer.seabed->age_s.has_value());
}

TEST(Answer, JoinsSeabedAndContacts) {
  ContactMap map(ContactMapOptions{});
  for (const double north_m : {100.0, 110.0}) {
    map.Apply({.key = {.source = {"c4i"},
                       .contact = {std::to_string(static_cast<int>(north_m))}},
               .contact_class = ContactClass::kVessel,
               .time = kNow,
               .observation = ContactFix{.position = Direct(kBay, 0, north_m)},
               .depth_m = {},
               .depth_std_m = {}});
  }
  const ObstacleAnswer answer = Answer(At(9), Seabed(10, 1), map.View());
  const Eigen::Matrix2d P = Eigen::Matrix2d::Identity() * 100;
  const double p1 = DiscProbability({100, 0}, P, 100);
  const double p2 = DiscProbability({110, 0}, P, 100);
  const double p_static = NormalCdf(-1);
  // Plane and geodesic differ by nm at 110 m.
  EXPECT_NEAR(answer.probability, 1 - (1 - p_static) * (1 - p1) * (1 - p2),
              1e-8);
  ASSERT_EQ(answer.contacts.size(), 2u);
  // The likelier first.
  EXPECT_EQ(answer.contacts[0].key.contact.value, "100");
  EXPECT_NEAR(answer.contacts[0].probability, p1, 1e-8);
  EXPECT_NEAR(answer.contacts[0].distance_m, 100, 1e-4);
  EXPECT_NEAR(answer.contacts[1].probability, p2, 1e-8);
  EXPECT_EQ(answer.seabed->probability, p_static);
}

TEST(Answer, RadiusOfTheVehicleAddsToTheContacts) {
  const ContactsView contacts = OneContact(Direct(kBay, 90, 160));
  ObstacleQuery query = At(5);
  const double without = Answer(query, Seabed(1000, 1), contacts).probability;
  query.radius_m = 60;
  const double with = Answer(query, Seabed(1000, 1), contacts).probability;
  // 100 m from 160 m away with 10 m: 6 sigma; 160 m: the edge.
  EXPECT_LT(without, 1e-8);
  EXPECT_NEAR(with, 0.5, 0.03);
}

TEST(Answer, ShipReachesDownToItsKeel) {
  const ContactsView contacts = OneContact(kBay);  // Keel 10 m.
  EXPECT_GT(Answer(At(0), Seabed(1000, 1), contacts).probability, 0.99);
  EXPECT_GT(Answer(At(10), Seabed(1000, 1), contacts).probability, 0.99);
  EXPECT_EQ(Answer(At(10.1), Seabed(1000, 1), contacts).probability, 0);
  // z - h = 12 - 2 <= 10.
  ObstacleQuery wary = At(12);
  wary.vertical_clearance_m = 2;
  EXPECT_GT(Answer(wary, Seabed(1000, 1), contacts).probability, 0.99);
}

TEST(Answer, SubmergedContactIsWhereItsDepthSays) {
  // At 100 m +- 5 m, 15 m high: 92.5 to 107.5.
  const ContactsView contacts =
      OneContact(kBay, ContactClass::kSubmerged, 100, 5);
  const auto probability = [&](double depth_m) {
    return Answer(At(depth_m), Seabed(1000, 1), contacts).probability;
  };
  // Phi(7.5 / 5) - Phi(-7.5 / 5) = 0.866385597462284.
  EXPECT_NEAR(probability(100), 0.866385597462284, 1e-6);
  // Phi((110 - 92.5) / 5) - Phi((110 - 107.5) / 5)
  //   = Phi(3.5) - Phi(0.5) = 0.999767370920964 - 0.691462461274013.
  EXPECT_NEAR(probability(110), 0.308304909646951, 1e-6);
  EXPECT_LT(probability(10), 1e-12);
  // Without a depth it may be anywhere down to 500 m.
  const ContactsView vague = OneContact(kBay, ContactClass::kSubmerged);
  EXPECT_GT(Answer(At(499), Seabed(1000, 1), vague).probability, 0.99);
  EXPECT_GT(Answer(At(0), Seabed(1000, 1), vague).probability, 0.99);
  EXPECT_EQ(Answer(At(501), Seabed(1000, 1), vague).probability, 0);
}

TEST(Answer, PredictsTheContactToTheTimeAsked) {
  ContactMap map(ContactMapOptions{});
  map.Apply(
      {.key = {.source = {"c4i"}, .contact = {"ship"}},
       .contact_class = ContactClass::kVessel,
       .time = kNow,
       .observation = ContactFix{.position = kBay, .velocity_north_m_s = 10},
       .depth_m = {},
       .depth_std_m = {}});
  const ContactsView contacts = map.View();
  ObstacleQuery query = At(5);
  query.position = Direct(kBay, 0, 600);
  EXPECT_EQ(Answer(query, Seabed(1000, 1), contacts).probability, 0);
  query.time = kNow + std::chrono::seconds(60);
  const ObstacleAnswer answer = Answer(query, Seabed(1000, 1), contacts);
  // Variance 10^2 + 60^2 * 0.5^2 + 2e-3 * 60^3 / 3 = 1144 m^2 per axis:
  // 1 - exp(-100^2 / (2 * 1144)).
  EXPECT_NEAR(answer.probability, 1 - std::exp(-1e4 / 2288), 1e-6);
  ASSERT_EQ(answer.contacts.size(), 1u);
  EXPECT_EQ(answer.contacts[0].age_s, 60);
  // Before its first report there is no contact.
  query.time = kNow - std::chrono::seconds(1);
  query.position = kBay;
  EXPECT_EQ(Answer(query, Seabed(1000, 1), contacts).probability, 0);
}

TEST(Answer, TellsTheSixteenLikeliestContacts) {
  ContactMap map(ContactMapOptions{});
  for (int i = 0; i < 20; ++i) {
    map.Apply(
        {.key = {.source = {"c4i"}, .contact = {std::to_string(i)}},
         .contact_class = ContactClass::kVessel,
         .time = kNow,
         .observation = ContactFix{.position = Direct(kBay, 0, 130 - 2.0 * i)},
         .depth_m = {},
         .depth_std_m = {}});
  }
  const ObstacleAnswer answer = Answer(At(5), Seabed(1000, 1), map.View());
  ASSERT_EQ(answer.contacts.size(), 16u);
  for (std::size_t i = 0; i < 16; ++i) {
    EXPECT_EQ(answer.contacts[i].key.contact.value, std::to_string(19 - i));
  }
}

TEST(ValidateQuery, NamesTheFieldThatIsWrong) {
  FATHOM_EXPECT_OK(ValidateQuery(At(5)));
  const double nan = std::nan("");
  const auto refused = [](auto&& change, const std::string& field) {
    ObstacleQuery query = At(5);
    change(query);
    EXPECT_THAT(ValidateQuery(query),
                StatusIs(absl::StatusCode::kInvalidArgument,
                         ::testing::HasSubstr(field)));
  };
  using Q = ObstacleQuery;
  refused([&](Q& q) { q.position.latitude_deg = nan; }, "latitude_deg");
  refused([&](Q& q) { q.position.longitude_deg = 181; }, "longitude_deg");
  refused([&](Q& q) { q.depth_m = nan; }, "depth_m");
  refused([&](Q& q) { q.depth_m = 12'001; }, "depth_m");
  refused([&](Q& q) { q.confidence = 0.5; }, "confidence");
  refused([&](Q& q) { q.confidence = 1; }, "confidence");
  refused([&](Q& q) { q.confidence = nan; }, "confidence");
  refused([&](Q& q) { q.vertical_clearance_m = -1; }, "vertical_clearance_m");
  refused([&](Q& q) { q.radius_m = -1; }, "radius_m");
  refused([&](Q& q) { q.radius_m = nan; }, "radius_m");
}

}  // namespace
}  // namespace fathom::map
