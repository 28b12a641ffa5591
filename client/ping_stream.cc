#include "client/ping_stream.h"

#include <grpcpp/channel.h>

#include <utility>

#include "client/sequenced_codec.h"
#include "client/sequenced_stream.h"

namespace fathom::client {
namespace {

std::optional<IngestAck> DecodeAck(grpc::ByteBuffer* bytes) {
  v1::StreamPingsResponse response;
  if (!DecodeResponse(bytes, response)) return std::nullopt;
  IngestAck ack = CommonAck(response);
  ack.messages_applied = response.pings_applied();
  ack.messages_duplicate = response.pings_duplicate();
  ack.measurements_accepted = response.measurements_accepted();
  return ack;
}

}  // namespace

class PingStream::Impl {
 public:
  explicit Impl(std::unique_ptr<SequencedStream> s) : stream(std::move(s)) {}

  const std::unique_ptr<SequencedStream> stream;
};

absl::StatusOr<std::unique_ptr<PingStream>> PingStream::Open(
    std::shared_ptr<grpc::Channel> channel,
    const IngestStreamOptions& options) {
  auto stream = SequencedStream::Open(std::move(channel),
                                      "/fathom.v1.IngestService/StreamPings",
                                      options, DecodeAck);
  if (!stream.ok()) return stream.status();
  return std::unique_ptr<PingStream>(
      new PingStream(std::make_unique<Impl>(*std::move(stream))));
}

PingStream::PingStream(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PingStream::~PingStream() = default;

absl::StatusOr<std::uint64_t> PingStream::Send(v1::Ping& ping) {
  return impl_->stream->Send([&](std::uint64_t epoch, std::uint64_t sequence) {
    ping.set_source_id(impl_->stream->source_id());
    ping.set_epoch(epoch);
    ping.set_sequence(sequence);
    return EncodeInField<v1::StreamPingsRequest::kPingFieldNumber>(ping);
  });
}

absl::Status PingStream::Flush() { return impl_->stream->Flush(); }

absl::Status PingStream::WaitApplied(std::uint64_t sequence) {
  return impl_->stream->WaitApplied(sequence);
}

absl::Status PingStream::Finish() { return impl_->stream->Finish(); }

absl::Status PingStream::Reconnect() { return impl_->stream->Reconnect(); }

IngestProgress PingStream::progress() const {
  return impl_->stream->progress();
}

}  // namespace fathom::client
