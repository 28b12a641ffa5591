#include "sim_feeder/truth_source.h"

#include <algorithm>
#include <functional>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "sim_feeder/simulation.h"

namespace fathom::feeder {
namespace {

constexpr double kSearchRadiusM = 20'000.0;
// Deeper than this the 101 beams spread too far to map anything.
constexpr double kMaxSurveyDepthM = 500.0;

}  // namespace

TruthSource::TruthSource(const TruthOptions& options, Terrain terrain)
    : options_(options),
      terrain_(std::make_shared<const Terrain>(std::move(terrain))) {}

absl::StatusOr<TruthSource> TruthSource::Load(const TruthOptions& options) {
  if (options.flat_depth_m.has_value()) return TruthSource(options);
  if (options.path.empty()) {
    FATHOM_ASSIGN_OR_RETURN(
        Terrain etopo, LoadRasterTerrain(options.etopo_path, Positive::kUp));
    return TruthSource(options, std::move(etopo));
  }
  FATHOM_ASSIGN_OR_RETURN(Terrain terrain,
                          LoadRasterTerrain(options.path, options.positive));
  return TruthSource(options, std::move(terrain));
}

absl::StatusOr<PickedArea> TruthSource::Pick(double side_m, double cell_size_m,
                                             double min_depth_m) const {
  if (terrain_ == nullptr) {
    return absl::FailedPreconditionError(
        "a level seabed has no best place: state the area");
  }
  AreaPickOptions pick = {.side_m = side_m,
                          .cell_size_m = cell_size_m,
                          .min_depth_m = min_depth_m,
                          .max_depth_m = kMaxSurveyDepthM};
  if (options_.path.empty()) {
    pick.near = options_.center;
    pick.search_radius_m = std::max(kSearchRadiusM, 2.0 * side_m);
  }
  return PickArea(*terrain_, pick);
}

absl::StatusOr<std::shared_ptr<const LocalTerrain>> TruthSource::SeabedAbout(
    const SurveyArea& area, double max_slant_range_m) const {
  FATHOM_RETURN_IF_ERROR(ValidateArea(area));
  const PlaneBox box = BoxAround(area, max_slant_range_m);
  std::shared_ptr<const LocalTerrain> base;
  std::function<std::optional<double>(double, double)> depth_m =
      [flat_m = options_.flat_depth_m](double, double) { return flat_m; };
  if (terrain_ != nullptr) {
    FATHOM_ASSIGN_OR_RETURN(base, WithoutShapes(area, box));
    if (options_.shapes.empty()) return base;
    depth_m = [&base](double north_m, double east_m) {
      return base->DepthAt(north_m, east_m);
    };
  }
  FATHOM_ASSIGN_OR_RETURN(
      Terrain shaped, ShapedTerrain(depth_m, options_.shapes, area.south_west,
                                    box, options_.shape_cell_m));
  FATHOM_ASSIGN_OR_RETURN(
      LocalTerrain local,
      LocalTerrain::Create(std::make_shared<const Terrain>(std::move(shaped)),
                           area.south_west, box));
  return std::make_shared<const LocalTerrain>(std::move(local));
}

absl::StatusOr<std::shared_ptr<const LocalTerrain>> TruthSource::WithoutShapes(
    const SurveyArea& area, const PlaneBox& box) const {
  std::shared_ptr<const Terrain> terrain = terrain_;
  if (options_.path.empty()) {
    const map::GeodeticPoint middle =
        map::NedFrame(area.south_west)
            .ToGeodetic(0.5 * area.north_extent_m, 0.5 * area.east_extent_m);
    FATHOM_ASSIGN_OR_RETURN(
        Terrain fine,
        RefineTerrain(*terrain_,
                      {.center = options_.center,
                       .middle = middle,
                       .half_side_m = 0.5 * std::max(box.north_m - box.south_m,
                                                     box.east_m - box.west_m) +
                                      4.0 * options_.fine_cell_m,
                       .cell_size_m = options_.fine_cell_m,
                       .relief = options_.relief}));
    terrain = std::make_shared<const Terrain>(std::move(fine));
  }
  FATHOM_ASSIGN_OR_RETURN(
      LocalTerrain local,
      LocalTerrain::Create(std::move(terrain), area.south_west, box));
  return std::make_shared<const LocalTerrain>(std::move(local));
}

std::string TruthSource::Describe() const {
  const std::string shapes =
      options_.shapes.empty()
          ? ""
          : absl::StrFormat(" + %d shapes", options_.shapes.size());
  if (options_.flat_depth_m.has_value()) {
    return absl::StrFormat("level at %g m", *options_.flat_depth_m) + shapes;
  }
  if (!options_.path.empty()) return options_.path + shapes;
  return absl::StrFormat(
             "ETOPO5 + fractal relief (std %g m, correlation length %g m, seed "
             "%d)",
             options_.relief.std_m, options_.relief.correlation_length_m,
             options_.relief.seed) +
         shapes;
}

}  // namespace fathom::feeder
