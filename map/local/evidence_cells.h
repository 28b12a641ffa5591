// The evidence of a block's cells, of the touched ones alone, 20 bytes each.
//
// A swath covers the blocks at its border thinly, and a map's memory is that
// of its cells, so a block keeps them packed and in the order in which they
// were first touched, with one byte for each of its 256 places that says
// where. Mean, weight and scatter are kept as they are. The other numbers give
// up what nobody misses:
//   - the shoalest depth is kept in steps of 1/1024 m, rounded to the shoaler
//     (-100 to 12000 m in 24 bits);
//   - times are kept to the second within a window of 194 days whose later
//     half the newest sounding of the block is in; what is older counts as old
//     as the window's begin;
//   - 15 bits of count (Evidence::count ends there), one for "measured".
// Packing what was unpacked changes nothing. Plain values: storage writes them
// as they are, in the order of k, and reading them back gives the same answers.
//
// Not thread-safe; const calls may run at once.

#ifndef FATHOM_MAP_LOCAL_EVIDENCE_CELLS_H_
#define FATHOM_MAP_LOCAL_EVIDENCE_CELLS_H_

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "map/local/evidence.h"

namespace fathom::map {

inline constexpr std::uint32_t kBlockSide = 16;
inline constexpr std::size_t kBlockCells = 256;

// One cell, packed.
struct PackedEvidence {
  float weight = 0.0f;
  float mean_m = 0.0f;
  float scatter = 0.0f;
  std::uint32_t shoalest_time = 0x00ff'ffff;  // 24 bits, 8 lower bits of time.
  std::uint32_t time_count = 0;  // 16 upper bits, 15 of count, 1 "measured".

  friend bool operator==(const PackedEvidence&,
                         const PackedEvidence&) = default;
};
static_assert(sizeof(PackedEvidence) == 20);

inline std::uint16_t CountOf(const PackedEvidence& cell) {
  return static_cast<std::uint16_t>((cell.time_count >> 16) & kMaxCount);
}

inline bool IsMeasured(const PackedEvidence& cell) {
  return (cell.time_count >> 31) != 0;
}

// Weight, mean, scatter and count alone; what the rest says means nothing.
inline PackedEvidence PackMoments(const Evidence& evidence) {
  return {.weight = evidence.weight,
          .mean_m = evidence.mean_m,
          .scatter = evidence.scatter,
          .time_count = std::uint32_t{evidence.count} << 16};
}

class EvidenceCells {
 public:
  EvidenceCells() { slots_.fill(255); }
  EvidenceCells(const EvidenceCells& other);
  EvidenceCells& operator=(const EvidenceCells& other) {
    return *this = EvidenceCells(other);
  }
  EvidenceCells(EvidenceCells&&) noexcept = default;
  EvidenceCells& operator=(EvidenceCells&&) noexcept = default;
  ~EvidenceCells() = default;

  // Cells that were touched: those that something was ever written to.
  std::size_t size() const { return fresh_.size(); }
  bool touched(std::size_t k) const { return slots_[k] < size(); }
  // Whether a sounding ever fell in the cell, wherever its evidence is now.
  bool measured(std::size_t k) const {
    return touched(k) && IsMeasured(fresh_[slots_[k]]);
  }

  // The evidence since the start or the last MarkTransferred(); empty where
  // the cell was never touched.
  Evidence Fresh(std::size_t k) const {
    return touched(k) ? Unpack(fresh_[slots_[k]]) : Evidence{};
  }
  // What MarkTransferred() moved.
  Evidence Transferred(std::size_t k) const {
    return touched(k) && any_transferred() ? Unpack(transferred_[slots_[k]])
                                           : Evidence{};
  }
  bool any_transferred() const { return !transferred_.empty(); }
  // Both together.
  Evidence All(std::size_t k) const;
  // Fresh(k) as it is kept; null where it was never touched.
  const PackedEvidence* Find(std::size_t k) const {
    return touched(k) ? &fresh_[slots_[k]] : nullptr;
  }
  // The same of k, k + 1 and k + 2, without a branch.
  std::array<const PackedEvidence*, 3> FindThree(std::size_t k) const {
    const PackedEvidence* const cells = fresh_.data();
    const std::size_t touched = fresh_.size();
    std::array<const PackedEvidence*, 3> found;
    for (std::size_t n = 0; n < 3; ++n) {
      const std::size_t slot = slots_[k + n];
      found[n] = slot < touched ? cells + slot : nullptr;
    }
    return found;
  }
  const PackedEvidence* FindTransferred(std::size_t k) const {
    return touched(k) && any_transferred() ? &transferred_[slots_[k]] : nullptr;
  }

  // Cells that were ever measured; cells with fresh evidence. O(size()).
  std::size_t CountMeasured() const;
  std::size_t CountFresh() const;

  // Adds one sounding (Evidence::Add); true if it is the first ever in the
  // cell.
  bool Add(std::size_t k, float depth_m, float std_m, std::uint32_t time_s);
  // Hints that Add(k) is near: first the one, some time later the other.
  void PrefetchPlace(std::size_t k) const { __builtin_prefetch(&slots_[k]); }
  void PrefetchCell(std::size_t k) const {
    if (touched(k)) __builtin_prefetch(&fresh_[slots_[k]], /*for writing*/ 1);
  }
  // Replaces the cell's fresh evidence and says whether it was ever measured.
  void Set(std::size_t k, const Evidence& evidence, bool measured) {
    // Packed first: it may move the window.
    const PackedEvidence packed = Pack(evidence, measured);
    Mutable(k) = packed;
  }
  // Moves all fresh evidence to the transferred. The cells stay measured.
  void MarkTransferred();

