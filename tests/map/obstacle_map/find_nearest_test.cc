// The nearest obstacle against a search through every cell there is.
#include "map/obstacle_map/find_nearest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "tests/map/obstacle_map/test_missions.h"

namespace fathom::map {
namespace {

using ::absl::StatusCode;

NearestQuestion Question(const GeodeticPoint& from, double depth_m,
                         double radius_m) {
  NearestQuestion question;
  question.query = {.position = from, .depth_m = depth_m, .time = At(9)};
  question.search_radius_m = radius_m;
  question.unknown_is_free = true;
  return question;
}

std::optional<NearestObstacle> Find(ObstacleMap& map,
                                    const NearestQuestion& question) {
  // Leaked to the end of the test by the reasons: they point into it.
  static std::shared_ptr<const ObstacleMapView> view;
  view = map.View();
  auto found = FindNearestObstacle(*view, question);
  EXPECT_TRUE(found.ok()) << found.status();
  return found.ok() ? *found : std::nullopt;
}

// The least distance from `from` to a curve at(0) to at(1), by thirds.
double LeastM(const GeodeticPoint& from,
              const std::function<GeodeticPoint(double)>& at) {
  double low = 0;
  double high = 1;
  for (int step = 0; step < 60; ++step) {
    const double third = (high - low) / 3;
    if (DistanceM(from, at(low + third)) < DistanceM(from, at(high - third))) {
      high -= third;
    } else {
      low += third;
    }
  }
  return DistanceM(from, at(0.5 * (low + high)));
}

// The nearest by looking at every cell of the finest layers in turn. Shares
// with the search SeabedAt and Answer, not geometry, order or skipping.
class Oracle {
 public:
  Oracle(const ObstacleMapView& view, const NearestQuestion& question)
      : view_(view), question_(question) {}

  double Run() {
    if (Counts(question_.query.position)) return 0;
    for (const auto& activity : view_.activities()) {
      if (activity->open()) LookThrough(*activity->local);
    }
    LookThroughGlobal();
    return best_m_;
  }

 private:
  bool Counts(const GeodeticPoint& point) const {
    ObstacleQuery query = question_.query;
    query.position = point;
    const ObstacleAnswer answer =
        Answer(query, view_.SeabedAt(point), ContactsView());
    return answer.state == ObstacleState::kOccupied ||
           (answer.state == ObstacleState::kUnknown &&
            !question_.unknown_is_free) ||
           (answer.seabed.has_value() &&
            query.depth_m + query.vertical_clearance_m >=
                double{answer.seabed->estimate.hazard_m});
  }
  // A cell by its four sides: side(k, 0..1), one behind the other.
  void Add(const std::function<GeodeticPoint(int, double)>& side) {
    for (int k = 0; k < 4; ++k) {
      best_m_ =
          std::min(best_m_, LeastM(question_.query.position,
                                   [&](double at) { return side(k, at); }));
    }
  }
  bool Near(const GeodeticPoint& middle, double size_m) const {
    return DistanceM(question_.query.position, middle) <
           std::min(best_m_, question_.search_radius_m) + size_m;
  }

  void LookThrough(const LocalMapView& local) {
    const double size_m = local.options().cell_size_m;
    for (int i = 0; i < static_cast<int>(local.cells_north()); ++i) {
      for (int j = 0; j < static_cast<int>(local.cells_east()); ++j) {
        const GeodeticPoint middle = local.CellCenter({.i = i, .j = j});
        if (!Near(middle, size_m) || !Counts(middle)) continue;
        Add([&](int k, double at) {
          const double n = k == 0 ? 0 : k == 1 ? at : k == 2 ? 1 : 1 - at;
          const double e = k == 0 ? at : k == 1 ? 1 : k == 2 ? 1 - at : 0;
          return local.frame().ToGeodetic((i + n) * size_m, (j + e) * size_m);
        });
      }
    }
  }

