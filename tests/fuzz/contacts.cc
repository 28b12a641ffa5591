// Fuzz target: blobs of contacts, of their history (this format's and the last
// one's) and of activities, as far as a start takes them. The first byte
// chooses the kind.

#include <cstddef>
#include <cstdint>
#include <utility>

#include "map/contacts/contact_map.h"
#include "storage/activity_codec.h"
#include "storage/contact_codec.h"
#include "storage/history_codec.h"
#include "tests/fuzz/fuzz.h"

namespace fathom::fuzz {
namespace {

using storage::Bytes;
using storage::ByteSpan;

void FuzzEstimate(ByteSpan payload, std::uint8_t version) {
  auto estimate = storage::DecodeContactEstimate(
      Sealed(storage::BlobKind::kContactEstimate, version, payload),
      "estimate");
  if (!estimate.ok()) return;
  // A migration makes a block of it.
  storage::ContactHistoryRow row;
  row.estimate = *std::move(estimate);
  const Bytes stored = storage::EncodeHistory(1, {&row, 1});
  FATHOM_FUZZ_CHECK(storage::DecodeHistory(stored, 1, "again").ok());
}

void FuzzHistory(ByteSpan payload) {
  const Bytes blob = Sealed(storage::BlobKind::kContactHistory, 1, payload);
  // Whose it says it is.
  const std::int64_t number = storage::ByteReader(payload).GetI64();
  const auto rows = storage::DecodeHistory(blob, number, "history");
  if (!rows.ok()) return;
  const Bytes stored = storage::EncodeHistory(number, *rows);
  const auto again = storage::DecodeHistory(stored, number, "again");
  FATHOM_FUZZ_CHECK(again.ok());
  FATHOM_FUZZ_CHECK(storage::EncodeHistory(number, *again) == stored);
}

void FuzzContact(ByteSpan payload, std::uint8_t version) {
  const auto contact = storage::DecodeContact(
      Sealed(storage::BlobKind::kContact, version, payload), "contact");
  if (!contact.ok()) return;
  const Bytes stored = storage::EncodeContact(*contact);
  const auto again = storage::DecodeContact(stored, "again");
  FATHOM_FUZZ_CHECK(again.ok());
  FATHOM_FUZZ_CHECK(storage::EncodeContact(*again) == stored);
  map::ContactMap contacts((map::ContactMapOptions()));
  (void)contacts.Restore(*contact);
}

void FuzzActivity(ByteSpan payload) {
  const auto activity = storage::DecodeActivity(
      Sealed(storage::BlobKind::kActivity, 1, payload), "activity");
  if (!activity.ok()) return;
  const Bytes stored = storage::EncodeActivity(*activity);
  const auto again = storage::DecodeActivity(stored, "again");
  FATHOM_FUZZ_CHECK(again.ok());
  FATHOM_FUZZ_CHECK(storage::EncodeActivity(*again) == stored);
  (void)map::LocalMap::Create(activity->start.options);
}

}  // namespace
}  // namespace fathom::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes,
                                      std::size_t size) {
  if (size == 0) return 0;
  const fathom::storage::ByteSpan payload(bytes + 1, size - 1);
  switch (bytes[0] % 8) {
    case 0:
      fathom::fuzz::FuzzEstimate(payload, 1);
      break;
    case 1:
      fathom::fuzz::FuzzContact(payload, 1);
      break;
    case 2:
      fathom::fuzz::FuzzContact(payload, 2);
      break;
    case 3:
      fathom::fuzz::FuzzActivity(payload);
      break;
    case 4:
      fathom::fuzz::FuzzEstimate(payload, 2);
      break;
    case 5:
      fathom::fuzz::FuzzContact(payload, 3);
      break;
    case 7:
      fathom::fuzz::FuzzContact(payload, 4);
      break;
    default:
      fathom::fuzz::FuzzHistory(payload);
  }
  return 0;
}
