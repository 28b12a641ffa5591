// IngestService: the way in. Streams are IngestStreams; a batch of reports is
// answered when all of it is durable.
//
// Thread-safe; `context` must outlive it.

#ifndef FATHOM_SERVER_INGEST_SERVICE_H_
#define FATHOM_SERVER_INGEST_SERVICE_H_

#include "fathom/v1/ingest_service.grpc.pb.h"
#include "server/server_context.h"

namespace fathom::server {

// See file comment.
class IngestService final : public v1::IngestService::CallbackService {
 public:
  explicit IngestService(ServerContext& context) : context_(context) {}

  grpc::ServerBidiReactor<v1::StreamPingsRequest, v1::StreamPingsResponse>*
  StreamPings(grpc::CallbackServerContext* call) override;
  grpc::ServerUnaryReactor* ReportContacts(
      grpc::CallbackServerContext* call,
      const v1::ReportContactsRequest* request,
      v1::ReportContactsResponse* response) override;
  grpc::ServerBidiReactor<v1::StreamContactsRequest,
                          v1::StreamContactsResponse>*
  StreamContacts(grpc::CallbackServerContext* call) override;

 private:
  ServerContext& context_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_INGEST_SERVICE_H_
