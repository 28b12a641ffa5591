#include "client/cli/map_area.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/exit_code.h"
#include "client/cli/geo_math.h"

namespace fathom::client::cli {
namespace {

GeoBox BoxAround(const v1::GeodeticPoint& south_west, double north_m,
                 double east_m, double margin) {
  const v1::GeodeticPoint low =
      Offset(south_west, -margin * north_m, -margin * east_m);
  const v1::GeodeticPoint high =
      Offset(south_west, (1 + margin) * north_m, (1 + margin) * east_m);
  return {low.latitude_deg(), low.longitude_deg(), high.latitude_deg(),
          high.longitude_deg()};
}

absl::StatusOr<v1::GeodeticPoint> PointFrom(
    const nlohmann::ordered_json& json) {
  v1::GeodeticPoint point;
  point.set_latitude_deg(json.at("latitude_deg").get<double>());
  point.set_longitude_deg(json.at("longitude_deg").get<double>());
  return point;
}

// What `fathom-feeder run --json` wrote: its area and when it ended.
absl::StatusOr<MapArea> AreaOfSurvey(const std::string& path, double margin) {
  std::ifstream in(path);
  if (!in) {
    return FileError(
        absl::NotFoundError(absl::StrFormat("%s: cannot be opened", path)));
  }
  try {
    const auto survey = nlohmann::ordered_json::parse(in);
    const nlohmann::ordered_json& area = survey.at("area");
    MapArea view;
    FATHOM_ASSIGN_OR_RETURN(const v1::GeodeticPoint south_west,
                            PointFrom(area.at("south_west")));
    double north_m = 0;
    double east_m = 0;
    if (area.contains("north_east")) {
      FATHOM_ASSIGN_OR_RETURN(const v1::GeodeticPoint north_east,
                              PointFrom(area.at("north_east")));
      const MetersPerDegree scale = MetersPerDegreeAt(
          (south_west.latitude_deg() + north_east.latitude_deg()) / 2);
      north_m = (north_east.latitude_deg() - south_west.latitude_deg()) *
                scale.latitude;
      east_m = WrapLongitude(north_east.longitude_deg() -
                             south_west.longitude_deg()) *
               scale.longitude;
    } else {
      north_m = area.at("north_extent_m").get<double>();
      east_m = area.at("east_extent_m").get<double>();
    }
    view.box = BoxAround(south_west, north_m, east_m, margin);
    view.cell_m = area.value("cell_size_m", 0.0);
    if (survey.contains("end_time")) {
      FATHOM_ASSIGN_OR_RETURN(
          view.time, ParseTime(survey.at("end_time").get<std::string>()));
    }
    return view;
  } catch (const nlohmann::json::exception& error) {
    return FileError(absl::InvalidArgumentError(absl::StrFormat(
        "%s: not the JSON of a survey: %s", path, error.what())));
  }
}

}  // namespace

void AddAreaFlags(CLI::App& verb, AreaFlags& flags) {
  CLI::Option* area =
      verb.add_option("--area", flags.area, "Which part: S,W,N,E in degrees");
  CLI::Option* center =
      verb.add_option("--center", flags.center,
                      "Which part: LAT,LON of the middle, with --size-m");
  verb.add_option("--size-m", flags.size_m, "Side of the square, metres")
      ->needs(center);
  CLI::Option* activity = verb.add_option("--activity", flags.activity_id,
                                          "Which part: this activity's area");
  CLI::Option* survey = verb.add_option(
      "--survey", flags.survey,
      "Which part: the area and end time in the JSON of fathom-feeder run");
  area->excludes(center)->excludes(activity)->excludes(survey);
  center->excludes(activity)->excludes(survey);
  activity->excludes(survey);
}

double MapArea::LongerSideM() const {
  const MetersPerDegree scale =
      MetersPerDegreeAt((box.south_deg + box.north_deg) / 2);
  return std::max((box.north_deg - box.south_deg) * scale.latitude,
                  box.Width() * scale.longitude);
}

double MapArea::Cells(double resolution_m) const {
  const MetersPerDegree scale =
      MetersPerDegreeAt((box.south_deg + box.north_deg) / 2);
  const double rows =
      (box.north_deg - box.south_deg) * scale.latitude / resolution_m;
  const double columns = box.Width() * scale.longitude / resolution_m;
  return std::max(1.0, std::ceil(rows)) * std::max(1.0, std::ceil(columns));
}

absl::StatusOr<MapArea> ChooseArea(const AreaFlags& flags, double margin,
                                   const v1::GetMissionStatusResponse& status) {
  if (!flags.area.empty()) {
    FATHOM_ASSIGN_OR_RETURN(const GeoBox box, ParseBox(flags.area));
    return MapArea{.box = box};
  }
  if (!flags.center.empty()) {
    FATHOM_ASSIGN_OR_RETURN(const v1::GeodeticPoint center,
                            ParsePoint(flags.center));
    if (!(flags.size_m > 0)) {
      return UsageError(absl::InvalidArgumentError("--center needs --size-m"));
    }
    const v1::GeodeticPoint low =
        Offset(center, -flags.size_m / 2, -flags.size_m / 2);
    const v1::GeodeticPoint high =
        Offset(center, flags.size_m / 2, flags.size_m / 2);
    return MapArea{.box = {low.latitude_deg(), low.longitude_deg(),
                           high.latitude_deg(), high.longitude_deg()}};
  }
  if (!flags.survey.empty()) return AreaOfSurvey(flags.survey, margin);
  for (const v1::ActivityStatus& activity : status.activities()) {
    if (flags.activity_id.empty() ||
        activity.activity_id() == flags.activity_id) {
      const v1::ActivityParameters& p = activity.parameters();
      return MapArea{.box = BoxAround(p.south_west(), p.north_extent_m(),
                                      p.east_extent_m(), margin),
                     .cell_m = p.cell_size_m()};
    }
  }
  if (!flags.activity_id.empty()) {
    return absl::NotFoundError(
        absl::StrFormat("activity \"%s\": the mission has none of this name",
                        flags.activity_id));
  }
  return MapArea{.box = MissionBox(status.global_map().south_west(),
                                   status.global_map().north_west())};
}

v1::GetRegionRequest RegionRequest(const GeoBox& box, double resolution_m) {
  v1::GetRegionRequest request;
  request.mutable_south_west()->set_latitude_deg(box.south_deg);
  request.mutable_south_west()->set_longitude_deg(box.west_deg);
  request.mutable_north_east()->set_latitude_deg(box.north_deg);
  request.mutable_north_east()->set_longitude_deg(box.east_deg);
  request.set_resolution_m(resolution_m);
  return request;
}

}  // namespace fathom::client::cli
