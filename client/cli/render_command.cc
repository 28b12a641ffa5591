// fathom render: the map as a picture.

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
#include <optional>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/arguments.h"
#include "client/cli/exit_code.h"
#include "client/cli/geo_math.h"
#include "client/cli/picture.h"
#include "client/cli/points_file.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "client/proto_time.h"

namespace fathom::client::cli {
namespace {

// Cells along the longer side, if no resolution is asked for: near one a
// pixel of a panel.
constexpr double kDefaultCells = 800;

// Room left around an activity or survey, of its side.
constexpr double kMargin = 0.12;

struct RenderFlags {
  std::string out = "map.png";
  std::string area;
  std::string center;
  double size_m = 0;
  std::string activity_id;
  std::string survey;
  double resolution_m = 0;
  std::string track;
  std::string time;
  std::string title;
  int width_px = 1800;
};

struct View {
  GeoBox box;
  std::optional<Time> time = std::nullopt;
  // Of the activity shown, metres; finer than that shows nothing more.
  double cell_m = 0;
};

GeoBox BoxAround(const v1::GeodeticPoint& south_west, double north_m,
                 double east_m) {
  const v1::GeodeticPoint low =
      Offset(south_west, -kMargin * north_m, -kMargin * east_m);
  const v1::GeodeticPoint high =
      Offset(south_west, (1 + kMargin) * north_m, (1 + kMargin) * east_m);
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
absl::StatusOr<View> ViewOfSurvey(const std::string& path) {
  std::ifstream in(path);
  if (!in) {
    return FileError(
        absl::NotFoundError(absl::StrFormat("%s: cannot be opened", path)));
  }
  try {
    const auto survey = nlohmann::ordered_json::parse(in);
    const nlohmann::ordered_json& area = survey.at("area");
    View view;
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
    view.box = BoxAround(south_west, north_m, east_m);
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

absl::StatusOr<View> ChooseView(const RenderFlags& flags,
                                const v1::GetMissionStatusResponse& status) {
  if (!flags.area.empty()) {
    FATHOM_ASSIGN_OR_RETURN(const GeoBox box, ParseBox(flags.area));
    return View{.box = box};
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
    return View{.box = {low.latitude_deg(), low.longitude_deg(),
                        high.latitude_deg(), high.longitude_deg()}};
  }
  if (!flags.survey.empty()) return ViewOfSurvey(flags.survey);
  for (const v1::ActivityStatus& activity : status.activities()) {
    if (flags.activity_id.empty() ||
        activity.activity_id() == flags.activity_id) {
      const v1::ActivityParameters& p = activity.parameters();
      return View{.box = BoxAround(p.south_west(), p.north_extent_m(),
                                   p.east_extent_m()),
                  .cell_m = p.cell_size_m()};
    }
  }
  if (!flags.activity_id.empty()) {
    return absl::NotFoundError(
        absl::StrFormat("activity \"%s\": the mission has none of this name",
                        flags.activity_id));
  }
  return View{.box = MissionBox(status.global_map().south_west(),
                                status.global_map().north_west())};
}

v1::GetRegionRequest RegionRequest(const View& view, double resolution_m) {
  const GeoBox& box = view.box;
  v1::GetRegionRequest request;
  request.mutable_south_west()->set_latitude_deg(box.south_deg);
  request.mutable_south_west()->set_longitude_deg(box.west_deg);
  request.mutable_north_east()->set_latitude_deg(box.north_deg);
  request.mutable_north_east()->set_longitude_deg(box.east_deg);
  if (!(resolution_m > 0)) {
    const MetersPerDegree scale =
        MetersPerDegreeAt((box.south_deg + box.north_deg) / 2);
    const double side_m =
        std::max((box.north_deg - box.south_deg) * scale.latitude,
                 box.Width() * scale.longitude);
    resolution_m = std::max({0.1, view.cell_m, side_m / kDefaultCells});
  }
  request.set_resolution_m(resolution_m);
  return request;
}

std::string Subtitle(const PictureInput& picture, double resolution_m,
                     Time contacts_time) {
  std::string text = absl::StrFormat(
      "%d × %d cells of %s   ·   map revision %s", picture.region.columns,
      picture.region.rows,
      resolution_m >= 1000 ? absl::StrFormat("%.3g km", resolution_m / 1000)
                           : absl::StrFormat("%.3g m", resolution_m),
      CountText(picture.region.stamp.map_revision()));
  if (picture.region.stamp.as_of().seconds() != 0) {
    absl::StrAppendFormat(&text, ", evidence to %s",
                          TimeText(picture.region.stamp.as_of()));
  }
  if (!picture.contacts.empty()) {
    absl::StrAppendFormat(&text, "   ·   %d contacts at %s",
                          picture.contacts.size(), FormatTime(contacts_time));
  }
  return text;
}

absl::Status Run(const Session& session, const RenderFlags& flags) {
  PictureInput picture;
  if (!flags.track.empty()) {
    FATHOM_ASSIGN_OR_RETURN(picture.track, ReadPlaces(flags.track));
  }
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::GetMissionStatusResponse status,
                          client->GetMissionStatus());
  FATHOM_ASSIGN_OR_RETURN(View view, ChooseView(flags, status));
  if (!flags.time.empty()) {
    FATHOM_ASSIGN_OR_RETURN(view.time, ParseMoment(flags.time, session.Now()));
  }
  const v1::GetRegionRequest request = RegionRequest(view, flags.resolution_m);
  FATHOM_ASSIGN_OR_RETURN(picture.region, client->GetRegion(request));
  v1::ListContactsRequest contacts_request;
  if (view.time.has_value()) {
    *contacts_request.mutable_time() = ToProto(*view.time);
  }
  FATHOM_ASSIGN_OR_RETURN(const v1::ListContactsResponse contacts,
                          client->ListContacts(contacts_request));
  picture.contacts.assign(contacts.contacts().begin(),
                          contacts.contacts().end());
  picture.title =
      flags.title.empty() ? "Fathom: " + status.name() : flags.title;
  picture.vertical_datum = status.vertical_datum();
  picture.width_px = flags.width_px;
  picture.subtitle = Subtitle(picture, request.resolution_m(),
                              std::chrono::floor<std::chrono::seconds>(
                                  view.time.value_or(session.Now())));
  if (const absl::Status drawn = DrawPicture(picture, flags.out); !drawn.ok()) {
    // A file that cannot be written is marked already.
    return ExitCodeOf(drawn) == ExitCode::kBadFile ? drawn : UsageError(drawn);
  }
  if (session.json) {
    nlohmann::ordered_json document;
    document["picture"] = flags.out;
    document["rows"] = picture.region.rows;
    document["columns"] = picture.region.columns;
    document["resolution_m"] = request.resolution_m();
    document["contacts"] = contacts.contacts_size();
    document["track_points"] = picture.track.size();
    document["stamp"] = ToJson(picture.region.stamp);
    PrintJson(document);
  } else {
    Print(flags.out + "\n");
  }
  return absl::OkStatus();
}

}  // namespace

void AddRender(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "render", "The map as a picture: depth and std side by side, PNG");
  const auto f = std::make_shared<RenderFlags>();
  verb->add_option("--out,-o", f->out, "The PNG file to write")
      ->capture_default_str();
  CLI::Option* area =
      verb->add_option("--area", f->area, "What to show: S,W,N,E in degrees");
  CLI::Option* center =
      verb->add_option("--center", f->center,
                       "What to show: LAT,LON of the middle, with --size-m");
  verb->add_option("--size-m", f->size_m, "Side of the square, metres")
      ->needs(center);
  CLI::Option* activity = verb->add_option(
      "--activity", f->activity_id, "What to show: this activity's area");
  CLI::Option* survey = verb->add_option(
      "--survey", f->survey,
      "What to show: the area and end time in the JSON of fathom-feeder run");
  area->excludes(center)->excludes(activity)->excludes(survey);
  center->excludes(activity)->excludes(survey);
  activity->excludes(survey);
  verb->add_option("--resolution-m", f->resolution_m,
                   "Side of a cell, metres (default: 800 cells along the "
                   "longer side)")
      ->check(CLI::PositiveNumber);
  verb->add_option("--track", f->track,
                   "CSV file with latitude_deg and longitude_deg of the "
                   "vehicle's way");
  verb->add_option("--time", f->time,
                   "Where the contacts are at this time (default: now, or the "
                   "survey's end)");
  verb->add_option("--title", f->title, "Heading (default: mission's name)");
  verb->add_option("--width-px", f->width_px, "Width of the picture, pixels")
      ->check(CLI::Range(600, 8000))
      ->capture_default_str();
  verb->footer(
      "\nWithout an area: the newest activity's, or the whole mission. Land "
      "is tan, what\nnobody knows is hatched grey.\n"
      "\nExamples:\n"
      "  fathom render --activity bay --track track.csv --out bay.png\n"
      "  fathom render --area 40,-75,44,-68 --title \"New England\"\n"
      "  fathom render --center 41.6,-71.4 --size-m 2000 --resolution-m 2");
  verb->callback([&session, f]() {
    session.run = [&session, f]() { return Run(session, *f); };
  });
}

}  // namespace fathom::client::cli
