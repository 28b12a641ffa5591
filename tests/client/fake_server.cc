#include "tests/client/fake_server.h"

#include <grpcpp/server_builder.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <utility>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace fathom::client {
namespace {

// How often acks are looked after: fathomd's group commit takes 2 to 20 ms.
constexpr std::chrono::milliseconds kCommitPeriod{2};

template <typename Response>
void FillAck(FakeLedger& ledger, Response& ack) {
  const FakeLedger::Position at = ledger.position();
  ack.set_epoch(at.epoch);
  ack.set_applied_sequence(at.applied);
  ack.set_durable_sequence(at.durable);
  ack.set_map_revision(1000 + at.applied);
  for (const v1::SequenceGap& gap : ledger.TakeGaps()) *ack.add_gaps() = gap;
  if constexpr (std::is_same_v<Response, v1::StreamPingsResponse>) {
    ack.set_pings_applied(at.taken);
    ack.set_pings_duplicate(at.duplicates);
  } else {
    ack.set_reports_applied(at.taken);
    ack.set_reports_duplicate(at.duplicates);
  }
}

// Reads until the client is done or the ledger cuts; a second thread commits
// and acknowledges.
template <typename Response, typename Request, typename GetMessage>
grpc::Status Serve(FakeLedger& ledger, GetMessage get_message,
                   grpc::ServerContext* context,
                   grpc::ServerReaderWriter<Response, Request>* stream) {
  ledger.BeginStream();
  std::atomic<bool> done = false;
  std::thread committer([&]() {
    while (!done.load()) {
      std::this_thread::sleep_for(kCommitPeriod);
      if (!ledger.Commit()) continue;
      Response ack;
      FillAck(ledger, ack);
      stream->Write(ack);
    }
  });
  Request request;
  bool cut = false;
  while (!cut && stream->Read(&request)) {
    const auto& message = get_message(request);
    cut = !ledger.Take(message.epoch(), message.sequence());
  }
  done.store(true);
  committer.join();
  if (cut) return ledger.cut_status();
  if (context->IsCancelled()) return grpc::Status::CANCELLED;
  ledger.Commit();
  Response ack;
  FillAck(ledger, ack);
  stream->Write(ack);
  return grpc::Status::OK;
}

}  // namespace

grpc::Status BadField(const std::string& field,
                      const std::string& description) {
  google::rpc::BadRequest bad_request;
  auto* violation = bad_request.add_field_violations();
  violation->set_field(field);
  violation->set_description(description);
  google::rpc::Status rich;
  rich.set_code(grpc::StatusCode::INVALID_ARGUMENT);
  rich.set_message("the request is not valid");
  rich.add_details()->PackFrom(bad_request);
  return grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, rich.message(),
                      rich.SerializeAsString());
}

void FakeLedger::CutAfter(int messages, grpc::Status status,
                          bool lose_applied) {
  MutexLock lock(mutex_);
  cut_after_ = messages;
  cut_status_ = std::move(status);
  lose_applied_ = lose_applied;
}

void FakeLedger::HoldDurable(bool hold) {
  MutexLock lock(mutex_);
  hold_durable_ = hold;
}

int FakeLedger::times_applied(std::uint64_t sequence) const {
  MutexLock lock(mutex_);
  const auto found = times_.find(sequence);
  return found == times_.end() ? 0 : found->second;
}

std::uint64_t FakeLedger::durable() const {
  MutexLock lock(mutex_);
  return durable_;
}

std::uint64_t FakeLedger::messages_received() const {
  MutexLock lock(mutex_);
  return received_;
}

void FakeLedger::AwaitReceived(std::uint64_t messages) {
  MutexLock lock(mutex_);
  while (received_ < messages) received_more_.Wait(mutex_);
}

bool FakeLedger::Take(std::uint64_t epoch, std::uint64_t sequence) {
  MutexLock lock(mutex_);
  ++received_;
  received_more_.NotifyAll();
  if (epoch > epoch_) {
    epoch_ = epoch;
    applied_ = durable_ = 0;
  }
  if (sequence <= applied_) {
    ++stream_duplicates_;
  } else {
    if (sequence > applied_ + 1) {
      v1::SequenceGap& gap = gaps_.emplace_back();
      gap.set_first_sequence(applied_ + 1);
      gap.set_last_sequence(sequence - 1);
    }
    applied_ = sequence;
    ++times_[sequence];
    ++stream_applied_;
  }
  if (cut_after_ > 0 && --cut_after_ == 0) {
    cut_after_ = -1;
    if (lose_applied_) {
      while (applied_ > durable_) times_.erase(applied_--);
    }
    return false;
  }
  return true;
}

grpc::Status FakeLedger::cut_status() const {
  MutexLock lock(mutex_);
  return cut_status_;
}

bool FakeLedger::Commit() {
  MutexLock lock(mutex_);
  if (hold_durable_ || durable_ == applied_) return false;
  durable_ = applied_;
  return true;
}

FakeLedger::Position FakeLedger::position() const {
  MutexLock lock(mutex_);
  return {epoch_, applied_, durable_, stream_applied_, stream_duplicates_};
}

std::vector<v1::SequenceGap> FakeLedger::TakeGaps() {
  MutexLock lock(mutex_);
  return std::exchange(gaps_, {});
}

