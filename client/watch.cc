#include "client/watch.h"

#include <algorithm>
#include <deque>
#include <string>
#include <type_traits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/errors.h"
#include "fathom/v1/obstacle_service.grpc.pb.h"

namespace fathom::client {
namespace {

using SteadyClock = std::chrono::steady_clock;

// Waits between attempts: 50 ms, doubled to 2 s.
constexpr std::chrono::milliseconds kFirstPause{50};
constexpr std::chrono::milliseconds kLongestPause{2000};

// Whether a new connection may mend it.
bool MayPass(const absl::Status& status) {
  // OK and CANCELLED not by us: a server that ends.
  return status.ok() || absl::IsUnavailable(status) ||
         absl::IsCancelled(status);
}

// What an event is about, and its words but for what time alone changes.
struct Told {
  std::string key;
  std::size_t words = 0;
};

std::size_t WordsOf(const google::protobuf::MessageLite& message) {
  return std::hash<std::string>()(message.SerializeAsString());
}

Told ToldOf(const v1::WatchRegionResponse& event) {
  v1::RegionTile tile = event.tile();
  tile.clear_age_s();
  return {absl::StrCat(tile.first_row(), " ", tile.first_column()),
          WordsOf(tile)};
}

Told ToldOf(const v1::WatchContactsResponse& event) {
  // An id holds no NUL.
  return {event.estimate().source_id() + '\0' + event.estimate().contact_id(),
          WordsOf(event.estimate())};
}

Told ToldOf(const v1::WatchTrajectoryResponse& event) {
  v1::CheckTrajectoryResponse verdict = event.verdict();
  verdict.clear_stamp();
  return {"", WordsOf(verdict) * 2 + (event.alert() ? 1 : 0)};
}

// A message's events.
template <typename Response>
std::deque<Response> EventsOf(Response message) {
  std::deque<Response> events;
  events.push_back(std::move(message));
  return events;
}
std::deque<v1::WatchContactsResponse> EventsOf(
    v1::WatchContactsResponse message) {
  std::deque<v1::WatchContactsResponse> events;
  if (!message.has_batch()) {
    events.push_back(std::move(message));
    return events;
  }
  const auto add = [&]() -> v1::WatchContactsResponse& {
    v1::WatchContactsResponse& event = events.emplace_back();
    *event.mutable_stamp() = message.stamp();
    return event;
  };
  for (v1::ContactEstimate& estimate :
       *message.mutable_batch()->mutable_estimates()) {
    add().mutable_estimate()->Swap(&estimate);
  }
  if (message.batch().has_progress()) {
    *add().mutable_progress() = message.batch().progress();
  }
  return events;
}

template <typename Request, typename Response>
void ResumeBehind(const Response& progress, Request& request) {
  request.set_from_revision(progress.stamp().map_revision());
  request.set_run_id(progress.progress().run_id());
}
void ResumeBehind(const v1::WatchTrajectoryResponse&,
                  v1::WatchTrajectoryRequest&) {}

// Returns whether the state comes anew.
template <typename Response>
bool IsResync(const Response& event) {
  return event.has_resync();
}
bool IsResync(const v1::WatchTrajectoryResponse&) { return false; }

}  // namespace

template <typename Request, typename Response>
Watch<Request, Response>::~Watch() {
  Cancel();
  if (reader_ != nullptr) (void)Disconnect();
}

template <typename Request, typename Response>
void Watch<Request, Response>::Cancel() {
  MutexLock lock(mutex_);
  cancelled_ = true;
  if (context_ != nullptr) context_->TryCancel();
  changed_.NotifyAll();
}

template <typename Request, typename Response>
bool Watch<Request, Response>::Connect() {
  grpc::ClientContext* context = nullptr;
  {
    MutexLock lock(mutex_);
    if (cancelled_) return false;
    context_ = std::make_unique<grpc::ClientContext>();
    context = context_.get();
  }
  reader_ = open_(context, request_);
  return true;
}

template <typename Request, typename Response>
absl::Status Watch<Request, Response>::Disconnect() {
  const absl::Status end = FromGrpc(reader_->Finish());
  reader_.reset();
  MutexLock lock(mutex_);
  context_.reset();
  return cancelled_ ? absl::CancelledError("the watch was cancelled") : end;
}

template <typename Request, typename Response>
bool Watch<Request, Response>::WaitFor(std::chrono::milliseconds pause) {
  const auto until = SteadyClock::now() + pause;
  MutexLock lock(mutex_);
  while (!cancelled_ && changed_.WaitUntil(mutex_, until)) {
  }
  return !cancelled_;
}

template <typename Request, typename Response>
bool Watch<Request, Response>::IsCancelled() {
  MutexLock lock(mutex_);
  return cancelled_;
}

template <typename Request, typename Response>
bool Watch<Request, Response>::Note(const Response& event) {
  if (event.has_progress()) {
    ResumeBehind(event, request_);
    // A trajectory's verdict still stands.
    if constexpr (!std::is_same_v<Response, v1::WatchTrajectoryResponse>) {
      told_.clear();
    }
    return true;
  }
  if (IsResync(event)) {
    told_.clear();
    return true;
  }
  if constexpr (std::is_same_v<Response, v1::WatchTrajectoryResponse>) {
    request_.set_alert_stands(event.alert());
  }
  const Told told = ToldOf(event);
  const auto [held, is_new] = told_.emplace(told.key, told.words);
  const bool again = !is_new && held->second == told.words;
  held->second = told.words;
  return !again;
}

template <typename Request, typename Response>
absl::StatusOr<Response> Watch<Request, Response>::Next() {
  std::chrono::milliseconds pause = kFirstPause;
  // When the connection was lost; max: it is up.
  auto cut = SteadyClock::time_point::max();
  while (true) {
    while (!waiting_.empty()) {
      if (IsCancelled()) return absl::CancelledError("the watch was cancelled");
      Response event = std::move(waiting_.front());
      waiting_.pop_front();
      if (Note(event)) return event;
    }
    if (reader_ == nullptr && !Connect()) {
      return absl::CancelledError("the watch was cancelled");
    }
    Response message;
    if (reader_->Read(&message)) {
      waiting_ = EventsOf(std::move(message));
      cut = SteadyClock::time_point::max();
      pause = kFirstPause;
      continue;
    }
    const absl::Status end = Disconnect();
    if (absl::IsCancelled(end) && !WaitFor(std::chrono::milliseconds(0))) {
      return end;
    }
    const auto now = SteadyClock::now();
    cut = std::min(cut, now);
    if (!MayPass(end) || now - cut > options_.give_up_after) {
      return end.ok() ? absl::UnavailableError("the server ended the watch")
                      : end;
    }
    if (!WaitFor(pause)) {
      return absl::CancelledError("the watch was cancelled");
    }
    pause = std::min(2 * pause, kLongestPause);
    ++reconnections_;
  }
}

template class Watch<v1::WatchRegionRequest, v1::WatchRegionResponse>;
template class Watch<v1::WatchContactsRequest, v1::WatchContactsResponse>;
template class Watch<v1::WatchTrajectoryRequest, v1::WatchTrajectoryResponse>;

}  // namespace fathom::client
