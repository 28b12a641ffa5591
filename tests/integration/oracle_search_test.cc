// Searches and trajectories to a live server, each answer held against going
// through all cells and contacts (oracle_scene.h).
//
// What the seabed says is asked for a time before anything was sounded or
// sighted: nothing has aged, no contact is there. What contacts say is asked
// near the surface, where no seabed reaches.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "client/proto_time.h"
#include "tests/integration/oracle.h"
#include "tests/integration/oracle_scene.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
// Before the first sounding and the first report, both at 0.
constexpr double kBeforeS = -10'000;
// Between the oracle's planes and the server's.
constexpr double kPlaceM = 2e-3;

// The server draws a track between the times that it looks at as straight
// pieces (map/query/closest_approach.h); how far that may be off is stated in
// standard deviations of the contact's place: 0.1 makes 0.04 of P at most.
constexpr double kApproachSigmas = 0.1;

// A value that rounding may put anywhere between two.
struct Span {
  double least = kInf;
  double most = kInf;
};

struct Point {
  double north_m = 0;
  double east_m = 0;
};

double Length(Point a, Point b) {
  return std::hypot(a.north_m - b.north_m, a.east_m - b.east_m);
}
Point Between(Point a, Point b, double share) {
  return {std::lerp(a.north_m, b.north_m, share),
          std::lerp(a.east_m, b.east_m, share)};
}

// A square cell.
struct Square {
  Point south_west;
  double side_m = 0;

  double From(Point p) const {
    return std::hypot(std::max({south_west.north_m - p.north_m, 0.0,
                                p.north_m - south_west.north_m - side_m}),
                      std::max({south_west.east_m - p.east_m, 0.0,
                                p.east_m - south_west.east_m - side_m}));
  }
};

// Where on the way from a to b a function of the share is least, if it falls
// and then rises.
template <typename Function>
double LeastAt(const Function& function, double low = 0, double high = 1) {
  for (int i = 0; i < 80; ++i) {
    const double one = (2 * low + high) / 3;
    const double two = (low + 2 * high) / 3;
    (function(one) <= function(two) ? high : low) =
        function(one) <= function(two) ? two : one;
  }
  return (low + high) / 2;
}

// The least distance of a leg from a cell: that of a point from a convex set
// falls and then rises.
double FromLeg(const Square& cell, Point a, Point b) {
  return cell.From(Between(a, b, LeastAt([&](double share) {
                             return cell.From(Between(a, b, share));
                           })));
}

// The first share of the leg at which the cell is within `reach_m`.
// REQUIRES: it comes to that.
double TouchedAt(const Square& cell, Point a, Point b, double reach_m) {
  const auto from = [&](double share) {
    return cell.From(Between(a, b, share));
  };
  double far = 0;
  double near = LeastAt(from);
  if (from(far) <= reach_m) return 0;
  for (int i = 0; i < 100; ++i) {
    const double middle = (far + near) / 2;
    (from(middle) <= reach_m ? near : far) = middle;
  }
  return near;
}

// The share of the leg that is `ahead_m` before the cell's middle comes
// abreast.
double ShareBefore(const Square& cell, Point a, Point b, double ahead_m) {
  const double length_m = Length(a, b);
  const double along_m =
      ((cell.south_west.north_m + cell.side_m / 2 - a.north_m) *
           (b.north_m - a.north_m) +
       (cell.south_west.east_m + cell.side_m / 2 - a.east_m) *
           (b.east_m - a.east_m)) /
      length_m;
  return std::clamp((along_m - ahead_m) / length_m, 0.0, 1.0);
}

class SearchOracle : public OracleScene {
 protected:
  void SetUp() override {
    OracleScene::SetUp();
    for (const Area& area : areas_) {
      if (area.completed) continue;
      Survey& survey = surveys_.emplace_back(Survey{.area = &area});
      const auto corner = plane_.ToGeodetic(area.north_m, area.east_m);
      survey.plane = Plane(corner.latitude_deg(), corner.longitude_deg());
      for (int k = 0; k < area.cells * area.cells; ++k) {
        survey.cells.push_back(area.Cell(k / area.cells, k % area.cells));
      }
    }
  }

  // An open activity in metres from its own corner.
  struct Survey {
    const Area* area;
    Plane plane{0, 0};
    std::vector<oracle::Seabed> cells = {};

    Square SquareOf(std::size_t k) const {
      const auto across = static_cast<std::size_t>(area->cells);
      return {{static_cast<double>(k / across) * kCellM,
               static_cast<double>(k % across) * kCellM},
              kCellM};
    }
  };

