#include "client/cli/relief_shading.h"

#include <algorithm>
#include <cmath>

namespace fathom::client::cli {
namespace {

// Light from azimuth 315, 45 degrees high: equal parts of north, west, up.
constexpr double kLightNorth = 0.5;
constexpr double kLightEast = -0.5;
constexpr double kLightUp = 0.70710678;
// Exaggerated slope of the steepest tenth.
constexpr double kWantedSlope = 0.5;
constexpr double kMaxExaggeration = 40;
constexpr double kDarkest = 0.72;
constexpr double kBrightest = 1.14;

}  // namespace

std::vector<float> ShadeRelief(const std::vector<float>& depth_m,
                               const ShadingGrid& grid) {
  std::vector<float> shade(depth_m.size(), 1.0f);
  if (grid.rows < 3 || grid.columns < 3) return shade;
  struct Slope {
    float north = 0;
    float east = 0;
  };
  std::vector<Slope> slopes(depth_m.size());
  std::vector<float> steepness;
  const std::size_t columns = grid.columns;
  for (std::size_t row = 1; row + 1 < grid.rows; ++row) {
    for (std::size_t column = 1; column + 1 < columns; ++column) {
      const std::size_t at = row * columns + column;
      const float middle = depth_m[at];
      if (!std::isfinite(middle)) continue;
      const auto z = [&](int down, int right) {
        const float depth =
            depth_m[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(row) +
                                             down) *
                        columns +
                    static_cast<std::size_t>(
                        static_cast<std::ptrdiff_t>(column) + right)];
        return -static_cast<double>(std::isfinite(depth) ? depth : middle);
      };
      const double east = (z(-1, 1) + 2 * z(0, 1) + z(1, 1) - z(-1, -1) -
                           2 * z(0, -1) - z(1, -1)) /
                          (8 * grid.east_west_m);
      const double north = (z(-1, -1) + 2 * z(-1, 0) + z(-1, 1) - z(1, -1) -
                            2 * z(1, 0) - z(1, 1)) /
                           (8 * grid.north_south_m);
      slopes[at] = {static_cast<float>(north), static_cast<float>(east)};
      steepness.push_back(static_cast<float>(std::hypot(north, east)));
    }
  }
  if (steepness.empty()) return shade;
  const auto tenth =
      steepness.begin() + static_cast<std::ptrdiff_t>(
                              0.9 * static_cast<double>(steepness.size() - 1));
  std::nth_element(steepness.begin(), tenth, steepness.end());
  const double exaggeration =
      std::clamp(kWantedSlope / std::max(1e-9, static_cast<double>(*tenth)),
                 0.05, kMaxExaggeration);
  for (std::size_t i = 0; i < shade.size(); ++i) {
    const double north = slopes[i].north * exaggeration;
    const double east = slopes[i].east * exaggeration;
    // Normal of the surface: (-dz/dn, -dz/de, 1).
    const double light = (-north * kLightNorth - east * kLightEast + kLightUp) /
                         std::sqrt(1 + north * north + east * east);
    shade[i] = static_cast<float>(
        std::clamp(1 + 0.42 * (light - kLightUp), kDarkest, kBrightest));
  }
  return shade;
}

}  // namespace fathom::client::cli
