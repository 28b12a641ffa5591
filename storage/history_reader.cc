#include "storage/history_reader.h"

#include <algorithm>
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

absl::StatusOr<std::vector<map::ContactKey>> AllContacts(
    Connection& connection) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare("SELECT source_id, contact_id FROM contact ORDER BY "
                         "source_id, contact_id"));
  std::vector<map::ContactKey> keys;
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const bool more, select.Step());
    if (!more) return keys;
    keys.push_back(
        {.source = {select.ColumnText(0)}, .contact = {select.ColumnText(1)}});
  }
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
    Time from, Time to, std::size_t max_rows) {
  FATHOM_ASSIGN_OR_RETURN(const std::vector<HistoryBlocks> found,
                          FindBlocksIn(connection, area, from, to));
  std::map<map::ContactKey, HistoryBlocks> contacts;
  // Of these the blocks may know nothing there.
  for (const auto& [key, tail] : tails) {
    contacts[key] = {.contact_number = 0, .key = key, .block_ids = {}};
  }
  for (const HistoryBlocks& blocks : found) contacts[blocks.key] = blocks;
  std::vector<ContactHistoryRow> rows;
  const auto visit = [&](const ContactHistoryRow& row) {
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
  FATHOM_ASSIGN_OR_RETURN(const auto history,
                          ContactHistory::Create(connection, contacts));
  FATHOM_RETURN_IF_ERROR(history->Adopt(replayed));
  for (const map::ContactKey& key : history->Contacts()) {
    tails[key] = history->Tail(key);
  }
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
  absl::StatusOr<HistoryTails> tails = FindTails(connection, replayed);
  absl::StatusOr<std::vector<map::ContactKey>> keys = AllContacts(connection);
  for (const absl::Status& status : {tails.status(), keys.status()}) {
    if (status.ok()) continue;
    return absl::IsDataLoss(status) ? damaged(status) : status;
  }
  for (const auto& [key, tail] : *tails) keys->push_back(key);
  std::sort(keys->begin(), keys->end());
  keys->erase(std::unique(keys->begin(), keys->end()), keys->end());
  for (const map::ContactKey& key : *keys) {
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
    const auto blocks = FindBlocks(connection, key, Time::min(), Time::max());
    if (absl::IsDataLoss(blocks.status())) {
      FATHOM_RETURN_IF_ERROR(damaged(blocks.status()));
    } else {
      FATHOM_RETURN_IF_ERROR(blocks.status());
    }
    HistoryBlocks one{.contact_number = 0, .key = key, .block_ids = {}};
    HistoryTail tail = std::exchange((*tails)[key], {});
    if (blocks.ok() && blocks->has_value()) {
      one.contact_number = (*blocks)->contact_number;
      HistoryTail cut{.rows = {}, .cut = tail.cut};
      for (const std::int64_t block_id : (*blocks)->block_ids) {
        one.block_ids = {block_id};
        FATHOM_RETURN_IF_ERROR(read(one, cut));
      }
    }
    one.block_ids.clear();
    FATHOM_RETURN_IF_ERROR(read(one, tail));
  }
  return absl::OkStatus();
}

}  // namespace fathom::storage
