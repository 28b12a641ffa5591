#include "map/local/smoothed_reading.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "map/local/local_map_options.h"

namespace fathom::map {
namespace {

struct Step {
  double square_sum = 0.0;
  double count = 0.0;
  void Add(const std::optional<DepthEstimate>& a,
           const std::optional<DepthEstimate>& b) {
    if (!a.has_value() || !b.has_value()) return;
    const double step_m =
        static_cast<double>(b->depth_m) - static_cast<double>(a->depth_m);
    square_sum += step_m * step_m;
    count += 1.0;
  }
};

// D^2 of the header, per cell squared.
double Roughness(const std::vector<std::optional<DepthEstimate>>& box,
                 std::size_t rows, std::size_t cols, double cell_size_m) {
  Step north;
  Step east;
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t col = 0; col < cols; ++col) {
      const std::optional<DepthEstimate>& here = box[row * cols + col];
      if (row + 1 < rows) north.Add(here, box[(row + 1) * cols + col]);
      if (col + 1 < cols) east.Add(here, box[row * cols + col + 1]);
    }
  }
  const double typical_m = kTypicalSlope * cell_size_m;
  double square = 0.0;
  if (north.count > 0.0) square += north.square_sum / north.count;
  if (east.count > 0.0) square += east.square_sum / east.count;
  // One axis without a pair: it is taken to step as the other does.
  if ((north.count > 0.0) != (east.count > 0.0)) square *= 2.0;
  return std::max(square, typical_m * typical_m);
}

}  // namespace

std::optional<DepthEstimate> ReadSmoothed(CellIndex cell,
                                          const NeighbourBounds& bounds,
                                          double scale, double cell_size_m,
                                          const MeasuredReader& read) {
  if (scale <= 0.0) return std::nullopt;
  const auto rows = static_cast<std::size_t>(bounds.north - bounds.south) + 1;
  const auto cols = static_cast<std::size_t>(bounds.east - bounds.west) + 1;
  std::vector<std::optional<DepthEstimate>> box(rows * cols);
  bool any = false;
  for (std::size_t k = 0; k < box.size(); ++k) {
    box[k] = read({.i = bounds.south + static_cast<std::int32_t>(k / cols),
                   .j = bounds.west + static_cast<std::int32_t>(k % cols)});
    any = any || box[k].has_value();
  }
  if (!any) return std::nullopt;

  const double roughness_m2 = Roughness(box, rows, cols, cell_size_m);
  double weight_sum = 0.0;
  double mean_m = 0.0;
  double spread = 0.0;  // Sum of w (z - mean)^2, Welford.
  double worst_m2 = 0.0;
  std::uint32_t nearest = kMaxSmoothReach;
  std::uint32_t oldest_s = std::numeric_limits<std::uint32_t>::max();
  for (std::size_t k = 0; k < box.size(); ++k) {
    if (!box[k].has_value()) continue;
    const DepthEstimate& from = *box[k];
    const std::uint32_t apart = CellsApart(
        cell, {.i = bounds.south + static_cast<std::int32_t>(k / cols),
               .j = bounds.west + static_cast<std::int32_t>(k % cols)});
    const double variance_m2 = static_cast<double>(from.std_m) * from.std_m;
    const double weight =
        1.0 / (variance_m2 + roughness_m2 * static_cast<double>(apart) * apart);
    const double from_old_m = from.depth_m - mean_m;
    weight_sum += weight;
    mean_m += from_old_m * weight / weight_sum;
    spread += weight * from_old_m * (from.depth_m - mean_m);
    worst_m2 = std::max(worst_m2, variance_m2);
    nearest = std::min(nearest, apart);
    oldest_s = std::min(oldest_s, from.time_s);
  }
  const double variance_m2 =
      (worst_m2 + roughness_m2 * static_cast<double>(nearest) * nearest +
       spread / weight_sum) /
      scale;
  return DepthEstimate{.depth_m = static_cast<float>(mean_m),
                       .std_m = static_cast<float>(std::sqrt(variance_m2)),
                       .kind = EvidenceKind::kSmoothed,
                       .time_s = oldest_s,
                       .cell_size_m = static_cast<float>(cell_size_m)};
}

}  // namespace fathom::map
