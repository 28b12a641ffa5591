// The C++ client of a Fathom server: connect, ask, report, load charts.
//
//   FATHOM_ASSIGN_OR_RETURN(std::unique_ptr<Client> client,
//                           Client::Connect("127.0.0.1:7430", {}));
//   v1::QueryObstacleRequest request;
//   ...
//   FATHOM_ASSIGN_OR_RETURN(v1::QueryObstacleResponse answer,
//                           client->QueryObstacle(request));
//
// Messages are the contract's own (proto/fathom/v1), so their units, frames
// and ranges hold here unchanged. This library knows the contract, gRPC and
// base/ alone; nothing of the map.
//
// Errors. Every call returns an absl::Status with the server's code; its
// message ends with the paths of the offending fields where the server named
// them (errors.h). Beside the codes that the contract lists, every call can
// return UNAVAILABLE (no connection, server going down) and
// DEADLINE_EXCEEDED (ClientOptions::call_timeout passed).
//
// Retries. Calls that change nothing, and ReportContacts, which the server
// applies once however often it is sent, are repeated by gRPC on UNAVAILABLE:
// up to kMaxAttempts attempts within the call's timeout. StartActivity,
// CompleteActivity, TransferLocalMap, ImportPrior, SaveMission and
// DropContact are sent once.
//
// Thread safety: all methods of one Client may be called at once. Streams and
// writers that it opens hold the channel and may outlive it.

#ifndef FATHOM_CLIENT_CLIENT_H_
#define FATHOM_CLIENT_CLIENT_H_

#include <grpcpp/channel.h>
#include <grpcpp/security/credentials.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/contact_stream.h"
#include "client/ping_stream.h"
#include "client/prior_writer.h"
#include "client/region.h"
#include "client/watch.h"
#include "fathom/v1/ingest_service.grpc.pb.h"
#include "fathom/v1/mission_service.grpc.pb.h"
#include "fathom/v1/obstacle_service.grpc.pb.h"

