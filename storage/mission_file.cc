#include "storage/mission_file.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/mutex.h"
#include "base/status_macros.h"
#include "storage/checkpoint_writer.h"
#include "storage/contact_history.h"
#include "storage/contact_table.h"
#include "storage/draft_file.h"
#include "storage/file_lock.h"
#include "storage/history_reader.h"
#include "storage/history_replay.h"
#include "storage/journal_codec.h"
#include "storage/loader.h"
#include "storage/migrate.h"
#include "storage/schema.h"
#include "storage/sqlite.h"
#include "storage/stream_positions.h"

namespace fathom::storage {
namespace {

namespace fs = std::filesystem;

// SQLite's page cache of the writing connection: holds the pages that a
// commit of a second of ingest touches.
constexpr char kWriterPragmas[] =
    "PRAGMA synchronous = FULL; "
    "PRAGMA cache_size = -16384; "
    "PRAGMA temp_store = MEMORY; "
    "PRAGMA mmap_size = 0; "
    "PRAGMA cell_size_check = ON; ";

// A reader may meet the writer's recovery of the log just after a start.
constexpr char kReaderPragmas[] =
    "PRAGMA busy_timeout = 2000; "
    "PRAGMA query_only = ON; "
    "PRAGMA mmap_size = 0; "
    "PRAGMA cell_size_check = ON; ";

// The same file has the same lock by whatever path it is named. Hard links
// are the exception: do not make any to a mission.
std::string CanonicalPath(const std::string& path) {
  std::error_code error;
  const fs::path canonical = fs::weakly_canonical(path, error);
  return error ? path : canonical.string();
}

std::uint64_t SizeOf(const std::string& path) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  return error ? 0 : size;
}

// Damage is told with what to do about it.
absl::Status ToRepair(const absl::Status& status, const std::string& path) {
  if (!absl::IsDataLoss(status)) return status;
  return absl::DataLossError(
      absl::StrFormat("%s; `fathom mission repair %s NEW` saves what is sound",
                      status.message(), path));
}

}  // namespace

class MissionFile::Impl {
 public:
  Impl(std::string path, FileLock lock)
      : path_(std::move(path)), lock_(std::move(lock)) {}

  // REQUIRES: the header has been checked.
  absl::Status OpenWriter(const MigrationProgress& progress);

  absl::Status Commit(const Batch& batch);
  void LimitHistory(const HistoryLimits& limits);
  absl::StatusOr<Loaded> Load(std::uint64_t unpacked_tile_bytes);
  absl::Status CopyLog();
  absl::Status Close();
  absl::Status ReadContactHistory(
      const map::ContactKey& key, Time from, Time to,
      const std::function<bool(const ContactHistoryRow&)>& visit);
  absl::StatusOr<std::vector<ContactHistoryRow>> ReadContactHistoryIn(
      const HistoryArea& area, Time from, Time to, std::size_t max_rows,
      const std::atomic<bool>* stop);
  absl::StatusOr<SavedCopy> SaveCopy(const std::string& path);
  absl::StatusOr<Proof> Verify();
  MissionFileStatus Status() const;

  const MissionMetadata& metadata() const { return metadata_; }
  const std::string& path() const { return path_; }

 private:
  // What a commit leaves behind when it has succeeded.
  struct Outcome {
    Positions reached;
    std::uint64_t durable_revision = 0;
    std::uint64_t checkpoint_revision = 0;
    std::uint64_t journal_records = 0;
  };

  absl::Status CheckBatch(const Batch& batch) const;
  absl::StatusOr<Outcome> WriteBatch(const Batch& batch);
  absl::Status WriteJournal(const std::vector<JournalSegment>& segments);
  absl::Status WritePositions(const Positions& reached);
  // What of the history waits goes into the file.
  absl::Status FlushHistory();
  static absl::StatusOr<Connection> OpenReader(const std::string& path);
  // Runs `read` on reader_ in one transaction.
  absl::Status ReadAtOneMoment(
      const std::function<absl::Status(Connection&)>& read);

  const std::string path_;
  // Held until all connections are closed: members die in reverse order.
  FileLock lock_;
  MissionMetadata metadata_;

