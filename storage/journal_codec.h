// The journal's codec: the events of one commit as segments.
//
// One row per ping would cap ingest at what SQLite inserts; so the records of
// a commit share rows. Within a segment the beams of all pings form one array
// of 16-byte elements, laid out as sixteen byte planes (column.h): bearings
// repeat from ping to ping and vanish, the noise in ranges and depths stays.
// What is left per record is a row of plain bytes, all rows in one plane.
// Layout in docs/storage_format.md. Lossless. Thread-safe.

#ifndef FATHOM_STORAGE_JOURNAL_CODEC_H_
#define FATHOM_STORAGE_JOURNAL_CODEC_H_

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "storage/bytes.h"
#include "storage/mission_records.h"

namespace fathom::storage {

// A segment is closed when it holds this many beams: planes of 64 KiB stay in
// the second-level cache while they are split and compressed.
inline constexpr std::size_t kTargetBeams = 1 << 16;

// A record that alone exceeds these is refused; a segment that claims more is
// damaged. Beams of the largest ping that a server could admit (its message
// limit is 4 MiB, a beam takes 16 bytes).
inline constexpr std::size_t kMaxBeamsPerRecord = 1 << 18;
inline constexpr std::size_t kMaxSegmentBeams =
    kTargetBeams + kMaxBeamsPerRecord;
inline constexpr std::size_t kMaxSegmentRecords = 1 << 16;

// One encoded segment and what its row says of it.
struct JournalSegment {
  std::uint64_t first_revision = 0;
  std::uint64_t last_revision = 0;
  std::size_t record_count = 0;
  Bytes content;
};

// `records` in order, in as few segments as the targets allow.
// Errors: INVALID_ARGUMENT if a ping exceeds kMaxBeamsPerRecord or an id
// kMaxStringBytes.
absl::StatusOr<std::vector<JournalSegment>> EncodeJournal(
    std::span<const JournalRecord> records);

// Appends a segment's records to `records`.
// Errors: DATA_LOSS naming `what`; UNIMPLEMENTED for a newer version.
absl::Status DecodeJournal(ByteSpan blob, std::string_view what,
                           std::vector<JournalRecord>& records);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_JOURNAL_CODEC_H_
