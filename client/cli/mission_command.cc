// fathom mission: what the mission is and allows; copies and proofs of its
// file.

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/mission_file.h"
#include "client/cli/session.h"
#include "client/cli/text.h"

namespace fathom::client::cli {
namespace {

absl::Status Info(const Session& session) {
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(v1::GetMissionStatusResponse status,
                          client->GetMissionStatus());
  if (session.json) {
    status.clear_activities();
    PrintJson(ToJson(status));
    return absl::OkStatus();
  }
  const v1::GlobalMapStatus& map = status.global_map();
  const v1::Limits& limits = status.limits();
  std::string text = absl::StrFormat(
      "mission       %s  (%s)\ncreated       %s\ndatum         %s\n"
      "area          SW %s\n              NW %s\n"
      "finest cell   %.4g m (level %d)\ntolerance     %.3g m\n\nlimits\n",
      status.name(), status.mission_id(), TimeText(status.created_time()),
      status.vertical_datum(), PlaceText(map.south_west()),
      PlaceText(map.north_west()), map.min_cell_m(), map.max_level(),
      map.tolerance_m());
  const struct {
    const char* name;
    std::uint64_t value;
  } kRows[] = {{"global cells", map.max_cells()},
               {"contacts", status.contacts().max_contacts()},
               {"message bytes", limits.max_message_bytes()},
               {"beams a ping", limits.max_beams_per_ping()},
               {"points a query", limits.max_points_per_query()},
               {"waypoints", limits.max_waypoints()},
               {"reports a request", limits.max_reports_per_request()},
               {"cells a chart tile", limits.max_tile_cells()},
               {"cells a region", limits.max_region_cells()},
               {"open activities", limits.max_open_activities()},
               {"cells an activity", limits.max_local_cells()},
               {"ingest streams", limits.max_ingest_streams()},
               {"watchers", limits.max_watchers()},
               {"pending ingest", limits.max_pending_ingest()}};
  for (const auto& row : kRows) {
    absl::StrAppendFormat(&text, "  %-20s %15s\n", row.name,
                          CountText(row.value));
  }
  absl::StrAppendFormat(&text, "\n%-14s %9s %8s %12s %12s\n", "contact class",
                        "radius m", "keel m", "q m2/s3", "stale after");
  for (const v1::ContactClassParameters& c : status.contacts().classes()) {
    absl::StrAppendFormat(&text, "%-14s %9.4g %8.3g %12.2g %12s\n",
                          ClassText(c.contact_class()), c.radius_m(),
                          c.keel_depth_m(), c.process_noise_m2_s3(),
                          SpanText(c.stale_after_s()));
  }
  Print(text);
  return absl::OkStatus();
}

absl::Status Save(const Session& session, const std::string& file_name) {
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  v1::SaveMissionRequest request;
  request.set_file_name(file_name);
  FATHOM_ASSIGN_OR_RETURN(const v1::SaveMissionResponse saved,
                          client->SaveMission(request));
  if (session.json) {
    PrintJson(ToJson(saved));
  } else {
    Print(
        absl::StrFormat("saved %s beside the mission: %s, revision %d, "
                        "digest %s\n",
                        file_name, BytesText(saved.file_bytes()),
                        saved.map_revision(), saved.map_digest()));
  }
  return absl::OkStatus();
}

absl::Status Verify(const Session& session) {
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  FATHOM_ASSIGN_OR_RETURN(const v1::VerifyMissionResponse proof,
                          client->VerifyMission());
  if (session.json) {
    PrintJson(ToJson(proof));
  } else {
    Print(absl::StrFormat("mission file %s, digest %s\n",
                          proof.ok() ? "is sound" : "is DAMAGED",
                          proof.map_digest()));
    for (const std::string& problem : proof.problems()) {
      Print("  " + problem + "\n");
    }
  }
  return proof.ok() ? absl::OkStatus()
                    : absl::DataLossError("the mission file is damaged");
}

// A verb for files alone.
void AddFileVerb(CLI::App& mission, Session& session, const std::string& name,
                 const std::string& about, bool has_output) {
  CLI::App* verb = mission.add_subcommand(name, about);
  const auto files = std::make_shared<std::vector<std::string>>();
  verb->add_option(
          "FILE", *files,
          has_output ? "The mission, and the file to make" : "The mission")
      ->required()
      ->expected(has_output ? 2 : 1);
  verb->callback([&session, name, files]() {
    session.run = [&session, name, files]() {
      std::vector<std::string> arguments = {name};
      arguments.insert(arguments.end(), files->begin(), files->end());
      return WorkOnMissionFile(session, arguments);
    };
  });
}

// `fathom mission import FROM INTO`; fathomd knows the flags' meaning.
void AddImport(CLI::App& mission, Session& session) {
  CLI::App* verb = mission.add_subcommand(
      "import", "Merge the map of another mission's file into one");
  const auto arguments = std::make_shared<std::vector<std::string>>();
  verb->add_option("FILES", *arguments, "The other mission, and who takes it")
      ->required()
      ->expected(2)
      ->type_name("FROM INTO");
  const auto ageing = std::make_shared<std::string>();
  const auto create = std::make_shared<bool>(false);
  const auto as_chart = std::make_shared<bool>(false);
  verb->add_flag("--create", *create,
                 "Make INTO: a new mission with the square of FROM");
  verb->add_flag("--as-chart", *as_chart,
                 "As a-priori depths, not as measurements: may share evidence "
                 "with INTO, fills only what is unknown there");
  verb->add_option("--ageing-m2-per-day", *ageing,
                   "Variance that a depth gained per day of its age; by "
                   "default that of FROM");
  verb->callback([&session, arguments, ageing, create, as_chart]() {
    session.run = [&session, arguments, ageing, create, as_chart]() {
      std::vector<std::string> all = {"import"};
      all.insert(all.end(), arguments->begin(), arguments->end());
      if (*create) all.emplace_back("--create");
      if (*as_chart) all.emplace_back("--as-chart");
      if (!ageing->empty()) {
        all.insert(all.end(), {"--ageing-m2-per-day", *ageing});
      }
      return WorkOnMissionFile(session, all);
    };
  });
}

}  // namespace

void AddMission(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "mission", "What the mission is and allows; copy and prove its file");
  verb->require_subcommand(1);
  verb->footer(
      "\nExamples:\n  fathom mission info\n"
      "  fathom mission save before-dive.fathom\n"
      "  fathom mission verify --json\n"
      "  fathom mission verify --file old.fathom\n"
      "  fathom mission export old.fathom tracks.gpkg\n"
      "  fathom mission import other.fathom mine.fathom");

