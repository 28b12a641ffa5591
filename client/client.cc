#include "client/client.h"

#include <grpcpp/client_context.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/support/channel_arguments.h>

#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/errors.h"

namespace fathom::client {
namespace {

// gRPC's own waits between attempts to connect, which default to 1 s and
// 120 s: a vehicle's server comes back in seconds, and so should we.
constexpr int kMinReconnectMs = 100;
constexpr int kMaxReconnectMs = 2'000;

// Which calls gRPC repeats by itself (client.h says why these).
std::string ServiceConfig() {
  static constexpr const char* kRepeatable[][2] = {
      {"fathom.v1.ObstacleService", "QueryObstacle"},
      {"fathom.v1.ObstacleService", "QueryObstacles"},
      {"fathom.v1.ObstacleService", "CheckTrajectory"},
      {"fathom.v1.ObstacleService", "FindNearestObstacle"},
      {"fathom.v1.ObstacleService", "GetRegion"},
      {"fathom.v1.ObstacleService", "ListContacts"},
      {"fathom.v1.ObstacleService", "GetContactHistory"},
      {"fathom.v1.IngestService", "ReportContacts"},
      {"fathom.v1.MissionService", "GetImport"},
      {"fathom.v1.MissionService", "GetMissionStatus"},
      {"fathom.v1.MissionService", "VerifyMission"},
  };
  std::string names;
  for (const auto& [service, method] : kRepeatable) {
    names += absl::StrFormat(R"(%s{"service":"%s","method":"%s"})",
                             names.empty() ? "" : ",", service, method);
  }
  return absl::StrFormat(
      R"({"methodConfig":[{"name":[%s],"retryPolicy":{"maxAttempts":%d,)"
      R"("initialBackoff":"0.1s","maxBackoff":"1s","backoffMultiplier":2,)"
      R"("retryableStatusCodes":["UNAVAILABLE"]}}]})",
      names, kMaxAttempts);
}

// One unary call with its deadline.
template <typename Response, typename Stub, typename Method, typename Request>
absl::StatusOr<Response> Call(Stub& stub, Method method, const Request& request,
                              std::chrono::milliseconds timeout) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + timeout);
  Response response;
  FATHOM_RETURN_IF_ERROR(
      FromGrpc((stub.*method)(&context, request, &response)));
  return response;
}

}  // namespace

absl::StatusOr<std::unique_ptr<Client>> Client::Connect(
    const std::string& address, const ClientOptions& options) {
  if (address.empty()) {
    return absl::InvalidArgumentError(
        "address is empty: say host:port or unix:/path");
  }
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(static_cast<int>(kMaxMessageBytes));
  arguments.SetMaxSendMessageSize(static_cast<int>(kMaxMessageBytes));
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, kMinReconnectMs);
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, kMinReconnectMs);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, kMaxReconnectMs);
  // Channels of one process to one server do not share a connection: a
  // stream's flow control must not slow another client's questions.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetServiceConfigJSON(ServiceConfig());
  std::shared_ptr<grpc::Channel> channel = grpc::CreateCustomChannel(
      address,
      options.credentials != nullptr ? options.credentials
                                     : grpc::InsecureChannelCredentials(),
      arguments);
  if (options.connect_timeout.count() > 0 &&
      !channel->WaitForConnected(std::chrono::system_clock::now() +
                                 options.connect_timeout)) {
    return absl::UnavailableError(absl::StrFormat(
        "no Fathom server answers at %s within %d ms: is fathomd running "
        "there%s?",
        address, options.connect_timeout.count(),
        options.credentials != nullptr
            ? ", for this name and authority, and does it know our certificate"
            : ", and does it speak plain text"));
  }
  return std::unique_ptr<Client>(
      new Client(address, options, std::move(channel)));
}

