#include "storage/schema.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/checked_pages.h"
#include "storage/history_features.h"
#include "storage/mission_file.h"

namespace fathom::storage {
namespace {

// STRICT: a column holds what it says. Revisions, epochs and sequences are
// unsigned 64-bit numbers in signed columns, bit for bit.
constexpr char kTables[] = R"sql(
CREATE TABLE mission (
  only_row INTEGER PRIMARY KEY CHECK (only_row = 1),
  mission_id TEXT NOT NULL,
  name TEXT NOT NULL,
  vertical_datum TEXT NOT NULL,
  created_us INTEGER NOT NULL,
  root_south_west_latitude_deg REAL NOT NULL,
  root_south_west_longitude_deg REAL NOT NULL,
  root_north_west_latitude_deg REAL NOT NULL,
  root_north_west_longitude_deg REAL NOT NULL,
  min_cell_m REAL NOT NULL,
  max_cells INTEGER NOT NULL,
  tolerance_m REAL NOT NULL,
  ageing_rate_m2_s REAL NOT NULL,
  max_contacts INTEGER NOT NULL,
  contact_filter TEXT NOT NULL,
  checkpoint_revision INTEGER NOT NULL,
  checkpoint_as_of_us INTEGER NOT NULL,
  degraded_updates INTEGER NOT NULL
) STRICT;

CREATE TABLE contact_reject (
  reason INTEGER PRIMARY KEY,
  report_count INTEGER NOT NULL
) STRICT;

CREATE TABLE tile (
  tile_key INTEGER PRIMARY KEY,
  content BLOB NOT NULL
) STRICT;

CREATE TABLE activity (
  activity_number INTEGER PRIMARY KEY,
  activity_id TEXT NOT NULL UNIQUE,
  vehicle_id TEXT NOT NULL,
  start_us INTEGER NOT NULL,
  open INTEGER NOT NULL CHECK (open IN (0, 1)),
  content BLOB NOT NULL
) STRICT;

CREATE TABLE local_block (
  block_key INTEGER PRIMARY KEY,
  content BLOB NOT NULL
) STRICT;

CREATE TABLE contact (
  contact_number INTEGER PRIMARY KEY,
  source_id TEXT NOT NULL,
  contact_id TEXT NOT NULL,
  content BLOB,
  UNIQUE (source_id, contact_id)
) STRICT;

CREATE TABLE source_position (
  stream INTEGER NOT NULL CHECK (stream IN (1, 2, 3)),
  source_id TEXT NOT NULL,
  epoch INTEGER NOT NULL,
  sequence INTEGER NOT NULL,
  PRIMARY KEY (stream, source_id)
) STRICT, WITHOUT ROWID;

CREATE TABLE journal (
  segment_id INTEGER PRIMARY KEY,
  first_revision INTEGER NOT NULL,
  last_revision INTEGER NOT NULL,
  record_count INTEGER NOT NULL,
  content BLOB NOT NULL
) STRICT;
)sql";

constexpr char kHistoryTables[] = R"sql(
CREATE TABLE contact_history (
  block_id INTEGER PRIMARY KEY,
  contact_number INTEGER NOT NULL REFERENCES contact,
  first_time_us INTEGER NOT NULL,
  last_time_us INTEGER NOT NULL,
  last_revision INTEGER NOT NULL,
  estimate_count INTEGER NOT NULL,
  content BLOB NOT NULL
) STRICT;

CREATE INDEX contact_history_time ON contact_history
  (contact_number, last_time_us, first_time_us, last_revision);

CREATE INDEX contact_history_age ON contact_history (last_time_us);

CREATE VIRTUAL TABLE contact_history_place USING rtree (
  block_id, south_deg, north_deg, west_deg, east_deg, first_s, last_s);

CREATE TABLE contact_history_total (
  only_row INTEGER PRIMARY KEY CHECK (only_row = 1),
  estimate_count INTEGER NOT NULL,
  content_bytes INTEGER NOT NULL,
  forgotten_count INTEGER NOT NULL
) STRICT;

INSERT INTO contact_history_total VALUES (1, 0, 0, 0);
)sql";

constexpr char kMissionColumns[] =
    "mission_id, name, vertical_datum, created_us, "
    "root_south_west_latitude_deg, root_south_west_longitude_deg, "
    "root_north_west_latitude_deg, root_north_west_longitude_deg, "
    "min_cell_m, max_cells, tolerance_m, ageing_rate_m2_s, max_contacts, "
    "contact_filter";

// Offsets in the header of an SQLite file (sqlite.org/fileformat2.html 1.3);
// both numbers are big-endian.
constexpr std::size_t kHeaderBytes = 100;
constexpr std::size_t kReservedBytesOffset = 20;
constexpr std::size_t kUserVersionOffset = 60;
constexpr std::size_t kApplicationIdOffset = 68;
constexpr char kMagic[] = "SQLite format 3";  // And a zero byte: 16.

