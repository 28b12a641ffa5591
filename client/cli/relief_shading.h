// Hillshade: how bright each cell of a depth grid looks under a light from the
// north-west. Thread-safe.

#ifndef FATHOM_CLIENT_CLI_RELIEF_SHADING_H_
#define FATHOM_CLIENT_CLI_RELIEF_SHADING_H_

#include <cstdint>
#include <vector>

namespace fathom::client::cli {

struct ShadingGrid {
  std::uint32_t rows = 0;
  std::uint32_t columns = 0;
  // Size of a cell, metres.
  double north_south_m = 0;
  double east_west_m = 0;
};

// Factors for the lightness, 1 for flat cells and for cells without a depth,
// in [0.72, 1.14]. Row-major from the north-west, as `depth_m` (NaN: none).
// Slopes are exaggerated so that the steepest tenth of them spans the light's
// range, at most 40 times. Gradient by Horn's 3 x 3 kernel (Proc. IEEE 69,
// 1981); a neighbour without a depth counts as the cell itself.
std::vector<float> ShadeRelief(const std::vector<float>& depth_m,
                               const ShadingGrid& grid);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_RELIEF_SHADING_H_
