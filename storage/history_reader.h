// Reads the contact history: a contact's, an area's, or all there is, also of
// missions of older formats. docs/storage_format.md has the tables.
//
// Thread-safe on connections of their own.

#ifndef FATHOM_STORAGE_HISTORY_READER_H_
#define FATHOM_STORAGE_HISTORY_READER_H_

#include <atomic>
#include <cstddef>
#include <functional>
#include <map>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"
#include "map/geodesy/ids.h"
#include "storage/history_tail.h"
#include "storage/mission_records.h"
#include "storage/sqlite.h"

namespace fathom::storage {

// The first format whose history is in blocks.
inline constexpr int kFirstBlockVersion = 7;

// Tails of all contacts that have one.
using HistoryTails = std::map<map::ContactKey, HistoryTail>;

// See MissionFile::ReadContactHistory; `tail` is the contact's, taken before.
absl::Status ReadHistory(
    Connection& connection, const map::ContactKey& key, const HistoryTail& tail,
    Time from, Time to,
    const std::function<bool(const ContactHistoryRow&)>& visit);

// See MissionFile::ReadContactHistoryIn.
absl::StatusOr<std::vector<ContactHistoryRow>> ReadHistoryIn(
    Connection& connection, const HistoryArea& area, const HistoryTails& tails,
    Time from, Time to, std::size_t max_rows, const std::atomic<bool>* stop);

// What the journal of a file that nobody serves adds to its blocks: see
// history_replay.h. The file is not changed.
absl::StatusOr<HistoryTails> FindTails(
    Connection& connection, const std::vector<ContactHistoryRow>& replayed);

// Calls `visit` for every row of every contact, contact by contact, each in
// order of time. What cannot be read is told to `damaged`, and the rest goes
// on; each may end it with an error. `replayed`: from ReplayHistory.
absl::Status ReadWholeHistory(
    Connection& connection, const std::vector<ContactHistoryRow>& replayed,
    const std::function<absl::Status(const ContactHistoryRow&)>& visit,
    const std::function<absl::Status(const absl::Status&)>& damaged);

// The rows of the table `table` of formats 5 and 6, in its order; as above.
absl::Status ReadOldHistory(
    Connection& connection, const char* table,
    const std::function<absl::Status(const ContactHistoryRow&)>& visit,
    const std::function<absl::Status(const absl::Status&)>& damaged);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_HISTORY_READER_H_
