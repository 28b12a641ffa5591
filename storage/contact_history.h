// ContactHistory: every contact's past in one mission file.
//
// New estimates wait in memory (history_tail.h) until there is a block's worth
// of them; blocks (history_table.h) are written in the transaction of a commit.
// So ingest pays one insert for kBlockEstimates reports, into trees whose size
// makes no difference, and nothing at all for durability: the journal already
// has the reports. With a checkpoint, which cuts the journal, all tails go into
// blocks; after a crash they are made again by replay.
//
// Thread safety: Write, Committed, RolledBack, Flush and Adopt belong to the
// storage thread; Tail and Contacts may be called from any thread.

#ifndef FATHOM_STORAGE_CONTACT_HISTORY_H_
#define FATHOM_STORAGE_CONTACT_HISTORY_H_

#include <deque>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/mutex.h"
#include "base/time.h"
#include "map/geodesy/ids.h"
#include "storage/contact_table.h"
#include "storage/history_table.h"
#include "storage/history_tail.h"
#include "storage/mission_records.h"
#include "storage/sqlite.h"

namespace fathom::storage {

class ContactHistory {
 public:
  using Tails = std::unordered_map<map::ContactKey, HistoryTail>;

  // `connection`, the writing one, and `contacts` must outlive it.
  static absl::StatusOr<std::unique_ptr<ContactHistory>> Create(
      Connection& connection, ContactTable& contacts);

  // Of `rows`, what a replay of the journal made (history_replay.h), the tails
  // of what the blocks do not hold.
  static absl::StatusOr<Tails> MakeTails(
      HistoryTable& table, ContactTable& contacts,
      const std::vector<ContactHistoryRow>& rows);

  // Takes what a replay of the journal made (history_replay.h), but what the
  // blocks hold already, in place of what it has.
  absl::Status Adopt(const std::vector<ContactHistoryRow>& rows);

  // Within a transaction: writes full tails into blocks; with a checkpoint
  // those of all contacts and `rows` too, and forgets what `limits` do not
  // allow. Call Committed with the same rows afterwards, or RolledBack.
  absl::Status Write(std::span<const ContactHistoryRow> rows,
                     const Checkpoint* checkpoint, const HistoryLimits& limits);
  void Committed(std::span<const ContactHistoryRow> rows);
  void RolledBack();

  // Within a transaction: writes all tails. No other call may follow.
  absl::Status Flush();

  // What is not in blocks of this contact; a copy.
  HistoryTail Tail(const map::ContactKey& key) const;
  // Contacts that have a tail, in no order.
  std::vector<map::ContactKey> Contacts() const;
  // As of the last commit. Storage thread.
  const HistoryTotal& total() const { return total_; }

 private:
  ContactHistory(HistoryTable table, ContactTable& contacts)
      : table_(std::move(table)), contacts_(contacts), total_(table_.total()) {}
  absl::Status WriteAll(const Tails& tails);
  static void Add(std::span<const ContactHistoryRow> rows, Tails& tails);

  HistoryTable table_;
  ContactTable& contacts_;
  // As of the last commit.
  HistoryTotal total_;
  // Contacts whose tails are full, in the order in which they became so.
  std::deque<map::ContactKey> full_;
  // Written by the transaction under way: the first so many of full_, or all
  // tails and its own rows.
  std::size_t written_ = 0;
  bool all_written_ = false;

  mutable Mutex mutex_;
  // Changed by the storage thread alone, which may read without the lock.
  Tails tails_;
};

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_CONTACT_HISTORY_H_
