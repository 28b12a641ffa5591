// Writing many cells of one level: the walk that transfer and import share.
// Private to map/global; not thread-safe.

#ifndef FATHOM_MAP_GLOBAL_AREA_WRITER_H_
#define FATHOM_MAP_GLOBAL_AREA_WRITER_H_

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "map/global/cell_key.h"
#include "map/global/fuse.h"
#include "map/global/root_square.h"
#include "map/global/work_tree.h"

namespace fathom::map {

// What is written where. One object serves one call.
class CellRule {
 public:
  CellRule() = default;
  CellRule(const CellRule&) = delete;
  CellRule& operator=(const CellRule&) = delete;
  virtual ~CellRule() = default;

  // What is known about a cell, nullopt for nothing. The cell is given by its
  // middle and by k row planes and k column planes that cross at the middles
  // of its k x k parts (RootSquare::Meet).
  virtual std::optional<CellEvidence> Sample(
      const SquarePoint& center, std::span<const Vector3> row_planes,
      std::span<const Vector3> col_planes) = 0;

  // Whether a leaf that is larger than the cell may be divided for it.
  virtual bool MayDivide(const Leaf& leaf) const = 0;

  // Changes the leaf; false if it is left as it was.
  virtual bool Apply(const CellEvidence& evidence, Leaf& leaf) const = 0;
};

struct AreaCounts {
  std::uint64_t written = 0;
  // Cells for which the map could not be divided far enough.
  std::uint64_t degraded = 0;
  // Cells whose leaf the rule left as it was.
  std::uint64_t refused = 0;
};

// A rectangle of cells of one level; ends are included.
struct CellRange {
  std::uint32_t row_begin = 0;
  std::uint32_t row_last = 0;
  std::uint32_t col_begin = 0;
  std::uint32_t col_last = 0;
};

class AreaWriter {
 public:
  // Writes cells of `level`, each sampled at `samples_per_side` squared points.
  AreaWriter(const RootSquare& root, WorkTree& tree, int level,
             int samples_per_side, CellRule& rule);

  // Offers every cell of the range to the rule, tile by tile; where the map is
  // deeper than the level, the leaves below in its place.
  void WriteRange(const CellRange& range);

  // Gives the coarser leaves that could not be divided what was gathered for
  // them, one update each, and returns the counts. Call it once, last.
  AreaCounts Finish();

 private:
  void WriteTile(const TileKey& key, const CellRange& range);
  // Offers each leaf below a cell that is divided further.
  void WriteDeeper(WorkTile& tile, std::uint32_t begin, std::uint32_t end);
  std::optional<CellEvidence> SampleCell(const CellKey& cell);
  void Update(WorkTile& tile, std::uint32_t start,
              const CellEvidence& evidence);

  const RootSquare& root_;
  WorkTree& tree_;
  const int level_;
  const int samples_;
  CellRule& rule_;
  AreaCounts counts_;
  // What waits for a leaf that could not be divided. Ordered, so that the
  // outcome does not depend on addresses.
  std::map<CellKey, EvidenceSum> pending_;
  // Planes of the rows and columns of the present tile, samples_ per cell.
  std::vector<Vector3> row_planes_;
  std::vector<Vector3> col_planes_;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_AREA_WRITER_H_
