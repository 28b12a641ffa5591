// MapKeeper: the one writer of the map. No gRPC, no protobuf, no SQL.
//
//   Submit -> queue -> mapper thread: dedupe, apply, publish a view
//                   -> storage thread: group commit -> durable callbacks
//
// Invariants:
//  1. Only the mapper thread touches the ObstacleMap; everyone else reads
//     immutable views, which are swapped under a mutex held for a pointer
//     copy.
//  2. What was submitted first is applied first and durable first.
//  3. A view is published before its messages are told applied; they are
//     committed and fsynced before they are told durable.
//  4. Work under way (submitted, not yet durable) is bounded in messages and
//     bytes; a stream holds at most one message beyond the bound.
//  5. After a storage fault nothing new is taken until the waiting batch is
//     committed (where the file is damaged: never); queries go on; nothing
//     that was told durable is lost.
//
// All changes of the file that are not in the journal (transfer, import) are
// made durable by a checkpoint: the view at that moment, which the storage
// thread encodes while the mapper goes on.
//
// Lock order: none is held while another is taken, nor during a callback.
// Thread-safe.

#ifndef FATHOM_SERVER_MAP_KEEPER_H_
#define FATHOM_SERVER_MAP_KEEPER_H_

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/mutex.h"
#include "base/published.h"
#include "base/time.h"
#include "map/obstacle_map/obstacle_map.h"
#include "server/ingest.h"
#include "server/limits.h"
#include "server/mission_store.h"
#include "server/revision_gate.h"
#include "server/source_ledger.h"

namespace fathom::server {

// Bounds of a keeper; the defaults are the server's, tests take smaller ones.
struct KeeperOptions {
  size_t max_pending_ingest = kMaxPendingIngest;
  size_t max_pending_bytes = kMaxPendingIngestBytes;
  size_t max_pending_commands = kMaxPendingCommands;
  size_t max_messages_per_view = kMaxMessagesPerView;
  size_t journal_max_records = kJournalMaxRecords;
  std::chrono::microseconds view_interval = kViewInterval;
  std::chrono::microseconds commit_interval = kCommitInterval;
  std::chrono::milliseconds storage_retry_delay = kStorageRetryDelay;
  // Called once, on the storage thread, when the file must not be written any
  // more (I/O error, failed fsync): the program should end. Without it the
  // keeper only stays in fault, as it does where the file is damaged.
  std::function<void(const absl::Status&)> on_fatal = nullptr;
};

// Whether another message may follow.
enum class Room {
  kSome,
  // Wait for OnRoom before submitting again.
  kNone,
};

// The result of a command and the revision that shows it.
template <typename Result>
struct Applied {
  Result result;
  uint64_t revision = 0;
};
template <typename Result>
using Done = std::function<void(absl::StatusOr<Applied<Result>>)>;

// For commands whose only result is the revision.
struct Nothing {};

// Which tile of which import a block is. Tiles of an id count from 1 and are
// taken in order, each once. An empty id: not remembered.
struct ImportTile {
  std::string import_id;
  uint64_t number = 0;
};

// What became of a tile. Skipped: the map held it already; nothing changed, all
// counts are 0.
struct ImportedTile {
  map::ImportResult result;
  bool skipped = false;
};

// State of the way to the disk.
struct StorageState {
  // Every change up to this revision survives a power cut.
  uint64_t durable_revision = 0;
  // Journal records behind the last checkpoint.
  uint64_t journal_records = 0;
  // Why nothing new is taken; empty: all is well.
  std::string fault;
  // The fault is damage of the file: it does not pass.
  bool damaged = false;
};

// See file comment.
class MapKeeper {
 public:
  // What a mission file held.
  struct Restored {
    // The map as of the last checkpoint, with the journal replayed on it.
    std::unique_ptr<map::ObstacleMap> map;
    // The view before the replay: what the file's snapshot holds.
    std::shared_ptr<const map::ObstacleMapView> checkpoint;
    SourceLedger ledger;
    // Records that were replayed.
    size_t journal_records = 0;
    // What could not be read and was left out, for people.
    std::vector<std::string> damage;
  };

  // Starts the threads. `store` must outlive the keeper.
  MapKeeper(Restored restored, MissionStore& store, KeeperOptions options);
  // Stops, if Stop was not called.
  ~MapKeeper();
  MapKeeper(const MapKeeper&) = delete;
  MapKeeper& operator=(const MapKeeper&) = delete;

  // ---- Reading ----

  // The newest view. Costs a lock and a reference count.
  std::shared_ptr<const map::ObstacleMapView> View() const;

  // The newest view, once it is newer than `revision`, at `until` at the
  // latest. Blocks.
  std::shared_ptr<const map::ObstacleMapView> NextView(
      uint64_t revision, RevisionGate::Deadline until) const;

  // See RevisionGate::Wait.
  bool WaitForRevision(uint64_t revision, RevisionGate::Deadline deadline,
                       RevisionGate::Callback callback) {
    return gate_.Wait(revision, deadline, std::move(callback));
  }

