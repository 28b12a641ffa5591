#include "map/geodesy/ping.h"

#include <gtest/gtest.h>

#include <set>

namespace fathom::map {
namespace {

TEST(RejectCounts, CountsEachReasonApart) {
  RejectCounts counts;
  EXPECT_TRUE(counts.empty());
  counts.Add(RejectReason::kBadStd);
  counts.Add(RejectReason::kBadStd, 2);
  counts.Add(RejectReason::kContactsFull);
  EXPECT_EQ(counts.count(RejectReason::kBadStd), 3u);  // 1 + 2.
  EXPECT_EQ(counts.count(RejectReason::kContactsFull), 1u);
  EXPECT_EQ(counts.count(RejectReason::kNotFinite), 0u);
  EXPECT_EQ(counts.total(), 4u);
}

TEST(RejectCounts, MergeAdds) {
  RejectCounts a;
  a.Add(RejectReason::kGated, 5);
  RejectCounts b;
  b.Add(RejectReason::kGated, 7);
  b.Add(RejectReason::kTooLate);
  a.Merge(b);
  EXPECT_EQ(a.count(RejectReason::kGated), 12u);  // 5 + 7.
  EXPECT_EQ(a.total(), 13u);
}

TEST(RejectReasonName, IsKnownAndDifferentForAll) {
  std::set<std::string_view> names;
  for (std::size_t number = 1; number < kRejectReasonEnd; ++number) {
    const std::string_view name =
        RejectReasonName(static_cast<RejectReason>(number));
    EXPECT_NE(name, "?") << number;
    names.insert(name);
  }
  EXPECT_EQ(names.size(), kRejectReasonEnd - 1);
  EXPECT_EQ(RejectReasonName(static_cast<RejectReason>(0)), "?");
  EXPECT_EQ(RejectReasonName(static_cast<RejectReason>(kRejectReasonEnd)), "?");
}

}  // namespace
}  // namespace fathom::map
