// fathom render: the map as a picture.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <optional>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/arguments.h"
#include "client/cli/cell_layers.h"
#include "client/cli/exit_code.h"
#include "client/cli/geo_math.h"
#include "client/cli/map_area.h"
#include "client/cli/picture.h"
#include "client/cli/points_file.h"
#include "client/cli/raster.h"
#include "client/cli/raster_sampling.h"
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
  std::string show = "depth,std";
  std::string against;
  std::string against_server;
  std::string against_positive = "auto";
  AreaFlags area;
  double resolution_m = 0;
  std::string track;
  std::string time;
  std::string title;
  int width_px = 1800;
};

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

absl::StatusOr<std::vector<PanelKind>> PanelsOf(const RenderFlags& flags) {
  static const std::map<std::string, PanelKind> kNames = {
      {"depth", PanelKind::kDepth},
      {"std", PanelKind::kStd},
      {"age", PanelKind::kAge},
      {"layer", PanelKind::kLayer},
      {"difference", PanelKind::kDifference}};
  std::vector<PanelKind> panels;
  for (const std::string& name : SplitList(flags.show, ',')) {
    const auto found = kNames.find(name);
    if (found == kNames.end()) {
      return UsageError(absl::InvalidArgumentError(absl::StrFormat(
          "show: \"%s\" is none; choose from depth, std, age, layer, "
          "difference",
          name)));
    }
    if (std::find(panels.begin(), panels.end(), found->second) !=
        panels.end()) {
      return UsageError(absl::InvalidArgumentError(
          absl::StrFormat("show: \"%s\" is there twice", name)));
    }
    panels.push_back(found->second);
  }
  const bool difference = std::find(panels.begin(), panels.end(),
                                    PanelKind::kDifference) != panels.end();
  const bool other = !flags.against.empty() || !flags.against_server.empty();
  if (difference && !other) {
    return UsageError(absl::InvalidArgumentError(
        "show: difference to what? Say --against FILE or --against-server "
        "HOST:PORT"));
  }
  // Naming another map asks for the difference.
  if (other && !difference) panels.push_back(PanelKind::kDifference);
  if (panels.size() > 4) {
    return UsageError(
        absl::InvalidArgumentError("show: at most four panels fit"));
  }
  return panels;
}

// The other map's depth at each cell of `region`, metres; NaN: not known.
absl::StatusOr<std::vector<float>> DepthsAgainst(
    const Session& session, const RenderFlags& flags,
    const v1::GetRegionRequest& request, const Region& region) {
  if (!flags.against_server.empty()) {
    Session other = session;
    other.server = flags.against_server;
    FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                            other.Connect());
    FATHOM_ASSIGN_OR_RETURN(Region there, client->GetRegion(request));
    return std::move(there.depth_m);
  }
  RasterOptions options{
      .path = flags.against,
      .positive = flags.against_positive == "up"     ? Positive::kUp
                  : flags.against_positive == "down" ? Positive::kDown
                                                     : Positive::kAuto,
      // The difference asks for depths alone.
      .std_m = 1};
  const double south_deg =
      region.north_west.latitude_deg() - region.latitude_step_deg * region.rows;
  const double width_deg = region.longitude_step_deg * region.columns;
  options.clip =
      GeoBox{std::max(-90.0, south_deg), region.north_west.longitude_deg(),
             region.north_west.latitude_deg(),
             WrapLongitude(region.north_west.longitude_deg() + width_deg)};
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<DepthRaster> raster,
                          DepthRaster::Open(options));
  return DepthsAt(*raster, region);
}

nlohmann::ordered_json DifferenceJson(const std::vector<float>& difference_m) {
  std::uint64_t cells = 0;
  double sum = 0, squares = 0, most = 0;
  for (const float value : difference_m) {
    if (!std::isfinite(value)) continue;
    ++cells;
    sum += value;
    squares += double{value} * value;
    most = std::max(most, std::abs(double{value}));
  }
  nlohmann::ordered_json json;
  json["cells"] = cells;
  json["mean_m"] = nullptr;
  json["rms_m"] = nullptr;
  json["most_m"] = nullptr;
  if (cells > 0) {
    const auto n = static_cast<double>(cells);
    json["mean_m"] = sum / n;
    json["rms_m"] = std::sqrt(squares / n);
    json["most_m"] = most;
  }
  return json;
}