  // What a cell is to one at z + h who wants confidence c.
  struct Verdict {
    // P without a contact.
    double probability = 0;
    // Not to be run into: surely; perhaps.
    bool bad = false;
    bool maybe_bad = false;
    // UNCERTAIN or worse: surely; perhaps.
    bool doubtful = false;
    bool maybe_doubtful = false;
    bool unknown = false;
  };
  static Verdict Judge(const oracle::Seabed& seabed, double solid_above_m,
                       double confidence, bool unknown_is_free) {
    const oracle::Expected expected =
        Answer({.depth_m = solid_above_m, .time_s = kBeforeS}, seabed, {}, 0);
    const double p = expected.probability;
    const double hazard_m = expected.into_hazard_m.value_or(-1);
    const bool unknown = !seabed.known && !unknown_is_free;
    return {
        .probability = p,
        .bad = unknown || p >= confidence + kTolerance || hazard_m > 1e-4,
        .maybe_bad =
            unknown || p >= confidence - kTolerance || hazard_m > -1e-4,
        .doubtful = p > 1 - confidence + kTolerance || hazard_m > 1e-4,
        .maybe_doubtful = p > 1 - confidence - kTolerance || hazard_m > -1e-4,
        .unknown = unknown};
  }

  double AnyConfidence() { return std::array{0.6, 0.9, 0.95, 0.99}[Pick4()]; }
  std::size_t Pick4() { return static_cast<std::size_t>(Pick(4)); }
  const Survey& AnySurvey() {
    return surveys_[static_cast<std::size_t>(
        Pick(static_cast<int>(surveys_.size())))];
  }
  Point AnyPoint(const Survey& survey, double margin_m) {
    const double far_m = survey.area->side_m() - margin_m;
    return {Uniform(margin_m, far_m), Uniform(margin_m, far_m)};
  }

  std::vector<Survey> surveys_;
};

TEST_F(SearchOracle, TheNearestOfAllCellsIsFound) {
  constexpr int kQuestions = 3000;
  int found = 0;
  double worst_m = 0;
  for (int n = 0; n < kQuestions; ++n) {
    const Survey& survey = AnySurvey();
    // No other activity and no border comes as near.
    const Point from = AnyPoint(survey, 60);
    const bool unknown_is_free = Pick(2) == 0 || survey.area->prior.has_value();
    const double radius_m = unknown_is_free ? 250 : 55;
    const double depth_m = Uniform(5, 20);
    const double clearance_m = Uniform(0, 3);
    const double c = AnyConfidence();
    Span expected;
    for (std::size_t k = 0; k < survey.cells.size(); ++k) {
      const Verdict verdict =
          Judge(survey.cells[k], depth_m + clearance_m, c, unknown_is_free);
      const double away_m = survey.SquareOf(k).From(from);
      if (verdict.bad) expected.most = std::min(expected.most, away_m);
      if (verdict.maybe_bad) expected.least = std::min(expected.least, away_m);
    }
    v1::FindNearestObstacleRequest request;
    *request.mutable_position() =
        survey.plane.ToGeodetic(from.north_m, from.east_m);
    request.set_depth_m(depth_m);
    *request.mutable_time() = ToProto(At(kBeforeS));
    request.set_confidence(c);
    request.set_vertical_clearance_m(clearance_m);
    request.set_search_radius_m(radius_m);
    request.set_treat_unknown_as(unknown_is_free
                                     ? v1::UNKNOWN_TREATMENT_FREE
                                     : v1::UNKNOWN_TREATMENT_OCCUPIED);
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto nearest,
                                client_->FindNearestObstacle(request));
    const std::string where = absl::StrCat(
        "question ", n, ", seed ", kSeed, ", ", survey.area->name, ": north ",
        from.north_m, " east ", from.east_m, " depth ", depth_m, " clearance ",
        clearance_m, " c ", c, " expected ", expected.least, " to ",
        expected.most, ": ", nearest.ShortDebugString());
    // A cell of the global map, of 9.04 m, is unknown if its middle is: it may
    // reach beyond the activity's unknown cell by half its diagonal.
    if (nearest.answer().state() == v1::OBSTACLE_STATE_UNKNOWN) {
      expected.least -= 0.5 * std::hypot(9.05, 9.05);
    }
    if (!nearest.found()) {
      ASSERT_GT(expected.most, radius_m - kPlaceM) << where;
      continue;
    }
    ++found;
    ASSERT_GE(nearest.distance_m(), expected.least - kPlaceM) << where;
    ASSERT_LE(nearest.distance_m(), expected.most + kPlaceM) << where;
    if (nearest.answer().state() == v1::OBSTACLE_STATE_UNKNOWN) continue;
    worst_m =
        std::max(worst_m, std::fabs(nearest.distance_m() - expected.most));
  }
  std::printf("%d searches, %d found: greatest difference %.1e m\n", kQuestions,
              found, worst_m);
  EXPECT_GT(found, kQuestions / 4);
  EXPECT_LT(found, kQuestions);
}

