#include "storage/column.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>

#include "tests/testing/status_matchers.h"

namespace fathom::storage {
namespace {

using ::fathom::testing::IsOk;

template <typename T>
std::vector<T> RoundTrip(const std::vector<T>& elements) {
  ByteWriter writer;
  PutColumn(elements, writer);
  ByteReader reader(writer.bytes());
  std::vector<T> back = GetColumn<T>(reader, elements.size());
  EXPECT_THAT(reader.Finish("column"), IsOk());
  return back;
}

TEST(Column, EqualElementsTakeTwoBytesAPlane) {
  ByteWriter writer;
  PutColumn(std::vector<std::uint32_t>(1000, 0x01020304), writer);
  // Mode constant (0) and the byte, four times, least significant first.
  EXPECT_EQ(writer.bytes(), (Bytes{0, 4, 0, 3, 0, 2, 0, 1}));
}

TEST(Column, ShortPlaneIsRaw) {
  ByteWriter writer;
  PutColumn(std::vector<std::uint8_t>{5, 6}, writer);
  EXPECT_EQ(writer.bytes(), (Bytes{1, 5, 6}));
}

TEST(Column, EmptyTakesNothing) {
  ByteWriter writer;
  PutColumn(std::vector<double>{}, writer);
  EXPECT_EQ(writer.size(), 0u);
}

TEST(Column, FloatsComeBackBitForBitAtEverySizeAndRoughness) {
  std::mt19937 random(2);
  for (const std::size_t count : {1u, 2u, 47u, 48u, 49u, 255u, 4096u, 70000u}) {
    std::vector<float> smooth(count);
    std::vector<std::uint32_t> noise(count);
    std::vector<double> doubles(count);
    std::vector<std::uint16_t> shorts(count);
    for (std::size_t i = 0; i < count; ++i) {
      smooth[i] = std::sin(static_cast<float>(i) * 0.01f) * 50.0f;
      noise[i] = static_cast<std::uint32_t>(random());
      doubles[i] = std::bit_cast<double>(
          (static_cast<std::uint64_t>(random()) << 32) | random());
      shorts[i] = static_cast<std::uint16_t>(i / 100);
    }
    EXPECT_EQ(RoundTrip(smooth), smooth);
    EXPECT_EQ(RoundTrip(noise), noise);
    EXPECT_EQ(RoundTrip(shorts), shorts);
    const std::vector<double> back = RoundTrip(doubles);
    ASSERT_EQ(back.size(), count);
    // Compared as bits: some of them are NaN.
    EXPECT_EQ(std::memcmp(back.data(), doubles.data(), count * 8), 0);
  }
}

TEST(Rows, AreOnePlaneByteByByteAtEveryWidthAndCount) {
  std::mt19937 random(4);
  for (const std::size_t width : {3u, 15u, 16u, 17u, 33u, 250u}) {
    for (const std::size_t count : {1u, 2u, 15u, 16u, 17u, 128u}) {
      Bytes rows(width * count);
      for (auto& byte : rows) byte = static_cast<std::uint8_t>(random());
      ByteWriter writer;
      PutRows(rows, width, writer);
      const Bytes written = writer.bytes();
      // Noise is raw (1): byte k of row i stands at k * count + i.
      ASSERT_EQ(written.size(), 1 + rows.size());
      EXPECT_EQ(written[0], 1);
      for (std::size_t k = 0; k < width; ++k) {
        for (std::size_t i = 0; i < count; ++i) {
          ASSERT_EQ(written[1 + k * count + i], rows[i * width + k])
              << width << " x " << count << ": " << k << ", " << i;
        }
      }
      ByteReader reader(written);
      EXPECT_EQ(GetRows(reader, count, width), rows);
      EXPECT_THAT(reader.Finish("rows"), IsOk());
    }
  }
}

TEST(Column, SmoothDepthsShrink) {
  // Depths of a gentle slope, centimetres apart: sign, exponent and upper
  // mantissa are shared, so at least a third must go.
  std::vector<float> depths(4096);
  for (std::size_t i = 0; i < depths.size(); ++i) {
    depths[i] = 20.0f + 0.01f * static_cast<float>(i % 64);
  }
  ByteWriter writer;
  PutColumn(depths, writer);
  EXPECT_LT(writer.size(), 4096u * 4 * 2 / 3);
}

TEST(Column, DamagedBytesNeverCrashOrGrow) {
  std::mt19937 random(3);
  std::vector<float> elements(500);
  for (auto& e : elements) e = static_cast<float>(random() % 1000) * 0.1f;
  ByteWriter writer;
  PutColumn(elements, writer);
  const Bytes written = writer.bytes();
  for (int trial = 0; trial < 2000; ++trial) {
    Bytes bytes = written;
    bytes[random() % bytes.size()] ^=
        static_cast<std::uint8_t>(1 + random() % 255);
    bytes.resize(1 + random() % bytes.size());
    ByteReader reader(bytes);
    const std::vector<float> back = GetColumn<float>(reader, elements.size());
    EXPECT_TRUE(back.empty() || back.size() == elements.size());
  }
}

}  // namespace
}  // namespace fathom::storage
