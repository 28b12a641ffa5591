// A watch that goes on by itself: after a cut it connects again and resumes
// behind the last progress, so that no change is missed and none is told twice.
//
//   const auto watch = client->WatchContacts({}, {});
//   while (true) {
//     FATHOM_ASSIGN_OR_RETURN(const v1::WatchContactsResponse event,
//                             watch->Next());
//     ...
//   }
//
// Events are the contract's own: first the state, then changes; a `progress`
// whenever everything was told; a `resync` when the state comes anew (then
// forget what was told before). After a cut the server may have to resync; that
// is told like any other. A batch of contacts is told one by one.
//
// Thread safety: one thread calls Next; any may call Cancel.

#ifndef FATHOM_CLIENT_WATCH_H_
#define FATHOM_CLIENT_WATCH_H_

#include <grpcpp/client_context.h>
#include <grpcpp/support/sync_stream.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "base/mutex.h"
#include "fathom/v1/obstacle_service.pb.h"

namespace fathom::client {

struct WatchOptions {
  // For how long a connection is tried anew before Next gives up.
  std::chrono::milliseconds give_up_after{60'000};
};

// See file comment. Made by Client.
template <typename Request, typename Response>
class Watch {
 public:
  using Reader = std::unique_ptr<grpc::ClientReader<Response>>;
  using Open = std::function<Reader(grpc::ClientContext*, const Request&)>;

  Watch(Open open, Request request, WatchOptions options)
      : open_(std::move(open)),
        request_(std::move(request)),
        options_(options) {}
  // Cancels.
  ~Watch();
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  // The next event; blocks until it comes. Errors: the server's (a bad request,
  // a limit, an activity that ended); UNAVAILABLE when no server took the watch
  // for give_up_after; CANCELLED.
  absl::StatusOr<Response> Next();

  // Ends Next, now and ever after.
  void Cancel();

  // Connections that were made anew.
  std::uint64_t reconnections() const { return reconnections_; }

 private:
  // False once cancelled.
  bool Connect();
  absl::Status Disconnect();
  // Waits before the next attempt; false once cancelled.
  bool WaitFor(std::chrono::milliseconds pause);
  bool IsCancelled();
  // Keeps what a resumption needs; false: the event was told before the cut.
  bool Note(const Response& event);

  const Open open_;
  Request request_;
  const WatchOptions options_;
  Reader reader_;
  // Events that came in one message and are yet to be told.
  std::deque<Response> waiting_;
  // What was told since the last progress, by whom it is about: what a
  // resumption may tell again.
  std::map<std::string, std::size_t> told_;
  std::uint64_t reconnections_ = 0;

  Mutex mutex_;
  CondVar changed_;
  std::unique_ptr<grpc::ClientContext> context_ FATHOM_GUARDED_BY(mutex_);
  bool cancelled_ FATHOM_GUARDED_BY(mutex_) = false;
};

using RegionWatch = Watch<v1::WatchRegionRequest, v1::WatchRegionResponse>;
using ContactsWatch =
    Watch<v1::WatchContactsRequest, v1::WatchContactsResponse>;
// Has no revision to resume behind: after a cut the verdict comes again only
// if it has changed, and the alert keeps its hysteresis.
using TrajectoryWatch =
    Watch<v1::WatchTrajectoryRequest, v1::WatchTrajectoryResponse>;

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_WATCH_H_
