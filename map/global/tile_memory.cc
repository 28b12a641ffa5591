#include "map/global/tile_memory.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace fathom::map {
namespace {

// What an allocator adds to a block of memory, near enough.
constexpr std::uint64_t kAllocationBytes = 16;
constexpr std::uint64_t kControlBytes = 16;

// While more than this of what was evicted waits for guards, and more than the
// budget, no more is evicted.
constexpr std::uint64_t kLeastRetiredBytes = 16 << 20;

// Slots that the clock's hand passes before the mutex is let go: it is held
// for some microseconds at a time, however many slots there are.
constexpr std::uint64_t kLooksPerLock = 64;

std::uint64_t BytesOf(const PackedTile& packed) {
  return packed.capacity() + sizeof(PackedTile) + 2 * kAllocationBytes;
}

}  // namespace

// ---- The clock ----

void TileMemory::Link(const TileSlot& slot) {
  if (hand_ == nullptr) {
    slot.previous_ = slot.next_ = &slot;
    hand_ = &slot;
  } else {
    slot.next_ = hand_;
    slot.previous_ = hand_->previous_;
    slot.previous_->next_ = &slot;
    slot.next_->previous_ = &slot;
  }
  ++clock_tiles_;
  clock_bytes_.fetch_add(slot.totals_.memory_bytes, std::memory_order_relaxed);
}

void TileMemory::Unlink(const TileSlot& slot) {
  if (slot.next_ == &slot) {
    hand_ = nullptr;
  } else {
    slot.previous_->next_ = slot.next_;
    slot.next_->previous_ = slot.previous_;
    if (hand_ == &slot) hand_ = slot.next_;
  }
  slot.previous_ = slot.next_ = nullptr;
  --clock_tiles_;
  clock_bytes_.fetch_sub(slot.totals_.memory_bytes, std::memory_order_relaxed);
}

std::shared_ptr<const TileSlot> TileMemory::NextVictim(std::uint64_t& steps) {
  MutexLock lock(mutex_);
  if (hand_ == nullptr) steps = 0;
  const std::uint64_t last = steps - std::min(steps, kLooksPerLock);
  for (; steps > last && hand_ != nullptr; --steps) {
    const TileSlot* const slot = hand_;
    hand_ = slot->next_;
    if (slot->touched_.exchange(false, std::memory_order_relaxed)) continue;
    // Null: nobody has it any more, and its end waits for the mutex.
    if (auto held = slot->weak_from_this().lock()) return held;
  }
  return nullptr;
}

void TileMemory::Retire(const TileSlot& slot) {
  // Freed behind the lock if there is no guard at all.
  std::unique_ptr<const Tile> tile;
  MutexLock lock(mutex_);
  Unlink(slot);
  tile.reset(slot.live_.exchange(nullptr, std::memory_order_acq_rel));
  ++packed_tiles_;
  if (generations_.empty()) return;
  retired_bytes_ += slot.totals_.memory_bytes;
  generations_.back().retired_bytes += slot.totals_.memory_bytes;
  generations_.back().retired.push_back(std::move(tile));
}

bool TileMemory::Evict() {
  if (!over_budget()) return false;
  std::uint64_t steps = 0;
  {
    MutexLock lock(mutex_);
    // Evicting frees nothing while somebody holds an old guard; what is read
    // again meanwhile would be there many times.
    if (retired_bytes_ > std::max(options_.budget_bytes, kLeastRetiredBytes)) {
      return false;
    }
    steps = 2 * clock_tiles_;
  }
  bool any = false;
  while (over_budget() && steps > 0) {
    const std::shared_ptr<const TileSlot> victim = NextVictim(steps);
    if (victim == nullptr) continue;
    if (victim->packed_.load(std::memory_order_relaxed) == nullptr) {
      // Only this thread clears `live_`.
      const Tile& tile = *victim->live_.load(std::memory_order_acquire);
      auto packed = std::make_unique<PackedTile>(
          options_.codec.pack(tile.key(), tile.Content()));
      packed->shrink_to_fit();
      MutexLock lock(mutex_);
      packed_bytes_ += BytesOf(*packed);
      victim->packed_.store(packed.release(), std::memory_order_release);
    }
    Retire(*victim);
    any = true;
  }
  return any;
}

// ---- Slots ----

