#include "server/obstacle_service.h"

#include <atomic>
#include <deque>
#include <memory>
#include <utility>
#include <vector>

#include "base/status_macros.h"
#include "map/obstacle_map/check_trajectory.h"
#include "map/obstacle_map/find_nearest.h"
#include "server/convert_common.h"
#include "server/convert_query.h"
#include "server/convert_trajectory.h"
#include "server/field_checks.h"
#include "server/history_call.h"
#include "server/region.h"
#include "server/search_call.h"
#include "server/watch_contacts.h"
#include "server/watch_region.h"
#include "server/watch_stream.h"
#include "server/watch_trajectory.h"

namespace fathom::server {
namespace {

using ViewPtr = std::shared_ptr<const map::ObstacleMapView>;

grpc::ServerUnaryReactor* Reply(grpc::CallbackServerContext* call,
                                const absl::Status& status) {
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  reactor->Finish(ToGrpc(status));
  return reactor;
}

absl::Status TooManyBulkStreams() {
  return TooManyCalls("GetRegion and GetContactHistory streams",
                      kMaxBulkStreams);
}

absl::Status TooManySearches() {
  return TooManyCalls("CheckTrajectory and FindNearestObstacle calls",
                      kMaxSearches);
}

// What the map says of a search, as the client is to see it.
absl::Status SearchError(const absl::Status& status, const char* path) {
  return absl::IsResourceExhausted(status) ? TooManyCells(path, kMaxSearchCells)
                                           : status;
}

// A server stream that ends at once with an error.
template <typename Response>
class FailedStream final : public grpc::ServerWriteReactor<Response> {
 public:
  explicit FailedStream(const absl::Status& status) {
    this->Finish(ToGrpc(status));
  }
  void OnDone() override { delete this; }
};

// Writes one block of a region after the other, as fast as the client reads.
// Blocks are made by a worker; at any time a block is being made or a write is
// under way, so the state needs no mutex.
class RegionStream final
    : public grpc::ServerWriteReactor<v1::GetRegionResponse> {
 public:
  RegionStream(ServerContext& context, Region region)
      : context_(context), region_(std::move(region)) {}

  void Begin(const absl::Status& status, ViewPtr view) {
    const absl::Status opened =
        status.ok() ? region_.Open(std::move(view)) : status;
    if (!opened.ok()) {
      Finish(ToGrpc(opened));
      return;
    }
    WriteNext();
  }
  void OnWriteDone(bool ok) override {
    if (!ok) gone_ = true;
    WriteNext();
  }
  // May come while a worker makes a block: it then stops and finishes.
  void OnCancel() override { gone_ = true; }
  void OnDone() override {
    context_.bulk_calls.GiveBack();
    delete this;
  }

 private:
  void WriteNext() {
    context_.workers.Give([this] {
      const Region::Step step = gone_ || context_.draining
                                    ? Region::Step::kStopped
                                    : region_.Next(gone_, &response_);
      switch (step) {
        case Region::Step::kBlock:
          StartWrite(&response_);
          break;
        case Region::Step::kEnd:
          Finish(grpc::Status::OK);
          break;
        case Region::Step::kStopped:
          Finish(ToGrpc(gone_ ? absl::CancelledError("the client has gone")
                              : ShuttingDown()));
          break;
      }
    });
  }

  ServerContext& context_;
  Region region_;
  v1::GetRegionResponse response_;
  std::atomic<bool> gone_{false};
};

// Starts a watch if it could be made and a slot of each of `slots` is free.
template <typename Watch>
grpc::ServerWriteReactor<typename Watch::Response>* StartWatch(
    ServerContext& context, Workers& workers, absl::StatusOr<Watch> watch,
    const std::vector<CallSlots*>& slots) {
  using Failed = FailedStream<typename Watch::Response>;
  if (!watch.ok()) return new Failed(watch.status());
  for (size_t i = 0; i < slots.size(); ++i) {
    if (slots[i]->Take()) continue;
    for (size_t taken = 0; taken < i; ++taken) slots[taken]->GiveBack();
    return new Failed(TooManyCalls(i == 0 ? "watches" : "trajectory watches",
                                   slots[i]->limit()));
  }
  const auto stream = std::make_shared<WatchStream<Watch>>(
      context, workers, *std::move(watch), slots);
  stream->Begin();
  return stream.get();
}

}  // namespace

grpc::ServerUnaryReactor* ObstacleService::QueryObstacle(
    grpc::CallbackServerContext* call, const v1::QueryObstacleRequest* request,
    v1::QueryObstacleResponse* response) {
  absl::StatusOr<map::ObstacleQuery> query =
      ConvertQuery(*request, context_.clock.Now());
  if (!query.ok()) return Reply(call, query.status());
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  AtRevision(context_, *call, request->min_revision(),
             [reactor, response, query = *query](const absl::Status& status,
                                                 const ViewPtr& view) {
               if (status.ok()) {
                 WriteAnswer(view->Answer(query), response->mutable_answer());
                 WriteStamp(*view, response->mutable_stamp());
               }
               reactor->Finish(ToGrpc(status));
             });
  return reactor;
}

grpc::ServerUnaryReactor* ObstacleService::QueryObstacles(
    grpc::CallbackServerContext* call, const v1::QueryObstaclesRequest* request,
    v1::QueryObstaclesResponse* response) {
  const Time now = context_.clock.Now();
  if (request->min_revision() > 0) {
    // A request that will be refused must not wait first.
    const absl::Status checked = CheckBatch(*request);
    if (!checked.ok()) return Reply(call, checked);
  }
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  AtRevision(context_, *call, request->min_revision(),
             [this, call, reactor, request, response, now](
                 const absl::Status& status, const ViewPtr& view) {
               reactor->Finish(ToGrpc(
                   status.ok() ? AnswerBatch(
                                     *request, now, *view, response,
                                     [call] { return call->IsCancelled(); },
                                     &context_.batch_helpers)
                               : status));
             });
  return reactor;
}

grpc::ServerWriteReactor<v1::GetRegionResponse>* ObstacleService::GetRegion(
    grpc::CallbackServerContext* call, const v1::GetRegionRequest* request) {
  absl::StatusOr<Region> region =
      Region::Create(*request, context_.clock.Now());
  if (!region.ok()) {
    return new FailedStream<v1::GetRegionResponse>(region.status());
  }
  if (!context_.bulk_calls.Take()) {
    return new FailedStream<v1::GetRegionResponse>(TooManyBulkStreams());
  }
  auto* stream = new RegionStream(context_, *std::move(region));
  AtRevision(context_, *call, request->min_revision(),
             [stream](const absl::Status& status, const ViewPtr& view) {
               stream->Begin(status, view);
             });
  return stream;
}

grpc::ServerUnaryReactor* ObstacleService::ListContacts(
    grpc::CallbackServerContext* call, const v1::ListContactsRequest* request,
    v1::ListContactsResponse* response) {
  Time time = context_.clock.Now();
  if (request->has_time()) {
    const FieldPath root;
    const auto checked = CheckTime(request->time(), FieldPath(root, "time"));
    if (!checked.ok()) return Reply(call, checked.status());
    time = *checked;
  }
  fathom::server::ListContacts(*context_.keeper.View(), time,
                               request->include_inactive(), response);
  return Reply(call, absl::OkStatus());
}

grpc::ServerWriteReactor<v1::GetContactHistoryResponse>*
ObstacleService::GetContactHistory(
    grpc::CallbackServerContext*, const v1::GetContactHistoryRequest* request) {
  if (!context_.bulk_calls.Take()) {
    return new FailedStream<v1::GetContactHistoryResponse>(
        TooManyBulkStreams());
  }
  return new HistoryStream(context_, *request);
}

grpc::ServerUnaryReactor* ObstacleService::CheckTrajectory(
    grpc::CallbackServerContext* call,
    const v1::CheckTrajectoryRequest* request,
    v1::CheckTrajectoryResponse* response) {
  const FieldPath root;
  const FieldPath path(root, "trajectory");
  absl::StatusOr<map::Trajectory> trajectory =
      ConvertTrajectory(request->trajectory(), path);
  if (!trajectory.ok()) return Reply(call, trajectory.status());
  if (!context_.search_calls.Take()) return Reply(call, TooManySearches());
  auto* search = new SearchCall(
      context_,
      [response, stop_at_first = request->stop_at_first(),
       trajectory = *std::move(trajectory)](
          const map::ObstacleMapView& view,
          const std::atomic<bool>& stop) -> absl::Status {
        const auto verdict =
            map::CheckTrajectory(view, trajectory,
                                 {.stop_at_first = stop_at_first,
                                  .most_cells = kMaxSearchCells,
                                  .stop = &stop});
        if (!verdict.ok()) {
          return SearchError(verdict.status(), "trajectory.waypoints");
        }
        WriteVerdict(*verdict, response);
        WriteStamp(view, response->mutable_stamp());
        return absl::OkStatus();
      });
  AtRevision(context_, *call, request->min_revision(),
             [search](const absl::Status& status, const ViewPtr& view) {
               search->Begin(status, view);
             });
  return search;
}

grpc::ServerUnaryReactor* ObstacleService::FindNearestObstacle(
    grpc::CallbackServerContext* call,
    const v1::FindNearestObstacleRequest* request,
    v1::FindNearestObstacleResponse* response) {
  absl::StatusOr<map::NearestQuestion> question =
      ConvertNearest(*request, context_.clock.Now());
  if (!question.ok()) return Reply(call, question.status());
  if (!context_.search_calls.Take()) return Reply(call, TooManySearches());
  auto* search = new SearchCall(
      context_,
      [response, question = *question](
          const map::ObstacleMapView& view,
          const std::atomic<bool>& stop) -> absl::Status {
        const auto nearest = map::FindNearestObstacle(
            view, question, {.most_cells = kMaxSearchCells, .stop = &stop});
        if (!nearest.ok()) {
          return SearchError(nearest.status(), "search_radius_m");
        }
        if (nearest->has_value()) WriteNearest(**nearest, response);
        WriteStamp(view, response->mutable_stamp());
        return absl::OkStatus();
      });
  search->Begin(absl::OkStatus(), context_.keeper.View());
  return search;
}

grpc::ServerWriteReactor<v1::WatchRegionResponse>* ObstacleService::WatchRegion(
    grpc::CallbackServerContext*, const v1::WatchRegionRequest* request) {
  return StartWatch(
      context_, context_.region_watches,
      RegionWatch::Create(*request, context_.changes.log(), context_.clock),
      {&context_.watch_calls});
}

grpc::ServerWriteReactor<v1::WatchContactsResponse>*
ObstacleService::WatchContacts(grpc::CallbackServerContext*,
                               const v1::WatchContactsRequest* request) {
  return StartWatch<ContactsWatch>(
      context_, context_.contact_watches,
      ContactsWatch(*request, context_.changes.log()), {&context_.watch_calls});
}

grpc::ServerWriteReactor<v1::WatchTrajectoryResponse>*
ObstacleService::WatchTrajectory(grpc::CallbackServerContext*,
                                 const v1::WatchTrajectoryRequest* request) {
  return StartWatch(context_, context_.trajectory_watches,
                    TrajectoryWatch::Create(*request, context_.changes.log()),
                    {&context_.watch_calls, &context_.trajectory_watch_calls});
}

}  // namespace fathom::server
