#include "sim_feeder/forward_sonar.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_format.h"
#include "sim_feeder/angles.h"

namespace fathom::feeder {

absl::Status ValidateForwardSonar(const ForwardSonarOptions& options) {
  const BeamFan& fan = options.fan;
  if (fan.beam_count < 1 || fan.beam_count % 2 == 0 || fan.beam_count > 4095) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "beam_count=%d must be odd, 1 to 4095", fan.beam_count));
  }
  const int outermost = fan.beam_count / 2;
  if (!(fan.spacing_deg > 0.0) || !(outermost * fan.spacing_deg < 90.0)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "beam_count=%d beams spacing_deg=%g apart reach past the horizontal",
        fan.beam_count, fan.spacing_deg));
  }
  if (!(fan.max_slant_range_m > 0.0) || !(fan.max_slant_range_m <= 20'000.0)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "max_slant_range_m=%g must be in (0, 20000]", fan.max_slant_range_m));
  }
  if (!(options.beam_std_m >= 0.0) || !(options.beam_std_m <= 100.0)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "beam_std_m=%g must be in [0, 100]", options.beam_std_m));
  }
  if (!(options.sonar_cell_m > 0.0) || !std::isfinite(options.sonar_cell_m)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("sonar_cell_m=%g must be > 0", options.sonar_cell_m));
  }
  if (!(options.least_std_m > 0.0) || !std::isfinite(options.least_std_m)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("least_std_m=%g must be > 0", options.least_std_m));
  }
  return absl::OkStatus();
}

CellNoise DrawCellNoise(Random& random, double beam_std_m, int beam_count) {
  CellNoise noise;
  noise.mean_m = random.Normal(
      0.0, beam_std_m / std::sqrt(static_cast<double>(beam_count)));
  noise.beam_std_m = beam_std_m;
  if (beam_count > 1) {
    const int freedom = beam_count - 1;
    noise.beam_std_m *= std::sqrt(random.ChiSquare(freedom) / freedom);
  }
  return noise;
}

std::vector<SonarMeasurement> MeasureForward(const LocalTerrain& terrain,
                                             const ForwardSonarOptions& options,
                                             const SonarPlace& sonar,
                                             Random& random) {
  struct Group {
    double row;
    double column;
    double depth_sum_m;
    int beam_count;
  };
  std::vector<Group> groups;
  for (const BeamHit& hit : IntersectSwath(terrain, options.fan, sonar)) {
    const double row = std::floor(hit.north_m / options.sonar_cell_m);
    const double column = std::floor(hit.east_m / options.sonar_cell_m);
    // The hits lie in order on a line and cells are convex: the beams of one
    // cell follow each other, fig. 3-3's search of the list looks at its end.
    if (!groups.empty() && groups.back().row == row &&
        groups.back().column == column) {
      groups.back().depth_sum_m += hit.depth_m;
      ++groups.back().beam_count;
    } else {
      groups.push_back({row, column, hit.depth_m, 1});
    }
  }
  std::vector<SonarMeasurement> measurements;
  measurements.reserve(groups.size());
  for (const Group& group : groups) {
    const CellNoise noise =
        DrawCellNoise(random, options.beam_std_m, group.beam_count);
    const double dx_m =
        (group.row + 0.5) * options.sonar_cell_m - sonar.north_m;
    const double dy_m =
        (group.column + 0.5) * options.sonar_cell_m - sonar.east_m;
    measurements.push_back(
        {.range_m = std::sqrt(dx_m * dx_m + dy_m * dy_m),
         .bearing_rad = WrapToPi(std::atan2(dy_m, dx_m) - sonar.course_rad),
         .depth_m = group.depth_sum_m / group.beam_count + noise.mean_m,
         .std_m = std::max(options.least_std_m,
                           noise.beam_std_m / std::sqrt(static_cast<double>(
                                                  group.beam_count))),
         .beam_count = group.beam_count});
  }
  return measurements;
}

}  // namespace fathom::feeder
