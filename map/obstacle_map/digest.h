// Digest64: a running 64-bit digest of a map's content, for comparing maps
// ("the same acknowledged input gives the same map, digest for digest").
//
// FNV-1a (Fowler, Noll, Vo; draft-eastlake-fnv) over 64-bit words instead of
// bytes, with a final mix (splitmix64), since a map is tens of millions of
// words. Not cryptographic: it guards against faults, not against forgers.
// Not thread-safe.
#ifndef FATHOM_MAP_OBSTACLE_MAP_DIGEST_H_
#define FATHOM_MAP_OBSTACLE_MAP_DIGEST_H_

#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "absl/strings/str_format.h"

namespace fathom::map {

class Digest64 {
 public:
  void Add(uint64_t word) { hash_ = (hash_ ^ word) * kPrime; }
  // Bit pattern of the value: -0.0 differs from 0.0, every NaN payload counts.
  void Add(double value) { Add(std::bit_cast<uint64_t>(value)); }
  void Add(float value) { Add(uint64_t{std::bit_cast<uint32_t>(value)}); }
  // Length first, so that ("ab", "c") differs from ("a", "bc").
  void Add(std::string_view text) {
    Add(uint64_t{text.size()});
    AddBytes(text.data(), text.size());
  }
  // `size` bytes without padding, whose layout the caller vouches for.
  void AddBytes(const void* bytes, size_t size) {
    const char* at = static_cast<const char*>(bytes);
    for (; size >= sizeof(uint64_t); size -= sizeof(uint64_t)) {
      uint64_t word;
      std::memcpy(&word, at, sizeof word);
      Add(word);
      at += sizeof word;
    }
    if (size > 0) {
      uint64_t word = 0;
      std::memcpy(&word, at, size);
      Add(word);
    }
  }

  // 16 hexadecimal digits.
  std::string Hex() const {
    uint64_t mixed = hash_;
    mixed = (mixed ^ (mixed >> 30)) * 0xbf58476d1ce4e5b9;
    mixed = (mixed ^ (mixed >> 27)) * 0x94d049bb133111eb;
    return absl::StrFormat("%016x", mixed ^ (mixed >> 31));
  }

 private:
  static constexpr uint64_t kPrime = 0x100000001b3;
  uint64_t hash_ = 0xcbf29ce484222325;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_OBSTACLE_MAP_DIGEST_H_
