#include "storage/contact_table.h"

#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/contact_codec.h"

namespace fathom::storage {
namespace {

constexpr char kFind[] =
    "SELECT contact_number FROM contact WHERE source_id = ? AND contact_id = ?";

std::string NameOf(const map::ContactKey& key) {
  return absl::StrFormat("contact source_id=%s contact_id=%s", key.source.value,
                         key.contact.value);
}

// The contact's number in the file, if it has one.
absl::StatusOr<std::optional<std::int64_t>> FindNumber(
    Statement& find, const map::ContactKey& key) {
  find.BindText(0, key.source.value);
  find.BindText(1, key.contact.value);
  const absl::StatusOr<bool> row = find.Step();
  std::optional<std::int64_t> number;
  if (row.ok() && *row) number = find.ColumnInt(0);
  find.Reset();
  FATHOM_RETURN_IF_ERROR(row.status());
  return number;
}

}  // namespace

absl::StatusOr<ContactTable> ContactTable::Create(Connection& connection) {
  ContactTable table;
  FATHOM_ASSIGN_OR_RETURN(table.find_, connection.Prepare(kFind));
  FATHOM_ASSIGN_OR_RETURN(
      table.add_, connection.Prepare("INSERT INTO contact (source_id, "
                                     "contact_id) VALUES (?, ?) RETURNING "
                                     "contact_number"));
  FATHOM_ASSIGN_OR_RETURN(
      table.append_,
      connection.Prepare(
          "INSERT OR REPLACE INTO contact_history (contact_number, time_us, "
          "revision, contact_class, status, latitude_deg, longitude_deg, "
          "velocity_north_m_s, velocity_east_m_s, content) VALUES (?, ?, ?, "
          "?, ?, ?, ?, ?, ?, ?)"));
  FATHOM_ASSIGN_OR_RETURN(
      table.revise_,
      connection.Prepare("DELETE FROM contact_history WHERE contact_number = ? "
                         "AND time_us >= ? AND revision < ?"));
  FATHOM_ASSIGN_OR_RETURN(
      table.write_state_,
      connection.Prepare("UPDATE contact SET content = ? WHERE "
                         "contact_number = ?"));
  return table;
}

absl::StatusOr<std::int64_t> ContactTable::NumberOf(
    const map::ContactKey& key) {
  if (const auto known = numbers_.find(key); known != numbers_.end()) {
    return known->second;
  }
  FATHOM_ASSIGN_OR_RETURN(std::optional<std::int64_t> number,
                          FindNumber(find_, key));
  if (!number.has_value()) {
    FATHOM_ASSIGN_OR_RETURN(number, FindNumber(add_, key));
    if (!number.has_value()) {
      return absl::InternalError(NameOf(key) + ": no number was given");
    }
  }
  if (numbers_.size() >= kMaxNumbersKept) numbers_.clear();
  numbers_.emplace(key, *number);
  return *number;
}

absl::Status ContactTable::AppendHistory(const ContactHistoryRow& row) {
  const map::ContactEstimate& estimate = row.estimate;
  FATHOM_ASSIGN_OR_RETURN(const std::int64_t number, NumberOf(estimate.key));
  if (row.revises) {
    revise_.BindInt(0, number);
    revise_.BindInt(1, ToUnixMicros(estimate.time));
    revise_.BindUint(2, row.revision);
    FATHOM_RETURN_IF_ERROR(revise_.Run());
  }
  const map::GeodeticPoint position = estimate.Position();
  const Bytes content = EncodeContactEstimate(estimate);
  append_.BindInt(0, number);
  append_.BindInt(1, ToUnixMicros(estimate.time));
  append_.BindUint(2, row.revision);
  append_.BindInt(3, static_cast<std::int64_t>(estimate.contact_class));
  append_.BindInt(4, static_cast<std::int64_t>(estimate.status));
  append_.BindReal(5, position.latitude_deg);
  append_.BindReal(6, position.longitude_deg);
  append_.BindReal(7, estimate.x(2));
  append_.BindReal(8, estimate.x(3));
  append_.BindBlob(9, content);
  return append_.Run();
}

absl::Status ContactTable::WriteState(const map::ContactKey& key,
                                      ByteSpan content) {
  FATHOM_ASSIGN_OR_RETURN(const std::int64_t number, NumberOf(key));
  write_state_.BindBlob(0, content);
  write_state_.BindInt(1, number);
  return write_state_.Run();
}

absl::Status ContactTable::ClearState(const map::ContactKey& key) {
  FATHOM_ASSIGN_OR_RETURN(const std::int64_t number, NumberOf(key));
  write_state_.BindNull(0);
  write_state_.BindInt(1, number);
  return write_state_.Run();
}

absl::Status ReadHistory(
    Connection& connection, const map::ContactKey& key, Time from, Time to,
    const std::function<bool(const ContactHistoryRow&)>& visit) {
  FATHOM_ASSIGN_OR_RETURN(Statement find, connection.Prepare(kFind));
  FATHOM_ASSIGN_OR_RETURN(const std::optional<std::int64_t> number,
                          FindNumber(find, key));
  if (!number.has_value()) {
    return absl::NotFoundError(NameOf(key) + " was never reported");
  }
  FATHOM_ASSIGN_OR_RETURN(
      Statement select,
      connection.Prepare("SELECT revision, content FROM contact_history WHERE "
                         "contact_number = ? AND time_us BETWEEN ? AND ? "
                         "ORDER BY time_us, revision"));
  select.BindInt(0, *number);
  select.BindInt(1, ToUnixMicros(from));
  select.BindInt(2, ToUnixMicros(to));
  while (true) {
    FATHOM_ASSIGN_OR_RETURN(const bool more, select.Step());
    if (!more) return absl::OkStatus();
    FATHOM_ASSIGN_OR_RETURN(
        map::ContactEstimate estimate,
        DecodeContactEstimate(select.ColumnBlob(1), NameOf(key) + " history"));
    ContactHistoryRow row;
    row.revision = select.ColumnUint(0);
    row.estimate = std::move(estimate);
    row.estimate.key = key;
    if (!visit(row)) return absl::OkStatus();
  }
}

}  // namespace fathom::storage