  // The storage thread's.
  Connection writer_;
  std::optional<ContactTable> contacts_;
  std::unique_ptr<ContactHistory> history_;
  HistoryLimits limits_;
  // A journal is there whose part of the history nobody made again yet.
  bool must_load_ = false;
  Statement add_segment_;
  Statement set_position_;
  Positions positions_;
  // Log size at which Commit copies it: grows while a reader keeps the log
  // from starting over, so that commits do not copy in vain.
  std::uint64_t copy_at_bytes_ = kWalCheckpointBytes;
  // The first I/O error; nothing is written after it.
  absl::Status failed_;
  bool closed_ = false;

  mutable Mutex reader_mutex_;
  Connection reader_ FATHOM_GUARDED_BY(reader_mutex_);
  // Close lets go of history_.
  bool reads_closed_ FATHOM_GUARDED_BY(reader_mutex_) = false;

  mutable Mutex status_mutex_;
  MissionFileStatus status_ FATHOM_GUARDED_BY(status_mutex_);
};

absl::Status MissionFile::Impl::OpenWriter(const MigrationProgress& progress) {
  FATHOM_ASSIGN_OR_RETURN(
      writer_, Connection::Open(path_, Connection::Mode::kReadWrite));
  FATHOM_RETURN_IF_ERROR(CheckVersion(writer_));
  FATHOM_RETURN_IF_ERROR(writer_.Execute(kWriterPragmas));
  FATHOM_RETURN_IF_ERROR(writer_.Execute(
      absl::StrFormat("PRAGMA journal_size_limit = %d", kWalKeepBytes)));
  // A copy made by other tools may have left the log's mode behind.
  FATHOM_RETURN_IF_ERROR(
      writer_.QueryText("PRAGMA journal_mode = WAL").status());
  FATHOM_RETURN_IF_ERROR(Migrate(path_, writer_, progress));
  FATHOM_ASSIGN_OR_RETURN(metadata_, ReadMetadata(writer_));
  FATHOM_ASSIGN_OR_RETURN(const std::vector<SourcePosition> positions,
                          LoadSourcePositions(writer_));
  for (const SourcePosition& position : positions) {
    Raise(positions_, position.stream, position.source,
          {position.epoch, position.sequence});
  }
  FATHOM_ASSIGN_OR_RETURN(contacts_, ContactTable::Create(writer_));
  FATHOM_ASSIGN_OR_RETURN(history_,
                          ContactHistory::Create(writer_, *contacts_));
  FATHOM_ASSIGN_OR_RETURN(
      add_segment_,
      writer_.Prepare("INSERT INTO journal (first_revision, last_revision, "
                      "record_count, content) VALUES (?, ?, ?, ?)"));
  FATHOM_ASSIGN_OR_RETURN(
      set_position_,
      writer_.Prepare("INSERT OR REPLACE INTO source_position (stream, "
                      "source_id, epoch, sequence) VALUES (?, ?, ?, ?)"));
  FATHOM_ASSIGN_OR_RETURN(
      const std::int64_t checkpoint,
      writer_.QueryInt("SELECT checkpoint_revision FROM mission"));
  FATHOM_ASSIGN_OR_RETURN(
      const std::int64_t last,
      writer_.QueryInt("SELECT ifnull(max(last_revision), 0) FROM journal"));
  FATHOM_ASSIGN_OR_RETURN(
      const std::int64_t records,
      writer_.QueryInt("SELECT ifnull(sum(record_count), 0) FROM journal"));
  must_load_ = records > 0;
  MutexLock lock(status_mutex_);
  status_.history = history_->total();
  status_.checkpoint_revision = static_cast<std::uint64_t>(checkpoint);
  status_.durable_revision =
      static_cast<std::uint64_t>(std::max(checkpoint, last));
  status_.journal_records = static_cast<std::uint64_t>(records);
  return absl::OkStatus();
}

