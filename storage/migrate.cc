#include "storage/migrate.h"

#include <cstdint>
#include <filesystem>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/draft_file.h"
#include "storage/mission_file.h"

namespace fathom::storage {
namespace {

absl::Status BackUp(const std::string& path, std::int64_t version,
                    Connection& connection) {
  const std::string target = absl::StrFormat("%s.v%d.bak", path, version);
  if (std::filesystem::exists(target)) return absl::OkStatus();
  DraftFile draft(target);
  FATHOM_RETURN_IF_ERROR(connection.BackupTo(draft.path()));
  return draft.Publish();
}

// To checked pages (checked_pages.h). VACUUM writes every page anew, in one
// transaction of its own; done twice it does no harm.
absl::Status ToVersion6(Connection& connection) {
  FATHOM_RETURN_IF_ERROR(connection.CheckPages());
  FATHOM_RETURN_IF_ERROR(connection.Execute("VACUUM"));
  FATHOM_RETURN_IF_ERROR(connection.Execute("PRAGMA user_version = 6"));
  // Nothing of the old pages stays in the log.
  return connection.CheckpointTruncate();
}

}  // namespace

absl::Status Migrate(const std::string& path, Connection& connection) {
  FATHOM_ASSIGN_OR_RETURN(const std::int64_t version,
                          connection.QueryInt("PRAGMA user_version"));
  if (version == kSchemaVersion) return absl::OkStatus();
  FATHOM_RETURN_IF_ERROR(BackUp(path, version, connection));
  if (version < 6) FATHOM_RETURN_IF_ERROR(ToVersion6(connection));
  return absl::OkStatus();
}

}  // namespace fathom::storage
