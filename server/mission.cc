#include "server/mission.h"

#include <cmath>
#include <random>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "base/status_macros.h"
#include "map/contacts/filter.h"
#include "map/global/root_square.h"
#include "server/limits.h"
#include "storage/restore.h"
#include "storage/tile_codec.h"

namespace fathom::server {
namespace {

absl::StatusOr<map::RootSquare> MakeRoot(const NewMission& mission) {
  if (mission.center.has_value()) {
    if (mission.south_west.has_value() || mission.north_west.has_value()) {
      return absl::InvalidArgumentError(
          "give either --center and --side-nmi, or --south-west and "
          "--north-west");
    }
    if (!(mission.side_m > 0)) {
      return absl::InvalidArgumentError("--center needs --side-nmi > 0");
    }
    return map::RootSquare::CenteredOn(*mission.center, mission.side_m,
                                       mission.min_cell_m);
  }
  if (!mission.south_west.has_value() || !mission.north_west.has_value()) {
    return absl::InvalidArgumentError(
        "a new mission needs its square: --center LAT,LON --side-nmi N, or "
        "--south-west LAT,LON --north-west LAT,LON");
  }
  return map::RootSquare::Create(*mission.south_west, *mission.north_west,
                                 mission.min_cell_m);
}

absl::Status CheckRange(const char* flag, double value, double min,
                        double max) {
  if (value >= min && value <= max) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrFormat("%s=%g is not in [%g, %g]", flag, value, min, max));
}

}  // namespace

std::string RandomMissionId() {
  std::random_device random;
  std::string id;
  for (int i = 0; i < 4; ++i) id += absl::StrFormat("%08x", random());
  return id;
}

absl::StatusOr<map::GeodeticPoint> ParsePoint(std::string_view text) {
  const std::vector<std::string> parts = absl::StrSplit(std::string(text), ',');
  map::GeodeticPoint point;
  if (parts.size() != 2 || !absl::SimpleAtod(parts[0], &point.latitude_deg) ||
      !absl::SimpleAtod(parts[1], &point.longitude_deg)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "\"%s\" is not LAT,LON in degrees, e.g. 41.5,-71.4", text));
  }
  FATHOM_RETURN_IF_ERROR(map::ValidateGeodetic(point));
  return point;
}

absl::StatusOr<std::unique_ptr<storage::MissionFile>> CreateMission(
    const std::string& path, const NewMission& mission, Time now) {
  FATHOM_RETURN_IF_ERROR(
      CheckRange("--min-cell-m", mission.min_cell_m, 0.1, 100'000));
  FATHOM_RETURN_IF_ERROR(
      CheckRange("--tolerance-m", mission.tolerance_m, 0, 1000));
  FATHOM_RETURN_IF_ERROR(CheckRange(
      "--max-cells", static_cast<double>(mission.max_cells), 1000, 1e9));
  FATHOM_RETURN_IF_ERROR(
      CheckRange("--max-contacts", mission.max_contacts, 1, 100'000));
  FATHOM_RETURN_IF_ERROR(CheckRange("--ageing-m2-per-day",
                                    mission.ageing_rate_m2_s * 86'400, 0, 1e6));
  if (mission.name.size() > kMaxNameLength) {
    return absl::InvalidArgumentError("--name is too long");
  }
  if (mission.vertical_datum.empty() ||
      mission.vertical_datum.size() > kMaxNameLength) {
    return absl::InvalidArgumentError("--datum must have 1 to 200 characters");
  }
  FATHOM_ASSIGN_OR_RETURN(const map::RootSquare root, MakeRoot(mission));
  return storage::MissionFile::Create(
      path, {.mission_id = RandomMissionId(),
             .name = mission.name,
             .vertical_datum = mission.vertical_datum,
             .created = now,
             .root_south_west = root.south_west(),
             .root_north_west = root.north_west(),
             .min_cell_m = mission.min_cell_m,
             .max_cells = mission.max_cells,
             .tolerance_m = mission.tolerance_m,
             .ageing_rate_m2_s = mission.ageing_rate_m2_s,
             .max_contacts = mission.max_contacts,
             .contact_filter = std::string(
                 map::FilterName(map::ContactMapOptions{}.filter))});
}

absl::StatusOr<MapKeeper::Restored> RestoreMission(storage::MissionFile& file,
                                                   uint64_t tile_budget_bytes) {
  FATHOM_ASSIGN_OR_RETURN(storage::Loaded loaded, file.Load(tile_budget_bytes));
  FATHOM_ASSIGN_OR_RETURN(map::MissionOptions options,
                          storage::OptionsOf(loaded.metadata));
  options.global.memory = {.budget_bytes = tile_budget_bytes,
                           .codec = storage::kTileCodec};
  MapKeeper::Restored restored;
  for (const storage::SourcePosition& position : loaded.source_positions) {
    restored.ledger.Restore(position.stream, position.source,
                            {position.epoch, position.sequence});
  }
  restored.journal_records = loaded.journal.size();
  restored.damage = std::move(loaded.damage);
  FATHOM_ASSIGN_OR_RETURN(storage::RestoredMap map,
                          storage::RestoreMap(std::move(loaded), options));
  restored.map = std::move(map.map);
  restored.checkpoint = std::move(map.checkpoint);
  return restored;
}

}  // namespace fathom::server