absl::Status MissionFile::Impl::CheckBatch(const Batch& batch) const {
  MutexLock lock(status_mutex_);
  std::uint64_t revision = status_.durable_revision;
  for (const JournalRecord& record : batch.journal) {
    // Covered by the last checkpoint already: will be left out.
    if (record.revision <= status_.checkpoint_revision) continue;
    if (record.revision < revision) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "journal revision %d comes after %d", record.revision, revision));
    }
    revision = record.revision;
  }
  if (!batch.checkpoint.has_value()) return absl::OkStatus();
  const Checkpoint& checkpoint = *batch.checkpoint;
  if (checkpoint.now == nullptr ||
      checkpoint.now->revision() < status_.checkpoint_revision) {
    return absl::InvalidArgumentError(
        absl::StrFormat("a checkpoint older than the file's, of revision %d",
                        status_.checkpoint_revision));
  }
  if (checkpoint.previous != nullptr &&
      checkpoint.previous->revision() != status_.checkpoint_revision) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "checkpoint.previous is of revision %d, the file's checkpoint of %d",
        checkpoint.previous->revision(), status_.checkpoint_revision));
  }
  return absl::OkStatus();
}

absl::Status MissionFile::Impl::WriteJournal(
    const std::vector<JournalSegment>& segments) {
  for (const JournalSegment& segment : segments) {
    add_segment_.BindUint(0, segment.first_revision);
    add_segment_.BindUint(1, segment.last_revision);
    add_segment_.BindUint(2, segment.record_count);
    add_segment_.BindBlob(3, segment.content);
    FATHOM_RETURN_IF_ERROR(add_segment_.Run());
  }
  return absl::OkStatus();
}

absl::Status MissionFile::Impl::WritePositions(const Positions& reached) {
  for (const auto& [key, sequence] : reached) {
    const auto held = positions_.find(key);
    if (held != positions_.end() && held->second >= sequence) continue;
    set_position_.BindInt(0, static_cast<std::int64_t>(key.first));
    set_position_.BindText(1, key.second.value);
    set_position_.BindUint(2, sequence.first);
    set_position_.BindUint(3, sequence.second);
    FATHOM_RETURN_IF_ERROR(set_position_.Run());
  }
  return absl::OkStatus();
}

absl::StatusOr<MissionFile::Impl::Outcome> MissionFile::Impl::WriteBatch(
    const Batch& batch) {
  Outcome outcome;
  {
    MutexLock lock(status_mutex_);
    outcome.durable_revision = status_.durable_revision;
    outcome.checkpoint_revision = status_.checkpoint_revision;
    outcome.journal_records = status_.journal_records;
  }
  if (batch.checkpoint.has_value()) {
    outcome.checkpoint_revision = batch.checkpoint->now->revision();
  }
  // Records that a checkpoint covers are not worth writing.
  const auto uncovered =
      std::find_if(batch.journal.begin(), batch.journal.end(),
                   [&](const JournalRecord& record) {
                     return record.revision > outcome.checkpoint_revision;
                   });
  // Encoded before the transaction: it then lasts as long as the disk does.
  FATHOM_ASSIGN_OR_RETURN(
      const std::vector<JournalSegment> segments,
      EncodeJournal(std::span(uncovered, batch.journal.end())));
  outcome.reached = PositionsReached(batch);

  FATHOM_ASSIGN_OR_RETURN(Transaction transaction, Transaction::Begin(writer_));
  FATHOM_RETURN_IF_ERROR(WriteJournal(segments));
  FATHOM_RETURN_IF_ERROR(history_->Write(
      batch.contact_history,
      batch.checkpoint.has_value() ? &*batch.checkpoint : nullptr, limits_));
  FATHOM_RETURN_IF_ERROR(WritePositions(outcome.reached));
  if (batch.checkpoint.has_value()) {
    FATHOM_RETURN_IF_ERROR(
        WriteCheckpoint(*batch.checkpoint, writer_, *contacts_));
    FATHOM_ASSIGN_OR_RETURN(
        const std::int64_t records,
        writer_.QueryInt("SELECT ifnull(sum(record_count), 0) FROM journal"));
    outcome.journal_records = static_cast<std::uint64_t>(records);
  } else {
    for (const JournalSegment& segment : segments) {
      outcome.journal_records += segment.record_count;
    }
  }
  FATHOM_RETURN_IF_ERROR(transaction.Commit());
  outcome.durable_revision =
      std::max({outcome.durable_revision, outcome.checkpoint_revision,
                segments.empty() ? 0 : segments.back().last_revision});
  return outcome;
}

