#include "server/mission_tool.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_format.h"
#include "base/clock.h"
#include "base/status_macros.h"
#include "google/protobuf/struct.pb.h"
#include "google/protobuf/util/json_util.h"
#include "server/mission.h"
#include "storage/offline.h"

namespace fathom::server {
namespace {

constexpr int kExitFailed = 1;
constexpr int kExitMisuse = 2;
constexpr int kExitDamaged = 4;

// A result as pairs of name and value, in order.
class Result {
 public:
  void Text(const std::string& name, const std::string& value) {
    rows_.emplace_back(name, value);
    (*json_.mutable_fields())[name].set_string_value(value);
  }
  void Number(const std::string& name, double value) {
    rows_.emplace_back(name, absl::StrFormat("%.15g", value));
    (*json_.mutable_fields())[name].set_number_value(value);
  }
  void Count(const std::string& name, std::uint64_t value) {
    Number(name, static_cast<double>(value));
  }
  void List(const std::string& name, const std::vector<std::string>& values) {
    auto* list = (*json_.mutable_fields())[name].mutable_list_value();
    for (const std::string& value : values) {
      rows_.emplace_back(name, value);
      list->add_values()->set_string_value(value);
    }
  }

  void Print(bool as_json) const {
    if (as_json) {
      std::string text;
      google::protobuf::util::JsonPrintOptions options;
      options.add_whitespace = true;
      (void)google::protobuf::util::MessageToJsonString(json_, &text, options);
      absl::PrintF("%s", text);
      return;
    }
    for (const auto& [name, value] : rows_) {
      absl::PrintF("%-20s %s\n", name, value);
    }
  }

