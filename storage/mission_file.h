// MissionFile: one mission on disk, in one SQLite file that survives power cut.
//
// Promises, each tested:
//  1. When Commit returns OK the whole batch is on the disk (fsynced);
//     otherwise none of it will be found there, except after INTERNAL (an I/O
//     error, which may strike between writing and knowing): then it is all or
//     nothing, and this object refuses everything from there on.
//  2. At every instant, kill -9 and power cut included, the file equals a
//     checkpoint and the journal behind it (mission_records.h).
//  3. A file that is not ours, or newer than this program, is refused and not
//     one byte of it is changed.
//  4. One process at a time: a second Open or Create is refused.
//
// How: write-ahead log with synchronous=FULL; exactly one connection writes
// and checkpoints the log (SQLite 3.40's WAL-reset bug needs two), others read
// only. The log is copied into the file when it has grown past
// kWalCheckpointBytes and at idle, never inside Commit's fsync path
// automatically. docs/storage_format.md describes the file to the byte.
//
// Thread safety: LimitHistory, Commit, Load, CopyLog and Close belong to one
// thread at a time (the storage thread); ReadContactHistory(In), Status,
// SaveCopy, Verify and metadata may be called from any thread at any time.

#ifndef FATHOM_STORAGE_MISSION_FILE_H_
#define FATHOM_STORAGE_MISSION_FILE_H_

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"
#include "map/contacts/contact.h"
#include "map/geodesy/ids.h"
#include "storage/history_table.h"
#include "storage/migrate.h"
#include "storage/mission_records.h"
#include "storage/verify.h"

namespace fathom::storage {

// "Fthm" in ASCII: the application_id of our files.
inline constexpr std::int32_t kApplicationId = 0x4674686D;

// The user_version that this program writes, and the oldest that it reads.
// Older ones were never released.
inline constexpr int kSchemaVersion = 9;
inline constexpr int kOldestSchemaVersion = 5;

// Size of the write-ahead log beyond which Commit copies it into the file
// after its fsync. Big enough that the copy is rare beside the commits (a
// second of heavy ingest), small enough that a crash replays it in well under
// a second.
inline constexpr std::uint64_t kWalCheckpointBytes = 32ull << 20;

// Once the log has been copied it is cut down to this (journal_size_limit). It
// grows beyond only while a reader holds an old state: MissionFile's own reads
// of history are short, those of SaveCopy and Verify last as long as a start.
inline constexpr std::uint64_t kWalKeepBytes = 64ull << 20;

// The file at a glance.
struct MissionFileStatus {
  // Without and of the write-ahead log.
  std::uint64_t file_bytes = 0;
  std::uint64_t wal_bytes = 0;
  // Records behind the last checkpoint.
  std::uint64_t journal_records = 0;
  // Every change up to this revision is on the disk.
  std::uint64_t durable_revision = 0;
  std::uint64_t checkpoint_revision = 0;
  // The log is beyond kWalKeepBytes: a reader keeps it from being copied.
  bool log_starved = false;
  // Of the contact history: what is in blocks (the newest estimates, a block of
  // each contact and what comes until its turn, come on top), and what the
  // limits let go.
  HistoryTotal history;
  HistoryLimits history_limits;
};

// What SaveCopy wrote.
struct SavedCopy {
  std::uint64_t bytes = 0;
  // Of the map in it.
  std::uint64_t revision = 0;
  std::string digest;
};

class MissionFile {
 public:
  // Makes a new mission at `path` and opens it. The file appears under its
  // name complete or not at all.
  //
  // Errors: ALREADY_EXISTS (something is at `path`), INVALID_ARGUMENT
  // (metadata out of the ranges stated), FAILED_PRECONDITION (in use), and
  // those of sqlite.h.
  static absl::StatusOr<std::unique_ptr<MissionFile>> Create(
      const std::string& path, const MissionMetadata& metadata);

