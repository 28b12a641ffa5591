#include "storage/tile_codec.h"

#include <array>
#include <cstring>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "storage/blob.h"
#include "storage/column.h"

namespace fathom::storage {
namespace {

constexpr std::uint8_t kTileVersion = 2;
constexpr std::uint8_t kBlockVersion = 3;

enum TileFlag : std::uint8_t {
  kHasResiduals = 1,
  kHasSpreads = 2,
  kHasHazards = 4,
  kAllTileFlags = 7,
};

enum BlockFlag : std::uint8_t {
  kHasTransferred = 1,
  kHasPriorGrid = 2,
  kHasNervegna = 4,
  kHasPending = 8,
  kHasPriorHazards = 16,
  kAllBlockFlags = 31,
};

// One bit per cell, cell k in bit k % 8 of byte k / 8.
using CellMask = std::array<std::uint8_t, map::kBlockCells / 8>;

bool IsSet(const CellMask& mask, std::size_t k) {
  return ((mask[k / 8] >> (k % 8)) & 1) != 0;
}

// The touched cells in order, as they are kept: all fresh, then all transferred
// evidence if there is any.
void PutEvidence(const map::EvidenceCells& cells, ByteWriter& writer) {
  CellMask mask = {};
  std::vector<map::PackedEvidence> packed;
  packed.reserve(2 * cells.size());
  for (std::size_t k = 0; k < map::kBlockCells; ++k) {
    if (!cells.touched(k)) continue;
    mask[k / 8] |= static_cast<std::uint8_t>(1u << (k % 8));
    packed.push_back(*cells.Find(k));
  }
  for (std::size_t k = 0; cells.any_transferred() && k < map::kBlockCells;
       ++k) {
    if (cells.touched(k)) packed.push_back(*cells.FindTransferred(k));
  }
  writer.PutU32(cells.window_s());
  writer.PutBytes(mask);
  PutColumnBytes(packed.data(), packed.size(), sizeof(map::PackedEvidence),
                 writer);
}

void GetEvidence(ByteReader& reader, bool any_transferred,
                 map::EvidenceCells& cells) {
  cells.set_window_s(reader.GetU32());
  CellMask mask = {};
  const ByteSpan stored = reader.GetBytes(mask.size());
  std::copy(stored.begin(), stored.end(), mask.begin());
  std::size_t count = 0;
  for (std::size_t k = 0; k < map::kBlockCells; ++k) count += IsSet(mask, k);
  std::vector<map::PackedEvidence> packed(any_transferred ? 2 * count : count);
  GetColumnBytes(reader, packed.size(), sizeof(map::PackedEvidence),
                 packed.data());
  if (!reader.ok()) return;
  std::size_t n = 0;
  for (std::size_t k = 0; k < map::kBlockCells; ++k) {
    if (!IsSet(mask, k)) continue;
    cells.Restore(k, packed[n], any_transferred ? &packed[count + n] : nullptr);
    ++n;
  }
}

// The numbers are those of map::EvidenceKind; it knows five.
void CheckKind(map::EvidenceKind kind, ByteReader& reader) {
  if (static_cast<std::uint8_t>(kind) > 4) reader.Fail();
}

}  // namespace

Bytes EncodeTile(const map::TileKey& key, const map::TileContent& content) {
  ByteWriter writer = StartBlob();
  writer.PutU64(key.Packed());
  writer.PutVarint(content.levels.size());
  std::uint8_t flags = 0;
  if (!content.residual_codes.empty()) flags |= kHasResiduals;
  if (!content.spread_codes.empty()) flags |= kHasSpreads;
  if (!content.hazard_slots.empty()) flags |= kHasHazards;
  writer.PutU8(flags);
  PutColumn(content.levels, writer);
  PutColumn(content.depths_m, writer);
  PutColumn(content.std_codes, writer);
  PutColumn(content.times_s, writer);
  PutColumn(content.residual_codes, writer);
  PutColumn(content.spread_codes, writer);
  if (!content.hazard_slots.empty()) {
    writer.PutVarint(content.hazard_slots.size());
    PutColumn(content.hazard_slots, writer);
    PutColumn(content.hazards_m, writer);
  }
  return SealBlob(BlobKind::kTile, kTileVersion, std::move(writer));
}

absl::StatusOr<map::TileContent> DecodeTile(const map::TileKey& key,
                                            ByteSpan blob) {
  const std::string what = absl::StrFormat("tile level=%d row=%d col=%d",
                                           key.level, key.row, key.col);
  FATHOM_ASSIGN_OR_RETURN(const ByteSpan payload,
                          OpenBlob(BlobKind::kTile, kTileVersion, blob, what));
  ByteReader reader(payload);
  if (reader.GetU64() != key.Packed()) {
    return absl::DataLossError(what + ": holds the bytes of another tile");
  }
  const std::size_t count = reader.GetCount(map::kTileCells);
  const std::uint8_t flags = reader.GetU8();
  if (flags > kAllTileFlags) reader.Fail();
  map::TileContent content;
  content.levels = GetColumn<std::uint8_t>(reader, count);
  content.depths_m = GetColumn<float>(reader, count);
  content.std_codes = GetColumn<std::uint16_t>(reader, count);
  content.times_s = GetColumn<std::uint32_t>(reader, count);
  if ((flags & kHasResiduals) != 0) {
    content.residual_codes = GetColumn<std::uint8_t>(reader, count);
  }
  if ((flags & kHasSpreads) != 0) {
    content.spread_codes = GetColumn<std::uint8_t>(reader, count);
  }
  if ((flags & kHasHazards) != 0) {
    const std::size_t hazards = reader.GetCount(count);
    content.hazard_slots = GetColumn<std::uint16_t>(reader, hazards);
    content.hazards_m = GetColumn<float>(reader, hazards);
  }
  FATHOM_RETURN_IF_ERROR(reader.Finish(what));
  return content;
}

Bytes EncodeBlock(const BlockKey& key, const map::LocalBlock& block) {
  ByteWriter writer = StartBlob();
  writer.PutU64(key.Packed());
  std::uint8_t flags = 0;
  if (block.evidence.any_transferred()) flags |= kHasTransferred;
  if (block.prior_grid != nullptr) flags |= kHasPriorGrid;
  if (!block.nervegna.empty()) flags |= kHasNervegna;
  if (!block.pending.empty()) flags |= kHasPending;
  if (block.prior_grid != nullptr && !block.prior_grid->hazard_m.empty()) {
    flags |= kHasPriorHazards;
  }
  writer.PutU8(flags);
  writer.PutF32(block.uniform_prior.depth_m);
  writer.PutF32(block.uniform_prior.std_m);
  writer.PutF32(block.uniform_prior.hazard_m);
  writer.PutU8(static_cast<std::uint8_t>(block.uniform_prior.kind));
  PutEvidence(block.evidence, writer);
  if (block.prior_grid != nullptr) {
    PutColumn(std::span<const float>(block.prior_grid->depth_m), writer);
    PutColumn(std::span<const float>(block.prior_grid->std_m), writer);
    static_assert(sizeof(map::EvidenceKind) == 1);
    PutColumnBytes(block.prior_grid->kind.data(), map::kBlockCells, 1, writer);
    PutColumn(std::span<const float>(block.prior_grid->hazard_m), writer);
  }
  static_assert(sizeof(map::NervegnaCell) == 8);
  PutColumnBytes(block.nervegna.data(), block.nervegna.size(), 8, writer);
  static_assert(sizeof(map::PendingShoal) == 16);
  if (!block.pending.empty()) {
    writer.PutVarint(block.pending.size());
    PutColumnBytes(block.pending.data(), block.pending.size(), 16, writer);
  }
  return SealBlob(BlobKind::kLocalBlock, kBlockVersion, std::move(writer));
}

absl::StatusOr<map::LocalBlock> DecodeBlock(const BlockKey& key,
                                            ByteSpan blob) {
  const std::string what =
      absl::StrFormat("local block activity_number=%d row=%d col=%d",
                      key.activity_number, key.index.row, key.index.col);
  FATHOM_ASSIGN_OR_RETURN(
      const ByteSpan payload,
      OpenBlob(BlobKind::kLocalBlock, kBlockVersion, blob, what));
  ByteReader reader(payload);
  if (reader.GetU64() != key.Packed()) {
    return absl::DataLossError(what + ": holds the bytes of another block");
  }
  const std::uint8_t flags = reader.GetU8();
  if (flags > kAllBlockFlags) reader.Fail();
  map::LocalBlock block;
  block.uniform_prior.depth_m = reader.GetF32();
  block.uniform_prior.std_m = reader.GetF32();
  block.uniform_prior.hazard_m = reader.GetF32();
  block.uniform_prior.kind = static_cast<map::EvidenceKind>(reader.GetU8());
  CheckKind(block.uniform_prior.kind, reader);
  GetEvidence(reader, (flags & kHasTransferred) != 0, block.evidence);
  if ((flags & kHasPriorGrid) != 0) {
    auto grid = std::make_shared<map::PriorGrid>();
    GetColumnBytes(reader, map::kBlockCells, 4, grid->depth_m.data());
    GetColumnBytes(reader, map::kBlockCells, 4, grid->std_m.data());
    GetColumnBytes(reader, map::kBlockCells, 1, grid->kind.data());
    for (const map::EvidenceKind kind : grid->kind) CheckKind(kind, reader);
    if ((flags & kHasPriorHazards) != 0) {
      grid->hazard_m.resize(map::kBlockCells);
      GetColumnBytes(reader, map::kBlockCells, 4, grid->hazard_m.data());
    }
    block.prior_grid = std::move(grid);
  }
  if ((flags & kHasNervegna) != 0) {
    block.nervegna.resize(map::kBlockCells);
    GetColumnBytes(reader, map::kBlockCells, 8, block.nervegna.data());
  }
  if ((flags & kHasPending) != 0) {
    block.pending.resize(reader.GetCount(map::kBlockCells));
    GetColumnBytes(reader, block.pending.size(), 16, block.pending.data());
  }
  FATHOM_RETURN_IF_ERROR(reader.Finish(what));
  return block;
}

}  // namespace fathom::storage
