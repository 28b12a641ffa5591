#include "server/ingest_service.h"

#include <memory>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "server/convert_ingest.h"
#include "server/ingest_stream.h"

namespace fathom::server {
namespace {

// Gathers what becomes of the reports of one ReportContacts call and answers
// when the last is durable.
class ReportBatch final : public IngestListener {
 public:
  ReportBatch(ServerContext& context, grpc::ServerUnaryReactor* reactor,
              v1::ReportContactsResponse* response, size_t count)
      : context_(context),
        reactor_(reactor),
        response_(response),
        under_way_(count) {}

  void OnApplied(const MessageOutcome& outcome) override {
    MutexLock lock(mutex_);
    if (answered_) return;
    response_->set_map_revision(outcome.revision);
    switch (outcome.fate) {
      case MessageFate::kApplied:
        response_->set_reports_applied(response_->reports_applied() + 1);
        break;
      case MessageFate::kDuplicate:
        response_->set_reports_duplicate(response_->reports_duplicate() + 1);
        break;
      case MessageFate::kRefused:
        WriteRejection(outcome.number.sequence, outcome.refusal,
                       response_->add_rejections());
        break;
    }
  }

  void OnDurable(MessageNumber, size_t count) override {
    {
      MutexLock lock(mutex_);
      under_way_ -= count;
      if (under_way_ > 0) return;
    }
    Answer(absl::OkStatus());
  }

  void OnRoom() override {}

  void OnFault() override {
    Answer(StorageFault(context_.keeper.storage_state()));
  }

 private:
  void Answer(const absl::Status& status) {
    {
      MutexLock lock(mutex_);
      if (std::exchange(answered_, true)) return;
    }
    context_.courier.Give(
        [reactor = reactor_, status] { reactor->Finish(ToGrpc(status)); });
  }

  ServerContext& context_;
  grpc::ServerUnaryReactor* const reactor_;
  // Written until answered; then it is gRPC's.
  v1::ReportContactsResponse* const response_ FATHOM_PT_GUARDED_BY(mutex_);
  Mutex mutex_;
  size_t under_way_ FATHOM_GUARDED_BY(mutex_);
  bool answered_ FATHOM_GUARDED_BY(mutex_) = false;
};

}  // namespace

grpc::ServerBidiReactor<v1::StreamPingsRequest, v1::StreamPingsResponse>*
IngestService::StreamPings(grpc::CallbackServerContext*) {
  return IngestStream<PingStreamKind>::Start(context_);
}

grpc::ServerBidiReactor<v1::StreamContactsRequest, v1::StreamContactsResponse>*
IngestService::StreamContacts(grpc::CallbackServerContext*) {
  return IngestStream<ContactStreamKind>::Start(context_);
}

grpc::ServerUnaryReactor* IngestService::ReportContacts(
    grpc::CallbackServerContext* call, const v1::ReportContactsRequest* request,
    v1::ReportContactsResponse* response) {
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  auto messages = ConvertReports(*request, context_.clock.Now());
  if (!messages.ok()) {
    reactor->Finish(ToGrpc(messages.status()));
    return reactor;
  }
  auto batch = std::make_shared<ReportBatch>(context_, reactor, response,
                                             messages->size());
  const absl::Status submitted =
      context_.keeper.SubmitAll(*std::move(messages), std::move(batch));
  if (!submitted.ok()) {
    reactor->Finish(ToGrpc(KeeperError(context_, submitted)));
  }
  return reactor;
}

}  // namespace fathom::server
