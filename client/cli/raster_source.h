// Where each place lies in an open raster: its grid on the ellipsoid and the
// way from longitude and latitude to pixel and line. GDAL side of raster.h.
//
// The grid of a raster that is not north-up on WGS 84. Its cells are as wide
// and high as the source's own at the middle, times the largest k <= 1 for
// which a cell of the grid, laid parallel to the meridian, fits inside every
// source cell, which is a parallelogram in longitude and latitude. Any such
// parallelogram then holds a middle of the grid: each source cell is taken at
// least once. For UTM k is 0.93 to 1, for any rotation of square cells at
// least 1 / sqrt(2).
// Thread safety: one thread at a time.

#ifndef FATHOM_CLIENT_CLI_RASTER_SOURCE_H_
#define FATHOM_CLIENT_CLI_RASTER_SOURCE_H_

#include <array>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cli/gdal_edge.h"
#include "client/cli/raster_grid.h"

namespace fathom::client::cli {

class RasterSource {
 public:
  // `crs`: instead of the file's, if not empty. Adds remarks on what had to be
  // assumed. Errors: INVALID_ARGUMENT.
  static absl::StatusOr<RasterSource> Create(GDALDataset& dataset,
                                             const std::string& crs,
                                             std::vector<std::string>& remarks);

  // The grid that the raster is read on, whole.
  const LonLatGrid& grid() const { return grid_; }
  const std::string& crs_name() const { return crs_name_; }

  // Turns places into pixel (x) and line (y), fractions kept, in place.
  // Places that the projection does not know become NaN.
  void ToPixels(std::vector<double>& x, std::vector<double>& y) const;

 private:
  RasterSource() = default;
  absl::Status ReadReference(GDALDataset& dataset, const std::string& crs,
                             std::vector<std::string>& remarks);
  // The raster's own cells, if it is north-up in degrees; false if it is not.
  absl::StatusOr<bool> KeepOwnGrid();
  absl::Status PlanGrid();
  // From pixel and line to unwrapped longitude and latitude, in place; NaN
  // where the projection does not know the place.
  void FromPixels(std::vector<double>& x, std::vector<double>& y) const;
  // Whether the pole (+1 north, -1 south) lies inside.
  bool HoldsPole(int sign) const;

  OGRSpatialReference reference_;
  std::string crs_name_;
  int columns_ = 0;
  int rows_ = 0;
  std::array<double, 6> to_map_{};    // GDAL geotransform.
  std::array<double, 6> to_pixel_{};  // Its inverse.
  bool geographic_ = false;
  // Null: the raster's coordinates are WGS 84 longitude and latitude.
  TransformationPtr from_wgs84_;
  TransformationPtr to_wgs84_;
  LonLatGrid grid_;
};

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_RASTER_SOURCE_H_