  // Heap memory; a function of size() and any_transferred() alone.
  std::size_t memory_bytes() const { return MemoryBytesOf(size()); }
  // What it would be with so many cells.
  std::size_t MemoryBytesOf(std::size_t cells) const {
    return RoomFor(cells) * sizeof(PackedEvidence) *
           (any_transferred() ? 2 : 1);
  }

  // For storage: the begin of the window that packed times count from, Unix
  // seconds, and single cells, of which `transferred` is null where no cell
  // has any. Set the window before cells are restored.
  std::uint32_t window_s() const { return window_s_; }
  void set_window_s(std::uint32_t window_s) { window_s_ = window_s; }
  void Restore(std::size_t k, const PackedEvidence& fresh,
               const PackedEvidence* transferred);

  // Whether all 256 cells hold the same, in whatever order they were touched.
  friend bool operator==(const EvidenceCells& a, const EvidenceCells& b);

 private:
  static constexpr std::uint32_t kLow24 = 0x00ff'ffffu;
  static constexpr std::uint32_t kNoShoalest = kLow24;
  static constexpr double kStepsPerM = 1024.0;
  static constexpr double kShallowest_m = -100.0;
  // Times are packed as 1 + seconds since window_s_, 0: none.
  static constexpr std::uint32_t kHalfWindowS = 1u << 23;
  // Few are spare, and growing is rare: a cell is touched once for the first
  // time.
  static constexpr std::size_t RoomFor(std::size_t cells) {
    return (cells + 7) / 8 * 8;
  }
  static std::uint32_t PackShoalest(float depth_m) {
    // Cut off, that is to the shoaler; exact in double.
    return static_cast<std::uint32_t>(
        std::clamp((double{depth_m} - kShallowest_m) * kStepsPerM, 0.0,
                   double{kNoShoalest - 1}));
  }
  static std::uint32_t PackedTime(const PackedEvidence& cell) {
    return cell.shoalest_time >> 24 | (cell.time_count & 0xffffu) << 8;
  }

  Evidence Unpack(const PackedEvidence& cell) const;
  PackedEvidence Pack(const Evidence& evidence, bool measured);
  // The packed form, the window moved on if the time is beyond it.
  std::uint32_t PackTime(std::uint32_t time_s);
  void MoveWindow(std::uint32_t time_s);
  // The cell, touched now if it was not.
  PackedEvidence& Mutable(std::size_t k) {
    return touched(k) ? fresh_[slots_[k]] : Touch(k);
  }
  PackedEvidence& Touch(std::size_t k);

  std::vector<PackedEvidence> fresh_;
  std::vector<PackedEvidence> transferred_;  // Empty, or as many.
  std::uint32_t window_s_ = 0;               // A multiple of kHalfWindowS.
  // Where in fresh_ each cell is: a number that is not below size() means
  // nowhere. (With all 256 touched 255 is a place.)
  std::array<std::uint8_t, kBlockCells> slots_;
};

// Inline from here on, because each sounding comes this way.
inline Evidence EvidenceCells::Unpack(const PackedEvidence& cell) const {
  Evidence evidence = {.weight = cell.weight,
                       .mean_m = cell.mean_m,
                       .scatter = cell.scatter,
                       .count = CountOf(cell)};
  const std::uint32_t shoalest = cell.shoalest_time & kLow24;
  if (shoalest != kNoShoalest) {
    // Exact: a multiple of 2^-10 below 2^14.
    evidence.shoalest_m =
        static_cast<float>(shoalest) / static_cast<float>(kStepsPerM) +
        static_cast<float>(kShallowest_m);
  }
  const std::uint32_t time = PackedTime(cell);
  evidence.time_s = time == 0 ? 0 : window_s_ + (time - 1);
  return evidence;
}

inline std::uint32_t EvidenceCells::PackTime(std::uint32_t time_s) {
  if (time_s == 0) return 0;
  // What is older than the window wraps around to beyond it.
  if (time_s - window_s_ >= 2 * kHalfWindowS - 1) MoveWindow(time_s);
  return 1 + (std::max(time_s, window_s_) - window_s_);
}

inline bool EvidenceCells::Add(std::size_t k, float depth_m, float std_m,
                               std::uint32_t time_s) {
  const std::uint32_t packed_time = PackTime(time_s);
  PackedEvidence& cell = Mutable(k);
  const bool first = !IsMeasured(cell);
  Evidence evidence = {.weight = cell.weight,
                       .mean_m = cell.mean_m,
                       .scatter = cell.scatter,
                       .count = CountOf(cell)};
  evidence.AddMoments(depth_m, std_m);
  std::uint32_t shoalest = cell.shoalest_time & kLow24;
  if (const std::uint32_t here = PackShoalest(depth_m);
      here < shoalest && IsCredible(depth_m, std_m)) {
    shoalest = here;
  }
  const std::uint32_t time = std::max(PackedTime(cell), packed_time);
  cell = {.weight = evidence.weight,
          .mean_m = evidence.mean_m,
          .scatter = evidence.scatter,
          .shoalest_time = shoalest | time << 24,
          .time_count = time >> 8 | std::uint32_t{evidence.count} << 16 |
                        std::uint32_t{1} << 31};
  return first;
}

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_EVIDENCE_CELLS_H_
