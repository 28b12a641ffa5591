#include "storage/migrate.h"

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <system_error>
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
#include "storage/sqlite.h"

namespace fathom::storage {
namespace {

using SteadyClock = std::chrono::steady_clock;

// Tells of one migration.
class Teller {
 public:
  explicit Teller(const MigrationProgress& progress) : progress_(progress) {}

  void Tell(const std::string& line) {
    told_ = SteadyClock::now();
    if (progress_.tell) progress_.tell(line);
  }

  // So many more estimates of the history are done; of `all`, if it is known.
  void Add(std::uint64_t estimates, std::uint64_t all) {
    done_ += estimates;
    if (SteadyClock::now() - told_ < progress_.interval) return;
    Tell(all == 0
             ? absl::StrFormat("%d estimates of the contact history are done",
                               done_)
             : absl::StrFormat("%d of %d estimates of the contact history are "
                               "done",
                               done_, all));
  }

  double Seconds() const {
    return std::chrono::duration<double>(SteadyClock::now() - began_).count();
  }

 private:
  const MigrationProgress& progress_;
  const SteadyClock::time_point began_ = SteadyClock::now();
  SteadyClock::time_point told_ = began_;
  std::uint64_t done_ = 0;
};

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
absl::Status RowsToVersion8(Connection& connection, Teller& teller) {
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
      teller.Add(1, 0);
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
absl::Status BlocksToVersion8(Connection& connection, Teller& teller) {
  FATHOM_ASSIGN_OR_RETURN(Transaction transaction,
                          Transaction::Begin(connection));
  FATHOM_RETURN_IF_ERROR(CreateFeatureTables(connection));
  FATHOM_ASSIGN_OR_RETURN(
      const std::int64_t all,
      connection.QueryInt("SELECT estimate_count FROM contact_history_total"));
  FATHOM_RETURN_IF_ERROR(
      FillFeatureTables(connection, [&](std::uint64_t estimates) {
        teller.Add(estimates, static_cast<std::uint64_t>(all));
      }));
  FATHOM_RETURN_IF_ERROR(connection.Execute("PRAGMA user_version = 8"));
  return transaction.Commit();
}

// A contact may have older estimates now (contact_codec.h), which a program of
// before does not read; there are none yet.
absl::Status ToVersion9(Connection& connection) {
  return connection.Execute("PRAGMA user_version = 9");
}

}  // namespace

absl::Status Migrate(const std::string& path, Connection& connection,
                     const MigrationProgress& progress) {
  FATHOM_ASSIGN_OR_RETURN(const std::int64_t version,
                          connection.QueryInt("PRAGMA user_version"));
  if (version == kSchemaVersion) return absl::OkStatus();
  Teller teller(progress);
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(path, error);
  teller.Tell(absl::StrFormat(
      "%s is of format %d and is brought to %d, %d MB; as it is it stays "
      "beside it as .v%d.bak",
      path, version, kSchemaVersion, error ? 0 : bytes / 1'000'000, version));
  FATHOM_RETURN_IF_ERROR(BackUp(path, version, connection));
  if (version < 6) FATHOM_RETURN_IF_ERROR(ToVersion6(connection));
  if (version < kFirstBlockVersion) {
    FATHOM_RETURN_IF_ERROR(RowsToVersion8(connection, teller));
  } else if (version < kFirstFeatureVersion) {
    FATHOM_RETURN_IF_ERROR(BlocksToVersion8(connection, teller));
  }
  FATHOM_RETURN_IF_ERROR(ToVersion9(connection));
  teller.Tell(absl::StrFormat("%s is of format %d now, after %.1f s", path,
                              kSchemaVersion, teller.Seconds()));
  return absl::OkStatus();
}

}  // namespace fathom::storage
