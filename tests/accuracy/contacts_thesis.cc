// The run of Nervegna 2002, section 6.2, which states 3.4 ft/s, 290 degrees,
// the approach and the departure; the rest is chosen here: 25 minutes, a
// report every 10 s, the vehicle at 2 m/s on 110 degrees from 2 km away,
// passing 200 m abeam; range 30 m and bearing 3 degrees, 1 sigma.

#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "tests/accuracy/contact_runs.h"
#include "tests/accuracy/contacts.h"
#include "tests/accuracy/line_chart.h"

namespace fathom::accuracy {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180;
constexpr double kFootM = 0.3048;

Encounter ThesisEncounter(int noise) {
  const double course = 290 * kRadPerDeg;
  const double speed_m_s = 3.4 * kFootM;
  const double ahead = 110 * kRadPerDeg;
  // 2 km ahead, 200 m to the right.
  const Eigen::Vector2d place(2000 * std::cos(ahead) - 200 * std::sin(ahead),
                              2000 * std::sin(ahead) + 200 * std::cos(ahead));
  return {.contact = {place.x(), place.y(), speed_m_s * std::cos(course),
                      speed_m_s * std::sin(course)},
          .velocity_std_m_s = 0,
          .process_noise_m2_s3 = 0,
          .vehicle_m_s = {2 * std::cos(ahead), 2 * std::sin(ahead)},
          .range_std_m = 30.0 * noise,
          .bearing_std_deg = 3.0 * noise,
          .step_s = 10,
          .reports = 151};
}

// Range and bearing of the contact from the vehicle, along the estimate.
std::array<double, 2> RangeBearingOf(const map::ContactPoint& estimate,
                                     const Moment& moment) {
  const map::RangeAzimuth seen = map::Inverse(
      std::get<map::RangeBearing>(moment.report.observation).pose.position,
      estimate.Position());
  return {seen.distance_m, seen.azimuth_deg};
}

struct Errors {
  double range_m2 = 0;
  double bearing_deg2 = 0;
  double position_m2 = 0;
  double velocity_m2_s2 = 0;
};

}  // namespace

nlohmann::json ThesisContactFigures() {
  constexpr int kRuns = 100;
  auto rows = nlohmann::json::array();
  for (const int noise : {1, 2, 4}) {
    const Encounter encounter = ThesisEncounter(noise);
    std::vector<Errors> errors(static_cast<std::size_t>(encounter.reports));
    double within = 0;
    double count = 0;
    double measured_m2 = 0;
    double range_m2 = 0;
    for (std::uint64_t run = 1; run <= kRuns; ++run) {
      map::ContactMap map(map::ContactMapOptions{});
      const std::vector<Moment> moments = Run(encounter, run);
      for (std::size_t i = 0; i < moments.size(); ++i) {
        const Moment& moment = moments[i];
        map.Apply(moment.report);
        const map::ContactEstimate estimate =
            *map.View().At(moment.report.key, moment.report.time);
        const Eigen::Vector4d error = ErrorOf(estimate, moment.truth);
        const auto [range_m, bearing_deg] = RangeBearingOf(estimate, moment);
        errors[i].range_m2 += std::pow(range_m - moment.range_m, 2);
        errors[i].bearing_deg2 += std::pow(
            std::remainder(bearing_deg - moment.azimuth_deg, 360.0), 2);
        errors[i].position_m2 += error.head<2>().squaredNorm();
        errors[i].velocity_m2_s2 += error.tail<2>().squaredNorm();
        for (int k = 0; k < 4; ++k) {
          within += std::fabs(error(k)) <= 3 * std::sqrt(estimate.P(k, k));
          count += 1;
        }
        const auto& heard =
            std::get<map::RangeBearing>(moment.report.observation);
        measured_m2 += std::pow(heard.range_m - moment.range_m, 2);
        range_m2 += std::pow(range_m - moment.range_m, 2);
      }
    }
    const auto rms = [&](double Errors::*what, std::size_t i) {
      return std::sqrt(errors[i].*what / kRuns);
    };
    nlohmann::json row = {
        {"noise", noise},
        {"within_3std_percent", 100 * within / count},
        {"range_over_measured", std::sqrt(range_m2 / measured_m2)}};
    for (const std::size_t minute : {1u, 5u, 15u, 25u}) {
      const std::size_t i = 6 * minute;
      const std::string at = std::to_string(minute) + "_min";
      row["range_m_" + at] = rms(&Errors::range_m2, i);
      row["bearing_deg_" + at] = rms(&Errors::bearing_deg2, i);
      row["position_m_" + at] = rms(&Errors::position_m2, i);
      row["velocity_m_s_" + at] = rms(&Errors::velocity_m2_s2, i);
    }
    rows.push_back(row);
  }
  return rows;
}

