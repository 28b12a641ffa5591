// A numbered stream of contact reports that survives cuts: PingStream's
// promises and methods (ping_stream.h), for reports about moving obstacles.
//
// Thread safety: as PingStream.

#ifndef FATHOM_CLIENT_CONTACT_STREAM_H_
#define FATHOM_CLIENT_CONTACT_STREAM_H_

#include <cstdint>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/ingest_progress.h"
#include "fathom/v1/ingest_service.pb.h"

namespace grpc {
class Channel;
}  // namespace grpc

namespace fathom::client {

class ContactStream {
 public:
  // Use Client::OpenContactStream.
  static absl::StatusOr<std::unique_ptr<ContactStream>> Open(
      std::shared_ptr<grpc::Channel> channel,
      const IngestStreamOptions& options);

  // Cancels what is on the way; call Finish first to lose nothing.
  ~ContactStream();
  ContactStream(const ContactStream&) = delete;
  ContactStream& operator=(const ContactStream&) = delete;

  // Numbers `report` (writes its source_id, epoch and sequence), sends it and
  // returns its number. Errors as PingStream::Send.
  absl::StatusOr<std::uint64_t> Send(v1::ContactReport& report);

  // Waits until every report sent so far is durable.
  absl::Status Flush();

  // Waits until report `sequence` is visible to queries.
  absl::Status WaitApplied(std::uint64_t sequence);

  // Flushes, ends the stream and returns how the server ended it.
  absl::Status Finish();

  // Connects anew and resends from durable_sequence + 1.
  absl::Status Reconnect();

  // What the acks said so far.
  IngestProgress progress() const;

 private:
  class Impl;
  explicit ContactStream(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_CONTACT_STREAM_H_