absl::Status MissionFile::Impl::Commit(const Batch& batch) {
  if (closed_) return absl::FailedPreconditionError("the mission is closed");
  FATHOM_RETURN_IF_ERROR(failed_);
  if (batch.empty()) return absl::OkStatus();
  if (must_load_) {
    return absl::FailedPreconditionError(
        "the mission has a journal: Load it before the first Commit");
  }
  FATHOM_RETURN_IF_ERROR(CheckBatch(batch));
  absl::StatusOr<Outcome> outcome = WriteBatch(batch);
  if (!outcome.ok()) {
    contacts_->ForgetNumbers();
    history_->RolledBack();
    // After an I/O error nobody knows what is on the disk: no later OK could
    // be believed (a second fsync may succeed without having written).
    if (absl::IsInternal(outcome.status())) failed_ = outcome.status();
    return outcome.status();
  }
  for (auto& [key, sequence] : outcome->reached) {
    Raise(positions_, key.first, key.second, sequence);
  }
  history_->Committed(batch.contact_history);
  {
    MutexLock lock(status_mutex_);
    status_.history = history_->total();
    status_.durable_revision = outcome->durable_revision;
    status_.checkpoint_revision = outcome->checkpoint_revision;
    status_.journal_records = outcome->journal_records;
  }
  // The batch is safe in the log whatever becomes of the copying; an I/O
  // error there is told by the next Commit.
  const std::uint64_t log_bytes = writer_.LogBytes();
  {
    MutexLock lock(status_mutex_);
    status_.log_starved = log_bytes > kWalKeepBytes;
  }
  if (log_bytes < kWalCheckpointBytes) {
    copy_at_bytes_ = kWalCheckpointBytes;
  } else if (log_bytes >= copy_at_bytes_) {
    copy_at_bytes_ = log_bytes + kWalCheckpointBytes;
    CopyLog().IgnoreError();
  }
  return absl::OkStatus();
}

void MissionFile::Impl::LimitHistory(const HistoryLimits& limits) {
  limits_ = limits;
  MutexLock lock(status_mutex_);
  status_.history_limits = limits;
}

absl::StatusOr<Loaded> MissionFile::Impl::Load(
    std::uint64_t unpacked_tile_bytes) {
  FATHOM_ASSIGN_OR_RETURN(Loaded loaded,
                          LoadMission(writer_, unpacked_tile_bytes));
  if (must_load_) {
    FATHOM_ASSIGN_OR_RETURN(const std::vector<ContactHistoryRow> rows,
                            ReplayHistory(loaded));
    FATHOM_RETURN_IF_ERROR(history_->Adopt(rows));
    must_load_ = false;
  }
  return loaded;
}

absl::Status MissionFile::Impl::CopyLog() {
  if (closed_) return absl::FailedPreconditionError("the mission is closed");
  FATHOM_RETURN_IF_ERROR(failed_);
  if (writer_.LogBytes() == 0) return absl::OkStatus();
  absl::Status status = writer_.CheckpointPassive().status();
  if (absl::IsInternal(status)) failed_ = status;
  return status;
}

absl::Status MissionFile::Impl::FlushHistory() {
  if (history_->Contacts().empty()) return absl::OkStatus();
  FATHOM_ASSIGN_OR_RETURN(Transaction transaction, Transaction::Begin(writer_));
  FATHOM_RETURN_IF_ERROR(history_->Flush());
  return transaction.Commit();
}

absl::Status MissionFile::Impl::Close() {
  if (std::exchange(closed_, true)) return absl::OkStatus();
  {
    MutexLock lock(reader_mutex_);
    reader_ = Connection();
    reads_closed_ = true;
  }
  absl::Status status = failed_;
  if (history_ != nullptr && status.ok()) status = FlushHistory();
  history_.reset();
  contacts_.reset();
  add_segment_ = Statement();
  set_position_ = Statement();
  if (writer_.is_open() && status.ok()) {
    status = writer_.CheckpointTruncate();
    if (status.ok()) writer_.CheckpointOnClose();
  }
  writer_ = Connection();
  return status;
}

