// TileMemory: what the tiles of one global map take of RAM, and how tiles that
// are seldom read take less.
//
// Every tile hangs in a TileSlot, which all versions of the tree that share the
// tile share. A bottom tile (one without children: nearly all) may be packed:
// its slot then keeps the blob of a codec, a quarter of the tile's bytes, and
// whoever reads the tile unpacks it (some 0.1 ms). Answers never wait for the
// disk. Tiles with children, and the root, stay as they are.
//
// Invariants
//   1. A slot stands for one content for ever; whether it is packed changes no
//      answer. It holds the tile, or its blob, or both.
//   2. Only the map's writer packs (Evict), when the unpacked bottom tiles take
//      more than the budget: the one longest unread first, by the clock (second
//      chance). Readers only unpack.
//   3. A tile that was evicted is freed when all guards that were there at that
//      moment are gone. So whoever holds a guard may keep references to tiles
//      that it got under that guard, of any version of the tree.
//
// A tile that has never been packed is encoded when it is first evicted; its
// blob then stays, and the next eviction costs nothing.
//
// Thread safety: any thread reads slots and counts, under a guard; Evict and
// whatever is said to be for the writer by one thread at a time. One mutex,
// never held while a tile is encoded, decoded or freed, and no other is taken
// under it.

#ifndef FATHOM_MAP_GLOBAL_TILE_MEMORY_H_
#define FATHOM_MAP_GLOBAL_TILE_MEMORY_H_

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "base/mutex.h"
#include "map/global/cell_key.h"
#include "map/global/tile.h"

namespace fathom::map {

class TileSlot;

// How a tile becomes bytes and comes back. Both are pure and thread-safe, and
// unpack(key, pack(key, content)) is the content, bit for bit.
struct TileCodec {
  PackedTile (*pack)(const TileKey& key, const TileContent& content) = nullptr;
  absl::StatusOr<TileContent> (*unpack)(
      const TileKey& key, std::span<const std::uint8_t> packed) = nullptr;
};

struct TileMemoryOptions {
  static constexpr std::uint64_t kUnlimited =
      std::numeric_limits<std::uint64_t>::max();

  // What unpacked bottom tiles may take, bytes. Beyond it they are packed.
  std::uint64_t budget_bytes = kUnlimited;
  // Without one nothing is packed.
  TileCodec codec = {};
};

// What a map takes, all versions of it that somebody still holds included.
struct TileUse {
  std::uint64_t budget_bytes = 0;
  // Bottom tiles that can be read at once, and those that were packed since but
  // that somebody may still read.
  std::uint64_t unpacked_bytes = 0;
  // Blobs.
  std::uint64_t packed_bytes = 0;
  // All: these, the tiles above them and the slots.
  std::uint64_t memory_bytes = 0;
  // Bottom tiles that can be read at once; that are to be unpacked first.
  std::uint64_t unpacked_tiles = 0;
  std::uint64_t packed_tiles = 0;
};

// See file comment. Shared by the writer, all slots and all guards.
class TileMemory {
 public:
  // `tolerance_m` is the map's (see Tile::Build).
  TileMemory(const TileMemoryOptions& options, float tolerance_m)
      : options_(options), tolerance_m_(tolerance_m) {}
  TileMemory(const TileMemory&) = delete;
  TileMemory& operator=(const TileMemory&) = delete;

  // Packs until the budget is kept or two rounds of the clock are made; nothing
  // while more than the budget (16 MiB) waits for guards. Whether anything was
  // packed; the writer then begins a new guard, so that readers to come do not
  // keep what was evicted. 0.3 ms for a tile never packed before, else 0.2 us.
  bool Evict() FATHOM_EXCLUDES(mutex_);

  bool over_budget() const {
    return clock_bytes_.load(std::memory_order_relaxed) > options_.budget_bytes;
  }
  TileUse Use() const FATHOM_EXCLUDES(mutex_);

 private:
  friend class TileSlot;
  friend class TileGuard;

  // What was evicted while this was the newest guard.
  struct Generation {
    bool held = true;
    std::vector<std::unique_ptr<const Tile>> retired;
    // Of these.
    std::uint64_t retired_bytes = 0;
  };

  bool MayPack(const Tile& tile) const {
    return options_.codec.pack != nullptr && tile.children().empty() &&
           tile.key().level > 0;
  }
  std::unique_ptr<const Tile> Decode(const TileSlot& slot) const;

  // A slot comes and goes.
  void Enter(TileSlot& slot) FATHOM_EXCLUDES(mutex_);
  void Leave(TileSlot& slot) FATHOM_EXCLUDES(mutex_);
  // A reader has unpacked it.
  void EnterUnpacked(const TileSlot& slot) FATHOM_EXCLUDES(mutex_);

  void Link(const TileSlot& slot) FATHOM_REQUIRES(mutex_);
  void Unlink(const TileSlot& slot) FATHOM_REQUIRES(mutex_);
  // The next slot on the clock that was not read since it was last looked at;
  // null: none among the next kLooksPerLock, or within `steps`, which counts
  // down.
  std::shared_ptr<const TileSlot> NextVictim(std::uint64_t& steps)
      FATHOM_EXCLUDES(mutex_);
  void Retire(const TileSlot& slot) FATHOM_EXCLUDES(mutex_);