absl::Status Run(const Session& session, const RenderFlags& flags) {
  PictureInput picture;
  FATHOM_ASSIGN_OR_RETURN(picture.panels, PanelsOf(flags));
  if (!flags.track.empty()) {
    FATHOM_ASSIGN_OR_RETURN(picture.track, ReadPlaces(flags.track));
  }
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::GetMissionStatusResponse status,
                          client->GetMissionStatus());
  FATHOM_ASSIGN_OR_RETURN(MapArea view,
                          ChooseArea(flags.area, kMargin, status));
  if (!flags.time.empty()) {
    FATHOM_ASSIGN_OR_RETURN(view.time, ParseMoment(flags.time, session.Now()));
  }
  const v1::GetRegionRequest request = RegionRequest(
      view.box,
      flags.resolution_m > 0
          ? flags.resolution_m
          : std::max({0.1, view.cell_m, view.LongerSideM() / kDefaultCells}));
  FATHOM_ASSIGN_OR_RETURN(picture.region, client->GetRegion(request));
  const auto shows = [&](PanelKind kind) {
    return std::find(picture.panels.begin(), picture.panels.end(), kind) !=
           picture.panels.end();
  };
  if (shows(PanelKind::kLayer)) {
    FATHOM_ASSIGN_OR_RETURN(
        picture.layers,
        FetchCellLayers(*client, status, request, picture.region));
  }
  if (shows(PanelKind::kDifference)) {
    FATHOM_ASSIGN_OR_RETURN(
        picture.difference_m,
        DepthsAgainst(session, flags, request, picture.region));
    for (std::size_t i = 0; i < picture.difference_m.size(); ++i) {
      // Land has a height in the map, but it is no sea floor.
      picture.difference_m[i] =
          picture.region.kind[i] == v1::EVIDENCE_KIND_LAND
              ? std::numeric_limits<float>::quiet_NaN()
              : picture.region.depth_m[i] - picture.difference_m[i];
    }
    picture.against =
        flags.against.empty()
            ? flags.against_server
            : std::filesystem::path(flags.against).filename().string();
  }
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
    if (shows(PanelKind::kDifference)) {
      document["difference"] = DifferenceJson(picture.difference_m);
    }
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
      "render",
      "The map as a picture (PNG): depth, std, age, layers, differences");
  const auto f = std::make_shared<RenderFlags>();
  verb->add_option("--out,-o", f->out, "The PNG file to write")
      ->capture_default_str();
  verb->add_option("--show,--mode", f->show,
                   "One to four of depth,std,age,layer,difference, side by "
                   "side")
      ->capture_default_str();
  CLI::Option* against = verb->add_option(
      "--against", f->against,
      "Also the difference to this raster of depths or elevations (as "
      "fathom export writes, or any chart)");
  verb->add_option("--against-server", f->against_server,
                   "Also the difference to the mission of this server")
      ->excludes(against);
  verb->add_option("--against-positive", f->against_positive,
                   "How the raster's values count: up, down, or auto as it "
                   "says")
      ->check(CLI::IsMember({"auto", "up", "down"}))
      ->needs(against);
  AddAreaFlags(*verb, f->area);
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
      "is tan, what\nnobody knows is hatched grey. Differences are this map's "
      "depth less the other's:\norange where this map is shoaler, blue where "
      "it is deeper.\n"
      "\nExamples:\n"
      "  fathom render --activity bay --track track.csv --out bay.png\n"
      "  fathom render --area 40,-75,44,-68 --title \"New England\"\n"
      "  fathom render --show depth,std,age,layer --out all.png\n"
      "  fathom render --show depth --against etopo.tif --out bay.png\n"
      "  fathom render --center 41.6,-71.4 --size-m 2000 --resolution-m 2");
  verb->callback([&session, f]() {
    session.run = [&session, f]() { return Run(session, *f); };
  });
}

}  // namespace fathom::client::cli
