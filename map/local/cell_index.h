// The cells of a local map's grid.

#ifndef FATHOM_MAP_LOCAL_CELL_INDEX_H_
#define FATHOM_MAP_LOCAL_CELL_INDEX_H_

#include <cstdint>

namespace fathom::map {

// A cell of the grid: i cells north, j cells east of the south-west corner.
// Negative or too large outside the grid.
struct CellIndex {
  std::int32_t i = 0;
  std::int32_t j = 0;

  friend bool operator==(const CellIndex&, const CellIndex&) = default;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_CELL_INDEX_H_
