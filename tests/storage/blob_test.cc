#include "storage/blob.h"

#include <gtest/gtest.h>

#include <boost/crc.hpp>
#include <random>

#include "base/crc32c.h"
#include "tests/testing/status_matchers.h"

namespace fathom::storage {
namespace {

using ::fathom::testing::StatusIs;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Crc32c, GivesThePublishedCheckValues) {
  const std::string digits = "123456789";
  // The check value of CRC-32C in the catalogue of parametrised CRCs.
  EXPECT_EQ(Crc32c(Bytes(digits.begin(), digits.end())), 0xE3069283u);
  // RFC 3720, appendix B.4: 32 bytes of zeros, of ones, and 0..31.
  EXPECT_EQ(Crc32c(Bytes(32, 0x00)), 0x8A9136AAu);
  EXPECT_EQ(Crc32c(Bytes(32, 0xff)), 0x62A8AB43u);
  Bytes rising(32);
  for (std::size_t i = 0; i < 32; ++i) {
    rising[i] = static_cast<std::uint8_t>(i);
  }
  EXPECT_EQ(Crc32c(rising), 0x46DD794Eu);
}

TEST(Crc32c, AgreesWithBoostAtEveryLengthToThreeHundred) {
  std::mt19937 random(1);
  for (std::size_t size = 0; size <= 300; ++size) {
    Bytes bytes(size);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    boost::crc_optimal<32, 0x1EDC6F41, 0xFFFFFFFF, 0xFFFFFFFF, true, true> crc;
    crc.process_bytes(bytes.data(), bytes.size());
    ASSERT_EQ(Crc32c(bytes), crc.checksum()) << size;
  }
}

Bytes SealedBlob() {
  ByteWriter writer = StartBlob();
  writer.PutBytes(Bytes{10, 20, 30});
  return SealBlob(BlobKind::kTile, 2, std::move(writer));
}

TEST(Blob, PayloadComesBack) {
  const Bytes blob = SealedBlob();
  EXPECT_EQ(blob.size(), kBlobHeaderBytes + 3);
  FATHOM_ASSERT_OK_AND_ASSIGN(const ByteSpan payload,
                              OpenBlob(BlobKind::kTile, 2, blob, "tile"));
  EXPECT_THAT(payload, ElementsAre(10, 20, 30));
}

TEST(Blob, EveryFlippedBitIsFound) {
  const Bytes blob = SealedBlob();
  for (std::size_t bit = 0; bit < blob.size() * 8; ++bit) {
    Bytes flipped = blob;
    flipped[bit / 8] =
        static_cast<std::uint8_t>(flipped[bit / 8] ^ (1u << (bit % 8)));
    EXPECT_THAT(OpenBlob(BlobKind::kTile, 2, flipped, "tile 7"),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr("tile 7")))
        << bit;
  }
}

TEST(Blob, EveryTruncationIsFound) {
  const Bytes blob = SealedBlob();
  for (std::size_t size = 0; size < blob.size(); ++size) {
    EXPECT_THAT(
        OpenBlob(BlobKind::kTile, 2, ByteSpan(blob).first(size), "tile"),
        StatusIs(absl::StatusCode::kDataLoss))
        << size;
  }
}

TEST(Blob, NewerVersionIsToldApartFromDamage) {
  EXPECT_THAT(OpenBlob(BlobKind::kTile, 1, SealedBlob(), "tile"),
              StatusIs(absl::StatusCode::kUnimplemented));
}

TEST(Blob, AnotherKindIsRefused) {
  EXPECT_THAT(OpenBlob(BlobKind::kContact, 2, SealedBlob(), "contact"),
              StatusIs(absl::StatusCode::kDataLoss));
}

}  // namespace
}  // namespace fathom::storage
