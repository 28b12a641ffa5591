// ObstacleService: questions to the map. Thin: convert, ask an immutable view,
// convert back. No handler blocks on the writer or the disk but
// GetContactHistory, which reads the file through a connection of its own.
//
// Thread-safe; `context` must outlive it.

#ifndef FATHOM_SERVER_OBSTACLE_SERVICE_H_
#define FATHOM_SERVER_OBSTACLE_SERVICE_H_

#include "fathom/v1/obstacle_service.grpc.pb.h"
#include "server/server_context.h"

namespace fathom::server {

// See file comment.
class ObstacleService final : public v1::ObstacleService::CallbackService {
 public:
  explicit ObstacleService(ServerContext& context) : context_(context) {}

  grpc::ServerUnaryReactor* QueryObstacle(
      grpc::CallbackServerContext* call,
      const v1::QueryObstacleRequest* request,
      v1::QueryObstacleResponse* response) override;
  grpc::ServerUnaryReactor* QueryObstacles(
      grpc::CallbackServerContext* call,
      const v1::QueryObstaclesRequest* request,
      v1::QueryObstaclesResponse* response) override;
  grpc::ServerWriteReactor<v1::GetRegionResponse>* GetRegion(
      grpc::CallbackServerContext* call,
      const v1::GetRegionRequest* request) override;
  grpc::ServerUnaryReactor* ListContacts(
      grpc::CallbackServerContext* call, const v1::ListContactsRequest* request,
      v1::ListContactsResponse* response) override;
  grpc::ServerWriteReactor<v1::GetContactHistoryResponse>* GetContactHistory(
      grpc::CallbackServerContext* call,
      const v1::GetContactHistoryRequest* request) override;

  grpc::ServerUnaryReactor* CheckTrajectory(
      grpc::CallbackServerContext* call,
      const v1::CheckTrajectoryRequest* request,
      v1::CheckTrajectoryResponse* response) override;
  grpc::ServerUnaryReactor* FindNearestObstacle(
      grpc::CallbackServerContext* call,
      const v1::FindNearestObstacleRequest* request,
      v1::FindNearestObstacleResponse* response) override;

  // In the contract, not offered yet: UNIMPLEMENTED.
  grpc::ServerWriteReactor<v1::WatchRegionResponse>* WatchRegion(
      grpc::CallbackServerContext* call,
      const v1::WatchRegionRequest* request) override;
  grpc::ServerWriteReactor<v1::WatchContactsResponse>* WatchContacts(
      grpc::CallbackServerContext* call,
      const v1::WatchContactsRequest* request) override;
  grpc::ServerWriteReactor<v1::WatchTrajectoryResponse>* WatchTrajectory(
      grpc::CallbackServerContext* call,
      const v1::WatchTrajectoryRequest* request) override;

 private:
  ServerContext& context_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_OBSTACLE_SERVICE_H_
