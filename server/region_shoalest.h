// The shoalest depth that the map holds anywhere in a cell of a GetRegion
// answer, whatever the answer's resolution: what makes a coarse picture safe.
//
// Cells come block by block, in each row by row from north to south. A cell is
// bounded by its four corners; the arcs between them bow by less than bow_m,
// which is added. From
//   - each open activity: all its measured cells that the cell touches, their
//     mean of soundings and their shoalest sounding;
//   - the global map, unless one activity has measured every place in the
//     cell: the bounds of the quadtree cells, at most as large as the answer's
//     cell, that it touches; where one leaf covers it, that leaf's.
//
// Cost: 0.1 us a cell where a coarse chart alone is asked, about 1 us where
// the map is as fine, and 2 ns for each local cell below.
//
// Not thread-safe; each call has its own.

#ifndef FATHOM_SERVER_REGION_SHOALEST_H_
#define FATHOM_SERVER_REGION_SHOALEST_H_

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "map/obstacle_map/obstacle_map_view.h"

namespace fathom::server {

// What a RegionShoalest is asked for.
struct ShoalestOptions {
  // One activity alone, or null.
  const map::ActivityView* activity = nullptr;
  map::LayerChoice layers = map::LayerChoice::kJoined;
  // Largest side of a cell.
  double resolution_m = 0;
  // How far the middle of a cell's side may bow beyond its corners.
  double bow_m = 0;
};

// See file comment. The view must outlive it.
class RegionShoalest {
 public:
  RegionShoalest(const map::ObstacleMapView& view, ShoalestOptions options);

  // Before the rows of another block of the answer.
  void StartBlock() { south_nodes_.clear(); }

  // The next row: `north` and `south` are the corners of its cells from west
  // to east, one more than cells. Fills `shoalest_m` (NaN: nothing is held).
  // False, and the row is unfinished, once `stop` is set; looked at about once
  // a millisecond.
  bool NextRow(const std::vector<map::GeodeticPoint>& north,
               const std::vector<map::GeodeticPoint>& south,
               const std::atomic<bool>& stop, std::vector<float>& shoalest_m);

 private:
  // A corner in the global map.
  struct GlobalNode {
    std::optional<map::SquarePoint> place;
    std::optional<map::CellKey> leaf;
  };
  // What local cells say.
  struct LocalPart {
    float shoalest_m;
    // Every place of the cell was measured.
    bool complete = false;
  };

  LocalPart InActivity(const map::LocalMapView& local,
                       const std::vector<map::NedPoint>& north,
                       const std::vector<map::NedPoint>& south, size_t column,
                       const std::atomic<bool>& stop) const;
  float InGlobal(size_t column);
  float BoundOf(const map::CellKey& cell);
  GlobalNode NodeAt(const map::GeodeticPoint& point) const;

  const map::ObstacleMapView& view_;
  const ShoalestOptions options_;
  std::vector<const map::ActivityView*> activities_;
  // Level of the quadtree whose cells are at most as large as an answer cell.
  int level_ = 0;
  // bow_m as a part of the square's side.
  double bow_uv_ = 0;
  // Corners of the present row, kept because the next row shares the southern
  // ones.
  std::vector<GlobalNode> north_nodes_;
  std::vector<GlobalNode> south_nodes_;
  std::vector<map::NedPoint> north_ned_;
  std::vector<map::NedPoint> south_ned_;
  // Bounds of quadtree cells seen; neighbours share them.
  absl::flat_hash_map<uint64_t, float> bounds_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_REGION_SHOALEST_H_
