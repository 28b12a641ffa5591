#include "client/buffered_stream.h"

#include <algorithm>
#include <string>
#include <type_traits>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/errors.h"
#include "client/sequenced_stream.h"

namespace fathom::client {
namespace {

using SteadyClock = std::chrono::steady_clock;

// How long the thread's calls wait for a server that is away: what bounds the
// destructor.
constexpr std::chrono::milliseconds kThreadPatience{500};
// What an ack costs to look at is spread over so many messages.
constexpr int kLookEvery = 256;
// With nothing to send the thread looks for acks so often.
constexpr std::chrono::milliseconds kIdleLook{5};
// At most so much is lost to a power cut.
constexpr std::chrono::seconds kSyncEvery{1};

static_assert(kMaxIngestMessageBytes <= kMostSpoolMessageBytes);

template <typename Message>
constexpr bool kIsPing = std::is_same_v<Message, v1::Ping>;

}  // namespace

template <typename Message>
absl::StatusOr<std::unique_ptr<BufferedStream<Message>>>
BufferedStream<Message>::Open(const Client& client, IngestStreamOptions options,
                              const BufferOptions& buffer) {
  SpoolOptions on_disk = {.folder = buffer.folder,
                          .kind = kIsPing<Message> ? "pings" : "reports",
                          .source_id = options.source_id,
                          .epoch = EpochOrNow(options.epoch),
                          .max_bytes = buffer.max_bytes};
  FATHOM_ASSIGN_OR_RETURN(std::unique_ptr<Spool> spool, Spool::Open(on_disk));
  IngestStreamOptions of_stream = options;
  of_stream.source_id = spool->source_id();
  of_stream.epoch = spool->epoch();
  of_stream.first_sequence = spool->first_sequence();
  of_stream.patience = kThreadPatience;
  of_stream.resume = true;
  std::unique_ptr<Stream> stream;
  if constexpr (kIsPing<Message>) {
    FATHOM_ASSIGN_OR_RETURN(stream, client.OpenPingStream(of_stream));
  } else {
    FATHOM_ASSIGN_OR_RETURN(stream, client.OpenContactStream(of_stream));
  }
  return std::unique_ptr<BufferedStream>(
      new BufferedStream(std::move(spool), std::move(stream), options, buffer));
}

template <typename Message>
BufferedStream<Message>::BufferedStream(std::unique_ptr<Spool> spool,
                                        std::unique_ptr<Stream> stream,
                                        const IngestStreamOptions& options,
                                        const BufferOptions& buffer)
    : options_(buffer),
      patience_(options.patience),
      stream_(std::move(stream)),
      spool_(std::move(spool)),
      last_before_(spool_->last_sequence()),
      durable_(spool_->first_sequence() - 1),
      sent_(durable_),
      synced_(SteadyClock::now()),
      thread_([this] { Pump(); }) {}

template <typename Message>
BufferedStream<Message>::~BufferedStream() {
  {
    MutexLock lock(mutex_);
    stop_ = true;
  }
  come_.NotifyAll();
  thread_.join();
}

template <typename Message>
void BufferedStream<Message>::Pump() {
  Message message;
  bool holds = false;
  for (;;) {
    {
      MutexLock lock(mutex_);
      if (stop_ || !failed_.ok()) return;
    }
    Step(message, holds);
  }
}

template <typename Message>
void BufferedStream<Message>::Step(Message& message, bool& holds) {
  {
    MutexLock lock(mutex_);
    if (!holds) {
      std::string bytes;
      absl::StatusOr<bool> read = spool_->Read(bytes);
      if (read.ok() && *read && !message.ParseFromString(bytes)) {
        read = absl::DataLossError("a buffered message cannot be read");
      }
      if (!read.ok()) return Fail(read.status());
      holds = *read;
    }
    const absl::Status synced = SyncInTime(holds);
    if (!synced.ok()) return Fail(synced);
  }
  // Unlocked: a server that is away must not keep callers from sending.
  absl::Status status;
  bool waits = false;
  if (holds) {
    status = stream_->Send(message).status();
  } else {
    const std::uint64_t durable = stream_->progress().durable_sequence;
    MutexLock lock(mutex_);
    ReleaseDurable(durable);
    if (stop_ || spool_->last_sequence() > sent_) return;
    waits = durable_ < sent_;
    // An idle stream is woken by the next message.
    if (!waits) {
      come_.Wait(mutex_);
      return;
    }
    if (come_.WaitFor(mutex_, kIdleLook)) return;
  }
  // Also mends a link that was cut with messages on the way.
  if (waits) status = stream_->Flush();
  const bool look = waits || !status.ok() || ++since_look_ >= kLookEvery;
  const std::uint64_t durable = look ? stream_->progress().durable_sequence : 0;
  if (look) since_look_ = 0;
  MutexLock lock(mutex_);
  if (holds && status.ok()) {
    holds = false;
    ++sent_;
  }
  Note(status);
  ReleaseDurable(durable);
}

template <typename Message>
absl::Status BufferedStream<Message>::SyncInTime(bool holds) {
  const bool due = SteadyClock::now() - synced_ >= kSyncEvery;
  if (!due && (!holds || spool_->synced_sequence() > sent_)) {
    return absl::OkStatus();
  }
  synced_ = SteadyClock::now();
  return spool_->SyncUnlocked(mutex_);
}

template <typename Message>
void BufferedStream<Message>::Fail(const absl::Status& status) {
  failed_ = status;
  gone_.NotifyAll();
}

template <typename Message>
void BufferedStream<Message>::Note(const absl::Status& status) {
  link_ = status;
  if (!status.ok() && !MayMend(status.code()) &&
      !absl::IsDeadlineExceeded(status)) {
    Fail(status);
  }
}

template <typename Message>
void BufferedStream<Message>::ReleaseDurable(std::uint64_t durable) {
  if (durable <= durable_) return;
  durable_ = durable;
  const absl::Status status = spool_->Release(durable);
  if (!status.ok()) failed_ = status;
  gone_.NotifyAll();
}

template <typename Message>
absl::Status BufferedStream<Message>::WaitUntil(
    const std::function<bool()>& done) {
  std::uint64_t mark = durable_;
  SteadyClock::time_point deadline = SteadyClock::now() + patience_;
  while (!done()) {
    if (!failed_.ok()) return failed_;
    if (durable_ != mark) {
      mark = durable_;
      deadline = SteadyClock::now() + patience_;
    }
    if (!gone_.WaitUntil(mutex_, deadline) && durable_ == mark && !done()) {
      return absl::UnavailableError(absl::StrFormat(
          "the buffer %s holds %d messages that the server has not: %s",
          options_.folder, spool_->last_sequence() - durable_,
          link_.ok() ? absl::StrFormat("no acknowledgement for %d ms",
                                       patience_.count())
                     : std::string(link_.message())));
    }
  }
  return absl::OkStatus();
}

template <typename Message>
absl::StatusOr<bool> BufferedStream<Message>::Send(Message& message) {
  MutexLock lock(mutex_);
  if (!failed_.ok()) return failed_;
  message.set_source_id(spool_->source_id());
  message.set_epoch(spool_->epoch());
  std::string bytes;
  // Others may take the number, or finish, while this one waits for room.
  const auto fits = [&]() FATHOM_REQUIRES(mutex_) {
    message.set_sequence(spool_->last_sequence() + 1);
    bytes = message.SerializeAsString();
    return spool_->HasRoom(bytes.size());
  };
  const bool room = fits();
  if (bytes.size() > kMaxIngestMessageBytes) {
    return absl::InvalidArgumentError(
        absl::StrFormat("message of %d bytes: at most %d are accepted",
                        bytes.size(), kMaxIngestMessageBytes));
  }
  if (!room && !finished_ && options_.drop_when_full) {
    ++dropped_;
    return false;
  }
  if (!room) {
    FATHOM_RETURN_IF_ERROR(WaitUntil(
        [&]() FATHOM_REQUIRES(mutex_) { return finished_ || fits(); }));
  }
  if (finished_) {
    return absl::FailedPreconditionError("the stream was finished");
  }
  const absl::Status status = spool_->Append(bytes);
  // A full disk is a full buffer.
  if (absl::IsResourceExhausted(status) && options_.drop_when_full) {
    ++dropped_;
    return false;
  }
  FATHOM_RETURN_IF_ERROR(status);
  come_.NotifyOne();
  return true;
}

template <typename Message>
absl::Status BufferedStream<Message>::Finish() {
  MutexLock lock(mutex_);
  finished_ = true;
  gone_.NotifyAll();
  FATHOM_RETURN_IF_ERROR(WaitUntil([&]() FATHOM_REQUIRES(mutex_) {
    return durable_ >= spool_->last_sequence();
  }));
  return spool_->Clear();
}

template <typename Message>
IngestProgress BufferedStream<Message>::progress() const {
  IngestProgress progress = stream_->progress();
  MutexLock lock(mutex_);
  progress.sent_sequence = spool_->last_sequence();
  return progress;
}

template <typename Message>
BufferState BufferedStream<Message>::state() const {
  MutexLock lock(mutex_);
  return {.waiting = spool_->last_sequence() - durable_,
          .last_before = last_before_,
          .bytes = spool_->bytes(),
          .dropped = dropped_,
          .link = link_};
}

template class BufferedStream<v1::Ping>;
template class BufferedStream<v1::ContactReport>;

}  // namespace fathom::client
