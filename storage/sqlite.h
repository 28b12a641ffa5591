// SQLite behind RAII and absl::Status: the only user of sqlite3.h.
//
// Status codes of every function here, from SQLite's result code:
//   RESOURCE_EXHAUSTED   the disk (or a quota) is full, or memory is: the
//                        transaction is undone; the same call may work later
//   INTERNAL             an I/O error, fsync's among them: what was written
//                        last may or may not be on the disk; stop
//                        acknowledging and let the supervisor restart us
//   DATA_LOSS            the file is corrupt (a page fails its checksum), or no
//                        database
//   UNAVAILABLE          another connection holds a lock
//   FAILED_PRECONDITION  not permitted: read-only, cannot open, constraint
//   INVALID_ARGUMENT     our SQL or its use is wrong
// Messages carry SQLite's extended code and text and the system's errno.
//
// A connection and its statements belong to one thread at a time.

#ifndef FATHOM_STORAGE_SQLITE_H_
#define FATHOM_STORAGE_SQLITE_H_

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "storage/bytes.h"

struct sqlite3;
struct sqlite3_stmt;

namespace fathom::storage {

// A prepared statement. Parameters and columns count from 0. Bound text and
// blobs are not copied: they must live until the statement is run or reset.
class Statement {
 public:
  Statement() = default;

  void BindInt(int parameter, std::int64_t value);
  // SQLite stores 64-bit signed integers; the same bits come back.
  void BindUint(int parameter, std::uint64_t value) {
    BindInt(parameter, static_cast<std::int64_t>(value));
  }
  // -0.0 comes back as 0.0. What is not finite is INVALID_ARGUMENT at the next
  // Step: SQLite would store NaN as NULL.
  void BindReal(int parameter, double value);
  void BindText(int parameter, std::string_view text);
  void BindBlob(int parameter, ByteSpan bytes);
  void BindNull(int parameter);

  // To the next row. True if there is one, false at the end.
  absl::StatusOr<bool> Step();
  // Runs a statement that yields no rows to its end and resets it.
  absl::Status Run();
  // Ready to be bound and run again.
  void Reset();

  std::int64_t ColumnInt(int column) const;
  std::uint64_t ColumnUint(int column) const {
    return static_cast<std::uint64_t>(ColumnInt(column));
  }
  double ColumnReal(int column) const;
  std::string ColumnText(int column) const;
  // Valid until the next Step or Reset.
  ByteSpan ColumnBlob(int column) const;
  bool ColumnIsNull(int column) const;

 private:
  friend class Connection;
  struct Finalizer {
    void operator()(sqlite3_stmt* statement) const;
  };
  absl::Status Error(int result) const;

  std::unique_ptr<sqlite3_stmt, Finalizer> statement_;
  // The first error of a Bind, told by the next Step.
  int bind_result_ = 0;
};

// An open database.
class Connection {
 public:
  enum class Mode {
    kReadOnly,   // Never writes, never checkpoints.
    kReadWrite,  // Writes; checkpoints when told to.
    kCreate,     // As kReadWrite, but the file is made if it is absent.
  };

  Connection() = default;

  // Opens `path`; nothing is read yet. Pages are checked where the file says so
  // (checked_pages.h). SQLite never checkpoints by itself:
  // neither by the log's size nor when the connection closes (but see
  // CheckpointOnClose). Errors: FAILED_PRECONDITION for a file that is to be
  // written and may only be read; those above.
  static absl::StatusOr<Connection> Open(const std::string& path, Mode mode);

  // Makes every page of the database a checked one (checked_pages.h): of a new
  // one at once, of another with its next VACUUM.
  absl::Status CheckPages();

  // Runs SQL (one or more statements) without parameters or results.
  absl::Status Execute(const std::string& sql);
  absl::StatusOr<Statement> Prepare(std::string_view sql);
  // The single integer or text that `sql` yields, such as a PRAGMA.
  absl::StatusOr<std::int64_t> QueryInt(std::string_view sql);
  absl::StatusOr<std::string> QueryText(std::string_view sql);

  // Copies what can be copied of the log into the file without waiting for
  // readers (SQLITE_CHECKPOINT_PASSIVE). Returns frames left in the log.
  absl::StatusOr<int> CheckpointPassive();
  // Copies all and cuts the log to zero bytes; UNAVAILABLE if a reader is in
  // the way (SQLITE_CHECKPOINT_TRUNCATE).
  absl::Status CheckpointTruncate();

  // Bytes of the write-ahead log that this connection's last commit left to
  // be copied: 0 before the first. Only for the one writing connection.
  std::uint64_t LogBytes() const;

  // From here on closing checkpoints and deletes the log, as SQLite does by
  // itself. Only for the one writing connection, when it is about to close.
  void CheckpointOnClose();

  // Copies this database, as of one moment, to a new or empty one at `path`.
  absl::Status BackupTo(const std::string& path);

  bool is_open() const { return database_ != nullptr; }

 private:
  struct Closer {
    void operator()(sqlite3* database) const;
  };
  absl::Status Error(int result, std::string_view doing) const;

  // Frames in the log after the last commit, told by SQLite's hook. On the
  // heap, so that the hook's pointer survives a move. Destroyed last.
  std::unique_ptr<int> log_frames_ = std::make_unique<int>(0);
  std::unique_ptr<sqlite3, Closer> database_;
};

// BEGIN IMMEDIATE ... COMMIT; rolled back when destroyed uncommitted.
class Transaction {
 public:
  static absl::StatusOr<Transaction> Begin(Connection& connection);
  Transaction(Transaction&& other) noexcept
      : connection_(std::exchange(other.connection_, nullptr)) {}
  Transaction& operator=(Transaction&&) = delete;
  ~Transaction();

  // OK once everything is on the disk (synchronous=FULL). On an error the
  // transaction is rolled back.
  absl::Status Commit();

 private:
  explicit Transaction(Connection& connection) : connection_(&connection) {}

  Connection* connection_;
};

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_SQLITE_H_
