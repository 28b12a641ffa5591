// Truth for the accuracy figures: the depth of the seabed as a function of
// place, from a survey raster or made up. It knows nothing of the map.
//
// Places are metres north and east of the terrain's south-west corner, on a
// plane: what the figures need is a surface with real roughness, not its
// position on the Earth.

#ifndef FATHOM_TESTS_ACCURACY_TERRAIN_H_
#define FATHOM_TESTS_ACCURACY_TERRAIN_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace fathom::accuracy {

class Terrain {
 public:
  // The first band of a GDAL raster with square pixels in metres; nodata and
  // what is not wet (depth <= 0) have no depth. `elevation_up`: the band holds
  // heights. `pixel_m` overrides the raster's own (0: its own).
  // Errors: NOT_FOUND, INVALID_ARGUMENT.
  static absl::StatusOr<Terrain> FromRaster(const std::string& path,
                                            bool elevation_up,
                                            double pixel_m = 0);

  // Seeded fractal relief: 256 x 256 nodes `pixel_m` apart about
  // `mean_depth_m`, octaves of value noise whose amplitude halves (Hurst
  // exponent 1) from `relief_m` at 64 nodes down to one node.
  static Terrain Fractal(std::uint64_t seed, double pixel_m,
                         double mean_depth_m, double relief_m);

  // The same depth everywhere.
  static Terrain Flat(double depth_m);

  // Bilinear between the nodes; nullopt outside and beside a node without a
  // depth.
  std::optional<double> DepthAt(double north_m, double east_m) const;

  double north_extent_m() const { return (rows_ - 1) * pixel_m_; }
  double east_extent_m() const { return (cols_ - 1) * pixel_m_; }
  double pixel_m() const { return pixel_m_; }

 private:
  Terrain(int rows, int cols, double pixel_m, std::vector<float> depths_m)
      : rows_(rows),
        cols_(cols),
        pixel_m_(pixel_m),
        depths_m_(std::move(depths_m)) {}

  float Node(int row, int col) const {
    return depths_m_[static_cast<std::size_t>(row) *
                         static_cast<std::size_t>(cols_) +
                     static_cast<std::size_t>(col)];
  }

  int rows_;  // From the south.
  int cols_;
  double pixel_m_;
  std::vector<float> depths_m_;  // NaN: none.
};

}  // namespace fathom::accuracy

#endif  // FATHOM_TESTS_ACCURACY_TERRAIN_H_
