// From a mission file back to a working map: restore the checkpoint, replay
// the journal. The server calls this once at start; the command line calls it
// to tell a file's digest.

#ifndef FATHOM_STORAGE_RESTORE_H_
#define FATHOM_STORAGE_RESTORE_H_

#include <cstdint>
#include <memory>

#include "absl/status/statusor.h"
#include "map/obstacle_map/obstacle_map.h"
#include "storage/mission_records.h"

namespace fathom::storage {

// The options that a mission's metadata asks for; what metadata leaves open
// (bounds of a server) keeps its default. Errors: INVALID_ARGUMENT.
absl::StatusOr<map::MissionOptions> OptionsOf(const MissionMetadata& metadata);

// A map that is where the mission was.
struct RestoredMap {
  std::unique_ptr<map::ObstacleMap> map;
  // The map as of the file's checkpoint, before the replay: hand it to the
  // next Checkpoint as `previous`.
  std::shared_ptr<const map::ObstacleMapView> checkpoint;
  // Records that the map refused when replayed; the same were refused then.
  std::uint64_t refused_records = 0;
};

// Builds the map. `options` should come from OptionsOf(loaded.metadata).
// Errors: DATA_LOSS if the pieces do not fit together, naming the piece.
absl::StatusOr<RestoredMap> RestoreMap(Loaded loaded,
                                       const map::MissionOptions& options);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_RESTORE_H_
