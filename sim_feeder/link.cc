#include "sim_feeder/link.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <optional>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/buffered_stream.h"

namespace fathom::feeder {
namespace {

// Both streams of a source through its buffer on disk.
class BufferedSink final : public MessageSink {
 public:
  static absl::StatusOr<std::unique_ptr<MessageSink>> Open(
      const client::Client& client, const client::IngestStreamOptions& options,
      const client::BufferOptions& buffer) {
    std::unique_ptr<BufferedSink> sink(new BufferedSink());
    FATHOM_ASSIGN_OR_RETURN(sink->pings_, client::BufferedPingStream::Open(
                                              client, options, buffer));
    FATHOM_ASSIGN_OR_RETURN(sink->reports_, client::BufferedContactStream::Open(
                                                client, options, buffer));
    return sink;
  }

  absl::Status SendPing(v1::Ping& ping) override {
    return pings_->Send(ping).status();
  }
  absl::Status SendReport(v1::ContactReport& report) override {
    return reports_->Send(report).status();
  }
  absl::Status Finish() override {
    const absl::Status pings = pings_->Finish();
    const absl::Status reports = reports_->Finish();
    return pings.ok() ? reports : pings;
  }
  SinkState State() const override {
    SinkState state;
    Add(*pings_, state.pings, state);
    Add(*reports_, state.reports, state);
    return state;
  }

 private:
  BufferedSink() = default;

  template <typename Stream>
  static void Add(const Stream& stream, client::IngestProgress& progress,
                  SinkState& state) {
    progress = stream.progress();
    const client::BufferState buffer = stream.state();
    // Of this run alone: a buffer's numbering may have begun before it.
    for (std::uint64_t* count :
         {&progress.sent_sequence, &progress.durable_sequence,
          &progress.applied_sequence}) {
      *count -= std::min(*count, buffer.last_before);
    }
    state.buffered += buffer.waiting;
    state.dropped += buffer.dropped;
  }

  std::unique_ptr<client::BufferedPingStream> pings_;
  std::unique_ptr<client::BufferedContactStream> reports_;
};

client::IngestStreamOptions StreamOptions(const LinkOptions& link) {
  client::IngestStreamOptions options;
  options.source_id = link.source_id;
  options.epoch = link.epoch;
  options.patience = std::chrono::duration_cast<std::chrono::milliseconds>(
      std::chrono::duration<double>(link.patience_s));
  return options;
}

// Sends one kind; how many it found.
template <typename Message>
absl::StatusOr<std::uint64_t> SendKind(const client::Client& client,
                                       const LinkOptions& link,
                                       const client::BufferOptions& buffer) {
  FATHOM_ASSIGN_OR_RETURN(const auto stream,
                          client::BufferedStream<Message>::Open(
                              client, StreamOptions(link), buffer));
  const std::uint64_t found = stream->state().waiting;
  FATHOM_RETURN_IF_ERROR(stream->Finish());
  return found;
}

}  // namespace

absl::StatusOr<std::unique_ptr<client::Client>> Connect(const LinkOptions& link,
                                                        bool may_be_away) {
  client::ClientOptions options;
  FATHOM_ASSIGN_OR_RETURN(options.credentials,
                          client::TlsCredentials(link.tls));
  if (may_be_away) options.connect_timeout = std::chrono::milliseconds(0);
  return client::Client::Connect(link.server, options);
}

absl::StatusOr<std::unique_ptr<MessageSink>> OpenSink(
    const client::Client& client, const LinkOptions& link, bool paced) {
  if (link.buffer.empty()) {
    return StreamSink::Open(client, StreamOptions(link));
  }
  return BufferedSink::Open(client, StreamOptions(link),
                            {.folder = link.buffer,
                             .max_bytes = link.buffer_mib << 20,
                             .drop_when_full = paced});
}

absl::Status SendBuffered(LinkOptions link) {
  // The buffer's own.
  link.source_id.clear();
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<client::Client> client,
                          Connect(link));
  const client::BufferOptions buffer = {.folder = link.buffer};
  const absl::StatusOr<std::uint64_t> pings =
      SendKind<v1::Ping>(*client, link, buffer);
  if (!pings.ok() && !absl::IsNotFound(pings.status())) return pings.status();
  const absl::StatusOr<std::uint64_t> reports =
      SendKind<v1::ContactReport>(*client, link, buffer);
  if (!reports.ok() && !(absl::IsNotFound(reports.status()) && pings.ok())) {
    return reports.status();
  }
  absl::FPrintF(stderr, "sent %d pings and %d reports of the buffer %s\n",
                pings.value_or(0), reports.value_or(0), link.buffer);
  return absl::OkStatus();
}

}  // namespace fathom::feeder
