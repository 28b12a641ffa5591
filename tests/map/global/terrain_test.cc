// The quadtree on real seabed: Woods Hole at 10 m (the shared test recordings;
// skipped where they are absent). The figures are printed, and bounded.

#include <gdal_priv.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "map/global/global_map.h"
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
    const std::string path = std::string(FATHOM_SHARED_DATA_DIR) +
                             "/bathymetry/woods_hole_buzzards_10m_utm19.tif";
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

  Terrain terrain_;
};

std::uint64_t Median(std::vector<std::uint64_t> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// Section 6.1.2: root 1267 nmi, min cell 10 m, local 500 m x 500 m at 10 m,
// tolerance 0.5 m.
TEST_F(TerrainTest, ThesisScene) {
  const RootSquare root = ThesisSquare();
  const NedFrame frame(Direct(kNarragansett, 30, 40000));
  const auto area = Rectangle(frame, 0, 500, 0, 500);
  std::vector<std::uint64_t> pairwise_leaves;
  std::vector<std::uint64_t> range_leaves;
  std::vector<std::uint64_t> range_bytes;
  double range_worst_m = 0;
  double pairwise_worst_m = 0;
  for (int row = 0; row + 50 <= terrain_.rows; row += 37) {
    for (int col = 0; col + 50 <= terrain_.columns; col += 33) {
      const auto source = Window(frame, row, col, 50, 50);
      bool wet = true;
      for (int i = 0; i < 50 && wet; ++i) {
        for (int j = 0; j < 50; ++j) {
          wet = wet && terrain_.At(row + i, col + j) > 0;
        }
      }
      if (!wet) continue;
      for (const MergeRule rule : {MergeRule::kPairwise, MergeRule::kRange}) {
        GlobalMap map({.root = root, .tolerance_m = 0.5});
        map.MergeArea(area, kCellM, source);
        const GlobalMapView fine = map.View();
        map.Conglomerate(rule);
        const GlobalMapView view = map.View();
        double worst_m = 0;
        fine.ForEachLeaf([&](const CellKey& cell, const Leaf& leaf) {
          if (!leaf.known()) return;
          worst_m = std::max(
              worst_m,
              std::abs(static_cast<double>(view.At(root.Center(cell))->depth_m -
                                           leaf.depth_m)));
        });
        if (rule == MergeRule::kPairwise) {
          pairwise_leaves.push_back(view.leaf_count());
          pairwise_worst_m = std::max(pairwise_worst_m, worst_m);
        } else {
          range_leaves.push_back(view.leaf_count());
          range_bytes.push_back(view.memory_bytes());
          range_worst_m = std::max(range_worst_m, worst_m);
        }
      }
    }
  }
  GlobalMap flat({.root = root});
  flat.MergeArea(
      area, kCellM,
      [&frame](const GeodeticPoint& point) -> std::optional<DepthEstimate> {
        const NedPoint p = frame.ToNed(point);
        if (p.north_m < 0 || p.north_m >= 500 || p.east_m < 0 ||
            p.east_m >= 500) {
          return std::nullopt;
        }
        return Measured(10, 0.3f);
      });
  flat.Conglomerate();
  std::printf(
      "thesis scene, %zu wet windows of Woods Hole: fig. 4-18 %llu leaves, off "
      "by up to %.2f m; by range %llu leaves, %llu bytes, off by up to %.2f m; "
      "flat floor %llu leaves (thesis: 220 cells, 28200 bytes)\n",
      range_leaves.size(),
      static_cast<unsigned long long>(Median(pairwise_leaves)),
      pairwise_worst_m, static_cast<unsigned long long>(Median(range_leaves)),
      static_cast<unsigned long long>(Median(range_bytes)), range_worst_m,
      static_cast<unsigned long long>(flat.leaf_count()));
  ASSERT_GT(range_leaves.size(), 30u);
  EXPECT_LT(Median(range_leaves), Median(pairwise_leaves));
  EXPECT_LE(range_worst_m, 0.5 + 1e-5);
  EXPECT_GT(pairwise_worst_m, 0.5);  // Why it is not the default.
  EXPECT_LT(Median(range_bytes), 28200u);
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
