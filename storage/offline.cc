#include "storage/offline.h"

#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/contact_codec.h"
#include "storage/file_lock.h"
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

// Copies what can be decoded of the history.
absl::Status CopyHistory(Connection& from, MissionFile& to, Repair& repair) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      from.Prepare("SELECT source_id, contact_id, revision, contact_history."
                   "content FROM contact_history JOIN contact USING "
                   "(contact_number)"));
  Batch batch;
  while (true) {
    const absl::StatusOr<bool> more = select.Step();
    const bool lost = absl::IsDataLoss(more.status());
    if (!more.ok() && !lost) return more.status();
    if (lost) {
      repair.left_out.push_back(
          absl::StrFormat("contact history behind row %d: %s",
                          repair.history_rows, more.status().message()));
    }
    const bool end = lost || !*more;
    if (end || batch.contact_history.size() >= kHistoryRowsPerCommit) {
      FATHOM_RETURN_IF_ERROR(to.Commit(batch));
      batch = Batch();
    }
    if (end) return absl::OkStatus();
    ContactHistoryRow row;
    row.revision = select.ColumnUint(2);
    const absl::StatusOr<map::ContactPoint> point = DecodeContactPoint(
        select.ColumnBlob(3),
        absl::StrFormat("history of contact_id=%s", select.ColumnText(1)));
    if (!point.ok()) {
      if (!absl::IsDataLoss(point.status())) return point.status();
      repair.left_out.push_back(std::string(point.status().message()));
      continue;
    }
    static_cast<map::ContactPoint&>(row.estimate) = *point;
    row.estimate.key = {.source = {select.ColumnText(0)},
                        .contact = {select.ColumnText(1)}};
    batch.contact_history.push_back(std::move(row));
    ++repair.history_rows;
  }
}

}  // namespace

absl::StatusOr<MissionInfo> ReadInfo(const std::string& path) {
  FATHOM_ASSIGN_OR_RETURN(ReadMission mission, OpenToRead(path));
  Connection& connection = mission.connection;
  MissionInfo info;
  FATHOM_ASSIGN_OR_RETURN(info.metadata, ReadMetadata(connection));
  const auto count = [&](std::uint64_t& out,
                         std::string_view sql) -> absl::Status {
    FATHOM_ASSIGN_OR_RETURN(const std::int64_t value, connection.QueryInt(sql));
    out = static_cast<std::uint64_t>(value);
    return absl::OkStatus();
  };
  FATHOM_ASSIGN_OR_RETURN(const std::int64_t version,
                          connection.QueryInt("PRAGMA user_version"));
  info.format_version = static_cast<int>(version);
  info.file_bytes = SizeOf(path);
  info.wal_bytes = SizeOf(path + "-wal");
  FATHOM_RETURN_IF_ERROR(count(info.checkpoint_revision,
                               "SELECT checkpoint_revision FROM mission"));
  FATHOM_RETURN_IF_ERROR(count(info.tiles, "SELECT count(*) FROM tile"));
  FATHOM_RETURN_IF_ERROR(
      count(info.activities, "SELECT count(*) FROM activity"));
  FATHOM_RETURN_IF_ERROR(count(info.contacts, "SELECT count(*) FROM contact"));
  FATHOM_RETURN_IF_ERROR(
      count(info.history_rows, "SELECT count(*) FROM contact_history"));
  FATHOM_RETURN_IF_ERROR(
      count(info.journal_records,
            "SELECT ifnull(sum(record_count), 0) FROM journal"));
  return info;
}

absl::StatusOr<Proof> ProveFile(const std::string& path) {
  FATHOM_ASSIGN_OR_RETURN(ReadMission mission, OpenToRead(path));
  return ProveMission(mission.connection);
}

absl::StatusOr<ExportedContacts> ExportFile(const std::string& path,
                                            const std::string& out) {
  FATHOM_ASSIGN_OR_RETURN(ReadMission mission, OpenToRead(path));
  return ExportContacts(mission.connection, out);
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
  if (status.ok()) status = CopyHistory(mission.connection, *file, repair);
  const absl::Status closed = file->Close();
  if (status.ok()) status = closed;
  if (status.ok()) return repair;
  // Half a repair is worse than none.
  std::error_code ignored;
  for (const char* end : {"", "-wal", "-shm"}) {
    std::filesystem::remove(out + end, ignored);
  }
  return status;
}

absl::StatusOr<std::uint64_t> CompactMission(const std::string& path) {
  {
    // Recovers what a crash left, and brings an old format to ours.
    FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<MissionFile> file,
                            MissionFile::Open(path));
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

}  // namespace fathom::storage