  StorageState storage_state() const;

  // ---- Ingest ----

  // Takes one message of a stream; always, if the answer is OK, also beyond
  // the bound (by one a stream, invariant 4). Errors: RESOURCE_EXHAUSTED
  // (storage fault; the message was not taken), DATA_LOSS (the same: the
  // mission file is damaged), UNAVAILABLE (stopping).
  absl::StatusOr<Room> Submit(IngestMessage message,
                              std::shared_ptr<IngestListener> listener);

  // Takes all messages or none. Errors as Submit, and ABORTED if the queue
  // has no room for them now.
  absl::Status SubmitAll(std::vector<IngestMessage> messages,
                         const std::shared_ptr<IngestListener>& listener);

  // ---- Commands: `done` runs once, when the change is durable or was
  // refused, on a thread of the keeper's. Beside the map's own errors:
  // RESOURCE_EXHAUSTED (storage fault), DATA_LOSS (the mission file is
  // damaged), ABORTED (too many commands wait), UNAVAILABLE (stopping). ----

  void StartActivity(map::StartActivity event, Done<Nothing> done);
  void CompleteActivity(map::ActivityId id, bool discard,
                        Done<map::TransferResult> done);
  void Transfer(map::ActivityId id, Done<map::TransferResult> done);
  void DropContact(map::DropContact event, Done<Nothing> done);
  // One block of a chart. When the `last` is done it and all before it are
  // durable; the others tell when they are applied, but every
  // kImportCheckpointCells they wait for the disk too. The number of the tile
  // becomes durable in one transaction with it. Errors: FAILED_PRECONDITION
  // (tiles of the id before this one are missing), RESOURCE_EXHAUSTED (too many
  // ids).
  void Import(map::RasterBlock block, bool last, ImportTile tile,
              Done<ImportedTile> done);
  // The number of the import's last tile in the map; 0 if it has none.
  void FindImport(std::string import_id, Done<uint64_t> done);
  // Makes durable what a broken-off import has left in the map.
  void Checkpoint(Done<Nothing> done);

  // Tells all who wait for a revision that it does not come.
  void StopWaiting() { gate_.Close(); }

  // Takes nothing new, applies and commits what waits, makes a last
  // checkpoint, ends the threads. Returns whether everything is durable.
  // Errors: the storage fault that stands in the way. Idempotent.
  absl::Status Stop();

 private:
  using ViewPtr = std::shared_ptr<const map::ObstacleMapView>;
  using SteadyTime = std::chrono::steady_clock::time_point;

  // One step on the way to the disk, in the order of application.
  struct StorageItem {
    // What the journal, the history and the ledger keep of it.
    std::optional<storage::JournalRecord> record;
    // So many rows of the contact history, next of those handed on beside the
    // items (one by one they would cost two allocations a report).
    size_t history_rows = 0;
    std::optional<storage::SourcePosition> position;
    // Set: this view is to be saved whole, and with it how far imports got.
    ViewPtr checkpoint;
    std::vector<storage::SourcePosition> import_positions;
    // Revision of the map behind it.
    uint64_t revision = 0;
    // Of an ingest message: whom to tell, and what it took of the bound.
    std::shared_ptr<IngestListener> listener;
    MessageNumber number;
    size_t bytes = 0;
    // Of a command: told when durable, or why it never will be.
    std::function<void(const absl::Status&)> done;
    // Of a command: `done` does not wait for the disk.
    bool done_when_applied = false;
  };
  struct IngestCommand {
    IngestMessage message;
    std::shared_ptr<IngestListener> listener;
    size_t bytes = 0;
  };
  struct MapCommand {
    // Changes the map and fills the item. If the map refuses: tells the
    // caller and returns false.
    std::function<bool(StorageItem& item)> apply;
  };
  using Command = std::variant<IngestCommand, MapCommand>;
  struct Told {
    std::shared_ptr<IngestListener> listener;
    MessageOutcome outcome;
  };

  template <typename Result, typename Apply>
  void Enqueue(Done<Result> done, Apply apply);
  absl::Status Admit() const FATHOM_REQUIRES(mutex_);
  bool HasRoom() const FATHOM_REQUIRES(mutex_);
  void Push(IngestMessage message, std::shared_ptr<IngestListener> listener)
      FATHOM_REQUIRES(mutex_);

