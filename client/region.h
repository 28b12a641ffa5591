// An area of the map as one grid, and how it is put together from the tiles
// of GetRegion. Plain values.

#ifndef FATHOM_CLIENT_REGION_H_
#define FATHOM_CLIENT_REGION_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "fathom/v1/obstacle_service.pb.h"
#include "fathom/v1/types.pb.h"

namespace fathom::client {

// Most cells that a client takes: five arrays of 64 M cells are 1.1 GB. The
// server's own limit (Limits.max_region_cells) is usually lower.
inline constexpr std::uint64_t kMaxRegionCells = 64'000'000;

// A regular grid of latitude and longitude. All arrays are rows x columns,
// row-major, row 0 northernmost, column 0 westernmost.
struct Region {
  std::uint32_t rows = 0;
  std::uint32_t columns = 0;
  // Outer north-west corner of cell (0, 0).
  v1::GeodeticPoint north_west;
  // Size of a cell, degrees, > 0.
  double latitude_step_deg = 0;
  double longitude_step_deg = 0;
  // Metres below the mission's datum; NaN: unknown or land.
  std::vector<float> depth_m;
  // 1 sigma metres; NaN: unknown.
  std::vector<float> std_m;
  // Age of the newest evidence, seconds; NaN: unknown.
  std::vector<float> age_s;
  // Shoalest depth anywhere in the cell, metres; NaN: unknown.
  std::vector<float> shoalest_m;
  // EvidenceKind of each cell.
  std::vector<std::uint8_t> kind;
  // What it was read from.
  v1::MapStamp stamp;

  std::size_t Index(std::uint32_t row, std::uint32_t column) const {
    return static_cast<std::size_t>(row) * columns + column;
  }
};

// Puts a stream of tiles together. The first message fixes the grid; tiles
// may come in any order.
class RegionAssembler {
 public:
  // Adds one message. Errors: INTERNAL when it contradicts the messages
  // before it (size, steps, a tile outside the grid, arrays of a wrong
  // length); RESOURCE_EXHAUSTED for a grid above kMaxRegionCells.
  absl::Status Add(const v1::GetRegionResponse& message);

  // The grid; empties the assembler. Errors: INTERNAL when
  // no message came, or the tiles do not cover the grid.
  absl::StatusOr<Region> Take();

  // Cells that came, and those of the whole grid (0 before the first message).
  std::uint64_t cells_seen() const { return cells_seen_; }
  std::uint64_t cells_total() const { return region_.depth_m.size(); }

 private:
  Region region_;
  std::uint64_t cells_seen_ = 0;
  bool have_grid_ = false;
  bool have_origin_ = false;
};

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_REGION_H_
