#include "storage/offline.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/contact_table.h"
#include "storage/file_lock.h"
#include "storage/history_reader.h"
#include "storage/history_replay.h"
#include "storage/history_table.h"
#include "storage/loader.h"
#include "storage/mission_file.h"
#include "storage/restore.h"
#include "storage/schema.h"
#include "storage/sqlite.h"

namespace fathom::storage {
namespace {

// Rows of history in one transaction of a repair.
constexpr std::size_t kHistoryRowsPerCommit = 10'000;

// A mission that nobody else works on, open for reading.
struct ReadMission {
  FileLock lock;
  Connection connection;
};

absl::StatusOr<ReadMission> OpenToRead(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    return absl::NotFoundError(
        absl::StrFormat("%s: no such mission file", path));
  }
  FATHOM_ASSIGN_OR_RETURN(FileLock lock, FileLock::Acquire(path));
  FATHOM_RETURN_IF_ERROR(CheckHeader(path));
  FATHOM_ASSIGN_OR_RETURN(Connection connection,
                          Connection::Open(path, Connection::Mode::kReadOnly));
  FATHOM_RETURN_IF_ERROR(CheckVersion(connection));
  FATHOM_RETURN_IF_ERROR(connection.Execute("PRAGMA cell_size_check = ON"));
  return ReadMission{std::move(lock), std::move(connection)};
}

std::uint64_t SizeOf(const std::string& path) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  return error ? 0 : size;
}

// What the journal adds to the history: nothing where the mission was closed
// cleanly.
absl::StatusOr<std::vector<ContactHistoryRow>> ReplayedHistory(
    Connection& connection) {
  FATHOM_ASSIGN_OR_RETURN(const std::int64_t segments,
                          connection.QueryInt("SELECT count(*) FROM journal"));
  if (segments == 0) return std::vector<ContactHistoryRow>();
  FATHOM_ASSIGN_OR_RETURN(const Loaded loaded,
                          LoadContactsAndJournal(connection));
  return ReplayHistory(loaded);
}

// What the blocks hold, and what the journal adds to the contacts and to that.
struct HistoryCount {
  std::int64_t rows = 0;
  std::uint64_t more_contacts = 0;
};

absl::StatusOr<HistoryCount> CountHistory(Connection& connection,
                                          int format_version) {
  HistoryCount count;
  if (format_version < kFirstBlockVersion) {
    FATHOM_ASSIGN_OR_RETURN(
        count.rows,
        connection.QueryInt("SELECT count(*) FROM contact_history"));
    return count;
  }
  FATHOM_ASSIGN_OR_RETURN(
      count.rows,
      connection.QueryInt("SELECT estimate_count FROM contact_history_total"));
  FATHOM_ASSIGN_OR_RETURN(const std::vector<ContactHistoryRow> replayed,
                          ReplayedHistory(connection));
  FATHOM_ASSIGN_OR_RETURN(const HistoryTails tails,
                          FindTails(connection, replayed));
  FATHOM_ASSIGN_OR_RETURN(ContactTable contacts,
                          ContactTable::Create(connection));
  for (const auto& [key, tail] : tails) {
    count.rows += static_cast<std::int64_t>(tail.rows.size());
    FATHOM_ASSIGN_OR_RETURN(const auto number, contacts.FindNumber(key));
    if (!number.has_value()) {
      ++count.more_contacts;
    } else if (tail.cut.has_value()) {
      FATHOM_ASSIGN_OR_RETURN(
          const HistoryBlocks cut,
          FindBlocksOf(connection, *number, key, *tail.cut, Time::max()));
      FATHOM_RETURN_IF_ERROR(ReadBlocks(connection, cut, {}, *tail.cut,
                                        Time::max(),
                                        [&count](const ContactHistoryRow&) {
                                          --count.rows;
                                          return true;
                                        })
                                 .status());
    }
  }
  return count;
}