Client::Client(std::string address, const ClientOptions& options,
               std::shared_ptr<grpc::Channel> channel)
    : address_(std::move(address)),
      options_(options),
      channel_(std::move(channel)),
      obstacle_(v1::ObstacleService::NewStub(channel_)),
      ingest_(v1::IngestService::NewStub(channel_)),
      mission_(v1::MissionService::NewStub(channel_)) {}

absl::StatusOr<v1::QueryObstacleResponse> Client::QueryObstacle(
    const v1::QueryObstacleRequest& request) const {
  return Call<v1::QueryObstacleResponse>(
      *obstacle_, &v1::ObstacleService::Stub::QueryObstacle, request,
      options_.call_timeout);
}

absl::StatusOr<v1::QueryObstaclesResponse> Client::QueryObstacles(
    const v1::QueryObstaclesRequest& request) const {
  return Call<v1::QueryObstaclesResponse>(
      *obstacle_, &v1::ObstacleService::Stub::QueryObstacles, request,
      options_.call_timeout);
}

absl::StatusOr<v1::CheckTrajectoryResponse> Client::CheckTrajectory(
    const v1::CheckTrajectoryRequest& request) const {
  return Call<v1::CheckTrajectoryResponse>(
      *obstacle_, &v1::ObstacleService::Stub::CheckTrajectory, request,
      options_.call_timeout);
}

absl::StatusOr<v1::FindNearestObstacleResponse> Client::FindNearestObstacle(
    const v1::FindNearestObstacleRequest& request) const {
  return Call<v1::FindNearestObstacleResponse>(
      *obstacle_, &v1::ObstacleService::Stub::FindNearestObstacle, request,
      options_.call_timeout);
}

absl::StatusOr<v1::ListContactsResponse> Client::ListContacts(
    const v1::ListContactsRequest& request) const {
  return Call<v1::ListContactsResponse>(
      *obstacle_, &v1::ObstacleService::Stub::ListContacts, request,
      options_.call_timeout);
}

absl::StatusOr<Region> Client::GetRegion(const v1::GetRegionRequest& request,
                                         const RegionProgress& progress) const {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() +
                       options_.long_call_timeout);
  const auto reader = obstacle_->GetRegion(&context, request);
  RegionAssembler assembler;
  v1::GetRegionResponse message;
  absl::Status fit;
  while (fit.ok() && reader->Read(&message)) {
    fit = assembler.Add(message);
    if (fit.ok() && progress != nullptr) {
      progress(assembler.cells_seen(), assembler.cells_total());
    }
  }
  if (!fit.ok()) context.TryCancel();
  const absl::Status end = FromGrpc(reader->Finish());
  FATHOM_RETURN_IF_ERROR(fit);
  FATHOM_RETURN_IF_ERROR(end);
  return assembler.Take();
}

absl::StatusOr<std::vector<v1::ContactEstimate>> Client::GetContactHistory(
    const v1::GetContactHistoryRequest& request) const {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() +
                       options_.long_call_timeout);
  const auto reader = obstacle_->GetContactHistory(&context, request);
  std::vector<v1::ContactEstimate> estimates;
  v1::GetContactHistoryResponse message;
  while (reader->Read(&message)) {
    for (v1::ContactEstimate& estimate : *message.mutable_estimates()) {
      estimates.push_back(std::move(estimate));
    }
  }
  FATHOM_RETURN_IF_ERROR(FromGrpc(reader->Finish()));
  return estimates;
}

std::unique_ptr<RegionWatch> Client::WatchRegion(
    const v1::WatchRegionRequest& request, const WatchOptions& options) const {
  return std::make_unique<RegionWatch>(
      [stub = obstacle_](auto* context, const auto& asked) {
        return stub->WatchRegion(context, asked);
      },
      request, options);
}

std::unique_ptr<ContactsWatch> Client::WatchContacts(
    const v1::WatchContactsRequest& request,
    const WatchOptions& options) const {
  v1::WatchContactsRequest batched = request;
  batched.set_batched(true);
  return std::make_unique<ContactsWatch>(
      [stub = obstacle_](auto* context, const auto& asked) {
        return stub->WatchContacts(context, asked);
      },
      std::move(batched), options);
}

