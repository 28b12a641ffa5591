// The tables `contact` and `contact_history`: who was ever reported, what the
// map holds of each, and what was believed after every report.
//
// Histories are clustered by contact and time (WITHOUT ROWID), so a contact's
// past is one range, and inserts touch one page per contact that is reporting
// now, however many millions of rows lie behind.
//
// One thread at a time; inside the caller's transaction.

#ifndef FATHOM_STORAGE_CONTACT_TABLE_H_
#define FATHOM_STORAGE_CONTACT_TABLE_H_

#include <cstdint>
#include <functional>
#include <optional>
#include <unordered_map>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"
#include "map/geodesy/ids.h"
#include "storage/bytes.h"
#include "storage/mission_records.h"
#include "storage/sqlite.h"

namespace fathom::storage {

class ContactTable {
 public:
  // `connection` must outlive it.
  static absl::StatusOr<ContactTable> Create(Connection& connection);

  // Of rows of one contact, time and revision the last stays.
  absl::Status AppendHistory(const ContactHistoryRow& row);
  // What the map holds of the contact (EncodeContact).
  absl::Status WriteState(const map::ContactKey& key, ByteSpan content);
  // The map holds it no longer; its history stays.
  absl::Status ClearState(const map::ContactKey& key);

  // Forgets the numbers it has given since the last commit: call when a
  // transaction is rolled back.
  void ForgetNumbers() { numbers_.clear(); }

 private:
  // The contact's number, given now if it is new.
  absl::StatusOr<std::int64_t> NumberOf(const map::ContactKey& key);

  // Numbers are looked up once; beyond this many the memory is given back.
  static constexpr std::size_t kMaxNumbersKept = 100'000;

  std::unordered_map<map::ContactKey, std::int64_t> numbers_;
  Statement find_;
  Statement add_;
  Statement append_;
  Statement revise_;
  Statement write_state_;
};

// Reads a contact's history through `connection`: see
// MissionFile::ReadContactHistory.
absl::Status ReadHistory(
    Connection& connection, const map::ContactKey& key, Time from, Time to,
    const std::function<bool(const ContactHistoryRow&)>& visit);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_CONTACT_TABLE_H_
