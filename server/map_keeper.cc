#include "server/map_keeper.h"

#include <algorithm>
#include <iterator>
#include <type_traits>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/history_replay.h"

namespace fathom::server {
namespace {

// What a message takes of the bound in bytes: its own memory.
size_t BytesOf(const IngestMessage& message) {
  size_t bytes = sizeof(message) + message.source.value.size();
  if (const auto* ping = std::get_if<map::Ping>(&message.content)) {
    bytes += ping->beams.size() * sizeof(map::Beam);
  }
  return bytes;
}

storage::SourcePosition PositionOf(const IngestMessage& message) {
  return {.stream = message.kind,
          .source = message.source,
          .epoch = message.number.epoch,
          .sequence = message.number.sequence};
}

// Tells what the map's own refusal means.
std::string Describe(map::RejectReason reason, size_t max_contacts) {
  switch (reason) {
    case map::RejectReason::kGated:
      return "too far from where the contact can be; if the next report agrees "
             "with it the track begins anew";
    case map::RejectReason::kTooLate:
      return absl::StrFormat(
          "more than %d s or %d reports older than the newest report about "
          "this contact, or before its drop",
          map::kLateWindow.count(), map::kRecentReports);
    case map::RejectReason::kContactsFull:
      return absl::StrFormat(
          "the contact list is full: max_contacts=%d are live; drop contacts "
          "that are gone",
          max_contacts);
    case map::RejectReason::kBadLink:
      return absl::StrFormat(
          "same_as would give one contact more than %d other names; or nothing "
          "is observed and none of those named is live: send a fix",
          map::kMaxLinkedNames);
    default:
      return absl::StrFormat("refused: %s", map::RejectReasonName(reason));
  }
}

}  // namespace

MapKeeper::MapKeeper(Restored restored, MissionStore& store,
                     KeeperOptions options)
    : options_(std::move(options)),
      store_(store),
      map_(std::move(restored.map)),
      ledger_(std::move(restored.ledger)),
      records_since_checkpoint_(restored.journal_records),
      checkpoint_revision_(restored.checkpoint ? restored.checkpoint->revision()
                                               : 0),
      saved_view_(restored.checkpoint ? restored.checkpoint->AtRest()
                                      : nullptr) {
  storage_.journal_records = restored.journal_records;
  storage_.durable_revision = map_->revision();
  Publish();
  mapper_ = std::thread([this] { RunMapper(); });
  storage_thread_ = std::thread([this] { RunStorage(); });
}

MapKeeper::~MapKeeper() { (void)Stop(); }

absl::Status MapKeeper::Stop() {
  {
    MutexLock lock(mutex_);
    stopping_ = true;
    queue_changed_.NotifyAll();
    storage_changed_.NotifyAll();
  }
  if (mapper_.joinable()) mapper_.join();
  if (storage_thread_.joinable()) storage_thread_.join();
  gate_.Close();
  MutexLock lock(mutex_);
  return end_;
}

// ---- Reading ----

std::shared_ptr<const map::ObstacleMapView> MapKeeper::View() const {
  return views_.Get();
}

std::shared_ptr<const map::ObstacleMapView> MapKeeper::NextView(
    uint64_t revision, RevisionGate::Deadline until) const {
  {
    MutexLock lock(published_mutex_);
    while (published_revision_ <= revision &&
           published_.WaitUntil(published_mutex_, until)) {
    }
  }
  return views_.Get();
}

StorageState MapKeeper::storage_state() const {
  MutexLock lock(mutex_);
  return storage_;
}

// ---- Ingest ----

absl::Status MapKeeper::Admit() const {
  if (!storage_.fault.empty()) {
    return storage_.damaged ? absl::DataLossError(storage_.fault)
                            : absl::ResourceExhaustedError(storage_.fault);
  }
  if (stopping_) return absl::UnavailableError("the server is shutting down");
  return absl::OkStatus();
}

bool MapKeeper::HasRoom() const {
  return pending_messages_ < options_.max_pending_ingest &&
         pending_bytes_ < options_.max_pending_bytes;
}

void MapKeeper::Push(IngestMessage message,
                     std::shared_ptr<IngestListener> listener) {
  const size_t bytes = BytesOf(message);
  pending_messages_ += 1;
  pending_bytes_ += bytes;
  queue_.emplace_back(IngestCommand{.message = std::move(message),
                                    .listener = std::move(listener),
                                    .bytes = bytes});
}

absl::StatusOr<Room> MapKeeper::Submit(
    IngestMessage message, std::shared_ptr<IngestListener> listener) {
  MutexLock lock(mutex_);
  FATHOM_RETURN_IF_ERROR(Admit());
  Push(std::move(message), listener);
  const bool room = HasRoom();
  if (!room) waiting_.push_back(std::move(listener));
  WakeMapper();
  return room ? Room::kSome : Room::kNone;
}

absl::Status MapKeeper::SubmitAll(
    std::vector<IngestMessage> messages,
    const std::shared_ptr<IngestListener>& listener) {
  MutexLock lock(mutex_);
  FATHOM_RETURN_IF_ERROR(Admit());
  if (pending_messages_ + messages.size() > options_.max_pending_ingest) {
    return absl::AbortedError("the queue has no room for the batch");
  }
  for (IngestMessage& message : messages) Push(std::move(message), listener);
  WakeMapper();
  return absl::OkStatus();
}

// ---- Commands ----

template <typename Result, typename Apply>
void MapKeeper::Enqueue(Done<Result> done, Apply apply) {
  // Shared, because std::function copies and `done` is told by one of two.
  auto told = std::make_shared<Done<Result>>(std::move(done));
  MapCommand command;
  command.apply = [this, told, apply = std::move(apply)](StorageItem& item) {
    absl::StatusOr<Result> result = apply(item);
    if (!result.ok()) {
      (*told)(result.status());
      return false;
    }
    item.revision = map_->revision();
    item.done = [told, result = *std::move(result),
                 revision = item.revision](const absl::Status& status) {
      if (!status.ok()) {
        (*told)(status);
      } else {
        (*told)(Applied<Result>{.result = result, .revision = revision});
      }
    };
    return true;
  };
  absl::Status admitted;
  {
    MutexLock lock(mutex_);
    admitted = Admit();
    if (admitted.ok() && pending_commands_ >= options_.max_pending_commands) {
      admitted = absl::AbortedError("too many commands wait");
    }
    if (admitted.ok()) {
      pending_commands_ += 1;
      queue_.emplace_back(std::move(command));
      WakeMapper();
      return;
    }
  }
  (*told)(admitted);
}

void MapKeeper::StartActivity(map::StartActivity event, Done<Nothing> done) {
  Enqueue(std::move(done),
          [this, event = std::move(event)](
              StorageItem& item) -> absl::StatusOr<Nothing> {
            FATHOM_RETURN_IF_ERROR(map_->Start(event));
            item.record = storage::JournalRecord{map_->revision(), event};
            return Nothing{};
          });
}

void MapKeeper::CompleteActivity(map::ActivityId id, bool discard,
                                 Done<map::TransferResult> done) {
  Enqueue(std::move(done),
          [this, id = std::move(id),
           discard](StorageItem& item) -> absl::StatusOr<map::TransferResult> {
            auto result = map_->Complete(id, discard);
            if (result.ok()) SaveAll(Publish(), item);
            return result;
          });
}

void MapKeeper::Transfer(map::ActivityId id, Done<map::TransferResult> done) {
  Enqueue(std::move(done),
          [this, id = std::move(id)](
              StorageItem& item) -> absl::StatusOr<map::TransferResult> {
            auto result = map_->Transfer(id);
            if (result.ok()) SaveAll(Publish(), item);
            return result;
          });
}

void MapKeeper::DropContact(map::DropContact event, Done<Nothing> done) {
  Enqueue(
      std::move(done),
      [this,
       event = std::move(event)](StorageItem& item) -> absl::StatusOr<Nothing> {
        FATHOM_ASSIGN_OR_RETURN(map::ContactOutcome outcome, map_->Drop(event));
        item.record = storage::JournalRecord{map_->revision(), event};
        AddHistory(std::move(outcome), item);
        return Nothing{};
      });
}

void MapKeeper::Import(map::RasterBlock block, bool last, ImportTile tile,
                       Done<ImportedTile> done) {
  // Shared, because std::function copies and a block holds megabytes.
  auto shared = std::make_shared<const map::RasterBlock>(std::move(block));
  Enqueue(std::move(done),
          [this, shared, last, tile = std::move(tile)](StorageItem& item) {
            return ApplyImport(*shared, last, tile, item);
          });
}

void MapKeeper::FindImport(std::string import_id, Done<uint64_t> done) {
  Enqueue(std::move(done),
          [this, import_id = std::move(import_id)](
              StorageItem& item) -> absl::StatusOr<uint64_t> {
            item.done_when_applied = true;
            return ledger_.Newest(StreamKind::kImports, {import_id}).sequence;
          });
}

void MapKeeper::Checkpoint(Done<Nothing> done) {
  Enqueue(std::move(done),
          [this](StorageItem& item) -> absl::StatusOr<Nothing> {
            SaveAll(Publish(), item);
            return Nothing{};
          });
}

// ---- The mapper thread ----

bool MapKeeper::MapperIsDue() const {
  // A full batch; or somebody waits for a command or for room.
  return stopping_ || queue_.size() >= options_.max_messages_per_view ||
         pending_commands_ > 0 || !waiting_.empty();
}

void MapKeeper::WakeMapper() {
  if (mapper_waits_ || (mapper_paces_ && MapperIsDue())) {
    queue_changed_.NotifyOne();
  }
}

bool MapKeeper::TakeCommands(std::vector<Command>& commands) {
  // What is packed may be unpacked by readers meanwhile.
  const bool any_packed =
      map_->tile_use().packed_tiles > 0 || map_->over_budget();
  MutexLock lock(mutex_);
  while (queue_.empty() && !stopping_) {
    mapper_waits_ = true;
    bool in_time = true;
    if (any_packed) {
      in_time = queue_changed_.WaitFor(mutex_, kTileBudgetInterval);
    } else {
      queue_changed_.Wait(mutex_);
    }
    mapper_waits_ = false;
    if (!in_time && queue_.empty() && !stopping_) return true;
  }
  if (paced_from_ != SteadyTime{}) {
    const SteadyTime due = paced_from_ + options_.view_interval;
    mapper_paces_ = true;
    while (!MapperIsDue() && queue_changed_.WaitUntil(mutex_, due)) {
    }
    mapper_paces_ = false;
  }
  const size_t count = std::min(queue_.size(), options_.max_messages_per_view);
  paced_from_ = count > 1 ? std::chrono::steady_clock::now() : SteadyTime{};
  const auto end = queue_.begin() + static_cast<std::ptrdiff_t>(count);
  commands.assign(std::make_move_iterator(queue_.begin()),
                  std::make_move_iterator(end));
  queue_.erase(queue_.begin(), end);
  return count > 0;
}

void MapKeeper::RunMapper() {
  std::vector<Command> commands;
  std::vector<Told> told;
  std::vector<std::function<void(const absl::Status&)>> applied;
  std::vector<StorageItem> items;
  while (TakeCommands(commands)) {
    if (commands.empty()) {
      KeepTileBudget();
      continue;
    }
    items.reserve(commands.size() + 1);
    size_t refused_commands = 0;
    bool any_record = false;
    for (Command& command : commands) {
      StorageItem item;
      if (auto* ingest = std::get_if<IngestCommand>(&command)) {
        MessageOutcome outcome = ApplyMessage(ingest->message, item);
        item.listener = ingest->listener;
        item.number = ingest->message.number;
        item.bytes = ingest->bytes;
        told.push_back({std::move(ingest->listener), std::move(outcome)});
      } else if (!std::get<MapCommand>(command).apply(item)) {
        refused_commands += 1;
        continue;
      } else if (item.done_when_applied) {
        refused_commands += 1;
        applied.push_back(std::move(item.done));
        continue;
      }
      item.revision = map_->revision();
      if (item.record.has_value()) {
        const bool report =
            std::holds_alternative<storage::ContactRecord>(item.record->event);
        (report ? reports_since_checkpoint_ : records_since_checkpoint_) += 1;
        any_record = true;
      }
      if (item.checkpoint != nullptr) {
        NoteCheckpoint(item.checkpoint->revision());
      }
      items.push_back(std::move(item));
    }
    commands.clear();
    const ViewPtr view = Publish();
    // A ping's prior may have been read from tiles that no checkpoint holds:
    // replayed without them it would give another map. So what is journalled
    // beside such tiles is committed in one transaction with them.
    const bool tiles_unsaved = unsaved_import_cells_ > 0 && any_record;
    if (tiles_unsaved || CheckpointIsDue()) {
      StorageItem item;
      SaveAll(view, item);
      item.revision = view->revision();
      items.push_back(std::move(item));
      NoteCheckpoint(view->revision());
    }
    for (const Told& message : told) {
      message.listener->OnApplied(message.outcome);
    }
    told.clear();
    for (const auto& done : applied) done(absl::OkStatus());
    applied.clear();
    if (refused_commands > 0) {
      MutexLock lock(mutex_);
      pending_commands_ -= refused_commands;
    }
    HandToStorage(items, /*last=*/false);
  }
  if (map_->revision() != checkpoint_revision_) {
    // A snapshot at the end makes the next start quick.
    StorageItem& item = items.emplace_back();
    SaveAll(Publish(), item);
    item.revision = map_->revision();
  }
  HandToStorage(items, /*last=*/true);
}

MessageOutcome MapKeeper::ApplyMessage(IngestMessage& message,
                                       StorageItem& item) {
  MessageOutcome outcome;
  outcome.number = message.number;
  const Judgement judgement =
      ledger_.Take(message.kind, message.source, message.number);
  outcome.missing = judgement.missing;
  switch (judgement.verdict) {
    case Verdict::kDuplicate:
      outcome.fate = MessageFate::kDuplicate;
      break;
    case Verdict::kOldEpoch:
      outcome.fate = MessageFate::kRefused;
      outcome.refusal = {map::RejectReason::kInvalidMessage, "epoch",
                         "is older than the source's newest epoch"};
      break;
    case Verdict::kFull:
      outcome.fate = MessageFate::kRefused;
      outcome.refusal = {map::RejectReason::kInvalidMessage, "source_id",
                         "the mission has taken in as many sources as it can"};
      break;
    case Verdict::kNew:
      if (std::holds_alternative<map::Ping>(message.content)) {
        ApplyPing(message, outcome, item);
      } else if (std::holds_alternative<map::ContactReport>(message.content)) {
        ApplyContact(message, outcome, item);
      } else {
        outcome.fate = MessageFate::kRefused;
        outcome.refusal = std::get<Refusal>(std::move(message.content));
      }
      if (!item.record.has_value()) {
        item.position = PositionOf(message);
      }
      break;
  }
  outcome.revision = map_->revision();
  return outcome;
}

void MapKeeper::ApplyPing(IngestMessage& message, MessageOutcome& outcome,
                          StorageItem& item) {
  auto& ping = std::get<map::Ping>(message.content);
  auto result = map_->ApplyPing(ping);
  if (!result.ok()) {
    outcome.fate = MessageFate::kRefused;
    outcome.refusal = {map::RejectReason::kNoActivity, "activity_id",
                       std::string(result.status().message())};
    return;
  }
  outcome.accepted = result->accepted;
  outcome.rejects = result->rejects;
  item.record = storage::JournalRecord{
      map_->revision(), storage::PingRecord{.source = message.source,
                                            .epoch = message.number.epoch,
                                            .sequence = message.number.sequence,
                                            .ping = std::move(ping)}};
}

void MapKeeper::ApplyContact(IngestMessage& message, MessageOutcome& outcome,
                             StorageItem& item) {
  auto& report = std::get<map::ContactReport>(message.content);
  const uint64_t revision_before = map_->revision();
  map::ContactOutcome result = map_->ApplyContact(report);
  if (!result.applied) {
    const auto reason =
        result.reason.value_or(map::RejectReason::kInvalidMessage);
    outcome.fate = MessageFate::kRefused;
    outcome.refusal = {reason, "",
                       Describe(reason, map_->options().contacts.max_contacts)};
    // A refusal that the map counts is replayed like any other event.
    if (map_->revision() == revision_before) return;
  }
  // A refused one may have them too: a late outlier changes what the outlier
  // after it was taken for.
  AddHistory(std::move(result), item);
  item.record = storage::JournalRecord{
      map_->revision(),
      storage::ContactRecord{.epoch = message.number.epoch,
                             .sequence = message.number.sequence,
                             .report = std::move(report)}};
}

void MapKeeper::AddHistory(map::ContactOutcome outcome, StorageItem& item) {
  const size_t before = history_.size();
  storage::AppendHistoryRows(std::move(outcome), map_->revision(), history_);
  item.history_rows = history_.size() - before;
}

void MapKeeper::KeepTileBudget() {
  // Of the same revision: nothing changes but what is held in memory.
  if (map_->over_budget()) Publish();
  views_.FreeReplaced();
}

MapKeeper::ViewPtr MapKeeper::Publish() {
  ViewPtr view = map_->View();
  views_.Publish(view);
  {
    MutexLock lock(published_mutex_);
    published_revision_ = view->revision();
    published_.NotifyAll();
  }
  gate_.Reach(view->revision());
  return view;
}

void MapKeeper::SaveAll(ViewPtr view, StorageItem& item) {
  item.checkpoint = std::move(view);
  for (const auto& [import_id, number] : unsaved_imports_) {
    item.import_positions.push_back({.stream = StreamKind::kImports,
                                     .source = {import_id},
                                     .epoch = 1,
                                     .sequence = number});
  }
  unsaved_imports_.clear();
  unsaved_import_cells_ = 0;
}

absl::StatusOr<ImportedTile> MapKeeper::ApplyImport(
    const map::RasterBlock& block, bool last, const ImportTile& tile,
    StorageItem& item) {
  ImportedTile imported;
  const map::SourceId source{tile.import_id};
  const bool remembered = !tile.import_id.empty();
  if (remembered) {
    const uint64_t held = ledger_.Newest(StreamKind::kImports, source).sequence;
    if (tile.number > held + 1) {
      return absl::FailedPreconditionError(absl::StrFormat(
          "tile %d of import_id=%s follows tile %d: send the tiles between, or "
          "resume with first_tile=%d",
          tile.number, tile.import_id, held, held + 1));
    }
    if (!ledger_.HasRoomFor(StreamKind::kImports, source)) {
      return absl::ResourceExhaustedError(
          "the mission has taken in as many sources and imports as it can");
    }
    imported.skipped = tile.number <= held;
  }
  if (!imported.skipped) {
    FATHOM_ASSIGN_OR_RETURN(imported.result, map_->Import(block, last));
    unsaved_import_cells_ += block.depth_m.size();
    if (remembered) {
      ledger_.Take(StreamKind::kImports, source, {1, tile.number});
      unsaved_imports_[tile.import_id] = tile.number;
    }
  }
  if (last || unsaved_import_cells_ >= kImportCheckpointCells) {
    SaveAll(Publish(), item);
  } else {
    item.done_when_applied = true;
  }
  return imported;
}

bool MapKeeper::CheckpointIsDue() const {
  return records_since_checkpoint_ +
             reports_since_checkpoint_ / kReportsPerJournalRecord >=
         options_.journal_max_records;
}

void MapKeeper::NoteCheckpoint(uint64_t revision) {
  records_since_checkpoint_ = 0;
  reports_since_checkpoint_ = 0;
  checkpoint_revision_ = revision;
}

void MapKeeper::HandToStorage(std::vector<StorageItem>& items, bool last) {
  MutexLock lock(mutex_);
  if (to_store_.empty()) {
    to_store_.swap(items);
    history_to_store_.swap(history_);
  } else {
    to_store_.insert(to_store_.end(), std::make_move_iterator(items.begin()),
                     std::make_move_iterator(items.end()));
    history_to_store_.insert(history_to_store_.end(),
                             std::make_move_iterator(history_.begin()),
                             std::make_move_iterator(history_.end()));
    items.clear();
    history_.clear();
  }
  if (last) mapper_ended_ = true;
  storage_changed_.NotifyOne();
}

}  // namespace fathom::server
