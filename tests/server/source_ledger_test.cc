#include "server/source_ledger.h"

#include <gtest/gtest.h>

#include <string>

namespace fathom::server {
namespace {

constexpr StreamKind kPings = StreamKind::kPings;
const map::SourceId kAuv = {"auv-1"};

TEST(SourceLedger, TakesEachNumberOnce) {
  SourceLedger ledger;
  for (uint64_t sequence = 1; sequence <= 3; ++sequence) {
    const Judgement judgement = ledger.Take(kPings, kAuv, {1, sequence});
    EXPECT_EQ(judgement.verdict, Verdict::kNew);
    EXPECT_FALSE(judgement.missing.any());
  }
  EXPECT_EQ(ledger.Take(kPings, kAuv, {1, 3}).verdict, Verdict::kDuplicate);
  EXPECT_EQ(ledger.Take(kPings, kAuv, {1, 1}).verdict, Verdict::kDuplicate);
  EXPECT_EQ(ledger.Take(kPings, kAuv, {1, 4}).verdict, Verdict::kNew);
}

TEST(SourceLedger, TellsWhatIsMissing) {
  SourceLedger ledger;
  const Judgement first = ledger.Take(kPings, kAuv, {1, 4});
  EXPECT_EQ(first.verdict, Verdict::kNew);
  EXPECT_EQ(first.missing.first, 1U);
  EXPECT_EQ(first.missing.last, 3U);
  const Judgement next = ledger.Take(kPings, kAuv, {1, 6});
  EXPECT_EQ(next.missing.first, 5U);
  EXPECT_EQ(next.missing.last, 5U);
  // A late one counts as a resend: it was reported missing, and order is
  // what makes the map deterministic.
  EXPECT_EQ(ledger.Take(kPings, kAuv, {1, 5}).verdict, Verdict::kDuplicate);
}

TEST(SourceLedger, ALargerEpochBeginsAnewAndASmallerOneIsRefused) {
  SourceLedger ledger;
  ledger.Take(kPings, kAuv, {5, 10});
  const Judgement judgement = ledger.Take(kPings, kAuv, {6, 1});
  EXPECT_EQ(judgement.verdict, Verdict::kNew);
  EXPECT_FALSE(judgement.missing.any());
  EXPECT_EQ(ledger.Take(kPings, kAuv, {5, 11}).verdict, Verdict::kOldEpoch);
  EXPECT_EQ(ledger.Take(kPings, kAuv, {6, 1}).verdict, Verdict::kDuplicate);
}

TEST(SourceLedger, SourcesAndKindsCountApart) {
  SourceLedger ledger;
  ledger.Take(kPings, kAuv, {1, 1});
  EXPECT_EQ(ledger.Take(StreamKind::kContacts, kAuv, {1, 1}).verdict,
            Verdict::kNew);
  EXPECT_EQ(ledger.Take(kPings, {"auv-2"}, {1, 1}).verdict, Verdict::kNew);
}

TEST(SourceLedger, GoesOnWhereTheFileLeftOff) {
  SourceLedger ledger;
  ledger.Restore(kPings, kAuv, {2, 7});
  EXPECT_EQ(ledger.Take(kPings, kAuv, {2, 7}).verdict, Verdict::kDuplicate);
  EXPECT_EQ(ledger.Take(kPings, kAuv, {2, 8}).verdict, Verdict::kNew);
}

TEST(SourceLedger, RefusesOneSourceTooManyAndServesTheOthers) {
  SourceLedger ledger;
  for (size_t i = 0; i < SourceLedger::kMaxSources; ++i) {
    ASSERT_EQ(ledger.Take(kPings, {std::to_string(i)}, {1, 1}).verdict,
              Verdict::kNew);
  }
  EXPECT_EQ(ledger.Take(kPings, {"one more"}, {1, 1}).verdict, Verdict::kFull);
  EXPECT_EQ(ledger.Take(kPings, {"0"}, {1, 2}).verdict, Verdict::kNew);
}

}  // namespace
}  // namespace fathom::server