void TileMemory::Enter(TileSlot& slot) {
  const Tile* const tile = slot.live_.load(std::memory_order_relaxed);
  MutexLock lock(mutex_);
  fixed_bytes_ += TileSlot::OwnBytes();
  if (tile == nullptr) {
    ++packed_tiles_;
    packed_bytes_ += BytesOf(*slot.packed_.load(std::memory_order_relaxed));
  } else if (slot.may_pack_) {
    Link(slot);
  } else {
    fixed_bytes_ += tile->memory_bytes();
  }
}

void TileMemory::EnterUnpacked(const TileSlot& slot) {
  MutexLock lock(mutex_);
  --packed_tiles_;
  Link(slot);
}

void TileMemory::Leave(TileSlot& slot) {
  const Tile* const tile = slot.live_.load(std::memory_order_relaxed);
  const PackedTile* const packed = slot.packed_.load(std::memory_order_relaxed);
  MutexLock lock(mutex_);
  fixed_bytes_ -= TileSlot::OwnBytes();
  if (packed != nullptr) packed_bytes_ -= BytesOf(*packed);
  if (slot.next_ != nullptr) {
    Unlink(slot);
  } else if (tile == nullptr) {
    --packed_tiles_;
  } else {
    fixed_bytes_ -= tile->memory_bytes();
  }
}

std::unique_ptr<const Tile> TileMemory::Decode(const TileSlot& slot) const {
  auto content = options_.codec.unpack(
      slot.key(), *slot.packed_.load(std::memory_order_acquire));
  // The bytes were checked when they came, or are our own: they have changed
  // in memory. No answer is better than one from them.
  if (!content.ok()) std::abort();
  return Tile::FromContent(slot.key(), *content, {}, tolerance_m_);
}

TileUse TileMemory::Use() const {
  MutexLock lock(mutex_);
  const std::uint64_t unpacked_bytes =
      clock_bytes_.load(std::memory_order_relaxed) + retired_bytes_;
  return {.budget_bytes = options_.budget_bytes,
          .unpacked_bytes = unpacked_bytes,
          .packed_bytes = packed_bytes_,
          .memory_bytes = fixed_bytes_ + unpacked_bytes + packed_bytes_,
          .unpacked_tiles = clock_tiles_,
          .packed_tiles = packed_tiles_};
}

TileSlot::TileSlot(std::shared_ptr<TileMemory> memory,
                   std::unique_ptr<const Tile> tile)
    : live_(tile.get()),
      may_pack_(memory->MayPack(*tile)),
      key_(tile->key()),
      totals_(tile->totals()),
      memory_(std::move(memory)) {
  (void)tile.release();  // live_ holds it.
  memory_->Enter(*this);
}

TileSlot::TileSlot(std::shared_ptr<TileMemory> memory, const TileKey& key,
                   const TileTotals& totals, PackedTile packed)
    : live_(nullptr),
      packed_(new PackedTile(std::move(packed))),
      may_pack_(true),
      key_(key),
      totals_(totals),
      memory_(std::move(memory)) {
  memory_->Enter(*this);
}

TileSlot::~TileSlot() {
  memory_->Leave(*this);
  delete live_.load(std::memory_order_relaxed);
  delete packed_.load(std::memory_order_relaxed);
}

std::uint64_t TileSlot::OwnBytes() {
  return sizeof(TileSlot) + kControlBytes + kAllocationBytes;
}

const Tile& TileSlot::Unpack() const {
  std::unique_ptr<const Tile> tile = memory_->Decode(*this);
  const Tile* first = nullptr;
  // Of readers that meet here the first one's tile is taken.
  if (!live_.compare_exchange_strong(first, tile.get(),
                                     std::memory_order_acq_rel)) {
    return *first;
  }
  touched_.store(true, std::memory_order_relaxed);
  // Not before it is on the clock may it be evicted, and be unpacked again.
  memory_->EnterUnpacked(*this);
  return *tile.release();
}

TileLook TileSlot::Look() const {
  const Tile* const tile = live_.load(std::memory_order_acquire);
  return tile != nullptr ? TileLook(tile) : TileLook(memory_->Decode(*this));
}

// ---- Guards ----

TileMemory::Generation* TileMemory::BeginGeneration() {
  MutexLock lock(mutex_);
  return &generations_.emplace_back();
}

void TileMemory::EndGeneration(Generation* generation) {
  std::vector<std::vector<std::unique_ptr<const Tile>>> freed;
  MutexLock lock(mutex_);
  generation->held = false;
  while (!generations_.empty() && !generations_.front().held) {
    retired_bytes_ -= generations_.front().retired_bytes;
    freed.push_back(std::move(generations_.front().retired));
    generations_.pop_front();
  }
}

}  // namespace fathom::map