// Copies what can be decoded of the history. Closing `to` writes what waits.
absl::Status CopyHistory(Connection& from,
                         const std::vector<ContactHistoryRow>& replayed,
                         MissionFile& to, Repair& repair) {
  Batch batch;
  const auto take = [&](const ContactHistoryRow& row) -> absl::Status {
    batch.contact_history.push_back(row);
    ++repair.history_rows;
    if (batch.contact_history.size() < kHistoryRowsPerCommit) {
      return absl::OkStatus();
    }
    FATHOM_RETURN_IF_ERROR(to.Commit(batch));
    batch = Batch();
    return absl::OkStatus();
  };
  const auto leave_out = [&repair](const absl::Status& status) {
    repair.left_out.push_back(std::string(status.message()));
    return absl::OkStatus();
  };
  FATHOM_RETURN_IF_ERROR(ReadWholeHistory(from, replayed, take, leave_out));
  return to.Commit(batch);
}

// Half a file is worse than none.
void RemoveMission(const std::string& path) {
  std::error_code ignored;
  for (const char* end : {"", "-wal", "-shm"}) {
    std::filesystem::remove(path + end, ignored);
  }
}

// Positions of this kind say which missions were merged into one.
constexpr std::string_view kMissionPrefix = "mission:";

// The missions whose evidence is in one.
std::set<std::string> Ancestors(const Loaded& loaded) {
  std::set<std::string> ids = {loaded.metadata.mission_id};
  for (const SourcePosition& position : loaded.source_positions) {
    const std::string& source = position.source.value;
    if (position.stream == StreamKind::kImports &&
        source.starts_with(kMissionPrefix)) {
      ids.insert(source.substr(kMissionPrefix.size()));
    }
  }
  return ids;
}

// What is merged: the other mission's map with every activity completed.
struct OtherMission {
  MissionMetadata metadata;
  std::set<std::string> ancestors;
  std::shared_ptr<const map::ObstacleMapView> view;
  std::vector<std::string> damage;
};

absl::StatusOr<OtherMission> ReadOther(const std::string& path) {
  FATHOM_ASSIGN_OR_RETURN(ReadMission mission, OpenToRead(path));
  FATHOM_ASSIGN_OR_RETURN(Loaded loaded, LoadMission(mission.connection));
  OtherMission other{.metadata = loaded.metadata,
                     .ancestors = Ancestors(loaded),
                     .view = nullptr,
                     .damage = loaded.damage};
  FATHOM_ASSIGN_OR_RETURN(const map::MissionOptions options,
                          OptionsOf(loaded.metadata));
  FATHOM_ASSIGN_OR_RETURN(const RestoredMap restored,
                          RestoreMap(std::move(loaded), options));
  other.view = restored.map->View();
  for (const auto& activity : other.view->activities()) {
    if (!activity->open()) continue;
    FATHOM_RETURN_IF_ERROR(
        restored.map->Complete(activity->id, /*discard=*/false).status());
  }
  other.view = restored.map->View();
  return other;
}

absl::Status CheckUnrelated(const OtherMission& other, const Loaded& into) {
  const std::string& id = other.metadata.mission_id;
  for (const std::string& held : Ancestors(into)) {
    if (!other.ancestors.contains(held)) continue;
    if (held == into.metadata.mission_id) {
      return absl::FailedPreconditionError(absl::StrFormat(
          "mission_id=%s is or holds the mission that it is to be merged into; "
          "its evidence would count twice (as a chart it may come)",
          id));
    }
    return absl::AlreadyExistsError(absl::StrFormat(
        "evidence of mission_id=%s is there already and would count twice (as "
        "a chart it may come)",
        held));
  }
  return absl::OkStatus();
}

absl::Status CheckFits(const OtherMission& other, const MissionMetadata& into,
                       const ImportOptions& options) {
  if (options.ageing_m2_s.has_value() &&
      !(*options.ageing_m2_s >= 0 && std::isfinite(*options.ageing_m2_s))) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "ageing_m2_s=%g must be finite and >= 0", *options.ageing_m2_s));
  }
  if (other.metadata.vertical_datum != into.vertical_datum) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "its depths are below vertical_datum=%s, those of this mission below "
        "%s; export it, shift it, and import it as a chart",
        other.metadata.vertical_datum, into.vertical_datum));
  }
  return absl::OkStatus();
}

// Unix seconds within what a leaf can hold.
std::uint32_t LeafSeconds(Time time) {
  return static_cast<std::uint32_t>(
      std::clamp<std::int64_t>(ToUnixMicros(time) / 1'000'000, 0,
                               std::numeric_limits<std::uint32_t>::max()));
}

