// Fuzz target: blobs of tiles and of local blocks, as far as a start takes
// them. The first byte chooses the kind, the rest is the payload.

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "map/geodesy/points.h"
#include "map/local/local_map.h"
#include "storage/tile_codec.h"
#include "tests/fuzz/fuzz.h"

namespace fathom::fuzz {
namespace {

using storage::ByteSpan;

// The key that the payload claims, as the loader takes it from the row.
std::uint64_t KeyIn(ByteSpan payload) {
  std::uint64_t key = 0;
  for (std::size_t i = 0; i < 8 && i < payload.size(); ++i) {
    key |= std::uint64_t{payload[i]} << (8 * i);
  }
  return key;
}

void FuzzTile(ByteSpan payload) {
  const auto key = map::TileKey::FromPacked(KeyIn(payload));
  const auto content =
      storage::DecodeTile(key, Sealed(storage::BlobKind::kTile, 2, payload));
  if (!content.ok()) return;
  constexpr int kMaxLevel = 18;
  const auto tile = map::RestoredTile::Make(key, *content, kMaxLevel, 0.5f);
  if (!tile.ok()) return;
  // What makes a sound tile is stored again as it was.
  const auto again =
      storage::DecodeTile(key, storage::EncodeTile(key, *content));
  FATHOM_FUZZ_CHECK(again.ok());
  FATHOM_FUZZ_CHECK(*again == *content);
}

void FuzzBlock(ByteSpan payload) {
  const auto key =
      storage::BlockKey::FromPacked(KeyIn(payload) & 0x7fff'ffff'ffff'ffffull);
  const auto block = storage::DecodeBlock(
      key, Sealed(storage::BlobKind::kLocalBlock, 3, payload));
  if (!block.ok()) return;
  const storage::Bytes stored = storage::EncodeBlock(key, *block);
  const auto again = storage::DecodeBlock(key, stored);
  FATHOM_FUZZ_CHECK(again.ok());
  FATHOM_FUZZ_CHECK(storage::EncodeBlock(key, *again) == stored);
  map::LocalMapOptions options;
  options.south_west = {.latitude_deg = 41.5, .longitude_deg = -70.65};
  options.north_extent_m = 320;
  options.east_extent_m = 320;
  options.cell_size_m = 10;
  options.smoothing_distance_m = 20;
  options.smoothing_scale = 0.5;
  options.estimator = !block->nervegna.empty()  ? map::EstimatorKind::kNervegna
                      : payload.size() % 4 == 0 ? map::EstimatorKind::kKalman
                                                : map::EstimatorKind::kAdaptive;
  auto local = map::LocalMap::Create(options);
  FATHOM_FUZZ_CHECK(local.ok());
  if (!local->RestoreBlock({.row = 0, .col = 0}, *block).ok()) return;
  const map::LocalMapView view = local->View();
  for (std::uint32_t row = 0; row < 18; ++row) {
    for (std::uint32_t col = 0; col < 18; ++col) {
      const map::CellIndex cell = {static_cast<std::int32_t>(row),
                                   static_cast<std::int32_t>(col)};
      (void)view.EvidenceAt(view.CellCenter(cell));
      const auto read = view.AtCell(cell);
      FATHOM_FUZZ_CHECK(!read.has_value() ||
                        read->kind != map::EvidenceKind::kMeasured ||
                        (std::isfinite(read->depth_m) && read->std_m > 0.0f));
    }
  }
}

}  // namespace
}  // namespace fathom::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes,
                                      std::size_t size) {
  if (size == 0) return 0;
  const fathom::storage::ByteSpan payload(bytes + 1, size - 1);
  if (bytes[0] % 2 == 0) {
    fathom::fuzz::FuzzTile(payload);
  } else {
    fathom::fuzz::FuzzBlock(payload);
  }
  return 0;
}
