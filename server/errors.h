// Every error that a client can see, as a named function.
//
// Inside the server an error is an absl::Status whose payloads are serialised
// google.rpc messages, keyed by their type URL: BadRequest (which field),
// ErrorInfo (a machine-readable reason in the domain "fathom.v1"), RetryInfo.
// ToGrpc turns it into a grpc::Status with the same code and message and with
// the payloads as a google.rpc.Status in `grpc-status-details-bin`, which the
// client libraries of every language decode.
//
// A message says name=value with unit and what to do. Thread-safe.

#ifndef FATHOM_SERVER_ERRORS_H_
#define FATHOM_SERVER_ERRORS_H_

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "fathom/v1/types.pb.h"
#include "grpcpp/support/status.h"

namespace fathom::server {

// Domain of our ErrorInfo details.
inline constexpr char kErrorDomain[] = "fathom.v1";

// INVALID_ARGUMENT for one field. `path` is the field's path in the request
// ("reports[3].time"); `description` says what is wrong with which value.
// `reason` is what a stream's Rejection says. BadRequest + ErrorInfo.
absl::Status InvalidField(
    std::string_view path, std::string_view description,
    v1::RejectReason reason = v1::REJECT_REASON_INVALID_MESSAGE);

// RESOURCE_EXHAUSTED: `path` holds `count` items, more than `limit`.
// ErrorInfo LIMIT_EXCEEDED with the metadata field, count and limit.
absl::Status LimitExceeded(std::string_view path, uint64_t count,
                           uint64_t limit);

// RESOURCE_EXHAUSTED: to answer for the field at `path` more than `limit` cells
// would have to be read. ErrorInfo LIMIT_EXCEEDED with the metadata field and
// limit.
absl::Status TooManyCells(std::string_view path, uint64_t limit);

// RESOURCE_EXHAUSTED: too many calls of this kind at once. RetryInfo.
absl::Status TooManyCalls(std::string_view kind, uint64_t limit);

// RESOURCE_EXHAUSTED: the writer's queue is full. RetryInfo.
absl::Status QueueFull();

// RESOURCE_EXHAUSTED: the mission file takes no more (`fault` says why);
// queries go on. RetryInfo.
absl::Status StorageFull(std::string_view fault);

// DATA_LOSS: the mission file is damaged where it is to be written (`fault`
// says where and what to do); queries go on.
absl::Status StorageDamaged(std::string_view fault);

// UNAVAILABLE: the server is shutting down. RetryInfo.
absl::Status ShuttingDown();

// UNAVAILABLE: `min_revision` was not reached in time; `revision` was.
// RetryInfo.
absl::Status RevisionNotReached(uint64_t min_revision, uint64_t revision);

// NOT_FOUND: no contact of this source with this id.
absl::Status NoSuchContact(std::string_view source_id,
                           std::string_view contact_id);

// FAILED_PRECONDITION: the first message of an import is not a header.
absl::Status HeaderMissing();

// What BadRequest and ErrorInfo of an InvalidField say.
struct FieldViolation {
  std::string path;
  std::string description;
  v1::RejectReason reason = v1::REJECT_REASON_INVALID_MESSAGE;
};

// The violation in `status`; nullopt if it is not from InvalidField.
std::optional<FieldViolation> ViolationOf(const absl::Status& status);

// See file comment. Costs nothing for OK.
grpc::Status ToGrpc(const absl::Status& status);

}  // namespace fathom::server

#endif  // FATHOM_SERVER_ERRORS_H_
