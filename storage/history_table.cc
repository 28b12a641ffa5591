#include "storage/history_table.h"

#include <algorithm>
#include <utility>

#include "base/status_macros.h"
#include "storage/history_codec.h"

namespace fathom::storage {
namespace {

// A box that holds every row of a block.
struct Box {
  double south_deg = 90;
  double north_deg = -90;
  double west_deg = 180;
  double east_deg = -180;

  void Include(const map::GeodeticPoint& point) {
    south_deg = std::min(south_deg, point.latitude_deg);
    north_deg = std::max(north_deg, point.latitude_deg);
    west_deg = std::min(west_deg, point.longitude_deg);
    east_deg = std::max(east_deg, point.longitude_deg);
  }
};

Box BoxOf(std::span<const map::GeodeticPoint> positions) {
  Box box;
  for (const map::GeodeticPoint& position : positions) box.Include(position);
  return box;
}

// The index holds 32-bit floats, rounded outwards, so that a microsecond is
// neither needed nor kept: seconds.
double IndexSeconds(Time time) {
  return static_cast<double>(ToUnixMicros(time)) * 1e-6;
}

absl::StatusOr<std::vector<ContactHistoryRow>> ReadBlock(
    Statement& read, std::int64_t contact_number, std::int64_t block_id) {
  read.BindInt(0, block_id);
  FATHOM_ASSIGN_OR_RETURN(const bool found, read.Step());
  const std::string what = WhatOfBlock(contact_number, block_id);
  if (!found) {
    read.Reset();
    return absl::DataLossError(what + " is missing");
  }
  auto rows = DecodeHistory(read.ColumnBlob(0), contact_number, what);
  read.Reset();
  return rows;
}

constexpr char kRead[] =
    "SELECT content FROM contact_history WHERE block_id = ?";

}  // namespace

HistoryBlockMark MarkOf(std::span<const ContactHistoryRow> rows) {
  HistoryBlockMark mark{.first = rows.front().estimate.time,
                        .last = rows.back().estimate.time,
                        .last_revision = 0,
                        .estimates = rows.size()};
  for (const ContactHistoryRow& row : rows) {
    mark.last_revision = std::max(mark.last_revision, row.revision);
  }
  return mark;
}

absl::StatusOr<HistoryTable> HistoryTable::Create(Connection& connection) {
  HistoryTable table(connection);
  const auto prepare = [&connection](Statement& out,
                                     const char* sql) -> absl::Status {
    FATHOM_ASSIGN_OR_RETURN(out, connection.Prepare(sql));
    return absl::OkStatus();
  };
  FATHOM_RETURN_IF_ERROR(prepare(
      table.newest_blocks_,
      "SELECT block_id, estimate_count, length(content), last_time_us FROM "
      "contact_history WHERE contact_number = ? ORDER BY last_time_us DESC, "
      "first_time_us DESC, last_revision DESC"));
  FATHOM_RETURN_IF_ERROR(prepare(
      table.newest_revision_,
      "SELECT max(last_revision) FROM contact_history WHERE contact_number = "
      "?"));
  FATHOM_RETURN_IF_ERROR(prepare(table.read_, kRead));
  FATHOM_RETURN_IF_ERROR(prepare(
      table.insert_,
      "INSERT INTO contact_history (contact_number, first_time_us, "
      "last_time_us, last_revision, estimate_count, content) VALUES (?, ?, ?, "
      "?, ?, ?) RETURNING block_id"));
  FATHOM_RETURN_IF_ERROR(prepare(
      table.insert_place_,
      "INSERT INTO contact_history_place (block_id, south_deg, north_deg, "
      "west_deg, east_deg, first_s, last_s) VALUES (?, ?, ?, ?, ?, ?, ?)"));
  FATHOM_RETURN_IF_ERROR(
      prepare(table.delete_, "DELETE FROM contact_history WHERE block_id = ?"));
  FATHOM_RETURN_IF_ERROR(
      prepare(table.delete_place_,
              "DELETE FROM contact_history_place WHERE block_id = ?"));
  FATHOM_RETURN_IF_ERROR(prepare(
      table.oldest_,
      "SELECT block_id, estimate_count, length(content), last_time_us FROM "
      "contact_history ORDER BY last_time_us LIMIT ?"));
  FATHOM_RETURN_IF_ERROR(
      prepare(table.newest_, "SELECT max(last_time_us) FROM contact_history"));
  FATHOM_RETURN_IF_ERROR(prepare(
      table.place_,
      "SELECT south_deg <= ? AND north_deg >= ? AND west_deg <= ? AND east_deg "
      ">= ? AND first_s <= ? AND last_s >= ? FROM contact_history_place WHERE "
      "block_id = ?"));
  FATHOM_RETURN_IF_ERROR(
      prepare(table.write_total_,
              "UPDATE contact_history_total SET estimate_count = ?, "
              "content_bytes = ?, forgotten_count = ?"));
  FATHOM_RETURN_IF_ERROR(
      prepare(table.read_total_,
              "SELECT estimate_count, content_bytes, forgotten_count FROM "
              "contact_history_total"));
  FATHOM_RETURN_IF_ERROR(
      prepare(table.count_blocks_, "SELECT count(*) FROM contact_history"));
  return table;
}

absl::Status HistoryTable::ReloadTotal() {
  FATHOM_ASSIGN_OR_RETURN(const bool row, read_total_.Step());
  if (row) {
    total_ = {.estimates = read_total_.ColumnUint(0),
              .content_bytes = read_total_.ColumnUint(1),
              .forgotten_estimates = read_total_.ColumnUint(2)};
  }
  read_total_.Reset();
  if (!row) {
    return absl::DataLossError("the table contact_history_total is empty");
  }
  const absl::StatusOr<bool> counted = count_blocks_.Step();
  if (counted.ok() && *counted) total_.blocks = count_blocks_.ColumnUint(0);
  count_blocks_.Reset();
  if (!absl::IsDataLoss(counted.status())) return counted.status();
  // What a damaged index is needed for tells of it; for the limits full blocks
  // will do.
  total_.blocks = (total_.estimates + kBlockEstimates - 1) / kBlockEstimates;
  return absl::OkStatus();
}

absl::Status HistoryTable::WriteTotal() {
  write_total_.BindUint(0, total_.estimates);
  write_total_.BindUint(1, total_.content_bytes);
  write_total_.BindUint(2, total_.forgotten_estimates);
  return write_total_.Run();
}

absl::StatusOr<std::vector<HistoryTable::Block>> HistoryTable::FindJoined(
    std::int64_t contact_number, const HistoryTail& tail) {
  // What begins in the middle of a block, or behind its cut.
  Time from = tail.cut.value_or(Time::max());
  if (!tail.rows.empty()) {
    from = std::min(from, tail.rows.front().estimate.time + Duration(1));
  }
  std::vector<Block> joined;
  newest_blocks_.BindInt(0, contact_number);
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const bool more, newest_blocks_.Step());
    if (!more) break;
    const Block block{.id = newest_blocks_.ColumnInt(0),
                      .estimates = newest_blocks_.ColumnUint(1),
                      .content_bytes = newest_blocks_.ColumnUint(2)};
    const bool small = joined.empty() && block.estimates < kBlockEstimates / 2;
    if (!small && TimeFromUnixMicros(newest_blocks_.ColumnInt(3)) < from) break;
    joined.push_back(block);
  }
  newest_blocks_.Reset();
  std::reverse(joined.begin(), joined.end());
  return joined;
}