TEST_F(SearchOracle, TheNearestOfAllContactsIsFound) {
  constexpr int kQuestions = 2000;
  constexpr double kRadiusM = 300;
  // Shallower than any seabed of the scene but land, which is farther off.
  constexpr double kDepthM = 2;
  int found = 0;
  for (int n = 0; n < kQuestions; ++n) {
    const oracle::Track& track = tracks_[static_cast<std::size_t>(
        Pick(static_cast<int>(tracks_.size())))];
    const double time_s = std::round(Uniform(0, 700));
    const auto place = PlaceOf(track, time_s);
    if (!place.has_value()) continue;
    const Point from = {place->north_m + Uniform(-400, 400),
                        place->east_m + Uniform(-400, 400)};
    if (from.north_m > 1200) continue;
    double nearest_m = kInf;
    for (const oracle::Track& other : tracks_) {
      const auto there = PlaceOf(other, time_s);
      if (!there.has_value() || other.keel_depth_m < kDepthM) continue;
      nearest_m =
          std::min(nearest_m,
                   std::max(0.0, Length(from, {there->north_m, there->east_m}) -
                                     other.radius_m));
    }
    v1::FindNearestObstacleRequest request;
    *request.mutable_position() = plane_.ToGeodetic(from.north_m, from.east_m);
    request.set_depth_m(kDepthM);
    *request.mutable_time() = ToProto(At(time_s));
    request.set_confidence(0.95);
    request.set_search_radius_m(kRadiusM);
    request.set_treat_unknown_as(v1::UNKNOWN_TREATMENT_FREE);
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto nearest,
                                client_->FindNearestObstacle(request));
    const std::string where =
        absl::StrCat("question ", n, ", seed ", kSeed, ": north ", from.north_m,
                     " east ", from.east_m, " time ", time_s);
    if (std::fabs(nearest_m - kRadiusM) < kPlaceM) continue;
    ASSERT_EQ(nearest.found(), nearest_m < kRadiusM)
        << where << " expected " << nearest_m;
    if (!nearest.found()) continue;
    ++found;
    ASSERT_NEAR(nearest.distance_m(), nearest_m, kPlaceM) << where;
    ASSERT_FALSE(nearest.contact_id().empty()) << where;
  }
  std::printf("%d searches for contacts, %d found\n", kQuestions, found);
  EXPECT_GT(found, kQuestions / 4);
}

