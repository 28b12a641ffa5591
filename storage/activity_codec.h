// Activities as bytes: their start (for the journal), and parameters with
// counters (for the checkpoint). Lossless; layouts in docs/storage_format.md.
// Thread-safe.

#ifndef FATHOM_STORAGE_ACTIVITY_CODEC_H_
#define FATHOM_STORAGE_ACTIVITY_CODEC_H_

#include <string_view>

#include "absl/status/statusor.h"
#include "map/obstacle_map/events.h"
#include "map/obstacle_map/obstacle_map.h"
#include "storage/bytes.h"

namespace fathom::storage {

void PutStartActivity(const map::StartActivity& start, ByteWriter& writer);
// Fails the reader on what no encoder wrote.
void GetStartActivity(ByteReader& reader, map::StartActivity& start);

Bytes EncodeActivity(const map::StoredActivity& activity);
// Errors: DATA_LOSS naming `what`; UNIMPLEMENTED for a newer version.
absl::StatusOr<map::StoredActivity> DecodeActivity(ByteSpan blob,
                                                   std::string_view what);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_ACTIVITY_CODEC_H_