absl::StatusOr<Connection> MissionFile::Impl::OpenReader(
    const std::string& path) {
  FATHOM_ASSIGN_OR_RETURN(Connection reader,
                          Connection::Open(path, Connection::Mode::kReadOnly));
  FATHOM_RETURN_IF_ERROR(reader.Execute(kReaderPragmas));
  return reader;
}

absl::Status MissionFile::Impl::ReadAtOneMoment(
    const std::function<absl::Status(Connection&)>& read) {
  MutexLock lock(reader_mutex_);
  if (reads_closed_) {
    return absl::FailedPreconditionError("the mission is closed");
  }
  if (!reader_.is_open()) {
    FATHOM_ASSIGN_OR_RETURN(reader_, OpenReader(path_));
  }
  FATHOM_RETURN_IF_ERROR(reader_.Execute("BEGIN"));
  absl::Status status = read(reader_);
  const absl::Status ended = reader_.Execute("ROLLBACK");
  if (status.ok()) status = ended;
  return status;
}

absl::Status MissionFile::Impl::ReadContactHistory(
    const map::ContactKey& key, Time from, Time to,
    const std::function<bool(const ContactHistoryRow&)>& visit) {
  return ReadAtOneMoment([&](Connection& reader) {
    // Before the file: what goes into it meanwhile is then seen twice, not
    // missed.
    const HistoryTail tail = history_->Tail(key);
    return ReadHistory(reader, key, tail, from, to, visit);
  });
}

absl::StatusOr<std::vector<ContactHistoryRow>>
MissionFile::Impl::ReadContactHistoryIn(const HistoryArea& area, Time from,
                                        Time to, std::size_t max_rows,
                                        const std::atomic<bool>* stop) {
  absl::StatusOr<std::vector<ContactHistoryRow>> rows;
  FATHOM_RETURN_IF_ERROR(ReadAtOneMoment([&](Connection& reader) {
    // Before the file, as above.
    HistoryTails tails;
    for (const map::ContactKey& key : history_->Contacts()) {
      tails.emplace(key, history_->Tail(key));
    }
    rows = ReadHistoryIn(reader, area, tails, from, to, max_rows, stop);
    return rows.status();
  }));
  return rows;
}

absl::StatusOr<SavedCopy> MissionFile::Impl::SaveCopy(const std::string& path) {
  const std::string target = CanonicalPath(path);
  FATHOM_RETURN_IF_ERROR(CheckAbsent(target));
  FATHOM_ASSIGN_OR_RETURN(const FileLock lock, FileLock::Acquire(target));
  DraftFile draft(target);
  {
    // A connection of its own: a long copy keeps no history reader waiting.
    FATHOM_ASSIGN_OR_RETURN(Connection reader, OpenReader(path_));
    FATHOM_RETURN_IF_ERROR(reader.BackupTo(draft.path()));
  }
  Proof proof;
  {
    FATHOM_ASSIGN_OR_RETURN(Connection copy, OpenReader(draft.path()));
    FATHOM_ASSIGN_OR_RETURN(proof, ProveMission(copy));
  }
  if (!proof.problems.empty()) {
    return absl::DataLossError(absl::StrFormat(
        "the copy was not kept: %s (%d problems; VerifyMission tells them)",
        proof.problems.front(), proof.problems.size()));
  }
  FATHOM_RETURN_IF_ERROR(draft.Publish());
  return SavedCopy{.bytes = SizeOf(target),
                   .revision = proof.revision,
                   .digest = std::move(proof.digest)};
}

absl::StatusOr<Proof> MissionFile::Impl::Verify() {
  FATHOM_ASSIGN_OR_RETURN(Connection reader, OpenReader(path_));
  return ProveMission(reader);
}