  void LookThroughGlobal() {
    const RootSquare& root = view_.global().root();
    const std::uint32_t side = 1u << root.max_level();
    const double size_m = root.cell_size_m(root.max_level());
    for (std::uint32_t row = 0; row < side; ++row) {
      for (std::uint32_t col = 0; col < side; ++col) {
        const GeodeticPoint middle =
            root.Center({.level = static_cast<std::uint8_t>(root.max_level()),
                         .row = row,
                         .col = col});
        if (!Near(middle, size_m) || !Counts(middle)) continue;
        const auto seabed = view_.SeabedAt(middle);
        if (seabed.has_value() && seabed->local) continue;
        Add([&](int k, double at) {
          const double u = k == 0 ? 0 : k == 1 ? at : k == 2 ? 1 : 1 - at;
          const double v = k == 0 ? at : k == 1 ? 1 : k == 2 ? 1 - at : 0;
          return root.Unproject({.u = (row + u) / side, .v = (col + v) / side});
        });
      }
    }
  }

  const ObstacleMapView& view_;
  const NearestQuestion& question_;
  double best_m_ = std::numeric_limits<double>::infinity();
};

// 4 km of rough chart with a hole in it, and an activity on its corner.
MissionOptions RoughMission() {
  MissionOptions options;
  options.global.root =
      RootSquare::CenteredOn(Place(250, 250), 4000, 20).value();
  return options;
}

RasterBlock RoughChart(std::mt19937& random) {
  RasterBlock block;
  block.north_west = Place(1500, -1500);
  block.latitude_step_deg = 0.0006;
  block.longitude_step_deg = 0.0008;
  block.rows = 40;
  block.columns = 40;
  std::uniform_real_distribution<float> depth_m(8, 60);
  for (int k = 0; k < 1600; ++k) {
    const bool hole = k / 40 > 28 && k % 40 < 9;
    block.depth_m.push_back(hole ? std::numeric_limits<float>::quiet_NaN()
                                 : depth_m(random));
  }
  block.std_m = {1.0f};
  return block;
}

TEST(FindNearest, EqualsASearchThroughEveryCell) {
  std::mt19937 random(20260105);
  ObstacleMap map(RoughMission());
  ASSERT_TRUE(map.Import(RoughChart(random), true).ok());
  StartActivity survey = Survey("a");
  survey.options.cell_size_m = 12.5;
  survey.options.smoothing_distance_m = 30;
  survey.options.smoothing_scale = 0.5;
  ASSERT_TRUE(map.Start(survey).ok());
  std::uniform_real_distribution<double> in_area(10, 490);
  std::uniform_real_distribution<float> depth_m(5, 60);
  for (int n = 0; n < 400; ++n) {
    ASSERT_TRUE(map.ApplyPing(HitAt("a", in_area(random), in_area(random),
                                    depth_m(random), 0.3f, n))
                    .ok());
  }
  const auto view = map.View();
  std::uniform_real_distribution<double> around(-1600, 1600);
  std::uniform_real_distribution<double> deep(2, 30);
  int found_some = 0;
  int found_none = 0;
  int at_once = 0;
  for (int n = 0; n < 60; ++n) {
    NearestQuestion question = Question(Place(around(random), around(random)),
                                        deep(random), 50 + 8.0 * n);
    question.query.vertical_clearance_m = n % 3;
    question.query.confidence = n % 2 == 0 ? 0.95 : 0.6;
    question.unknown_is_free = n % 4 != 0;
    const auto found = FindNearestObstacle(*view, question);
    ASSERT_TRUE(found.ok()) << found.status();
    double expected_m = Oracle(*view, question).Run();
    // Beyond the square nothing is known: its border counts.
    if (!question.unknown_is_free && expected_m > 0) {
      const RootSquare& root = view->global().root();
      for (const double end : {0.0, 1.0}) {
        expected_m = std::min({expected_m,
                               LeastM(question.query.position,
                                      [&](double at) {
                                        return root.Unproject({end, at});
                                      }),
                               LeastM(question.query.position, [&](double at) {
                                 return root.Unproject({at, end});
                               })});
      }
    }
    if (!(expected_m <= question.search_radius_m)) {
      EXPECT_FALSE(found->has_value()) << n;
      ++found_none;
      continue;
    }
    ASSERT_TRUE(found->has_value()) << n << ": " << expected_m;
    const NearestObstacle& nearest = **found;
    // Cells of 20 m: 1e-9 x 400 = 0.4 um; the geodesics 15 nm; the search by
    // thirds ends within 1e-10 of a side.
    EXPECT_NEAR(nearest.distance_m, expected_m, 1e-4) << n;
    EXPECT_NEAR(DistanceM(question.query.position, nearest.position),
                nearest.distance_m, 1e-6);
    EXPECT_NE(nearest.answer.state, ObstacleState::kFree);
    if (nearest.distance_m == 0) {
      ++at_once;
      continue;
    }
    ++found_some;
    EXPECT_NEAR(DistanceM(Direct(question.query.position, nearest.bearing_deg,
                                 nearest.distance_m),
                          nearest.position),
                0, 1e-3);
  }
  EXPECT_GT(found_some, 15);
  EXPECT_GT(found_none, 3);
  EXPECT_GT(at_once, 3);
}

// A wall of 3 m sounded north-east of the place; 30 m of water elsewhere.
TEST(FindNearest, AWallIsFoundWithItsBearingAndReason) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(30, 1), true).ok());
  ASSERT_TRUE(map.Start(Survey("a")).ok());
  ASSERT_TRUE(map.ApplyPing(HitAt("a", 305, 405, 3, 0.01f, 1)).ok());
  const auto nearest = Find(map, Question(Place(105, 205), 10, 5000));
  ASSERT_TRUE(nearest.has_value());
  // The cell [300, 310] x [400, 410]: 195 m north, 195 m east of the place.
  EXPECT_NEAR(nearest->distance_m, 195 * std::sqrt(2.0), 0.01);
  EXPECT_NEAR(nearest->bearing_deg, 45, 0.01);
  EXPECT_EQ(nearest->answer.state, ObstacleState::kOccupied);
  ASSERT_TRUE(nearest->answer.seabed.has_value());
  EXPECT_TRUE(nearest->answer.seabed->local);
  EXPECT_FALSE(nearest->contact.has_value());
  // Within 270 m there is none; over it a vehicle at 2 m passes.
  EXPECT_FALSE(Find(map, Question(Place(105, 205), 10, 270)).has_value());
  EXPECT_FALSE(Find(map, Question(Place(105, 205), 2, 5000)).has_value());
  NearestQuestion clearance = Question(Place(105, 205), 2, 5000);
  clearance.query.vertical_clearance_m = 2;
  EXPECT_TRUE(Find(map, clearance).has_value());
}