absl::StatusOr<Import> MergeInto(const OtherMission& other, MissionFile& file,
                                 const ImportOptions& options) {
  FATHOM_RETURN_IF_ERROR(CheckFits(other, file.metadata(), options));
  FATHOM_ASSIGN_OR_RETURN(Loaded loaded, file.Load());
  Import import;
  import.left_out = other.damage;
  Batch batch;
  if (!options.as_chart) {
    FATHOM_RETURN_IF_ERROR(CheckUnrelated(other, loaded));
    for (const std::string& id : other.ancestors) {
      batch.source_positions.push_back(
          {.stream = StreamKind::kImports,
           .source = {std::string(kMissionPrefix) + id},
           .epoch = 1,
           .sequence = std::max<std::uint64_t>(1, other.view->revision())});
    }
  }
  const double rate_m2_s = loaded.metadata.ageing_rate_m2_s;
  FATHOM_ASSIGN_OR_RETURN(const map::MissionOptions map_options,
                          OptionsOf(loaded.metadata));
  FATHOM_ASSIGN_OR_RETURN(const RestoredMap restored,
                          RestoreMap(std::move(loaded), map_options));
  const std::uint64_t revision_before = restored.map->revision();
  FATHOM_ASSIGN_OR_RETURN(
      import.merge,
      restored.map->MergeMap(
          other.view->global(), other.view->as_of(),
          {.widening_m2_s = std::max(0.0, options.ageing_m2_s.value_or(
                                              other.metadata.ageing_rate_m2_s) -
                                              rate_m2_s),
           .now_s = LeafSeconds(options.now),
           .unknown_time_s = LeafSeconds(other.metadata.created),
           .as_chart = options.as_chart}));
  if (!options.create.has_value()) {
    import.backup = absl::StrFormat("%s.r%d.bak", file.path(), revision_before);
    const auto saved = file.SaveCopy(import.backup);
    // One that is there is of an earlier try.
    if (!saved.ok() && !absl::IsAlreadyExists(saved.status())) {
      return saved.status();
    }
  }
  const auto view = restored.map->View();
  batch.checkpoint = Checkpoint{.now = view, .previous = restored.checkpoint};
  FATHOM_RETURN_IF_ERROR(file.Commit(batch));
  import.revision = view->revision();
  import.digest = view->Digest();
  return import;
}

}  // namespace

absl::StatusOr<MissionInfo> ReadInfo(const std::string& path) {
  FATHOM_ASSIGN_OR_RETURN(ReadMission mission, OpenToRead(path));
  Connection& connection = mission.connection;
  MissionInfo info;
  FATHOM_ASSIGN_OR_RETURN(info.metadata, ReadMetadata(connection));
  FATHOM_ASSIGN_OR_RETURN(const std::int64_t version,
                          connection.QueryInt("PRAGMA user_version"));
  info.format_version = static_cast<int>(version);
  info.file_bytes = SizeOf(path);
  info.wal_bytes = SizeOf(path + "-wal");
  FATHOM_ASSIGN_OR_RETURN(
      const std::int64_t checkpoint,
      connection.QueryInt("SELECT checkpoint_revision FROM mission"));
  info.checkpoint_revision = static_cast<std::uint64_t>(checkpoint);

  const auto note = [&info](const absl::Status& status) {
    if (!absl::IsDataLoss(status)) return status;
    info.damage.push_back(std::string(status.message()));
    return absl::OkStatus();
  };
  const auto count = [&](std::optional<std::uint64_t>& out,
                         std::string_view sql) -> absl::Status {
    const absl::StatusOr<std::int64_t> value = connection.QueryInt(sql);
    if (value.ok()) out = static_cast<std::uint64_t>(*value);
    return note(value.status());
  };
  FATHOM_RETURN_IF_ERROR(count(info.tiles, "SELECT count(*) FROM tile"));
  FATHOM_RETURN_IF_ERROR(
      count(info.activities, "SELECT count(*) FROM activity"));
  FATHOM_RETURN_IF_ERROR(count(info.contacts, "SELECT count(*) FROM contact"));
  FATHOM_RETURN_IF_ERROR(
      count(info.journal_records,
            "SELECT ifnull(sum(record_count), 0) FROM journal"));
  const absl::StatusOr<HistoryCount> history =
      CountHistory(connection, info.format_version);
  FATHOM_RETURN_IF_ERROR(note(history.status()));
  if (history.ok()) {
    info.history_rows = static_cast<std::uint64_t>(history->rows);
    if (info.contacts.has_value()) *info.contacts += history->more_contacts;
  }
  return info;
}

