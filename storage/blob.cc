#include "storage/blob.h"

#include <utility>

#include "absl/strings/str_format.h"
#include "base/crc32c.h"

namespace fathom::storage {
namespace {

constexpr std::size_t kCrcOffset = 4;

// The CRC field is zero while it is computed: one pass over one buffer.
std::uint32_t BlobCrc(ByteSpan blob) {
  const std::uint8_t head[4] = {blob[0], blob[1], blob[2], blob[3]};
  const std::uint32_t payload = Crc32c(blob.subspan(kBlobHeaderBytes));
  Bytes sum(head, head + 4);
  for (int i = 0; i < 4; ++i) {
    sum.push_back(static_cast<std::uint8_t>(payload >> (8 * i)));
  }
  return Crc32c(sum);
}

}  // namespace

ByteWriter StartBlob() {
  ByteWriter writer;
  writer.PutU64(0);
  return writer;
}

Bytes SealBlob(BlobKind kind, std::uint8_t version, ByteWriter writer) {
  Bytes blob = writer.Take();
  blob[0] = static_cast<std::uint8_t>(kind);
  blob[1] = version;
  const std::uint32_t crc = BlobCrc(blob);
  for (std::size_t i = 0; i < 4; ++i) {
    blob[kCrcOffset + i] = static_cast<std::uint8_t>(crc >> (8 * i));
  }
  return blob;
}

absl::StatusOr<ByteSpan> OpenBlob(BlobKind kind, std::uint8_t newest_version,
                                  ByteSpan blob, std::string_view what) {
  if (blob.size() < kBlobHeaderBytes) {
    return absl::DataLossError(absl::StrFormat(
        "%s: blob of %d bytes is shorter than its header", what, blob.size()));
  }
  ByteReader header(blob.subspan(kCrcOffset, 4));
  const std::uint32_t stored = header.GetU32();
  const std::uint32_t computed = BlobCrc(blob);
  if (stored != computed) {
    return absl::DataLossError(absl::StrFormat(
        "%s: checksum is %08x, its bytes give %08x", what, stored, computed));
  }
  if (blob[0] != static_cast<std::uint8_t>(kind) || blob[2] != 0 ||
      blob[3] != 0 || blob[1] == 0) {
    return absl::DataLossError(
        absl::StrFormat("%s: blob is of kind %d, expected %d", what, blob[0],
                        static_cast<int>(kind)));
  }
  if (blob[1] > newest_version) {
    return absl::UnimplementedError(
        absl::StrFormat("%s: blob has version %d, this program reads up to %d",
                        what, blob[1], newest_version));
  }
  return blob.subspan(kBlobHeaderBytes);
}

}  // namespace fathom::storage
