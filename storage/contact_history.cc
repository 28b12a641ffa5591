#include "storage/contact_history.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "base/status_macros.h"
#include "storage/history_codec.h"

namespace fathom::storage {
namespace {

// Contacts that report in turn fill their tails together. Blocks are written
// twice as fast as rows come, and not all at once: a commit waits 2 ms for
// them, not 20.
std::size_t BlocksFor(std::size_t rows) {
  return 8 + 2 * rows / kBlockEstimates;
}

}  // namespace

absl::StatusOr<std::unique_ptr<ContactHistory>> ContactHistory::Create(
    Connection& connection, ContactTable& contacts) {
  FATHOM_ASSIGN_OR_RETURN(HistoryTable table, HistoryTable::Create(connection));
  FATHOM_RETURN_IF_ERROR(table.ReloadTotal());
  return std::unique_ptr<ContactHistory>(
      new ContactHistory(std::move(table), contacts));
}

absl::StatusOr<ContactHistory::Tails> ContactHistory::MakeTails(
    HistoryTable& table, ContactTable& contacts,
    const std::vector<ContactHistoryRow>& rows) {
  Tails tails;
  std::unordered_map<map::ContactKey, std::uint64_t> newest;
  for (const ContactHistoryRow& row : rows) {
    const map::ContactKey& key = row.estimate.key;
    auto known = newest.find(key);
    if (known == newest.end()) {
      FATHOM_ASSIGN_OR_RETURN(const std::optional<std::int64_t> number,
                              contacts.FindNumber(key));
      std::uint64_t revision = 0;
      if (number.has_value()) {
        FATHOM_ASSIGN_OR_RETURN(revision, table.NewestRevision(*number));
      }
      known = newest.emplace(key, revision).first;
    }
    if (row.revision > known->second) tails[key].Add(row);
  }
  return tails;
}

absl::Status ContactHistory::Adopt(const std::vector<ContactHistoryRow>& rows) {
  FATHOM_ASSIGN_OR_RETURN(Tails tails, MakeTails(table_, contacts_, rows));
  full_.clear();
  for (const auto& [key, tail] : tails) {
    if (tail.rows.size() >= kBlockEstimates) full_.push_back(key);
  }
  MutexLock lock(mutex_);
  tails_ = std::move(tails);
  return absl::OkStatus();
}

void ContactHistory::Add(std::span<const ContactHistoryRow> rows,
                         Tails& tails) {
  for (const ContactHistoryRow& row : rows) tails[row.estimate.key].Add(row);
}

absl::Status ContactHistory::WriteAll(const Tails& tails) {
  for (const auto& [key, tail] : tails) {
    FATHOM_ASSIGN_OR_RETURN(const std::int64_t number, contacts_.NumberOf(key));
    FATHOM_RETURN_IF_ERROR(table_.Write(number, tail));
  }
  return absl::OkStatus();
}

absl::Status ContactHistory::Write(std::span<const ContactHistoryRow> rows,
                                   const Checkpoint* checkpoint,
                                   const HistoryLimits& limits) {
  written_ = 0;
  all_written_ = checkpoint != nullptr;
  if (all_written_) {
    FATHOM_RETURN_IF_ERROR(WriteAll(tails_));
    Tails last;
    Add(rows, last);
    FATHOM_RETURN_IF_ERROR(WriteAll(last));
    return table_.Forget(limits);
  }
  const std::size_t blocks = std::min(full_.size(), BlocksFor(rows.size()));
  for (; written_ < blocks; ++written_) {
    // One that was cut and filled again is named twice.
    const auto tail = tails_.find(full_[written_]);
    if (tail == tails_.end()) continue;
    FATHOM_ASSIGN_OR_RETURN(const std::int64_t number,
                            contacts_.NumberOf(tail->first));
    FATHOM_RETURN_IF_ERROR(table_.Write(number, tail->second));
  }
  return absl::OkStatus();
}

void ContactHistory::Committed(std::span<const ContactHistoryRow> rows) {
  total_ = table_.total();
  MutexLock lock(mutex_);
  if (all_written_) {
    tails_.clear();
    full_.clear();
    return;
  }
  for (; written_ > 0; --written_) {
    tails_.erase(full_.front());
    full_.pop_front();
  }
  for (const ContactHistoryRow& row : rows) {
    HistoryTail& tail = tails_[row.estimate.key];
    const bool was_full = tail.rows.size() >= kBlockEstimates;
    tail.Add(row);
    if (!was_full && tail.rows.size() >= kBlockEstimates) {
      full_.push_back(row.estimate.key);
    }
  }
}

void ContactHistory::RolledBack() {
  written_ = 0;
  table_.RestoreTotal(total_);
}

absl::Status ContactHistory::Flush() { return WriteAll(tails_); }

HistoryTail ContactHistory::Tail(const map::ContactKey& key) const {
  MutexLock lock(mutex_);
  const auto found = tails_.find(key);
  return found == tails_.end() ? HistoryTail() : found->second;
}

std::vector<map::ContactKey> ContactHistory::Contacts() const {
  MutexLock lock(mutex_);
  std::vector<map::ContactKey> keys;
  keys.reserve(tails_.size());
  for (const auto& [key, tail] : tails_) keys.push_back(key);
  return keys;
}

}  // namespace fathom::storage
