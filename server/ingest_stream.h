// IngestStream: one StreamPings or StreamContacts call. Reads a message only
// when the keeper has room for another (so TCP's flow control reaches the
// vehicle), hands it over, and writes acks as messages become durable; acks
// coalesce while one is being written.
//
// Ends: OK once everything read is durable and acknowledged; with an error
// (a message of another source, shutting down) after the same; at once on a
// storage fault or a cancel. Numbers that were accepted are told in acks,
// never in the final status, which in gRPC may overtake messages.
//
// Threads: gRPC's (reactions), the keeper's (IngestListener) and the courier.
// One mutex guards the state; no gRPC operation is started under it. Kept
// alive by itself until OnDone and by the keeper while messages are under way.

#ifndef FATHOM_SERVER_INGEST_STREAM_H_
#define FATHOM_SERVER_INGEST_STREAM_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "base/mutex.h"
#include "fathom/v1/ingest_service.pb.h"
#include "google/protobuf/arena.h"
#include "grpcpp/support/server_callback.h"
#include "server/call_registry.h"
#include "server/convert_ingest.h"
#include "server/ingest.h"
#include "server/server_context.h"

namespace fathom::server {

// What the two kinds of stream differ in.
struct PingStreamKind {
  using Request = v1::StreamPingsRequest;
  using Response = v1::StreamPingsResponse;
  static constexpr const char* kField = "ping";
  static bool Has(const Request& request) { return request.has_ping(); }
  static const v1::Ping& Of(const Request& request) { return request.ping(); }
};
struct ContactStreamKind {
  using Request = v1::StreamContactsRequest;
  using Response = v1::StreamContactsResponse;
  static constexpr const char* kField = "report";
  static bool Has(const Request& request) { return request.has_report(); }
  static const v1::ContactReport& Of(const Request& request) {
    return request.report();
  }
};

// See file comment.
template <typename Kind>
class IngestStream final
    : public grpc::ServerBidiReactor<typename Kind::Request,
                                     typename Kind::Response>,
      public IngestListener,
      public LongCall,
      public std::enable_shared_from_this<IngestStream<Kind>> {
 public:
  using Request = typename Kind::Request;
  using Response = typename Kind::Response;

  // The reactor for one call; it deletes itself.
  static IngestStream* Start(ServerContext& context);

  explicit IngestStream(ServerContext& context) : context_(context) {}

  // gRPC's reactions.
  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnCancel() override;
  void OnDone() override;

  // The keeper's.
  void OnApplied(const MessageOutcome& outcome) override;
  void OnDurable(MessageNumber newest, size_t count) override;
  void OnRoom() override;
  void OnFault() override;

  // The shutdown's.
  void Drain() override;

 private:
  // Everything that acks tell.
  struct Progress {
    uint64_t epoch = 0;
    uint64_t applied_sequence = 0;
    uint64_t durable_sequence = 0;
    uint64_t map_revision = 0;
    uint64_t applied = 0;
    uint64_t duplicate = 0;
    uint64_t accepted = 0;
    map::RejectCounts rejects;
    std::vector<v1::Rejection> rejections;
    std::vector<MissingNumbers> gaps;
    // Something is to be told.
    bool fresh = false;
  };

  // Checks and submits request_; an error ends the stream.
  absl::Status TakeRequest();
  // Source and epoch are those of the first message.
  absl::Status CheckSameSource(const std::string& source_id, uint64_t epoch);
  void RejectUnnumbered(const absl::Status& status);
  void NoteRejection(uint64_t sequence, const Refusal& refusal)
      FATHOM_REQUIRES(mutex_);
  // Ends the stream once all is durable, or at once if `abandon`.
  void End(const absl::Status& status, bool abandon);
  // Starts whatever may be started now. Calls gRPC without the mutex.
  void Pump();
  void PumpLater();
  void FillAck() FATHOM_REQUIRES(mutex_);

  ServerContext& context_;
  // Reader only: one read is under way at a time. The message and its parts lie
  // in one block, which serves the next one again; larger ones get more.
  static constexpr size_t kRequestBlockBytes = 4096;
  alignas(8) std::array<char, kRequestBlockBytes> request_block_;
  google::protobuf::Arena arena_{request_block_.data(), kRequestBlockBytes};
  Request* request_ = nullptr;
  std::string source_id_;
  uint64_t epoch_ = 0;
  // Written only while no write is under way.
  Response ack_;

  mutable Mutex mutex_;
  std::shared_ptr<IngestStream> self_ FATHOM_GUARDED_BY(mutex_);
  Progress progress_ FATHOM_GUARDED_BY(mutex_);
  size_t under_way_ FATHOM_GUARDED_BY(mutex_) = 0;
  bool room_ FATHOM_GUARDED_BY(mutex_) = true;
  bool reading_ FATHOM_GUARDED_BY(mutex_) = false;
  bool writing_ FATHOM_GUARDED_BY(mutex_) = false;
  bool abandon_ FATHOM_GUARDED_BY(mutex_) = false;
  bool finished_ FATHOM_GUARDED_BY(mutex_) = false;
  std::optional<absl::Status> end_ FATHOM_GUARDED_BY(mutex_);
};

extern template class IngestStream<PingStreamKind>;
extern template class IngestStream<ContactStreamKind>;

}  // namespace fathom::server

#endif  // FATHOM_SERVER_INGEST_STREAM_H_
