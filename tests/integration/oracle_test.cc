// 100 000 random questions to a live server through our client, each answer
// held against a brute-force oracle (oracle.h): charts, land, unknown water,
// open and completed activities with every estimator, tracks of four classes;
// before the first report, between reports, and up to an hour ahead of now.

#include "tests/integration/oracle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "client/client.h"
#include "client/point_questions.h"
#include "client/proto_time.h"
#include "tests/integration/oracle_scene.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client {
namespace {

constexpr int kQuestions = 100'000;
// Questions that share clearance, radius and confidence: one batch.
constexpr int kBatch = 2'000;
// Of each batch so many are asked one by one as well.
constexpr int kAlone = 40;
// Where a hazard begins: float's rounding of 30 m, and of 4.5 std.
constexpr double kHazardToleranceM = 1e-4;

double Round64(double x) { return std::round(64 * x) / 64; }

class Oracle : public OracleScene {
 protected:
  // A place worth asking about, and what is under it.
  std::pair<oracle::Question, Ground> AnyQuestion() {
    for (;;) {
      oracle::Question question;
      // To the microsecond, as the wire has it.
      question.time_s = std::round(1e6 * (Pick(3) == 0 ? Uniform(-300, 4500)
                                                       : Uniform(0, 600))) /
                        1e6;
      const int kind = Pick(10);
      if (kind < 4) {  // In an area.
        const Area& area = areas_[static_cast<std::size_t>(
            Pick(static_cast<int>(areas_.size())))];
        if (area.completed) {
          // Elsewhere GroundAt is not sure.
          question.north_m = area.north_m + Uniform(-0.3, 0.3) +
                             (Pick(area.cells) + 0.5) * kCellM;
          question.east_m = area.east_m + Uniform(-0.3, 0.3) +
                            (Pick(area.cells) + 0.5) * kCellM;
        } else {
          question.north_m = area.north_m + Uniform(0, area.side_m());
          question.east_m = area.east_m + Uniform(0, area.side_m());
        }
      } else if (kind < 8) {  // Near a contact.
        const oracle::Track& track = tracks_[static_cast<std::size_t>(
            Pick(static_cast<int>(tracks_.size())))];
        const oracle::Fix& fix = track.fixes[static_cast<std::size_t>(
            Pick(static_cast<int>(track.fixes.size())))];
        question.time_s =
            std::round(1e6 * (fix.time_s + Uniform(-60, 200))) / 1e6;
        question.north_m =
            fix.north_m + Normal(track.radius_m + 50) +
            fix.velocity_north_m_s * (question.time_s - fix.time_s);
        question.east_m =
            fix.east_m + Normal(track.radius_m + 50) +
            fix.velocity_east_m_s * (question.time_s - fix.time_s);
      } else {  // Anywhere.
        question.north_m = Uniform(-7000, 2500);
        question.east_m = Uniform(-3000, 5000);
      }
      const std::optional<Ground> ground =
          GroundAt(question.north_m, question.east_m);
      if (!ground.has_value()) continue;
      const oracle::Depth& depth = ground->seabed.depth;
      const double std_m = std::sqrt(depth.variance_m2);
      question.depth_m =
          Pick(2) == 0 ? Uniform(0, 12) : depth.mean_m + Uniform(-3, 3) * std_m;
      question.depth_m = std::max(0.0, Round64(question.depth_m));
      return {question, *ground};
    }
  }
};

v1::ObstacleState StateOf(const oracle::Expected& expected, double confidence,
                          bool known) {
  const double probability = expected.probability;
  if (probability >= confidence) return v1::OBSTACLE_STATE_OCCUPIED;
  if (!known) return v1::OBSTACLE_STATE_UNKNOWN;
  // At a hazard nothing is free.
  return probability <= 1 - confidence &&
                 expected.into_hazard_m.value_or(-1) < 0
             ? v1::OBSTACLE_STATE_FREE
             : v1::OBSTACLE_STATE_UNCERTAIN;
}

TEST_F(Oracle, AHundredThousandRandomQuestionsAreAnsweredAlike) {
  std::map<v1::ObstacleState, int> states;
  int moving = 0;
  int past = 0;
  int future = 0;
  int borderline = 0;
  int at_hazard = 0;
  int stored = 0;
  double worst = 0;
  double worst_stored = 0;
  const double now_s =
      std::chrono::duration<double>(std::chrono::system_clock::now() - base_)
          .count();
  for (std::size_t batch = 0; batch < kQuestions / kBatch; ++batch) {
    v1::QueryObstaclesRequest common;
    common.set_confidence(std::array{0.6, 0.9, 0.95, 0.99}[batch % 4]);
    common.set_vertical_clearance_m(std::array{0.0, 1.0, 3.5}[batch % 3]);
    common.set_radius_m(std::array{0, 2, 5, 20, 1}[batch % 5]);
    common.set_with_reasons(true);
    std::vector<QuestionPoint> points;
    std::vector<oracle::Question> questions;
    std::vector<Ground> grounds;
    for (int i = 0; i < kBatch; ++i) {
      auto [question, ground] = AnyQuestion();
      question.clearance_m = common.vertical_clearance_m();
      question.radius_m = common.radius_m();
      const v1::GeodeticPoint place =
          plane_.ToGeodetic(question.north_m, question.east_m);
      points.push_back({.latitude_deg = place.latitude_deg(),
                        .longitude_deg = place.longitude_deg(),
                        .depth_m = question.depth_m,
                        .time = At(question.time_s)});
      questions.push_back(question);
      grounds.push_back(ground);
    }
    FATHOM_ASSERT_OK_AND_ASSIGN(const PointAnswers answers,
                                AskPoints(*client_, common, points, base_));
    for (std::size_t i = 0; i < points.size(); ++i) {
      const oracle::Seabed& seabed = grounds[i].seabed;
      const double tolerance =
          kTolerance + (grounds[i].stored ? kStoredTolerance : 0);
      const oracle::Expected expected =
          Answer(questions[i], seabed, tracks_, kAgeingM2PerDay / 86'400);
      const auto where = [&] {
        return absl::StrCat(
            "question ", i, " of batch ", batch, ", seed ", kSeed, ": north ",
            questions[i].north_m, " east ", questions[i].east_m, " depth ",
            questions[i].depth_m, " time ", questions[i].time_s,
            " contacts alone ", expected.moving, " mean ", seabed.depth.mean_m,
            " std ", std::sqrt(seabed.depth.variance_m2), " hazard ",
            seabed.hazard_m.value_or(NAN), "; told ", answers.mean_depth_m[i],
            " ", answers.std_m[i], " hazard ", answers.hazard_m[i]);
      };
      const double difference =
          std::fabs(answers.probability[i] - expected.probability);
      (grounds[i].stored ? worst_stored : worst) =
          std::max(grounds[i].stored ? worst_stored : worst, difference);
      if (std::fabs(expected.into_hazard_m.value_or(1)) < kHazardToleranceM) {
        ++borderline;
        continue;
      }
      ASSERT_LE(difference, tolerance) << where();
      const double c = common.confidence();
      if (std::fabs(expected.probability - c) <= tolerance ||
          std::fabs(expected.probability - (1 - c)) <= tolerance) {
        ++borderline;
      } else {
        ASSERT_EQ(answers.state[i], StateOf(expected, c, seabed.known))
            << where();
      }
      if (seabed.known && !seabed.land) {
        const double std_m = std::sqrt(seabed.depth.variance_m2);
        ASSERT_NEAR(answers.mean_depth_m[i], seabed.depth.mean_m, 1e-4)
            << where();
        ASSERT_NEAR(answers.std_m[i], std_m,
                    1e-4 + (grounds[i].stored ? kStoredStdShare * std_m : 0))
            << where();
      }
      at_hazard += expected.into_hazard_m.value_or(-1) >= 0 ? 1 : 0;
      stored += grounds[i].stored ? 1 : 0;
      ++states[answers.state[i]];
      moving += expected.moving > 1e-3 ? 1 : 0;
      past += questions[i].time_s < now_s ? 1 : 0;
      future += questions[i].time_s >= now_s ? 1 : 0;
      if (i >= kAlone) continue;
      v1::QueryObstacleRequest alone;
      alone.mutable_position()->set_latitude_deg(points[i].latitude_deg);
      alone.mutable_position()->set_longitude_deg(points[i].longitude_deg);
      alone.set_depth_m(points[i].depth_m);
      *alone.mutable_time() = ToProto(*points[i].time);
      alone.set_confidence(c);
      alone.set_vertical_clearance_m(common.vertical_clearance_m());
      alone.set_radius_m(common.radius_m());
      FATHOM_ASSERT_OK_AND_ASSIGN(const auto answer,
                                  client_->QueryObstacle(alone));
      ASSERT_NEAR(answer.answer().probability(), expected.probability,
                  tolerance)
          << where();
      ASSERT_EQ(answer.answer().state(), answers.state[i]) << where();
    }
  }
  std::printf(
      "%d questions (%d past, %d future, %d with contacts, %d of completed "
      "activities, %d at hazards): greatest difference %.1e, of completed "
      "activities %.1e; %d free, %d occupied, %d uncertain, %d unknown; %d "
      "within the tolerance of a bound\n",
      kQuestions, past, future, moving, stored, at_hazard, worst, worst_stored,
      states[v1::OBSTACLE_STATE_FREE], states[v1::OBSTACLE_STATE_OCCUPIED],
      states[v1::OBSTACLE_STATE_UNCERTAIN], states[v1::OBSTACLE_STATE_UNKNOWN],
      borderline);
  // The scene has some of everything.
  for (const auto& [state, count] : states) EXPECT_GT(count, 3'000) << state;
  EXPECT_EQ(states.size(), 4u);
  EXPECT_GT(moving, 10'000);
  EXPECT_GT(stored, 2'000);
  EXPECT_GT(at_hazard, 1'000);
  EXPECT_GT(future, 5'000);
  EXPECT_LT(borderline, 500);
}

}  // namespace
}  // namespace fathom::client
