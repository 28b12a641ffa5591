// RevisionGate: lets a caller wait, without holding a thread, until the map
// has reached a revision ("read your own writes").
//
// Thread-safe. Callbacks run one after the other on the gate's own thread, so
// a slow answer delays other waiters but never the writer. Every callback
// runs exactly once.

#ifndef FATHOM_SERVER_REVISION_GATE_H_
#define FATHOM_SERVER_REVISION_GATE_H_

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <thread>
#include <vector>

#include "base/mutex.h"

namespace fathom::server {

// See file comment.
class RevisionGate {
 public:
  using Deadline = std::chrono::steady_clock::time_point;
  // `reached`: the map holds the revision; false: the time ran out, or the
  // gate was closed.
  using Callback = std::function<void(bool reached)>;

  // At most `max_waiters` wait at once.
  explicit RevisionGate(size_t max_waiters);
  // Closes the gate.
  ~RevisionGate();
  RevisionGate(const RevisionGate&) = delete;
  RevisionGate& operator=(const RevisionGate&) = delete;

  // Calls `callback` once `revision` is reached or at `deadline`. False, and
  // the callback is never called, if too many wait or the gate is closed.
  bool Wait(uint64_t revision, Deadline deadline, Callback callback);

  // The map has reached `revision`. Cheap when nobody waits.
  void Reach(uint64_t revision);

  // Tells all waiters false and takes no new ones. Idempotent.
  void Close();

 private:
  struct Waiter {
    uint64_t revision;
    Deadline deadline;
    Callback callback;
  };

  void Run();

  const size_t max_waiters_;
  Mutex mutex_;
  CondVar changed_;
  std::vector<Waiter> waiters_ FATHOM_GUARDED_BY(mutex_);
  uint64_t reached_ FATHOM_GUARDED_BY(mutex_) = 0;
  bool closed_ FATHOM_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_REVISION_GATE_H_
