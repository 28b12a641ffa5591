#include "sim_feeder/survey_area.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "map/geodesy/ned_frame.h"

namespace fathom::feeder {
namespace {

constexpr int kLookupsPerSide = 16;
constexpr int kLookupsPerStep = 4;
constexpr double kMaxLookupsAcross = 4'000.0;
constexpr double kLeastUsableShare = 0.1;

// Half the raster's extent along north and east about `middle`, metres.
double HalfExtentM(const Terrain& terrain) {
  const double cells = static_cast<double>(
      std::max(terrain.grid().rows, terrain.grid().columns));
  return 0.5 * cells * terrain.grid().cell_size_m;
}

// Sums over rectangles of a 0/1 grid in constant time.
class SummedArea {
 public:
  SummedArea(std::size_t rows, std::size_t columns)
      : columns_(columns + 1), sums_((rows + 1) * (columns + 1)) {}

  // Rows and columns must come in order.
  void Set(std::size_t row, std::size_t column, bool value) {
    sums_[(row + 1) * columns_ + column + 1] =
        (value ? 1 : 0) + sums_[row * columns_ + column + 1] +
        sums_[(row + 1) * columns_ + column] - sums_[row * columns_ + column];
  }

  std::int64_t Count(std::size_t row, std::size_t column,
                     std::size_t size) const {
    const std::size_t row_end = row + size;
    const std::size_t column_end = column + size;
    return sums_[row_end * columns_ + column_end] -
           sums_[row * columns_ + column_end] -
           sums_[row_end * columns_ + column] + sums_[row * columns_ + column];
  }

 private:
  std::size_t columns_;
  std::vector<std::int64_t> sums_;
};

}  // namespace

absl::Status ValidateArea(const SurveyArea& area) {
  FATHOM_RETURN_IF_ERROR(map::ValidateGeodetic(area.south_west));
  if (!std::isfinite(area.cell_size_m) || area.cell_size_m <= 0.0) {
    return absl::InvalidArgumentError(
        absl::StrFormat("cell_size_m=%g must be > 0", area.cell_size_m));
  }
  for (const double extent_m : {area.north_extent_m, area.east_extent_m}) {
    if (!std::isfinite(extent_m) || extent_m < 2.0 * area.cell_size_m) {
      return absl::InvalidArgumentError(
          absl::StrFormat("extent_m=%g must be at least two cells of %g m",
                          extent_m, area.cell_size_m));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<PickedArea> PickArea(const Terrain& terrain,
                                    const AreaPickOptions& options) {
  if (!std::isfinite(options.side_m) ||
      options.side_m < 2.0 * options.cell_size_m) {
    return absl::InvalidArgumentError(
        absl::StrFormat("side_m=%g must be at least two cells of %g m",
                        options.side_m, options.cell_size_m));
  }
  map::GeodeticPoint middle = options.near;
  double half_extent_m = options.search_radius_m;
  if (half_extent_m <= 0.0) {
    FATHOM_ASSIGN_OR_RETURN(middle, terrain.Middle());
    half_extent_m = HalfExtentM(terrain);
  }
  const double step_m = options.side_m / kLookupsPerSide;
  const double across = std::max<double>(
      kLookupsPerSide, std::ceil(2.0 * half_extent_m / step_m));
  if (across > kMaxLookupsAcross) {
    return absl::ResourceExhaustedError(absl::StrFormat(
        "%s is too large to search for a square of side_m=%g; state a place "
        "to search about",
        terrain.grid().name, options.side_m));
  }
  const std::size_t count = static_cast<std::size_t>(across);
  const map::NedFrame frame(middle);
  const double origin_m = -0.5 * across * step_m;
  SummedArea usable(count, count);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < count; ++j) {
      const std::optional<double> depth_m = terrain.DepthAt(
          frame.ToGeodetic(origin_m + (static_cast<double>(i) + 0.5) * step_m,
                           origin_m + (static_cast<double>(j) + 0.5) * step_m));
      usable.Set(i, j,
                 depth_m.has_value() && *depth_m >= options.min_depth_m &&
                     *depth_m <= options.max_depth_m);
    }
  }
  const std::int64_t all = kLookupsPerSide * kLookupsPerSide;
  std::int64_t best_percent = -1;
  std::int64_t best_count = 0;
  double best_distance_m = 0.0;
  double best_north_m = 0.0;
  double best_east_m = 0.0;
  for (std::size_t i = 0; i + kLookupsPerSide <= count; i += kLookupsPerStep) {
    for (std::size_t j = 0; j + kLookupsPerSide <= count;
         j += kLookupsPerStep) {
      const std::int64_t wet = usable.Count(i, j, kLookupsPerSide);
      const std::int64_t percent = 100 * wet / all;
      const double north_m = origin_m + static_cast<double>(i) * step_m;
      const double east_m = origin_m + static_cast<double>(j) * step_m;
      const double distance_m = std::hypot(north_m + 0.5 * options.side_m,
                                           east_m + 0.5 * options.side_m);
      if (percent > best_percent ||
          (percent == best_percent && distance_m < best_distance_m)) {
        best_percent = percent;
        best_count = wet;
        best_distance_m = distance_m;
        best_north_m = north_m;
        best_east_m = east_m;
      }
    }
  }
  const double share =
      static_cast<double>(best_count) / static_cast<double>(all);
  if (share < kLeastUsableShare) {
    return absl::NotFoundError(absl::StrFormat(
        "no square of side_m=%g in %s has a tenth of its depths in "
        "[%g, %g] m",
        options.side_m, terrain.grid().name, options.min_depth_m,
        options.max_depth_m));
  }
  return PickedArea{
      .area = {.south_west = frame.ToGeodetic(best_north_m, best_east_m),
               .north_extent_m = options.side_m,
               .east_extent_m = options.side_m,
               .cell_size_m = options.cell_size_m},
      .usable_share = share};
}

}  // namespace fathom::feeder