namespace fathom::client {

// Largest message that the client sends or takes. 100 000 points with reasons
// and their contacts are below 16 MiB; a server may allow less
// (Limits.max_message_bytes).
inline constexpr std::size_t kMaxMessageBytes = 64u << 20;

// Attempts of one repeatable call, the first included: with waits of about
// 0.1, 0.2 and 0.4 s they span a server's restart on a warm file.
inline constexpr int kMaxAttempts = 4;

struct ClientOptions {
  // How long Connect waits for a server that answers; 0: it does not, the
  // first call does.
  std::chrono::milliseconds connect_timeout{5'000};
  // Deadline of each short call.
  std::chrono::milliseconds call_timeout{10'000};
  // Deadline of calls whose work grows with the map: CompleteActivity,
  // TransferLocalMap, ImportPrior, GetRegion, GetContactHistory, SaveMission,
  // VerifyMission.
  std::chrono::milliseconds long_call_timeout{600'000};
  // Null: plain text, for loopback and Unix sockets.
  std::shared_ptr<grpc::ChannelCredentials> credentials = nullptr;
};

class Client {
 public:
  // Connects to `address`: "host:port", "[::1]:port" or "unix:/path". Waits
  // until the transport is up.
  //
  // Errors: INVALID_ARGUMENT (empty address); UNAVAILABLE when no server
  // answers within connect_timeout.
  static absl::StatusOr<std::unique_ptr<Client>> Connect(
      const std::string& address, const ClientOptions& options);

  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  // --- Questions (ObstacleService) ---

  absl::StatusOr<v1::QueryObstacleResponse> QueryObstacle(
      const v1::QueryObstacleRequest& request) const;
  absl::StatusOr<v1::QueryObstaclesResponse> QueryObstacles(
      const v1::QueryObstaclesRequest& request) const;
  absl::StatusOr<v1::CheckTrajectoryResponse> CheckTrajectory(
      const v1::CheckTrajectoryRequest& request) const;
  absl::StatusOr<v1::FindNearestObstacleResponse> FindNearestObstacle(
      const v1::FindNearestObstacleRequest& request) const;
  absl::StatusOr<v1::ListContactsResponse> ListContacts(
      const v1::ListContactsRequest& request) const;

  // The area as one grid, put together from the server's tiles. `progress`,
  // if any, is told the cells that came and those of the whole after each
  // message. Errors: also INTERNAL when tiles do not fit the grid that the
  // server announced.
  using RegionProgress =
      std::function<void(std::uint64_t cells, std::uint64_t total)>;
  absl::StatusOr<Region> GetRegion(
      const v1::GetRegionRequest& request,
      const RegionProgress& progress = nullptr) const;

  // A contact's estimates, oldest first. Errors: NOT_FOUND.
  absl::StatusOr<std::vector<v1::ContactEstimate>> GetContactHistory(
      const v1::GetContactHistoryRequest& request) const;

  // Begin to watch; see watch.h. Whether the server takes the watch shows with
  // the first Next. No deadline: a watch lasts until it is cancelled.
  std::unique_ptr<RegionWatch> WatchRegion(
      const v1::WatchRegionRequest& request,
      const WatchOptions& options = {}) const;
  std::unique_ptr<ContactsWatch> WatchContacts(
      const v1::WatchContactsRequest& request = {},
      const WatchOptions& options = {}) const;
  std::unique_ptr<TrajectoryWatch> WatchTrajectory(
      const v1::WatchTrajectoryRequest& request,
      const WatchOptions& options = {}) const;

  // --- Evidence (IngestService) ---

  // Opens a stream of pings, or of contact reports; see ping_stream.h and
  // contact_stream.h. Errors: INVALID_ARGUMENT for bad options; whether the
  // server takes the stream shows with the first Send or Flush.
  absl::StatusOr<std::unique_ptr<PingStream>> OpenPingStream(
      const IngestStreamOptions& options) const;
  absl::StatusOr<std::unique_ptr<ContactStream>> OpenContactStream(
      const IngestStreamOptions& options) const;

  // A batch with numbers set by the caller; durable when it returns.
  absl::StatusOr<v1::ReportContactsResponse> ReportContacts(
      const v1::ReportContactsRequest& request) const;

  // --- The mission (MissionService) ---

  absl::StatusOr<v1::GetMissionStatusResponse> GetMissionStatus(
      const v1::GetMissionStatusRequest& request = {}) const;
  absl::StatusOr<v1::StartActivityResponse> StartActivity(
      const v1::StartActivityRequest& request) const;
  absl::StatusOr<v1::CompleteActivityResponse> CompleteActivity(
      const v1::CompleteActivityRequest& request) const;
  absl::StatusOr<v1::TransferLocalMapResponse> TransferLocalMap(
      const v1::TransferLocalMapRequest& request) const;
  absl::StatusOr<v1::SaveMissionResponse> SaveMission(
      const v1::SaveMissionRequest& request) const;
  absl::StatusOr<v1::VerifyMissionResponse> VerifyMission() const;
  absl::StatusOr<v1::DropContactResponse> DropContact(
      const v1::DropContactRequest& request) const;

  // Tiles of the import `import_id` that the mission holds; 0: none.
  absl::StatusOr<std::uint64_t> GetImport(const std::string& import_id) const;

  // Begins to load a chart; see prior_writer.h.
  absl::StatusOr<std::unique_ptr<PriorWriter>> ImportPrior(
      const v1::PriorHeader& header) const;

  // What Connect was given.
  const std::string& address() const { return address_; }

 private:
  Client(std::string address, const ClientOptions& options,
         std::shared_ptr<grpc::Channel> channel);

  const std::string address_;
  const ClientOptions options_;
  const std::shared_ptr<grpc::Channel> channel_;
  // Shared with the watches that it opened.
  const std::shared_ptr<v1::ObstacleService::Stub> obstacle_;
  const std::unique_ptr<v1::IngestService::Stub> ingest_;
  const std::unique_ptr<v1::MissionService::Stub> mission_;
};

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_CLIENT_H_
