// fathom watch: what changes, as it changes.

#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>

#include "base/status_macros.h"
#include "client/cli/map_area.h"
#include "client/cli/session.h"
#include "client/cli/trajectory_question.h"
#include "client/cli/watch_picture.h"

namespace fathom::client::cli {
namespace {

constexpr char kHomeAndClear[] = "\x1b[H\x1b[2J";

struct WatchFlags {
  AreaFlags area;
  double resolution_m = 10;
  TrajectoryFlags trajectory;
  double hysteresis = 0.1;
  // 0: for ever.
  std::uint64_t events = 0;
};

// Follows a watch: `picture` of what was told so far in a terminal, a line for
// each event otherwise, a JSON document for each with --json.
template <typename Watch, typename Response>
absl::Status Follow(const Session& session, const WatchFlags& flags,
                    Watch& watch,
                    const std::function<std::string(const Response&)>& take) {
  const bool terminal = !session.json && isatty(STDOUT_FILENO) == 1;
  for (std::uint64_t n = 0; flags.events == 0 || n < flags.events; ++n) {
    FATHOM_ASSIGN_OR_RETURN(const Response event, watch.Next());
    if (session.json) {
      PrintJsonLine(ToJson(event));
      continue;
    }
    if (!terminal) {
      Print(EventText(event));
      std::fflush(stdout);
      continue;
    }
    // A picture is drawn when it is whole.
    const std::string picture = take(event);
    if (picture.empty()) continue;
    Print(kHomeAndClear + picture + EventText(event));
    std::fflush(stdout);
  }
  return absl::OkStatus();
}

absl::Status WatchArea(const Session& session, const WatchFlags& flags) {
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::GetMissionStatusResponse status,
                          client->GetMissionStatus());
  FATHOM_ASSIGN_OR_RETURN(const MapArea area,
                          ChooseArea(flags.area, /*margin=*/0, status));
  v1::WatchRegionRequest request;
  *request.mutable_region() = RegionRequest(area.box, flags.resolution_m);
  const auto watch = client->WatchRegion(request);
  RegionPicture picture;
  return Follow<RegionWatch, v1::WatchRegionResponse>(
      session, flags, *watch, [&](const v1::WatchRegionResponse& event) {
        picture.Take(event);
        return event.has_progress() ? picture.Text() : std::string();
      });
}

absl::Status WatchContacts(const Session& session, const WatchFlags& flags) {
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  const auto watch = client->WatchContacts();
  ContactsPicture picture;
  return Follow<ContactsWatch, v1::WatchContactsResponse>(
      session, flags, *watch, [&](const v1::WatchContactsResponse& event) {
        picture.Take(event);
        return event.has_progress() ? picture.Text() : std::string();
      });
}

absl::Status WatchPath(const Session& session, const WatchFlags& flags) {
  v1::WatchTrajectoryRequest request;
  FATHOM_ASSIGN_OR_RETURN(*request.mutable_trajectory(),
                          TrajectoryOf(flags.trajectory, session.Now()));
  request.set_hysteresis(flags.hysteresis);
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  const auto watch = client->WatchTrajectory(request);
  const double confidence = flags.trajectory.question.confidence;
  std::string verdict;
  return Follow<TrajectoryWatch, v1::WatchTrajectoryResponse>(
      session, flags, *watch, [&](const v1::WatchTrajectoryResponse& event) {
        if (event.has_verdict()) {
          verdict = VerdictText(confidence, event.verdict());
        }
        return verdict;
      });
}

CLI::App* AddKind(CLI::App& verb, Session& session, const char* name,
                  const char* help, const std::shared_ptr<WatchFlags>& flags,
                  absl::Status (*run)(const Session&, const WatchFlags&)) {
  CLI::App* kind = verb.add_subcommand(name, help);
  kind->add_option("--events", flags->events,
                   "End after so many events (default: never)");
  kind->callback([&session, flags, run]() {
    session.run = [&session, flags, run]() { return run(session, *flags); };
  });
  return kind;
}

}  // namespace

void AddWatch(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "watch", "What changes, as it changes: a region, contacts, a trajectory");
  verb->require_subcommand(1);
  verb->footer(
      "\nFirst the state, then every change, until Ctrl-C. In a terminal the "
      "picture is\ndrawn anew; else each event is a line, with --json a JSON "
      "document. After a cut\nit connects again and goes on where it was.");
  const auto f = std::make_shared<WatchFlags>();

  CLI::App* region = AddKind(*verb, session, "region",
                             "Depths of an area, tile by tile", f, WatchArea);
  AddAreaFlags(*region, f->area);
  region
      ->add_option("--resolution-m", f->resolution_m,
                   "Side of a cell of the answer, metres")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();

  AddKind(*verb, session, "contacts", "Contacts after each report", f,
          WatchContacts);

  CLI::App* trajectory =
      AddKind(*verb, session, "trajectory",
              "Whether the vehicle can still go there: alerts", f, WatchPath);
  AddTrajectoryOptions(*trajectory, f->trajectory);
  trajectory
      ->add_option("--hysteresis", f->hysteresis,
                   "An alert is cleared when P has fallen this far below "
                   "--confidence")
      ->capture_default_str();
  trajectory->footer(
      "\nExamples:\n"
      "  fathom watch trajectory plan.csv --radius-m 5 --clearance-m 3\n"
      "  fathom watch trajectory plan.csv --json | grep '\"alert\":true'");
}

}  // namespace fathom::client::cli
