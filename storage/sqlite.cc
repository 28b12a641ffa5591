#include "storage/sqlite.h"

#include <sqlite3.h>

#include <cerrno>
#include <cmath>
#include <cstring>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/checked_pages.h"

namespace fathom::storage {
namespace {

absl::StatusCode CodeOf(int result, int system_errno) {
  switch (result & 0xff) {
    case SQLITE_FULL:
    case SQLITE_NOMEM:
    case SQLITE_TOOBIG:
      return absl::StatusCode::kResourceExhausted;
    case SQLITE_IOERR:
      if (result == SQLITE_IOERR_DATA) return absl::StatusCode::kDataLoss;
      // The shared-memory index too is a file that must grow.
      if (system_errno == ENOSPC || system_errno == EDQUOT ||
          result == SQLITE_IOERR_NOMEM) {
        return absl::StatusCode::kResourceExhausted;
      }
      return absl::StatusCode::kInternal;
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
    case SQLITE_FORMAT:
      return absl::StatusCode::kDataLoss;
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
    case SQLITE_PROTOCOL:
      return absl::StatusCode::kUnavailable;
    case SQLITE_READONLY:
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
    case SQLITE_AUTH:
    case SQLITE_CONSTRAINT:
      return absl::StatusCode::kFailedPrecondition;
    default:
      return absl::StatusCode::kInvalidArgument;
  }
}

absl::Status ErrorOf(sqlite3* database, int result, std::string_view doing) {
  // A checksum is no matter of the system's: what it said last is of before.
  const int system_errno = database == nullptr || result == SQLITE_IOERR_DATA
                               ? 0
                               : sqlite3_system_errno(database);
  const char* text = result == SQLITE_IOERR_DATA ? "a page fails its checksum"
                     : database == nullptr       ? sqlite3_errstr(result)
                                                 : sqlite3_errmsg(database);
  std::string message =
      absl::StrFormat("%s: %s (sqlite code %d)", doing, text, result);
  if (system_errno != 0) {
    absl::StrAppendFormat(&message, ", %s", std::strerror(system_errno));
  }
  return absl::Status(CodeOf(result, system_errno), message);
}

}  // namespace

void Statement::Finalizer::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

absl::Status Statement::Error(int result) const {
  const char* sql = sqlite3_sql(statement_.get());
  return ErrorOf(sqlite3_db_handle(statement_.get()), result,
                 sql == nullptr ? "statement" : sql);
}

void Statement::BindInt(int parameter, std::int64_t value) {
  const int result = sqlite3_bind_int64(statement_.get(), parameter + 1, value);
  if (bind_result_ == SQLITE_OK) bind_result_ = result;
}

void Statement::BindReal(int parameter, double value) {
  const int result =
      std::isfinite(value)
          ? sqlite3_bind_double(statement_.get(), parameter + 1, value)
          : SQLITE_MISMATCH;
  if (bind_result_ == SQLITE_OK) bind_result_ = result;
}

void Statement::BindText(int parameter, std::string_view text) {
  // A null pointer would bind NULL; an empty view may have one.
  const int result = sqlite3_bind_text64(
      statement_.get(), parameter + 1, text.empty() ? "" : text.data(),
      text.size(), SQLITE_STATIC, SQLITE_UTF8);
  if (bind_result_ == SQLITE_OK) bind_result_ = result;
}

void Statement::BindBlob(int parameter, ByteSpan bytes) {
  const int result =
      bytes.empty()
          ? sqlite3_bind_zeroblob(statement_.get(), parameter + 1, 0)
          : sqlite3_bind_blob64(statement_.get(), parameter + 1, bytes.data(),
                                bytes.size(), SQLITE_STATIC);
  if (bind_result_ == SQLITE_OK) bind_result_ = result;
}

void Statement::BindNull(int parameter) {
  const int result = sqlite3_bind_null(statement_.get(), parameter + 1);
  if (bind_result_ == SQLITE_OK) bind_result_ = result;
}

absl::StatusOr<bool> Statement::Step() {
  if (bind_result_ != SQLITE_OK) return Error(bind_result_);
  const int result = sqlite3_step(statement_.get());
  if (result == SQLITE_ROW) return true;
  if (result == SQLITE_DONE) return false;
  absl::Status error = Error(result);
  sqlite3_reset(statement_.get());
  return error;
}

absl::Status Statement::Run() {
  const absl::StatusOr<bool> row = Step();
  Reset();
  return row.status();
}

void Statement::Reset() {
  bind_result_ = SQLITE_OK;
  sqlite3_reset(statement_.get());
}

std::int64_t Statement::ColumnInt(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

double Statement::ColumnReal(int column) const {
  return sqlite3_column_double(statement_.get(), column);
}

std::string Statement::ColumnText(int column) const {
  const unsigned char* text = sqlite3_column_text(statement_.get(), column);
  if (text == nullptr) return {};
  const int size = sqlite3_column_bytes(statement_.get(), column);
  return std::string(reinterpret_cast<const char*>(text),
                     static_cast<std::size_t>(size));
}

ByteSpan Statement::ColumnBlob(int column) const {
  const void* blob = sqlite3_column_blob(statement_.get(), column);
  if (blob == nullptr) return {};
  const int size = sqlite3_column_bytes(statement_.get(), column);
  return ByteSpan(static_cast<const std::uint8_t*>(blob),
                  static_cast<std::size_t>(size));
}

bool Statement::ColumnIsNull(int column) const {
  return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL;
}

void Connection::Closer::operator()(sqlite3* database) const {
  sqlite3_close_v2(database);
}

absl::Status Connection::Error(int result, std::string_view doing) const {
  return ErrorOf(database_.get(), result, doing);
}

absl::StatusOr<Connection> Connection::Open(const std::string& path,
                                            Mode mode) {
  int flags = SQLITE_OPEN_NOMUTEX;
  switch (mode) {
    case Mode::kReadOnly:
      flags |= SQLITE_OPEN_READONLY;
      break;
    case Mode::kReadWrite:
      flags |= SQLITE_OPEN_READWRITE;
      break;
    case Mode::kCreate:
      flags |= SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
      break;
  }
  sqlite3* database = nullptr;
  const int result =
      sqlite3_open_v2(path.c_str(), &database, flags, CheckedPagesVfs());
  Connection connection;
  connection.database_.reset(database);
  if (result != SQLITE_OK) {
    return connection.Error(result, absl::StrFormat("open %s", path));
  }
  // SQLite takes what it may only read without a word, and fails later.
  if (mode != Mode::kReadOnly && sqlite3_db_readonly(database, "main") == 1) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "open %s: it is read-only for this process; give it the right to "
        "write, or work on a copy",
        path));
  }
  sqlite3_extended_result_codes(database, 1);
  sqlite3_db_config(database, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  // A file from elsewhere must not run functions that its schema names.
  sqlite3_db_config(database, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  // Takes away the hook that checkpoints by size, then puts ours there.
  sqlite3_wal_autocheckpoint(database, 0);
  sqlite3_wal_hook(
      database,
      [](void* frames, sqlite3*, const char*, int count) {
        *static_cast<int*>(frames) = count;
        return SQLITE_OK;
      },
      connection.log_frames_.get());
  return connection;
}

absl::Status Connection::CheckPages() {
  int reserved = kPageChecksumBytes;
  int result = sqlite3_file_control(database_.get(), "main",
                                    SQLITE_FCNTL_RESERVE_BYTES, &reserved);
  if (result == SQLITE_OK) {
    result = sqlite3_file_control(database_.get(), "main",
                                  kFileControlCheckPages, nullptr);
  }
  return result == SQLITE_OK ? absl::OkStatus() : Error(result, "check pages");
}

absl::Status Connection::Execute(const std::string& sql) {
  const int result =
      sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr);
  return result == SQLITE_OK ? absl::OkStatus() : Error(result, sql);
}

