// 100 000 random questions to a live server through our client, each answer
// held against a brute-force oracle (oracle.h): charts, land, unknown water,
// four activities with two estimators, tracks of four classes; before the
// first report, between reports, and up to an hour ahead of now.

#include "tests/integration/oracle.h"

#include <gtest/gtest.h>

#include <GeographicLib/LocalCartesian.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "client/client.h"
#include "client/point_questions.h"
#include "client/proto_time.h"
#include "tests/integration/live_server.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client {
namespace {

using oracle::Depth;
using oracle::Rule;

constexpr unsigned kSeed = 20'260'101;
constexpr int kQuestions = 100'000;
// Questions that share clearance, radius and confidence: one batch.
constexpr int kBatch = 2'000;
// Of each batch so many are asked one by one as well.
constexpr int kAlone = 40;
// The server keeps depths and stds as floats: 2e-6 m of 30 m, divided by the
// least std of 0.1 m, times the density's peak 0.4: 8e-6. Its normal law is
// good to 1e-15, its disc to 1e-6 (map/query). That each contact has a tangent
// plane of its own, the oracle one for all, shifts places by 1e-4 m of 7 m and
// more: 6e-6. (Met: 6e-6.)
constexpr double kTolerance = 2e-5;
constexpr double kAgeingM2PerDay = 5;
constexpr double kCellM = 10;

double Round64(double x) { return std::round(64 * x) / 64; }

// Metres north and east of the scene's corner, on one tangent plane.
class Plane {
 public:
  v1::GeodeticPoint ToGeodetic(double north_m, double east_m) const {
    // On the ellipsoid below the plane: its height there is undone.
    double latitude_deg;
    double longitude_deg;
    double height_m;
    double up_m = 0;
    for (int i = 0; i < 3; ++i) {
      frame_.Reverse(east_m, north_m, up_m, latitude_deg, longitude_deg,
                     height_m);
      up_m -= height_m;
    }
    v1::GeodeticPoint point;
    point.set_latitude_deg(latitude_deg);
    point.set_longitude_deg(longitude_deg);
    return point;
  }
  // What is north at a place, seen on the plane, radians clockwise.
  double NorthAt(const v1::GeodeticPoint& p) const {
    double x0, y0, x1, y1, z;
    frame_.Forward(p.latitude_deg(), p.longitude_deg(), 0, x0, y0, z);
    frame_.Forward(p.latitude_deg() + 1e-4, p.longitude_deg(), 0, x1, y1, z);
    return std::atan2(x1 - x0, y1 - y0);
  }

 private:
  const GeographicLib::LocalCartesian frame_{41.5, -71.4, 0};
};

// An activity and what was sounded in it.
struct Area {
  const char* name;
  double north_m;
  double east_m;
  int cells;
  Rule rule;
  // Below what was sounded.
  std::optional<Depth> prior;
  std::map<std::pair<int, int>, Depth> sounded = {};

  double side_m() const { return cells * kCellM; }
};

// The chart: bands from north to south, by the metres north of their borders.
// All stds are powers of two, which the global map's codes hold exactly.
constexpr double kChartStep = 0.001;  // Degrees: 111 m north, 83 m east.
constexpr double kChartNorthM = 2500;
constexpr double kChartWestM = -500;
constexpr int kChartRows = 40;
constexpr int kChartColumns = 50;
constexpr int kLandRows = 8;      // 2500 m to 1612 m.
constexpr int kShallowFrom = 30;  // -832 m to -1942 m.
constexpr Depth kDeep{.mean_m = 30, .variance_m2 = 16};
constexpr Depth kShallow{.mean_m = 12, .variance_m2 = 1};
// Twice the length of a chart's cell: far from where the bands meet.
constexpr double kMarginM = 200;

class Oracle : public ClientLive {
 protected:
  void SetUp() override {
    ClientLive::SetUp();
    server_ = std::make_unique<LiveServer>(
        folder_, /*create=*/true, 0,
        std::vector<std::string>{"--ageing-m2-per-day",
                                 absl::StrCat(kAgeingM2PerDay)});
    ASSERT_NE(server_->port(), 0);
    FATHOM_ASSERT_OK_AND_ASSIGN(client_,
                                Client::Connect(server_->address(), {}));
    // A whole second a quarter of an hour ago.
    base_ = std::chrono::floor<std::chrono::seconds>(
                std::chrono::system_clock::now()) -
            std::chrono::minutes(15);
    ImportChart();
    for (Area& area : areas_) Survey(area);
    ReportTracks();
  }

  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  double Normal(double std) {
    return std::normal_distribution<double>(0, std)(random_);
  }
  int Pick(int count) {
    return std::uniform_int_distribution<int>(0, count - 1)(random_);
  }
  Time At(double time_s) const {
    return base_ + std::chrono::microseconds(std::llround(1e6 * time_s));
  }

