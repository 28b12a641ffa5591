#include "client/region.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "absl/strings/str_format.h"

namespace fathom::client {
namespace {

// Copies a tile's array into its place; an empty array leaves it unknown.
// False if it is neither empty nor rows x columns long.
template <typename From, typename To>
bool Place(const From& from, const v1::RegionTile& tile, std::uint32_t columns,
           std::vector<To>& to) {
  const std::size_t tile_columns = tile.columns();
  const std::size_t tile_cells = tile.rows() * tile_columns;
  if (from.empty()) return true;
  if (static_cast<std::size_t>(from.size()) != tile_cells) return false;
  for (std::size_t row = 0; row < tile.rows(); ++row) {
    const auto begin =
        from.begin() + static_cast<std::ptrdiff_t>(row * tile_columns);
    const std::size_t offset =
        (tile.first_row() + row) * columns + tile.first_column();
    std::copy(begin, begin + static_cast<std::ptrdiff_t>(tile_columns),
              to.begin() + static_cast<std::ptrdiff_t>(offset));
  }
  return true;
}

}  // namespace

absl::Status RegionAssembler::Add(const v1::GetRegionResponse& message) {
  if (!have_grid_) {
    const std::uint64_t cells =
        std::uint64_t{message.total_rows()} * message.total_columns();
    if (cells == 0 || cells > kMaxRegionCells) {
      return absl::ResourceExhaustedError(absl::StrFormat(
          "region of %d x %d cells: from 1 to %d are accepted; ask for a "
          "smaller area or a coarser resolution_m",
          message.total_rows(), message.total_columns(), kMaxRegionCells));
    }
    constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
    region_.rows = message.total_rows();
    region_.columns = message.total_columns();
    region_.depth_m.assign(cells, kUnknown);
    region_.std_m.assign(cells, kUnknown);
    region_.age_s.assign(cells, kUnknown);
    region_.shoalest_m.assign(cells, kUnknown);
    region_.kind.assign(cells, v1::EVIDENCE_KIND_UNSPECIFIED);
    have_grid_ = true;
  }
  if (message.has_stamp()) region_.stamp = message.stamp();
  if (!message.has_tile()) return absl::OkStatus();

  const v1::RegionTile& tile = message.tile();
  if (std::uint64_t{tile.first_row()} + tile.rows() > region_.rows ||
      std::uint64_t{tile.first_column()} + tile.columns() > region_.columns) {
    return absl::InternalError(absl::StrFormat(
        "tile at row %d, column %d of %d x %d cells leaves the grid of %d x %d",
        tile.first_row(), tile.first_column(), tile.rows(), tile.columns(),
        region_.rows, region_.columns));
  }
  if (!have_origin_) {
    region_.latitude_step_deg = tile.latitude_step_deg();
    region_.longitude_step_deg = tile.longitude_step_deg();
    // Every tile tells where the grid begins; the first one decides.
    region_.north_west.set_latitude_deg(tile.north_west().latitude_deg() +
                                        tile.first_row() *
                                            tile.latitude_step_deg());
    double longitude_deg = tile.north_west().longitude_deg() -
                           tile.first_column() * tile.longitude_step_deg();
    if (longitude_deg < -180) longitude_deg += 360;
    region_.north_west.set_longitude_deg(longitude_deg);
    have_origin_ = true;
  }
  if (!Place(tile.depth_m(), tile, region_.columns, region_.depth_m) ||
      !Place(tile.std_m(), tile, region_.columns, region_.std_m) ||
      !Place(tile.age_s(), tile, region_.columns, region_.age_s) ||
      !Place(tile.shoalest_m(), tile, region_.columns, region_.shoalest_m) ||
      !Place(tile.kind(), tile, region_.columns, region_.kind)) {
    return absl::InternalError(absl::StrFormat(
        "tile at row %d, column %d: an array is not rows x columns = %d long",
        tile.first_row(), tile.first_column(),
        std::uint64_t{tile.rows()} * tile.columns()));
  }
  cells_seen_ += std::uint64_t{tile.rows()} * tile.columns();
  return absl::OkStatus();
}

absl::StatusOr<Region> RegionAssembler::Take() {
  if (!have_grid_) return absl::InternalError("the region came without a grid");
  if (!have_origin_) {
    return absl::InternalError("the region came without any tile");
  }
  if (cells_seen_ != region_.depth_m.size()) {
    return absl::InternalError(
        absl::StrFormat("%d of %d cells came: the region is not whole",
                        cells_seen_, region_.depth_m.size()));
  }
  return std::move(region_);
}

}  // namespace fathom::client
