#include "storage/quarantine.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "map/global/cell_key.h"

namespace fathom::storage {
namespace {

// One unknown leaf.
map::TileContent Unknown() {
  return {.levels = {0},
          .depths_m = {0},
          .std_codes = {0},
          .times_s = {0},
          .residual_codes = {},
          .spread_codes = {},
          .hazard_slots = {},
          .hazards_m = {}};
}

// The keys of the child tiles that `tile` names.
std::vector<map::TileKey> ChildrenOf(const map::RestoredTile& tile) {
  std::vector<map::TileKey> children;
  std::uint32_t position = 0;
  for (std::size_t slot = 0; slot < tile.content.levels.size(); ++slot) {
    const int level = tile.content.levels[slot];
    if (tile.content.std_codes[slot] == map::kChildCode) {
      const map::CellKey cell = map::CellInTile(tile.key, position, level);
      children.push_back(
          {.level = cell.level, .row = cell.row, .col = cell.col});
    }
    position += map::SpanOf(level);
  }
  return children;
}

}  // namespace

std::string TileName(const map::TileKey& key) {
  return absl::StrFormat("tile level=%d row=%d col=%d", key.level, key.row,
                         key.col);
}

absl::Status MendTree(const map::GlobalMapOptions& options,
                      const std::set<map::TileKey>& damaged,
                      std::vector<map::RestoredTile>& tiles,
                      std::vector<std::string>& damage) {
  if (tiles.empty() && damaged.empty()) return absl::OkStatus();
  // Parents come before their children: one pass.
  std::set<map::TileKey> wanted = {{.level = 0, .row = 0, .col = 0}};
  std::vector<map::RestoredTile> kept;
  std::size_t orphans = 0;
  for (map::RestoredTile& tile : tiles) {
    if (wanted.erase(tile.key) == 0) {
      ++orphans;
      continue;
    }
    for (const map::TileKey& child : ChildrenOf(tile)) wanted.insert(child);
    kept.push_back(std::move(tile));
  }
  for (const map::TileKey& key : wanted) {
    FATHOM_ASSIGN_OR_RETURN(
        map::RestoredTile unknown,
        map::RestoredTile::Make(key, Unknown(), options.root.max_level(),
                                static_cast<float>(options.tolerance_m)));
    kept.push_back(std::move(unknown));
    if (!damaged.contains(key))
      damage.push_back(TileName(key) + ": is missing");
  }
  if (orphans > 0) {
    damage.push_back(absl::StrFormat(
        "%d sound tiles hang on none that can be read and were left out",
        orphans));
  }
  std::sort(kept.begin(), kept.end(),
            [](const map::RestoredTile& a, const map::RestoredTile& b) {
              return a.key < b.key;
            });
  tiles = std::move(kept);
  return absl::OkStatus();
}

}  // namespace fathom::storage
