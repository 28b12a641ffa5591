#include "server/errors.h"

#include <initializer_list>
#include <utility>

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "server/limits.h"

namespace fathom::server {
namespace {

constexpr char kTypeUrlPrefix[] = "type.googleapis.com/";
constexpr std::string_view kRejectReasonPrefix = "REJECT_REASON_";

template <typename Detail>
absl::string_view TypeUrl() {
  static const std::string* const url =
      new std::string(kTypeUrlPrefix + Detail::descriptor()->full_name());
  return *url;
}

template <typename Detail>
void Attach(absl::Status& status, const Detail& detail) {
  status.SetPayload(TypeUrl<Detail>(), absl::Cord(detail.SerializeAsString()));
}

template <typename Detail>
std::optional<Detail> DetailOf(const absl::Status& status) {
  const absl::optional<absl::Cord> payload =
      status.GetPayload(TypeUrl<Detail>());
  if (!payload.has_value()) return std::nullopt;
  Detail detail;
  if (!detail.ParseFromString(std::string(*payload))) return std::nullopt;
  return detail;
}

using Metadata = std::initializer_list<std::pair<const char*, std::string>>;

void AttachReason(absl::Status& status, std::string_view reason,
                  Metadata metadata = {}) {
  google::rpc::ErrorInfo error;
  error.set_reason(std::string(reason));
  error.set_domain(kErrorDomain);
  for (const auto& [key, value] : metadata) {
    (*error.mutable_metadata())[key] = value;
  }
  Attach(status, error);
}

void AttachRetry(absl::Status& status) {
  google::rpc::RetryInfo retry;
  const int64_t delay_ms = kRetryDelay.count();
  retry.mutable_retry_delay()->set_seconds(delay_ms / 1000);
  retry.mutable_retry_delay()->set_nanos(static_cast<int32_t>(delay_ms % 1000) *
                                         1'000'000);
  Attach(status, retry);
}

}  // namespace

absl::Status InvalidField(std::string_view path, std::string_view description,
                          v1::RejectReason reason) {
  absl::Status status =
      absl::InvalidArgumentError(absl::StrFormat("%s: %s", path, description));
  google::rpc::BadRequest bad_request;
  auto* violation = bad_request.add_field_violations();
  violation->set_field(std::string(path));
  violation->set_description(std::string(description));
  Attach(status, bad_request);
  // "REJECT_REASON_BAD_STD" -> "BAD_STD".
  AttachReason(status, std::string_view(v1::RejectReason_Name(reason))
                           .substr(kRejectReasonPrefix.size()));
  return status;
}

absl::Status LimitExceeded(std::string_view path, uint64_t count,
                           uint64_t limit) {
  absl::Status status = absl::ResourceExhaustedError(
      absl::StrFormat("%s: %d is more than the limit of %d; split the request",
                      path, count, limit));
  AttachReason(status, "LIMIT_EXCEEDED",
               {{"field", std::string(path)},
                {"count", absl::StrCat(count)},
                {"limit", absl::StrCat(limit)}});
  return status;
}

absl::Status TooManyCells(std::string_view path, uint64_t limit) {
  absl::Status status = absl::ResourceExhaustedError(absl::StrFormat(
      "%s: more than the limit of %d cells of the map would have to be read; "
      "ask about less of it at a time",
      path, limit));
  AttachReason(status, "LIMIT_EXCEEDED",
               {{"field", std::string(path)}, {"limit", absl::StrCat(limit)}});
  return status;
}

absl::Status TooManyCalls(std::string_view kind, uint64_t limit) {
  absl::Status status = absl::ResourceExhaustedError(absl::StrFormat(
      "already %d %s are open, the most allowed; end one first", limit, kind));
  AttachReason(status, "TOO_MANY_CALLS", {{"limit", absl::StrCat(limit)}});
  AttachRetry(status);
  return status;
}

absl::Status QueueFull() {
  absl::Status status = absl::ResourceExhaustedError(
      "the map's writer has too much work waiting; try again");
  AttachReason(status, "QUEUE_FULL");
  AttachRetry(status);
  return status;
}

absl::Status StorageFull(std::string_view fault) {
  absl::Status status = absl::ResourceExhaustedError(absl::StrFormat(
      "the mission file cannot be written, nothing new is taken until it can "
      "(queries go on): %s",
      fault));
  AttachReason(status, "STORAGE_FULL");
  AttachRetry(status);
  return status;
}

absl::Status StorageDamaged(std::string_view fault) {
  absl::Status status = absl::DataLossError(absl::StrFormat(
      "the mission file is damaged, nothing new is taken until a repaired one "
      "is served (queries go on): %s",
      fault));
  AttachReason(status, "STORAGE_DAMAGED");
  return status;
}

absl::Status ShuttingDown() {
  absl::Status status = absl::UnavailableError(
      "the server is shutting down; resend what is not durable to its "
      "successor");
  AttachReason(status, "SHUTTING_DOWN");
  AttachRetry(status);
  return status;
}

absl::Status RevisionNotReached(uint64_t min_revision, uint64_t revision) {
  absl::Status status = absl::UnavailableError(absl::StrFormat(
      "min_revision=%d was not reached in time, the map is at %d; ask again "
      "or ask for less",
      min_revision, revision));
  AttachReason(status, "REVISION_NOT_REACHED",
               {{"min_revision", absl::StrCat(min_revision)},
                {"map_revision", absl::StrCat(revision)}});
  AttachRetry(status);
  return status;
}

absl::Status NoSuchContact(std::string_view source_id,
                           std::string_view contact_id) {
  absl::Status status = absl::NotFoundError(
      absl::StrFormat("source_id=%s has reported no contact_id=%s; "
                      "ListContacts names those that it has",
                      source_id, contact_id));
  AttachReason(status, "NO_SUCH_CONTACT");
  return status;
}

absl::Status HeaderMissing() {
  absl::Status status = absl::FailedPreconditionError(
      "the first message of an import must be its header, and only the "
      "first");
  AttachReason(status, "HEADER_MISSING");
  return status;
}

std::optional<FieldViolation> ViolationOf(const absl::Status& status) {
  const auto bad_request = DetailOf<google::rpc::BadRequest>(status);
  if (!bad_request.has_value() || bad_request->field_violations_size() == 0) {
    return std::nullopt;
  }
  FieldViolation violation{
      .path = bad_request->field_violations(0).field(),
      .description = bad_request->field_violations(0).description(),
      .reason = v1::REJECT_REASON_INVALID_MESSAGE};
  if (const auto error = DetailOf<google::rpc::ErrorInfo>(status)) {
    v1::RejectReason reason;
    if (v1::RejectReason_Parse(
            absl::StrCat(std::string(kRejectReasonPrefix), error->reason()),
            &reason)) {
      violation.reason = reason;
    }
  }
  return violation;
}

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  google::rpc::Status rich;
  rich.set_code(status.raw_code());
  rich.set_message(std::string(status.message()));
  status.ForEachPayload(
      [&rich](absl::string_view type_url, const absl::Cord& payload) {
        google::protobuf::Any* any = rich.add_details();
        any->set_type_url(std::string(type_url));
        any->set_value(std::string(payload));
      });
  return grpc::Status(
      static_cast<grpc::StatusCode>(status.raw_code()), rich.message(),
      rich.details_size() == 0 ? std::string() : rich.SerializeAsString());
}

}  // namespace fathom::server