  Generation* BeginGeneration() FATHOM_EXCLUDES(mutex_);
  void EndGeneration(Generation* generation) FATHOM_EXCLUDES(mutex_);

  const TileMemoryOptions options_;
  const float tolerance_m_;
  // Bytes of the tiles on the clock; written under the mutex.
  std::atomic<std::uint64_t> clock_bytes_{0};

  mutable Mutex mutex_;
  // Slots whose tile is unpacked and may be packed: a ring. The hand stands at
  // the one that is looked at next; new ones come just behind it.
  const TileSlot* hand_ FATHOM_GUARDED_BY(mutex_) = nullptr;
  std::uint64_t clock_tiles_ FATHOM_GUARDED_BY(mutex_) = 0;
  std::uint64_t packed_tiles_ FATHOM_GUARDED_BY(mutex_) = 0;
  std::uint64_t packed_bytes_ FATHOM_GUARDED_BY(mutex_) = 0;
  std::uint64_t retired_bytes_ FATHOM_GUARDED_BY(mutex_) = 0;
  // Slots, and tiles that are never packed.
  std::uint64_t fixed_bytes_ FATHOM_GUARDED_BY(mutex_) = 0;
  // Oldest guard first; those at the front are held by somebody.
  std::deque<Generation> generations_ FATHOM_GUARDED_BY(mutex_);
};

// Keeps every tile that is read while it is held: see invariant 3. Views hold
// one.
class TileGuard {
 public:
  explicit TileGuard(std::shared_ptr<TileMemory> memory)
      : memory_(std::move(memory)), generation_(memory_->BeginGeneration()) {}
  ~TileGuard() { memory_->EndGeneration(generation_); }
  TileGuard(const TileGuard&) = delete;
  TileGuard& operator=(const TileGuard&) = delete;

  const TileMemory& memory() const { return *memory_; }

 private:
  const std::shared_ptr<TileMemory> memory_;
  TileMemory::Generation* const generation_;
};

// A tile for one look: that of the slot, or unpacked for this alone.
class TileLook {
 public:
  explicit TileLook(const Tile* shared) : tile_(shared) {}
  explicit TileLook(std::unique_ptr<const Tile> own)
      : own_(std::move(own)), tile_(own_.get()) {}

  const Tile& operator*() const { return *tile_; }
  const Tile* operator->() const { return tile_; }

 private:
  std::unique_ptr<const Tile> own_;
  const Tile* tile_;
};

// A place for a tile in the tree. Held by shared_ptr: by the parents (and work
// trees and views, of root tiles) that have the tile.
class TileSlot : public std::enable_shared_from_this<TileSlot> {
 public:
  TileSlot(std::shared_ptr<TileMemory> memory,
           std::unique_ptr<const Tile> tile);
  // A packed one. REQUIRES: `packed` is what the memory's codec made of a tile
  // without children that has this key (not the root's) and these totals.
  TileSlot(std::shared_ptr<TileMemory> memory, const TileKey& key,
           const TileTotals& totals, PackedTile packed);
  ~TileSlot();
  TileSlot(const TileSlot&) = delete;
  TileSlot& operator=(const TileSlot&) = delete;

  const TileKey& key() const { return key_; }
  // Those of the tile, packed or not.
  const TileTotals& totals() const { return totals_; }

  // The tile; unpacks it if it must. Valid while the caller's guard is held;
  // for the writer: until its next Evict.
  const Tile& tile() const {
    const Tile* const tile = live_.load(std::memory_order_acquire);
    if (tile == nullptr) [[unlikely]]
      return Unpack();
    // Read first: the line then stays shared between readers.
    if (!touched_.load(std::memory_order_relaxed)) {
      touched_.store(true, std::memory_order_relaxed);
    }
    return *tile;
  }

  // The same for one who walks through the whole map: changes neither what is
  // unpacked nor what counts as read. Validity as tile(), and the look.
  TileLook Look() const;

  // Whether it must be unpacked to be read. Another thread may change it.
  bool packed() const {
    return live_.load(std::memory_order_acquire) == nullptr;
  }

  // What a slot takes without its tile, with the reference counts and the
  // allocator's.
  static std::uint64_t OwnBytes();

  // Whether conglomerating this tile and all below it changes nothing. Only
  // for the writer of the map; false is always right.
  bool settled() const { return settled_; }
  void set_settled(bool settled) const { settled_ = settled; }

 private:
  friend class TileMemory;

  const Tile& Unpack() const;
  // The tile, owned. Null: packed. Only readers set it, only the writer clears
  // it.
  mutable std::atomic<const Tile*> live_;
  // The blob, owned; set once, before `live_` is first cleared.
  mutable std::atomic<const PackedTile*> packed_{nullptr};
  // Read since the clock's hand was last here.
  mutable std::atomic<bool> touched_{false};
  mutable bool settled_ = false;
  const bool may_pack_;
  const TileKey key_;
  const TileTotals totals_;
  const std::shared_ptr<TileMemory> memory_;
  // The clock's ring; under the memory's mutex. Null: not on it.
  mutable const TileSlot* previous_ = nullptr;
  mutable const TileSlot* next_ = nullptr;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_TILE_MEMORY_H_
