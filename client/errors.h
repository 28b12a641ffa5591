// From a gRPC status to an absl::Status that tells a person what to change.
//
// The server puts google.rpc details into the status (BadRequest with field
// paths, ErrorInfo, RetryInfo). Their field paths are added to the message,
// and the details are kept as payloads under their type URLs. Thread-safe.

#ifndef FATHOM_CLIENT_ERRORS_H_
#define FATHOM_CLIENT_ERRORS_H_

#include <grpcpp/support/status.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace fathom::client {

// One field that the server refused.
struct FieldError {
  // Path from the request, e.g. "parameters.south_west.latitude_deg".
  std::string field;
  // What was wrong and what to do.
  std::string description;
};

// The same code and message, plus one " [field: description]" for each field
// violation whose path the message does not name already.
absl::Status FromGrpc(const grpc::Status& status);

// The fields that the server named in the status; empty: none.
std::vector<FieldError> FieldErrors(const absl::Status& status);

// When the server asks to try again (google.rpc.RetryInfo), if it does.
std::optional<std::chrono::milliseconds> RetryDelay(const absl::Status& status);

// Whether a stream that ended so is worth a new connection: the server is
// away, or full, or is going down, or waits for its mission to be repaired.
bool MayMend(absl::StatusCode code);

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_ERRORS_H_
