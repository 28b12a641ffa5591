#include "storage/contact_table.h"

#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"

namespace fathom::storage {
namespace {

std::string NameOf(const map::ContactKey& key) {
  return absl::StrFormat("contact source_id=%s contact_id=%s", key.source.value,
                         key.contact.value);
}

// The contact's number, as `find` yields it.
absl::StatusOr<std::optional<std::int64_t>> NumberBy(
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
  FATHOM_ASSIGN_OR_RETURN(
      table.find_,
      connection.Prepare("SELECT contact_number FROM contact "
                         "WHERE source_id = ? AND contact_id = ?"));
  FATHOM_ASSIGN_OR_RETURN(
      table.add_, connection.Prepare("INSERT INTO contact (source_id, "
                                     "contact_id) VALUES (?, ?) RETURNING "
                                     "contact_number"));
  FATHOM_ASSIGN_OR_RETURN(
      table.write_state_,
      connection.Prepare("UPDATE contact SET content = ? WHERE "
                         "contact_number = ?"));
  return table;
}

absl::StatusOr<std::optional<std::int64_t>> ContactTable::FindNumber(
    const map::ContactKey& key) {
  return NumberBy(find_, key);
}

absl::StatusOr<std::int64_t> ContactTable::NumberOf(
    const map::ContactKey& key) {
  if (const auto known = numbers_.find(key); known != numbers_.end()) {
    return known->second;
  }
  FATHOM_ASSIGN_OR_RETURN(std::optional<std::int64_t> number,
                          NumberBy(find_, key));
  if (!number.has_value()) {
    FATHOM_ASSIGN_OR_RETURN(number, NumberBy(add_, key));
    if (!number.has_value()) {
      return absl::InternalError(NameOf(key) + ": no number was given");
    }
  }
  if (numbers_.size() >= kMaxNumbersKept) numbers_.clear();
  numbers_.emplace(key, *number);
  return *number;
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

}  // namespace fathom::storage