std::unique_ptr<TrajectoryWatch> Client::WatchTrajectory(
    const v1::WatchTrajectoryRequest& request,
    const WatchOptions& options) const {
  return std::make_unique<TrajectoryWatch>(
      [stub = obstacle_](auto* context, const auto& asked) {
        return stub->WatchTrajectory(context, asked);
      },
      request, options);
}

absl::StatusOr<std::unique_ptr<PingStream>> Client::OpenPingStream(
    const IngestStreamOptions& options) const {
  return PingStream::Open(channel_, options);
}

absl::StatusOr<std::unique_ptr<ContactStream>> Client::OpenContactStream(
    const IngestStreamOptions& options) const {
  return ContactStream::Open(channel_, options);
}

absl::StatusOr<v1::ReportContactsResponse> Client::ReportContacts(
    const v1::ReportContactsRequest& request) const {
  return Call<v1::ReportContactsResponse>(
      *ingest_, &v1::IngestService::Stub::ReportContacts, request,
      options_.call_timeout);
}

absl::StatusOr<v1::GetMissionStatusResponse> Client::GetMissionStatus(
    const v1::GetMissionStatusRequest& request) const {
  return Call<v1::GetMissionStatusResponse>(
      *mission_, &v1::MissionService::Stub::GetMissionStatus, request,
      request.with_digest() ? options_.long_call_timeout
                            : options_.call_timeout);
}

absl::StatusOr<v1::StartActivityResponse> Client::StartActivity(
    const v1::StartActivityRequest& request) const {
  return Call<v1::StartActivityResponse>(
      *mission_, &v1::MissionService::Stub::StartActivity, request,
      options_.call_timeout);
}

absl::StatusOr<v1::CompleteActivityResponse> Client::CompleteActivity(
    const v1::CompleteActivityRequest& request) const {
  return Call<v1::CompleteActivityResponse>(
      *mission_, &v1::MissionService::Stub::CompleteActivity, request,
      options_.long_call_timeout);
}

absl::StatusOr<v1::TransferLocalMapResponse> Client::TransferLocalMap(
    const v1::TransferLocalMapRequest& request) const {
  return Call<v1::TransferLocalMapResponse>(
      *mission_, &v1::MissionService::Stub::TransferLocalMap, request,
      options_.long_call_timeout);
}

absl::StatusOr<v1::SaveMissionResponse> Client::SaveMission(
    const v1::SaveMissionRequest& request) const {
  return Call<v1::SaveMissionResponse>(*mission_,
                                       &v1::MissionService::Stub::SaveMission,
                                       request, options_.long_call_timeout);
}

absl::StatusOr<v1::VerifyMissionResponse> Client::VerifyMission() const {
  return Call<v1::VerifyMissionResponse>(
      *mission_, &v1::MissionService::Stub::VerifyMission,
      v1::VerifyMissionRequest(), options_.long_call_timeout);
}

absl::StatusOr<v1::DropContactResponse> Client::DropContact(
    const v1::DropContactRequest& request) const {
  return Call<v1::DropContactResponse>(*mission_,
                                       &v1::MissionService::Stub::DropContact,
                                       request, options_.call_timeout);
}

absl::StatusOr<std::uint64_t> Client::GetImport(
    const std::string& import_id) const {
  v1::GetImportRequest request;
  request.set_import_id(import_id);
  FATHOM_ASSIGN_OR_RETURN(const v1::GetImportResponse response,
                          Call<v1::GetImportResponse>(
                              *mission_, &v1::MissionService::Stub::GetImport,
                              request, options_.call_timeout));
  return response.tiles();
}

absl::StatusOr<std::unique_ptr<PriorWriter>> Client::ImportPrior(
    const v1::PriorHeader& header) const {
  return PriorWriter::Open(*mission_, header, options_.long_call_timeout);
}

}  // namespace fathom::client
