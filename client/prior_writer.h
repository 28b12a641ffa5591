// Loads an a-priori chart: a header, then tiles, then one answer when all of
// it is durable (MissionService.ImportPrior).
//
//   FATHOM_ASSIGN_OR_RETURN(auto writer, client->ImportPrior(header));
//   for (...) { FATHOM_RETURN_IF_ERROR(writer->Write(tile)); }
//   FATHOM_ASSIGN_OR_RETURN(v1::ImportPriorResponse done, writer->Finish());
//
// With header.import_id it may break off anywhere: Client::GetImport tells
// which tile the mission holds last; begin again with header.first_tile one
// above it.
//
// Thread safety: one thread at a time.

#ifndef FATHOM_CLIENT_PRIOR_WRITER_H_
#define FATHOM_CLIENT_PRIOR_WRITER_H_

#include <grpcpp/client_context.h>
#include <grpcpp/support/sync_stream.h>

#include <chrono>
#include <memory>
#include <optional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "fathom/v1/mission_service.grpc.pb.h"

namespace fathom::client {

class PriorWriter {
 public:
  // Use Client::ImportPrior. `timeout` bounds the whole import.
  static std::unique_ptr<PriorWriter> Open(v1::MissionService::Stub& stub,
                                           const v1::PriorHeader& header,
                                           std::chrono::milliseconds timeout);

  // Cancels an import that was not finished.
  ~PriorWriter();
  PriorWriter(const PriorWriter&) = delete;
  PriorWriter& operator=(const PriorWriter&) = delete;

  // Sends one tile; waits while the server's window is full. An error is the
  // one that ended the import (INVALID_ARGUMENT with the field's path,
  // RESOURCE_EXHAUSTED, ...): what was sent before may have been applied
  // (with an import_id GetImport tells).
  absl::Status Write(const v1::DepthTile& tile);

  // Ends the chart and waits for the server's summary. Errors: as Write;
  // FAILED_PRECONDITION when called twice.
  absl::StatusOr<v1::ImportPriorResponse> Finish();

 private:
  PriorWriter() = default;

  grpc::ClientContext context_;
  v1::ImportPriorRequest request_;
  v1::ImportPriorResponse response_;
  std::unique_ptr<grpc::ClientWriter<v1::ImportPriorRequest>> writer_;
  std::optional<absl::Status> final_;  // Set once the call has ended.
};

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_PRIOR_WRITER_H_