  void ImportChart() {
    v1::PriorHeader header;
    header.set_name("bands");
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto writer,
                                client_->ImportPrior(header));
    v1::DepthTile tile;
    *tile.mutable_north_west() = plane_.ToGeodetic(kChartNorthM, kChartWestM);
    tile.set_latitude_step_deg(kChartStep);
    tile.set_longitude_step_deg(kChartStep);
    tile.set_rows(kChartRows);
    tile.set_columns(kChartColumns);
    for (int row = 0; row < kChartRows; ++row) {
      const bool land = row < kLandRows;
      const Depth& depth = row >= kShallowFrom ? kShallow : kDeep;
      for (int column = 0; column < kChartColumns; ++column) {
        tile.add_depth_m(static_cast<float>(land ? NAN : depth.mean_m));
        tile.add_std_m(static_cast<float>(std::sqrt(depth.variance_m2)));
        tile.mutable_land()->push_back(land ? '\1' : '\0');
      }
    }
    FATHOM_ASSERT_OK(writer->Write(tile));
    FATHOM_ASSERT_OK(writer->Finish().status());
  }

  // One to four soundings in half of an area's cells.
  void Survey(Area& area) {
    v1::StartActivityRequest request;
    request.set_activity_id(area.name);
    *request.mutable_time() = ToProto(base_);
    auto* parameters = request.mutable_parameters();
    *parameters->mutable_south_west() =
        plane_.ToGeodetic(area.north_m, area.east_m);
    parameters->set_north_extent_m(area.side_m());
    parameters->set_east_extent_m(area.side_m());
    parameters->set_cell_size_m(kCellM);
    parameters->set_estimator(area.rule == Rule::kKalman
                                  ? v1::ESTIMATOR_KALMAN
                                  : v1::ESTIMATOR_NERVEGNA);
    const bool own_prior = area.prior.has_value() && area.north_m < -2500;
    if (own_prior) {
      parameters->mutable_default_prior()->set_depth_m(area.prior->mean_m);
      parameters->mutable_default_prior()->set_std_m(
          std::sqrt(area.prior->variance_m2));
    }
    FATHOM_ASSERT_OK(client_->StartActivity(request).status());
    FATHOM_ASSERT_OK_AND_ASSIGN(
        const auto stream, client_->OpenPingStream({.source_id = area.name}));
    constexpr int kPings = 40;
    constexpr int kBeams = 100;
    for (int n = 0; n < kPings; ++n) {
      v1::Ping ping;
      ping.set_activity_id(area.name);
      const double time_s = 10 * n;
      *ping.mutable_time() = ToProto(At(time_s));
      const double middle_m = area.side_m() / 2;
      *ping.mutable_pose()->mutable_position() =
          plane_.ToGeodetic(area.north_m + middle_m, area.east_m + middle_m);
      for (int beam = 0; beam < kBeams; ++beam) {
        // Half of the cells only: the others stay as the prior has them.
        const int i = 2 * Pick(area.cells / 2);
        const int j = Pick(area.cells);
        const double north_m = (i + 0.5) * kCellM - middle_m;
        const double east_m = (j + 0.5) * kCellM - middle_m;
        const double depth_m = Round64(Uniform(15, 35));
        const double std_m = Round64(Uniform(0.25, 3));
        ping.add_range_m(static_cast<float>(std::hypot(north_m, east_m)));
        ping.add_bearing_deg(static_cast<float>(std::atan2(east_m, north_m) *
                                                180 / std::numbers::pi));
        ping.add_depth_m(static_cast<float>(depth_m));
        ping.add_std_m(static_cast<float>(std_m));
        const auto found = area.sounded.find({i, j});
        area.sounded[{i, j}] = Fuse(found != area.sounded.end()
                                        ? std::optional<Depth>(found->second)
                                        : area.prior,
                                    depth_m, std_m, time_s, area.rule);
      }
      FATHOM_ASSERT_OK(stream->Send(ping).status());
    }
    FATHOM_ASSERT_OK(stream->Finish());
    ASSERT_EQ(stream->progress().measurements_accepted,
              std::uint64_t{kPings * kBeams});
  }

