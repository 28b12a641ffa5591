// SearchCall: a unary call whose work may take long (a trajectory, a search for
// the nearest obstacle). It is done by a thread of ServerContext::searches, so
// that gRPC's threads stay free, and ends soon after the client cancels or its
// deadline passes.

#ifndef FATHOM_SERVER_SEARCH_CALL_H_
#define FATHOM_SERVER_SEARCH_CALL_H_

#include <atomic>
#include <functional>
#include <memory>
#include <utility>

#include "grpcpp/support/server_callback.h"
#include "map/obstacle_map/obstacle_map_view.h"
#include "server/server_context.h"

namespace fathom::server {

// Deletes itself. REQUIRES: a slot of context.search_calls was taken; it is
// given back in the end.
class SearchCall final : public grpc::ServerUnaryReactor {
 public:
  // Fills the response, or says why not. CANCELLED soon after `stop` is true.
  using Work = std::function<absl::Status(const map::ObstacleMapView& view,
                                          const std::atomic<bool>& stop)>;

  SearchCall(ServerContext& context, Work work)
      : context_(context), work_(std::move(work)) {}

  // Must be called, once.
  void Begin(const absl::Status& status,
             std::shared_ptr<const map::ObstacleMapView> view) {
    if (!status.ok()) {
      Finish(ToGrpc(status));
      return;
    }
    context_.searches.Give([this, view = std::move(view)] {
      const absl::Status done = gone_ ? absl::CancelledError("client has gone")
                                : context_.draining ? ShuttingDown()
                                                    : work_(*view, gone_);
      Finish(ToGrpc(done));
    });
  }

  // May come while the work is under way: it then ends.
  void OnCancel() override { gone_ = true; }
  void OnDone() override {
    context_.search_calls.GiveBack();
    delete this;
  }

 private:
  ServerContext& context_;
  const Work work_;
  std::atomic<bool> gone_{false};
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_SEARCH_CALL_H_
