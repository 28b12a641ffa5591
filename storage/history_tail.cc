#include "storage/history_tail.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "storage/history_codec.h"

namespace fathom::storage {

void HistoryTail::Add(const ContactHistoryRow& row) {
  if (row.revises) {
    const Time from = row.estimate.time;
    std::erase_if(rows, [&row, from](const ContactHistoryRow& held) {
      return held.estimate.time >= from && held.revision < row.revision;
    });
    cut = std::min(cut.value_or(from), from);
  }
  auto at = rows.end();
  if (!rows.empty() && !IsBefore(rows.back(), row)) {
    at = std::lower_bound(rows.begin(), rows.end(), row, IsBefore);
    if (!IsBefore(row, *at)) at = rows.erase(at);
  }
  at = rows.insert(at, row);
  at->estimate.key = {};
  at->revises = false;
}

std::vector<ContactHistoryRow> Merged(std::vector<ContactHistoryRow> stored,
                                      std::vector<ContactHistoryRow> newer) {
  std::vector<ContactHistoryRow> all;
  all.reserve(stored.size() + newer.size());
  // Of two alike set_union takes the first range's.
  std::set_union(std::make_move_iterator(newer.begin()),
                 std::make_move_iterator(newer.end()),
                 std::make_move_iterator(stored.begin()),
                 std::make_move_iterator(stored.end()), std::back_inserter(all),
                 IsBefore);
  return all;
}

}  // namespace fathom::storage