  void ReportTracks() {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto status, client_->GetMissionStatus());
    constexpr std::array kClasses = {
        v1::CONTACT_CLASS_SMALL_CRAFT, v1::CONTACT_CLASS_VESSEL,
        v1::CONTACT_CLASS_DEEP_DRAUGHT, v1::CONTACT_CLASS_DRIFTING};
    constexpr std::size_t kTracks = 24;
    v1::ReportContactsRequest request;
    std::uint64_t sequence = 0;
    for (std::size_t n = 0; n < kTracks; ++n) {
      const v1::ContactClass contact_class = kClasses[n % kClasses.size()];
      oracle::Track track;
      for (const auto& of_class : status.contacts().classes()) {
        if (of_class.contact_class() != contact_class) continue;
        track.radius_m = of_class.radius_m();
        track.keel_depth_m = of_class.keel_depth_m();
        track.process_noise_m2_s3 = of_class.process_noise_m2_s3();
      }
      ASSERT_GT(track.radius_m, 0);
      // A straight way, fixes with errors as stated.
      const double north_m =
          n % 3 == 0 ? Uniform(-5500, -4500) : Uniform(-1500, 2200);
      const double east_m = Uniform(-200, 3200);
      const double speed_m_s = Uniform(0, 6);
      const double course = Uniform(0, 2 * std::numbers::pi);
      const double vn = speed_m_s * std::cos(course);
      const double ve = speed_m_s * std::sin(course);
      const double position_std_m = Uniform(10, 40);
      const double velocity_std_m_s = Uniform(0.1, 0.5);
      const int fixes = 1 + Pick(10);
      for (double time_s = Pick(100); std::ssize(track.fixes) < fixes;
           time_s += 5 + Pick(50)) {
        v1::ContactReport& report = *request.add_reports();
        report.set_source_id("c4i");
        report.set_epoch(1);
        report.set_sequence(++sequence);
        report.set_contact_id(absl::StrCat("c", n));
        report.set_contact_class(contact_class);
        *report.mutable_time() = ToProto(At(time_s));
        oracle::Fix fix{.time_s = time_s,
                        .north_m = north_m + vn * time_s,
                        .east_m = east_m + ve * time_s,
                        .position_std_m = position_std_m,
                        .velocity_std_m_s = velocity_std_m_s};
        fix.north_m += Normal(position_std_m / 2);
        fix.east_m += Normal(position_std_m / 2);
        // The report speaks of north where the contact is.
        const double told_north_m_s = vn + Normal(velocity_std_m_s / 2);
        const double told_east_m_s = ve + Normal(velocity_std_m_s / 2);
        *report.mutable_fix()->mutable_position() =
            plane_.ToGeodetic(fix.north_m, fix.east_m);
        const double turn = plane_.NorthAt(report.fix().position());
        fix.velocity_north_m_s =
            told_north_m_s * std::cos(turn) - told_east_m_s * std::sin(turn);
        fix.velocity_east_m_s =
            told_north_m_s * std::sin(turn) + told_east_m_s * std::cos(turn);
        report.mutable_fix()->set_velocity_north_m_s(told_north_m_s);
        report.mutable_fix()->set_velocity_east_m_s(told_east_m_s);
        report.mutable_fix()->set_position_std_m(position_std_m);
        report.mutable_fix()->set_velocity_std_m_s(velocity_std_m_s);
        track.fixes.push_back(fix);
      }
      tracks_.push_back(std::move(track));
    }
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto response,
                                client_->ReportContacts(request));
    ASSERT_EQ(response.reports_applied(), sequence)
        << response.ShortDebugString();
  }

  // What is under a place; absent too near to a border to be sure which side
  // of it the server's cells put it.
  std::optional<oracle::Seabed> SeabedAt(double north_m, double east_m) const {
    for (const Area& area : areas_) {
      const double i = (north_m - area.north_m) / kCellM;
      const double j = (east_m - area.east_m) / kCellM;
      if (i < -1 || j < -1 || i > area.cells + 1 || j > area.cells + 1) {
        continue;
      }
      if (i < 0 || j < 0 || i > area.cells || j > area.cells) return {};
      const double in_i = i - std::floor(i);
      const double in_j = j - std::floor(j);
      if (std::min(in_i, in_j) < 0.1 || std::max(in_i, in_j) > 0.9) return {};
      const auto found = area.sounded.find(
          {static_cast<int>(std::floor(i)), static_cast<int>(std::floor(j))});
      if (found != area.sounded.end()) {
        return oracle::Seabed{.known = true, .depth = found->second};
      }
      if (!area.prior.has_value()) return oracle::Seabed{};
      return oracle::Seabed{.known = true, .depth = *area.prior};
    }
    const auto between = [&](double high_m, double low_m) {
      return north_m < high_m - kMarginM && north_m > low_m + kMarginM;
    };
    const bool beside = east_m < kChartWestM - kMarginM || east_m > 4000;
    const bool across = east_m > kChartWestM + kMarginM && east_m < 3400;
    if (beside || north_m < -1942 - kMarginM) return oracle::Seabed{};
    if (!across) return {};
    if (between(kChartNorthM, 1612)) {
      return oracle::Seabed{.known = true, .land = true, .depth = {}};
    }
    if (between(1612, -832)) {
      return oracle::Seabed{.known = true, .depth = kDeep};
    }
    if (between(-832, -1942)) {
      return oracle::Seabed{.known = true, .depth = kShallow};
    }
    return {};
  }

  // A place worth asking about, and what is under it.
  std::pair<oracle::Question, oracle::Seabed> AnyQuestion() {
    for (;;) {
      oracle::Question question;
      // To the microsecond, as the wire has it.
      question.time_s = std::round(1e6 * (Pick(3) == 0 ? Uniform(-300, 4500)
                                                       : Uniform(0, 600))) /
                        1e6;
      const int kind = Pick(10);
      if (kind < 4) {  // In an area.
        const Area& area = areas_[static_cast<std::size_t>(Pick(4))];
        question.north_m = area.north_m + Uniform(0, area.side_m());
        question.east_m = area.east_m + Uniform(0, area.side_m());
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
      const std::optional<oracle::Seabed> seabed =
          SeabedAt(question.north_m, question.east_m);
      if (!seabed.has_value()) continue;
      const double std_m = std::sqrt(seabed->depth.variance_m2);
      question.depth_m = Pick(2) == 0
                             ? Uniform(0, 12)
                             : seabed->depth.mean_m + Uniform(-3, 3) * std_m;
      question.depth_m = std::max(0.0, Round64(question.depth_m));
      return {question, *seabed};
    }
  }

  std::mt19937_64 random_{kSeed};
  Plane plane_;
  std::unique_ptr<LiveServer> server_;
  std::unique_ptr<Client> client_;
  Time base_;
  std::vector<Area> areas_ = {
      {"kalman", 0, 0, 50, Rule::kKalman, kDeep},
      {"nervegna", 0, 800, 50, Rule::kNervegna, kDeep},
      {"guessed", -5000, 0, 40, Rule::kKalman,
       Depth{.mean_m = 20, .variance_m2 = 4}},
      {"bare", -5000, 800, 40, Rule::kKalman, std::nullopt}};
  std::vector<oracle::Track> tracks_;
};

