#include "storage/restore.h"

#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"

namespace fathom::storage {
namespace {

// A piece that the map refuses to take back: the file's fault, not the
// caller's.
absl::Status Misfit(const absl::Status& status, const std::string& piece) {
  if (status.ok()) return status;
  return absl::DataLossError(
      absl::StrFormat("%s does not fit: %s", piece, status.message()));
}

absl::Status RestoreCheckpoint(Loaded& loaded, map::ObstacleMap& map) {
  for (map::RestoredTile& tile : loaded.tiles) {
    FATHOM_RETURN_IF_ERROR(Misfit(map.RestoreTile(std::move(tile)), "a tile"));
  }
  for (LoadedActivity& activity : loaded.activities) {
    const map::ActivityId& id = activity.activity.start.id;
    FATHOM_RETURN_IF_ERROR(Misfit(map.RestoreActivity(activity.activity),
                                  "activity_id=" + id.value));
    for (auto& [index, block] : activity.blocks) {
      FATHOM_RETURN_IF_ERROR(
          Misfit(map.RestoreBlock(id, index, std::move(block)),
                 absl::StrFormat("block row=%d col=%d of activity_id=%s",
                                 index.row, index.col, id.value)));
    }
  }
  for (map::StoredContact& contact : loaded.contacts) {
    const std::string name = "contact_id=" + contact.key.contact.value;
    FATHOM_RETURN_IF_ERROR(
        Misfit(map.RestoreContact(std::move(contact)), name));
  }
  map.RestoreCounters(loaded.counters);
  return Misfit(
      map.RestoreRevision(loaded.checkpoint_revision, loaded.checkpoint_as_of),
      "the checkpoint");
}

// False if the map refused the event.
struct Replayer {
  map::ObstacleMap& map;

  bool operator()(const PingRecord& record) const {
    return map.ApplyPing(record.ping).ok();
  }
  bool operator()(const ContactRecord& record) const {
    return map.ApplyContact(record.report).applied;
  }
  bool operator()(const map::StartActivity& start) const {
    return map.Start(start).ok();
  }
  bool operator()(const map::DropContact& drop) const {
    return map.Drop(drop).ok();
  }
};

}  // namespace

absl::StatusOr<map::MissionOptions> OptionsOf(const MissionMetadata& metadata) {
  map::MissionOptions options;
  FATHOM_ASSIGN_OR_RETURN(
      options.global.root,
      map::RootSquare::Create(metadata.root_south_west,
                              metadata.root_north_west, metadata.min_cell_m));
  options.global.max_cells = metadata.max_cells;
  options.global.tolerance_m = metadata.tolerance_m;
  FATHOM_RETURN_IF_ERROR(options.global.Validate());
  options.contacts.max_contacts = metadata.max_contacts;
  FATHOM_ASSIGN_OR_RETURN(options.contacts.filter,
                          map::ParseFilter(metadata.contact_filter));
  options.ageing_rate_m2_s = metadata.ageing_rate_m2_s;
  return options;
}

absl::StatusOr<RestoredMap> RestoreMap(Loaded loaded,
                                       const map::MissionOptions& options) {
  RestoredMap restored;
  restored.map = std::make_unique<map::ObstacleMap>(options);
  FATHOM_RETURN_IF_ERROR(RestoreCheckpoint(loaded, *restored.map));
  restored.checkpoint = restored.map->View();
  for (const JournalRecord& record : loaded.journal) {
    // Events that the map refused took a revision and left no record.
    restored.map->AdvanceRevision(record.revision - 1);
    if (!std::visit(Replayer{*restored.map}, record.event)) {
      ++restored.refused_records;
    }
  }
  restored.map->AdvanceRevision(loaded.revision);
  return restored;
}

}  // namespace fathom::storage
