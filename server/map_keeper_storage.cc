// MapKeeper's storage thread: commits what waits in one transaction, tells who
// waits that it is durable, and handles a disk that refuses.
#include <algorithm>
#include <iterator>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/log.h"
#include "base/status_macros.h"
#include "server/map_keeper.h"

namespace fathom::server {
namespace {

// How long the storage thread is idle before it does housekeeping.
constexpr std::chrono::milliseconds kIdleTime{1000};

// Takes the first `count` off. REQUIRES: count <= rows.size().
std::vector<storage::ContactHistoryRow> TakeFirst(
    size_t count, std::vector<storage::ContactHistoryRow>& rows) {
  if (count == rows.size()) return std::exchange(rows, {});
  const auto end = rows.begin() + static_cast<std::ptrdiff_t>(count);
  std::vector<storage::ContactHistoryRow> first(
      std::make_move_iterator(rows.begin()), std::make_move_iterator(end));
  rows.erase(rows.begin(), end);
  return first;
}

}  // namespace

bool MapKeeper::TakeItems(std::vector<StorageItem>& items,
                          std::vector<storage::ContactHistoryRow>& history) {
  bool idle_told = false;
  while (true) {
    bool idle = false;
    {
      MutexLock lock(mutex_);
      while (to_store_.empty() && !mapper_ended_ && !idle) {
        if (idle_told) {
          storage_changed_.Wait(mutex_);
        } else {
          idle = !storage_changed_.WaitFor(mutex_, kIdleTime);
        }
      }
      if (!to_store_.empty()) {
        if (commit_paced_from_ != SteadyTime{}) {
          const SteadyTime due = commit_paced_from_ + options_.commit_interval;
          // Nobody waits for a command or for room: more may come along.
          while (pending_commands_ == 0 && HasRoom() && !stopping_ &&
                 storage_changed_.WaitUntil(mutex_, due)) {
          }
        }
        items.swap(to_store_);
        history.swap(history_to_store_);
        commit_paced_from_ =
            items.size() > 1 ? std::chrono::steady_clock::now() : SteadyTime{};
        return true;
      }
      if (mapper_ended_) return false;
    }
    store_.Idle();
    idle_told = true;
  }
}

void MapKeeper::RunStorage() {
  std::vector<StorageItem> items;
  std::vector<storage::ContactHistoryRow> history;
  absl::Status status;
  while (TakeItems(items, history)) {
    if (status.ok()) status = CommitItems(items, history);
    if (!status.ok()) GiveUp(status, items);
    items.clear();
    history.clear();
  }
}

absl::Status MapKeeper::CommitItems(
    std::vector<StorageItem>& items,
    std::vector<storage::ContactHistoryRow>& history) {
  size_t begin = 0;
  while (begin < items.size()) {
    // Up to and with the next checkpoint, which covers what is before it.
    storage::Batch batch;
    batch.journal.reserve(items.size() - begin);
    ViewPtr checkpoint;
    size_t records = 0;
    size_t rows = 0;
    size_t end = begin;
    for (; end < items.size() && checkpoint == nullptr; ++end) {
      StorageItem& item = items[end];
      rows += item.history_rows;
      if (item.record.has_value()) {
        batch.journal.push_back(*std::move(item.record));
        records += 1;
      }
      if (item.position.has_value()) {
        batch.source_positions.push_back(*std::move(item.position));
      }
      for (storage::SourcePosition& position : item.import_positions) {
        batch.source_positions.push_back(std::move(position));
      }
      checkpoint = item.checkpoint;
    }
    batch.contact_history = TakeFirst(rows, history);
    if (checkpoint != nullptr) {
      batch.checkpoint =
          storage::Checkpoint{.now = checkpoint, .previous = saved_view_};
    }
    if (absl::Status status = CommitBatch(batch, items); !status.ok()) {
      items.erase(items.begin(),
                  items.begin() + static_cast<std::ptrdiff_t>(begin));
      return status;
    }
    if (checkpoint != nullptr) saved_view_ = checkpoint->AtRest();
    {
      MutexLock lock(mutex_);
      storage_.durable_revision = items[end - 1].revision;
      storage_.journal_records =
          batch.checkpoint.has_value() ? 0 : storage_.journal_records + records;
    }
    TellDurable(std::span(items).subspan(begin, end - begin));
    begin = end;
  }
  return absl::OkStatus();
}

absl::Status MapKeeper::CommitBatch(const storage::Batch& batch,
                                    const std::vector<StorageItem>& items) {
  while (true) {
    absl::Status status = store_.Commit(batch);
    if (!absl::IsResourceExhausted(status)) {
      if (status.ok()) {
        bool again = false;
        {
          MutexLock lock(mutex_);
          again = !storage_.fault.empty();
          storage_.fault.clear();
        }
        if (again)
          Log(LogLevel::kInfo, "the mission file can be written again");
      } else {
        EnterFault(status, items);
      }
      return status;
    }
    EnterFault(status, items);
    MutexLock lock(mutex_);
    // One failed attempt after stopping began is the last.
    if (stopping_) return status;
    storage_changed_.WaitFor(mutex_, options_.storage_retry_delay);
  }
}

void MapKeeper::EnterFault(const absl::Status& status,
                           const std::vector<StorageItem>& items) {
  std::vector<std::shared_ptr<IngestListener>> listeners;
  bool first = false;
  bool told = false;
  {
    MutexLock lock(mutex_);
    first = storage_.fault.empty();
    // A full disk may have room again and then show damage.
    told = !first && storage_.damaged == absl::IsDataLoss(status);
    storage_.damaged = absl::IsDataLoss(status);
    storage_.fault = std::string(status.message());
    if (storage_.fault.empty()) storage_.fault = status.ToString();
    if (first) listeners.swap(waiting_);
  }
  if (!told) {
    Log(LogLevel::kError, "nothing new is taken, queries go on: %s",
        std::string(status.message()));
  }
  if (!first) return;
  for (const StorageItem& item : items) {
    if (item.listener != nullptr) listeners.push_back(item.listener);
  }
  std::sort(listeners.begin(), listeners.end());
  listeners.erase(std::unique(listeners.begin(), listeners.end()),
                  listeners.end());
  for (const auto& listener : listeners) listener->OnFault();
}

void MapKeeper::TellDurable(std::span<StorageItem> items) {
  size_t messages = 0;
  size_t bytes = 0;
  size_t commands = 0;
  // One a listener, in the order of first appearance; few.
  struct Durable {
    std::shared_ptr<IngestListener> listener;
    MessageNumber newest;
    size_t count = 0;
  };
  std::vector<Durable> durable;
  for (StorageItem& item : items) {
    if (item.listener != nullptr) {
      messages += 1;
      bytes += item.bytes;
      auto found = std::find_if(durable.begin(), durable.end(),
                                [&](const Durable& entry) {
                                  return entry.listener == item.listener;
                                });
      if (found == durable.end()) {
        found = durable.insert(found, {.listener = std::move(item.listener),
                                       .newest = item.number,
                                       .count = 0});
      }
      found->newest = item.number;
      found->count += 1;
    } else if (item.done) {
      commands += 1;
    }
  }
  // The room is given back first: who hears of it here may use it.
  std::vector<std::shared_ptr<IngestListener>> waiting;
  {
    MutexLock lock(mutex_);
    pending_messages_ -= messages;
    pending_bytes_ -= bytes;
    pending_commands_ -= commands;
    if (HasRoom()) waiting.swap(waiting_);
  }
  for (const Durable& entry : durable) {
    entry.listener->OnDurable(entry.newest, entry.count);
  }
  for (const StorageItem& item : items) {
    if (item.done) item.done(absl::OkStatus());
  }
  for (const auto& listener : waiting) listener->OnRoom();
}

void MapKeeper::GiveUp(const absl::Status& status,
                       std::vector<StorageItem>& items) {
  bool first = false;
  bool fatal = false;
  {
    MutexLock lock(mutex_);
    first = end_.ok();
    if (first) end_ = status;
    // Where damage stood in the way nothing was written: there is nothing to
    // save by ending, and the map still answers.
    fatal = first && !absl::IsResourceExhausted(status) &&
            !absl::IsDataLoss(status);
  }
  for (const StorageItem& item : items) {
    if (item.done) item.done(status);
    if (!first && item.listener != nullptr) item.listener->OnFault();
  }
  if (fatal && options_.on_fatal) options_.on_fatal(status);
}

}  // namespace fathom::server
