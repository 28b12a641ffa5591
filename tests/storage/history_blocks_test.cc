// What the contact history is made of: blocks as bytes, and tails.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "storage/history_codec.h"
#include "storage/history_tail.h"
#include "tests/storage/sample_records.h"
#include "tests/testing/status_matchers.h"

namespace fathom::storage {
namespace {

using ::fathom::testing::StatusIs;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::pair<int, int>> TimesAndRevisions(
    const std::vector<ContactHistoryRow>& rows) {
  std::vector<std::pair<int, int>> found;
  for (const ContactHistoryRow& row : rows) {
    found.emplace_back(
        static_cast<int>((row.estimate.time - HistoryTime(0)).count() /
                         1'000'000),
        static_cast<int>(row.revision));
  }
  return found;
}

TEST(HistoryCodec, BlockComesBackBitForBitWithTheNamesOfItsTime) {
  const std::vector<map::ContactKey> names = {
      {.source = {"ais"}, .contact = {"235000001"}}};
  std::vector<ContactHistoryRow> rows;
  for (int i = 0; i < static_cast<int>(kMaxBlockEstimates); ++i) {
    rows.push_back(SampleHistoryRow(i / 2, static_cast<std::uint64_t>(i)));
    // None, a name, none, and the name again at the end.
    if ((i >= 10 && i < 20) || i == 255) rows.back().estimate.linked = names;
  }
  const Bytes blob = EncodeHistory(7, rows);
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::vector<ContactHistoryRow> back,
                              DecodeHistory(blob, 7, "block"));
  ASSERT_EQ(back.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(back[i].revision, rows[i].revision);
    EXPECT_EQ(back[i].estimate, rows[i].estimate) << i;
  }
  EXPECT_THAT(DecodeHistory(blob, 8, "block"),
              StatusIs(absl::StatusCode::kDataLoss,
                       HasSubstr("holds contact_number=7")));
}

TEST(HistoryCodec, WhatNoEncoderWroteIsRefused) {
  std::vector<ContactHistoryRow> rows = {SampleHistoryRow(1, 1),
                                         SampleHistoryRow(2, 2)};
  std::swap(rows[0], rows[1]);
  EXPECT_THAT(DecodeHistory(EncodeHistory(7, rows), 7, "block"),
              StatusIs(absl::StatusCode::kDataLoss));
  const Bytes blob = EncodeHistory(7, std::vector{SampleHistoryRow(1, 1)});
  for (std::size_t size = 0; size < blob.size(); ++size) {
    EXPECT_THAT(DecodeHistory(ByteSpan(blob).first(size), 7, "block"),
                StatusIs(absl::StatusCode::kDataLoss))
        << size;
  }
}

TEST(HistoryTail, RevisedRowsTakeThePlaceOfOnesOfBefore) {
  HistoryTail tail;
  for (const auto& row : {SampleHistoryRow(10, 1), SampleHistoryRow(20, 2),
                          SampleHistoryRow(30, 3)})
    tail.Add(row);
  EXPECT_FALSE(tail.cut.has_value());
  // The report of 15 s came as revision 4.
  for (const auto& row : {SampleHistoryRow(10, 4, true),
                          SampleHistoryRow(15, 4), SampleHistoryRow(20, 4)}) {
    tail.Add(row);
  }
  EXPECT_THAT(
      TimesAndRevisions(tail.rows),
      ElementsAre(std::pair(10, 4), std::pair(15, 4), std::pair(20, 4)));
  EXPECT_TRUE(tail.Stands(SampleHistoryRow(9, 1)));
  EXPECT_FALSE(tail.Stands(SampleHistoryRow(10, 1)));
}

TEST(HistoryTail, RowsAreInOrderAndOfOneTimeAndRevisionTheLastStays) {
  HistoryTail tail;
  for (const auto& row : {SampleHistoryRow(20, 2), SampleHistoryRow(10, 3),
                          SampleHistoryRow(20, 1)})
    tail.Add(row);
  ContactHistoryRow last = SampleHistoryRow(10, 3);
  last.estimate.radius_m = 77;
  tail.Add(last);
  EXPECT_THAT(
      TimesAndRevisions(tail.rows),
      ElementsAre(std::pair(10, 3), std::pair(20, 1), std::pair(20, 2)));
  EXPECT_EQ(tail.rows[0].estimate.radius_m, 77);
}

}  // namespace
}  // namespace fathom::storage
