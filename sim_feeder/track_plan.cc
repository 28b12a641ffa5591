#include "sim_feeder/track_plan.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "sim_feeder/water_grid.h"

namespace fathom::feeder {
namespace {

constexpr double kMaxLegs = 4'000.0;
constexpr int kMaxPasses = 1'000;

// A place on a leg: `along` it and `across` all legs.
PlanePoint OnLeg(bool legs_go_north, double along_m, double across_m) {
  return legs_go_north ? PlanePoint{.north_m = along_m, .east_m = across_m}
                       : PlanePoint{.north_m = across_m, .east_m = along_m};
}

struct Leg {
  PlanePoint start;
  PlanePoint end;
};

// The pieces of one line that lie in open water, at least two cells long.
void AppendOpenPieces(const WaterGrid& water, bool legs_go_north,
                      double across_m, double length_m, bool backwards,
                      std::vector<Leg>& legs) {
  const double step_m = 0.5 * water.cell_m();
  const std::size_t first = legs.size();
  bool inside = false;
  double begin_m = 0.0;
  double last_m = 0.0;
  const auto close = [&] {
    if (inside && last_m - begin_m >= 2.0 * water.cell_m()) {
      legs.push_back({OnLeg(legs_go_north, begin_m, across_m),
                      OnLeg(legs_go_north, last_m, across_m)});
    }
    inside = false;
  };
  const int steps = static_cast<int>(std::floor(length_m / step_m));
  for (int i = 1; i < steps; ++i) {
    const double along_m = i * step_m;
    if (!water.IsOpen(OnLeg(legs_go_north, along_m, across_m))) {
      close();
      continue;
    }
    if (!inside) begin_m = along_m;
    inside = true;
    last_m = along_m;
  }
  close();
  if (!backwards) return;
  std::reverse(legs.begin() + static_cast<std::ptrdiff_t>(first), legs.end());
  for (std::size_t i = first; i < legs.size(); ++i) {
    std::swap(legs[i].start, legs[i].end);
  }
}

std::vector<Leg> PlanLegs(const WaterGrid& water, const SurveyArea& area,
                          double spacing_m, bool legs_go_north) {
  const double length_m =
      legs_go_north ? area.north_extent_m : area.east_extent_m;
  const double width_m =
      legs_go_north ? area.east_extent_m : area.north_extent_m;
  const int count =
      std::max(1, static_cast<int>(std::ceil(width_m / spacing_m)));
  std::vector<Leg> legs;
  for (int i = 0; i < count; ++i) {
    const double across_m = (i + 0.5) * width_m / count;
    AppendOpenPieces(water, legs_go_north, across_m, length_m, i % 2 == 1,
                     legs);
  }
  return legs;
}

double Distance(const PlanePoint& a, const PlanePoint& b) {
  return std::hypot(a.north_m - b.north_m, a.east_m - b.east_m);
}

}  // namespace

absl::StatusOr<std::vector<PlanePoint>> PlanTrack(
    const LocalTerrain& terrain, const SurveyArea& area,
    const TrackPlanOptions& options) {
  FATHOM_RETURN_IF_ERROR(ValidateArea(area));
  const double width_m = std::max(area.north_extent_m, area.east_extent_m);
  if (!(options.spacing_m > 0.0) || width_m / options.spacing_m > kMaxLegs) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "track spacing_m=%g must be > 0 and at least a %g-th of the area",
        options.spacing_m, kMaxLegs));
  }
  if (options.passes < 1 || options.passes > kMaxPasses) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "passes=%d must be 1 to %d", options.passes, kMaxPasses));
  }
  const WaterGrid water(terrain, area, options.min_water_m);
  const bool longer_is_north = area.north_extent_m >= area.east_extent_m;
  std::vector<PlanePoint> track;
  const auto append = [&](const PlanePoint& point) {
    if (track.empty() || Distance(track.back(), point) > 1e-6) {
      track.push_back(point);
    }
  };
  for (int pass = 0; pass < options.passes; ++pass) {
    const bool legs_go_north = longer_is_north == (pass % 2 == 0);
    for (const Leg& leg :
         PlanLegs(water, area, options.spacing_m, legs_go_north)) {
      if (!track.empty()) {
        for (const PlanePoint& corner :
             water.FindWay(track.back(), leg.start)) {
          append(corner);
        }
      }
      append(leg.start);
      append(leg.end);
    }
  }
  if (track.size() < 2) {
    return absl::NotFoundError(absl::StrFormat(
        "the area has no leg over water of min_water_m=%g; take another area "
        "or a smaller depth",
        options.min_water_m));
  }
  return track;
}

}  // namespace fathom::feeder
