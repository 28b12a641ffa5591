#include "sim_feeder/swath.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace fathom::feeder {
namespace {

constexpr double kLookupsPerCell = 4.0;

// The half line across the track on one side.
struct HalfLine {
  double north_m;
  double east_m;
  // Unit vector away from the vehicle.
  double toward_north;
  double toward_east;

  double NorthAt(double s_m) const { return north_m + s_m * toward_north; }
  double EastAt(double s_m) const { return east_m + s_m * toward_east; }
};

// Appends the hits of the beams 1..half on one side, inner ones first.
// `sign` is -1 for port and +1 for starboard.
void WalkSide(const LocalTerrain& terrain, const BeamFan& fan,
              const SonarPlace& sonar, double nadir_depth_m, int sign,
              std::vector<BeamHit>& hits) {
  const int half = fan.beam_count / 2;
  const double spacing_rad = fan.spacing_deg * std::numbers::pi / 180.0;
  const HalfLine line = {
      .north_m = sonar.north_m,
      .east_m = sonar.east_m,
      // Starboard is the course plus 90 degrees.
      .toward_north = -std::sin(sonar.course_rad) * sign,
      .toward_east = std::cos(sonar.course_rad) * sign,
  };
  const double step_m = terrain.cell_size_m() / kLookupsPerCell;
  double near_m = 0.0;
  double near_depth_m = nadir_depth_m;
  int beam = 1;
  double cotangent = 1.0 / std::tan(spacing_rad);
  while (beam <= half && near_m < fan.max_slant_range_m) {
    const double far_m = near_m + step_m;
    const std::optional<double> far_depth_m =
        terrain.DepthAt(line.NorthAt(far_m), line.EastAt(far_m));
    if (!far_depth_m.has_value()) return;
    while (beam <= half) {
      // The ray's depth less the seabed's: negative above the ground.
      const double near_gap_m =
          sonar.depth_m + near_m * cotangent - near_depth_m;
      const double far_gap_m = sonar.depth_m + far_m * cotangent - *far_depth_m;
      if (far_gap_m < 0.0) break;
      const double part =
          near_gap_m >= 0.0 ? 0.0 : near_gap_m / (near_gap_m - far_gap_m);
      const double s_m = near_m + part * step_m;
      const double drop_m = s_m * cotangent;
      // std::hypot's guard against overflow costs a tenth of the ping.
      if (std::sqrt(s_m * s_m + drop_m * drop_m) > fan.max_slant_range_m) {
        return;
      }
      const double north_m = line.NorthAt(s_m);
      const double east_m = line.EastAt(s_m);
      const std::optional<double> depth_m = terrain.DepthAt(north_m, east_m);
      if (depth_m.has_value()) {
        hits.push_back({.beam = half + sign * beam,
                        .north_m = north_m,
                        .east_m = east_m,
                        .depth_m = *depth_m});
      }
      ++beam;
      cotangent = 1.0 / std::tan(beam * spacing_rad);
    }
    near_m = far_m;
    near_depth_m = *far_depth_m;
  }
}

}  // namespace

std::vector<BeamHit> IntersectSwath(const LocalTerrain& terrain,
                                    const BeamFan& fan,
                                    const SonarPlace& sonar) {
  std::vector<BeamHit> hits;
  const std::optional<double> nadir_depth_m =
      terrain.DepthAt(sonar.north_m, sonar.east_m);
  if (!nadir_depth_m.has_value() || *nadir_depth_m <= sonar.depth_m) {
    return hits;
  }
  hits.reserve(static_cast<std::size_t>(fan.beam_count));
  WalkSide(terrain, fan, sonar, *nadir_depth_m, -1, hits);
  std::reverse(hits.begin(), hits.end());
  if (*nadir_depth_m - sonar.depth_m <= fan.max_slant_range_m) {
    hits.push_back({.beam = fan.beam_count / 2,
                    .north_m = sonar.north_m,
                    .east_m = sonar.east_m,
                    .depth_m = *nadir_depth_m});
  }
  WalkSide(terrain, fan, sonar, *nadir_depth_m, +1, hits);
  return hits;
}

}  // namespace fathom::feeder
