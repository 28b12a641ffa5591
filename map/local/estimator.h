// The thesis's update and smoothing rules, each under its equation's number,
// and the names of the estimators that are built from them.
//
// Throughout, 1 is what the cell held and 2 what is added. Means are metres,
// variances m^2. All functions are pure and thread-safe.
//
//   nervegna  4.18 + 4.21, smoothing written to the neighbours (4.24): the
//             thesis's choice.
//   kalman    4.18 + 4.20: optimal while pings agree, overconfident where
//             they do not.
//   adaptive  the default: sufficient statistics of the evidence, kept apart
//             from the prior; see map/local/adaptive.h.
//
// Why the default departs from 4.21 (shown by
// tests/map/local/estimator_test.cc): in expectation its fixed point is
// std^2 = sqrt(2) sigma^2 with a gain of 2 - sqrt(2) = 0.59, so each new ping
// goes on moving the mean; simulated, the error stops falling at 0.54 sigma
// however many pings arrive, and 91 % of truths lie within 1 std.

#ifndef FATHOM_MAP_LOCAL_ESTIMATOR_H_
#define FATHOM_MAP_LOCAL_ESTIMATOR_H_

#include <cstdint>
#include <string_view>

#include "absl/status/statusor.h"
#include "map/geodesy/depth_fusion.h"  // IWYU pragma: export
#include "map/local/cell_index.h"

namespace fathom::map {

// The numbers are those of fathom.v1.Estimator and are stored.
enum class EstimatorKind : std::uint8_t {
  kNervegna = 1,
  kKalman = 2,
  kAdaptive = 3,
};

// "nervegna", "kalman", "adaptive"; "?" for a number that is none.
std::string_view EstimatorName(EstimatorKind kind);

// The inverse. Errors: INVALID_ARGUMENT, listing the names.
absl::StatusOr<EstimatorKind> ParseEstimator(std::string_view name);

// Gain, FuseMean, CorrectMean and FuseVariance* (eqs. 4.17 to 4.21) stand in
// map/geodesy/depth_fusion.h, which this header includes.

// Eq. 4.22: n = ceil(d / res), cells smoothed in each direction. REQUIRES:
// distance_m >= 0, cell_size_m > 0.
std::uint32_t SmoothReach(double distance_m, double cell_size_m);

// The inclusive box of cells of eq. 4.23.
struct NeighbourBounds {
  std::int32_t north = 0;  // Greatest i.
  std::int32_t east = 0;   // Greatest j.
  std::int32_t south = 0;  // Least i.
  std::int32_t west = 0;   // Least j.

  friend bool operator==(const NeighbourBounds&,
                         const NeighbourBounds&) = default;
};

// Eq. 4.23, kept inside a grid of cells_north x cells_east: the cells within
// `reach` of `cell` in both directions.
NeighbourBounds SmoothBounds(CellIndex cell, std::uint32_t reach,
                             std::uint32_t cells_north,
                             std::uint32_t cells_east);

// Eq. 4.24: s s1^2 / (s1^2 + s2^2 + n_ij), the gain with which a neighbour
// (1) takes from the cell that was just updated (2). `scale` in [0, 1).
double SmoothGain(double scale, double variance_1, double variance_2,
                  std::uint32_t cells_apart);

// Eq. 4.25: n_ij, the Chebyshev distance in cells.
std::uint32_t CellsApart(CellIndex a, CellIndex b);

}  // namespace fathom::map

#endif  // FATHOM_MAP_LOCAL_ESTIMATOR_H_