int DrawThesisContact(const std::string& folder) {
  const std::vector<Moment> moments = Run(ThesisEncounter(1), 2002);
  map::ContactMap map(map::ContactMapOptions{});
  std::vector<double> x;
  // By name: a value at each report.
  std::map<std::string, std::vector<double>> line;
  double true_deg = 90;
  for (const Moment& moment : moments) {
    map.Apply(moment.report);
    const map::ContactEstimate estimate =
        *map.View().At(moment.report.key, moment.report.time);
    const Eigen::Vector4d error = ErrorOf(estimate, moment.truth);
    const auto& heard = std::get<map::RangeBearing>(moment.report.observation);
    const auto [range_m, bearing_deg] = RangeBearingOf(estimate, moment);
    x.push_back(moment.at_s / 60);
    // Without the leap at 180 degrees.
    true_deg += std::remainder(moment.azimuth_deg - true_deg, 360);
    const auto about = [&](double deg) {
      return true_deg + std::remainder(deg - true_deg, 360);
    };
    line["range true"].push_back(moment.range_m);
    line["range measured"].push_back(heard.range_m);
    line["range estimated"].push_back(range_m);
    line["bearing true"].push_back(true_deg);
    line["bearing measured"].push_back(about(heard.bearing_deg));
    line["bearing estimated"].push_back(about(bearing_deg));
    const double azimuth = heard.bearing_deg * kRadPerDeg;
    const Eigen::Vector2d seen =
        moment.vehicle +
        heard.range_m * Eigen::Vector2d(std::cos(azimuth), std::sin(azimuth));
    for (int axis = 0; axis < 2; ++axis) {
      const std::string name = axis == 0 ? "x" : "y";
      line[name + " true"].push_back(moment.truth(axis));
      line[name + " estimated"].push_back(moment.truth(axis) + error(axis));
      line[name + " measured error"].push_back(seen(axis) - moment.truth(axis));
      line[name + " error"].push_back(error(axis));
      const double std_m = std::sqrt(estimate.P(axis, axis));
      line[name + " +3 std"].push_back(3 * std_m);
      line[name + " -3 std"].push_back(-3 * std_m);
      const int v = axis + 2;
      line["v" + name + " true"].push_back(moment.truth(v));
      line["v" + name + " estimated"].push_back(moment.truth(v) + error(v));
      line["v" + name + " error"].push_back(error(v));
      const double std_m_s = std::sqrt(estimate.P(v, v));
      line["v" + name + " +3 std"].push_back(3 * std_m_s);
      line["v" + name + " -3 std"].push_back(-3 * std_m_s);
    }
  }
  // Colours that hold for who sees no red or green (Okabe and Ito).
  const auto series = [&](const std::string& key, const std::string& name) {
    ChartSeries one{.name = name, .values = line.at(key)};
    one.points = name == "measured";
    if (name == "measured") one.red = one.green = one.blue = 0.6;
    if (name == "true") one.blue = 0.7, one.green = 0.45;
    if (name == "estimated" || name == "error")
      one.red = 0.84, one.green = 0.37;
    if (name == "3 std" || name.empty()) one.green = 0.62, one.blue = 0.45;
    return one;
  };
  int written = 0;
  const auto draw = [&](int figure, const std::string& title,
                        const std::string& unit,
                        std::vector<ChartSeries> lines) {
    const LineChart chart{
        .title = "Fig. 6-" + std::to_string(figure) + ": " + title,
        .x_label = "minutes",
        .y_label = unit,
        .x = x,
        .series = std::move(lines)};
    written +=
        DrawChart(chart, folder + "/fig_6_" + std::to_string(figure) + ".png");
  };
  const auto compared = [&](const std::string& key) {
    return std::vector{series(key + " measured", "measured"),
                       series(key + " estimated", "estimated"),
                       series(key + " true", "true")};
  };
  const auto followed = [&](const std::string& key) {
    return std::vector{series(key + " estimated", "estimated"),
                       series(key + " true", "true")};
  };
  const auto bounded = [&](const std::string& key) {
    return std::vector{series(key + " +3 std", "3 std"),
                       series(key + " -3 std", ""),
                       series(key + " error", "error")};
  };
  const auto measured = [&](const std::string& key) {
    return std::vector{series(key + " measured error", "measured"),
                       series(key + " error", "estimated")};
  };
  draw(2, "range", "m", compared("range"));
  draw(3, "bearing from north", "degrees", compared("bearing"));
  draw(4, "x-position (north)", "m", followed("x"));
  draw(5, "y-position (east)", "m", followed("y"));
  draw(6, "error of the x-position", "m", bounded("x"));
  draw(7, "error of the y-position", "m", bounded("y"));
  draw(8, "error of the measured and the estimated x-position", "m",
       measured("x"));
  draw(9, "error of the measured and the estimated y-position", "m",
       measured("y"));
  draw(10, "error of the y-velocity", "m/s", bounded("vy"));
  draw(11, "y-velocity", "m/s", followed("vy"));
  draw(12, "error of the x-velocity", "m/s", bounded("vx"));
  draw(13, "x-velocity", "m/s", followed("vx"));
  return written;
}

}  // namespace fathom::accuracy
