// GetRegion: the map over an area as a regular grid of latitude and longitude,
// square at the area's middle latitude, handed out in blocks of at most
// kRegionTileSide squared so that a slow reader costs one block of memory.
//
// A Region reads one immutable view. Not thread-safe; each call has its own.

#ifndef FATHOM_SERVER_REGION_H_
#define FATHOM_SERVER_REGION_H_

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/time.h"
#include "fathom/v1/obstacle_service.pb.h"
#include "map/obstacle_map/obstacle_map_view.h"
#include "server/field_path.h"
#include "server/region_shoalest.h"

namespace fathom::server {

// See file comment.
class Region {
 public:
  // The grid for `request`, not yet tied to a view. `now` is what ages count
  // to. Errors: INVALID_ARGUMENT (field path below `root`); RESOURCE_EXHAUSTED
  // past kMaxRegionCells.
  static absl::StatusOr<Region> Create(const v1::GetRegionRequest& request,
                                       Time now, const FieldPath& root = {});

  // What to read. Errors: NOT_FOUND (no such activity), FAILED_PRECONDITION
  // (it has ended: its evidence is in the global map).
  absl::Status Open(std::shared_ptr<const map::ObstacleMapView> view);

  // Lets go of the view; Open before the next reading.
  void Close();

  uint32_t rows() const { return rows_; }
  uint32_t columns() const { return columns_; }
  // Outer north-west corner of the grid, and the size of its cells, degrees.
  const map::GeodeticPoint& north_west() const { return north_west_; }
  double latitude_step_deg() const { return latitude_step_deg_; }
  double longitude_step_deg() const { return longitude_step_deg_; }

  // Ages count to `now`.
  void set_now(Time now) { now_ = now; }

  // A part of the grid.
  struct Block {
    uint32_t first_row = 0;
    uint32_t first_column = 0;
    uint32_t rows = 0;
    uint32_t columns = 0;
  };
  // Writes the block; what it holds does not depend on how the grid is cut.
  // False soon after `stop` is set (about a millisecond), with an unfinished
  // tile. REQUIRES: Open; inside the grid. About 1 us a cell
  // (region_shoalest.h).
  bool Read(const Block& block, const std::atomic<bool>& stop,
            v1::RegionTile* tile);

  // What Next did.
  enum class Step { kBlock, kEnd, kStopped };

  // Writes the next block, rows from north to south. kStopped: see Read.
  // REQUIRES: Open.
  Step Next(const std::atomic<bool>& stop, v1::GetRegionResponse* out);

 private:
  Region() = default;

  std::optional<map::SeabedEstimate> SeabedAt(
      const map::GeodeticPoint& point) const;
  // Writes one cell: the map at its centre.
  void WriteCell(const map::GeodeticPoint& center, float shoalest_m, int i,
                 v1::RegionTile* tile) const;
  // The point that many rows south and columns east of the grid's corner.
  map::GeodeticPoint PointAt(double row, double column) const;
  // Corners of `columns` cells on the grid line `row`.
  void Corners(uint32_t row, uint32_t first_column, uint32_t columns,
               std::vector<map::GeodeticPoint>& out) const;

  std::shared_ptr<const map::ObstacleMapView> view_;
  const map::ActivityView* activity_ = nullptr;
  map::ActivityId activity_id_;
  map::LayerChoice layers_ = map::LayerChoice::kJoined;
  Time now_;
  map::GeodeticPoint north_west_;
  double latitude_step_deg_ = 0;
  double longitude_step_deg_ = 0;
  double resolution_m_ = 0;
  uint32_t rows_ = 0;
  uint32_t columns_ = 0;
  // How far a cell's side bows beyond its corners, at most.
  double bow_m_ = 0;
  std::optional<RegionShoalest> shoalest_;
  uint32_t next_row_ = 0;
  uint32_t next_column_ = 0;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_REGION_H_
