// The envelope of every blob of the mission file.
//
//   offset size
//        0    1  kind: which codec wrote it (BlobKind, an ASCII letter)
//        1    1  version of that codec, from 1
//        2    2  zero
//        4    4  CRC-32C of bytes 0 to 3 and of the payload, little-endian
//        8    -  payload
//
// A blob that fails its CRC is an error that names it; nothing of it is used.
// Functions are thread-safe.

#ifndef FATHOM_STORAGE_BLOB_H_
#define FATHOM_STORAGE_BLOB_H_

#include <cstdint>
#include <string_view>

#include "absl/status/statusor.h"
#include "storage/bytes.h"

namespace fathom::storage {

enum class BlobKind : std::uint8_t {
  kTile = 'T',
  kLocalBlock = 'B',
  kJournalSegment = 'J',
  kContact = 'C',
  kContactEstimate = 'E',  // Formats 5 and 6.
  kContactHistory = 'H',
  kActivity = 'A',
};

inline constexpr std::size_t kBlobHeaderBytes = 8;

// A writer that already holds room for the header: encode into it, then Seal.
ByteWriter StartBlob();

// Fills in the header of what StartBlob began and returns the blob.
Bytes SealBlob(BlobKind kind, std::uint8_t version, ByteWriter writer);

// Checks kind, version and CRC; returns the payload, in place.
//
// Errors: DATA_LOSS naming `what` for a short blob, another kind or a bad CRC;
// UNIMPLEMENTED for a version above `newest_version`.
absl::StatusOr<ByteSpan> OpenBlob(BlobKind kind, std::uint8_t newest_version,
                                  ByteSpan blob, std::string_view what);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_BLOB_H_
