// The quadtree on real seabed: Woods Hole at 10 m (the shared test recordings;
// skipped where they are absent). The figures are printed, and bounded.

#include "tests/accuracy/terrain.h"

#include <gdal_priv.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "map/global/global_map.h"
#include "tests/accuracy/thesis_scene.h"
#include "tests/map/global/scene.h"

namespace fathom::map {
namespace {

constexpr double kCellM = 10;

// Depth on a grid of 10 m; NaN where there is none, negative on land.
struct Terrain {
  int rows = 0;
  int columns = 0;
  std::vector<float> depth_m;

  float At(int row, int col) const {
    return depth_m[static_cast<std::size_t>(row) *
                       static_cast<std::size_t>(columns) +
                   static_cast<std::size_t>(col)];
  }
};

class TerrainTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string& path = path_;
    if (!std::filesystem::exists(path)) {
      GTEST_SKIP() << "no " << path;
    }
    GDALAllRegister();
    GDALDataset* const set =
        GDALDataset::FromHandle(GDALOpen(path.c_str(), GA_ReadOnly));
    ASSERT_NE(set, nullptr);
    terrain_.columns = set->GetRasterXSize();
    terrain_.rows = set->GetRasterYSize();
    terrain_.depth_m.resize(static_cast<std::size_t>(terrain_.rows) *
                            static_cast<std::size_t>(terrain_.columns));
    GDALRasterBand* const band = set->GetRasterBand(1);
    const double nodata = band->GetNoDataValue();
    ASSERT_EQ(band->RasterIO(GF_Read, 0, 0, terrain_.columns, terrain_.rows,
                             terrain_.depth_m.data(), terrain_.columns,
                             terrain_.rows, GDT_Float32, 0, 0),
              CE_None);
    for (float& value : terrain_.depth_m) {
      value = static_cast<double>(value) == nodata
                  ? std::numeric_limits<float>::quiet_NaN()
                  : -value;
    }
    GDALClose(set);
  }

  // The window's grid, row 0 northernmost, laid on the frame's plane with its
  // south-west corner at the origin: the map's area is anywhere.
  GlobalMap::CellSource Window(const NedFrame& frame, int row, int col,
                               int rows, int columns) const {
    return [this, &frame, row, col, rows, columns](
               const GeodeticPoint& point) -> std::optional<DepthEstimate> {
      const NedPoint p = frame.ToNed(point);
      const int i = rows - 1 - static_cast<int>(std::floor(p.north_m / kCellM));
      const int j = static_cast<int>(std::floor(p.east_m / kCellM));
      if (i < 0 || i >= rows || j < 0 || j >= columns) return std::nullopt;
      const float depth_m = terrain_.At(row + i, col + j);
      if (std::isnan(depth_m)) return std::nullopt;
      // Surveyed in lines, a second a cell: no two times are alike.
      return Measured(depth_m, 0.3f,
                      static_cast<std::uint32_t>(1'000'000 + rows * j + i));
    };
  }

  const std::string path_ = std::string(FATHOM_SHARED_DATA_DIR) +
                            "/bathymetry/woods_hole_buzzards_10m_utm19.tif";
  Terrain terrain_;
};

// Section 6.1.2: root 1267 nmi, min cell 10 m, local 500 m x 500 m at 10 m,
// tolerance 0.5 m.
TEST_F(TerrainTest, ThesisScene) {
  const auto relief = accuracy::Terrain::FromRaster(path_, true);
  ASSERT_TRUE(relief.ok()) << relief.status();
  const accuracy::ThesisScene scene =
      accuracy::MeasureThesisScene(*relief, 200);
  const auto number = [](std::uint64_t value) {
    return static_cast<unsigned long long>(value);
  };
  std::printf(
      "thesis scene, %d wet windows of Woods Hole: fig. 4-18 %llu leaves, off "
      "by up to %.2f m; by range %llu leaves, %llu bytes (at most %llu), off "
      "by up to %.2f m; flat floor %llu leaves (thesis: 220 cells, 28200 "
      "bytes)\n",
      scene.windows, number(scene.pairwise_median_leaves),
      scene.pairwise_worst_m, number(scene.median_leaves),
      number(scene.median_bytes), number(scene.most_bytes), scene.worst_m,
      number(scene.flat_median_leaves));
  ASSERT_EQ(scene.windows, 200);
  EXPECT_LE(scene.median_leaves, 560u);
  EXPECT_LT(scene.median_leaves, scene.pairwise_median_leaves);
  EXPECT_LE(scene.worst_m, 0.5 + 1e-5);
  EXPECT_GT(scene.pairwise_worst_m, 0.5);  // Why it is not the default.
  EXPECT_LE(scene.median_bytes, 10'000u);
}

TEST_F(TerrainTest, ALeafCostsAtMostTwelveBytes) {
  GlobalMap map({.root = ThesisSquare()});
  const NedFrame frame(kNarragansett);
  const double north_m = terrain_.rows * kCellM;
  const double east_m = terrain_.columns * kCellM;
  map.MergeArea(Rectangle(frame, 0, north_m, 0, east_m), kCellM,
                Window(frame, 0, 0, terrain_.rows, terrain_.columns));
  const GlobalMapView fine = map.View();
  map.Conglomerate();
  const GlobalMapView joined = map.View();
  const auto per_leaf = [](const GlobalMapView& view) {
    return static_cast<double>(view.memory_bytes()) /
           static_cast<double>(view.leaf_count());
  };
  std::printf(
      "Woods Hole, %d x %d at 10 m: %llu leaves of %.2f bytes; conglomerated "
      "%llu leaves of %.2f bytes\n",
      terrain_.rows, terrain_.columns,
      static_cast<unsigned long long>(fine.leaf_count()), per_leaf(fine),
      static_cast<unsigned long long>(joined.leaf_count()), per_leaf(joined));
  EXPECT_GT(fine.leaf_count(), 300000u);
  EXPECT_LE(per_leaf(fine), 12.0);
  EXPECT_LE(per_leaf(joined), 12.0);
}

}  // namespace
}  // namespace fathom::map
