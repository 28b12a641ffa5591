#include "client/contact_stream.h"

#include <grpcpp/channel.h>

#include <utility>

#include "client/sequenced_codec.h"
#include "client/sequenced_stream.h"

namespace fathom::client {
namespace {

std::optional<IngestAck> DecodeAck(grpc::ByteBuffer* bytes) {
  v1::StreamContactsResponse response;
  if (!DecodeResponse(bytes, response)) return std::nullopt;
  IngestAck ack = CommonAck(response);
  ack.messages_applied = response.reports_applied();
  ack.messages_duplicate = response.reports_duplicate();
  return ack;
}

}  // namespace

class ContactStream::Impl {
 public:
  explicit Impl(std::unique_ptr<SequencedStream> s) : stream(std::move(s)) {}

  const std::unique_ptr<SequencedStream> stream;
};

absl::StatusOr<std::unique_ptr<ContactStream>> ContactStream::Open(
    std::shared_ptr<grpc::Channel> channel,
    const IngestStreamOptions& options) {
  auto stream = SequencedStream::Open(std::move(channel),
                                      "/fathom.v1.IngestService/StreamContacts",
                                      options, DecodeAck);
  if (!stream.ok()) return stream.status();
  return std::unique_ptr<ContactStream>(
      new ContactStream(std::make_unique<Impl>(*std::move(stream))));
}

ContactStream::ContactStream(std::unique_ptr<Impl> impl)
    : impl_(std::move(impl)) {}
ContactStream::~ContactStream() = default;

absl::StatusOr<std::uint64_t> ContactStream::Send(v1::ContactReport& report) {
  return impl_->stream->Send([&](std::uint64_t epoch, std::uint64_t sequence) {
    report.set_source_id(impl_->stream->source_id());
    report.set_epoch(epoch);
    report.set_sequence(sequence);
    return EncodeInField<v1::StreamContactsRequest::kReportFieldNumber>(report);
  });
}

absl::Status ContactStream::Flush() { return impl_->stream->Flush(); }

absl::Status ContactStream::WaitApplied(std::uint64_t sequence) {
  return impl_->stream->WaitApplied(sequence);
}

absl::Status ContactStream::Finish() { return impl_->stream->Finish(); }

absl::Status ContactStream::Reconnect() { return impl_->stream->Reconnect(); }

IngestProgress ContactStream::progress() const {
  return impl_->stream->progress();
}

}  // namespace fathom::client
