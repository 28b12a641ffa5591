// Fuzz target: journal segments, and their replay into a map as at a start.

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "storage/journal_codec.h"
#include "storage/restore.h"
#include "tests/fuzz/fuzz.h"
#include "tests/storage/sample_records.h"

namespace fathom::storage {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes,
                                      std::size_t size) {
  const Bytes blob =
      fuzz::Sealed(BlobKind::kJournalSegment, 1, ByteSpan(bytes, size));
  std::vector<JournalRecord> records;
  if (!DecodeJournal(blob, "segment", records).ok()) return 0;

  // Encoding is a fixed point from the first decoded form on.
  const auto segments = EncodeJournal(records);
  if (segments.ok()) {
    std::vector<JournalRecord> again;
    for (const JournalSegment& segment : *segments) {
      FATHOM_FUZZ_CHECK(DecodeJournal(segment.content, "again", again).ok());
    }
    FATHOM_FUZZ_CHECK(again.size() == records.size());
    const auto second = EncodeJournal(again);
    FATHOM_FUZZ_CHECK(second.ok() && second->size() == segments->size());
    for (std::size_t i = 0; i < second->size(); ++i) {
      FATHOM_FUZZ_CHECK((*second)[i].content == (*segments)[i].content);
    }
  }

  // Large areas cost time, not bugs.
  if (records.size() > 200) return 0;
  Loaded loaded;
  loaded.metadata = SampleMetadata();
  loaded.journal = std::move(records);
  map::MissionOptions options = *OptionsOf(loaded.metadata);
  options.max_local_cells = 10'000;
  (void)RestoreMap(std::move(loaded), options);
  return 0;
}

}  // namespace fathom::storage
