#include "client/cli/raster_grid.h"

#include <algorithm>
#include <cmath>

namespace fathom::client::cli {
namespace {

// Rounding of edges that lie on the box's own: a millionth of a cell.
constexpr double kEdgeSlack = 1e-6;

struct Range {
  std::int64_t first = 0;
  std::int64_t end = 0;
  std::int64_t count() const { return std::max<std::int64_t>(0, end - first); }
};

// Cells of a line of cells of size 1 from 0 that touch (low, high).
Range Touching(double low, double high) {
  return {static_cast<std::int64_t>(std::floor(low + kEdgeSlack)),
          static_cast<std::int64_t>(std::ceil(high - kEdgeSlack))};
}

Range Within(Range range, std::int64_t count) {
  return {std::clamp<std::int64_t>(range.first, 0, count),
          std::clamp<std::int64_t>(range.end, 0, count)};
}

}  // namespace

std::optional<LonLatGrid> Clip(const LonLatGrid& grid,
                               const std::optional<GeoBox>& box) {
  const auto rows_of = [&](double north_deg, double south_deg) {
    return Within(
        Touching((grid.north_deg - north_deg) / grid.latitude_step_deg,
                 (grid.north_deg - south_deg) / grid.latitude_step_deg),
        grid.rows);
  };
  // Cells whose edges pass a pole are left out.
  Range rows = {
      std::max<std::int64_t>(
          0, static_cast<std::int64_t>(std::ceil(
                 (grid.north_deg - 90) / grid.latitude_step_deg - kEdgeSlack))),
      std::min<std::int64_t>(
          grid.rows,
          static_cast<std::int64_t>(std::floor(
              (grid.north_deg + 90) / grid.latitude_step_deg + kEdgeSlack)))};
  Range columns = {0, grid.columns};
  if (box.has_value()) {
    const Range wanted = rows_of(box->north_deg, box->south_deg);
    rows = {std::max(rows.first, wanted.first), std::min(rows.end, wanted.end)};
    columns = {0, 0};
    for (int turn = -2; turn <= 2; ++turn) {
      const double west = (box->west_deg + 360 * turn - grid.west_deg) /
                          grid.longitude_step_deg;
      Range touching =
          Touching(west, west + box->Width() / grid.longitude_step_deg);
      if (grid.periodic) {
        // Every turn holds the same cells; take the one that starts here.
        touching.end = std::min(touching.end, touching.first + grid.columns);
        if (touching.first >= 0 && touching.first < grid.columns) {
          columns = touching;
        }
      } else {
        touching = Within(touching, grid.columns);
        if (touching.count() > columns.count()) columns = touching;
      }
    }
  }
  if (rows.count() == 0 || columns.count() == 0) return std::nullopt;
  LonLatGrid clipped = grid;
  clipped.north_deg -= static_cast<double>(rows.first) * grid.latitude_step_deg;
  clipped.west_deg +=
      static_cast<double>(columns.first) * grid.longitude_step_deg;
  clipped.rows = rows.count();
  clipped.columns = columns.count();
  clipped.periodic = grid.periodic && clipped.columns == grid.columns;
  return clipped;
}

std::vector<GridBlock> CutIntoBlocks(const LonLatGrid& grid,
                                     std::int64_t max_cells) {
  // First the columns, at each antimeridian between two cell middles.
  std::vector<std::int64_t> cuts = {0};
  double meridian_deg =
      360 * std::floor((grid.CenterLongitude(0) + 180) / 360) - 180;
  while (true) {
    meridian_deg += 360;
    const auto cut = static_cast<std::int64_t>(
        std::ceil((meridian_deg - grid.west_deg) / grid.longitude_step_deg -
                  0.5 + kEdgeSlack));
    if (cut >= grid.columns) break;
    if (cut > cuts.back()) cuts.push_back(cut);
  }
  cuts.push_back(grid.columns);

  const auto side = std::max<std::int64_t>(
      1, static_cast<std::int64_t>(std::sqrt(static_cast<double>(max_cells))));
  std::vector<GridBlock> blocks;
  for (std::int64_t row = 0; row < grid.rows; row += side) {
    for (std::size_t part = 0; part + 1 < cuts.size(); ++part) {
      for (std::int64_t column = cuts[part]; column < cuts[part + 1];
           column += side) {
        blocks.push_back({row, column, std::min(side, grid.rows - row),
                          std::min(side, cuts[part + 1] - column)});
      }
    }
  }
  return blocks;
}

}  // namespace fathom::client::cli
