#include "client/sequenced_stream.h"

#include <grpcpp/client_context.h>
#include <grpcpp/support/client_callback.h>

#include <algorithm>
#include <map>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/errors.h"

namespace fathom::client {
namespace {

// Waits between connections that bring nothing: 50 ms, doubled to 2 s. A
// server that restarts is found within a doubling of its own absence.
constexpr std::chrono::milliseconds kFirstBackoff{50};
constexpr int kMaxBackoffDoublings = 5;  // 1.6 s.

constexpr std::size_t kMaxSourceIdLength = 64;

absl::Status Validate(const IngestStreamOptions& options) {
  const std::string& id = options.source_id;
  const bool good_characters = std::all_of(id.begin(), id.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
           (c >= '0' && c <= '9') || c == '.' || c == '_' || c == '-';
  });
  if (id.empty() || id.size() > kMaxSourceIdLength || !good_characters) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "source_id=\"%s\": must be 1 to %d characters of [A-Za-z0-9._-]", id,
        kMaxSourceIdLength));
  }
  if (options.first_sequence == 0) {
    return absl::InvalidArgumentError("first_sequence=0: numbers begin at 1");
  }
  if (options.max_in_flight == 0) {
    return absl::InvalidArgumentError("max_in_flight=0: must be at least 1");
  }
  return absl::OkStatus();
}

template <typename T>
void AppendNewest(const std::vector<T>& from, std::vector<T>& to) {
  to.insert(to.end(), from.begin(), from.end());
  if (to.size() > kMaxRemembered) {
    to.erase(to.begin(), to.end() - kMaxRemembered);
  }
}

void AddRejects(const std::vector<v1::RejectCount>& from,
                std::vector<v1::RejectCount>& to) {
  std::map<int, std::uint64_t> counts;
  for (const v1::RejectCount& r : to) counts[r.reason()] += r.count();
  for (const v1::RejectCount& r : from) counts[r.reason()] += r.count();
  to.clear();
  for (const auto& [reason, count] : counts) {
    v1::RejectCount& r = to.emplace_back();
    r.set_reason(static_cast<v1::RejectReason>(reason));
    r.set_count(count);
  }
}

// Adds an ack's counters, which run since its connection began.
void AddCounters(const IngestAck& ack, IngestProgress& sum) {
  sum.messages_applied += ack.messages_applied;
  sum.messages_duplicate += ack.messages_duplicate;
  sum.measurements_accepted += ack.measurements_accepted;
  AddRejects(ack.rejects, sum.rejects);
}

}  // namespace

std::uint64_t EpochOrNow(std::uint64_t epoch) {
  if (epoch != 0) return epoch;
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(now).count());
}

// One gRPC call. All members but context_ and read_ are guarded by the
// owner's mutex_. A hold keeps OnDone away while writes may still start from
// a caller's thread; it is released once, when writing is over.
class SequencedStream::Connection final
    : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  explicit Connection(SequencedStream& owner) : owner_(owner) {}

  void Start() {
    owner_.stub_.PrepareBidiStreamingCall(&context_, owner_.method_, {}, this);
    AddHold();
    StartRead(&read_);
    StartCall();
  }

  void Cancel() { context_.TryCancel(); }

  // Starts what may start now. Called without the owner's mutex by whoever
  // made something change.
  void Advance() {
    enum { kNothing, kWrite, kWritesDone, kRelease } action = kNothing;
    grpc::WriteOptions options;
    {
      MutexLock lock(owner_.mutex_);
      if (writing_ || released_) return;
      if (read_ended_ || write_failed_) {
        action = kRelease;
        released_ = true;
      } else if (owner_.buffer_.HasUnwritten()) {
        action = kWrite;
        writing_ = true;
        write_ = owner_.buffer_.NextToWrite();
        if (owner_.buffer_.HasUnwritten()) options.set_buffer_hint();
      } else if (owner_.finishing_) {
        action = kWritesDone;
        released_ = true;
      }
    }
    // Unlocked: `writing_` keeps other threads from starting a second write,
    // `released_` from touching a call that may end at any moment.
    switch (action) {
      case kNothing:
        break;
      case kWrite:
        StartWrite(&write_, options);
        break;
      case kWritesDone:
        StartWritesDone();
        RemoveHold();
        break;
      case kRelease:
        RemoveHold();
        break;
    }
  }

  void OnWriteDone(bool ok) override {
    {
      MutexLock lock(owner_.mutex_);
      writing_ = false;
      write_failed_ = !ok;
    }
    Advance();
  }

  void OnReadDone(bool ok) override {
    std::optional<IngestAck> ack;
    if (ok) ack = owner_.decode_ack_(&read_);
    {
      MutexLock lock(owner_.mutex_);
      if (ack.has_value()) {
        owner_.Apply(*ack);
      } else {
        read_ended_ = true;
      }
    }
    if (ack.has_value()) {
      owner_.changed_.NotifyAll();
      StartRead(&read_);
    } else {
      if (ok) Cancel();  // An answer that we cannot read.
      Advance();
    }
  }

  void OnDone(const grpc::Status& status) override {
    MutexLock lock(owner_.mutex_);
    absl::Status end = FromGrpc(status);
    if (end.ok() && !owner_.finishing_) {
      end = absl::UnavailableError("the server ended the stream");
    }
    owner_.cut_ = end;
    if (!end.ok() && !MayMend(end.code())) owner_.permanent_ = end;
    AddCounters(owner_.last_ack_, owner_.progress_);
    owner_.last_ack_ = IngestAck{};
    ended_ = true;
    owner_.changed_.NotifyAll();
  }

  bool ended() const { return ended_; }
  bool writing() const { return writing_; }

 private:
  SequencedStream& owner_;
  grpc::ClientContext context_;
  grpc::ByteBuffer read_;
  grpc::ByteBuffer write_;
  bool writing_ = false;
  bool write_failed_ = false;
  bool read_ended_ = false;
  bool released_ = false;
  bool ended_ = false;
};

