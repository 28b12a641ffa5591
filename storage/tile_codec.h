// Tiles of the global map and blocks of the local maps as blobs. Lossless:
// what is decoded is what was encoded, bit for bit. Each blob carries the key
// of its row, so that a row that lost its place is found out like a flipped
// bit. Layouts in docs/storage_format.md. Thread-safe.

#ifndef FATHOM_STORAGE_TILE_CODEC_H_
#define FATHOM_STORAGE_TILE_CODEC_H_

#include <cstdint>

#include "absl/status/statusor.h"
#include "map/global/tile.h"
#include "map/global/tile_memory.h"
#include "map/local/local_block.h"
#include "storage/bytes.h"

namespace fathom::storage {

// Key of a local block's row: which activity (its number in the file, from 1),
// which block.
struct BlockKey {
  std::uint32_t activity_number = 0;
  map::BlockIndex index;

  // activity_number in bits 32-62, row in 16-31, column in 0-15: blocks of an
  // activity are one range. REQUIRES: row, col < 65536 (kMaxLocalSideCells
  // allows 4096).
  std::uint64_t Packed() const {
    return std::uint64_t{activity_number} << 32 |
           std::uint64_t{index.row} << 16 | index.col;
  }
  static BlockKey FromPacked(std::uint64_t packed) {
    return {.activity_number = static_cast<std::uint32_t>(packed >> 32),
            .index = {.row = static_cast<std::uint32_t>(packed >> 16) & 0xffff,
                      .col = static_cast<std::uint32_t>(packed) & 0xffff}};
  }
};

// REQUIRES: the arrays of `content` are equally long (residual_codes and
// spread_codes may be empty; the two of hazards are as long as each other).
Bytes EncodeTile(const map::TileKey& key, const map::TileContent& content);
// Whether the content makes a sound tile is map::ValidateContent's question.
// Errors: DATA_LOSS naming the tile; UNIMPLEMENTED for a newer version.
absl::StatusOr<map::TileContent> DecodeTile(const map::TileKey& key,
                                            ByteSpan blob);

// The same two for a map that keeps tiles packed in memory: as they are stored.
inline constexpr map::TileCodec kTileCodec = {.pack = EncodeTile,
                                              .unpack = DecodeTile};

// REQUIRES: `nervegna` holds 0 or 256 elements.
Bytes EncodeBlock(const BlockKey& key, const map::LocalBlock& block);
// Errors: DATA_LOSS naming the block; UNIMPLEMENTED for a newer version.
absl::StatusOr<map::LocalBlock> DecodeBlock(const BlockKey& key, ByteSpan blob);

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_TILE_CODEC_H_
