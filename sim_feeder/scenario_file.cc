#include "sim_feeder/scenario_file.h"

#include <array>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "sim_feeder/angles.h"
#include "sim_feeder/yaml_reader.h"

namespace fathom::feeder {
namespace {

constexpr double kWholeEarthM = 2e7;

void ReadPoint(YamlMap& map, const std::string& prefix,
               map::GeodeticPoint& point) {
  map.Read(prefix + "_lat_deg", point.latitude_deg, -90, 90);
  map.Read(prefix + "_lon_deg", point.longitude_deg, -180, 180);
}

void ReadActivity(YamlMap map, RunOptions& run) {
  std::size_t estimator = 0;
  map.Read("id", run.scenario.activity_id);
  map.Read("cell_size_m", run.scenario.area.cell_size_m, 0.1, 1000);
  map.ReadName("estimator", estimator,
               {"default", "nervegna", "kalman", "adaptive"});
  run.activity.set_estimator(
      std::array{v1::ESTIMATOR_UNSPECIFIED, v1::ESTIMATOR_NERVEGNA,
                 v1::ESTIMATOR_KALMAN, v1::ESTIMATOR_ADAPTIVE}[estimator]);
  double value = 0;
  map.Read("min_range_m", value, 0, 100'000);
  run.activity.set_min_range_m(value);
  value = 0;
  map.Read("max_range_m", value, 0, 100'000);
  run.activity.set_max_range_m(value);
  value = 0;
  map.Read("smoothing_distance_m", value, 0, 1000);
  run.activity.set_smoothing_distance_m(value);
  value = 0;
  map.Read("smoothing_scale", value, 0, 1);
  run.activity.set_smoothing_scale(value);
  map.Read("complete", run.complete_activity);
  std::optional<double> depth_m;
  std::optional<double> std_m;
  map.Read("prior_depth_m", depth_m, -100, 12'000);
  map.Read("prior_std_m", std_m, 1e-3, 1000);
  if (depth_m.has_value() != std_m.has_value()) {
    map.Refuse(depth_m.has_value() ? "prior_depth_m" : "prior_std_m",
               "needs prior_depth_m and prior_std_m both");
  } else if (depth_m.has_value()) {
    run.activity.mutable_default_prior()->set_depth_m(*depth_m);
    run.activity.mutable_default_prior()->set_std_m(*std_m);
  }
}

void ReadArea(YamlMap map, RunOptions& run) {
  map.Read("auto_side_m", run.auto_area_side_m, 10, 100'000);
  SurveyArea& area = run.scenario.area;
  ReadPoint(map, "south_west", area.south_west);
  map.Read("north_extent_m", area.north_extent_m, 1, 100'000);
  map.Read("east_extent_m", area.east_extent_m, 1, 100'000);
  const bool stated = map.Has("south_west_lat_deg") &&
                      map.Has("south_west_lon_deg") &&
                      map.Has("north_extent_m") && map.Has("east_extent_m");
  if (stated == run.auto_area_side_m.has_value()) {
    map.Refuse("auto_side_m",
               "or south_west_lat_deg, south_west_lon_deg, north_extent_m and "
               "east_extent_m: one of both must be stated");
  }
}

std::vector<Shape> ReadShapes(YamlMap& truth) {
  std::vector<Shape> shapes;
  for (YamlMap& map : truth.Children("shapes")) {
    Shape shape;
    std::size_t kind = 0;
    map.ReadName("kind", kind,
                 {"slope", "ridge", "channel", "pinnacle", "wreck", "wall"});
    shape.kind = static_cast<ShapeKind>(kind);
    if (!map.Has("kind")) map.Refuse("kind", "is missing");
    map.Read("north_m", shape.north_m, -1e5, 1e5);
    map.Read("east_m", shape.east_m, -1e5, 1e5);
    map.Read("azimuth_deg", shape.azimuth_deg, -360, 360);
    map.Read("length_m", shape.length_m, 0.1, 1e5);
    map.Read("width_m", shape.width_m, 0.1, 1e5);
    const double least_m = shape.kind == ShapeKind::kSlope ? -1000 : 0.01;
    map.Read("height_m", shape.height_m, least_m, 1000);
    shapes.push_back(shape);
  }
  return shapes;
}

void ReadTruth(YamlMap map, TruthOptions& truth) {
  map.Read("raster", truth.path);
  std::size_t positive = 0;
  map.ReadName("positive", positive, {"auto", "up", "down"});
  truth.positive =
      std::array{Positive::kAuto, Positive::kUp, Positive::kDown}[positive];
  ReadPoint(map, "center", truth.center);
  map.Read("relief_std_m", truth.relief.std_m, 0, 1000);
  map.Read("relief_length_m", truth.relief.correlation_length_m, 1, 1e6);
  map.Read("relief_seed", truth.relief.seed);
  map.Read("relief_cell_m", truth.fine_cell_m, 0.1, 1000);
  map.Read("flat_depth_m", truth.flat_depth_m, 1, 12'000);
  if (truth.flat_depth_m.has_value() && !truth.path.empty()) {
    map.Refuse("flat_depth_m", "and raster are both stated");
  }
  truth.shapes = ReadShapes(map);
  map.Read("shape_cell_m", truth.shape_cell_m, 0.1, 1000);
}

void ReadVehicle(YamlMap map, Scenario& scenario) {
  VehicleOptions& vehicle = scenario.vehicle;
  map.Read("speed_m_s", vehicle.speed_m_s, 0.01, 100);
  map.Read("turn_rate_deg_s", vehicle.turn_rate_deg_s, 0.01, 360);
  map.Read("altitude_m", vehicle.altitude_m, 0.1, 12'000);
  map.Read("depth_m", vehicle.depth_m, 0, 12'000);
  map.Read("track_spacing_m", scenario.track_spacing_m, 0.1, 100'000);
  map.Read("min_water_m", scenario.min_water_m, 0.1, 12'000);
  for (YamlMap& point : map.Children("waypoints")) {
    Waypoint waypoint;
    point.Read("north_m", waypoint.place.north_m, -1e5, 1e5);
    point.Read("east_m", waypoint.place.east_m, -1e5, 1e5);
    point.Read("loiter_radius_m", waypoint.loiter_radius_m, 0.1, 1e5);
    point.Read("loiter_s", waypoint.loiter_s, 0.1, 1e7);
    if (point.Has("loiter_s") != point.Has("loiter_radius_m")) {
      point.Refuse(point.Has("loiter_s") ? "loiter_s" : "loiter_radius_m",
                   "needs loiter_radius_m and loiter_s both");
    }
    scenario.waypoints.push_back(waypoint);
  }
  if (map.Has("waypoints") && map.Has("track_spacing_m")) {
    map.Refuse("track_spacing_m",
               "is of a lawnmower, and waypoints are stated");
  }
}

void ReadNavigation(YamlMap map, NavigationOptions& navigation) {
  map.Read("bias_north_m", navigation.bias_north_m, -1000, 1000);
  map.Read("bias_east_m", navigation.bias_east_m, -1000, 1000);
  map.Read("walk_m_per_sqrt_s", navigation.walk_m_per_sqrt_s, 0, 100);
  map.Read("fix_interval_s", navigation.fix_interval_s, 0, 1e6);
  map.Read("fix_std_m", navigation.fix_std_m, 0, 1000);
}

void ReadSonar(YamlMap map, Scenario& scenario) {
  ForwardSonarOptions& sonar = scenario.sonar;
  map.Read("beam_count", sonar.fan.beam_count, 1, 4095);
  map.Read("beam_spacing_deg", sonar.fan.spacing_deg, 0.01, 90);
  map.Read("max_slant_range_m", sonar.fan.max_slant_range_m, 1, 20'000);
  map.Read("beam_std_m", sonar.beam_std_m, 0, 100);
  map.Read("least_std_m", sonar.least_std_m, 1e-3, 100);
  map.Read("cell_m", sonar.sonar_cell_m, 0.1, 1000);
  map.Read("ping_interval_s", scenario.ping_interval_s, 1e-3, 3600);
  SonarFaults& faults = scenario.faults;
  map.Read("dropout_share", faults.dropout_share, 0, 1);
  map.Read("ghost_share", faults.ghost_share, 0, 1);
  map.Read("crosstalk_share", faults.crosstalk_share, 0, 1);
  map.Read("sound_speed_error", faults.sound_speed_error, -0.1, 0.1);
  map.Read("tide_m", faults.tide_m, -20, 20);
}

// One ship: where it starts, its legs one after the other, and whether it
// chases the vehicle after them.
Ship ReadShip(YamlMap& map, std::vector<Pursuit>& pursuits) {
  Ship ship;
  std::size_t kind = 0;
  map.Read("id", ship.id);
  map.ReadName("class", kind,
               {"vessel", "small_craft", "deep_draught", "submerged",
                "drifting", "unknown"});
  ship.contact_class = std::array{
      v1::CONTACT_CLASS_VESSEL,       v1::CONTACT_CLASS_SMALL_CRAFT,
      v1::CONTACT_CLASS_DEEP_DRAUGHT, v1::CONTACT_CLASS_SUBMERGED,
      v1::CONTACT_CLASS_DRIFTING,     v1::CONTACT_CLASS_UNKNOWN}[kind];
  map.Read("north_m", ship.start.north_m, -1e6, 1e6);
  map.Read("east_m", ship.start.east_m, -1e6, 1e6);
  double at_s = 0;
  for (YamlMap& leg : map.Children("legs")) {
    double speed_m_s = 0;
    double course_deg = 0;
    double duration_s = 0;
    leg.Read("speed_m_s", speed_m_s, 0, 60);
    leg.Read("course_deg", course_deg, -360, 360);
    leg.Read("duration_s", duration_s, 0.1, 1e7);
    const CourseChange change = {
        .at_s = at_s,
        .north_m_s = speed_m_s * std::cos(course_deg * kRadiansPerDegree),
        .east_m_s = speed_m_s * std::sin(course_deg * kRadiansPerDegree)};
    if (at_s == 0) {
      ship.north_m_s = change.north_m_s;
      ship.east_m_s = change.east_m_s;
    } else {
      ship.changes.push_back(change);
    }
    if (duration_s == 0) leg.Refuse("duration_s", "is missing");
    at_s += duration_s;
  }
  if (ship.id.empty()) map.Refuse("id", "is missing");
  Pursuit pursuit = {.ship_id = ship.id, .from_s = at_s};
  map.Read("chase_speed_m_s", pursuit.speed_m_s, 0.01, 60);
  map.Read("chase_interval_s", pursuit.interval_s, 0.1, 1e6);
  if (map.Has("chase_speed_m_s")) {
    pursuits.push_back(pursuit);
  } else if (map.Has("chase_interval_s")) {
    map.Refuse("chase_interval_s", "needs chase_speed_m_s");
  }
  return ship;
}

void ReadContacts(YamlMap map, Scenario& scenario) {
  map.Read("ships", scenario.ships, 0, 1000);
  map.Read("crossing_m", scenario.crossing_m, 0, 1e5);
  for (YamlMap& ship : map.Children("scripted")) {
    scenario.scripted_ships.push_back(ReadShip(ship, scenario.pursuits));
  }
  map.Read("bearing_std_deg", scenario.passive_bearing_std_deg, 1e-6, 45);
  map.Read("passive_range_m", scenario.passive_range_m, 0, kWholeEarthM);
  map.Read("report_interval_s", scenario.report_interval_s, 1e-2, 1e6);
  map.Read("c4i_interval_s", scenario.fix_interval_s, 0, 1e6);
  map.Read("c4i_position_std_m", scenario.fix_position_std_m, 0, 1e4);
  map.Read("c4i_velocity_std_m_s", scenario.fix_velocity_std_m_s, 0, 60);
}

std::vector<Expectation> ReadExpectations(YamlMap& file,
                                          const std::string& name) {
  std::vector<Expectation> expectations;
  for (YamlMap& map : file.Children("expect")) {
    Expectation expectation;
    map.Read("figure", expectation.figure);
    map.Read("at_least", expectation.at_least, -1e12, 1e12);
    map.Read("at_most", expectation.at_most, -1e12, 1e12);
    expectation.place = absl::StrFormat("%s:%d", name, map.line());
    if (!expectation.figure.starts_with('/')) {
      map.Refuse("figure", "must be a JSON pointer: /measured/rmse_m");
    }
    if (!expectation.at_least.has_value() && !expectation.at_most.has_value()) {
      map.Refuse("figure", "needs at_least or at_most");
    }
    expectations.push_back(std::move(expectation));
  }
  return expectations;
}

}  // namespace

absl::StatusOr<ScenarioFile> ParseScenario(const std::string& text,
                                           const std::string& name) {
  FATHOM_ASSIGN_OR_RETURN(YamlMap file, YamlMap::Parse(text, name));
  ScenarioFile out;
  RunOptions& run = out.run;
  // The sonar's cells are the map's, unless stated.
  run.scenario.sonar.sonar_cell_m = 0;
  file.Read("title", out.title);
  file.Read("seed", run.scenario.seed);
  file.Read("start_time", run.start_time);
  file.Read("duration_s", run.duration_s, 1, 1e7);
  file.Read("pings", run.scenario.pings);
  file.Read("evaluation_points", out.evaluation_points);
  if (out.evaluation_points == 0) {
    file.Refuse("evaluation_points", "must be at least 1");
  }
  if (file.Has("duration_s") && file.Has("pings")) {
    file.Refuse("pings", "and duration_s are both stated");
  }
  ReadActivity(file.Child("activity"), run);
  ReadArea(file.Child("area"), run);
  ReadTruth(file.Child("truth"), run.truth);
  ReadVehicle(file.Child("vehicle"), run.scenario);
  ReadNavigation(file.Child("navigation"), run.scenario.navigation);
  ReadSonar(file.Child("sonar"), run.scenario);
  ReadContacts(file.Child("contacts"), run.scenario);
  out.expectations = ReadExpectations(file, name);
  if (run.scenario.activity_id.empty()) {
    file.Refuse("activity", "needs an id");
  }
  FATHOM_RETURN_IF_ERROR(file.Finish());
  if (run.scenario.sonar.sonar_cell_m == 0) {
    run.scenario.sonar.sonar_cell_m = run.scenario.area.cell_size_m;
  }
  return out;
}

absl::StatusOr<ScenarioFile> LoadScenario(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  if (!file || !(text << file.rdbuf())) {
    return absl::NotFoundError(absl::StrFormat("cannot read %s", path));
  }
  FATHOM_ASSIGN_OR_RETURN(ScenarioFile out, ParseScenario(text.str(), path));
  const std::filesystem::path raster = out.run.truth.path;
  if (!raster.empty() && raster.is_relative()) {
    out.run.truth.path =
        (std::filesystem::path(path).parent_path() / raster).string();
  }
  return out;
}

absl::StatusOr<std::vector<std::string>> Missed(
    const std::vector<Expectation>& expectations,
    const std::string& evaluation_json) {
  const auto json = nlohmann::json::parse(evaluation_json, nullptr,
                                          /*allow_exceptions=*/false);
  std::vector<std::string> missed;
  for (const Expectation& expected : expectations) {
    const nlohmann::json::json_pointer figure(expected.figure);
    if (!json.contains(figure) || !json.at(figure).is_number()) {
      return absl::InvalidArgumentError(
          absl::StrFormat("%s: the evaluation has no number %s", expected.place,
                          expected.figure));
    }
    const double value = json.at(figure);
    if (value < expected.at_least.value_or(value)) {
      missed.push_back(absl::StrFormat("%s: %s is %g, expected at least %g",
                                       expected.place, expected.figure, value,
                                       *expected.at_least));
    }
    if (value > expected.at_most.value_or(value)) {
      missed.push_back(absl::StrFormat("%s: %s is %g, expected at most %g",
                                       expected.place, expected.figure, value,
                                       *expected.at_most));
    }
  }
  return missed;
}

}  // namespace fathom::feeder
