// A keeper on a mission file, as the server opens it.

#ifndef FATHOM_TESTS_SERVER_OPEN_KEEPER_H_
#define FATHOM_TESTS_SERVER_OPEN_KEEPER_H_

#include <memory>
#include <utility>

#include "absl/status/statusor.h"
#include "server/map_keeper.h"
#include "server/mission.h"
#include "server/mission_store.h"
#include "storage/mission_file.h"
#include "tests/testing/status_matchers.h"

namespace fathom::server {

// Destroyed from the keeper to the file.
struct Open {
  std::unique_ptr<storage::MissionFile> file;
  std::unique_ptr<MissionFileStore> store;
  std::unique_ptr<MapKeeper> keeper;
};

// REQUIRES: the file could be opened; the calling test fails if its mission
// cannot be restored.
inline Open OpenKeeper(
    absl::StatusOr<std::unique_ptr<storage::MissionFile>> file,
    uint64_t tile_budget_bytes = map::TileMemoryOptions::kUnlimited) {
  EXPECT_THAT(file, ::fathom::testing::IsOk());
  Open open;
  open.file = *std::move(file);
  open.store = std::make_unique<MissionFileStore>(*open.file);
  auto restored = RestoreMission(*open.file, tile_budget_bytes);
  EXPECT_THAT(restored, ::fathom::testing::IsOk());
  open.keeper = std::make_unique<MapKeeper>(*std::move(restored), *open.store,
                                            KeeperOptions{});
  return open;
}

}  // namespace fathom::server

#endif  // FATHOM_TESTS_SERVER_OPEN_KEEPER_H_
