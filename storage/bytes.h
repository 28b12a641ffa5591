// The byte layer under every blob of the mission file: a little-endian writer
// and a bounds-checked reader.
//
// Everything is little-endian whatever the machine; floats and doubles are
// their IEEE 754 bits, so that what is read is what was written, NaN payloads
// and signed zeros included. Varints are LEB128, least significant group
// first, at most ten bytes.
//
// The reader never trusts a length: each read is checked against what is left,
// a failed read returns zero and makes the reader failed for good, and a
// decoder asks ok() once per record and Finish() at the end. So a decoder has
// no error path per field and still cannot read out of bounds or allocate more
// than its named limits. Not thread-safe.

#ifndef FATHOM_STORAGE_BYTES_H_
#define FATHOM_STORAGE_BYTES_H_

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "base/time.h"

namespace fathom::storage {

using Bytes = std::vector<std::uint8_t>;
using ByteSpan = std::span<const std::uint8_t>;

// Strings of the file (ids, names) are at most this long: the longest id that
// the server admits is far below it, and a hostile length stops here.
inline constexpr std::size_t kMaxStringBytes = 4096;

// Appends to a growing buffer. Cannot fail but by running out of memory.
class ByteWriter {
 public:
  void PutU8(std::uint8_t value) { bytes_.push_back(value); }
  void PutU16(std::uint16_t value) { PutLittleEndian(value); }
  void PutU32(std::uint32_t value) { PutLittleEndian(value); }
  void PutU64(std::uint64_t value) { PutLittleEndian(value); }
  void PutI64(std::int64_t value) {
    PutLittleEndian(static_cast<std::uint64_t>(value));
  }
  void PutF32(float value) {
    PutLittleEndian(std::bit_cast<std::uint32_t>(value));
  }
  void PutF64(double value) {
    PutLittleEndian(std::bit_cast<std::uint64_t>(value));
  }
  void PutTime(Time time) { PutI64(ToUnixMicros(time)); }
  void PutBool(bool value) { PutU8(value ? 1 : 0); }
  void PutVarint(std::uint64_t value);
  // A varint of the length, then the bytes. REQUIRES: at most kMaxStringBytes
  // (CHECKed: a longer one could never be read back).
  void PutString(std::string_view text);
  void PutBytes(ByteSpan bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }

  // Room for so many bytes in all, if they are known before.
  void Reserve(std::size_t size) { bytes_.reserve(size); }
  std::size_t size() const { return bytes_.size(); }
  const Bytes& bytes() const { return bytes_; }
  Bytes Take() { return std::move(bytes_); }

 private:
  template <typename Unsigned>
  void PutLittleEndian(Unsigned value) {
    const std::size_t at = bytes_.size();
    bytes_.resize(at + sizeof(value));
    if constexpr (std::endian::native == std::endian::little) {
      std::memcpy(bytes_.data() + at, &value, sizeof(value));
    } else {
      for (std::size_t i = 0; i < sizeof(value); ++i) {
        bytes_[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
      }
    }
  }

  Bytes bytes_;
};

// Reads what ByteWriter wrote. Holds no copy: `bytes` must outlive it.
class ByteReader {
 public:
  explicit ByteReader(ByteSpan bytes) : bytes_(bytes) {}

  std::uint8_t GetU8() { return GetLittleEndian<std::uint8_t>(); }
  std::uint16_t GetU16() { return GetLittleEndian<std::uint16_t>(); }
  std::uint32_t GetU32() { return GetLittleEndian<std::uint32_t>(); }
  std::uint64_t GetU64() { return GetLittleEndian<std::uint64_t>(); }
  std::int64_t GetI64() {
    return static_cast<std::int64_t>(GetLittleEndian<std::uint64_t>());
  }
  float GetF32() { return std::bit_cast<float>(GetU32()); }
  double GetF64() { return std::bit_cast<double>(GetU64()); }
  // Fails outside [kFirstTime, kLastTime]: what follows computes spans.
  Time GetTime();
  // Fails on anything but 0 and 1, so that one content has one encoding.
  bool GetBool();
  std::uint64_t GetVarint();
  // A varint that counts things to come: fails above `max`.
  std::size_t GetCount(std::size_t max);
  std::string GetString();
  // The next `size` bytes, in place; empty and failed if fewer are left.
  ByteSpan GetBytes(std::size_t size);

  bool ok() const { return ok_; }
  // Makes the reader failed: for a value that the decoder itself refuses.
  void Fail() { ok_ = false; }
  std::size_t left() const { return bytes_.size() - at_; }
  // OK if no read failed and nothing is left. Errors: DATA_LOSS naming `what`.
  absl::Status Finish(std::string_view what) const;

 private:
  template <typename Unsigned>
  Unsigned GetLittleEndian() {
    if (!ok_ || left() < sizeof(Unsigned)) {
      ok_ = false;
      return 0;
    }
    Unsigned value = 0;
    if constexpr (std::endian::native == std::endian::little) {
      std::memcpy(&value, bytes_.data() + at_, sizeof(value));
    } else {
      for (std::size_t i = 0; i < sizeof(value); ++i) {
        value |= static_cast<Unsigned>(static_cast<Unsigned>(bytes_[at_ + i])
                                       << (8 * i));
      }
    }
    at_ += sizeof(value);
    return value;
  }

  ByteSpan bytes_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

}  // namespace fathom::storage

#endif  // FATHOM_STORAGE_BYTES_H_