absl::StatusOr<Proof> ProveFile(const std::string& path) {
  FATHOM_ASSIGN_OR_RETURN(ReadMission mission, OpenToRead(path));
  return ProveMission(mission.connection);
}

absl::StatusOr<ExportedContacts> ExportFile(const std::string& path,
                                            const std::string& out) {
  FATHOM_ASSIGN_OR_RETURN(ReadMission mission, OpenToRead(path));
  FATHOM_ASSIGN_OR_RETURN(const std::vector<ContactHistoryRow> replayed,
                          ReplayedHistory(mission.connection));
  return ExportContacts(mission.connection, replayed, out);
}

absl::StatusOr<Repair> RepairMission(const std::string& path,
                                     const std::string& out) {
  FATHOM_ASSIGN_OR_RETURN(ReadMission mission, OpenToRead(path));
  FATHOM_ASSIGN_OR_RETURN(Loaded loaded, SalvageMission(mission.connection));
  FATHOM_ASSIGN_OR_RETURN(const map::MissionOptions options,
                          OptionsOf(loaded.metadata));
  Repair repair;
  repair.left_out = loaded.damage;
  const MissionMetadata metadata = loaded.metadata;
  FATHOM_ASSIGN_OR_RETURN(const std::vector<ContactHistoryRow> replayed,
                          ReplayHistory(loaded));
  Batch batch;
  batch.source_positions = loaded.source_positions;
  FATHOM_ASSIGN_OR_RETURN(const RestoredMap restored,
                          RestoreMap(std::move(loaded), options));
  const auto view = restored.map->View();
  batch.checkpoint = Checkpoint{.now = view, .previous = nullptr};
  repair.revision = view->revision();
  repair.digest = view->Digest();

  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<MissionFile> file,
                          MissionFile::Create(out, metadata));
  absl::Status status = file->Commit(batch);
  if (status.ok()) {
    status = CopyHistory(mission.connection, replayed, *file, repair);
  }
  const absl::Status closed = file->Close();
  if (status.ok()) status = closed;
  if (status.ok()) return repair;
  RemoveMission(out);
  return status;
}

absl::StatusOr<std::uint64_t> CompactMission(
    const std::string& path, const MigrationProgress& progress) {
  {
    // Recovers what a crash left, and brings an old format to ours.
    FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<MissionFile> file,
                            MissionFile::Open(path, progress));
    FATHOM_RETURN_IF_ERROR(file->Close());
  }
  FATHOM_ASSIGN_OR_RETURN(const FileLock lock, FileLock::Acquire(path));
  {
    FATHOM_ASSIGN_OR_RETURN(
        Connection connection,
        Connection::Open(path, Connection::Mode::kReadWrite));
    FATHOM_RETURN_IF_ERROR(connection.Execute("PRAGMA synchronous = FULL"));
    FATHOM_RETURN_IF_ERROR(connection.CheckPages());
    FATHOM_RETURN_IF_ERROR(connection.Execute("VACUUM"));
    FATHOM_RETURN_IF_ERROR(connection.CheckpointTruncate());
    connection.CheckpointOnClose();
  }
  return SizeOf(path);
}

absl::StatusOr<Import> ImportMission(const std::string& from,
                                     const std::string& into,
                                     const ImportOptions& options) {
  FATHOM_ASSIGN_OR_RETURN(const OtherMission other, ReadOther(from));
  if (!options.create.has_value()) {
    FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<MissionFile> file,
                            MissionFile::Open(into, options.progress));
    FATHOM_ASSIGN_OR_RETURN(Import import, MergeInto(other, *file, options));
    FATHOM_RETURN_IF_ERROR(file->Close());
    return import;
  }
  MissionMetadata metadata = other.metadata;
  metadata.mission_id = *options.create;
  metadata.created = options.now;
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<MissionFile> file,
                          MissionFile::Create(into, metadata));
  absl::StatusOr<Import> import = MergeInto(other, *file, options);
  const absl::Status closed = file->Close();
  if (import.ok() && !closed.ok()) import = closed;
  if (!import.ok()) RemoveMission(into);
  return import;
}

}  // namespace fathom::storage
