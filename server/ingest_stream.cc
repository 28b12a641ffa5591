#include "server/ingest_stream.h"

#include <algorithm>
#include <type_traits>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "server/convert_common.h"
#include "server/errors.h"
#include "server/field_checks.h"

namespace fathom::server {

template <typename Kind>
IngestStream<Kind>* IngestStream<Kind>::Start(ServerContext& context) {
  auto stream = std::make_shared<IngestStream>(context);
  {
    MutexLock lock(stream->mutex_);
    stream->self_ = stream;
  }
  if (!context.ingest_calls.Add(stream)) {
    stream->End(TooManyCalls("ingest streams", context.ingest_calls.limit()),
                /*abandon=*/true);
  } else if (context.draining) {
    stream->End(ShuttingDown(), /*abandon=*/true);
  }
  stream->Pump();
  return stream.get();
}

template <typename Kind>
void IngestStream<Kind>::OnReadDone(bool ok) {
  absl::Status end;
  bool ended = !ok;
  if (ok) {
    {
      // Set again by the keeper's answer, or by OnRoom, whichever is first.
      MutexLock lock(mutex_);
      ended = end_.has_value();
      room_ = false;
    }
    if (!ended) {
      end = TakeRequest();
      ended = !end.ok();
    }
  }
  if (ended) {
    End(end,
        /*abandon=*/absl::IsResourceExhausted(end) || absl::IsDataLoss(end));
  }
  {
    MutexLock lock(mutex_);
    reading_ = false;
  }
  Pump();
}

template <typename Kind>
absl::Status IngestStream<Kind>::TakeRequest() {
  const FieldPath root;
  const FieldPath path(root, Kind::kField);
  const auto unnumbered = [this](const absl::Status& status) {
    RejectUnnumbered(status);
    return absl::OkStatus();
  };
  if (!Kind::Has(*request_)) {
    return unnumbered(Missing(path, "one message"));
  }
  const auto& message = Kind::Of(*request_);
  if (epoch_ == 0) {
    // The first message names the source for the whole stream.
    FATHOM_RETURN_IF_ERROR(
        CheckId(message.source_id(), FieldPath(path, "source_id")));
    FATHOM_RETURN_IF_ERROR(
        CheckPositive(message.epoch(), FieldPath(path, "epoch")));
    source_id_ = message.source_id();
    epoch_ = message.epoch();
    MutexLock lock(mutex_);
    progress_.epoch = epoch_;
  } else {
    FATHOM_RETURN_IF_ERROR(
        CheckSameSource(message.source_id(), message.epoch()));
  }
  const absl::Status numbered = CheckNumbering(message, path);
  if (!numbered.ok()) return unnumbered(numbered);
  {
    MutexLock lock(mutex_);
    under_way_ += 1;
  }
  absl::StatusOr<Room> room = context_.keeper.Submit(
      NotFromTheFuture(ToIngest(message, path), context_.clock.Now(), path),
      this->shared_from_this());
  MutexLock lock(mutex_);
  if (!room.ok()) {
    under_way_ -= 1;
    return KeeperError(context_, room.status());
  }
  if (*room == Room::kSome) room_ = true;
  return absl::OkStatus();
}

template <typename Kind>
absl::Status IngestStream<Kind>::CheckSameSource(const std::string& source_id,
                                                 uint64_t epoch) {
  const FieldPath root;
  const FieldPath path(root, Kind::kField);
  if (source_id != source_id_) {
    return InvalidField(FieldPath(path, "source_id").ToString(),
                        absl::StrFormat("differs from the stream's first, %s; "
                                        "open a stream for each source",
                                        source_id_));
  }
  if (epoch != epoch_) {
    return InvalidField(
        FieldPath(path, "epoch").ToString(),
        absl::StrFormat("%d differs from the stream's first, %d; open a new "
                        "stream for a new epoch",
                        epoch, epoch_));
  }
  return absl::OkStatus();
}

template <typename Kind>
void IngestStream<Kind>::RejectUnnumbered(const absl::Status& status) {
  const std::optional<FieldViolation> violation = ViolationOf(status);
  MutexLock lock(mutex_);
  room_ = true;
  NoteRejection(0, {map::RejectReason::kInvalidMessage,
                    violation.has_value() ? violation->path : "",
                    violation.has_value() ? violation->description
                                          : std::string(status.message())});
}

template <typename Kind>
void IngestStream<Kind>::NoteRejection(uint64_t sequence,
                                       const Refusal& refusal) {
  progress_.rejects.Add(refusal.reason);
  progress_.fresh = true;
  auto& rejections = progress_.rejections;
  if (rejections.size() >= kMaxRejectionsPerAck) return;
  WriteRejection(sequence, refusal, &rejections.emplace_back());
}

template <typename Kind>
void IngestStream<Kind>::OnApplied(const MessageOutcome& outcome) {
  MutexLock lock(mutex_);
  Progress& progress = progress_;
  progress.applied_sequence =
      std::max(progress.applied_sequence, outcome.number.sequence);
  progress.map_revision = std::max(progress.map_revision, outcome.revision);
  switch (outcome.fate) {
    case MessageFate::kApplied:
      progress.applied += 1;
      break;
    case MessageFate::kDuplicate:
      progress.duplicate += 1;
      break;
    case MessageFate::kRefused: {
      Refusal refusal = outcome.refusal;
      // The keeper names a field of the message, not its path.
      if (refusal.field == "epoch" || refusal.field == "source_id" ||
          refusal.field == "activity_id") {
        refusal.field = std::string(Kind::kField) + "." + refusal.field;
      }
      NoteRejection(outcome.number.sequence, refusal);
      break;
    }
  }
  progress.accepted += outcome.accepted;
  progress.rejects.Merge(outcome.rejects);
  if (outcome.missing.any() && progress.gaps.size() < kMaxGapsPerAck) {
    progress.gaps.push_back(outcome.missing);
  }
}

template <typename Kind>
void IngestStream<Kind>::OnDurable(MessageNumber newest, size_t count) {
  {
    MutexLock lock(mutex_);
    progress_.durable_sequence =
        std::max(progress_.durable_sequence, newest.sequence);
    progress_.fresh = true;
    under_way_ -= count;
  }
  PumpLater();
}

template <typename Kind>
void IngestStream<Kind>::OnRoom() {
  {
    MutexLock lock(mutex_);
    room_ = true;
  }
  PumpLater();
}

template <typename Kind>
void IngestStream<Kind>::OnFault() {
  {
    MutexLock lock(mutex_);
    if (finished_) return;
  }
  End(StorageFault(context_.keeper.storage_state()), /*abandon=*/true);
  PumpLater();
}

template <typename Kind>
void IngestStream<Kind>::Drain() {
  End(ShuttingDown(), /*abandon=*/false);
  PumpLater();
}

template <typename Kind>
void IngestStream<Kind>::End(const absl::Status& status, bool abandon) {
  MutexLock lock(mutex_);
  if (!end_.has_value()) end_ = status;
  if (abandon && !abandon_) {
    abandon_ = true;
    // A fault overtakes an orderly end.
    if (!status.ok()) end_ = status;
  }
}

template <typename Kind>
void IngestStream<Kind>::OnWriteDone(bool ok) {
  {
    MutexLock lock(mutex_);
    writing_ = false;
  }
  if (!ok) End(absl::CancelledError("the client has gone"), /*abandon=*/true);
  Pump();
}

template <typename Kind>
void IngestStream<Kind>::OnCancel() {
  End(absl::CancelledError("the client cancelled the stream"),
      /*abandon=*/true);
  Pump();
}

template <typename Kind>
void IngestStream<Kind>::OnDone() {
  std::shared_ptr<IngestStream> last;  // Freed after the lock.
  MutexLock lock(mutex_);
  finished_ = true;
  last.swap(self_);
}

template <typename Kind>
void IngestStream<Kind>::PumpLater() {
  context_.courier.Give(
      [stream = this->shared_from_this()] { stream->Pump(); });
}

template <typename Kind>
void IngestStream<Kind>::Pump() {
  enum class Step { kNone, kRead, kWrite, kFinish };
  while (true) {
    Step step = Step::kNone;
    absl::Status status;
    {
      MutexLock lock(mutex_);
      if (finished_) return;
      const bool ending = end_.has_value() && (abandon_ || under_way_ == 0);
      if (!writing_ && progress_.fresh && !abandon_) {
        writing_ = true;
        FillAck();
        step = Step::kWrite;
      } else if (ending && !writing_) {
        finished_ = true;
        status = *end_;
        step = Step::kFinish;
      } else if (!end_.has_value() && !reading_ && room_) {
        reading_ = true;
        step = Step::kRead;
      }
    }
    switch (step) {
      case Step::kNone:
        return;
      case Step::kRead:
        arena_.Reset();
        request_ = google::protobuf::Arena::CreateMessage<Request>(&arena_);
        this->StartRead(request_);
        break;
      case Step::kWrite:
        this->StartWrite(&ack_);
        break;
      case Step::kFinish:
        this->Finish(ToGrpc(status));
        return;
    }
  }
}

template <typename Kind>
void IngestStream<Kind>::FillAck() {
  ack_.Clear();
  ack_.set_epoch(progress_.epoch);
  ack_.set_applied_sequence(progress_.applied_sequence);
  ack_.set_durable_sequence(progress_.durable_sequence);
  ack_.set_map_revision(progress_.map_revision);
  if constexpr (std::is_same_v<Kind, PingStreamKind>) {
    ack_.set_pings_applied(progress_.applied);
    ack_.set_pings_duplicate(progress_.duplicate);
    ack_.set_measurements_accepted(progress_.accepted);
  } else {
    ack_.set_reports_applied(progress_.applied);
    ack_.set_reports_duplicate(progress_.duplicate);
  }
  WriteRejects(progress_.rejects, ack_.mutable_rejects());
  for (v1::Rejection& rejection : progress_.rejections) {
    *ack_.add_rejections() = std::move(rejection);
  }
  for (const MissingNumbers& gap : progress_.gaps) {
    v1::SequenceGap* out = ack_.add_gaps();
    out->set_first_sequence(gap.first);
    out->set_last_sequence(gap.last);
  }
  progress_.rejections.clear();
  progress_.gaps.clear();
  progress_.fresh = false;
}

template class IngestStream<PingStreamKind>;
template class IngestStream<ContactStreamKind>;

}  // namespace fathom::server
