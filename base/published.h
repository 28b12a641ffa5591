// The newest of a row of immutable objects that one thread makes and many
// read: a reader takes it and asks it as long as it likes.
//
// An object that was replaced is freed by the thread that publishes, never by
// a reader: a reader that happened to be the last of an old map would else pay
// for its thousands of pieces in the middle of a question, and fight for the
// heap with the writer that made them (measured: a question beside a writer
// costs twice the time).

#ifndef FATHOM_BASE_PUBLISHED_H_
#define FATHOM_BASE_PUBLISHED_H_

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "base/mutex.h"

namespace fathom {

// T is immutable once published, and nobody keeps a weak reference to it.
template <typename T>
class Published {
 public:
  using Ptr = std::shared_ptr<const T>;

  // The newest; null before the first. Any thread; a lock held for the copy of
  // a pointer.
  Ptr Get() const FATHOM_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    return newest_;
  }

  // One thread at a time. Frees those that were replaced before and that
  // nobody reads any more; each that is still read waits for a later call, so
  // at most one more than readers hold.
  void Publish(Ptr next) FATHOM_EXCLUDES(mutex_) {
    {
      MutexLock lock(mutex_);
      newest_.swap(next);
    }
    FreeReplaced();
    if (next != nullptr) replaced_.push_back(std::move(next));
  }

  // Frees those that were replaced and that nobody reads any more, the last one
  // too. The publishing thread only.
  void FreeReplaced() {
    // Only this list can hand out what it alone holds: a count of one stays.
    std::erase_if(replaced_,
                  [](const Ptr& old) { return old.use_count() == 1; });
  }

  // Objects kept for readers, and the last that was replaced. The publishing
  // thread only.
  std::size_t replaced() const { return replaced_.size(); }

 private:
  mutable Mutex mutex_;
  Ptr newest_ FATHOM_GUARDED_BY(mutex_);
  // The publishing thread only.
  std::vector<Ptr> replaced_;
};

}  // namespace fathom

#endif  // FATHOM_BASE_PUBLISHED_H_
