// A bounded list of the newest of something, of which copies are cheap and
// stay as they were.
//
// Chunks are shared between all copies and filled from the front; a copy reads
// only below its own size, so the writer may fill the slots above while
// readers read. REQUIRES therefore: of all copies only one, the writer's, is
// ever changed.

#ifndef FATHOM_MAP_CONTACTS_SHARED_LOG_H_
#define FATHOM_MAP_CONTACTS_SHARED_LOG_H_

#include <array>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

namespace fathom::map {

// Keeps the newest kMost of T. Copies cost O(kMost / 16).
template <typename T, std::size_t kMost>
class SharedLog {
 public:
  std::size_t size() const { return end_ - begin_; }
  bool empty() const { return end_ == begin_; }
  // REQUIRES: i < size(). 0 is the oldest.
  const T& operator[](std::size_t i) const {
    const std::size_t slot = begin_ + i;
    return chunks_[slot / kChunk]->items[slot % kChunk];
  }
  // REQUIRES: not empty.
  const T& newest() const { return (*this)[size() - 1]; }

  // Adds one behind the newest; forgets the oldest beyond kMost.
  void Append(T item) {
    if (size() == kMost) ++begin_;
    if (begin_ == kChunk) {
      chunks_.erase(chunks_.begin());
      begin_ -= kChunk;
      end_ -= kChunk;
    }
    if (end_ == chunks_.size() * kChunk) {
      chunks_.push_back(std::make_shared<Chunk>());
    }
    chunks_[end_ / kChunk]->items[end_ % kChunk] = std::move(item);
    ++end_;
  }

  // Keeps the oldest `size` only. REQUIRES: size <= size(). O(16): others may
  // read the slots that are written next, so their chunk is copied.
  void Truncate(std::size_t size) {
    end_ = begin_ + size;
    chunks_.resize((end_ + kChunk - 1) / kChunk);
    if (end_ % kChunk != 0) {
      chunks_.back() = std::make_shared<Chunk>(*chunks_.back());
    }
  }

 private:
  static constexpr std::size_t kChunk = 16;
  struct Chunk {
    std::array<T, kChunk> items;
  };
  std::vector<std::shared_ptr<Chunk>> chunks_;
  // Slots [begin_, end_) counted from the first chunk held.
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_SHARED_LOG_H_
