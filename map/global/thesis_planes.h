// The thesis's own descent of the global quadtree by planes, kept under its
// name as the oracle of the two-angle cells (root_square.h) and for comparison.
// The map itself does not use it.
//
// Nervegna 2002, figs. 4-15 (SEARCH-GLOBAL-MAP, lines 18-30) and 4-17 (DIVIDE,
// lines 3-4 and the children's normals). Errata: the comments of fig. 4-15,
// lines 27 and 29, name the two southern quadrants the wrong way round; the
// tests themselves are right.
//
// Pure; thread-safe.

#ifndef FATHOM_MAP_GLOBAL_THESIS_PLANES_H_
#define FATHOM_MAP_GLOBAL_THESIS_PLANES_H_

#include <array>
#include <cstdint>
#include <optional>

#include "map/global/cell_key.h"
#include "map/global/root_square.h"
#include "map/global/unit_vector.h"

namespace fathom::map {

// A global cell as the thesis stores it: the inward unit normals of its four
// side planes (section 4.4.2); and its key, to compare.
struct ThesisCell {
  Vector3 north;
  Vector3 east;
  Vector3 south;
  Vector3 west;
  CellKey key;
};

inline ThesisCell ThesisRoot(const RootSquare& root) {
  return {.north = root.north_normal(),
          .east = root.east_normal(),
          .south = root.south_normal(),
          .west = root.west_normal(),
          .key = {}};
}

// Fig. 4-17: children NW, NE, SW, SE by the planes halfway between opposite
// sides.
inline std::array<ThesisCell, 4> ThesisDivide(const ThesisCell& cell) {
  const Vector3 mid_north_south = Unit(-cell.north + cell.south);
  const Vector3 mid_east_west = Unit(-cell.east + cell.west);
  const auto child = [&cell](std::uint32_t south_half,
                             std::uint32_t east_half) {
    return CellKey{.level = static_cast<std::uint8_t>(cell.key.level + 1),
                   .row = 2 * cell.key.row + south_half,
                   .col = 2 * cell.key.col + east_half};
  };
  return {ThesisCell{.north = cell.north,
                     .east = -mid_east_west,
                     .south = mid_north_south,
                     .west = cell.west,
                     .key = child(0, 0)},
          ThesisCell{.north = cell.north,
                     .east = cell.east,
                     .south = mid_north_south,
                     .west = mid_east_west,
                     .key = child(0, 1)},
          ThesisCell{.north = -mid_north_south,
                     .east = -mid_east_west,
                     .south = cell.south,
                     .west = cell.west,
                     .key = child(1, 0)},
          ThesisCell{.north = -mid_north_south,
                     .east = cell.east,
                     .south = cell.south,
                     .west = mid_east_west,
                     .key = child(1, 1)}};
}

// Fig. 4-15, lines 18-30, from the root down to `level`; nullopt if the point
// is outside the root.
inline std::optional<CellKey> ThesisSearch(const RootSquare& root,
                                           const GeodeticPoint& point,
                                           int level) {
  const Vector3 loc = FromGeodetic(point);
  ThesisCell cell = ThesisRoot(root);
  if (Dot(cell.north, loc) < 0 || Dot(cell.east, loc) < 0 ||
      Dot(cell.south, loc) < 0 || Dot(cell.west, loc) < 0) {
    return std::nullopt;
  }
  while (cell.key.level < level) {
    const std::array<ThesisCell, 4> children = ThesisDivide(cell);
    const ThesisCell& nw = children[0];
    const ThesisCell& ne = children[1];
    const ThesisCell& sw = children[2];
    const ThesisCell& se = children[3];
    if (Dot(nw.south, loc) >= 0 && Dot(nw.east, loc) >= 0) {
      cell = nw;
    } else if (Dot(ne.south, loc) >= 0 && Dot(ne.west, loc) >= 0) {
      cell = ne;
    } else if (Dot(se.north, loc) >= 0 && Dot(se.west, loc) >= 0) {
      cell = se;
    } else {
      cell = sw;
    }
  }
  return cell.key;
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_THESIS_PLANES_H_
