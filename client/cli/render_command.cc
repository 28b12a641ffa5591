// fathom render: the map as a picture.

#include <algorithm>
#include <memory>
#include <optional>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/arguments.h"
#include "client/cli/exit_code.h"
#include "client/cli/map_area.h"
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

absl::Status Run(const Session& session, const RenderFlags& flags) {
  PictureInput picture;
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
