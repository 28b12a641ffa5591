// GoogleMock matchers for absl::Status and absl::StatusOr, which Debian's
// Abseil does not ship.
//
//   EXPECT_THAT(store.Open(path), IsOk());
//   EXPECT_THAT(ParseTime("x"), StatusIs(absl::StatusCode::kInvalidArgument,
//                                        HasSubstr("RFC 3339")));
//   EXPECT_THAT(ParseTime("..."), IsOkAndHolds(expected));
//   FATHOM_ASSERT_OK_AND_ASSIGN(const Tile tile, DecodeTile(bytes));

#ifndef FATHOM_TESTS_TESTING_STATUS_MATCHERS_H_
#define FATHOM_TESTS_TESTING_STATUS_MATCHERS_H_

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ostream>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace fathom::testing {

inline const absl::Status& StatusOf(const absl::Status& status) {
  return status;
}
template <typename T>
const absl::Status& StatusOf(const absl::StatusOr<T>& status_or) {
  return status_or.status();
}

MATCHER(IsOk, negation ? "is an error" : "is OK") {
  const absl::Status& status = StatusOf(arg);
  *result_listener << status.ToString();
  return status.ok();
}

MATCHER_P2(StatusIs, code, message_matcher,
           "has code " + absl::StatusCodeToString(code)) {
  const absl::Status& status = StatusOf(arg);
  *result_listener << status.ToString() << " ";
  return status.code() == code &&
         ::testing::ExplainMatchResult(
             message_matcher, std::string(status.message()), result_listener);
}

inline auto StatusIs(absl::StatusCode code) {
  return StatusIs(code, ::testing::_);
}

MATCHER_P(
    IsOkAndHolds, value_matcher,
    "is OK and " +
        ::testing::DescribeMatcher<typename std::decay_t<arg_type>::value_type>(
            value_matcher, negation)) {
  if (!arg.ok()) {
    *result_listener << arg.status().ToString();
    return false;
  }
  return ::testing::ExplainMatchResult(value_matcher, *arg, result_listener);
}

}  // namespace fathom::testing

#define FATHOM_ASSERT_OK(expr) ASSERT_THAT((expr), ::fathom::testing::IsOk())
#define FATHOM_EXPECT_OK(expr) EXPECT_THAT((expr), ::fathom::testing::IsOk())

// Fails the test unless `expr` (an absl::StatusOr) is OK; else moves its value
// into `lhs`, which may declare a variable.
#define FATHOM_ASSERT_OK_AND_ASSIGN(lhs, ...) \
  FATHOM_ASSERT_OK_AND_ASSIGN_IMPL_(          \
      FATHOM_TESTING_CONCAT_(fathom_status_or_, __LINE__), lhs, (__VA_ARGS__))
#define FATHOM_ASSERT_OK_AND_ASSIGN_IMPL_(status_or, lhs, expr) \
  auto status_or = expr;                                        \
  ASSERT_THAT(status_or, ::fathom::testing::IsOk());            \
  lhs = *std::move(status_or)
#define FATHOM_TESTING_CONCAT_(a, b) FATHOM_TESTING_CONCAT_INNER_(a, b)
#define FATHOM_TESTING_CONCAT_INNER_(a, b) a##b

#endif  // FATHOM_TESTS_TESTING_STATUS_MATCHERS_H_