absl::StatusOr<std::unique_ptr<SequencedStream>> SequencedStream::Open(
    std::shared_ptr<grpc::Channel> channel, std::string method,
    const IngestStreamOptions& options, AckDecoder decode_ack) {
  FATHOM_RETURN_IF_ERROR(Validate(options));
  std::unique_ptr<SequencedStream> stream(new SequencedStream(
      std::move(channel), std::move(method), options, decode_ack));
  stream->StartConnection();
  return stream;
}

SequencedStream::SequencedStream(std::shared_ptr<grpc::Channel> channel,
                                 std::string method,
                                 const IngestStreamOptions& options,
                                 AckDecoder decode_ack)
    : channel_(std::move(channel)),
      method_(std::move(method)),
      options_(options),
      epoch_(EpochOrNow(options.epoch)),
      decode_ack_(decode_ack),
      stub_(channel_),
      next_sequence_(options.first_sequence),
      buffer_(options.first_sequence, options.max_in_flight,
              options.max_in_flight_bytes) {
  progress_.epoch = epoch_;
  progress_.applied_sequence = options.first_sequence - 1;
}

SequencedStream::~SequencedStream() {
  MutexLock lock(mutex_);
  if (connection_ == nullptr) return;
  if (!connection_->ended()) connection_->Cancel();
  while (!connection_->ended()) changed_.Wait(mutex_);
}

void SequencedStream::StartConnection() {
  const auto connection = std::make_shared<Connection>(*this);
  {
    MutexLock lock(mutex_);
    buffer_.Rewind();
    connection_ = connection;
  }
  connection->Start();
  connection->Advance();
}

bool SequencedStream::ConnectionUp() const {
  return connection_ != nullptr && !connection_->ended();
}

void SequencedStream::Apply(const IngestAck& ack) {
  fruitless_connections_ = 0;
  if (ack.epoch == epoch_) {
    progress_.applied_sequence =
        std::max(progress_.applied_sequence,
                 std::min(ack.applied_sequence, buffer_.last_sequence()));
    buffer_.AckDurable(ack.durable_sequence);
  }
  progress_.map_revision = std::max(progress_.map_revision, ack.map_revision);
  AppendNewest(ack.rejections, progress_.rejections);
  AppendNewest(ack.gaps, progress_.gaps);
  last_ack_ = ack;
}

absl::StatusOr<std::uint64_t> SequencedStream::Send(const Encoder& encode) {
  MutexLock send_lock(send_mutex_);
  grpc::Slice slice = encode(epoch_, next_sequence_);
  const std::size_t bytes = slice.size();
  if (bytes > kMaxIngestMessageBytes) {
    return absl::InvalidArgumentError(
        absl::StrFormat("message of %d bytes: at most %d are accepted", bytes,
                        kMaxIngestMessageBytes));
  }
  std::shared_ptr<Connection> idle;
  {
    MutexLock lock(mutex_);
    if (finishing_) {
      return absl::FailedPreconditionError("the stream was finished");
    }
    FATHOM_RETURN_IF_ERROR(WaitUntil([&]() FATHOM_REQUIRES(mutex_) {
      return ConnectionUp() && buffer_.HasRoom(bytes);
    }));
    buffer_.Push(grpc::ByteBuffer(&slice, 1), bytes);
    if (!connection_->writing()) idle = connection_;
  }
  if (idle != nullptr) idle->Advance();
  return next_sequence_++;
}