absl::Status HistoryTable::Write(std::int64_t contact_number,
                                 const HistoryTail& tail) {
  FATHOM_ASSIGN_OR_RETURN(const std::vector<Block> joined,
                          FindJoined(contact_number, tail));
  std::vector<ContactHistoryRow> stored;
  for (const Block& block : joined) {
    FATHOM_ASSIGN_OR_RETURN(std::vector<ContactHistoryRow> rows,
                            ReadBlock(read_, contact_number, block.id));
    for (ContactHistoryRow& row : rows) {
      if (tail.Stands(row)) stored.push_back(std::move(row));
    }
    FATHOM_RETURN_IF_ERROR(Delete(block));
  }
  std::span<const ContactHistoryRow> left(tail.rows);
  if (!stored.empty()) {
    stored = Merged(std::move(stored), tail.rows);
    left = stored;
  }
  while (!left.empty()) {
    const std::size_t count =
        left.size() > kMaxBlockEstimates ? kBlockEstimates : left.size();
    FATHOM_RETURN_IF_ERROR(Insert(contact_number, left.first(count)));
    left = left.subspan(count);
  }
  return WriteTotal();
}

absl::Status HistoryTable::Insert(std::int64_t contact_number,
                                  std::span<const ContactHistoryRow> rows) {
  const std::vector<map::GeodeticPoint> positions = PositionsOf(rows);
  const Box box = BoxOf(positions);
  const HistoryBlockMark mark = MarkOf(rows);
  const Bytes content = EncodeHistory(contact_number, rows);
  insert_.BindInt(0, contact_number);
  insert_.BindInt(1, ToUnixMicros(mark.first));
  insert_.BindInt(2, ToUnixMicros(mark.last));
  insert_.BindUint(3, mark.last_revision);
  insert_.BindUint(4, mark.estimates);
  insert_.BindBlob(5, content);
  const absl::StatusOr<bool> inserted = insert_.Step();
  const std::int64_t block_id =
      inserted.ok() && *inserted ? insert_.ColumnInt(0) : 0;
  insert_.Reset();
  FATHOM_RETURN_IF_ERROR(inserted.status());
  insert_place_.BindInt(0, block_id);
  insert_place_.BindReal(1, box.south_deg);
  insert_place_.BindReal(2, box.north_deg);
  insert_place_.BindReal(3, box.west_deg);
  insert_place_.BindReal(4, box.east_deg);
  insert_place_.BindReal(5, IndexSeconds(mark.first));
  insert_place_.BindReal(6, IndexSeconds(mark.last));
  total_.estimates += rows.size();
  total_.blocks += 1;
  total_.content_bytes += content.size();
  ++inserted_;
  FATHOM_RETURN_IF_ERROR(insert_place_.Run());
  return features_.Insert(block_id, contact_number, rows, positions);
}

