// The tables `contact_history`, its index by place and time, and
// `contact_history_total`: blocks of what was believed of each contact, and
// with each what GDAL shows of it (history_features.h).
// docs/storage_format.md says why blocks, and what each column means.
//
// A contact's blocks follow one another: no row of one lies between two of
// another. One thread at a time; inside the caller's transaction.

#ifndef FATHOM_STORAGE_HISTORY_TABLE_H_
#define FATHOM_STORAGE_HISTORY_TABLE_H_

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"
#include "storage/history_features.h"
#include "storage/history_tail.h"
#include "storage/mission_records.h"
#include "storage/sqlite.h"

namespace fathom::storage {

// What the blocks hold, and what was let go (HistoryLimits).
struct HistoryTotal {
  std::uint64_t estimates = 0;
  std::uint64_t blocks = 0;
  // Of the blocks' contents.
  std::uint64_t content_bytes = 0;
  std::uint64_t forgotten_estimates = 0;

  // What HistoryLimits::max_bytes counts: contents and features. The latter
  // are reckoned, not measured.
  std::uint64_t bytes() const {
    return content_bytes + kFeatureBlockBytes * blocks +
           kVertexBytes * estimates;
  }

  friend bool operator==(const HistoryTotal&, const HistoryTotal&) = default;
};

// What a block's row says of it.
struct HistoryBlockMark {
  Time first;
  Time last;
  std::uint64_t last_revision = 0;
  std::uint64_t estimates = 0;

  friend bool operator==(const HistoryBlockMark&,
                         const HistoryBlockMark&) = default;
};
// REQUIRES: rows, in order.
HistoryBlockMark MarkOf(std::span<const ContactHistoryRow> rows);

// Blocks forgotten in one transaction, at most, or twice as many as were
// written since the last one: a checkpoint stays short, and the limits are
// reached. The next one goes on.
inline constexpr std::uint64_t kMaxForgottenBlocks = 1000;

class HistoryTable {
 public:
  // `connection` must outlive it. Before anything is written or total() asked
  // for, ReloadTotal.
  static absl::StatusOr<HistoryTable> Create(Connection& connection);

  // Puts the tail into blocks: what it cut goes, and a last block that is less
  // than half full is filled up. O(rows) and one insert for kBlockEstimates.
  absl::Status Write(std::int64_t contact_number, const HistoryTail& tail);

  // Deletes blocks, the one that ended first first, that the limits do not
  // allow: all older than max_age beside the newest row, then as long as there
  // are more than max_bytes. At most kMaxForgottenBlocks.
  absl::Status Forget(const HistoryLimits& limits);

  // The newest revision in the contact's blocks; 0: there are none.
  absl::StatusOr<std::uint64_t> NewestRevision(std::int64_t contact_number);

  // Whether the index by place and time finds the block with these rows.
  absl::StatusOr<bool> IsPlaced(std::int64_t block_id,
                                std::span<const ContactHistoryRow> rows);

  const HistoryTotal& total() const { return total_; }
  // As it stands in the file. Counts the blocks, in the smallest index: 5 ms
  // for those of 100 M estimates, in memory. Where that index is damaged: as
  // many as full ones would be.
  absl::Status ReloadTotal();
  // As it was before a transaction that was rolled back.
  void RestoreTotal(const HistoryTotal& total) { total_ = total; }

 private:
  explicit HistoryTable(Connection& connection) : features_(connection) {}

  struct Block {
    std::int64_t id = 0;
    std::uint64_t estimates = 0;
    std::uint64_t content_bytes = 0;
  };
  // The total, changed by a block that goes.
  static void Subtract(const Block& block, HistoryTotal& total);
  absl::StatusOr<std::vector<Block>> FindJoined(std::int64_t contact_number,
                                                const HistoryTail& tail);
  absl::Status Insert(std::int64_t contact_number,
                      std::span<const ContactHistoryRow> rows);
  absl::Status Delete(const Block& block);
  absl::Status WriteTotal();
  // The time of the newest row; the earliest there is: there are none.
  absl::StatusOr<Time> Newest();

  HistoryFeatures features_;
  HistoryTotal total_;
  // Blocks written since the last Forget.
  std::uint64_t inserted_ = 0;
  Statement newest_blocks_;
  Statement newest_revision_;
  Statement read_;
  Statement insert_;
  Statement insert_place_;
  Statement delete_;
  Statement delete_place_;
  Statement oldest_;
  Statement newest_;
  Statement place_;
  Statement write_total_;
  Statement read_total_;
  Statement count_blocks_;
};

// Some of a contact's blocks, in order.
struct HistoryBlocks {
  std::int64_t contact_number = 0;
  map::ContactKey key;
  std::vector<std::int64_t> block_ids;
};

// The blocks of one contact, `key`, that reach into the time from `from` to
// `to`; nullopt: the file does not know it. Errors: those of sqlite.h.
absl::StatusOr<std::optional<HistoryBlocks>> FindBlocks(
    Connection& connection, const map::ContactKey& key, Time from, Time to);

// The same of a contact whose number is known.
absl::StatusOr<HistoryBlocks> FindBlocksOf(Connection& connection,
                                           std::int64_t contact_number,
                                           const map::ContactKey& key,
                                           Time from, Time to);

// The same of all contacts, in order of key, of blocks that may hold something
// within the area. O(log blocks + blocks found).
absl::StatusOr<std::vector<HistoryBlocks>> FindBlocksIn(Connection& connection,
                                                        const HistoryArea& area,
                                                        Time from, Time to);

// Calls `visit` for the rows with from <= time <= to that the blocks hold or
// `tail`, the same contact's, adds, in order, until it returns false; whether
// it never did. REQUIRES: one transaction with what found the blocks.
// Errors: DATA_LOSS; those of sqlite.h.
absl::StatusOr<bool> ReadBlocks(
    Connection& connection, const HistoryBlocks& blocks,
    const HistoryTail& tail, Time from, Time to,
    const std::function<bool(const ContactHistoryRow&)>& visit);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_HISTORY_TABLE_H_
