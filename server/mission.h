// Opening and creating missions: from a path and options to a keeper's start.
// Free functions; call them before threads start.

#ifndef FATHOM_SERVER_MISSION_H_
#define FATHOM_SERVER_MISSION_H_

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"
#include "map/geodesy/points.h"
#include "server/map_keeper.h"
#include "storage/mission_file.h"

namespace fathom::server {

// What a new mission is; either both corners, or center and side_m.
struct NewMission {
  std::optional<map::GeodeticPoint> south_west;
  std::optional<map::GeodeticPoint> north_west;
  std::optional<map::GeodeticPoint> center;
  double side_m = 0;
  // Finest cell of the global map, metres.
  double min_cell_m = 10;
  std::string name;
  std::string vertical_datum = "MSL";
  double tolerance_m = 0.5;
  uint64_t max_cells = 50'000'000;
  uint32_t max_contacts = 1000;
  // Variance that evidence gains with age, m^2/s; 0: none (the thesis's).
  double ageing_rate_m2_s = 0;
};

// 128 random bits as 32 hexadecimal digits.
std::string RandomMissionId();

// "41.5,-71.4" in degrees. Errors: INVALID_ARGUMENT.
absl::StatusOr<map::GeodeticPoint> ParsePoint(std::string_view text);

// Makes the mission file. Errors: INVALID_ARGUMENT naming the flag, and those
// of MissionFile::Create.
absl::StatusOr<std::unique_ptr<storage::MissionFile>> CreateMission(
    const std::string& path, const NewMission& mission, Time now);

// Reads the file and rebuilds the map, whose tiles may take `tile_budget_bytes`
// unpacked (map::TileMemory). Errors: those of MissionFile::Load and
// storage::RestoreMap.
absl::StatusOr<MapKeeper::Restored> RestoreMission(storage::MissionFile& file,
                                                   uint64_t tile_budget_bytes);

}  // namespace fathom::server

#endif  // FATHOM_SERVER_MISSION_H_
