// Marks: which of many things a watcher has yet to be told, one bit each, taken
// in turn so that none starves, however often others are marked anew.
//
// Not thread-safe.

#ifndef FATHOM_SERVER_MARKS_H_
#define FATHOM_SERVER_MARKS_H_

#include <cstddef>
#include <vector>

namespace fathom::server {

// See file comment. Grows with the greatest index that is marked.
class Marks {
 public:
  bool empty() const { return count_ == 0; }
  size_t count() const { return count_; }

  void Mark(size_t index) {
    if (index >= marked_.size()) marked_.resize(index + 1, false);
    if (marked_[index]) return;
    marked_[index] = true;
    ++count_;
  }
  // Marks the first `count`.
  void MarkFirst(size_t count) {
    for (size_t index = 0; index < count; ++index) Mark(index);
  }
  // The next marked one behind the last that was taken, round and round; it is
  // no longer marked. REQUIRES: not empty.
  size_t Take() {
    while (next_ >= marked_.size() || !marked_[next_]) {
      next_ = next_ + 1 < marked_.size() ? next_ + 1 : 0;
    }
    marked_[next_] = false;
    --count_;
    return next_++;
  }
  void Clear() { *this = Marks(); }

 private:
  std::vector<bool> marked_;
  size_t count_ = 0;
  size_t next_ = 0;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_MARKS_H_
