// Where the messages of a run go: a live server, or a file.
//
// StreamSink uses the client's numbered streams (pings and reports apart).
// RecordSink writes a file of length-delimited fathom.v1.Ping and
// fathom.v1.ContactReport messages, for tests and for those without a server.
// Not thread-safe.

#ifndef FATHOM_SIM_FEEDER_MESSAGE_SINK_H_
#define FATHOM_SIM_FEEDER_MESSAGE_SINK_H_

#include <cstdint>
#include <fstream>
#include <map>
#include <memory>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/client.h"
#include "client/ingest_progress.h"
#include "fathom/v1/ingest_service.pb.h"

namespace fathom::feeder {

// What became of the messages so far.
struct SinkState {
  client::IngestProgress pings;
  client::IngestProgress reports;
  // With a buffer on disk: what it holds that the server is not known to have,
  // and what found no room in it.
  std::uint64_t buffered = 0;
  std::uint64_t dropped = 0;
};

// What was refused, by reason (proto names without prefix).
std::map<std::string, std::uint64_t> RejectCounts(
    const client::IngestProgress& progress);
std::map<std::string, std::uint64_t> RejectCounts(
    std::span<const v1::RejectCount> rejects);

// The same of both for a progress bar: "  GATED 12  STALE 1" or "  no rejects",
// and what the buffer holds.
std::string RejectNote(const SinkState& state);

class MessageSink {
 public:
  MessageSink() = default;
  MessageSink(const MessageSink&) = delete;
  MessageSink& operator=(const MessageSink&) = delete;
  virtual ~MessageSink() = default;

  // Sends one message; may number it (writes source, epoch, sequence).
  // Errors: those of the streams or the file.
  virtual absl::Status SendPing(v1::Ping& ping) = 0;
  virtual absl::Status SendReport(v1::ContactReport& report) = 0;

  // Waits until everything sent is safe; nothing can be sent afterwards.
  virtual absl::Status Finish() = 0;

  virtual SinkState State() const = 0;
};

class StreamSink final : public MessageSink {
 public:
  // Opens both streams. The contact stream is opened with the first report.
  // Errors: as Client::OpenPingStream.
  static absl::StatusOr<std::unique_ptr<StreamSink>> Open(
      const client::Client& client, const client::IngestStreamOptions& options);

  absl::Status SendPing(v1::Ping& ping) override;
  absl::Status SendReport(v1::ContactReport& report) override;
  absl::Status Finish() override;
  SinkState State() const override;

 private:
  StreamSink(const client::Client& client,
             const client::IngestStreamOptions& options,
             std::unique_ptr<client::PingStream> pings);

  const client::Client& client_;
  const client::IngestStreamOptions options_;
  std::unique_ptr<client::PingStream> pings_;
  std::unique_ptr<client::ContactStream> reports_;
};

class RecordSink final : public MessageSink {
 public:
  // Writes pings to `pings_path` and reports to `reports_path`; an empty path
  // drops them. Every message is numbered from 1 in epoch 1. Errors:
  // PERMISSION_DENIED when a file cannot be written.
  static absl::StatusOr<std::unique_ptr<RecordSink>> Open(
      const std::string& pings_path, const std::string& reports_path,
      const std::string& source_id);

  absl::Status SendPing(v1::Ping& ping) override;
  absl::Status SendReport(v1::ContactReport& report) override;
  absl::Status Finish() override;
  SinkState State() const override { return state_; }

 private:
  explicit RecordSink(const std::string& source_id) : source_id_(source_id) {}

  const std::string source_id_;
  std::ofstream pings_;
  std::ofstream reports_;
  SinkState state_;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_MESSAGE_SINK_H_
