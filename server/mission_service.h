// MissionService: activities, charts, status. Changes are answered when they
// are durable.
//
// Thread-safe; `context` must outlive it.

#ifndef FATHOM_SERVER_MISSION_SERVICE_H_
#define FATHOM_SERVER_MISSION_SERVICE_H_

#include "fathom/v1/mission_service.grpc.pb.h"
#include "server/server_context.h"

namespace fathom::server {

// See file comment.
class MissionService final : public v1::MissionService::CallbackService {
 public:
  explicit MissionService(ServerContext& context) : context_(context) {}

  grpc::ServerUnaryReactor* StartActivity(
      grpc::CallbackServerContext* call,
      const v1::StartActivityRequest* request,
      v1::StartActivityResponse* response) override;
  grpc::ServerUnaryReactor* CompleteActivity(
      grpc::CallbackServerContext* call,
      const v1::CompleteActivityRequest* request,
      v1::CompleteActivityResponse* response) override;
  grpc::ServerUnaryReactor* TransferLocalMap(
      grpc::CallbackServerContext* call,
      const v1::TransferLocalMapRequest* request,
      v1::TransferLocalMapResponse* response) override;
  grpc::ServerReadReactor<v1::ImportPriorRequest>* ImportPrior(
      grpc::CallbackServerContext* call,
      v1::ImportPriorResponse* response) override;
  grpc::ServerUnaryReactor* GetImport(grpc::CallbackServerContext* call,
                                      const v1::GetImportRequest* request,
                                      v1::GetImportResponse* response) override;
  grpc::ServerUnaryReactor* GetMissionStatus(
      grpc::CallbackServerContext* call,
      const v1::GetMissionStatusRequest* request,
      v1::GetMissionStatusResponse* response) override;
  grpc::ServerUnaryReactor* DropContact(
      grpc::CallbackServerContext* call, const v1::DropContactRequest* request,
      v1::DropContactResponse* response) override;

  // In the contract, not offered yet: UNIMPLEMENTED.
  grpc::ServerUnaryReactor* SaveMission(
      grpc::CallbackServerContext* call, const v1::SaveMissionRequest* request,
      v1::SaveMissionResponse* response) override;
  grpc::ServerUnaryReactor* VerifyMission(
      grpc::CallbackServerContext* call,
      const v1::VerifyMissionRequest* request,
      v1::VerifyMissionResponse* response) override;

 private:
  // Answers with the status of `job`, which runs on a worker and fills the
  // response; one such job at a time. RESOURCE_EXHAUSTED if one runs.
  template <typename Job>
  grpc::ServerUnaryReactor* WorkOnFile(grpc::CallbackServerContext* call,
                                       Job job);

  ServerContext& context_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_MISSION_SERVICE_H_
