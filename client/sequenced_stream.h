// What PingStream and ContactStream share: a bidirectional gRPC stream of
// numbered, encoded messages with acknowledgements, a bounded resend buffer
// and resumption after cuts. Internal to client/.
//
// Messages travel as bytes: a message is encoded once, into a reference
// counted slice that both the connection and the resend buffer hold, and a
// resend costs no second encoding.
//
// Writing: gRPC takes one write at a time. Send puts a message into the
// buffer and starts a write if none is under way; the end of each write
// starts the next. While more messages wait, writes carry gRPC's buffer hint,
// so that they leave in one packet; the last one never does, so nothing
// lingers.
//
// Threads: callers' threads enter Send, Flush and the rest and wait there;
// gRPC's threads enter Connection's On... methods, which never wait. A call
// that finds the connection ended makes the next one; there is no thread of
// our own.
//
// Lock order: send_mutex_ (numbers and encodes, held across a wait for room)
// before mutex_ (all state). No gRPC call is made with mutex_ held.

#ifndef FATHOM_CLIENT_SEQUENCED_STREAM_H_
#define FATHOM_CLIENT_SEQUENCED_STREAM_H_

#include <grpcpp/channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/slice.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/mutex.h"
#include "client/ingest_progress.h"
#include "client/resend_buffer.h"
#include "fathom/v1/types.pb.h"

namespace fathom::client {

// Largest message that Send takes: gRPC's default receive limit.
inline constexpr std::size_t kMaxIngestMessageBytes = 4u << 20;

// `epoch`, or for 0 the wall clock's microseconds (IngestStreamOptions::epoch).
std::uint64_t EpochOrNow(std::uint64_t epoch);

// An acknowledgement of either stream, decoded.
struct IngestAck {
  std::uint64_t epoch = 0;
  std::uint64_t applied_sequence = 0;
  std::uint64_t durable_sequence = 0;
  std::uint64_t map_revision = 0;
  std::uint64_t messages_applied = 0;
  std::uint64_t messages_duplicate = 0;
  std::uint64_t measurements_accepted = 0;
  std::vector<v1::RejectCount> rejects;
  std::vector<v1::Rejection> rejections;
  std::vector<v1::SequenceGap> gaps;
};

class SequencedStream {
 public:
  // Encodes the caller's message under the given epoch and number.
  using Encoder =
      std::function<grpc::Slice(std::uint64_t epoch, std::uint64_t sequence)>;
  // Decodes an answer; nullopt: not a message of the contract.
  using AckDecoder = std::optional<IngestAck> (*)(grpc::ByteBuffer* bytes);

  // Opens a stream of `method` ("/package.Service/Method"). Errors:
  // INVALID_ARGUMENT for options out of range.
  static absl::StatusOr<std::unique_ptr<SequencedStream>> Open(
      std::shared_ptr<grpc::Channel> channel, std::string method,
      const IngestStreamOptions& options, AckDecoder decode_ack);

  ~SequencedStream();
  SequencedStream(const SequencedStream&) = delete;
  SequencedStream& operator=(const SequencedStream&) = delete;

  const std::string& source_id() const { return options_.source_id; }

  // See PingStream. `encode` is called once, on this thread.
  absl::StatusOr<std::uint64_t> Send(const Encoder& encode);
  absl::Status Flush();
  absl::Status WaitApplied(std::uint64_t sequence);
  absl::Status Finish();
  absl::Status Reconnect();
  IngestProgress progress() const;

 private:
  class Connection;
  friend class Connection;
  using SteadyTime = std::chrono::steady_clock::time_point;

  SequencedStream(std::shared_ptr<grpc::Channel> channel, std::string method,
                  const IngestStreamOptions& options, AckDecoder decode_ack);

  // Makes a new connection that begins behind durable_sequence.
  void StartConnection() FATHOM_EXCLUDES(mutex_);
  // Takes an ack in; the caller notifies.
  void Apply(const IngestAck& ack) FATHOM_REQUIRES(mutex_);
  // Waits until `done` (called with mutex_ held), across cuts if `resume`.
  absl::Status WaitUntil(const std::function<bool()>& done)
      FATHOM_REQUIRES(mutex_);
  // Replaces an ended connection. Releases mutex_ meanwhile.
  absl::Status Resume(SteadyTime deadline) FATHOM_REQUIRES(mutex_);
  bool ConnectionUp() const FATHOM_REQUIRES(mutex_);

  const std::shared_ptr<grpc::Channel> channel_;
  const std::string method_;
  const IngestStreamOptions options_;
  const std::uint64_t epoch_;
  const AckDecoder decode_ack_;
  grpc::GenericStub stub_;

  Mutex send_mutex_;
  std::uint64_t next_sequence_ FATHOM_GUARDED_BY(send_mutex_);

  mutable Mutex mutex_;
  CondVar changed_;
  ResendBuffer<grpc::ByteBuffer> buffer_ FATHOM_GUARDED_BY(mutex_);
  // Shared with a caller that is about to start a write on it.
  std::shared_ptr<Connection> connection_ FATHOM_GUARDED_BY(mutex_);
  // Someone is replacing the connection.
  bool resuming_ FATHOM_GUARDED_BY(mutex_) = false;
  // Connections that ended without having brought an ack, in a row.
  int fruitless_connections_ FATHOM_GUARDED_BY(mutex_) = 0;
  // Why the last connection ended; OK while none has.
  absl::Status cut_ FATHOM_GUARDED_BY(mutex_);
  // Set when resending cannot help.
  absl::Status permanent_ FATHOM_GUARDED_BY(mutex_);
  bool finishing_ FATHOM_GUARDED_BY(mutex_) = false;
  std::optional<absl::Status> finished_ FATHOM_GUARDED_BY(mutex_);
  // The sums of ended connections, and the last ack of the present one.
  IngestProgress progress_ FATHOM_GUARDED_BY(mutex_);
  IngestAck last_ack_ FATHOM_GUARDED_BY(mutex_);
};

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_SEQUENCED_STREAM_H_
