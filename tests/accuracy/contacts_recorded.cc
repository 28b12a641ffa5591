// Recorded tracks: RecordedContactFigures.

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <fstream>
#include <map>
#include <numbers>
#include <optional>
#include <set>

#include "map/contacts/contact_map.h"
#include "map/geodesy/ned_frame.h"
#include "tests/accuracy/contacts.h"
#include "tests/testing/shared_numbers.h"

namespace fathom::accuracy {
namespace {

// Of the radar, measured over all scenarios (data/README.md).
constexpr double kRangeStdM = 4.9;
constexpr double kBearingStdDeg = 5.2;
// A detection further than this from every truth is of something else.
constexpr double kOfTargetM = 40;
constexpr int kRadar = 2;

Time TimeOf(double unix_s) {
  return TimeFromUnixMicros(static_cast<std::int64_t>(unix_s * 1e6));
}

struct Place {
  double north_m = 0;
  double east_m = 0;
};

double Apart(const Place& a, const Place& b) {
  return std::hypot(a.north_m - b.north_m, a.east_m - b.east_m);
}

// Norths, then easts; of a single detection two numbers.
std::vector<Place> PlacesOf(const nlohmann::json& measured) {
  std::vector<Place> places;
  if (measured.size() != 2) return places;
  if (measured[0].is_number()) return {{measured[0], measured[1]}};
  for (std::size_t i = 0; i < measured[0].size(); ++i) {
    places.push_back({measured[0][i], measured[1][i]});
  }
  return places;
}

// What the radar is off on the whole, in one scenario.
struct Bias {
  double range_m = 0;
  double bearing_deg = 0;
};

struct TargetTrack {
  double square_m2 = 0;
  double measured_m2 = 0;
  // Sums over the reports.
  double range_off_m = 0;
  double bearing_off_deg = 0;
  int reports = 0;
  int gated = 0;
  int begun = 0;
};

// How the radar's tracks are made.
struct RadarCase {
  map::FilterKind filter = map::FilterKind::kFourState;
  // Less what the radar is off in each scenario on the whole.
  bool calibrated = false;
  // Times the class's process noise.
  double process_noise = 1;
};

// The tracks of one scenario by target; `bias` is taken off the detections.
std::map<int, TargetTrack> FollowScenario(const nlohmann::json& detections,
                                          const nlohmann::json& truths,
                                          const RadarCase& made,
                                          const Bias& bias) {
  const map::NedFrame plane(
      {.latitude_deg = 63.4389029083, .longitude_deg = 10.39908278});
  map::ContactMapOptions options{.filter = made.filter};
  options.classes[static_cast<std::size_t>(map::ContactClass::kSmallCraft)]
      .process_noise_m2_s3 *= made.process_noise;
  map::ContactMap map(options);
  std::map<int, TargetTrack> tracks;
  for (std::size_t i = 0; i < detections.size(); ++i) {
    const nlohmann::json& scan = detections[i];
    if (scan["sensorID"] != kRadar) continue;
    const Place own{scan["ownshipPosition"][0], scan["ownshipPosition"][1]};
    const std::vector<Place> seen = PlacesOf(scan["measurement"]);
    for (const nlohmann::json& truth : truths[i]) {
      if (!truth["position"][0].is_number()) continue;
      const int target = truth["targetID"];
      const Place there{truth["position"][0], truth["position"][1]};
      const Place from{there.north_m - own.north_m, there.east_m - own.east_m};
      const auto nearest = std::min_element(
          seen.begin(), seen.end(), [&](const Place& a, const Place& b) {
            return Apart(a, from) < Apart(b, from);
          });
      if (nearest == seen.end() || Apart(*nearest, from) > kOfTargetM) continue;
      const double range_m = std::hypot(nearest->north_m, nearest->east_m);
      const double bearing_deg = std::atan2(nearest->east_m, nearest->north_m) *
                                 180 / std::numbers::pi;
      map::ContactReport report;
      report.key = {{"radar"}, {std::to_string(target)}};
      report.contact_class = map::ContactClass::kSmallCraft;
      report.time = TimeOf(scan["time"]);
      report.observation = map::RangeBearing{
          .pose = {.position = plane.ToGeodetic(own.north_m, own.east_m)},
          .range_m = range_m - bias.range_m,
          .bearing_deg = bearing_deg - bias.bearing_deg,
          .range_std_m = kRangeStdM,
          .bearing_std_deg = kBearingStdDeg};
      const map::ContactOutcome outcome = map.Apply(report);
      TargetTrack& track = tracks[target];
      track.reports += 1;
      track.range_off_m += range_m - std::hypot(from.north_m, from.east_m);
      track.bearing_off_deg +=
          std::remainder(bearing_deg - std::atan2(from.east_m, from.north_m) *
                                           180 / std::numbers::pi,
                         360.0);
      track.gated += outcome.applied ? 0 : 1;
      track.begun += outcome.estimates.size() == 2 ? 1 : 0;
      const map::NedPoint place =
          plane.ToNed(map.View().At(report.key, report.time)->Position());
      track.square_m2 +=
          std::pow(Apart({place.north_m, place.east_m}, there), 2);
      track.measured_m2 += std::pow(Apart(*nearest, from), 2);
    }
  }
  return tracks;
}

std::optional<nlohmann::json> ReadJson(const std::string& path) {
  std::ifstream file(path);
  if (!file) return std::nullopt;
  nlohmann::json json = nlohmann::json::parse(file, nullptr, false);
  if (json.is_discarded()) return std::nullopt;
  return json;
}

nlohmann::json RadarRow(const std::string& folder, const RadarCase& made) {
  std::vector<double> rmse_m;
  std::vector<double> measured_m;
  int reports = 0;
  int gated = 0;
  int begun = 0;
  for (const int scenario : {2, 3, 4, 5, 13}) {
    const std::string path = folder + "/scenario" + std::to_string(scenario);
    const auto detections = ReadJson(path + "_detections.json");
    const auto truths = ReadJson(path + "_groundTruth.json");
    if (!detections.has_value() || !truths.has_value()) continue;
    auto tracks = FollowScenario(*detections, *truths, made, {});
    if (made.calibrated) {
      Bias bias;
      double count = 0;
      for (const auto& [target, track] : tracks) {
        bias.range_m += track.range_off_m;
        bias.bearing_deg += track.bearing_off_deg;
        count += track.reports;
      }
      bias.range_m /= count;
      bias.bearing_deg /= count;
      tracks = FollowScenario(*detections, *truths, made, bias);
    }
    for (const auto& [target, track] : tracks) {
      rmse_m.push_back(std::sqrt(track.square_m2 / track.reports));
      measured_m.push_back(std::sqrt(track.measured_m2 / track.reports));
      reports += track.reports;
      gated += track.gated;
      begun += track.begun;
    }
  }
  if (rmse_m.empty()) return nullptr;
  const auto median = [](std::vector<double>& values) {
    std::sort(values.begin(), values.end());
    const std::size_t half = values.size() / 2;
    return values.size() % 2 == 1 ? values[half]
                                  : 0.5 * (values[half - 1] + values[half]);
  };
  std::string scene = "radar_" + std::string(map::FilterName(made.filter));
  if (made.calibrated) scene += "_calibrated";
  if (made.process_noise < 1) scene += "_calm";
  if (made.process_noise > 1) scene += "_lively";
  return {{"scene", scene},
          {"tracks", rmse_m.size()},
          {"reports", reports},
          {"gated", gated},
          {"begun_anew", begun},
          {"median_rmse_m", median(rmse_m)},
          {"worst_rmse_m", rmse_m.back()},
          {"median_measured_m", median(measured_m)},
          {"plain_filter_m", 8.0}};
}

// "2016-01-12 13:02:11.218,235070762,50.77,-1.09,157.8,5.9".
std::optional<map::ContactReport> ParseAis(const std::string& line) {
  int h = 0;
  int m = 0;
  double s = 0;
  char mmsi[32];
  double latitude_deg = 0;
  double longitude_deg = 0;
  double course_deg = 0;
  double knots = 0;
  if (std::sscanf(line.c_str(), "2016-01-12 %d:%d:%lf,%31[^,],%lf,%lf,%lf,%lf",
                  &h, &m, &s, mmsi, &latitude_deg, &longitude_deg, &course_deg,
                  &knots) != 8) {
    return std::nullopt;
  }
  constexpr double kKnotMPerS = 1852.0 / 3600;
  const double course = course_deg * std::numbers::pi / 180;
  map::ContactReport report;
  report.key = {{"ais"}, {mmsi}};
  report.contact_class = map::ContactClass::kUnknown;
  report.time = TimeOf(1'452'556'800.0 + 3600 * h + 60 * m + s);
  report.observation = map::ContactFix{
      .position = {.latitude_deg = latitude_deg,
                   .longitude_deg = longitude_deg},
      .velocity_north_m_s = knots * kKnotMPerS * std::cos(course),
      .velocity_east_m_s = knots * kKnotMPerS * std::sin(course)};
  return report;
}

nlohmann::json AisRow(const std::string& path) {
  const std::vector<std::string> lines = testing::LinesOf(path);
  if (lines.empty()) return nullptr;
  map::ContactMap map(map::ContactMapOptions{});
  const map::ContactClassTable& classes = map.options().classes;
  std::map<map::ContactKey, std::deque<map::ContactPoint>> past;
  int reports = 0;
  int refused = 0;
  int gated = 0;
  int outliers = 0;
  constexpr int kAheadS[2] = {60, 300};
  constexpr double kShares[3] = {0.5, 0.9, 0.99};
  double inside[2][3] = {};
  double count[2] = {};
  std::set<map::ContactKey> vessels;
  for (const std::string& line : lines) {
    const auto report = ParseAis(line);
    if (!report.has_value()) continue;
    ++reports;
    vessels.insert(report->key);
    const map::ContactOutcome outcome = map.Apply(*report);
    if (!outcome.applied) {
      ++refused;
      if (outcome.reason != map::RejectReason::kGated) continue;
      ++gated;
      const auto& fix = std::get<map::ContactFix>(report->observation);
      outliers += fix.position.longitude_deg > 50 ? 1 : 0;
      continue;
    }
    std::deque<map::ContactPoint>& points = past[report->key];
    const map::ContactPoint& now = *outcome.estimate;
    if (outcome.revised || now.time != report->time) continue;
    for (int k = 0; k < 2; ++k) {
      // The oldest that is not more than 10 % older than asked for.
      const auto old = std::find_if(
          points.begin(), points.end(), [&](const map::ContactPoint& point) {
            return ToSeconds(now.time - point.time) <= 1.1 * kAheadS[k];
          });
      if (old == points.end() ||
          ToSeconds(now.time - old->time) < 0.9 * kAheadS[k]) {
        continue;
      }
      const map::ContactPoint foretold =
          map::PredictPoint(*old, now.time, classes);
      const map::ContactPoint there =
          map::InPlaneAt(now, foretold.frame_origin);
      const Eigen::Vector2d error = (foretold.x - there.x).head<2>();
      // The report's own noise, 10 m, belongs to the comparison.
      const Eigen::Matrix2d S =
          foretold.P.topLeftCorner<2, 2>() + there.P.topLeftCorner<2, 2>();
      const double square = error.dot(S.inverse() * error);
      for (int p = 0; p < 3; ++p) {
        inside[k][p] += square <= -2 * std::log(1 - kShares[p]) ? 1 : 0;
      }
      count[k] += 1;
    }
    points.push_back(now);
    while (ToSeconds(now.time - points.front().time) > 400) points.pop_front();
  }
  nlohmann::json row = {{"scene", "ais_solent"},
                        {"reports", reports},
                        {"vessels", vessels.size()},
                        {"tracked", map.View().live_count()},
                        {"gated", gated},
                        {"absurd_gated", outliers},
                        {"refused_otherwise", refused - gated}};
  for (int k = 0; k < 2; ++k) {
    const std::string at = std::to_string(kAheadS[k] / 60) + "_min";
    row["predictions_" + at] = count[k];
    for (int p = 0; p < 3; ++p) {
      row["within_" + std::to_string(static_cast<int>(100 * kShares[p])) +
          "_percent_" + at] = 100 * inside[k][p] / count[k];
    }
  }
  return row;
}

}  // namespace

nlohmann::json RecordedContactFigures(const std::string& folder) {
  auto rows = nlohmann::json::array();
  const std::string radar = folder + "/autoferry";
  for (nlohmann::json row :
       {RadarRow(radar, {}),
        // What is wrong with the raw tracks is not the process noise.
        RadarRow(radar, {.process_noise = 0.1}),
        RadarRow(radar, {.process_noise = 50}),
        RadarRow(radar, {.filter = map::FilterKind::kPerAxis}),
        RadarRow(radar, {.calibrated = true}),
        RadarRow(radar,
                 {.filter = map::FilterKind::kPerAxis, .calibrated = true}),
        AisRow(folder + "/solent-ais/SolentAIS_20160112_130211.csv")}) {
    if (!row.is_null()) rows.push_back(std::move(row));
  }
  if (rows.empty()) {
    std::printf("skipped: no recorded contacts in %s\n", folder.c_str());
  }
  return rows;
}

}  // namespace fathom::accuracy