void HistoryTable::Subtract(const Block& block, HistoryTotal& total) {
  // What a damaged file says may not add up.
  total.estimates -= std::min(total.estimates, block.estimates);
  total.blocks -= std::min<std::uint64_t>(total.blocks, 1);
  total.content_bytes -= std::min(total.content_bytes, block.content_bytes);
}

absl::Status HistoryTable::Delete(const Block& block) {
  Subtract(block, total_);
  delete_.BindInt(0, block.id);
  FATHOM_RETURN_IF_ERROR(delete_.Run());
  delete_place_.BindInt(0, block.id);
  FATHOM_RETURN_IF_ERROR(delete_place_.Run());
  return features_.Delete(block.id);
}

absl::StatusOr<Time> HistoryTable::Newest() {
  const absl::StatusOr<bool> row = newest_.Step();
  const Time newest = row.ok() && *row && !newest_.ColumnIsNull(0)
                          ? TimeFromUnixMicros(newest_.ColumnInt(0))
                          : Time::min();
  newest_.Reset();
  FATHOM_RETURN_IF_ERROR(row.status());
  return newest;
}

absl::Status HistoryTable::Forget(const HistoryLimits& limits) {
  const std::uint64_t most =
      std::max(kMaxForgottenBlocks, 2 * std::exchange(inserted_, 0));
  const bool too_much =
      limits.max_bytes.has_value() && total_.bytes() > *limits.max_bytes;
  if (!too_much && !limits.max_age.has_value()) return absl::OkStatus();
  FATHOM_ASSIGN_OR_RETURN(const Time newest, Newest());
  HistoryTotal left = total_;
  std::vector<Block> oldest;
  oldest_.BindUint(0, most);
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const bool more, oldest_.Step());
    if (!more) break;
    const bool too_old =
        limits.max_age.has_value() &&
        newest - TimeFromUnixMicros(oldest_.ColumnInt(3)) > *limits.max_age;
    if (!too_old && (!too_much || left.bytes() <= *limits.max_bytes)) break;
    oldest.push_back({.id = oldest_.ColumnInt(0),
                      .estimates = oldest_.ColumnUint(1),
                      .content_bytes = oldest_.ColumnUint(2)});
    Subtract(oldest.back(), left);
  }
  oldest_.Reset();
  for (const Block& block : oldest) {
    FATHOM_RETURN_IF_ERROR(Delete(block));
    total_.forgotten_estimates += block.estimates;
  }
  return oldest.empty() ? absl::OkStatus() : WriteTotal();
}

absl::StatusOr<std::uint64_t> HistoryTable::NewestRevision(
    std::int64_t contact_number) {
  newest_revision_.BindInt(0, contact_number);
  const absl::StatusOr<bool> row = newest_revision_.Step();
  const std::uint64_t revision =
      row.ok() && *row ? newest_revision_.ColumnUint(0) : 0;
  newest_revision_.Reset();
  FATHOM_RETURN_IF_ERROR(row.status());
  return revision;
}

absl::StatusOr<bool> HistoryTable::IsPlaced(
    std::int64_t block_id, std::span<const ContactHistoryRow> rows) {
  const Box box = BoxOf(PositionsOf(rows));
  place_.BindReal(0, box.south_deg);
  place_.BindReal(1, box.north_deg);
  place_.BindReal(2, box.west_deg);
  place_.BindReal(3, box.east_deg);
  place_.BindReal(4, IndexSeconds(rows.front().estimate.time));
  place_.BindReal(5, IndexSeconds(rows.back().estimate.time));
  place_.BindInt(6, block_id);
  const absl::StatusOr<bool> row = place_.Step();
  const bool placed = row.ok() && *row && place_.ColumnInt(0) != 0;
  place_.Reset();
  FATHOM_RETURN_IF_ERROR(row.status());
  return placed;
}