TEST_F(SearchOracle, NoCellOfAWayIsMissed) {
  constexpr int kWays = 400;
  constexpr double kSpeedMS = 2;
  int legs = 0;
  int conflicts = 0;
  for (int n = 0; n < kWays; ++n) {
    const Survey& survey = AnySurvey();
    const bool unknown_is_free = Pick(2) == 0;
    const double c = AnyConfidence();
    const double depth_m = Uniform(5, 20);
    const double clearance_m = Uniform(0, 3);
    const double radius_m = Uniform(0, 12);
    const double std_m = Pick(2) * Uniform(0, 8);
    const double reach_m = radius_m + std_m * std::sqrt(-2 * std::log(1 - c));
    std::vector<Point> ends = {AnyPoint(survey, 60)};
    v1::CheckTrajectoryRequest request;
    v1::Trajectory& trajectory = *request.mutable_trajectory();
    std::vector<double> times_s = {kBeforeS};
    for (int k = 1 + Pick(5); k > 0; --k) {
      ends.push_back(AnyPoint(survey, 60));
      times_s.push_back(
          times_s.back() + 1 +
          std::floor(Length(ends[ends.size() - 2], ends.back()) / kSpeedMS));
    }
    for (std::size_t k = 0; k < ends.size(); ++k) {
      v1::Waypoint* waypoint = trajectory.add_waypoints();
      *waypoint->mutable_position() =
          survey.plane.ToGeodetic(ends[k].north_m, ends[k].east_m);
      waypoint->set_depth_m(depth_m);
      *waypoint->mutable_time() = ToProto(At(times_s[k]));
    }
    trajectory.set_radius_m(radius_m);
    trajectory.set_vertical_clearance_m(clearance_m);
    trajectory.set_position_std_m(std_m);
    trajectory.set_confidence(c);
    trajectory.set_treat_unknown_as(unknown_is_free
                                        ? v1::UNKNOWN_TREATMENT_FREE
                                        : v1::UNKNOWN_TREATMENT_OCCUPIED);
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto verdict,
                                client_->CheckTrajectory(request));
    ASSERT_EQ(verdict.legs_size() + 1, std::ssize(ends));
    // The first conflict: at the latest, at the earliest.
    Span first_s;
    std::optional<std::uint32_t> first_leg;
    for (std::size_t leg = 0; leg + 1 < ends.size(); ++leg, ++legs) {
      Span clearance;
      double surely_worst = 0;
      double perhaps_worst = 0;
      bool bad = false, maybe_bad = false;
      bool doubtful = false, maybe_doubtful = false;
      for (std::size_t k = 0; k < survey.cells.size(); ++k) {
        const Square square = survey.SquareOf(k);
        // Far from the whole leg: what follows is slow.
        if (square.From(Between(ends[leg], ends[leg + 1], 0.5)) >
            Length(ends[leg], ends[leg + 1]) / 2 + reach_m + 1) {
          continue;
        }
        const double away_m = FromLeg(square, ends[leg], ends[leg + 1]);
        if (away_m > reach_m + kPlaceM) continue;
        const bool surely = away_m < reach_m - kPlaceM;
        const Verdict cell =
            Judge(survey.cells[k], depth_m + clearance_m, c, unknown_is_free);
        perhaps_worst = std::max(perhaps_worst, cell.probability);
        if (surely) surely_worst = std::max(surely_worst, cell.probability);
        if (survey.cells[k].known) {
          const double over_m = survey.cells[k].depth.mean_m - depth_m;
          clearance.least = std::min(clearance.least, over_m);
          if (surely) clearance.most = std::min(clearance.most, over_m);
        }
        doubtful = doubtful || (surely && cell.doubtful);
        maybe_doubtful = maybe_doubtful || cell.maybe_doubtful;
        bad = bad || (surely && cell.bad);
        maybe_bad = maybe_bad || cell.maybe_bad;
        if (!cell.maybe_bad) continue;
        const auto touched_s = [&](double within_m) {
          return std::lerp(
              times_s[leg], times_s[leg + 1],
              TouchedAt(square, ends[leg], ends[leg + 1], within_m));
        };
        // Told from when its middle, seen along the leg, is as near as the
        // reach and half a diagonal (map/query/trajectory.h).
        first_s.least = std::min(
            first_s.least,
            std::lerp(
                times_s[leg], times_s[leg + 1],
                ShareBefore(square, ends[leg], ends[leg + 1],
                            reach_m + std::sqrt(0.5) * kCellM + kPlaceM)));
        if (surely && cell.bad) {
          first_s.most = std::min(first_s.most, touched_s(reach_m));
        }
      }
      if (maybe_bad && !first_leg.has_value()) {
        first_leg = static_cast<std::uint32_t>(leg);
      }
      const v1::LegVerdict& told = verdict.legs(static_cast<int>(leg));
      const std::string where = absl::StrCat(
          "way ", n, " leg ", leg, ", seed ", kSeed, ", ", survey.area->name,
          ", depth ", depth_m, " clearance ", clearance_m, " reach ", reach_m,
          " c ", c, ": ", told.ShortDebugString());
      ASSERT_GE(told.worst_probability(), surely_worst - kTolerance) << where;
      ASSERT_LE(told.worst_probability(), perhaps_worst + kTolerance) << where;
      if (clearance.most < kInf) {
        ASSERT_TRUE(told.has_least_clearance_m()) << where;
      }
      if (told.has_least_clearance_m()) {
        ASSERT_GE(told.least_clearance_m(), clearance.least - 1e-4) << where;
        ASSERT_LE(told.least_clearance_m(), clearance.most + 1e-4) << where;
      }
      if (!maybe_bad && !maybe_doubtful) {
        ASSERT_EQ(told.state(), v1::OBSTACLE_STATE_FREE) << where;
      }
      if (bad || doubtful) {
        ASSERT_NE(told.state(), v1::OBSTACLE_STATE_FREE) << where;
      }
      if (surely_worst > c + kTolerance) {
        ASSERT_EQ(told.state(), v1::OBSTACLE_STATE_OCCUPIED) << where;
      }
    }
    const std::string where = absl::StrCat(
        "way ", n, ", seed ", kSeed, ": expected ", first_s.least, " to ",
        first_s.most, ": ", verdict.first_conflict().ShortDebugString());
    ASSERT_TRUE(verdict.has_first_conflict() || first_s.most == kInf) << where;
    if (!verdict.has_first_conflict()) continue;
    ++conflicts;
    const double told_s =
        std::chrono::duration<double>(
            FromProto(verdict.first_conflict().time()) - base_)
            .count();
    ASSERT_GE(told_s, first_s.least - 1e-2) << where;
    ASSERT_LE(told_s, first_s.most + 1e-2) << where;
    ASSERT_GE(verdict.first_conflict().leg_index(), *first_leg) << where;
  }
  std::printf("%d ways of %d legs, %d with a conflict\n", kWays, legs,
              conflicts);
  EXPECT_GT(conflicts, kWays / 4);
  EXPECT_LT(conflicts, kWays);
}

