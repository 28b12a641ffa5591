// A bounded list of the newest of something, of which copies are cheap and
// stay as they were.
//
// Chunks are shared between all copies and filled from the front; a copy reads
// only below its own size, so the writer may fill the slots above while
// readers read. REQUIRES therefore: of all copies only one, the writer's, is
// ever changed. Which chunks there are is shared too, and never changed: a
// writer that needs others makes a new list, once in kChunk items.

#ifndef FATHOM_MAP_CONTACTS_SHARED_LOG_H_
#define FATHOM_MAP_CONTACTS_SHARED_LOG_H_

#include <array>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

namespace fathom::map {

// Keeps the newest kMost of T. Copies cost one reference count.
template <typename T, std::size_t kMost>
class SharedLog {
 public:
  std::size_t size() const { return end_ - begin_; }
  bool empty() const { return end_ == begin_; }
  // REQUIRES: i < size(). 0 is the oldest.
  const T& operator[](std::size_t i) const {
    const std::size_t slot = begin_ + i;
    return (*chunks_)[slot / kChunk]->items[slot % kChunk];
  }
  // REQUIRES: not empty.
  const T& newest() const { return (*this)[size() - 1]; }

  // Adds one behind the newest; forgets the oldest beyond kMost.
  void Append(T item) {
    if (size() == kMost) ++begin_;
    if (begin_ == kChunk) {
      chunks_ = std::make_shared<Chunks>(chunks_->begin() + 1, chunks_->end());
      begin_ -= kChunk;
      end_ -= kChunk;
    }
    if (chunks_ == nullptr || end_ == chunks_->size() * kChunk) {
      Chunks more;
      if (chunks_ != nullptr) {
        more.reserve(chunks_->size() + 1);
        more = *chunks_;
      }
      more.push_back(std::make_shared<Chunk>());
      chunks_ = std::make_shared<Chunks>(std::move(more));
    }
    (*chunks_)[end_ / kChunk]->items[end_ % kChunk] = std::move(item);
    ++end_;
  }

  // Keeps the oldest `size` only. REQUIRES: size <= size(). O(kMost / 16):
  // others may read the slots that are written next, so their chunk is copied.
  void Truncate(std::size_t size) {
    if (chunks_ == nullptr) return;
    end_ = begin_ + size;
    const std::size_t kept = (end_ + kChunk - 1) / kChunk;
    Chunks fewer(chunks_->begin(),
                 chunks_->begin() + static_cast<std::ptrdiff_t>(kept));
    if (end_ % kChunk != 0) {
      fewer.back() = std::make_shared<Chunk>(*fewer.back());
    }
    chunks_ = std::make_shared<Chunks>(std::move(fewer));
  }

 private:
  static constexpr std::size_t kChunk = 16;
  struct Chunk {
    std::array<T, kChunk> items;
  };
  using Chunks = std::vector<std::shared_ptr<Chunk>>;
  std::shared_ptr<const Chunks> chunks_;  // nullptr: nothing was appended.
  // Slots [begin_, end_) counted from the first chunk held.
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_SHARED_LOG_H_
