// CallRegistry: the long calls that are open, so that their number is bounded
// and that a shutdown can ask each to end.
//
// Thread-safe.

#ifndef FATHOM_SERVER_CALL_REGISTRY_H_
#define FATHOM_SERVER_CALL_REGISTRY_H_

#include <cstddef>
#include <memory>
#include <vector>

#include "base/mutex.h"

namespace fathom::server {

// A call that lasts until it is asked to end.
class LongCall {
 public:
  virtual ~LongCall() = default;
  // The server shuts down: finish what was accepted, then end. May be called
  // from any thread, also after the call ended.
  virtual void Drain() = 0;
};

// See file comment.
class CallRegistry {
 public:
  explicit CallRegistry(size_t limit) : limit_(limit) {}

  // False: as many calls as are allowed are open already.
  bool Add(const std::shared_ptr<LongCall>& call) {
    MutexLock lock(mutex_);
    std::erase_if(calls_, [](const auto& open) { return open.expired(); });
    if (calls_.size() >= limit_) return false;
    calls_.push_back(call);
    return true;
  }

  // Asks every open call to end.
  void Drain() {
    std::vector<std::weak_ptr<LongCall>> calls;
    {
      MutexLock lock(mutex_);
      calls = calls_;
    }
    for (const auto& open : calls) {
      if (const auto call = open.lock()) call->Drain();
    }
  }

  size_t limit() const { return limit_; }

 private:
  const size_t limit_;
  Mutex mutex_;
  std::vector<std::weak_ptr<LongCall>> calls_ FATHOM_GUARDED_BY(mutex_);
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_CALL_REGISTRY_H_
