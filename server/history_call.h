// HistoryStream: one GetContactHistory call. Reads the mission file on a
// worker, then writes as fast as the client reads.

#ifndef FATHOM_SERVER_HISTORY_CALL_H_
#define FATHOM_SERVER_HISTORY_CALL_H_

#include <atomic>
#include <deque>

#include "fathom/v1/obstacle_service.grpc.pb.h"
#include "grpcpp/support/server_callback.h"
#include "server/server_context.h"

namespace fathom::server {

// Deletes itself when the call is done and gives its slot of bulk_calls back.
class HistoryStream final
    : public grpc::ServerWriteReactor<v1::GetContactHistoryResponse> {
 public:
  // REQUIRES: a slot of context.bulk_calls was taken. `context` must outlive
  // it.
  HistoryStream(ServerContext& context,
                const v1::GetContactHistoryRequest& request);
  void OnWriteDone(bool ok) override;
  // May come while the file is read: that then ends.
  void OnCancel() override { gone_ = true; }
  void OnDone() override;

 private:
  void WriteNext();

  ServerContext& context_;
  std::atomic<bool> gone_{false};
  std::deque<v1::GetContactHistoryResponse> messages_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_HISTORY_CALL_H_
