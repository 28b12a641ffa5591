// Tiles that cannot be read: left out, so that the rest serves.
//
// A place whose tile is in quarantine is unknown, never free: in the damaged
// tile's place stands one unknown leaf, and the tiles below it go with it. The
// file is not changed by that; a later checkpoint writes the tile anew when
// fresh evidence reaches it.

#ifndef FATHOM_STORAGE_QUARANTINE_H_
#define FATHOM_STORAGE_QUARANTINE_H_

#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "map/global/tile.h"
#include "map/obstacle_map/obstacle_map.h"

namespace fathom::storage {

// "tile level=7 row=3 col=4".
std::string TileName(const map::TileKey& key);

// Makes `tiles` (sound ones, coarse before fine) a whole tree again: puts an
// unknown tile where a tile names a child that is not there, and removes tiles
// that hang on none. Adds to `damage` what it put and removed that is not
// explained by `damaged` (keys whose tile was found and is bad). Without a
// tile of level 0 all others go; without any tile nothing is done.
// Errors: those of RestoredTile::Make.
absl::Status MendTree(const map::GlobalMapOptions& options,
                      const std::set<map::TileKey>& damaged,
                      std::vector<map::RestoredTile>& tiles,
                      std::vector<std::string>& damage);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_QUARANTINE_H_