absl::StatusOr<Statement> Connection::Prepare(std::string_view sql) {
  sqlite3_stmt* prepared = nullptr;
  const int result = sqlite3_prepare_v3(
      database_.get(), sql.data(), static_cast<int>(sql.size()),
      SQLITE_PREPARE_PERSISTENT, &prepared, nullptr);
  if (result != SQLITE_OK) return Error(result, sql);
  Statement statement;
  statement.statement_.reset(prepared);
  return statement;
}

absl::StatusOr<std::int64_t> Connection::QueryInt(std::string_view sql) {
  FATHOM_ASSIGN_OR_RETURN(Statement statement, Prepare(sql));
  FATHOM_ASSIGN_OR_RETURN(const bool row, statement.Step());
  if (!row) return absl::DataLossError(absl::StrFormat("%s: no row", sql));
  return statement.ColumnInt(0);
}

absl::StatusOr<std::string> Connection::QueryText(std::string_view sql) {
  FATHOM_ASSIGN_OR_RETURN(Statement statement, Prepare(sql));
  FATHOM_ASSIGN_OR_RETURN(const bool row, statement.Step());
  if (!row) return absl::DataLossError(absl::StrFormat("%s: no row", sql));
  return statement.ColumnText(0);
}

absl::StatusOr<int> Connection::CheckpointPassive() {
  int in_log = 0;
  int copied = 0;
  const int result = sqlite3_wal_checkpoint_v2(
      database_.get(), nullptr, SQLITE_CHECKPOINT_PASSIVE, &in_log, &copied);
  if (result != SQLITE_OK) return Error(result, "checkpoint");
  *log_frames_ = in_log - copied;
  return in_log - copied;
}

