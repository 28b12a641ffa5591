#include "sim_feeder/survey_record.h"

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "map/geodesy/ned_frame.h"

namespace fathom::feeder {
namespace {

using Json = nlohmann::ordered_json;

Json PointJson(const map::GeodeticPoint& point) {
  return {{"latitude_deg", point.latitude_deg},
          {"longitude_deg", point.longitude_deg}};
}

map::GeodeticPoint PointFrom(const Json& json) {
  return {.latitude_deg = json.at("latitude_deg"),
          .longitude_deg = json.at("longitude_deg")};
}

Json AreaJson(const SurveyArea& area) {
  const map::NedFrame frame(area.south_west);
  return {{"south_west", PointJson(area.south_west)},
          {"center", PointJson(frame.ToGeodetic(0.5 * area.north_extent_m,
                                                0.5 * area.east_extent_m))},
          {"north_east", PointJson(frame.ToGeodetic(area.north_extent_m,
                                                    area.east_extent_m))},
          {"north_extent_m", area.north_extent_m},
          {"east_extent_m", area.east_extent_m},
          {"cell_size_m", area.cell_size_m}};
}

Json ShipJson(const Ship& ship, const SurveyRecord& record) {
  const map::NedFrame frame(record.area.south_west);
  const PlanePoint end =
      ship.PlaceAt(ToSeconds(record.end_time - record.start_time));
  Json changes = Json::array();
  for (const CourseChange& change : ship.changes) {
    changes.push_back({{"at_s", change.at_s},
                       {"velocity_north_m_s", change.north_m_s},
                       {"velocity_east_m_s", change.east_m_s}});
  }
  return {
      {"contact_id", ship.id},
      {"contact_class", v1::ContactClass_Name(ship.contact_class)},
      {"start_position",
       PointJson(frame.ToGeodetic(ship.start.north_m, ship.start.east_m))},
      {"end_position", PointJson(frame.ToGeodetic(end.north_m, end.east_m))},
      {"start_north_m", ship.start.north_m},
      {"start_east_m", ship.start.east_m},
      {"velocity_north_m_s", ship.north_m_s},
      {"velocity_east_m_s", ship.east_m_s},
      {"course_changes", changes}};
}

absl::StatusOr<Ship> ShipFrom(const Json& json) {
  Ship ship;
  ship.id = json.at("contact_id");
  const std::string name = json.at("contact_class");
  if (!v1::ContactClass_Parse(name, &ship.contact_class)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("contact_class=\"%s\" is unknown", name));
  }
  ship.start = {.north_m = json.at("start_north_m"),
                .east_m = json.at("start_east_m")};
  ship.north_m_s = json.at("velocity_north_m_s");
  ship.east_m_s = json.at("velocity_east_m_s");
  for (const Json& change : json.value("course_changes", Json::array())) {
    ship.changes.push_back({.at_s = change.at("at_s"),
                            .north_m_s = change.at("velocity_north_m_s"),
                            .east_m_s = change.at("velocity_east_m_s")});
  }
  return ship;
}

absl::StatusOr<SurveyRecord> RecordFrom(const Json& json) {
  SurveyRecord record;
  record.activity_id = json.at("activity_id");
  record.source_id = json.at("source_id");
  record.seed = json.at("seed");
  record.truth = json.at("truth");
  FATHOM_ASSIGN_OR_RETURN(record.start_time,
                          ParseTime(json.at("start_time").get<std::string>()));
  FATHOM_ASSIGN_OR_RETURN(record.end_time,
                          ParseTime(json.at("end_time").get<std::string>()));
  const Json& area = json.at("area");
  record.area = {.south_west = PointFrom(area.at("south_west")),
                 .north_extent_m = area.at("north_extent_m"),
                 .east_extent_m = area.at("east_extent_m"),
                 .cell_size_m = area.at("cell_size_m")};
  FATHOM_RETURN_IF_ERROR(ValidateArea(record.area));
  for (const Json& ship_json : json.at("ships")) {
    FATHOM_ASSIGN_OR_RETURN(Ship ship, ShipFrom(ship_json));
    record.ships.push_back(ship);
  }
  record.track_length_m = json.at("track_length_m");
  record.track_spacing_m = json.at("track_spacing_m");
  record.pings = json.at("pings");
  record.measurements = json.at("measurements");
  record.contact_reports = json.at("contact_reports");
  record.pings_silent = json.at("pings_silent");
  record.pings_durable = json.at("pings_durable");
  record.reports_durable = json.at("reports_durable");
  record.measurements_accepted = json.at("measurements_accepted");
  record.rejects =
      json.at("rejects").get<std::map<std::string, std::uint64_t>>();
  record.report_rejects =
      json.at("report_rejects").get<std::map<std::string, std::uint64_t>>();
  record.dropped = json.value("dropped", std::uint64_t{0});
  record.reconnects = json.at("reconnects");
  record.map_revision = json.at("map_revision");
  record.seconds = json.at("seconds");
  return record;
}

}  // namespace

std::string ToJson(const SurveyRecord& record) {
  Json ships = Json::array();
  for (const Ship& ship : record.ships) ships.push_back(ShipJson(ship, record));
  const Json json = {
      {"activity_id", record.activity_id},
      {"source_id", record.source_id},
      {"seed", record.seed},
      {"truth", record.truth},
      {"start_time", FormatTime(record.start_time)},
      {"end_time", FormatTime(record.end_time)},
      {"area", AreaJson(record.area)},
      {"ships", ships},
      {"track_length_m", record.track_length_m},
      {"track_spacing_m", record.track_spacing_m},
      {"pings", record.pings},
      {"measurements", record.measurements},
      {"contact_reports", record.contact_reports},
      {"pings_silent", record.pings_silent},
      {"pings_durable", record.pings_durable},
      {"reports_durable", record.reports_durable},
      {"measurements_accepted", record.measurements_accepted},
      {"rejects", record.rejects},
      {"report_rejects", record.report_rejects},
      {"dropped", record.dropped},
      {"reconnects", record.reconnects},
      {"map_revision", record.map_revision},
      {"seconds", record.seconds},
      {"pings_per_s", record.seconds > 0.0
                          ? static_cast<double>(record.pings) / record.seconds
                          : 0.0}};
  return json.dump();
}

absl::StatusOr<SurveyRecord> ParseSurveyRecord(const std::string& json) {
  // nlohmann's exceptions stop here.
  try {
    return RecordFrom(Json::parse(json));
  } catch (const nlohmann::json::exception& error) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "not a survey record of fathom-feeder run --json: %s", error.what()));
  }
}

absl::StatusOr<SurveyRecord> LoadSurveyRecord(const std::string& path) {
  std::ifstream file(path);
  if (!file) {
    return absl::NotFoundError(absl::StrFormat("cannot open %s", path));
  }
  std::ostringstream text;
  text << file.rdbuf();
  return ParseSurveyRecord(text.str());
}

}  // namespace fathom::feeder
