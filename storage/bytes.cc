#include "storage/bytes.h"

#include <cstdlib>

#include "absl/strings/str_format.h"

namespace fathom::storage {

void ByteWriter::PutVarint(std::uint64_t value) {
  while (value >= 0x80) {
    PutU8(static_cast<std::uint8_t>(value | 0x80));
    value >>= 7;
  }
  PutU8(static_cast<std::uint8_t>(value));
}

void ByteWriter::PutString(std::string_view text) {
  if (text.size() > kMaxStringBytes) std::abort();  // REQUIRES of the header.
  PutVarint(text.size());
  bytes_.insert(bytes_.end(), text.begin(), text.end());
}

Time ByteReader::GetTime() {
  const Time time = TimeFromUnixMicros(GetI64());
  if (time < kFirstTime || time > kLastTime) {
    ok_ = false;
    return {};
  }
  return time;
}

bool ByteReader::GetBool() {
  const std::uint8_t value = GetU8();
  if (value > 1) ok_ = false;
  return value == 1;
}

std::uint64_t ByteReader::GetVarint() {
  std::uint64_t value = 0;
  for (int shift = 0; shift < 64; shift += 7) {
    const std::uint8_t group = GetU8();
    // The tenth group has room for one bit only.
    if (shift == 63 && group > 1) break;
    value |= static_cast<std::uint64_t>(group & 0x7f) << shift;
    if (group < 0x80) return ok_ ? value : 0;
  }
  ok_ = false;
  return 0;
}

std::size_t ByteReader::GetCount(std::size_t max) {
  const std::uint64_t count = GetVarint();
  if (count > max) {
    ok_ = false;
    return 0;
  }
  return static_cast<std::size_t>(count);
}

std::string ByteReader::GetString() {
  const std::size_t size = GetCount(kMaxStringBytes);
  const ByteSpan bytes = GetBytes(size);
  return std::string(bytes.begin(), bytes.end());
}

ByteSpan ByteReader::GetBytes(std::size_t size) {
  if (!ok_ || left() < size) {
    ok_ = false;
    return {};
  }
  const ByteSpan bytes = bytes_.subspan(at_, size);
  at_ += size;
  return bytes;
}

absl::Status ByteReader::Finish(std::string_view what) const {
  if (!ok_) {
    return absl::DataLossError(absl::StrFormat(
        "%s: malformed near byte %d of %d", what, at_, bytes_.size()));
  }
  if (left() != 0) {
    return absl::DataLossError(
        absl::StrFormat("%s: %d bytes too many", what, left()));
  }
  return absl::OkStatus();
}

}  // namespace fathom::storage