MissionFileStatus MissionFile::Impl::Status() const {
  MissionFileStatus status;
  {
    MutexLock lock(status_mutex_);
    status = status_;
  }
  status.file_bytes = SizeOf(path_);
  status.wal_bytes = SizeOf(path_ + "-wal");
  return status;
}

MissionFile::MissionFile(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

MissionFile::~MissionFile() { impl_->Close().IgnoreError(); }

absl::StatusOr<std::unique_ptr<MissionFile>> MissionFile::Create(
    const std::string& path, const MissionMetadata& metadata) {
  FATHOM_ASSIGN_OR_RETURN(const MissionMetadata normal,
                          NormalMetadata(metadata));
  const std::string target = CanonicalPath(path);
  FATHOM_ASSIGN_OR_RETURN(FileLock lock, FileLock::Acquire(target));
  FATHOM_RETURN_IF_ERROR(CheckAbsent(target));
  {
    DraftFile draft(target);
    FATHOM_ASSIGN_OR_RETURN(
        Connection connection,
        Connection::Open(draft.path(), Connection::Mode::kCreate));
    FATHOM_RETURN_IF_ERROR(CreateSchema(connection, normal));
    FATHOM_RETURN_IF_ERROR(connection.CheckpointTruncate());
    connection.CheckpointOnClose();
    connection = Connection();
    FATHOM_RETURN_IF_ERROR(draft.Publish());
  }
  auto impl = std::make_unique<Impl>(target, std::move(lock));
  FATHOM_RETURN_IF_ERROR(impl->OpenWriter({}));
  return std::unique_ptr<MissionFile>(new MissionFile(std::move(impl)));
}

absl::StatusOr<std::unique_ptr<MissionFile>> MissionFile::Open(
    const std::string& path, const MigrationProgress& progress) {
  const std::string target = CanonicalPath(path);
  std::error_code error;
  if (!fs::is_regular_file(target, error)) {
    return absl::NotFoundError(
        absl::StrFormat("%s: no such mission file", path));
  }
  FATHOM_ASSIGN_OR_RETURN(FileLock lock, FileLock::Acquire(target));
  FATHOM_RETURN_IF_ERROR(CheckHeader(target));
  auto impl = std::make_unique<Impl>(target, std::move(lock));
  FATHOM_RETURN_IF_ERROR(ToRepair(impl->OpenWriter(progress), target));
  return std::unique_ptr<MissionFile>(new MissionFile(std::move(impl)));
}

absl::Status MissionFile::Commit(const Batch& batch) {
  return ToRepair(impl_->Commit(batch), path());
}
void MissionFile::LimitHistory(const HistoryLimits& limits) {
  impl_->LimitHistory(limits);
}
absl::StatusOr<Loaded> MissionFile::Load(std::uint64_t unpacked_tile_bytes) {
  absl::StatusOr<Loaded> loaded = impl_->Load(unpacked_tile_bytes);
  if (!loaded.ok()) return ToRepair(loaded.status(), path());
  return loaded;
}
absl::Status MissionFile::CopyLog() { return impl_->CopyLog(); }
absl::Status MissionFile::Close() { return impl_->Close(); }

absl::Status MissionFile::ReadContactHistory(
    const map::ContactKey& key, Time from, Time to,
    const std::function<bool(const ContactHistoryRow&)>& visit) {
  return impl_->ReadContactHistory(key, from, to, visit);
}

absl::StatusOr<std::vector<ContactHistoryRow>>
MissionFile::ReadContactHistoryIn(const HistoryArea& area, Time from, Time to,
                                  std::size_t max_rows,
                                  const std::atomic<bool>* stop) {
  return impl_->ReadContactHistoryIn(area, from, to, max_rows, stop);
}
absl::StatusOr<SavedCopy> MissionFile::SaveCopy(const std::string& path) {
  return impl_->SaveCopy(path);
}
absl::StatusOr<Proof> MissionFile::Verify() { return impl_->Verify(); }

MissionFileStatus MissionFile::Status() const { return impl_->Status(); }
const MissionMetadata& MissionFile::metadata() const {
  return impl_->metadata();
}
const std::string& MissionFile::path() const { return impl_->path(); }

}  // namespace fathom::storage
