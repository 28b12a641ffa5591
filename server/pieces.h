// A loop over many small things, done by the thread that has them and by
// whichever helpers are free: for an answer that somebody waits for.

#ifndef FATHOM_SERVER_PIECES_H_
#define FATHOM_SERVER_PIECES_H_

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <memory>

#include "absl/cleanup/cleanup.h"
#include "absl/functional/function_ref.h"
#include "base/mutex.h"
#include "server/workers.h"

namespace fathom::server {

// Calls work(begin, end) for pieces of at most `piece` that together are
// [0, count), each once, in any order and on several threads at once; returns
// when all are done. Never waits for a helper that has not begun: with all of
// them busy, or `helpers` null, this thread does the whole.
// REQUIRES: piece > 0.
inline void ForEachPiece(
    Workers* helpers, std::size_t count, std::size_t piece,
    absl::FunctionRef<void(std::size_t, std::size_t)> work) {
  // Outlives the call: a helper may come when all is done.
  struct Loop {
    // Takes pieces until none is left.
    void Run(absl::FunctionRef<void(std::size_t, std::size_t)> work,
             std::size_t count, std::size_t piece) {
      for (std::size_t begin = next.fetch_add(piece); begin < count;
           begin = next.fetch_add(piece)) {
        work(begin, std::min(begin + piece, count));
      }
    }
    // Whether the loop goes on; if so, Leave() must follow.
    bool Enter() {
      MutexLock lock(mutex);
      if (closed) return false;
      ++busy;
      return true;
    }
    void Leave() {
      MutexLock lock(mutex);
      --busy;
      changed.NotifyAll();
    }
    void Close() {
      MutexLock lock(mutex);
      closed = true;
      while (busy > 0) changed.Wait(mutex);
    }
    std::atomic<std::size_t> next{0};
    Mutex mutex;
    CondVar changed;
    bool closed FATHOM_GUARDED_BY(mutex) = false;
    int busy FATHOM_GUARDED_BY(mutex) = 0;
  };
  const auto loop = std::make_shared<Loop>();
  // What `work` refers to lives as long as this call, whichever way it ends.
  const absl::Cleanup close = [&loop] { loop->Close(); };
  if (helpers != nullptr && count > piece) {
    const std::size_t others = (count - 1) / piece;
    for (std::size_t n = 0; n < std::min(others, helpers->size()); ++n) {
      const bool offered = helpers->Offer([loop, work, count, piece] {
        if (!loop->Enter()) return;
        loop->Run(work, count, piece);
        loop->Leave();
      });
      if (!offered) break;
    }
  }
  loop->Run(work, count, piece);
}

}  // namespace fathom::server

#endif  // FATHOM_SERVER_PIECES_H_
