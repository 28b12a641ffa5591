// The axes of the feeder's pictures.

#ifndef FATHOM_SIM_FEEDER_AXES_H_
#define FATHOM_SIM_FEEDER_AXES_H_

#include <string>

#include "client/cli/canvas.h"
#include "client/cli/value_scale.h"

namespace fathom::feeder {

inline constexpr client::cli::Color kInk = {0.13, 0.16, 0.2};
inline constexpr client::cli::Color kGrid = {0.85, 0.87, 0.89};

struct AxisWords {
  // Above the frame; may be empty.
  std::string title;
  // Below it, in the middle and at the left of the next line.
  std::string across;
  std::string up;
};

// A frame with a grid, the values at its lines, and words. `x` grows to the
// right, `y` upwards.
void DrawAxes(client::cli::Canvas& canvas, const client::cli::Rectangle& frame,
              const AxisWords& words, const client::cli::ValueScale& x,
              const client::cli::ValueScale& y);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_AXES_H_
