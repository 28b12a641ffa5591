// What of one contact's history is not in the file's blocks yet: its newest
// estimates, in memory. They are durable all the same: the journal holds the
// reports that they came of (history_replay.h), until a checkpoint writes the
// tail.
//
// A plain value; not thread-safe.

#ifndef FATHOM_STORAGE_HISTORY_TAIL_H_
#define FATHOM_STORAGE_HISTORY_TAIL_H_

#include <optional>
#include <vector>

#include "base/time.h"
#include "storage/mission_records.h"

namespace fathom::storage {

struct HistoryTail {
  // In order (IsBefore), without keys.
  std::vector<ContactHistoryRow> rows;
  // What the blocks hold at this time and later is no more: a late report
  // changed what is believed from there on.
  std::optional<Time> cut;

  // Adds a row behind those that it follows; of rows of one time and revision
  // the last stays. One that revises first takes away what it takes the place
  // of. O(1) in the order of time.
  void Add(const ContactHistoryRow& row);

  // Whether a row that the blocks hold still stands.
  bool Stands(const ContactHistoryRow& stored) const {
    return !cut.has_value() || stored.estimate.time < *cut;
  }
};

// The rows of `stored`, those of one contact's blocks that still stand, and of
// `newer`, both in order, in one; of rows of one time and revision the newer.
std::vector<ContactHistoryRow> Merged(std::vector<ContactHistoryRow> stored,
                                      std::vector<ContactHistoryRow> newer);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_HISTORY_TAIL_H_
