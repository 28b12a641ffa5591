// Names of cells and tiles of the global map, and their order.
//
// A cell of level L is one of 2^L x 2^L pieces of the root square; level 0 is
// the root itself. Row 0 is the northernmost, column 0 the westernmost. The
// four children of a cell come in the thesis's order NW, NE, SW, SE (Nervegna
// 2002, figs. 4-15 and 4-17), which is Z-order (Morton order) with the row's
// bit above the column's.
//
// A tile is a piece of the quadtree of six levels, down to 64 x 64 cells six
// levels below its root. Tiles hang so that the deepest ones end at the map's
// max_level: there nearly all leaves are, and a full tile is the cheapest. The
// root tile spans what is left over, 1 to 6 levels (TileLadder). A position
// inside a tile is the 12-bit Z-order number of one of its 64 x 64 places; the
// root tile too is numbered so, though its leaves may end above the finest.
//
// Plain values and pure functions; thread-safe.

#ifndef FATHOM_MAP_GLOBAL_CELL_KEY_H_
#define FATHOM_MAP_GLOBAL_CELL_KEY_H_

#include <compare>
#include <cstdint>

namespace fathom::map {

// The deepest level that a key can name. 2^24 cells along a side are 0.14 m
// each in a root of 1267 nmi: finer than any survey.
inline constexpr int kMaxLevel = 24;

// Levels that one tile spans: its leaves are 0..6 levels below its root.
inline constexpr int kTileLevels = 6;

// Cells along the side of a tile at its finest, and in all.
inline constexpr std::uint32_t kTileSide = 1u << kTileLevels;
inline constexpr std::uint32_t kTileCells = kTileSide * kTileSide;

// A cell of the quadtree. REQUIRES: level <= kMaxLevel; row, col < 2^level.
struct CellKey {
  std::uint8_t level = 0;
  std::uint32_t row = 0;  // From the north.
  std::uint32_t col = 0;  // From the west.

  friend auto operator<=>(const CellKey&, const CellKey&) = default;
};

// A tile, named by its root cell.
struct TileKey {
  std::uint8_t level = 0;
  std::uint32_t row = 0;
  std::uint32_t col = 0;

  // One number, unique and ordered by level first (parents before children):
  // level in bits 48-55, row in bits 24-47, column in bits 0-23.
  constexpr std::uint64_t Packed() const {
    return (std::uint64_t{level} << 48) | (std::uint64_t{row} << 24) | col;
  }
  // The reverse. Any number gives a key; TileLadder::Has says whether a map
  // has it.
  static constexpr TileKey FromPacked(std::uint64_t packed) {
    return {.level = static_cast<std::uint8_t>(packed >> 48),
            .row = static_cast<std::uint32_t>((packed >> 24) & 0xffffff),
            .col = static_cast<std::uint32_t>(packed & 0xffffff)};
  }
  constexpr CellKey Root() const { return {level, row, col}; }

  friend auto operator<=>(const TileKey&, const TileKey&) = default;
};

// Spreads the low 12 bits of `x` to the even bits.
constexpr std::uint32_t SpreadBits(std::uint32_t x) {
  x &= 0xfff;
  x = (x | (x << 8)) & 0x00ff00ff;
  x = (x | (x << 4)) & 0x0f0f0f0f;
  x = (x | (x << 2)) & 0x33333333;
  x = (x | (x << 1)) & 0x55555555;
  return x;
}

// The reverse: gathers the even bits of `x`.
constexpr std::uint32_t GatherBits(std::uint32_t x) {
  x &= 0x55555555;
  x = (x | (x >> 1)) & 0x33333333;
  x = (x | (x >> 2)) & 0x0f0f0f0f;
  x = (x | (x >> 4)) & 0x00ff00ff;
  x = (x | (x >> 8)) & 0x0000ffff;
  return x;
}

// Z-order number of a row and a column, each below 4096.
constexpr std::uint32_t ZOrder(std::uint32_t row, std::uint32_t col) {
  return (SpreadBits(row) << 1) | SpreadBits(col);
}
constexpr std::uint32_t ZOrderRow(std::uint32_t z) {
  return GatherBits(z >> 1);
}
constexpr std::uint32_t ZOrderCol(std::uint32_t z) { return GatherBits(z); }

// Positions that a cell `relative_level` below a tile's root covers: 4096 for
// the root itself, 1 for the finest. REQUIRES: 0 <= relative_level <= 6.
constexpr std::uint32_t SpanOf(int relative_level) {
  return 1u << (2 * (kTileLevels - relative_level));
}

// Where the tiles of a map hang: at level 0, and at max_level - 6, - 12, ... as
// far as these are above 0. A map of max_level 13 has them at 0, 1 and 7; one
// of 18 at 0, 6 and 12; one of 5 has the root tile alone. Never more than four.
struct TileLadder {
  constexpr explicit TileLadder(int its_max_level)
      : max_level(its_max_level),
        top_levels(its_max_level <= kTileLevels
                       ? its_max_level
                       : (its_max_level - 1) % kTileLevels + 1) {}

  // Levels that the tile at `tile_level` spans: where its child tiles hang.
  constexpr int LevelsOf(int tile_level) const {
    return tile_level == 0 ? top_levels : kTileLevels;
  }
  // Level of the root of the tile that holds cells of `level`: a cell of a
  // tile root's level is a slot of the parent tile.
  constexpr int TileLevelFor(int level) const {
    return level <= top_levels ? 0
                               : top_levels + (level - top_levels - 1) /
                                                  kTileLevels * kTileLevels;
  }
  // Whether a map may have this tile.
  constexpr bool Has(const TileKey& key) const {
    return (key.level == 0 || (key.level < max_level &&
                               (max_level - key.level) % kTileLevels == 0)) &&
           key.row < (1u << key.level) && key.col < (1u << key.level);
  }

  int max_level;
  // 1 to 6; 0 if max_level is 0.
  int top_levels;
};

// The cell that covers `position` of `tile`, `relative_level` below its root.
constexpr CellKey CellInTile(const TileKey& tile, std::uint32_t position,
                             int relative_level) {
  const int up = kTileLevels - relative_level;
  return {.level = static_cast<std::uint8_t>(tile.level + relative_level),
          .row = (tile.row << relative_level) | (ZOrderRow(position) >> up),
          .col = (tile.col << relative_level) | (ZOrderCol(position) >> up)};
}

// The position in the tile `tile_level` on the way to `cell` at which the cell
// begins, or at which the cell of level `tile_level + 6` that holds it lies.
// (In the root tile a slot above that level may hold both.)
constexpr std::uint32_t PositionInTile(const CellKey& cell, int tile_level) {
  const int finest = tile_level + kTileLevels;
  const std::uint32_t row = cell.level >= finest
                                ? cell.row >> (cell.level - finest)
                                : cell.row << (finest - cell.level);
  const std::uint32_t col = cell.level >= finest
                                ? cell.col >> (cell.level - finest)
                                : cell.col << (finest - cell.level);
  return ZOrder(row & (kTileSide - 1), col & (kTileSide - 1));
}

// The tile of level `tile_level` that holds `cell`.
// REQUIRES: tile_level <= cell.level.
constexpr TileKey TileHolding(const CellKey& cell, int tile_level) {
  const int up = cell.level - tile_level;
  return {.level = static_cast<std::uint8_t>(tile_level),
          .row = cell.row >> up,
          .col = cell.col >> up};
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_CELL_KEY_H_