// One sounding of 20 m, 5 cm sure, may be on a rock's top: the hazard
// begins 4.5 std above it, at 19.775 m, where P is small.
TEST(FindNearest, APointHazardCountsThoughNotOccupied) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(60, 1), true).ok());
  ASSERT_TRUE(map.Start(Survey("a", EstimatorKind::kAdaptive)).ok());
  ASSERT_TRUE(map.ApplyPing(HitAt("a", 305, 405, 20, 0.05f, 1)).ok());
  const auto nearest = Find(map, Question(Place(305, 205), 19.78, 1000));
  ASSERT_TRUE(nearest.has_value());
  EXPECT_NEAR(nearest->distance_m, 195, 0.01);
  EXPECT_EQ(nearest->answer.state, ObstacleState::kUncertain);
  EXPECT_LT(nearest->answer.probability, 0.5);  // Far below 0.95.
  EXPECT_FALSE(Find(map, Question(Place(305, 205), 19.77, 1000)).has_value());
}

TEST(FindNearest, UnknownCountsUnlessItIsAskedForAsFree) {
  ObstacleMap map(SmallMission());
  // Chart from 41.7 down to 41.3, from 71.6 to 71.0 W: the whole square.
  ASSERT_TRUE(map.Import(FlatChart(30, 1), true).ok());
  NearestQuestion question = Question(Place(0, 0), 10, 50'000);
  EXPECT_FALSE(Find(map, question).has_value());
  question.unknown_is_free = false;
  const auto border = Find(map, question);
  ASSERT_TRUE(border.has_value());
  // South: 0.05 degree to the square's side, which bows north of the parallel
  // by less than 20 m: 0.05 x 111 060 = 5553 m.
  EXPECT_NEAR(border->distance_m, 5553, 20);
  EXPECT_NEAR(border->bearing_deg, 180, 1);
  EXPECT_EQ(border->answer.state, ObstacleState::kUnknown);

  ObstacleMap empty(SmallMission());
  const auto here = Find(empty, question);
  ASSERT_TRUE(here.has_value());
  EXPECT_EQ(here->distance_m, 0);
  EXPECT_EQ(here->bearing_deg, 0);
}

ContactReport Ship(double north_m, double east_m) {
  ContactReport report;
  report.key = {.source = SourceId{"c4i"}, .contact = ContactId{"ship"}};
  report.contact_class = ContactClass::kVessel;
  report.time = At(0);
  ContactFix fix;
  fix.position = Place(north_m, east_m);
  fix.position_std_m = 10;
  fix.velocity_std_m_s = 0.5;
  fix.velocity_east_m_s = 5;
  report.observation = fix;
  return report;
}

TEST(FindNearest, AContactIsADiscWhereItIsPredicted) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(60, 1), true).ok());
  map.ApplyContact(Ship(0, 2000));
  NearestQuestion question = Question(Place(0, 0), 5, 5000);
  question.query.time = At(100);
  const auto nearest = Find(map, question);
  ASSERT_TRUE(nearest.has_value());
  ASSERT_TRUE(nearest->contact.has_value());
  EXPECT_EQ(nearest->contact->contact.value, "ship");
  // 2000 m + 100 s x 5 m/s less its radius.
  const double radius_m =
      map.View()->contacts().Find(*nearest->contact)->newest().radius_m;
  EXPECT_GT(radius_m, 0);
  EXPECT_NEAR(nearest->distance_m, 2500 - radius_m, 0.5);
  EXPECT_NEAR(nearest->bearing_deg, 90, 0.1);
  ASSERT_EQ(nearest->answer.contacts.size(), 1u);
  // Far below its keel it is no obstacle.
  question.query.depth_m = 50;
  EXPECT_FALSE(Find(map, question).has_value());
}

