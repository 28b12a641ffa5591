#include "storage/history_reader.h"

#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/contact_codec.h"
#include "storage/contact_history.h"
#include "storage/contact_table.h"
#include "storage/history_table.h"

namespace fathom::storage {
namespace {

using Damaged = std::function<absl::Status(const absl::Status&)>;

// The numbers of all contacts; where the table or its index is damaged, of
// those that the other tells, too.
absl::StatusOr<std::map<map::ContactKey, std::int64_t>> AllContacts(
    Connection& connection, const Damaged& damaged) {
  std::map<map::ContactKey, std::int64_t> numbers;
  for (const char* way : {"ORDER BY source_id, contact_id", "NOT INDEXED"}) {
    FATHOM_ASSIGN_OR_RETURN(
        Statement select,
        connection.Prepare(absl::StrFormat(
            "SELECT source_id, contact_id, contact_number FROM contact %s",
            way)));
    absl::StatusOr<bool> more;
    while ((more = select.Step()).ok() && *more) {
      numbers[{.source = {select.ColumnText(0)},
               .contact = {select.ColumnText(1)}}] = select.ColumnInt(2);
    }
    if (more.ok()) return numbers;
    if (!absl::IsDataLoss(more.status())) return more.status();
    FATHOM_RETURN_IF_ERROR(damaged(more.status()));
  }
  return numbers;
}

}  // namespace

absl::Status ReadHistory(
    Connection& connection, const map::ContactKey& key, const HistoryTail& tail,
    Time from, Time to,
    const std::function<bool(const ContactHistoryRow&)>& visit) {
  FATHOM_ASSIGN_OR_RETURN(std::optional<HistoryBlocks> blocks,
                          FindBlocks(connection, key, from, to));
  if (!blocks.has_value()) {
    if (tail.rows.empty()) {
      return absl::NotFoundError(absl::StrFormat(
          "contact source_id=%s contact_id=%s was never reported",
          key.source.value, key.contact.value));
    }
    blocks = HistoryBlocks{.contact_number = 0, .key = key, .block_ids = {}};
  }
  return ReadBlocks(connection, *blocks, tail, from, to, visit).status();
}

absl::StatusOr<std::vector<ContactHistoryRow>> ReadHistoryIn(
    Connection& connection, const HistoryArea& area, const HistoryTails& tails,
    Time from, Time to, std::size_t max_rows, const std::atomic<bool>* stop) {
  FATHOM_ASSIGN_OR_RETURN(const std::vector<HistoryBlocks> found,
                          FindBlocksIn(connection, area, from, to));
  std::map<map::ContactKey, HistoryBlocks> contacts;
  // Of these the blocks may know nothing there.
  for (const auto& [key, tail] : tails) {
    contacts[key] = {.contact_number = 0, .key = key, .block_ids = {}};
  }
  for (const HistoryBlocks& blocks : found) contacts[blocks.key] = blocks;
  std::vector<ContactHistoryRow> rows;
  const auto stopped = [stop] { return stop != nullptr && *stop; };
  const auto visit = [&](const ContactHistoryRow& row) {
    if (stopped()) return false;
    if (!area.Holds(row.estimate.Position())) return true;
    rows.push_back(row);
    return rows.size() <= max_rows;
  };
  const HistoryTail none;
  for (const auto& [key, blocks] : contacts) {
    const auto tail = tails.find(key);
    FATHOM_ASSIGN_OR_RETURN(
        const bool all,
        ReadBlocks(connection, blocks,
                   tail == tails.end() ? none : tail->second, from, to, visit));
    if (stopped()) return absl::CancelledError("stopped");
    if (!all) {
      return absl::ResourceExhaustedError(
          absl::StrFormat("more than max_rows=%d estimates", max_rows));
    }
  }
  return rows;
}

absl::StatusOr<HistoryTails> FindTails(
    Connection& connection, const std::vector<ContactHistoryRow>& replayed) {
  HistoryTails tails;
  FATHOM_ASSIGN_OR_RETURN(ContactTable contacts,
                          ContactTable::Create(connection));
  FATHOM_ASSIGN_OR_RETURN(HistoryTable table, HistoryTable::Create(connection));
  FATHOM_ASSIGN_OR_RETURN(ContactHistory::Tails made,
                          ContactHistory::MakeTails(table, contacts, replayed));
  for (auto& [key, tail] : made) tails[key] = std::move(tail);
  return tails;
}

absl::Status ReadOldHistory(
    Connection& connection, const char* table,
    const std::function<absl::Status(const ContactHistoryRow&)>& visit,
    const std::function<absl::Status(const absl::Status&)>& damaged) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare(absl::StrFormat(
          "SELECT source_id, contact_id, revision, old.content, old.time_us "
          "FROM %s AS old JOIN contact USING (contact_number) ORDER BY "
          "contact_number, time_us, revision",
          table)));
  while (true) {
    const absl::StatusOr<bool> more = select.Step();
    if (absl::IsDataLoss(more.status())) return damaged(more.status());
    FATHOM_RETURN_IF_ERROR(more.status());
    if (!*more) return absl::OkStatus();
    const std::string what =
        absl::StrFormat("history of source_id=%s contact_id=%s",
                        select.ColumnText(0), select.ColumnText(1));
    absl::StatusOr<map::ContactEstimate> estimate =
        DecodeContactEstimate(select.ColumnBlob(3), what);
    if (estimate.ok() && ToUnixMicros(estimate->time) != select.ColumnInt(4)) {
      estimate = absl::DataLossError(what + ": a row holds another time");
    }
    if (!estimate.ok()) {
      if (!absl::IsDataLoss(estimate.status())) return estimate.status();
      FATHOM_RETURN_IF_ERROR(damaged(estimate.status()));
      continue;
    }
    ContactHistoryRow row{.revision = select.ColumnUint(2),
                          .estimate = *std::move(estimate)};
    row.estimate.key = {.source = {select.ColumnText(0)},
                        .contact = {select.ColumnText(1)}};
    FATHOM_RETURN_IF_ERROR(visit(row));
  }
}