void FakeLedger::BeginStream() {
  MutexLock lock(mutex_);
  stream_applied_ = stream_duplicates_ = 0;
}

FakeServer::FakeServer() : address_("127.0.0.1:0") { Start(); }

FakeServer::~FakeServer() { Stop(); }

void FakeServer::Start() {
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort(address_, grpc::InsecureServerCredentials(), &port);
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.SetMaxReceiveMessageSize(64 << 20);
  builder.RegisterService(static_cast<v1::ObstacleService::Service*>(this));
  builder.RegisterService(static_cast<v1::IngestService::Service*>(this));
  builder.RegisterService(static_cast<v1::MissionService::Service*>(this));
  server_ = builder.BuildAndStart();
  address_ = "127.0.0.1:" + std::to_string(port);
}

void FakeServer::Stop() {
  if (server_ == nullptr) return;
  server_->Shutdown(std::chrono::system_clock::now());
  server_.reset();
}

void FakeServer::FailNext(const std::string& method, int times,
                          grpc::Status status) {
  MutexLock lock(mutex_);
  failures_[method] = {times, std::move(status)};
}

int FakeServer::calls(const std::string& method) const {
  MutexLock lock(mutex_);
  const auto found = calls_.find(method);
  return found == calls_.end() ? 0 : found->second;
}

grpc::Status FakeServer::Enter(const std::string& method) {
  MutexLock lock(mutex_);
  ++calls_[method];
  Failures& failures = failures_[method];
  if (failures.times == 0) return grpc::Status::OK;
  --failures.times;
  return failures.status;
}

grpc::Status FakeServer::QueryObstacle(grpc::ServerContext*,
                                       const v1::QueryObstacleRequest* request,
                                       v1::QueryObstacleResponse* response) {
  last_query = *request;
  response->mutable_answer()->set_state(v1::OBSTACLE_STATE_FREE);
  response->mutable_answer()->set_probability(0.01);
  response->mutable_stamp()->set_map_revision(7);
  return Enter("QueryObstacle");
}

grpc::Status FakeServer::QueryObstacles(
    grpc::ServerContext*, const v1::QueryObstaclesRequest* request,
    v1::QueryObstaclesResponse* response) {
  last_batch = *request;
  for (int i = 0; i < request->latitude_deg_size(); ++i) {
    response->add_probability(0.5f);
    response->add_state(v1::OBSTACLE_STATE_UNCERTAIN);
    if (echo_latitude) {
      response->add_mean_depth_m(static_cast<float>(request->latitude_deg(i)));
    }
  }
  if (echo_latitude) response->add_contacts()->set_point_index(0);
  response->mutable_stamp()->set_map_revision(batch_revision);
  return Enter("QueryObstacles");
}

grpc::Status FakeServer::GetRegion(
    grpc::ServerContext*, const v1::GetRegionRequest*,
    grpc::ServerWriter<v1::GetRegionResponse>* writer) {
  grpc::Status status = Enter("GetRegion");
  if (!status.ok()) return status;
  for (const v1::GetRegionResponse& message : region) writer->Write(message);
  return grpc::Status::OK;
}

grpc::Status FakeServer::StreamPings(
    grpc::ServerContext* context,
    grpc::ServerReaderWriter<v1::StreamPingsResponse, v1::StreamPingsRequest>*
        stream) {
  grpc::Status status = Enter("StreamPings");
  if (!status.ok()) return status;
  const auto get = [](const v1::StreamPingsRequest& request) -> const auto& {
    return request.ping();
  };
  return Serve(pings, get, context, stream);
}

grpc::Status FakeServer::StreamContacts(
    grpc::ServerContext* context,
    grpc::ServerReaderWriter<v1::StreamContactsResponse,
                             v1::StreamContactsRequest>* stream) {
  grpc::Status status = Enter("StreamContacts");
  if (!status.ok()) return status;
  const auto get = [](const v1::StreamContactsRequest& request) -> const auto& {
    return request.report();
  };
  return Serve(contacts, get, context, stream);
}

grpc::Status FakeServer::StartActivity(grpc::ServerContext*,
                                       const v1::StartActivityRequest* request,
                                       v1::StartActivityResponse* response) {
  last_start = *request;
  response->mutable_activity()->set_activity_id(request->activity_id());
  return Enter("StartActivity");
}

grpc::Status FakeServer::GetMissionStatus(grpc::ServerContext*,
                                          const v1::GetMissionStatusRequest*,
                                          v1::GetMissionStatusResponse* out) {
  *out = mission;
  return Enter("GetMissionStatus");
}

grpc::Status FakeServer::GetImport(grpc::ServerContext*,
                                   const v1::GetImportRequest*,
                                   v1::GetImportResponse* response) {
  response->set_tiles(tiles_held);
  return Enter("GetImport");
}

grpc::Status FakeServer::ImportPrior(
    grpc::ServerContext*, grpc::ServerReader<v1::ImportPriorRequest>* reader,
    v1::ImportPriorResponse* response) {
  grpc::Status status = Enter("ImportPrior");
  if (!status.ok()) return status;
  v1::ImportPriorRequest request;
  while (reader->Read(&request)) {
    if (request.has_header()) {
      header = request.header();
    } else {
      tiles.push_back(request.tile());
    }
  }
  response->set_tiles(tiles.size());
  return grpc::Status::OK;
}

}  // namespace fathom::client
