// Lines of equal value through a grid, as whole lines that can be labelled.
// Plain arithmetic. Thread-safe.

#ifndef FATHOM_CLIENT_CLI_CONTOUR_LINES_H_
#define FATHOM_CLIENT_CLI_CONTOUR_LINES_H_

#include <cstddef>
#include <cstdint>
#include <vector>

namespace fathom::client::cli {

// In cells: the middle of cell (row, column) is (column + 0.5, row + 0.5).
struct GridPoint {
  double x = 0;
  double y = 0;
};

struct ContourLine {
  double level = 0;
  std::vector<GridPoint> points;  // A closed line ends where it begins.
};

// The lines of `level` by marching squares between the cells' middles,
// linearly interpolated; none passes a square with a NaN corner. At a saddle
// the two lines keep to the corners below the level. Row-major `values`,
// rows x columns. Cost: O(cells).
std::vector<ContourLine> TraceContour(const std::vector<float>& values,
                                      std::uint32_t rows, std::uint32_t columns,
                                      double level);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_CONTOUR_LINES_H_
