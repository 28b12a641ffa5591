#include "tests/integration/oracle_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <numbers>
#include <string>

#include "absl/strings/str_cat.h"
#include "client/proto_time.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client {
namespace {

using oracle::Depth;
using oracle::Rule;

double Round64(double x) { return std::round(64 * x) / 64; }

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

}  // namespace

v1::GeodeticPoint Plane::ToGeodetic(double north_m, double east_m) const {
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

double Plane::NorthAt(const v1::GeodeticPoint& p) const {
  double x0, y0, x1, y1, z;
  frame_.Forward(p.latitude_deg(), p.longitude_deg(), 0, x0, y0, z);
  frame_.Forward(p.latitude_deg() + 1e-4, p.longitude_deg(), 0, x1, y1, z);
  return std::atan2(x1 - x0, y1 - y0);
}

double Area::side_m() const { return cells * 10.0; }

oracle::Seabed Area::Cell(int row, int column) const {
  if (const auto found = fused.find({row, column}); found != fused.end()) {
    return {.known = true, .depth = found->second};
  }
  if (soundings.contains({row, column})) {
    oracle::Around around = {};
    for (int k = 0; k < 9; ++k) {
      const auto found = soundings.find({row + k / 3 - 1, column + k % 3 - 1});
      if (found != soundings.end()) {
        around[static_cast<std::size_t>(k)] = &found->second;
      }
    }
    return ReadAdaptive(around, prior, 10.0);
  }
  if (!prior.has_value()) return {};
  return {.known = true, .depth = *prior};
}

void OracleScene::SetUp() {
  ClientLive::SetUp();
  server_ = std::make_unique<LiveServer>(
      folder_, /*create=*/true, 0,
      std::vector<std::string>{"--tolerance-m", "0.001", "--ageing-m2-per-day",
                               absl::StrCat(kAgeingM2PerDay)});
  ASSERT_NE(server_->port(), 0);
  FATHOM_ASSERT_OK_AND_ASSIGN(client_, Client::Connect(server_->address(), {}));
  // A whole second a quarter of an hour ago.
  base_ = std::chrono::floor<std::chrono::seconds>(
              std::chrono::system_clock::now()) -
          std::chrono::minutes(15);
  areas_ = {
      {"kalman", 0, 0, 50, Rule::kKalman, kDeep},
      {"nervegna", 0, 800, 50, Rule::kNervegna, kDeep},
      {"adaptive", 0, 1600, 50, Rule::kAdaptive, kDeep},
      {"charted", 0, 2400, 40, Rule::kAdaptive, kDeep, /*completed=*/true},
      {"guessed", -5000, 0, 40, Rule::kKalman,
       Depth{.mean_m = 20, .variance_m2 = 4}},
      {"bare", -5000, 800, 40, Rule::kKalman, std::nullopt},
      {"new", -5000, 1600, 40, Rule::kAdaptive, std::nullopt},
      {"done", -5000, 2400, 40, Rule::kAdaptive, std::nullopt,
       /*completed=*/true}};
  ImportChart();
  for (Area& area : areas_) Survey(area);
  ReportTracks();
}

void OracleScene::ImportChart() {
  v1::PriorHeader header;
  header.set_name("bands");
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto writer, client_->ImportPrior(header));
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

oracle::Sounding OracleScene::Sound(const Area& area, int row, int column,
                                    double time_s) {
  if (area.rule != Rule::kAdaptive) {
    return {.depth_m = Round64(Uniform(15, 35)),
            .std_m = Round64(Uniform(0.25, 3)),
            .time_s = time_s};
  }
  const double std_m = Round64(Uniform(0.1, 0.9));
  const double floor_m = 25 + 0.04 * row + 2 * std::sin(0.2 * column);
  const double rock_m = Pick(50) == 0 ? 4 : 0;
  return {.depth_m = Round64(floor_m - rock_m + Normal(std_m)),
          .std_m = std_m,
          .time_s = time_s};
}

void OracleScene::Survey(Area& area) {
  v1::StartActivityRequest request;
  request.set_activity_id(area.name);
  *request.mutable_time() = ToProto(base_);
  auto* parameters = request.mutable_parameters();
  *parameters->mutable_south_west() =
      plane_.ToGeodetic(area.north_m, area.east_m);
  parameters->set_north_extent_m(area.side_m());
  parameters->set_east_extent_m(area.side_m());
  parameters->set_cell_size_m(kCellM);
  // The default is the adaptive one.
  if (area.rule != Rule::kAdaptive) {
    parameters->set_estimator(area.rule == Rule::kKalman
                                  ? v1::ESTIMATOR_KALMAN
                                  : v1::ESTIMATOR_NERVEGNA);
  }
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
      // Half of the cells only, four rows of eight: the others stay as the
      // prior has them.
      const int row = 8 * Pick(area.cells / 8) + Pick(4);
      const int column = Pick(area.cells);
      const double north_m = (row + 0.5) * kCellM - middle_m;
      const double east_m = (column + 0.5) * kCellM - middle_m;
      const oracle::Sounding sounding = Sound(area, row, column, time_s);
      ping.add_range_m(static_cast<float>(std::hypot(north_m, east_m)));
      ping.add_bearing_deg(static_cast<float>(std::atan2(east_m, north_m) *
                                              180 / std::numbers::pi));
      ping.add_depth_m(static_cast<float>(sounding.depth_m));
      ping.add_std_m(static_cast<float>(sounding.std_m));
      if (area.rule == Rule::kAdaptive) {
        area.soundings[{row, column}].push_back(sounding);
        continue;
      }
      const auto found = area.fused.find({row, column});
      area.fused[{row, column}] =
          Fuse(found != area.fused.end() ? std::optional<Depth>(found->second)
                                         : area.prior,
               sounding.depth_m, sounding.std_m, time_s, area.rule);
    }
    FATHOM_ASSERT_OK(stream->Send(ping).status());
  }
  FATHOM_ASSERT_OK(stream->Finish());
  ASSERT_EQ(stream->progress().measurements_accepted,
            std::uint64_t{kPings * kBeams});
  if (area.completed) {
    v1::CompleteActivityRequest complete;
    complete.set_activity_id(area.name);
    FATHOM_ASSERT_OK(client_->CompleteActivity(complete).status());
  }
}
void OracleScene::ReportTracks() {
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

std::optional<Ground> OracleScene::GroundAt(double north_m,
                                            double east_m) const {
  for (const Area& area : areas_) {
    const double i = (north_m - area.north_m) / kCellM;
    const double j = (east_m - area.east_m) / kCellM;
    if (i < -1 || j < -1 || i > area.cells + 1 || j > area.cells + 1) {
      continue;
    }
    if (i < 0 || j < 0 || i > area.cells || j > area.cells) return {};
    const double in_i = i - std::floor(i);
    const double in_j = j - std::floor(j);
    // A cell of the global map, of 9.04 m, belongs to the cell in which its
    // middle lies: that of a place in the very middle does.
    const double rim = area.completed ? 0.46 : 0.1;
    if (std::min(in_i, in_j) < rim || std::max(in_i, in_j) > 1 - rim) {
      return {};
    }
    const int row = static_cast<int>(std::floor(i));
    const int column = static_cast<int>(std::floor(j));
    return Ground{
        .seabed = area.Cell(row, column),
        .stored = area.completed && area.soundings.contains({row, column})};
  }
  const auto between = [&](double high_m, double low_m) {
    return north_m < high_m - kMarginM && north_m > low_m + kMarginM;
  };
  const bool beside = east_m < kChartWestM - kMarginM || east_m > 4000;
  const bool across = east_m > kChartWestM + kMarginM && east_m < 3400;
  if (beside || north_m < -1942 - kMarginM) return Ground{};
  if (!across) return {};
  if (between(kChartNorthM, 1612)) {
    return Ground{.seabed = {.known = true, .land = true, .depth = {}}};
  }
  if (between(1612, -832)) {
    return Ground{.seabed = {.known = true, .depth = kDeep}};
  }
  if (between(-832, -1942)) {
    return Ground{.seabed = {.known = true, .depth = kShallow}};
  }
  return {};
}

}  // namespace fathom::client
