#include "tests/accuracy/terrain.h"

#include <gdal_priv.h>

#include <cmath>
#include <limits>
#include <memory>
#include <random>

#include "absl/strings/str_format.h"

namespace fathom::accuracy {
namespace {

// Of a grid of `cols` columns, row by row.
std::size_t IndexOf(int row, int col, int cols) {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(cols) +
         static_cast<std::size_t>(col);
}

}  // namespace

absl::StatusOr<Terrain> Terrain::FromRaster(const std::string& path,
                                            bool elevation_up, double pixel_m) {
  GDALAllRegister();
  const std::unique_ptr<GDALDataset> dataset(
      GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY));
  if (dataset == nullptr) {
    return absl::NotFoundError(absl::StrFormat("%s: cannot be read", path));
  }
  double transform[6];
  dataset->GetGeoTransform(transform);
  const double own_m = std::abs(transform[1]);
  if (pixel_m <= 0) pixel_m = own_m;
  const int rows = dataset->GetRasterYSize();
  const int cols = dataset->GetRasterXSize();
  std::vector<float> raw(IndexOf(rows, 0, cols));
  GDALRasterBand* band = dataset->GetRasterBand(1);
  if (band->RasterIO(GF_Read, 0, 0, cols, rows, raw.data(), cols, rows,
                     GDT_Float32, 0, 0) != CE_None) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s: band 1 cannot be read", path));
  }
  int has_nodata = 0;
  const double nodata = band->GetNoDataValue(&has_nodata);
  std::vector<float> depths(raw.size());
  for (int row = 0; row < rows; ++row) {
    for (int col = 0; col < cols; ++col) {
      const float value = raw[IndexOf(row, col, cols)];
      float depth = elevation_up ? -value : value;
      if ((has_nodata != 0 && value == static_cast<float>(nodata)) ||
          !(depth > 0)) {
        depth = std::numeric_limits<float>::quiet_NaN();
      }
      depths[IndexOf(rows - 1 - row, col, cols)] = depth;
    }
  }
  return Terrain(rows, cols, pixel_m, std::move(depths));
}

Terrain Terrain::Fractal(std::uint64_t seed, double pixel_m,
                         double mean_depth_m, double relief_m) {
  constexpr int kNodes = 256;
  std::vector<float> depths(IndexOf(kNodes, 0, kNodes),
                            static_cast<float>(mean_depth_m));
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  double amplitude_m = relief_m;
  for (int spacing = 64; spacing >= 1; spacing /= 2, amplitude_m /= 2) {
    const int knots = kNodes / spacing + 2;
    std::vector<double> values(IndexOf(knots, 0, knots));
    for (double& value : values) value = amplitude_m * normal(random);
    const auto knot = [&](int row, int col) {
      return values[IndexOf(row, col, knots)];
    };
    for (int row = 0; row < kNodes; ++row) {
      for (int col = 0; col < kNodes; ++col) {
        const int i = row / spacing;
        const int j = col / spacing;
        const double a = static_cast<double>(row % spacing) / spacing;
        const double b = static_cast<double>(col % spacing) / spacing;
        depths[IndexOf(row, col, kNodes)] += static_cast<float>(
            (1 - a) * ((1 - b) * knot(i, j) + b * knot(i, j + 1)) +
            a * ((1 - b) * knot(i + 1, j) + b * knot(i + 1, j + 1)));
      }
    }
  }
  return Terrain(kNodes, kNodes, pixel_m, std::move(depths));
}

Terrain Terrain::Flat(double depth_m) {
  return Terrain(2, 2, 1e5, std::vector<float>(4, static_cast<float>(depth_m)));
}

std::optional<double> Terrain::DepthAt(double north_m, double east_m) const {
  const double y = north_m / pixel_m_;
  const double x = east_m / pixel_m_;
  if (!(y >= 0 && x >= 0 && y < rows_ - 1 && x < cols_ - 1)) {
    return std::nullopt;
  }
  const int row = static_cast<int>(y);
  const int col = static_cast<int>(x);
  const double a = y - row;
  const double b = x - col;
  const double depth_m =
      (1 - a) * ((1 - b) * Node(row, col) + b * Node(row, col + 1)) +
      a * ((1 - b) * Node(row + 1, col) + b * Node(row + 1, col + 1));
  if (std::isnan(depth_m)) return std::nullopt;
  return depth_m;
}

}  // namespace fathom::accuracy
