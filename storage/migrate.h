// Brings a mission of an older format to this program's, step by step.
//
// Before the first step the mission is copied, as it is, to
// "<mission>.v<version>.bak"; a backup that is there already is of an earlier
// try and stays. A step is one transaction, or can be repeated: whatever cuts
// a migration off, the next opening finishes it.

#ifndef FATHOM_STORAGE_MIGRATE_H_
#define FATHOM_STORAGE_MIGRATE_H_

#include <string>

#include "absl/status/status.h"
#include "storage/sqlite.h"

namespace fathom::storage {

// `path` is that of `connection`, the only one. Does nothing to a mission of
// kSchemaVersion. REQUIRES: CheckVersion is OK. Needs room for two more
// copies of the mission. Errors: those of sqlite.h.
absl::Status Migrate(const std::string& path, Connection& connection);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_MIGRATE_H_
