// fathom-null-server: the floor under fathomd's figures. It speaks the same
// contract through the same callback API with answers of the same size, and
// does nothing else: what a call costs here is gRPC, Protobuf and the kernel.
//
//   fathom-null-server --port-file FILE     (loopback, any free port)
#include <grpcpp/alarm.h>
#include <grpcpp/grpcpp.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <fstream>
#include <iostream>
#include <memory>
#include <mutex>
#include <string>

#include "fathom/v1/ingest_service.grpc.pb.h"
#include "fathom/v1/obstacle_service.grpc.pb.h"

namespace fathom::bench {
namespace {

// The shortest group commit of the design (2-20 ms).
constexpr std::chrono::milliseconds kAckDelay{2};

class NullObstacleService final : public v1::ObstacleService::CallbackService {
 public:
  grpc::ServerUnaryReactor* QueryObstacle(
      grpc::CallbackServerContext* context, const v1::QueryObstacleRequest*,
      v1::QueryObstacleResponse* response) override {
    v1::ObstacleAnswer& answer = *response->mutable_answer();
    answer.set_state(v1::OBSTACLE_STATE_FREE);
    answer.set_probability(0.25);
    v1::StaticEvidence& seabed = *answer.mutable_seabed();
    seabed.set_probability(0.25);
    seabed.set_layer(v1::MAP_LAYER_LOCAL);
    seabed.set_kind(v1::EVIDENCE_KIND_MEASURED);
    seabed.set_depth_m(20.5);
    seabed.set_std_m(0.5);
    seabed.set_age_s(60.5);
    seabed.set_cell_size_m(10);
    seabed.set_shoalest_m(19.5);
    seabed.set_activity_id("bench");
    v1::MapStamp& stamp = *response->mutable_stamp();
    stamp.set_map_revision(4711);
    stamp.mutable_as_of()->set_seconds(1'767'225'600);
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    reactor->Finish(grpc::Status::OK);
    return reactor;
  }

  grpc::ServerUnaryReactor* QueryObstacles(
      grpc::CallbackServerContext* context,
      const v1::QueryObstaclesRequest* request,
      v1::QueryObstaclesResponse* response) override {
    const int points = request->depth_m_size();
    response->mutable_probability()->Resize(points, 0.25f);
    response->mutable_state()->Resize(points, v1::OBSTACLE_STATE_FREE);
    if (request->with_reasons()) {
      response->mutable_mean_depth_m()->Resize(points, 20.5f);
      response->mutable_std_m()->Resize(points, 0.5f);
      response->mutable_age_s()->Resize(points, 60.5f);
      response->mutable_kind()->Resize(points, v1::EVIDENCE_KIND_MEASURED);
    }
    response->mutable_stamp()->set_map_revision(4711);
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    reactor->Finish(grpc::Status::OK);
    return reactor;
  }
};

const v1::Ping& Numbered(const v1::StreamPingsRequest& request) {
  return request.ping();
}
const v1::ContactReport& Numbered(const v1::StreamContactsRequest& request) {
  return request.report();
}

void Fill(uint64_t count, v1::StreamPingsResponse& ack) {
  ack.set_pings_applied(count);
  ack.set_measurements_accepted(count * 101);
}
void Fill(uint64_t count, v1::StreamContactsResponse& ack) {
  ack.set_reports_applied(count);
}

// Reads pings or reports and throws them away; acks what has come once every
// kAckDelay, as a group commit that costs nothing would.
template <typename Request, typename Response>
class NullStreamReactor final
    : public grpc::ServerBidiReactor<Request, Response> {
 public:
  NullStreamReactor() { this->StartRead(&request_); }

  void OnReadDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    if (!ok) {
      read_all_ = true;
      Advance();
      return;
    }
    epoch_ = Numbered(request_).epoch();
    received_ = Numbered(request_).sequence();
    Advance();
    this->StartRead(&request_);
  }

  void OnWriteDone(bool /*ok*/) override {
    const std::lock_guard lock(mutex_);
    busy_ = false;
    Advance();
  }

  void OnDone() override { delete this; }

 private:
  // With mutex_ held: starts the wait for the next ack, or ends the stream.
  void Advance() {
    if (busy_) {
      return;
    }
    if (received_ == acked_) {
      if (read_all_) {
        busy_ = true;
        this->Finish(grpc::Status::OK);
      }
      return;
    }
    busy_ = true;
    alarm_.Set(std::chrono::system_clock::now() + kAckDelay,
               [this](bool /*ok*/) { Ack(); });
  }

  void Ack() {
    const std::lock_guard lock(mutex_);
    acked_ = received_;
    response_.set_epoch(epoch_);
    response_.set_applied_sequence(acked_);
    response_.set_durable_sequence(acked_);
    response_.set_map_revision(acked_);
    Fill(acked_, response_);
    this->StartWrite(&response_);
  }

  std::mutex mutex_;
  grpc::Alarm alarm_;
  Request request_;
  Response response_;
  uint64_t epoch_ = 0;
  uint64_t received_ = 0;
  uint64_t acked_ = 0;
  // An ack waits or is on its way, or the stream has been finished.
  bool busy_ = false;
  bool read_all_ = false;
};

class NullIngestService final : public v1::IngestService::CallbackService {
 public:
  grpc::ServerBidiReactor<v1::StreamPingsRequest, v1::StreamPingsResponse>*
  StreamPings(grpc::CallbackServerContext*) override {
    // Deletes itself in OnDone.
    return new NullStreamReactor<v1::StreamPingsRequest,
                                 v1::StreamPingsResponse>();
  }

  grpc::ServerBidiReactor<v1::StreamContactsRequest,
                          v1::StreamContactsResponse>*
  StreamContacts(grpc::CallbackServerContext*) override {
    return new NullStreamReactor<v1::StreamContactsRequest,
                                 v1::StreamContactsResponse>();
  }
};

int Main(int argc, char** argv) {
  CLI::App app{"A server that answers at once and does nothing."};
  std::string port_file;
  app.add_option("--port-file", port_file, "Where to write the port")
      ->required();
  CLI11_PARSE(app, argc, argv);

  NullObstacleService obstacle;
  NullIngestService ingest;
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(),
                           &port);
  builder.SetMaxReceiveMessageSize(64 << 20);
  builder.RegisterService(&obstacle);
  builder.RegisterService(&ingest);
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  if (server == nullptr) {
    std::cerr << "fathom-null-server: cannot listen on loopback\n";
    return 1;
  }
  std::ofstream(port_file) << port << std::endl;
  server->Wait();
  return 0;
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) { return fathom::bench::Main(argc, argv); }
