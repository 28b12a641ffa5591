// What `adaptive` read of measured cells, kept for who asks again: planners ask
// about the same water over and over, and a reading made of nine cells costs
// ten times as much as finding it here (docs/adr/0017-readings-kept.md).
//
// A reading is named by its map, its cell and the newest epoch among the blocks
// of the nine cells (map/local/block_directory.h). A piece of an epoch never
// changes once a view can see it, and whatever changes later has a later
// epoch, so the name tells the content: what is found is what would be
// reckoned, to the bit, for old views and new ones alike, and nothing ever
// needs to be thrown away. One table for each thread that reads, made when it
// first does: no lock, no counter.

#ifndef FATHOM_MAP_LOCAL_READING_CACHE_H_
#define FATHOM_MAP_LOCAL_READING_CACHE_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "map/geodesy/depth_estimate.h"
#include "map/local/cell_index.h"

namespace fathom::map {

struct ReadingName {
  std::uint64_t map = 0;  // LocalGrid::id; 0: no map.
  std::uint64_t epoch = 0;
  CellIndex cell;

  friend bool operator==(const ReadingName&, const ReadingName&) = default;
};

// 1 MiB: 128 x 128 places, so that no two cells of a local map of that size
// share one. A cell takes the place of another one 128 rows or columns off.
class ReadingCache {
 public:
  // A cache line.
  struct alignas(64) Place {
    ReadingName name;
    DepthEstimate estimate;
  };

  // The table of the thread that calls.
  static ReadingCache& OfThisThread() {
    thread_local ReadingCache mine;
    return mine;
  }

  // Where the reading is, if its name is that, or is to be put.
  Place& At(const ReadingName& name) {
    // Maps of the same area that are open together differ by their id.
    const std::size_t row = static_cast<std::uint32_t>(name.cell.i) +
                            static_cast<std::size_t>(name.map) * kMapStep;
    const std::size_t col = static_cast<std::uint32_t>(name.cell.j);
    return places_[row % kSide * kSide + col % kSide];
  }

 private:
  static constexpr std::size_t kSide = 128;
  static constexpr std::size_t kMapStep = 41;

  ReadingCache() : places_(kSide * kSide) {}

  std::vector<Place> places_;
};
static_assert(sizeof(ReadingCache::Place) == 64);

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_READING_CACHE_H_
