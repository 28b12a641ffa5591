// What the services share: the keeper, the file (for history and sizes), the
// clock and the bookkeeping of calls. No logic; lives as long as the server.

#ifndef FATHOM_SERVER_SERVER_CONTEXT_H_
#define FATHOM_SERVER_SERVER_CONTEXT_H_

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "grpcpp/server_context.h"
#include "grpcpp/support/server_callback.h"
#include "server/call_registry.h"
#include "server/change_feed.h"
#include "server/errors.h"
#include "server/limits.h"
#include "server/map_keeper.h"
#include "server/workers.h"
#include "storage/mission_file.h"

namespace fathom::server {

// The thread that asks is there too, and one helper does no harm on one core.
inline size_t BatchHelpers() {
  const size_t cores = std::thread::hardware_concurrency();
  return std::clamp<size_t>(cores, 2, kMaxBatchHelpers + 1) - 1;
}

// See file comment.
struct ServerContext {
  MapKeeper& keeper;
  storage::MissionFile& file;
  const Clock& clock;
  // What of the file could not be read at the start.
  std::vector<std::string> damage = {};
  // gRPC runs whatever callbacks are ready on the thread that starts an
  // operation. The keeper's two threads must not be caught up in that, so what
  // they have to tell a call - an ack to write, room to read on - is done by
  // the courier: small jobs, one thread, in order.
  Workers courier{1};
  // Long ones: a block of a region, a digest, a page of history.
  Workers workers{kWorkerThreads};
  // Trajectories and nearest obstacles.
  Workers searches{kSearchThreads};
  // Help gRPC's threads with the points of a batch.
  Workers batch_helpers{BatchHelpers()};
  // Watches, a thread for each kind: none waits for another kind, and all
  // together leave what other cores there are to the rest. A region's tile
  // takes 0.3 ms, a contact 10 us, a trajectory up to 60 ms.
  Workers region_watches{1};
  Workers contact_watches{1};
  Workers trajectory_watches{1};
  ChangeFeed changes{keeper};
  CallSlots watch_calls{kMaxWatchers};
  CallSlots trajectory_watch_calls{kMaxTrajectoryWatchers};
  CallSlots bulk_calls{kMaxBulkStreams};
  CallSlots search_calls{kMaxSearches};
  // SaveMission and VerifyMission: each reads the whole file and holds another
  // map.
  CallSlots file_calls{1};
  CallRegistry ingest_calls{kMaxIngestStreams};
  CallRegistry import_calls{kMaxImports};
  std::atomic<bool> draining{false};
  const std::chrono::steady_clock::time_point start =
      std::chrono::steady_clock::now();
};

// The named error for the keeper's storage fault.
inline absl::Status StorageFault(const StorageState& state) {
  return state.damaged ? StorageDamaged(state.fault) : StorageFull(state.fault);
}

// The named error for a status that the keeper (not the map) gave.
inline absl::Status KeeperError(const ServerContext& context,
                                const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kUnavailable:
      return ShuttingDown();
    case absl::StatusCode::kAborted:
      return QueueFull();
    case absl::StatusCode::kDataLoss:
    case absl::StatusCode::kResourceExhausted: {
      const StorageState state = context.keeper.storage_state();
      return state.fault.empty() ? status : StorageFault(state);
    }
    default:
      return status;
  }
}

// When a wait for a revision gives up: shortly before the client's deadline.
inline RevisionGate::Deadline WaitDeadline(
    const grpc::CallbackServerContext& call) {
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
      call.deadline() - std::chrono::system_clock::now());
  const auto wait = std::min(left - kRevisionWaitMargin, kMaxRevisionWait);
  return std::chrono::steady_clock::now() + wait;
}

// Runs `then(view)` once the map holds `min_revision`, or with the error why
// it does not. At once, on this thread, if it holds it already.
template <typename Then>
void AtRevision(ServerContext& context, const grpc::CallbackServerContext& call,
                uint64_t min_revision, Then then) {
  auto view = context.keeper.View();
  if (view->revision() >= min_revision) {
    then(absl::OkStatus(), std::move(view));
    return;
  }
  auto wake = [&context, min_revision, then](bool reached) {
    auto newest = context.keeper.View();
    then(reached ? absl::OkStatus()
                 : RevisionNotReached(min_revision, newest->revision()),
         newest);
  };
  if (!context.keeper.WaitForRevision(min_revision, WaitDeadline(call), wake)) {
    then(TooManyCalls("waits for min_revision", kMaxRevisionWaiters),
         std::move(view));
  }
}

}  // namespace fathom::server

#endif  // FATHOM_SERVER_SERVER_CONTEXT_H_
