#include "storage/bytes.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>

#include "tests/testing/status_matchers.h"

namespace fathom::storage {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;

TEST(Bytes, AreLittleEndianOnEveryMachine) {
  ByteWriter writer;
  writer.PutU16(0x0102);
  writer.PutU32(0x03040506);
  writer.PutF32(1.0f);  // IEEE 754: 0x3f800000.
  EXPECT_EQ(writer.bytes(),
            (Bytes{0x02, 0x01, 0x06, 0x05, 0x04, 0x03, 0, 0, 0x80, 0x3f}));
}

TEST(Bytes, VarintHasSevenBitsAByteLowGroupFirst) {
  ByteWriter writer;
  writer.PutVarint(300);  // 300 = 2 * 128 + 44: 44 | 0x80, then 2.
  EXPECT_EQ(writer.bytes(), (Bytes{0xac, 0x02}));
}

TEST(Bytes, EveryValueComesBackBitForBit) {
  ByteWriter writer;
  writer.PutF64(-0.0);
  writer.PutF64(std::numeric_limits<double>::quiet_NaN());
  writer.PutI64(std::numeric_limits<std::int64_t>::min());
  writer.PutVarint(std::numeric_limits<std::uint64_t>::max());
  writer.PutString(std::string("a\0b", 3));
  writer.PutBool(true);
  ByteReader reader(writer.bytes());
  EXPECT_TRUE(std::signbit(reader.GetF64()));
  EXPECT_EQ(
      std::bit_cast<std::uint64_t>(reader.GetF64()),
      std::bit_cast<std::uint64_t>(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_EQ(reader.GetI64(), std::numeric_limits<std::int64_t>::min());
  EXPECT_EQ(reader.GetVarint(), std::numeric_limits<std::uint64_t>::max());
  EXPECT_EQ(reader.GetString(), std::string("a\0b", 3));
  EXPECT_TRUE(reader.GetBool());
  EXPECT_THAT(reader.Finish("test"), IsOk());
}

TEST(Bytes, ReaderFailsAtTheEndAndStaysFailed) {
  const Bytes bytes = {1, 2, 3};
  ByteReader reader(bytes);
  EXPECT_EQ(reader.GetU32(), 0u);
  EXPECT_FALSE(reader.ok());
  EXPECT_EQ(reader.GetU8(), 0u);  // Three bytes are left, but it has failed.
  EXPECT_THAT(reader.Finish("x"), StatusIs(absl::StatusCode::kDataLoss));
}

TEST(Bytes, BytesLeftOverAreAnError) {
  const Bytes bytes = {1, 2};
  ByteReader reader(bytes);
  reader.GetU8();
  EXPECT_THAT(reader.Finish("x"), StatusIs(absl::StatusCode::kDataLoss));
}

TEST(Bytes, CountAtItsLimitPassesAndOnePastFails) {
  const Bytes bytes = {7, 8};
  ByteReader reader(bytes);
  EXPECT_EQ(reader.GetCount(7), 7u);
  EXPECT_EQ(reader.GetCount(7), 0u);
  EXPECT_FALSE(reader.ok());
}

// Found by fuzzing: the span from a time 290 000 years ago overflows.
TEST(Bytes, TimeThatNoTextCanSayFails) {
  for (const Time good : {kFirstTime, Time(), kLastTime}) {
    ByteWriter writer;
    writer.PutTime(good);
    ByteReader reader(writer.bytes());
    EXPECT_EQ(reader.GetTime(), good);
    EXPECT_THAT(reader.Finish("it"), IsOk());
  }
  for (const Time bad : {kFirstTime - Duration(1), kLastTime + Duration(1),
                         Time::min(), Time::max()}) {
    ByteWriter writer;
    writer.PutTime(bad);
    ByteReader reader(writer.bytes());
    EXPECT_EQ(reader.GetTime(), Time());
    EXPECT_FALSE(reader.ok());
  }
}

TEST(Bytes, VarintOfMoreThan64BitsFails) {
  const Bytes bytes(10, 0xff);
  ByteReader reader(bytes);
  reader.GetVarint();
  EXPECT_FALSE(reader.ok());
}

TEST(Bytes, StringLongerThanWhatIsLeftFails) {
  const Bytes bytes = {5, 'a', 'b'};
  ByteReader reader(bytes);
  EXPECT_EQ(reader.GetString(), "");
  EXPECT_FALSE(reader.ok());
}

}  // namespace
}  // namespace fathom::storage
