// A TileCodec for tests below the storage layer: the arrays one after the
// other. It counts its calls, so that a test can tell what was opened.

#ifndef FATHOM_TESTS_MAP_GLOBAL_PLAIN_CODEC_H_
#define FATHOM_TESTS_MAP_GLOBAL_PLAIN_CODEC_H_

#include <atomic>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "map/global/tile_memory.h"

namespace fathom::map {

class PlainCodec {
 public:
  static constexpr TileCodec Codec() {
    return {.pack = &Pack, .unpack = &Unpack};
  }
  static std::uint64_t packs() { return packs_; }
  static std::uint64_t unpacks() { return unpacks_; }

 private:
  template <typename T>
  static void Put(const std::vector<T>& column, PackedTile& bytes) {
    const std::uint64_t count = column.size();
    const std::size_t at = bytes.size();
    bytes.resize(at + sizeof count + count * sizeof(T));
    std::memcpy(&bytes[at], &count, sizeof count);
    if (count > 0) {
      std::memcpy(&bytes[at + sizeof count], column.data(), count * sizeof(T));
    }
  }
  template <typename T>
  static void Get(std::span<const std::uint8_t>& bytes,
                  std::vector<T>& column) {
    std::uint64_t count = 0;
    std::memcpy(&count, bytes.data(), sizeof count);
    bytes = bytes.subspan(sizeof count);
    column.resize(count);
    if (count > 0) std::memcpy(column.data(), bytes.data(), count * sizeof(T));
    bytes = bytes.subspan(count * sizeof(T));
  }

  static PackedTile Pack(const TileKey& key, const TileContent& content) {
    ++packs_;
    PackedTile bytes;
    Put(std::vector<std::uint64_t>{key.Packed()}, bytes);
    Put(content.levels, bytes);
    Put(content.depths_m, bytes);
    Put(content.std_codes, bytes);
    Put(content.times_s, bytes);
    Put(content.residual_codes, bytes);
    Put(content.spread_codes, bytes);
    Put(content.hazard_slots, bytes);
    Put(content.hazards_m, bytes);
    return bytes;
  }
  static absl::StatusOr<TileContent> Unpack(
      const TileKey& key, std::span<const std::uint8_t> bytes) {
    ++unpacks_;
    std::vector<std::uint64_t> of;
    Get(bytes, of);
    if (of != std::vector<std::uint64_t>{key.Packed()}) {
      return absl::DataLossError("the bytes of another tile");
    }
    TileContent content;
    Get(bytes, content.levels);
    Get(bytes, content.depths_m);
    Get(bytes, content.std_codes);
    Get(bytes, content.times_s);
    Get(bytes, content.residual_codes);
    Get(bytes, content.spread_codes);
    Get(bytes, content.hazard_slots);
    Get(bytes, content.hazards_m);
    return content;
  }

  static inline std::atomic<std::uint64_t> packs_{0};
  static inline std::atomic<std::uint64_t> unpacks_{0};
};

}  // namespace fathom::map

#endif  // FATHOM_TESTS_MAP_GLOBAL_PLAIN_CODEC_H_