  // Opens the mission at `path`; what a crash left in the log is recovered,
  // and one of an older format brought to ours (migrate.h), which may take
  // minutes and tells `progress`.
  //
  // Errors: NOT_FOUND; FAILED_PRECONDITION if it is in use (naming the
  // process), is no mission of ours, or was written by a newer program - the
  // file is then untouched; DATA_LOSS if it is damaged; those of sqlite.h.
  static absl::StatusOr<std::unique_ptr<MissionFile>> Open(
      const std::string& path, const MigrationProgress& progress = {});

  // Closes as Close does; errors are lost.
  ~MissionFile();
  MissionFile(const MissionFile&) = delete;
  MissionFile& operator=(const MissionFile&) = delete;

  // Writes `batch` in one transaction. OK: it is on the disk. An empty batch
  // does nothing.
  //
  // With a checkpoint, everything that differs between its two views is
  // written, and the journal up to now->revision() goes, this batch's own
  // records included.
  //
  // Errors: RESOURCE_EXHAUSTED (disk full: nothing was written, the same
  // batch may be committed later), INVALID_ARGUMENT (revisions not
  // ascending), FAILED_PRECONDITION (`previous` is not the view of the file's
  // last checkpoint; a journal that was not loaded), INTERNAL (see promise 1),
  // DATA_LOSS (a damaged page or block is in the way; nothing was written, and
  // nothing that is damaged is written over). DATA_LOSS of Open, Load and
  // Commit tells how to repair the mission.
  absl::Status Commit(const Batch& batch);

  // How much of the contact history is kept (all of it, until this is called).
  void LimitHistory(const HistoryLimits& limits);

  // Reads the whole mission. Before the first Commit to a file that has a
  // journal, whose part of the contact history is made again here. A blob whose
  // checksum fails is DATA_LOSS naming the block, contact or segment; only a
  // tile is left out and told in Loaded::damage (quarantine.h). Tiles are
  // decoded on up to four threads, ended when it returns; when those without
  // children take `unpacked_tile_bytes` the others come packed, for a map whose
  // GlobalMapOptions::memory has kTileCodec. Cost: about 30 ns of processor
  // time per leaf.
  absl::StatusOr<Loaded> Load(
      std::uint64_t unpacked_tile_bytes = map::TileMemoryOptions::kUnlimited);

  // Copies the log into the file as far as no reader is in the way; for idle
  // moments. Never waits. Commit does it by size.
  absl::Status CopyLog();

  // Copies the log, cuts it to nothing, and closes: the mission is then one
  // file. No other call may follow. Idempotent.
  absl::Status Close();

  // Calls `visit` for the contact's estimates with from <= time <= to, oldest
  // first, until it returns false. It must not call this object. Waits for
  // other callers of this function, never for Commit.
  // Errors: NOT_FOUND (the contact was never reported); FAILED_PRECONDITION
  // (closed); those of sqlite.h.
  absl::Status ReadContactHistory(
      const map::ContactKey& key, Time from, Time to,
      const std::function<bool(const ContactHistoryRow&)>& visit);

  // The estimates of all contacts with from <= time <= to whose position lies
  // within `area`: by contact, oldest first. As above. Errors:
  // RESOURCE_EXHAUSTED past `max_rows`; CANCELLED soon after `stop`, if there
  // is one, is true; FAILED_PRECONDITION (closed); those of sqlite.h.
  absl::StatusOr<std::vector<ContactHistoryRow>> ReadContactHistoryIn(
      const HistoryArea& area, Time from, Time to, std::size_t max_rows,
      const std::atomic<bool>* stop = nullptr);

  // Writes a consistent copy, as of the last commit, to `path` (which must
  // not exist) while work goes on: copied, fsynced, proved (verify.h), and
  // only then given its name. Cost: a start's, and memory for another map.
  // Errors: ALREADY_EXISTS; DATA_LOSS naming the first problem; those of
  // sqlite.h. No partial file stays.
  absl::StatusOr<SavedCopy> SaveCopy(const std::string& path);

  // Proves the mission as of the last commit, while work goes on (verify.h).
  absl::StatusOr<Proof> Verify();

  MissionFileStatus Status() const;
  const MissionMetadata& metadata() const;
  const std::string& path() const;

 private:
  class Impl;
  explicit MissionFile(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_MISSION_FILE_H_