TEST_F(SearchOracle, EveryContactOnAWayIsToldWithItsClosestApproach) {
  constexpr int kWays = 400;
  constexpr double kDepthM = 2;
  constexpr double kRadiusM = 5;
  int approaches = 0;
  double worst = 0;
  for (int n = 0; n < kWays; ++n) {
    const oracle::Track& track = tracks_[static_cast<std::size_t>(
        Pick(static_cast<int>(tracks_.size())))];
    const double begin_s = std::round(Uniform(100, 400));
    const double end_s = begin_s + 100;
    const auto place = PlaceOf(track, begin_s + 50);
    if (!place.has_value() || place->north_m > 1000) continue;
    const Point a = {place->north_m + Uniform(-150, 150),
                     place->east_m + Uniform(-150, 150)};
    const Point b = {place->north_m + Uniform(-150, 150),
                     place->east_m + Uniform(-150, 150)};
    v1::CheckTrajectoryRequest request;
    v1::Trajectory& trajectory = *request.mutable_trajectory();
    for (const auto& [point, time_s] :
         {std::pair(a, begin_s), std::pair(b, end_s)}) {
      v1::Waypoint* waypoint = trajectory.add_waypoints();
      *waypoint->mutable_position() =
          plane_.ToGeodetic(point.north_m, point.east_m);
      waypoint->set_depth_m(kDepthM);
      *waypoint->mutable_time() = ToProto(At(time_s));
    }
    trajectory.set_radius_m(kRadiusM);
    trajectory.set_confidence(0.95);
    trajectory.set_treat_unknown_as(v1::UNKNOWN_TREATMENT_FREE);
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto verdict,
                                client_->CheckTrajectory(request));
    for (std::size_t k = 0; k < tracks_.size(); ++k) {
      // Every tenth of a second, from its first fix on.
      double nearest_m = kInf;
      double std_m = 0;
      for (double time_s = begin_s; time_s <= end_s; time_s += 0.1) {
        const auto there = PlaceOf(tracks_[k], time_s);
        if (!there.has_value()) continue;
        const double away_m =
            Length(Between(a, b, (time_s - begin_s) / (end_s - begin_s)),
                   {there->north_m, there->east_m});
        if (away_m >= nearest_m) continue;
        nearest_m = away_m;
        std_m = std::sqrt(there->variance_m2);
      }
      const auto told =
          std::find_if(verdict.approaches().begin(), verdict.approaches().end(),
                       [&](const v1::ContactApproach& approach) {
                         return approach.contact_id() == absl::StrCat("c", k);
                       });
      const std::string where =
          absl::StrCat("way ", n, ", seed ", kSeed, ", contact ", k,
                       ": nearest ", nearest_m);
      if (told == verdict.approaches().end()) {
        ASSERT_GT(nearest_m, kRadiusM + tracks_[k].radius_m) << where;
        continue;
      }
      ++approaches;
      worst =
          std::max(worst, std::fabs(told->distance_m() - nearest_m) / std_m);
      ASSERT_NEAR(told->distance_m(), nearest_m, kApproachSigmas * std_m)
          << where << " " << told->ShortDebugString();
    }
  }
  std::printf("%d approaches: greatest difference %.1e std\n", approaches,
              worst);
  EXPECT_GT(approaches, kWays / 2);
}

}  // namespace
}  // namespace fathom::client