 private:
  std::vector<std::pair<std::string, std::string>> rows_;
  google::protobuf::Struct json_;
};

// DATA_LOSS with the result already told: the exit code alone.
absl::Status Damaged() { return absl::DataLossError(""); }

absl::Status Info(const std::string& path, Result& out) {
  FATHOM_ASSIGN_OR_RETURN(const storage::MissionInfo info,
                          storage::ReadInfo(path));
  out.Text("mission_id", info.metadata.mission_id);
  out.Text("name", info.metadata.name);
  out.Text("vertical_datum", info.metadata.vertical_datum);
  out.Number("south_west_latitude_deg",
             info.metadata.root_south_west.latitude_deg);
  out.Number("south_west_longitude_deg",
             info.metadata.root_south_west.longitude_deg);
  out.Number("north_west_latitude_deg",
             info.metadata.root_north_west.latitude_deg);
  out.Number("north_west_longitude_deg",
             info.metadata.root_north_west.longitude_deg);
  out.Number("min_cell_m", info.metadata.min_cell_m);
  out.Number("tolerance_m", info.metadata.tolerance_m);
  out.Count("max_cells", info.metadata.max_cells);
  out.Count("max_contacts", info.metadata.max_contacts);
  out.Number("format_version", info.format_version);
  out.Count("file_bytes", info.file_bytes);
  out.Count("wal_bytes", info.wal_bytes);
  out.Count("checkpoint_revision", info.checkpoint_revision);
  const auto count = [&out](const char* name,
                            const std::optional<std::uint64_t>& value) {
    if (value.has_value()) out.Count(name, *value);
  };
  count("tiles", info.tiles);
  count("activities", info.activities);
  count("contacts", info.contacts);
  count("history_rows", info.history_rows);
  count("journal_records", info.journal_records);
  out.List("damage", info.damage);
  return info.damage.empty() ? absl::OkStatus() : Damaged();
}

absl::Status Verify(const std::string& path, Result& out) {
  FATHOM_ASSIGN_OR_RETURN(const storage::Proof proof, storage::ProveFile(path));
  out.Text("sound", proof.problems.empty() ? "yes" : "no");
  out.Text("map_digest", proof.digest);
  out.Count("map_revision", proof.revision);
  out.Count("tiles", proof.tiles);
  out.Count("journal_records", proof.journal_records);
  out.Count("history_rows", proof.history_rows);
  out.List("problems", proof.problems);
  return proof.problems.empty() ? absl::OkStatus() : Damaged();
}

absl::Status Digest(const std::string& path, Result& out) {
  FATHOM_ASSIGN_OR_RETURN(const storage::Proof proof, storage::ProveFile(path));
  out.Text("map_digest", proof.digest);
  return proof.problems.empty() ? absl::OkStatus() : Damaged();
}

absl::Status RepairTo(const std::string& path, const std::string& to,
                      Result& out) {
  FATHOM_ASSIGN_OR_RETURN(const storage::Repair repair,
                          storage::RepairMission(path, to));
  out.Text("map_digest", repair.digest);
  out.Count("map_revision", repair.revision);
  out.Count("history_rows", repair.history_rows);
  out.List("left_out", repair.left_out);
  return absl::OkStatus();
}

absl::Status ExportTo(const std::string& path, const std::string& to,
                      Result& out) {
  FATHOM_ASSIGN_OR_RETURN(const storage::ExportedContacts counts,
                          storage::ExportFile(path, to));
  out.Count("points", counts.points);
  out.Count("tracks", counts.tracks);
  return absl::OkStatus();
}

storage::MigrationProgress ToldOnStandardError() {
  return {.tell = [](const std::string& line) {
    absl::FPrintF(stderr, "fathomd mission: %s\n", line);
  }};
}

absl::Status Compact(const std::string& path, Result& out) {
  FATHOM_ASSIGN_OR_RETURN(const std::uint64_t bytes,
                          storage::CompactMission(path, ToldOnStandardError()));
  out.Count("file_bytes", bytes);
  return absl::OkStatus();
}

struct ImportFlags {
  bool create = false;
  bool as_chart = false;
  std::optional<double> ageing_m2_per_day;
};

absl::Status ImportInto(const std::string& from, const std::string& into,
                        const ImportFlags& flags, Result& out) {
  storage::ImportOptions options;
  options.now = SystemClock().Now();
  options.as_chart = flags.as_chart;
  options.progress = ToldOnStandardError();
  if (flags.ageing_m2_per_day) {
    options.ageing_m2_s = *flags.ageing_m2_per_day / 86'400;
  }
  if (flags.create) options.create = RandomMissionId();
  FATHOM_ASSIGN_OR_RETURN(const storage::Import import,
                          storage::ImportMission(from, into, options));
  out.Text("map_digest", import.digest);
  out.Count("map_revision", import.revision);
  out.Count("leaves_before", import.merge.leaves_before);
  out.Count("leaves_written", import.merge.leaves_written);
  out.Count("leaves_kept", import.merge.leaves_kept);
  out.Count("leaves_after", import.merge.leaves_after);
  if (!import.backup.empty()) out.Text("backup", import.backup);
  out.List("left_out", import.left_out);
  return absl::OkStatus();
}

}  // namespace

int MissionToolMain(int argc, char** argv) {
  CLI::App app("Works on a mission file that no server holds.",
               "fathomd mission");
  app.require_subcommand(1);
  std::string path;
  std::string to;
  bool json = false;
  Result result;
  std::function<absl::Status()> run;
  const auto add = [&](const char* name, const char* about, bool writes,
                       std::function<absl::Status()> job) {
    CLI::App* verb = app.add_subcommand(name, about);
    verb->add_option("FILE", path, "The mission")->required();
    if (writes) verb->add_option("OUT", to, "The new file")->required();
    verb->add_flag("--json", json, "One JSON document");
    verb->callback([&run, job = std::move(job)] { run = job; });
    return verb;
  };
  add("info", "What it is and holds", false,
      [&] { return Info(path, result); });
  add("verify", "Prove it: structure, checksums, history, map", false,
      [&] { return Verify(path, result); });
  add("digest", "The digest of its map", false,
      [&] { return Digest(path, result); });
  add("repair", "Save all that can be read into a new mission", true,
      [&] { return RepairTo(path, to, result); });
  add("export", "Contact history as a GeoPackage, for GDAL and QGIS", true,
      [&] { return ExportTo(path, to, result); });
  add("compact", "Rewrite it without free pages, in place", false,
      [&] { return Compact(path, result); });
  ImportFlags flags;
  CLI::App* import_verb = app.add_subcommand(
      "import", "Merge the map of another mission into this one");
  import_verb->add_option("FROM", to, "The other mission")->required();
  import_verb->add_option("INTO", path, "The mission that takes it")
      ->required();
  import_verb->add_flag("--create", flags.create,
                        "Make INTO: a new mission with the square of FROM");
  import_verb->add_flag(
      "--as-chart", flags.as_chart,
      "As a-priori depths, not as measurements: may share evidence "
      "with INTO, fills only what is unknown there");
  import_verb->add_option("--ageing-m2-per-day", flags.ageing_m2_per_day,
                          "Variance that a depth gained per day of its age; by "
                          "default that of FROM");
  import_verb->add_flag("--json", json, "One JSON document");
  import_verb->callback(
      [&] { run = [&] { return ImportInto(to, path, flags, result); }; });
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitMisuse;
  }
  const absl::Status status = run();
  if (status.ok() || status.message().empty()) result.Print(json);
  if (status.ok()) return 0;
  if (!status.message().empty()) {
    absl::FPrintF(stderr, "fathomd mission: %s\n",
                  std::string(status.message()));
  }
  return absl::IsDataLoss(status) ? kExitDamaged : kExitFailed;
}

}  // namespace fathom::server
