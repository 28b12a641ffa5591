// Brings a mission of an older format to this program's, step by step.
//
// Before the first step the mission is copied, as it is, to
// "<mission>.v<version>.bak"; a backup that is there already is of an earlier
// try and stays. A step is one transaction, or can be repeated: whatever cuts
// a migration off, the next opening finishes it.

#ifndef FATHOM_STORAGE_MIGRATE_H_
#define FATHOM_STORAGE_MIGRATE_H_

#include <chrono>
#include <functional>
#include <string>

#include "absl/status/status.h"

namespace fathom::storage {

class Connection;

// Whom a migration tells what it does: a long history takes minutes.
struct MigrationProgress {
  // Called with a line of text for people: at the beginning, at the end, and
  // while the history is read, at most once in `interval`.
  std::function<void(const std::string&)> tell = nullptr;
  std::chrono::milliseconds interval{5000};
};

// `path` is that of `connection`, the only one. Does nothing to a mission of
// kSchemaVersion, and tells nothing. REQUIRES: CheckVersion is OK. Needs room
// for two more copies of the mission. Errors: those of sqlite.h.
absl::Status Migrate(const std::string& path, Connection& connection,
                     const MigrationProgress& progress);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_MIGRATE_H_
