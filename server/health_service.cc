#include "server/health_service.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>

#include "absl/strings/str_format.h"
#include "server/errors.h"
#include "server/limits.h"

namespace fathom::server {

using grpc::health::v1::HealthCheckRequest;
using grpc::health::v1::HealthCheckResponse;

namespace {

bool IsKnown(std::string_view service) {
  constexpr std::array<std::string_view, 4> kServices = {
      "", "fathom.v1.IngestService", "fathom.v1.ObstacleService",
      "fathom.v1.MissionService"};
  return std::find(kServices.begin(), kServices.end(), service) !=
         kServices.end();
}

HealthCheckResponse::ServingStatus StatusOf(bool known, bool serving) {
  if (!known) return HealthCheckResponse::SERVICE_UNKNOWN;
  return serving ? HealthCheckResponse::SERVING
                 : HealthCheckResponse::NOT_SERVING;
}

}  // namespace

// One Watch call: tells the status now, and once more when it changes, which
// is the end of the server.
class HealthService::Watcher final
    : public grpc::ServerWriteReactor<HealthCheckResponse>,
      public std::enable_shared_from_this<Watcher> {
 public:
  Watcher(bool known, bool serving) : known_(known), serving_(serving) {}

  void Begin() {
    {
      MutexLock lock(mutex_);
      self_ = shared_from_this();
    }
    Pump();
  }
  void Refuse(const absl::Status& status) {
    {
      MutexLock lock(mutex_);
      self_ = shared_from_this();
      finished_ = true;
    }
    Finish(ToGrpc(status));
  }
  void End() {
    {
      MutexLock lock(mutex_);
      serving_ = false;
      ending_ = true;
    }
    Pump();
  }
  void OnWriteDone(bool ok) override {
    {
      MutexLock lock(mutex_);
      writing_ = false;
      if (!ok) ending_ = cancelled_ = true;
    }
    Pump();
  }
  void OnCancel() override {
    {
      MutexLock lock(mutex_);
      ending_ = cancelled_ = true;
    }
    Pump();
  }
  void OnDone() override {
    std::shared_ptr<Watcher> last;
    MutexLock lock(mutex_);
    last.swap(self_);
  }

 private:
  void Pump() {
    bool finish = false;
    {
      MutexLock lock(mutex_);
      if (finished_ || writing_) return;
      const auto status = StatusOf(known_, serving_);
      if (!cancelled_ && told_ != status) {
        told_ = status;
        response_.set_status(status);
        writing_ = true;
      } else if (ending_) {
        finished_ = finish = true;
      } else {
        return;
      }
    }
    if (finish) {
      Finish(ToGrpc(ShuttingDown()));
    } else {
      StartWrite(&response_);
    }
  }

  const bool known_;
  Mutex mutex_;
  bool serving_ FATHOM_GUARDED_BY(mutex_);
  bool writing_ FATHOM_GUARDED_BY(mutex_) = false;
  bool ending_ FATHOM_GUARDED_BY(mutex_) = false;
  bool cancelled_ FATHOM_GUARDED_BY(mutex_) = false;
  bool finished_ FATHOM_GUARDED_BY(mutex_) = false;
  std::optional<HealthCheckResponse::ServingStatus> told_
      FATHOM_GUARDED_BY(mutex_);
  std::shared_ptr<Watcher> self_ FATHOM_GUARDED_BY(mutex_);
  // Written only while no write is under way.
  HealthCheckResponse response_;
};

bool HealthService::serving() const {
  MutexLock lock(mutex_);
  return serving_;
}

grpc::ServerUnaryReactor* HealthService::Check(
    grpc::CallbackServerContext* call, const HealthCheckRequest* request,
    HealthCheckResponse* response) {
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  if (!IsKnown(request->service())) {
    reactor->Finish(grpc::Status(
        grpc::StatusCode::NOT_FOUND,
        absl::StrFormat("service=%s is not served here", request->service())));
    return reactor;
  }
  response->set_status(StatusOf(true, serving()));
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

grpc::ServerWriteReactor<HealthCheckResponse>* HealthService::Watch(
    grpc::CallbackServerContext*, const HealthCheckRequest* request) {
  std::shared_ptr<Watcher> watcher;
  bool refused = false;
  {
    MutexLock lock(mutex_);
    watcher = std::make_shared<Watcher>(IsKnown(request->service()), serving_);
    std::erase_if(watchers_, [](const auto& open) { return open.expired(); });
    refused = watchers_.size() >= kMaxWatchers;
    if (!refused && serving_) watchers_.push_back(watcher);
  }
  if (refused) {
    watcher->Refuse(TooManyCalls("health watchers", kMaxWatchers));
  } else {
    watcher->Begin();
  }
  return watcher.get();
}

void HealthService::SetNotServing() {
  std::vector<std::weak_ptr<Watcher>> watchers;
  {
    MutexLock lock(mutex_);
    serving_ = false;
    watchers.swap(watchers_);
  }
  for (const auto& open : watchers) {
    if (const auto watcher = open.lock()) watcher->End();
  }
}

}  // namespace fathom::server
