#include "map/global/leaf.h"

#include <gtest/gtest.h>

#include <cmath>

namespace fathom::map {
namespace {

TEST(StdCode, HoldsPowersOfTwoExactly) {
  for (float std_m = kMinLeafStdM; std_m <= kMaxLeafStdM; std_m *= 2) {
    EXPECT_EQ(DecodeStd(EncodeStd(std_m)), std_m);
  }
}

TEST(StdCode, RoundsToTheNearestOfNineBitsOfMantissa) {
  // 1 m is code 10 << 9; the next value is 1 + 2^-9 = 1.001953 m.
  EXPECT_EQ(EncodeStd(1.0f), 10 << 9);
  EXPECT_EQ(EncodeStd(1.0009f), 10 << 9);
  EXPECT_EQ(EncodeStd(1.0011f), (10 << 9) + 1);
  EXPECT_EQ(DecodeStd((10 << 9) + 1), 1.001953125f);
}

TEST(StdCode, ErrsByAtMostATenthOfAPercent) {
  // Half a step of 2^-9 in a mantissa of at least 1: 2^-10.
  for (float std_m = 0.001f; std_m < 1000; std_m *= 1.00137f) {
    EXPECT_NEAR(DecodeStd(EncodeStd(std_m)) / std_m, 1.0, 0x1p-10);
  }
}

TEST(StdCode, EveryCodeSurvivesDecoding) {
  for (std::uint16_t code = 0; code <= kMaxStdBits; ++code) {
    ASSERT_EQ(EncodeStd(DecodeStd(code)), code);
  }
}

TEST(StdCode, ClampsToOneMillimetreAndOneKilometre) {
  EXPECT_EQ(DecodeStd(EncodeStd(0)), kMinLeafStdM);
  EXPECT_EQ(DecodeStd(EncodeStd(1e-30f)), kMinLeafStdM);
  EXPECT_EQ(DecodeStd(EncodeStd(5000)), kMaxLeafStdM);
}

TEST(LeafKind, TravelsInTheHighBits) {
  for (const LeafKind kind :
       {LeafKind::kPrior, LeafKind::kMeasured, LeafKind::kLand}) {
    const Leaf leaf{.depth_m = 1, .std_code = MakeStdCode(kind, 0.25f)};
    EXPECT_EQ(leaf.kind(), kind);
    EXPECT_EQ(leaf.std_m(), 0.25f);
    EXPECT_TRUE(leaf.known());
  }
  EXPECT_EQ(MakeStdCode(LeafKind::kUnknown, 0.25f), 0);
  EXPECT_FALSE(Leaf{}.known());
}

TEST(LeafKind, SpeaksTheMapsLanguage) {
  EXPECT_EQ(ToEvidenceKind(LeafKind::kUnknown), EvidenceKind::kNone);
  EXPECT_EQ(ToEvidenceKind(LeafKind::kPrior), EvidenceKind::kPrior);
  EXPECT_EQ(ToEvidenceKind(LeafKind::kMeasured), EvidenceKind::kMeasured);
  EXPECT_EQ(ToEvidenceKind(LeafKind::kLand), EvidenceKind::kLand);
}

}  // namespace
}  // namespace fathom::map
