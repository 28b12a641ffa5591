// A numbered stream that goes on while the server is away: messages are kept
// on disk (spool.h) and sent from there, in order, by a thread of its own.
//
//   FATHOM_ASSIGN_OR_RETURN(
//       auto stream, BufferedStream<v1::Ping>::Open(
//                        *client, {.source_id = "uuv-1"},
//                        {.folder = "/var/lib/uuv/outbox"}));
//   FATHOM_RETURN_IF_ERROR(stream->Send(ping).status());   // no server needed
//   FATHOM_RETURN_IF_ERROR(stream->Finish());              // here it is
//
// Nothing is lost and nothing counted twice, whoever dies: the numbers are in
// the files, the server knows how far it is durable, and what it has not is
// sent again. A buffer that an earlier process left behind is sent first, and
// new messages go on in its numbering.
//
// A power cut at the sender loses what came since the last sync, a second's at
// most. No message is sent before it is synced: its number would be given
// again, and the server would take the next message for it. One sync serves
// all that wait, and no caller waits for it.
//
// A full buffer: the caller says whether Send waits for room (a recording can
// wait) or drops the new message and counts it (the sea does not). What was
// taken is never dropped.
//
// Thread safety: all methods may be called from several threads.
// Lock order: none other is taken with mutex_; no call on the stream is made
// with it.

#ifndef FATHOM_CLIENT_BUFFERED_STREAM_H_
#define FATHOM_CLIENT_BUFFERED_STREAM_H_

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/mutex.h"
#include "client/client.h"
#include "client/contact_stream.h"
#include "client/ingest_progress.h"
#include "client/ping_stream.h"
#include "client/spool.h"
#include "fathom/v1/ingest_service.pb.h"

namespace fathom::client {

struct BufferOptions {
  // Pings and reports of one source share a folder.
  std::string folder = {};
  // Of pings, and of reports, each; at least kLeastSpoolBytes.
  std::uint64_t max_bytes = 256u << 20;
  // A full buffer: false: Send waits, as long as IngestStreamOptions::patience
  // without any room; true: the message is dropped and counted.
  bool drop_when_full = false;
};

struct BufferState {
  // Taken and not yet known to be durable at the server.
  std::uint64_t waiting = 0;
  // The last number that an earlier process gave.
  std::uint64_t last_before = 0;
  // On disk.
  std::uint64_t bytes = 0;
  // Messages that found no room.
  std::uint64_t dropped = 0;
  // How the link is: OK, or why nothing is sent.
  absl::Status link = absl::OkStatus();
};

// `Message` is v1::Ping or v1::ContactReport.
template <typename Message>
class BufferedStream {
 public:
  // `options.epoch` 0, and options.first_sequence, count for nothing once the
  // buffer has numbers of its own. An empty source_id: that of the buffer,
  // which must be there. The server need not be. Errors: as Spool::Open.
  static absl::StatusOr<std::unique_ptr<BufferedStream>> Open(
      const Client& client, IngestStreamOptions options,
      const BufferOptions& buffer);

  // Stops sending; what was taken stays in the buffer.
  ~BufferedStream();
  BufferedStream(const BufferedStream&) = delete;
  BufferedStream& operator=(const BufferedStream&) = delete;

  // Takes the message (and numbers it); false: it was dropped. Errors: those
  // of the server that no patience mends; DATA_LOSS (disk); without
  // drop_when_full: UNAVAILABLE when no room came for `patience`,
  // RESOURCE_EXHAUSTED (full disk).
  absl::StatusOr<bool> Send(Message& message);

  // Waits until the server has everything; nothing can be sent afterwards.
  // Errors: as Send; UNAVAILABLE when the server made nothing more durable for
  // `patience`: what it has not stays in the buffer, and the message says how
  // much and why.
  absl::Status Finish();

  IngestProgress progress() const;
  BufferState state() const;

 private:
  using Stream = std::conditional_t<std::is_same_v<Message, v1::Ping>,
                                    PingStream, ContactStream>;

  BufferedStream(std::unique_ptr<Spool> spool, std::unique_ptr<Stream> stream,
                 const IngestStreamOptions& options,
                 const BufferOptions& buffer);

  // The thread: until stop_, or an error that no patience mends.
  void Pump();
  // One step of it: sends the next message, or waits for one. Takes the lock.
  void Step(Message& message, bool& holds);
  // Notes how a call on the stream ended.
  void Note(const absl::Status& status) FATHOM_REQUIRES(mutex_);
  // What the server has, everything up to `durable`, leaves the buffer.
  void ReleaseDurable(std::uint64_t durable) FATHOM_REQUIRES(mutex_);
  // Syncs for the next message that is sent, or when it is time to.
  absl::Status SyncInTime(bool holds) FATHOM_REQUIRES(mutex_);
  // This ends everything.
  void Fail(const absl::Status& status) FATHOM_REQUIRES(mutex_);
  // Waits until `done`, as long as the server goes on making things durable.
  absl::Status WaitUntil(const std::function<bool()>& done)
      FATHOM_REQUIRES(mutex_);

  const BufferOptions options_;
  const std::chrono::milliseconds patience_;
  // Used by the thread alone but for progress().
  const std::unique_ptr<Stream> stream_;

  mutable Mutex mutex_;
  // To the thread: a message came, or stop. To callers: room, or an end.
  CondVar come_;
  CondVar gone_;
  const std::unique_ptr<Spool> spool_ FATHOM_PT_GUARDED_BY(mutex_);
  const std::uint64_t last_before_;
  // Everything up to this number is the server's.
  std::uint64_t durable_ FATHOM_GUARDED_BY(mutex_) = 0;
  // The last one that the stream took.
  std::uint64_t sent_ FATHOM_GUARDED_BY(mutex_) = 0;
  std::uint64_t dropped_ FATHOM_GUARDED_BY(mutex_) = 0;
  absl::Status link_ FATHOM_GUARDED_BY(mutex_);
  // What ends everything.
  absl::Status failed_ FATHOM_GUARDED_BY(mutex_);
  bool finished_ FATHOM_GUARDED_BY(mutex_) = false;
  bool stop_ FATHOM_GUARDED_BY(mutex_) = false;
  std::chrono::steady_clock::time_point synced_ FATHOM_GUARDED_BY(mutex_);
  // The thread's: messages since it looked at what is durable.
  int since_look_ = 0;
  std::thread thread_;
};

using BufferedPingStream = BufferedStream<v1::Ping>;
using BufferedContactStream = BufferedStream<v1::ContactReport>;

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_BUFFERED_STREAM_H_
