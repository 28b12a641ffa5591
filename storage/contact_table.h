// The table `contact`: who was ever reported, and what the map holds of each.
//
// One thread at a time; inside the caller's transaction.

#ifndef FATHOM_STORAGE_CONTACT_TABLE_H_
#define FATHOM_STORAGE_CONTACT_TABLE_H_

#include <cstdint>
#include <optional>
#include <unordered_map>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "map/geodesy/ids.h"
#include "storage/bytes.h"
#include "storage/sqlite.h"

namespace fathom::storage {

class ContactTable {
 public:
  // `connection` must outlive it.
  static absl::StatusOr<ContactTable> Create(Connection& connection);

  // The contact's number, given now if it is new.
  absl::StatusOr<std::int64_t> NumberOf(const map::ContactKey& key);
  // The same, if it has one.
  absl::StatusOr<std::optional<std::int64_t>> FindNumber(
      const map::ContactKey& key);
  // What the map holds of the contact (EncodeContact).
  absl::Status WriteState(const map::ContactKey& key, ByteSpan content);
  // The map holds it no longer; its history stays.
  absl::Status ClearState(const map::ContactKey& key);

  // Forgets the numbers it has given since the last commit: call when a
  // transaction is rolled back.
  void ForgetNumbers() { numbers_.clear(); }

 private:
  // Numbers are looked up once; beyond this many the memory is given back.
  static constexpr std::size_t kMaxNumbersKept = 100'000;

  std::unordered_map<map::ContactKey, std::int64_t> numbers_;
  Statement find_;
  Statement add_;
  Statement write_state_;
};

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_CONTACT_TABLE_H_