absl::StatusOr<std::optional<HistoryBlocks>> FindBlocks(
    Connection& connection, const map::ContactKey& key, Time from, Time to) {
  FATHOM_ASSIGN_OR_RETURN(
      Statement find,
      connection.Prepare("SELECT contact_number FROM contact WHERE source_id = "
                         "? AND contact_id = ?"));
  find.BindText(0, key.source.value);
  find.BindText(1, key.contact.value);
  FATHOM_ASSIGN_OR_RETURN(const bool known, find.Step());
  if (!known) return std::nullopt;
  return FindBlocksOf(connection, find.ColumnInt(0), key, from, to);
}

absl::StatusOr<HistoryBlocks> FindBlocksOf(Connection& connection,
                                           std::int64_t contact_number,
                                           const map::ContactKey& key,
                                           Time from, Time to) {
  HistoryBlocks blocks{
      .contact_number = contact_number, .key = key, .block_ids = {}};
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare(
          "SELECT block_id FROM contact_history WHERE contact_number = ? AND "
          "last_time_us >= ? AND first_time_us <= ? ORDER BY last_time_us, "
          "first_time_us, last_revision"));
  select.BindInt(0, blocks.contact_number);
  select.BindInt(1, ToUnixMicros(from));
  select.BindInt(2, ToUnixMicros(to));
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const bool more, select.Step());
    if (!more) return blocks;
    blocks.block_ids.push_back(select.ColumnInt(0));
  }
}

absl::StatusOr<std::vector<HistoryBlocks>> FindBlocksIn(Connection& connection,
                                                        const HistoryArea& area,
                                                        Time from, Time to) {
  // Across the antimeridian there are two boxes; else the second is none.
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare(
          "SELECT contact_number, source_id, contact_id, block_id FROM "
          "contact_history JOIN contact USING (contact_number) WHERE block_id "
          "IN (SELECT block_id FROM contact_history_place WHERE north_deg >= "
          "?1 AND south_deg <= ?2 AND last_s >= ?3 AND first_s <= ?4 AND "
          "east_deg >= ?5 AND west_deg <= ?6 UNION SELECT block_id FROM "
          "contact_history_place WHERE north_deg >= ?1 AND south_deg <= ?2 AND "
          "last_s >= ?3 AND first_s <= ?4 AND east_deg >= ?7 AND west_deg <= "
          "?8) AND last_time_us >= ?9 AND first_time_us <= ?10 ORDER BY "
          "source_id, contact_id, last_time_us, first_time_us, "
          "last_revision"));
  const bool crosses = area.west_deg > area.east_deg;
  constexpr double kNowhereDeg = 999;
  select.BindReal(0, area.south_deg);
  select.BindReal(1, area.north_deg);
  select.BindReal(2, IndexSeconds(from));
  select.BindReal(3, IndexSeconds(to));
  select.BindReal(4, area.west_deg);
  select.BindReal(5, crosses ? kNowhereDeg : area.east_deg);
  select.BindReal(6, crosses ? -kNowhereDeg : kNowhereDeg);
  select.BindReal(7, area.east_deg);
  select.BindInt(8, ToUnixMicros(from));
  select.BindInt(9, ToUnixMicros(to));
  std::vector<HistoryBlocks> found;
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const bool more, select.Step());
    if (!more) return found;
    if (found.empty() || found.back().contact_number != select.ColumnInt(0)) {
      found.push_back({.contact_number = select.ColumnInt(0),
                       .key = {.source = {select.ColumnText(1)},
                               .contact = {select.ColumnText(2)}},
                       .block_ids = {}});
    }
    found.back().block_ids.push_back(select.ColumnInt(3));
  }
}

absl::StatusOr<bool> ReadBlocks(
    Connection& connection, const HistoryBlocks& blocks,
    const HistoryTail& tail, Time from, Time to,
    const std::function<bool(const ContactHistoryRow&)>& visit) {
  FATHOM_ASSIGN_OR_RETURN(Statement read, connection.Prepare(kRead));
  const auto tell = [&](ContactHistoryRow row) {
    if (row.estimate.time < from || row.estimate.time > to) return true;
    row.estimate.key = blocks.key;
    return visit(row);
  };
  auto newer = tail.rows.begin();
  for (const std::int64_t block_id : blocks.block_ids) {
    FATHOM_ASSIGN_OR_RETURN(std::vector<ContactHistoryRow> rows,
                            ReadBlock(read, blocks.contact_number, block_id));
    for (ContactHistoryRow& row : rows) {
      if (!tail.Stands(row)) continue;
      for (; newer != tail.rows.end() && IsBefore(*newer, row); ++newer) {
        if (!tell(*newer)) return false;
      }
      // The tail may have been written since it was asked for.
      if (newer != tail.rows.end() && !IsBefore(row, *newer)) continue;
      if (!tell(std::move(row))) return false;
    }
  }
  for (; newer != tail.rows.end(); ++newer) {
    if (!tell(*newer)) return false;
  }
  return true;
}

}  // namespace fathom::storage
