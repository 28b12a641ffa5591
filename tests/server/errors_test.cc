#include "server/errors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "server/field_path.h"
#include "tests/server/violation_matcher.h"

namespace fathom::server {
namespace {

using ::testing::HasSubstr;

google::rpc::Status Details(const grpc::Status& status) {
  google::rpc::Status rich;
  EXPECT_TRUE(rich.ParseFromString(status.error_details()));
  return rich;
}

// The detail of the given type, which must be there once.
template <typename Detail>
Detail DetailOf(const grpc::Status& status) {
  Detail detail;
  int found = 0;
  const google::rpc::Status rich = Details(status);
  for (const auto& any : rich.details()) {
    if (any.Is<Detail>()) {
      EXPECT_TRUE(any.UnpackTo(&detail));
      found += 1;
    }
  }
  EXPECT_EQ(found, 1);
  return detail;
}

TEST(FieldPath, NamesNestedAndRepeatedFields) {
  const FieldPath root;
  EXPECT_EQ(root.ToString(), "");
  const FieldPath reports(root, "reports", 3);
  const FieldPath fix(reports, "fix");
  EXPECT_EQ(FieldPath(fix, "position").ToString(), "reports[3].fix.position");
  EXPECT_EQ(FieldPath(root, "time").ToString(), "time");
}

TEST(Errors, InvalidFieldCarriesBadRequestAndReasonToTheClient) {
  const grpc::Status status = ToGrpc(
      InvalidField("ping.pose.depth_m", "13000 m is not in [-100, 12000]",
                   v1::REJECT_REASON_BAD_DEPTH));
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(status.error_message(),
            "ping.pose.depth_m: 13000 m is not in [-100, 12000]");
  EXPECT_EQ(Details(status).code(), 3);  // google.rpc.Code.INVALID_ARGUMENT
  EXPECT_EQ(Details(status).message(), status.error_message());
  const auto bad_request = DetailOf<google::rpc::BadRequest>(status);
  ASSERT_EQ(bad_request.field_violations_size(), 1);
  EXPECT_EQ(bad_request.field_violations(0).field(), "ping.pose.depth_m");
  EXPECT_EQ(bad_request.field_violations(0).description(),
            "13000 m is not in [-100, 12000]");
  const auto error = DetailOf<google::rpc::ErrorInfo>(status);
  EXPECT_EQ(error.reason(), "BAD_DEPTH");
  EXPECT_EQ(error.domain(), "fathom.v1");
}

TEST(Errors, ViolationOfReadsBackWhatInvalidFieldWrote) {
  EXPECT_THAT(InvalidField("a.b[2]", "is odd", v1::REJECT_REASON_BAD_STD),
              Violates("a.b[2]", v1::REJECT_REASON_BAD_STD));
  EXPECT_FALSE(ViolationOf(absl::InvalidArgumentError("plain")).has_value());
  EXPECT_FALSE(ViolationOf(QueueFull()).has_value());
}

TEST(Errors, LimitsSayWhatAndHowMuch) {
  const grpc::Status status = ToGrpc(LimitExceeded("reports", 1001, 1000));
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), HasSubstr("1001"));
  const auto error = DetailOf<google::rpc::ErrorInfo>(status);
  EXPECT_EQ(error.reason(), "LIMIT_EXCEEDED");
  EXPECT_EQ(error.metadata().at("field"), "reports");
  EXPECT_EQ(error.metadata().at("count"), "1001");
  EXPECT_EQ(error.metadata().at("limit"), "1000");
}

TEST(Errors, WhatMayPassSaysWhenToTryAgain) {
  for (const absl::Status& error :
       {TooManyCalls("imports", 4), QueueFull(), StorageFull("disk full"),
        ShuttingDown(), RevisionNotReached(7, 5)}) {
    const grpc::Status status = ToGrpc(error);
    const auto retry = DetailOf<google::rpc::RetryInfo>(status);
    EXPECT_EQ(retry.retry_delay().seconds(), 1) << status.error_message();
    EXPECT_EQ(retry.retry_delay().nanos(), 0);
  }
}

TEST(Errors, CodesAreThoseOfTheContract) {
  EXPECT_EQ(ToGrpc(StorageFull("x")).error_code(),
            grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(ToGrpc(StorageDamaged("x")).error_code(),
            grpc::StatusCode::DATA_LOSS);
  EXPECT_EQ(ToGrpc(ShuttingDown()).error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(ToGrpc(RevisionNotReached(2, 1)).error_code(),
            grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(ToGrpc(NoSuchContact("s", "c")).error_code(),
            grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(ToGrpc(HeaderMissing()).error_code(),
            grpc::StatusCode::FAILED_PRECONDITION);
}

TEST(Errors, OkHasNoDetailsAndPlainErrorsKeepTheirText) {
  EXPECT_TRUE(ToGrpc(absl::OkStatus()).ok());
  const grpc::Status status = ToGrpc(absl::NotFoundError("no leg-9"));
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(status.error_message(), "no leg-9");
  EXPECT_EQ(status.error_details(), "");
}

}  // namespace
}  // namespace fathom::server
