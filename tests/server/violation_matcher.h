// A matcher for what InvalidField returns: the field's path and the reason.

#ifndef FATHOM_TESTS_SERVER_VIOLATION_MATCHER_H_
#define FATHOM_TESTS_SERVER_VIOLATION_MATCHER_H_

#include <gmock/gmock.h>

#include <string>

#include "absl/status/status.h"
#include "server/errors.h"
#include "tests/testing/status_matchers.h"

namespace fathom::server {

MATCHER_P2(Violates, path, reason,
           "is INVALID_ARGUMENT at " + std::string(path) + " for " +
               v1::RejectReason_Name(reason)) {
  const absl::Status& status = ::fathom::testing::StatusOf(arg);
  *result_listener << status.ToString();
  if (status.code() != absl::StatusCode::kInvalidArgument) return false;
  const auto violation = ViolationOf(status);
  return violation.has_value() && violation->path == path &&
         violation->reason == reason && !violation->description.empty();
}

inline auto Violates(const char* path) {
  return Violates(path, v1::REJECT_REASON_INVALID_MESSAGE);
}

}  // namespace fathom::server

#endif  // FATHOM_TESTS_SERVER_VIOLATION_MATCHER_H_
