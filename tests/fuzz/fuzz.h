// What the fuzz targets share. Each target is one program: under clang with
// libFuzzer it searches (tests/fuzz/run), under any compiler it replays the
// corpus as a ctest entry (replay.cc).
//
// A target checks: no crash, no sanitizer report, bounded memory, and what
// FATHOM_FUZZ_CHECK says - whatever is accepted must come back unchanged.

#ifndef FATHOM_TESTS_FUZZ_FUZZ_H_
#define FATHOM_TESTS_FUZZ_FUZZ_H_

#include <cstdio>
#include <cstdlib>

#include "storage/blob.h"

// Also in a release build.
#define FATHOM_FUZZ_CHECK(condition)                                       \
  do {                                                                     \
    if (!(condition)) {                                                    \
      std::fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                        \
    }                                                                      \
  } while (false)

namespace fathom::fuzz {

// The payload in an envelope with a right checksum: what a collision or a
// hostile writer would bring. Without it no mutation would pass the door.
inline storage::Bytes Sealed(storage::BlobKind kind, std::uint8_t version,
                             storage::ByteSpan payload) {
  storage::ByteWriter writer = storage::StartBlob();
  writer.PutBytes(payload);
  return storage::SealBlob(kind, version, std::move(writer));
}

}  // namespace fathom::fuzz

#endif  // FATHOM_TESTS_FUZZ_FUZZ_H_
