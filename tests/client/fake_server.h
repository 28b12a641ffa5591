// A server of the whole contract that lives in the test's process, keeps
// almost nothing and fails on command. It is what the client is tested
// against; it knows no map.
//
// Ingest keeps, per stream kind, how often each number was applied and how
// far it is durable. A crash (cut with `lose_applied`) forgets what was
// applied and not yet durable, as kill -9 does.
//
// Thread safety: all methods may be called while calls are served.

#ifndef FATHOM_TESTS_CLIENT_FAKE_SERVER_H_
#define FATHOM_TESTS_CLIENT_FAKE_SERVER_H_

#include <grpcpp/server.h>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "fathom/v1/ingest_service.grpc.pb.h"
#include "fathom/v1/mission_service.grpc.pb.h"
#include "fathom/v1/obstacle_service.grpc.pb.h"

namespace fathom::client {

// A status with google.rpc.BadRequest naming one field, as fathomd sends it.
grpc::Status BadField(const std::string& field, const std::string& description);

// The receiving end of one kind of ingest stream.
class FakeLedger {
 public:
  // After `messages` more messages the stream ends with `status`; with
  // `lose_applied` what is not durable is forgotten.
  void CutAfter(int messages, grpc::Status status, bool lose_applied);
  // Nothing becomes durable (and no ack says so) until it is set back.
  void HoldDurable(bool hold);

  // How often number `sequence` was applied.
  int times_applied(std::uint64_t sequence) const;
  std::uint64_t durable() const;
  std::uint64_t messages_received() const;
  // Waits until that many messages were received, over all streams.
  void AwaitReceived(std::uint64_t messages);

  // --- For the services ---
  // Takes one message; false: end the stream with cut_status().
  bool Take(std::uint64_t epoch, std::uint64_t sequence);
  grpc::Status cut_status() const;
  // Makes everything applied durable, unless held. True if it grew.
  bool Commit();
  struct Position {
    std::uint64_t epoch, applied, durable, taken, duplicates;
  };
  Position position() const;
  std::vector<v1::SequenceGap> TakeGaps();
  void BeginStream();

 private:
  mutable Mutex mutex_;
  CondVar received_more_;
  std::map<std::uint64_t, int> times_ FATHOM_GUARDED_BY(mutex_);
  std::uint64_t epoch_ FATHOM_GUARDED_BY(mutex_) = 0;
  std::uint64_t applied_ FATHOM_GUARDED_BY(mutex_) = 0;
  std::uint64_t durable_ FATHOM_GUARDED_BY(mutex_) = 0;
  std::uint64_t received_ FATHOM_GUARDED_BY(mutex_) = 0;
  std::uint64_t stream_applied_ FATHOM_GUARDED_BY(mutex_) = 0;
  std::uint64_t stream_duplicates_ FATHOM_GUARDED_BY(mutex_) = 0;
  int cut_after_ FATHOM_GUARDED_BY(mutex_) = -1;
  bool lose_applied_ FATHOM_GUARDED_BY(mutex_) = false;
  bool hold_durable_ FATHOM_GUARDED_BY(mutex_) = false;
  grpc::Status cut_status_ FATHOM_GUARDED_BY(mutex_);
  std::vector<v1::SequenceGap> gaps_ FATHOM_GUARDED_BY(mutex_);
};

class FakeServer final : public v1::ObstacleService::Service,
                         public v1::IngestService::Service,
                         public v1::MissionService::Service {
 public:
  // Listens on a free loopback port.
  FakeServer();
  ~FakeServer() override;

  // "127.0.0.1:port"; the same after Stop and Start.
  const std::string& address() const { return address_; }
  void Stop();
  void Start();

  // The next `times` calls of `method` ("QueryObstacle") answer `status`.
  void FailNext(const std::string& method, int times, grpc::Status status);
  // Calls of `method` so far, failed ones included.
  int calls(const std::string& method) const;

  FakeLedger pings;
  FakeLedger contacts;
  // Answered by GetRegion, message by message.
  std::vector<v1::GetRegionResponse> region;
  // Taken by ImportPrior.
  std::vector<v1::DepthTile> tiles;
  v1::PriorHeader header;
  // Answered by GetImport.
  std::uint64_t tiles_held = 0;
  // Answered by GetMissionStatus.
  v1::GetMissionStatusResponse mission;
  // QueryObstacles answers from this revision; with echo_latitude each mean
  // depth is the point's latitude, and the first point has a contact.
  std::uint64_t batch_revision = 0;
  bool echo_latitude = false;
  // Requests as they came.
  v1::QueryObstacleRequest last_query;
  v1::QueryObstaclesRequest last_batch;
  v1::StartActivityRequest last_start;

  grpc::Status QueryObstacle(grpc::ServerContext* context,
                             const v1::QueryObstacleRequest* request,
                             v1::QueryObstacleResponse* response) override;
  grpc::Status QueryObstacles(grpc::ServerContext* context,
                              const v1::QueryObstaclesRequest* request,
                              v1::QueryObstaclesResponse* response) override;
  grpc::Status GetRegion(
      grpc::ServerContext* context, const v1::GetRegionRequest* request,
      grpc::ServerWriter<v1::GetRegionResponse>* writer) override;
  grpc::Status StreamPings(
      grpc::ServerContext* context,
      grpc::ServerReaderWriter<v1::StreamPingsResponse, v1::StreamPingsRequest>*
          stream) override;
  grpc::Status StreamContacts(
      grpc::ServerContext* context,
      grpc::ServerReaderWriter<v1::StreamContactsResponse,
                               v1::StreamContactsRequest>* stream) override;
  grpc::Status StartActivity(grpc::ServerContext* context,
                             const v1::StartActivityRequest* request,
                             v1::StartActivityResponse* response) override;
  grpc::Status GetMissionStatus(
      grpc::ServerContext* context, const v1::GetMissionStatusRequest* request,
      v1::GetMissionStatusResponse* response) override;
  grpc::Status GetImport(grpc::ServerContext* context,
                         const v1::GetImportRequest* request,
                         v1::GetImportResponse* response) override;
  grpc::Status ImportPrior(grpc::ServerContext* context,
                           grpc::ServerReader<v1::ImportPriorRequest>* reader,
                           v1::ImportPriorResponse* response) override;

 private:
  // Counts the call; the status it must answer with.
  grpc::Status Enter(const std::string& method);

  struct Failures {
    int times = 0;
    grpc::Status status;
  };

  std::string address_;
  std::unique_ptr<grpc::Server> server_;
  mutable Mutex mutex_;
  std::map<std::string, int> calls_ FATHOM_GUARDED_BY(mutex_);
  std::map<std::string, Failures> failures_ FATHOM_GUARDED_BY(mutex_);
};

}  // namespace fathom::client

#endif  // FATHOM_TESTS_CLIENT_FAKE_SERVER_H_
