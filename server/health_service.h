// grpc.health.v1.Health as an ordinary service, so that reflection shows it
// (gRPC's built-in one is invisible there).
//
// Knows "" (the server) and the three services of fathom.v1. All serve until
// SetNotServing; then watchers are told and their calls end.
//
// Thread-safe.

#ifndef FATHOM_SERVER_HEALTH_SERVICE_H_
#define FATHOM_SERVER_HEALTH_SERVICE_H_

#include <memory>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "grpc/health/v1/health.grpc.pb.h"

namespace fathom::server {

// See file comment.
class HealthService final : public grpc::health::v1::Health::CallbackService {
 public:
  grpc::ServerUnaryReactor* Check(
      grpc::CallbackServerContext* call,
      const grpc::health::v1::HealthCheckRequest* request,
      grpc::health::v1::HealthCheckResponse* response) override;
  grpc::ServerWriteReactor<grpc::health::v1::HealthCheckResponse>* Watch(
      grpc::CallbackServerContext* call,
      const grpc::health::v1::HealthCheckRequest* request) override;

  // The server shuts down: everything is NOT_SERVING from here on.
  void SetNotServing();

 private:
  class Watcher;

  bool serving() const;

  mutable Mutex mutex_;
  bool serving_ FATHOM_GUARDED_BY(mutex_) = true;
  std::vector<std::weak_ptr<Watcher>> watchers_ FATHOM_GUARDED_BY(mutex_);
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_HEALTH_SERVICE_H_
