#include "storage/migrate.h"

#include <cstdint>
#include <filesystem>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/contact_table.h"
#include "storage/draft_file.h"
#include "storage/history_codec.h"
#include "storage/history_features.h"
#include "storage/history_reader.h"
#include "storage/history_table.h"
#include "storage/mission_file.h"
#include "storage/schema.h"

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

// From a history in rows to one in blocks (history_table.h), which come with
// their features, in one transaction.
absl::Status RowsToVersion8(Connection& connection) {
  FATHOM_ASSIGN_OR_RETURN(Transaction transaction,
                          Transaction::Begin(connection));
  FATHOM_RETURN_IF_ERROR(connection.Execute(
      "ALTER TABLE contact_history RENAME TO contact_history_6"));
  FATHOM_RETURN_IF_ERROR(CreateHistoryTables(connection));
  {
    FATHOM_ASSIGN_OR_RETURN(ContactTable contacts,
                            ContactTable::Create(connection));
    FATHOM_ASSIGN_OR_RETURN(HistoryTable table,
                            HistoryTable::Create(connection));
    map::ContactKey key;
    HistoryTail tail;
    const auto write = [&]() -> absl::Status {
      if (tail.rows.empty()) return absl::OkStatus();
      FATHOM_ASSIGN_OR_RETURN(const std::int64_t number,
                              contacts.NumberOf(key));
      return table.Write(number, std::exchange(tail, {}));
    };
    const auto take = [&](const ContactHistoryRow& row) -> absl::Status {
      if (row.estimate.key != key || tail.rows.size() == kBlockEstimates) {
        FATHOM_RETURN_IF_ERROR(write());
        key = row.estimate.key;
      }
      tail.Add(row);
      return absl::OkStatus();
    };
    FATHOM_RETURN_IF_ERROR(
        ReadOldHistory(connection, "contact_history_6", take,
                       [](const absl::Status& damage) { return damage; }));
    FATHOM_RETURN_IF_ERROR(write());
  }
  FATHOM_RETURN_IF_ERROR(connection.Execute("DROP TABLE contact_history_6"));
  FATHOM_RETURN_IF_ERROR(connection.Execute("PRAGMA user_version = 8"));
  return transaction.Commit();
}

// To blocks with features (history_features.h), in one transaction.
absl::Status BlocksToVersion8(Connection& connection) {
  FATHOM_ASSIGN_OR_RETURN(Transaction transaction,
                          Transaction::Begin(connection));
  FATHOM_RETURN_IF_ERROR(CreateFeatureTables(connection));
  FATHOM_RETURN_IF_ERROR(FillFeatureTables(connection));
  FATHOM_RETURN_IF_ERROR(connection.Execute("PRAGMA user_version = 8"));
  return transaction.Commit();
}

// A contact may have older estimates now (contact_codec.h), which a program of
// before does not read; there are none yet.
absl::Status ToVersion9(Connection& connection) {
  return connection.Execute("PRAGMA user_version = 9");
}

}  // namespace

absl::Status Migrate(const std::string& path, Connection& connection) {
  FATHOM_ASSIGN_OR_RETURN(const std::int64_t version,
                          connection.QueryInt("PRAGMA user_version"));
  if (version == kSchemaVersion) return absl::OkStatus();
  FATHOM_RETURN_IF_ERROR(BackUp(path, version, connection));
  if (version < 6) FATHOM_RETURN_IF_ERROR(ToVersion6(connection));
  if (version < kFirstBlockVersion) {
    FATHOM_RETURN_IF_ERROR(RowsToVersion8(connection));
  } else if (version < kFirstFeatureVersion) {
    FATHOM_RETURN_IF_ERROR(BlocksToVersion8(connection));
  }
  return ToVersion9(connection);
}

}  // namespace fathom::storage