absl::Status Connection::CheckpointTruncate() {
  const int result = sqlite3_wal_checkpoint_v2(
      database_.get(), nullptr, SQLITE_CHECKPOINT_TRUNCATE, nullptr, nullptr);
  return result == SQLITE_OK ? absl::OkStatus()
                             : Error(result, "truncating checkpoint");
}

std::uint64_t Connection::LogBytes() const {
  sqlite3_stmt* prepared = nullptr;
  std::uint64_t page_bytes = 0;
  if (*log_frames_ != 0 &&
      sqlite3_prepare_v2(database_.get(), "PRAGMA page_size", -1, &prepared,
                         nullptr) == SQLITE_OK &&
      sqlite3_step(prepared) == SQLITE_ROW) {
    page_bytes = static_cast<std::uint64_t>(sqlite3_column_int(prepared, 0));
  }
  sqlite3_finalize(prepared);
  return static_cast<std::uint64_t>(*log_frames_) * (page_bytes + 24);
}

void Connection::CheckpointOnClose() {
  sqlite3_db_config(database_.get(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 0,
                    nullptr);
}

absl::Status Connection::BackupTo(const std::string& path) {
  FATHOM_ASSIGN_OR_RETURN(Connection copy, Open(path, Mode::kCreate));
  // Pages may reach the copy before the header that says so.
  FATHOM_ASSIGN_OR_RETURN(const std::int64_t version,
                          QueryInt("PRAGMA user_version"));
  if (version >= kFirstCheckedVersion) {
    FATHOM_RETURN_IF_ERROR(copy.CheckPages());
  }
  sqlite3_backup* backup = sqlite3_backup_init(copy.database_.get(), "main",
                                               database_.get(), "main");
  if (backup == nullptr) {
    return copy.Error(sqlite3_extended_errcode(copy.database_.get()), "backup");
  }
  // All pages in one step, so under one read lock: one moment.
  const int step = sqlite3_backup_step(backup, -1);
  sqlite3_backup_finish(backup);
  return step == SQLITE_DONE ? absl::OkStatus() : copy.Error(step, "backup");
}

absl::StatusOr<Transaction> Transaction::Begin(Connection& connection) {
  FATHOM_RETURN_IF_ERROR(connection.Execute("BEGIN IMMEDIATE"));
  return Transaction(connection);
}

absl::Status Transaction::Commit() {
  Connection& connection = *std::exchange(connection_, nullptr);
  absl::Status status = connection.Execute("COMMIT");
  // A COMMIT that failed may leave the transaction open; ending it anyway
  // costs nothing when it is closed already.
  if (!status.ok()) connection.Execute("ROLLBACK").IgnoreError();
  return status;
}

Transaction::~Transaction() {
  if (connection_ != nullptr) connection_->Execute("ROLLBACK").IgnoreError();
}

}  // namespace fathom::storage
