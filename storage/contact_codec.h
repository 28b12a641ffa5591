// Contacts as bytes: reports and drops (for the journal), points and names (for
// the history, history_codec.h), whole contacts (for the checkpoint). Lossless.
// docs/storage_format.md has the layouts. Thread-safe.

#ifndef FATHOM_STORAGE_CONTACT_CODEC_H_
#define FATHOM_STORAGE_CONTACT_CODEC_H_

#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "map/contacts/contact.h"
#include "map/contacts/contact_report.h"
#include "storage/bytes.h"

namespace fathom::storage {

// Bytes of one ContactPoint: what a million of history rows cost.
inline constexpr std::size_t kContactPointBytes = 242;

// A report without its key (the caller writes ids from a table of its own).
void PutContactReport(const map::ContactReport& report, ByteWriter& writer);
// Leaves `key` as it is; fails the reader on what no encoder wrote.
void GetContactReport(ByteReader& reader, map::ContactReport& report);

// kContactPointBytes.
void PutContactPoint(const map::ContactPoint& point, ByteWriter& writer);
void GetContactPoint(ByteReader& reader, map::ContactPoint& point);

// At most map::kMaxLinkedNames names, and how many.
void PutNames(const std::vector<map::ContactKey>& names, ByteWriter& writer);
std::vector<map::ContactKey> GetNames(ByteReader& reader);

// An estimate without its key, its other names with it: a row of the history of
// formats 5 and 6 (migrate.h).
absl::StatusOr<map::ContactEstimate> DecodeContactEstimate(
    ByteSpan blob, std::string_view what);

// A contact with its recent estimates and reports, and what is kept of the
// estimates before. REQUIRES: 1 to map::kRecentEstimates estimates, at most
// map::kOlderEstimates older ones.
Bytes EncodeContact(const map::StoredContact& contact);
// Errors: DATA_LOSS naming `what`; UNIMPLEMENTED for a newer version.
absl::StatusOr<map::StoredContact> DecodeContact(ByteSpan blob,
                                                 std::string_view what);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_CONTACT_CODEC_H_
