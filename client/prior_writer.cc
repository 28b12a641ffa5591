#include "client/prior_writer.h"

#include "base/status_macros.h"
#include "client/errors.h"

namespace fathom::client {

std::unique_ptr<PriorWriter> PriorWriter::Open(
    v1::MissionService::Stub& stub, const v1::PriorHeader& header,
    std::chrono::milliseconds timeout) {
  std::unique_ptr<PriorWriter> writer(new PriorWriter());
  writer->context_.set_deadline(std::chrono::system_clock::now() + timeout);
  writer->writer_ = stub.ImportPrior(&writer->context_, &writer->response_);
  *writer->request_.mutable_header() = header;
  // A refused header shows with the next call.
  writer->writer_->Write(writer->request_);
  return writer;
}

PriorWriter::~PriorWriter() {
  if (final_.has_value()) return;
  context_.TryCancel();
  writer_->Finish().IgnoreError();
}

absl::Status PriorWriter::Write(const v1::DepthTile& tile) {
  if (!final_.has_value()) {
    *request_.mutable_tile() = tile;
    if (writer_->Write(request_)) return absl::OkStatus();
    final_ = FromGrpc(writer_->Finish());
    if (final_->ok()) {
      final_ = absl::InternalError("the server ended the import early");
    }
  }
  return *final_;
}

absl::StatusOr<v1::ImportPriorResponse> PriorWriter::Finish() {
  if (final_.has_value()) {
    if (!final_->ok()) return *final_;
    return absl::FailedPreconditionError("the import was finished");
  }
  writer_->WritesDone();
  final_ = FromGrpc(writer_->Finish());
  FATHOM_RETURN_IF_ERROR(*final_);
  return response_;
}

}  // namespace fathom::client