  // The mapper thread.
  void RunMapper();
  // False: stopping, and none is left. True without any: see to the tiles.
  bool TakeCommands(std::vector<Command>& commands);
  // Packs tiles of the global map that readers have unpacked beyond the budget,
  // and frees what nobody reads any more.
  void KeepTileBudget();
  // Whether the mapper should not wait for more messages; wakes it if so, or
  // if it waits for the first.
  bool MapperIsDue() const FATHOM_REQUIRES(mutex_);
  void WakeMapper() FATHOM_REQUIRES(mutex_);
  MessageOutcome ApplyMessage(IngestMessage& message, StorageItem& item);
  void ApplyPing(IngestMessage& message, MessageOutcome& outcome,
                 StorageItem& item);
  void ApplyContact(IngestMessage& message, MessageOutcome& outcome,
                    StorageItem& item);
  // Keeps what came of a report or drop for the contact history.
  void AddHistory(map::ContactOutcome outcome, StorageItem& item);
  // Publishes the map as it is now.
  ViewPtr Publish();
  // The item will save `view`, which is the map as it is now, and all that must
  // be saved with it.
  void SaveAll(ViewPtr view, StorageItem& item);
  absl::StatusOr<ImportedTile> ApplyImport(const map::RasterBlock& block,
                                           bool last, const ImportTile& tile,
                                           StorageItem& item);
  // Takes the items; `items` is then empty and keeps its memory, or has that of
  // the last that the storage thread is done with.
  void HandToStorage(std::vector<StorageItem>& items, bool last);

  // So much is journalled that a snapshot is to cover it.
  bool CheckpointIsDue() const;
  // A snapshot covers all that was journalled up to the revision.
  void NoteCheckpoint(uint64_t revision);

  // The storage thread.
  void RunStorage();
  bool TakeItems(std::vector<StorageItem>& items,
                 std::vector<storage::ContactHistoryRow>& history);
  // Commits the items, again and again while the disk is full, and tells who
  // waits for them, part by part. An error: the keeper gave up; what is left of
  // the items is not durable.
  absl::Status CommitItems(std::vector<StorageItem>& items,
                           std::vector<storage::ContactHistoryRow>& history);
  absl::Status CommitBatch(const storage::Batch& batch,
                           const std::vector<StorageItem>& items);
  void EnterFault(const absl::Status& status,
                  const std::vector<StorageItem>& items);
  void TellDurable(std::span<StorageItem> items);
  void GiveUp(const absl::Status& status, std::vector<StorageItem>& items);

  const KeeperOptions options_;
  MissionStore& store_;

  // ---- Mapper thread only (and the constructor). ----
  std::unique_ptr<map::ObstacleMap> map_;
  SourceLedger ledger_;
  // Rows of what was applied since storage was handed something.
  std::vector<storage::ContactHistoryRow> history_;
  size_t records_since_checkpoint_ = 0;
  // Contact reports beside them.
  size_t reports_since_checkpoint_ = 0;
  // Of tiles that no checkpoint holds yet: the last number of each import, and
  // their cells.
  std::map<std::string, uint64_t> unsaved_imports_;
  uint64_t unsaved_import_cells_ = 0;
  uint64_t checkpoint_revision_ = 0;
  // When the last batch of several messages began: the next one may wait for
  // company. Epoch: the last batch was a single one.
  SteadyTime paced_from_{};

  // ---- Storage thread only (and the constructor). ----
  ViewPtr saved_view_;
  // As paced_from_, for commits.
  SteadyTime commit_paced_from_{};

  // Published by the mapper thread (and the constructor).
  Published<map::ObstacleMapView> views_;
  mutable Mutex published_mutex_;
  mutable CondVar published_;
  uint64_t published_revision_ FATHOM_GUARDED_BY(published_mutex_) = 0;

  mutable Mutex mutex_;
  CondVar queue_changed_;
  CondVar storage_changed_;
  std::deque<Command> queue_ FATHOM_GUARDED_BY(mutex_);
  // The mapper waits for the first message, or for company of those that are
  // there: nobody wakes it for less.
  bool mapper_waits_ FATHOM_GUARDED_BY(mutex_) = false;
  bool mapper_paces_ FATHOM_GUARDED_BY(mutex_) = false;
  std::vector<StorageItem> to_store_ FATHOM_GUARDED_BY(mutex_);
  std::vector<storage::ContactHistoryRow> history_to_store_
      FATHOM_GUARDED_BY(mutex_);
  // Listeners that were told Room::kNone.
  std::vector<std::shared_ptr<IngestListener>> waiting_
      FATHOM_GUARDED_BY(mutex_);
  size_t pending_messages_ FATHOM_GUARDED_BY(mutex_) = 0;
  size_t pending_bytes_ FATHOM_GUARDED_BY(mutex_) = 0;
  size_t pending_commands_ FATHOM_GUARDED_BY(mutex_) = 0;
  bool stopping_ FATHOM_GUARDED_BY(mutex_) = false;
  bool mapper_ended_ FATHOM_GUARDED_BY(mutex_) = false;
  // Not OK: the storage thread gave up.
  absl::Status end_ FATHOM_GUARDED_BY(mutex_);
  StorageState storage_ FATHOM_GUARDED_BY(mutex_);

  RevisionGate gate_{kMaxRevisionWaiters};
  std::thread mapper_;
  std::thread storage_thread_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_MAP_KEEPER_H_