  const auto file = std::make_shared<std::string>();
  const auto add_file = [&file](CLI::App* to) {
    to->add_option("--file", *file,
                   "Of this file, which no server holds, not of the server's")
        ->type_name("FILE");
  };
  CLI::App* info = verb->add_subcommand(
      "info", "Identity, area, datum, limits, contact classes");
  add_file(info);
  info->callback([&session, file]() {
    session.run = [&session, file]() {
      return file->empty() ? Info(session)
                           : WorkOnMissionFile(session, {"info", *file});
    };
  });

  CLI::App* save = verb->add_subcommand(
      "save", "Write a consistent copy beside the mission while it runs");
  const auto file_name = std::make_shared<std::string>();
  save->add_option("FILE_NAME", *file_name, "Name without directories")
      ->required();
  save->callback([&session, file_name]() {
    session.run = [&session, file_name]() { return Save(session, *file_name); };
  });

  CLI::App* verify =
      verb->add_subcommand("verify", "Check the mission file's integrity");
  add_file(verify);
  verify->callback([&session, file]() {
    session.run = [&session, file]() {
      return file->empty() ? Verify(session)
                           : WorkOnMissionFile(session, {"verify", *file});
    };
  });

  AddFileVerb(*verb, session, "digest", "The digest of a file's map", false);
  AddFileVerb(*verb, session, "repair",
              "Save all that can be read of a file into a new mission", true);
  AddFileVerb(*verb, session, "compact",
              "Rewrite a file without its free pages, in place", false);
  AddFileVerb(*verb, session, "export",
              "A file's contact history as a GeoPackage, for GDAL and QGIS",
              true);
  AddImport(*verb, session);
}

}  // namespace fathom::client::cli
