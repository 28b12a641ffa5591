#include "sim_feeder/water_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <queue>
#include <utility>

namespace fathom::feeder {
namespace {

constexpr std::size_t kNowhere = std::numeric_limits<std::size_t>::max();

std::size_t CellsAlong(double extent_m, double cell_m) {
  return std::max<std::size_t>(
      1, static_cast<std::size_t>(std::floor(extent_m / cell_m)));
}

}  // namespace

WaterGrid::WaterGrid(const LocalTerrain& terrain, const SurveyArea& area,
                     double min_water_m) {
  const double longer_m = std::max(area.north_extent_m, area.east_extent_m);
  const double shorter_m = std::min(area.north_extent_m, area.east_extent_m);
  cell_m_ = std::max(longer_m / kMaxCellsPerSide,
                     std::min(terrain.cell_size_m(), shorter_m / 16.0));
  rows_ = CellsAlong(area.north_extent_m, cell_m_);
  columns_ = CellsAlong(area.east_extent_m, cell_m_);
  open_.resize(rows_ * columns_, 1);
  // Half a terrain cell apart, borders included: a hole in the terrain (two
  // of its cells wide, since the seabed is bilinear) cannot hide between.
  const int looks =
      2 * static_cast<int>(std::ceil(cell_m_ / terrain.cell_size_m())) + 1;
  std::vector<std::size_t> holes;
  for (std::size_t i = 0; i < open_.size(); ++i) {
    const PlanePoint center = CenterOf(i);
    bool hole = false;
    for (int k = 0; k < looks * looks && !hole; ++k) {
      const int row = k / looks;
      const int column = k % looks;
      const double north_m =
          center.north_m +
          (static_cast<double>(row) / (looks - 1) - 0.5) * cell_m_;
      const double east_m =
          center.east_m +
          (static_cast<double>(column) / (looks - 1) - 0.5) * cell_m_;
      const std::optional<double> depth_m = terrain.DepthAt(north_m, east_m);
      if (!depth_m.has_value()) hole = true;
      if (!depth_m.has_value() || *depth_m < min_water_m) open_[i] = 0;
    }
    if (hole) holes.push_back(i);
  }
  for (const std::size_t hole : holes) CloseAround(hole);
  KeepLargestWater();
}

std::size_t WaterGrid::IndexOf(const PlanePoint& place) const {
  const double row = std::floor(place.north_m / cell_m_);
  const double column = std::floor(place.east_m / cell_m_);
  if (!(row >= 0.0 && row < static_cast<double>(rows_) && column >= 0.0 &&
        column < static_cast<double>(columns_))) {
    return kNowhere;
  }
  return static_cast<std::size_t>(row) * columns_ +
         static_cast<std::size_t>(column);
}

PlanePoint WaterGrid::CenterOf(std::size_t index) const {
  const std::size_t row = index / columns_;
  const std::size_t column = index % columns_;
  return {.north_m = (static_cast<double>(row) + 0.5) * cell_m_,
          .east_m = (static_cast<double>(column) + 0.5) * cell_m_};
}

void WaterGrid::CloseAround(std::size_t index) {
  const std::size_t row = index / columns_;
  const std::size_t column = index % columns_;
  for (std::size_t i = row == 0 ? 0 : row - 1;
       i <= std::min(row + 1, rows_ - 1); ++i) {
    for (std::size_t j = column == 0 ? 0 : column - 1;
         j <= std::min(column + 1, columns_ - 1); ++j) {
      open_[i * columns_ + j] = 0;
    }
  }
}

void WaterGrid::KeepLargestWater() {
  std::vector<std::uint32_t> label(open_.size(), 0);
  std::uint32_t labels = 0;
  std::uint32_t largest = 0;
  for (std::size_t start = 0; start < open_.size(); ++start) {
    if (open_[start] == 0 || label[start] != 0) continue;
    ++labels;
    std::size_t size = 0;
    std::vector<std::size_t> waiting = {start};
    label[start] = labels;
    while (!waiting.empty()) {
      const std::size_t cell = waiting.back();
      waiting.pop_back();
      ++size;
      const auto visit = [&](bool inside, std::size_t next) {
        if (!inside || open_[next] == 0 || label[next] != 0) return;
        label[next] = labels;
        waiting.push_back(next);
      };
      visit(cell >= columns_, cell - columns_);
      visit(cell + columns_ < open_.size(), cell + columns_);
      visit(cell % columns_ != 0, cell - 1);
      visit(cell % columns_ + 1 != columns_, cell + 1);
    }
    if (size > open_cells_) {
      open_cells_ = size;
      largest = labels;
    }
  }
  for (std::size_t i = 0; i < open_.size(); ++i) {
    open_[i] = largest != 0 && label[i] == largest ? 1 : 0;
  }
}

bool WaterGrid::IsOpen(const PlanePoint& place) const {
  const std::size_t index = IndexOf(place);
  return index != kNowhere && open_[index] != 0;
}

bool WaterGrid::IsClear(const PlanePoint& from, const PlanePoint& to) const {
  const double north_m = to.north_m - from.north_m;
  const double east_m = to.east_m - from.east_m;
  const int steps = std::max(
      1,
      static_cast<int>(std::ceil(2.0 * std::hypot(north_m, east_m) / cell_m_)));
  for (int i = 0; i <= steps; ++i) {
    const double part = static_cast<double>(i) / steps;
    if (!IsOpen({.north_m = from.north_m + part * north_m,
                 .east_m = from.east_m + part * east_m})) {
      return false;
    }
  }
  return true;
}

std::vector<std::size_t> WaterGrid::SearchCells(std::size_t from,
                                                std::size_t to) const {
  const auto row_of = [&](std::size_t cell) {
    return static_cast<std::ptrdiff_t>(cell / columns_);
  };
  const auto column_of = [&](std::size_t cell) {
    return static_cast<std::ptrdiff_t>(cell % columns_);
  };
  const auto rest = [&](std::size_t cell) {
    return std::hypot(static_cast<double>(row_of(cell) - row_of(to)),
                      static_cast<double>(column_of(cell) - column_of(to)));
  };
  std::vector<double> cost(open_.size(),
                           std::numeric_limits<double>::infinity());
  std::vector<std::size_t> before(open_.size(), kNowhere);
  using Entry = std::pair<double, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> waiting;
  cost[from] = 0.0;
  waiting.push({rest(from), from});
  while (!waiting.empty()) {
    const auto [estimate, cell] = waiting.top();
    waiting.pop();
    if (cell == to) break;
    if (estimate > cost[cell] + rest(cell) + 1e-9) continue;  // Outdated.
    for (std::ptrdiff_t di = -1; di <= 1; ++di) {
      for (std::ptrdiff_t dj = -1; dj <= 1; ++dj) {
        const std::ptrdiff_t row = row_of(cell) + di;
        const std::ptrdiff_t column = column_of(cell) + dj;
        if (row < 0 || column < 0 ||
            row >= static_cast<std::ptrdiff_t>(rows_) ||
            column >= static_cast<std::ptrdiff_t>(columns_)) {
          continue;
        }
        const std::size_t next = static_cast<std::size_t>(row) * columns_ +
                                 static_cast<std::size_t>(column);
        if (next == cell || open_[next] == 0) continue;
        const double step = di != 0 && dj != 0 ? std::numbers::sqrt2 : 1.0;
        if (cost[cell] + step < cost[next]) {
          cost[next] = cost[cell] + step;
          before[next] = cell;
          waiting.push({cost[next] + rest(next), next});
        }
      }
    }
  }
  std::vector<std::size_t> cells;
  for (std::size_t cell = to; cell != kNowhere; cell = before[cell]) {
    cells.push_back(cell);
  }
  std::reverse(cells.begin(), cells.end());
  return cells;
}

std::vector<PlanePoint> WaterGrid::FindWay(const PlanePoint& from,
                                           const PlanePoint& to) const {
  if (IsClear(from, to)) return {from, to};
  std::vector<PlanePoint> full = {from};
  for (const std::size_t cell : SearchCells(IndexOf(from), IndexOf(to))) {
    full.push_back(CenterOf(cell));
  }
  full.push_back(to);
  // Go on from each corner to the farthest place that is in plain sight.
  std::vector<PlanePoint> way = {from};
  for (std::size_t at = 0; at + 1 < full.size();) {
    std::size_t next = at + 1;
    while (next + 1 < full.size() && IsClear(full[at], full[next + 1])) ++next;
    way.push_back(full[next]);
    at = next;
  }
  return way;
}

}  // namespace fathom::feeder