absl::Status ReadWholeHistory(
    Connection& connection, const std::vector<ContactHistoryRow>& replayed,
    const std::function<absl::Status(const ContactHistoryRow&)>& visit,
    const std::function<absl::Status(const absl::Status&)>& damaged) {
  FATHOM_ASSIGN_OR_RETURN(const std::int64_t version,
                          connection.QueryInt("PRAGMA user_version"));
  if (version < kFirstBlockVersion) {
    return ReadOldHistory(connection, "contact_history", visit, damaged);
  }
  FATHOM_ASSIGN_OR_RETURN(auto numbers, AllContacts(connection, damaged));
  // What is behind the blocks is less than what is in them.
  absl::StatusOr<HistoryTails> tails = FindTails(connection, replayed);
  if (!tails.ok()) {
    if (!absl::IsDataLoss(tails.status())) return tails.status();
    FATHOM_RETURN_IF_ERROR(damaged(tails.status()));
    tails = HistoryTails();
  }
  constexpr std::int64_t kNone = -1;
  for (const auto& [key, tail] : *tails) numbers.emplace(key, kNone);
  for (const auto& [key, number] : numbers) {
    absl::Status status;
    const auto tell = [&](const ContactHistoryRow& row) {
      status = visit(row);
      return status.ok();
    };
    // What a block's own failure must not hide: it ends at the block.
    const auto read = [&](const HistoryBlocks& blocks,
                          const HistoryTail& tail) -> absl::Status {
      const auto all =
          ReadBlocks(connection, blocks, tail, Time::min(), Time::max(), tell);
      FATHOM_RETURN_IF_ERROR(status);
      return absl::IsDataLoss(all.status()) ? damaged(all.status())
                                            : all.status();
    };
    HistoryBlocks one{.contact_number = number, .key = key, .block_ids = {}};
    HistoryTail tail = std::exchange((*tails)[key], {});
    const auto blocks =
        FindBlocksOf(connection, number, key, Time::min(), Time::max());
    if (blocks.ok()) {
      const HistoryTail cut{.rows = {}, .cut = tail.cut};
      for (const std::int64_t block_id : blocks->block_ids) {
        one.block_ids = {block_id};
        FATHOM_RETURN_IF_ERROR(read(one, cut));
      }
    } else if (absl::IsDataLoss(blocks.status())) {
      FATHOM_RETURN_IF_ERROR(damaged(blocks.status()));
    } else {
      return blocks.status();
    }
    one.block_ids.clear();
    FATHOM_RETURN_IF_ERROR(read(one, tail));
  }
  return absl::OkStatus();
}

}  // namespace fathom::storage