std::int64_t BigEndian32(const std::uint8_t* p) {
  return std::int64_t{p[0]} << 24 | p[1] << 16 | p[2] << 8 | p[3];
}

absl::Status CheckNumbers(std::int64_t application_id,
                          std::int64_t user_version, const std::string& what) {
  if (application_id != kApplicationId) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "%s is not a Fathom mission (application_id is %d, not %d); it was "
        "left untouched",
        what, application_id, kApplicationId));
  }
  if (user_version > kSchemaVersion) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "%s has format version %d, this program knows up to %d; it was left "
        "untouched: use a newer program",
        what, user_version, kSchemaVersion));
  }
  if (user_version < kOldestSchemaVersion) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "%s has format version %d, which was never released; this program "
        "knows %d to %d: it was left untouched",
        what, user_version, kOldestSchemaVersion, kSchemaVersion));
  }
  return absl::OkStatus();
}

absl::Status CheckText(std::string_view field, std::string_view text) {
  if (text.size() <= kMaxNameBytes) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat(
      "%s has %d bytes; at most %d", field, text.size(), kMaxNameBytes));
}

absl::Status CheckNumber(std::string_view field, double& value, double least,
                         bool may_equal) {
  if (std::isfinite(value) &&
      (value > least || (may_equal && value == least))) {
    value += 0.0;  // -0.0 becomes 0.0, everything else stays.
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrFormat("%s=%g; it must be finite and %s %g", field, value,
                      may_equal ? ">=" : ">", least));
}

}  // namespace

absl::Status CheckHeader(const std::string& path) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) {
    return absl::ErrnoToStatus(errno, absl::StrFormat("open %s", path));
  }
  std::array<std::uint8_t, kHeaderBytes> header = {};
  const ssize_t size = pread(descriptor, header.data(), header.size(), 0);
  const int error = errno;
  close(descriptor);
  if (size < 0) {
    return absl::ErrnoToStatus(error, absl::StrFormat("read %s", path));
  }
  if (size != static_cast<ssize_t>(kHeaderBytes) ||
      std::memcmp(header.data(), kMagic, sizeof(kMagic)) != 0) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "%s is not a Fathom mission (no SQLite header); it was left untouched",
        path));
  }
  const std::int64_t version = BigEndian32(header.data() + kUserVersionOffset);
  FATHOM_RETURN_IF_ERROR(CheckNumbers(
      BigEndian32(header.data() + kApplicationIdOffset), version, path));
  // Else a flipped bit here would switch all checksums off.
  if (version >= kFirstCheckedVersion &&
      header[kReservedBytesOffset] != kPageChecksumBytes) {
    return absl::DataLossError(absl::StrFormat(
        "%s: its header says that it has no checksums of pages", path));
  }
  return absl::OkStatus();
}

absl::Status CheckVersion(Connection& connection) {
  FATHOM_ASSIGN_OR_RETURN(const std::int64_t application_id,
                          connection.QueryInt("PRAGMA application_id"));
  FATHOM_ASSIGN_OR_RETURN(const std::int64_t user_version,
                          connection.QueryInt("PRAGMA user_version"));
  return CheckNumbers(application_id, user_version, "the mission");
}

absl::StatusOr<MissionMetadata> NormalMetadata(MissionMetadata metadata) {
  if (metadata.mission_id.empty() || metadata.mission_id.size() > 128) {
    return absl::InvalidArgumentError(
        absl::StrFormat("mission_id has %d bytes; 1 to 128 are needed",
                        metadata.mission_id.size()));
  }
  FATHOM_RETURN_IF_ERROR(CheckText("name", metadata.name));
  FATHOM_RETURN_IF_ERROR(CheckText("vertical_datum", metadata.vertical_datum));
  FATHOM_RETURN_IF_ERROR(CheckText("contact_filter", metadata.contact_filter));
  for (map::GeodeticPoint* corner :
       {&metadata.root_south_west, &metadata.root_north_west}) {
    FATHOM_RETURN_IF_ERROR(
        CheckNumber("root latitude_deg", corner->latitude_deg, -90, true));
    FATHOM_RETURN_IF_ERROR(
        CheckNumber("root longitude_deg", corner->longitude_deg, -360, true));
  }
  FATHOM_RETURN_IF_ERROR(
      CheckNumber("min_cell_m", metadata.min_cell_m, 0, false));
  FATHOM_RETURN_IF_ERROR(
      CheckNumber("tolerance_m", metadata.tolerance_m, 0, true));
  FATHOM_RETURN_IF_ERROR(
      CheckNumber("ageing_rate_m2_s", metadata.ageing_rate_m2_s, 0, true));
  return metadata;
}

