#include "map/local/local_map_options.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "map/local/evidence.h"

namespace fathom::map {
namespace {

absl::Status Bad(const char* field, double value, const char* rule) {
  return absl::InvalidArgumentError(
      absl::StrFormat("%s=%g %s", field, value, rule));
}

absl::Status ValidateSize(const LocalMapOptions& options) {
  if (!(options.cell_size_m >= 0.01 && options.cell_size_m <= 1e5)) {
    return Bad("cell_size_m", options.cell_size_m, "must be in [0.01, 1e5]");
  }
  const double sides_m[] = {options.north_extent_m, options.east_extent_m};
  const char* const names[] = {"north_extent_m", "east_extent_m"};
  double cells = 1.0;
  for (int side = 0; side < 2; ++side) {
    if (!(sides_m[side] > 0.0 && sides_m[side] <= 1e6)) {
      return Bad(names[side], sides_m[side], "must be in (0, 1e6]");
    }
    const double along =
        std::max(1.0, std::ceil(sides_m[side] / options.cell_size_m - 1e-9));
    if (along > kMaxLocalSideCells) {
      return Bad(names[side], sides_m[side],
                 "needs more than 65536 cells along one side; use larger "
                 "cells or a smaller area");
    }
    cells *= along;
  }
  if (cells > static_cast<double>(kMaxLocalCells)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "cells=%.0f of north_extent_m x east_extent_m must be at most %u; "
        "use larger cells or a smaller area",
        cells, kMaxLocalCells));
  }
  return absl::OkStatus();
}

absl::Status ValidateDefaults(const LocalMapOptions& options) {
  if (options.default_depth_m.has_value() !=
      options.default_std_m.has_value()) {
    return absl::InvalidArgumentError(
        "default_depth_m and default_std_m must be given both or neither");
  }
  if (!options.default_depth_m.has_value()) return absl::OkStatus();
  const float depth_m = *options.default_depth_m;
  const float std_m = *options.default_std_m;
  if (!(depth_m >= kMinDepthM && depth_m <= kMaxDepthM)) {
    return Bad("default_depth_m", depth_m, "must be in [-100, 12000]");
  }
  if (!(std_m >= kMinStdM && std_m <= 1e4f)) {
    return Bad("default_std_m", std_m, "must be in [0.001, 10000]");
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status ValidateLocalMapOptions(const LocalMapOptions& options) {
  FATHOM_RETURN_IF_ERROR(ValidateGeodetic(options.south_west));
  if (std::fabs(options.south_west.latitude_deg) > 89.0) {
    return Bad("south_west.latitude_deg", options.south_west.latitude_deg,
               "must be in [-89, 89]: nearer a pole north turns too quickly");
  }
  FATHOM_RETURN_IF_ERROR(ValidateSize(options));
  if (EstimatorName(options.estimator) == "?") {
    return Bad("estimator", static_cast<double>(options.estimator),
               "must be 1 (nervegna), 2 (kalman) or 3 (adaptive)");
  }
  if (!(options.min_range_m >= 0.0 && std::isfinite(options.min_range_m))) {
    return Bad("min_range_m", options.min_range_m, "must be finite and >= 0");
  }
  if (!(options.max_range_m > options.min_range_m &&
        options.max_range_m <= 1e5)) {
    return Bad("max_range_m", options.max_range_m,
               "must be above min_range_m and at most 1e5");
  }
  if (!(options.smoothing_scale >= 0.0 && options.smoothing_scale < 1.0)) {
    return Bad("smoothing_scale", options.smoothing_scale, "must be in [0, 1)");
  }
  if (!(options.smoothing_distance_m >= 0.0 &&
        options.smoothing_distance_m <=
            kMaxSmoothReach * options.cell_size_m)) {
    return Bad("smoothing_distance_m", options.smoothing_distance_m,
               "must be in [0, 16 * cell_size_m]");
  }
  return ValidateDefaults(options);
}

}  // namespace fathom::map