v1::ObstacleState StateOf(double probability, double confidence, bool known) {
  if (probability >= confidence) return v1::OBSTACLE_STATE_OCCUPIED;
  if (!known) return v1::OBSTACLE_STATE_UNKNOWN;
  return probability <= 1 - confidence ? v1::OBSTACLE_STATE_FREE
                                       : v1::OBSTACLE_STATE_UNCERTAIN;
}

TEST_F(Oracle, AHundredThousandRandomQuestionsAreAnsweredAlike) {
  std::map<v1::ObstacleState, int> states;
  int moving = 0;
  int past = 0;
  int future = 0;
  int borderline = 0;
  double worst = 0;
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
    std::vector<oracle::Seabed> seabeds;
    for (int i = 0; i < kBatch; ++i) {
      auto [question, seabed] = AnyQuestion();
      question.clearance_m = common.vertical_clearance_m();
      question.radius_m = common.radius_m();
      const v1::GeodeticPoint place =
          plane_.ToGeodetic(question.north_m, question.east_m);
      points.push_back({.latitude_deg = place.latitude_deg(),
                        .longitude_deg = place.longitude_deg(),
                        .depth_m = question.depth_m,
                        .time = At(question.time_s)});
      questions.push_back(question);
      seabeds.push_back(seabed);
    }
    FATHOM_ASSERT_OK_AND_ASSIGN(const PointAnswers answers,
                                AskPoints(*client_, common, points, base_));
    for (std::size_t i = 0; i < points.size(); ++i) {
      const oracle::Expected expected =
          Answer(questions[i], seabeds[i], tracks_, kAgeingM2PerDay / 86'400);
      const auto where = [&] {
        return absl::StrCat("question ", i, " of batch ", batch, ", seed ",
                            kSeed, ": north ", questions[i].north_m, " east ",
                            questions[i].east_m, " depth ",
                            questions[i].depth_m, " time ", questions[i].time_s,
                            " contacts alone ", expected.moving);
      };
      const double difference =
          std::fabs(answers.probability[i] - expected.probability);
      worst = std::max(worst, difference);
      ASSERT_LE(difference, kTolerance) << where();
      const double c = common.confidence();
      if (std::fabs(expected.probability - c) <= kTolerance ||
          std::fabs(expected.probability - (1 - c)) <= kTolerance) {
        ++borderline;
      } else {
        ASSERT_EQ(answers.state[i],
                  StateOf(expected.probability, c, seabeds[i].known))
            << where();
      }
      if (seabeds[i].known && !seabeds[i].land) {
        ASSERT_NEAR(answers.mean_depth_m[i], seabeds[i].depth.mean_m, 1e-4)
            << where();
        ASSERT_NEAR(answers.std_m[i], std::sqrt(seabeds[i].depth.variance_m2),
                    1e-4)
            << where();
      }
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
                  kTolerance)
          << where();
      ASSERT_EQ(answer.answer().state(), answers.state[i]) << where();
    }
  }
  std::printf(
      "%d questions (%d past, %d future, %d with contacts): greatest "
      "difference %.1e; %d free, %d occupied, %d uncertain, %d unknown; %d "
      "within the tolerance of a bound\n",
      kQuestions, past, future, moving, worst, states[v1::OBSTACLE_STATE_FREE],
      states[v1::OBSTACLE_STATE_OCCUPIED], states[v1::OBSTACLE_STATE_UNCERTAIN],
      states[v1::OBSTACLE_STATE_UNKNOWN], borderline);
  // The scene has some of everything.
  for (const auto& [state, count] : states) EXPECT_GT(count, 3'000) << state;
  EXPECT_EQ(states.size(), 4u);
  EXPECT_GT(moving, 10'000);
  EXPECT_GT(future, 5'000);
  EXPECT_LT(borderline, 500);
}

}  // namespace
}  // namespace fathom::client
