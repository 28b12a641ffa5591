#include "map/local/estimator.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>

#include "absl/strings/str_format.h"

namespace fathom::map {

std::string_view EstimatorName(EstimatorKind kind) {
  switch (kind) {
    case EstimatorKind::kNervegna:
      return "nervegna";
    case EstimatorKind::kKalman:
      return "kalman";
    case EstimatorKind::kAdaptive:
      return "adaptive";
  }
  return "?";
}

absl::StatusOr<EstimatorKind> ParseEstimator(std::string_view name) {
  for (const EstimatorKind kind :
       {EstimatorKind::kNervegna, EstimatorKind::kKalman,
        EstimatorKind::kAdaptive}) {
    if (EstimatorName(kind) == name) return kind;
  }
  return absl::InvalidArgumentError(absl::StrFormat(
      "estimator=\"%s\" must be one of nervegna, kalman, adaptive",
      std::string(name)));
}

std::uint32_t SmoothReach(double distance_m, double cell_size_m) {
  return static_cast<std::uint32_t>(std::ceil(distance_m / cell_size_m));
}

NeighbourBounds SmoothBounds(CellIndex cell, std::uint32_t reach,
                             std::uint32_t cells_north,
                             std::uint32_t cells_east) {
  const std::int32_t n = static_cast<std::int32_t>(reach);
  return {
      .north = std::min(cell.i + n, static_cast<std::int32_t>(cells_north) - 1),
      .east = std::min(cell.j + n, static_cast<std::int32_t>(cells_east) - 1),
      .south = std::max(cell.i - n, 0),
      .west = std::max(cell.j - n, 0)};
}

double SmoothGain(double scale, double variance_1, double variance_2,
                  std::uint32_t cells_apart) {
  if (std::isinf(variance_1)) return scale;
  return scale * variance_1 / (variance_1 + variance_2 + cells_apart);
}

std::uint32_t CellsApart(CellIndex a, CellIndex b) {
  return static_cast<std::uint32_t>(
      std::max(std::abs(a.i - b.i), std::abs(a.j - b.j)));
}

}  // namespace fathom::map