TEST(FindNearest, EndsAtItsBoundAndWhenToldTo) {
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(30, 1), true).ok());
  StartActivity survey = Survey("a");
  ASSERT_TRUE(map.Start(survey).ok());
  ASSERT_TRUE(map.ApplyPing(HitAt("a", 105, 105, 30, 1, 1)).ok());
  const NearestQuestion question = Question(Place(250, 250), 10, 50'000);
  const auto view = map.View();
  EXPECT_EQ(
      FindNearestObstacle(*view, question, {.most_cells = 100}).status().code(),
      StatusCode::kResourceExhausted);
  const std::atomic<bool> stop{true};
  EXPECT_EQ(
      FindNearestObstacle(*view, question, {.stop = &stop}).status().code(),
      StatusCode::kCancelled);
}

TEST(FindNearest, RefusesARadiusOutsideItsRange) {
  ObstacleMap map(SmallMission());
  const auto view = map.View();
  for (const double radius_m :
       {0.0, -1.0, 50'000.1, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_EQ(FindNearestObstacle(*view, Question(Place(0, 0), 10, radius_m))
                  .status()
                  .code(),
              StatusCode::kInvalidArgument);
  }
  EXPECT_TRUE(
      FindNearestObstacle(*view, Question(Place(0, 0), 10, 50'000)).ok());
}

}  // namespace
}  // namespace fathom::map