absl::Status CreateHistoryTables(Connection& connection) {
  FATHOM_RETURN_IF_ERROR(connection.Execute(kHistoryTables));
  return CreateFeatureTables(connection);
}

absl::Status CreateSchema(Connection& connection,
                          const MissionMetadata& metadata) {
  // Before the first page is written: both are fixed with it. 8 KiB pages: see
  // docs/storage_format.md for what was measured.
  FATHOM_RETURN_IF_ERROR(connection.Execute("PRAGMA page_size = 8192"));
  FATHOM_RETURN_IF_ERROR(connection.Execute("PRAGMA auto_vacuum = NONE"));
  FATHOM_RETURN_IF_ERROR(connection.CheckPages());
  FATHOM_RETURN_IF_ERROR(connection.Execute("PRAGMA synchronous = FULL"));
  FATHOM_ASSIGN_OR_RETURN(Transaction transaction,
                          Transaction::Begin(connection));
  FATHOM_RETURN_IF_ERROR(connection.Execute(
      absl::StrFormat("PRAGMA application_id = %d", kApplicationId)));
  FATHOM_RETURN_IF_ERROR(connection.Execute(
      absl::StrFormat("PRAGMA user_version = %d", kSchemaVersion)));
  FATHOM_RETURN_IF_ERROR(connection.Execute(kTables));
  FATHOM_RETURN_IF_ERROR(CreateHistoryTables(connection));
  FATHOM_ASSIGN_OR_RETURN(
      Statement insert,
      connection.Prepare(absl::StrFormat(
          "INSERT INTO mission (only_row, %s, checkpoint_revision, "
          "checkpoint_as_of_us, degraded_updates) VALUES (1, ?, ?, ?, ?, ?, ?, "
          "?, ?, ?, ?, ?, "
          "?, ?, ?, 0, 0, 0)",
          kMissionColumns)));
  insert.BindText(0, metadata.mission_id);
  insert.BindText(1, metadata.name);
  insert.BindText(2, metadata.vertical_datum);
  insert.BindInt(3, ToUnixMicros(metadata.created));
  insert.BindReal(4, metadata.root_south_west.latitude_deg);
  insert.BindReal(5, metadata.root_south_west.longitude_deg);
  insert.BindReal(6, metadata.root_north_west.latitude_deg);
  insert.BindReal(7, metadata.root_north_west.longitude_deg);
  insert.BindReal(8, metadata.min_cell_m);
  insert.BindUint(9, metadata.max_cells);
  insert.BindReal(10, metadata.tolerance_m);
  insert.BindReal(11, metadata.ageing_rate_m2_s);
  insert.BindInt(12, metadata.max_contacts);
  insert.BindText(13, metadata.contact_filter);
  FATHOM_RETURN_IF_ERROR(insert.Run());
  FATHOM_RETURN_IF_ERROR(transaction.Commit());
  FATHOM_ASSIGN_OR_RETURN(const std::string mode,
                          connection.QueryText("PRAGMA journal_mode = WAL"));
  if (mode == "wal") return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrFormat(
      "the file system cannot keep a write-ahead log (journal_mode=%s); put "
      "the mission on a local disk",
      mode));
}

absl::StatusOr<MissionMetadata> ReadMetadata(Connection& connection) {
  FATHOM_ASSIGN_OR_RETURN(Statement select,
                          connection.Prepare(absl::StrFormat(
                              "SELECT %s FROM mission", kMissionColumns)));
  FATHOM_ASSIGN_OR_RETURN(const bool row, select.Step());
  if (!row) return absl::DataLossError("the mission table is empty");
  MissionMetadata metadata;
  metadata.mission_id = select.ColumnText(0);
  metadata.name = select.ColumnText(1);
  metadata.vertical_datum = select.ColumnText(2);
  metadata.created = TimeFromUnixMicros(select.ColumnInt(3));
  metadata.root_south_west = {.latitude_deg = select.ColumnReal(4),
                              .longitude_deg = select.ColumnReal(5)};
  metadata.root_north_west = {.latitude_deg = select.ColumnReal(6),
                              .longitude_deg = select.ColumnReal(7)};
  metadata.min_cell_m = select.ColumnReal(8);
  metadata.max_cells = select.ColumnUint(9);
  metadata.tolerance_m = select.ColumnReal(10);
  metadata.ageing_rate_m2_s = select.ColumnReal(11);
  metadata.max_contacts = static_cast<std::uint32_t>(select.ColumnInt(12));
  metadata.contact_filter = select.ColumnText(13);
  return metadata;
}

}  // namespace fathom::storage