absl::Status SequencedStream::WaitUntil(const std::function<bool()>& done) {
  const auto mark = [this]() FATHOM_REQUIRES(mutex_) {
    return progress_.applied_sequence + buffer_.durable_sequence();
  };
  std::uint64_t last_mark = mark();
  SteadyTime deadline = std::chrono::steady_clock::now() + options_.patience;
  while (!done()) {
    if (!permanent_.ok()) return permanent_;
    if (mark() != last_mark) {
      last_mark = mark();
      deadline = std::chrono::steady_clock::now() + options_.patience;
    }
    if (!ConnectionUp() && !resuming_) {
      if (!options_.resume) return cut_;
      FATHOM_RETURN_IF_ERROR(Resume(deadline));
      continue;
    }
    if (!changed_.WaitUntil(mutex_, deadline) && mark() == last_mark &&
        !done()) {
      if (!cut_.ok()) return cut_;
      return absl::DeadlineExceededError(absl::StrFormat(
          "no acknowledgement for %d ms: sent %d, applied %d, durable %d",
          options_.patience.count(), buffer_.last_sequence(),
          progress_.applied_sequence, buffer_.durable_sequence()));
    }
  }
  return absl::OkStatus();
}

absl::Status SequencedStream::Resume(SteadyTime deadline) {
  resuming_ = true;
  const int doublings = std::min(fruitless_connections_, kMaxBackoffDoublings);
  std::chrono::milliseconds pause = fruitless_connections_ == 0
                                        ? std::chrono::milliseconds{0}
                                        : kFirstBackoff * (1 << doublings);
  pause = std::max(pause, RetryDelay(cut_).value_or(pause));
  ++fruitless_connections_;
  const SteadyTime start =
      std::min(std::chrono::steady_clock::now() + pause, deadline);
  while (changed_.WaitUntil(mutex_, start)) {
  }
  mutex_.Unlock();
  const auto wait = deadline - std::chrono::steady_clock::now();
  const bool connected =
      wait.count() > 0 &&
      channel_->WaitForConnected(
          std::chrono::system_clock::now() +
          std::chrono::duration_cast<std::chrono::microseconds>(wait));
  if (connected) StartConnection();
  mutex_.Lock();
  resuming_ = false;
  changed_.NotifyAll();
  if (!connected) return cut_;
  ++progress_.reconnects;
  return absl::OkStatus();
}

absl::Status SequencedStream::Flush() {
  MutexLock lock(mutex_);
  // A Send may have met the end of the stream and taken nothing: what was
  // taken is durable, but the caller must not read that as success.
  if (!permanent_.ok()) return permanent_;
  const std::uint64_t last = buffer_.last_sequence();
  return WaitUntil([&]() FATHOM_REQUIRES(mutex_) {
    return buffer_.durable_sequence() >= last;
  });
}

absl::Status SequencedStream::WaitApplied(std::uint64_t sequence) {
  MutexLock lock(mutex_);
  if (sequence > buffer_.last_sequence()) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "sequence=%d: only %d were sent", sequence, buffer_.last_sequence()));
  }
  return WaitUntil([&]() FATHOM_REQUIRES(mutex_) {
    return progress_.applied_sequence >= sequence;
  });
}

absl::Status SequencedStream::Finish() {
  MutexLock send_lock(send_mutex_);
  std::shared_ptr<Connection> connection;
  {
    MutexLock lock(mutex_);
    if (finished_.has_value()) return *finished_;
    FATHOM_RETURN_IF_ERROR(WaitUntil([&]() FATHOM_REQUIRES(mutex_) {
      return buffer_.durable_sequence() >= buffer_.last_sequence();
    }));
    finishing_ = true;
    connection = connection_;
  }
  connection->Advance();
  MutexLock lock(mutex_);
  const SteadyTime deadline =
      std::chrono::steady_clock::now() + options_.patience;
  while (!connection->ended()) {
    if (!changed_.WaitUntil(mutex_, deadline)) connection->Cancel();
  }
  // Everything is durable: a connection that is cut now has cost nothing.
  finished_ = permanent_;
  return *finished_;
}

absl::Status SequencedStream::Reconnect() {
  MutexLock send_lock(send_mutex_);
  MutexLock lock(mutex_);
  if (finishing_) {
    return absl::FailedPreconditionError("the stream was finished");
  }
  if (!permanent_.ok()) return permanent_;
  const SteadyTime deadline =
      std::chrono::steady_clock::now() + options_.patience;
  const std::shared_ptr<Connection> old = connection_;
  old->Cancel();
  while (!old->ended()) changed_.Wait(mutex_);
  // Another thread's wait may have replaced it already.
  while (resuming_) changed_.Wait(mutex_);
  if (connection_ != old) return absl::OkStatus();
  return Resume(deadline);
}

IngestProgress SequencedStream::progress() const {
  MutexLock lock(mutex_);
  IngestProgress progress = progress_;
  AddCounters(last_ack_, progress);
  progress.sent_sequence = buffer_.last_sequence();
  progress.durable_sequence = buffer_.durable_sequence();
  return progress;
}

}  // namespace fathom::client
