#include "client/errors.h"

#include <google/protobuf/any.pb.h>

#include <cstdint>
#include <utility>

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "absl/types/optional.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace fathom::client {
namespace {

constexpr char kBadRequestUrl[] = "type.googleapis.com/google.rpc.BadRequest";
constexpr char kRetryInfoUrl[] = "type.googleapis.com/google.rpc.RetryInfo";

template <typename Detail>
std::optional<Detail> Payload(const absl::Status& status, const char* url) {
  const absl::optional<absl::Cord> payload = status.GetPayload(url);
  Detail detail;
  if (!payload.has_value() || !detail.ParseFromString(std::string(*payload))) {
    return std::nullopt;
  }
  return detail;
}

}  // namespace

absl::Status FromGrpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  std::string message = status.error_message();
  google::rpc::Status rich;
  if (!status.error_details().empty() &&
      !rich.ParseFromString(status.error_details())) {
    rich.Clear();
  }
  for (const google::protobuf::Any& detail : rich.details()) {
    google::rpc::BadRequest bad_request;
    if (!detail.Is<google::rpc::BadRequest>() ||
        !detail.UnpackTo(&bad_request)) {
      continue;
    }
    for (const auto& violation : bad_request.field_violations()) {
      if (message.find(violation.field()) == std::string::npos) {
        absl::StrAppend(&message, " [", violation.field(), ": ",
                        violation.description(), "]");
      }
    }
  }
  // The canonical codes are the same numbers in gRPC and in Abseil.
  absl::Status result(static_cast<absl::StatusCode>(status.error_code()),
                      message);
  for (const google::protobuf::Any& detail : rich.details()) {
    result.SetPayload(detail.type_url(), absl::Cord(detail.value()));
  }
  return result;
}

std::vector<FieldError> FieldErrors(const absl::Status& status) {
  std::vector<FieldError> errors;
  const auto bad_request =
      Payload<google::rpc::BadRequest>(status, kBadRequestUrl);
  if (!bad_request.has_value()) return errors;
  for (const auto& violation : bad_request->field_violations()) {
    errors.push_back({violation.field(), violation.description()});
  }
  return errors;
}

std::optional<std::chrono::milliseconds> RetryDelay(
    const absl::Status& status) {
  const auto info = Payload<google::rpc::RetryInfo>(status, kRetryInfoUrl);
  if (!info.has_value() || !info->has_retry_delay()) return std::nullopt;
  const std::int64_t milliseconds = info->retry_delay().seconds() * 1000 +
                                    info->retry_delay().nanos() / 1'000'000;
  return std::chrono::milliseconds(milliseconds);
}

bool MayMend(absl::StatusCode code) {
  switch (code) {
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kResourceExhausted:  // Storage full: waits for room.
    case absl::StatusCode::kDataLoss:  // Damaged: waits for the repaired one.
    case absl::StatusCode::kAborted:
    case absl::StatusCode::kCancelled:  // By Reconnect, or by a dying server.
    case absl::StatusCode::kInternal:   // RST_STREAM of a dying server.
    case absl::StatusCode::kUnknown:
      return true;
    default:
      return false;
  }
}

}  // namespace fathom::client
