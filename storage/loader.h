// Reads a whole mission back: see MissionFile::Load.

#ifndef FATHOM_STORAGE_LOADER_H_
#define FATHOM_STORAGE_LOADER_H_

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "storage/mission_records.h"
#include "storage/sqlite.h"

namespace fathom::storage {

// Tiles are decoded, checked and built on up to four threads; all have ended
// when it returns. When those without children take `unpacked_tile_bytes`, the
// others come packed (for map::TileMemory with kTileCodec).
// Errors: DATA_LOSS naming the row whose blob is damaged; those of sqlite.h.
absl::StatusOr<Loaded> LoadMission(
    Connection& connection,
    std::uint64_t unpacked_tile_bytes = map::TileMemoryOptions::kUnlimited);

// The same of a damaged mission: what cannot be read is left out and told in
// Loaded::damage; of the journal, all from the first bad segment on. Errors:
// DATA_LOSS if the mission's own row cannot be read.
absl::StatusOr<Loaded> SalvageMission(Connection& connection);

// Of a mission only what ReplayHistory needs: contacts and journal.
absl::StatusOr<Loaded> LoadContactsAndJournal(Connection& connection);

absl::StatusOr<std::vector<SourcePosition>> LoadSourcePositions(
    Connection& connection);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_LOADER_H_
