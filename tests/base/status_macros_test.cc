#include "base/status_macros.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>

#include "tests/testing/status_matchers.h"

namespace fathom {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::IsOkAndHolds;
using ::fathom::testing::StatusIs;

absl::Status CountAndReturn(absl::Status status, int& calls) {
  ++calls;
  return status;
}

TEST(ReturnIfError, EvaluatesOnceAndReturnsTheErrorUnchanged) {
  absl::Status error = absl::DataLossError("torn page");
  error.SetPayload("where", absl::Cord("page 7"));
  int calls = 0;
  bool went_on = false;
  const auto function = [&]() -> absl::Status {
    FATHOM_RETURN_IF_ERROR(CountAndReturn(error, calls));
    went_on = true;
    return absl::OkStatus();
  };
  EXPECT_EQ(function(), error);  // Compares payloads too.
  EXPECT_EQ(calls, 1);
  EXPECT_FALSE(went_on);
}

TEST(ReturnIfError, GoesOnWhenOk) {
  int calls = 0;
  const auto function = [&]() -> absl::Status {
    FATHOM_RETURN_IF_ERROR(CountAndReturn(absl::OkStatus(), calls));
    return absl::AbortedError("went on");
  };
  EXPECT_THAT(function(), StatusIs(absl::StatusCode::kAborted));
  EXPECT_EQ(calls, 1);
}

absl::StatusOr<std::unique_ptr<int>> Box(int value) {
  if (value < 0) return absl::OutOfRangeError("value < 0");
  return std::make_unique<int>(value);
}

absl::StatusOr<int> Sum(int a, int b) {
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<int> first, Box(a));
  std::unique_ptr<int> second;
  FATHOM_ASSIGN_OR_RETURN(second, Box(b));
  return *first + *second;
}

TEST(AssignOrReturn, MovesTheValueIntoADeclarationOrAVariable) {
  EXPECT_THAT(Sum(2, 3), IsOkAndHolds(5));
}

TEST(AssignOrReturn, ReturnsTheErrorUnchanged) {
  EXPECT_THAT(Sum(2, -1), StatusIs(absl::StatusCode::kOutOfRange, "value < 0"));
  EXPECT_THAT(Sum(-1, 2), ::testing::Not(IsOk()));
}

TEST(AssignOrReturn, AcceptsAnExpressionWithCommas) {
  const auto function = []() -> absl::StatusOr<int> {
    using Pair = std::pair<int, int>;
    FATHOM_ASSIGN_OR_RETURN(const Pair pair,
                            absl::StatusOr<std::pair<int, int>>(Pair{4, 5}));
    return pair.second;
  };
  EXPECT_THAT(function(), IsOkAndHolds(5));
}

}  // namespace
}  // namespace fathom
