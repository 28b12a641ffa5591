// The tables of the mission file: made, recognised, and nothing else.
// docs/storage_format.md says what each column and blob means.

#ifndef FATHOM_STORAGE_SCHEMA_H_
#define FATHOM_STORAGE_SCHEMA_H_

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "storage/mission_records.h"
#include "storage/sqlite.h"

namespace fathom::storage {

// Whether the file at `path` is a mission that this program can open, judged
// from its first 100 bytes alone, before SQLite may touch it. REQUIRES: the
// caller holds its FileLock (reading closes a descriptor: see file_lock.h).
//
// Errors: NOT_FOUND; FAILED_PRECONDITION: no mission, or a newer one.
absl::Status CheckHeader(const std::string& path);

// The same judgement of an open database: a newer program may have died
// between writing the log and copying it into the file.
absl::Status CheckVersion(Connection& connection);

// The metadata as it will be read back: texts within their limits, numbers
// finite and in range, -0.0 (which SQLite does not keep) made 0.0.
// Errors: INVALID_ARGUMENT naming the field.
absl::StatusOr<MissionMetadata> NormalMetadata(MissionMetadata metadata);

// Makes tables, application_id, user_version and the mission's row in the
// empty database `connection`, and sets the write-ahead log up. One
// transaction. REQUIRES: metadata from NormalMetadata.
absl::Status CreateSchema(Connection& connection,
                          const MissionMetadata& metadata);

// The tables of the contact history, empty (history_table.h,
// history_features.h): for a new mission and for one whose history is in rows.
absl::Status CreateHistoryTables(Connection& connection);

absl::StatusOr<MissionMetadata> ReadMetadata(Connection& connection);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_SCHEMA_H_
