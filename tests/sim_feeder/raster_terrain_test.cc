// Rasters through GDAL: signs, holes, coordinate systems, real files.

#include "sim_feeder/raster_terrain.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>

#include "map/geodesy/points.h"
#include "sim_feeder/truth_source.h"
#include "tests/testing/status_matchers.h"

namespace fathom::feeder {
namespace {

using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

// An ESRI ASCII grid, 3 x 3 at 0.01 degree, south-west corner 41.50 N 70.70 W.
std::string WriteGrid(const std::string& name, const std::string& values) {
  const std::filesystem::path path =
      std::filesystem::path(::testing::TempDir()) / (name + ".asc");
  std::ofstream file(path);
  file << "ncols 3\nnrows 3\nxllcorner -70.70\nyllcorner 41.50\n"
          "cellsize 0.01\nNODATA_value -9999\n"
       << values;
  return path;
}

TEST(LoadRasterTerrain, TurnsElevationsIntoDepths) {
  const std::string path =
      WriteGrid("up", "-10 -20 -30\n-40 -50 -60\n-70 -80 5\n");
  FATHOM_ASSERT_OK_AND_ASSIGN(const Terrain terrain,
                              LoadRasterTerrain(path, Positive::kUp));
  // Row 0 is the north: centre of the first cell 41.525 N, 70.695 W.
  EXPECT_NEAR(*terrain.DepthAt({41.525, -70.695}), 10.0, 1e-9);
  EXPECT_NEAR(*terrain.DepthAt({41.515, -70.685}), 50.0, 1e-9);
  EXPECT_NEAR(*terrain.DepthAt({41.505, -70.675}), -5.0, 1e-9);
  // Half way between 10 and 20.
  EXPECT_NEAR(*terrain.DepthAt({41.525, -70.690}), 15.0, 1e-6);
  // A mean below zero tells elevations without a word.
  FATHOM_ASSERT_OK_AND_ASSIGN(const Terrain detected,
                              LoadRasterTerrain(path, Positive::kAuto));
  EXPECT_NEAR(*detected.DepthAt({41.525, -70.695}), 10.0, 1e-9);
}

TEST(LoadRasterTerrain, KeepsDepthsAndHoles) {
  const std::string path =
      WriteGrid("down", "10 20 30\n40 50 60\n-9999 80 90\n");
  FATHOM_ASSERT_OK_AND_ASSIGN(const Terrain terrain,
                              LoadRasterTerrain(path, Positive::kDown));
  EXPECT_NEAR(*terrain.DepthAt({41.515, -70.685}), 50.0, 1e-9);
  EXPECT_FALSE(terrain.DepthAt({41.505, -70.690}).has_value());
  EXPECT_THAT(LoadRasterTerrain(path, Positive::kAuto),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("--truth-positive")));
}

TEST(LoadRasterTerrain, SaysWhatIsWrongWithAFile) {
  EXPECT_THAT(LoadRasterTerrain("/nowhere/truth.tif", Positive::kAuto),
              StatusIs(absl::StatusCode::kNotFound));
  const std::string text =
      std::filesystem::path(::testing::TempDir()) / "text.txt";
  std::ofstream(text) << "no raster\n";
  EXPECT_THAT(LoadRasterTerrain(text, Positive::kAuto),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(text)));
}

TEST(DetectPositive, ReadsWhatTheFileSaysOfItself) {
  EXPECT_EQ(*DetectPositive({.description = "depth", .mean = -3}),
            Positive::kDown);
  EXPECT_EQ(*DetectPositive({.description = "Elevation", .mean = 3}),
            Positive::kUp);
  EXPECT_EQ(*DetectPositive({.positive = "down", .mean = -3}), Positive::kDown);
  EXPECT_EQ(*DetectPositive({.driver = "BAG", .mean = 3}), Positive::kUp);
  EXPECT_EQ(*DetectPositive({.description = "depth_m_positive_up", .mean = 3}),
            Positive::kUp);
  EXPECT_EQ(*DetectPositive({.mean = -3}), Positive::kUp);
  EXPECT_THAT(DetectPositive({.mean = 3}),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST(LoadRasterTerrain, ReadsAProjectedSurvey) {
  const std::string path = std::string(FATHOM_SHARED_DATA_DIR) +
                           "/bathymetry/woods_hole_buzzards_10m_utm19.tif";
  if (!std::filesystem::exists(path)) {
    GTEST_SKIP() << "no shared survey rasters: " << path;
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(const Terrain terrain,
                              LoadRasterTerrain(path, Positive::kAuto));
  EXPECT_EQ(terrain.grid().columns, 440u);
  EXPECT_DOUBLE_EQ(terrain.grid().cell_size_m, 10.0);
  // gdallocationinfo -wgs84 -70.68 41.53 says pixel (178, 343), 0.821 m up:
  // within a cell of it the land is no deeper than 5 m and no higher.
  EXPECT_NEAR(*terrain.DepthAt({41.53, -70.68}), -0.82, 5.0);
  // There and back: the pixel's own centre has its own value.
  const map::GeodeticPoint center =
      *terrain.georeference().to_geodetic({.column = 178.5, .row = 343.5});
  EXPECT_NEAR(*terrain.DepthAt(center), -0.821368873, 1e-4);
  EXPECT_LT(map::DistanceM(center, {41.53, -70.68}), 10.0);
}

TEST(TruthSource, Etopo5WithReliefIsOneSeabedWhereverItIsCut) {
  TruthOptions options;
  if (!std::filesystem::exists(options.etopo_path)) {
    GTEST_SKIP() << "ferret-datasets is not installed: " << options.etopo_path;
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(const TruthSource truth,
                              TruthSource::Load(options));
  FATHOM_ASSERT_OK_AND_ASSIGN(const PickedArea picked,
                              truth.Pick(500.0, 10.0, 4.0));
  EXPECT_GT(picked.usable_share, 0.9);
  EXPECT_LT(map::DistanceM(picked.area.south_west, options.center), 20'000.0);
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto whole,
                              truth.SeabedAbout(picked.area, 50.0));
  SurveyArea half = picked.area;
  half.north_extent_m = 250.0;
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto part, truth.SeabedAbout(half, 50.0));
  double lowest = 1e9;
  double highest = -1e9;
  for (double north_m = 5.0; north_m < 250.0; north_m += 20.0) {
    for (double east_m = 5.0; east_m < 500.0; east_m += 20.0) {
      const double depth_m = *whole->DepthAt(north_m, east_m);
      ASSERT_NEAR(depth_m, *part->DepthAt(north_m, east_m), 1e-4);
      lowest = std::min(lowest, depth_m);
      highest = std::max(highest, depth_m);
    }
  }
  // ETOPO5 alone is a plane here; the relief is not.
  EXPECT_GT(highest - lowest, 0.5);
}

TEST(LoadRasterTerrain, ReadsTheWholeEarth) {
  const std::string path(kEtopo5Path);
  if (!std::filesystem::exists(path)) {
    GTEST_SKIP() << "ferret-datasets is not installed: " << path;
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(const Terrain terrain,
                              LoadRasterTerrain(path, Positive::kAuto));
  EXPECT_TRUE(terrain.grid().wraps_east);
  // The middle of the Pacific is 4 to 6 km deep, Kansas is 300 to 900 m high,
  // the sea off Greenwich's meridian in the Gulf of Guinea is deep: no seam.
  EXPECT_NEAR(*terrain.DepthAt({0.0, -150.0}), 5000.0, 1000.0);
  EXPECT_NEAR(*terrain.DepthAt({38.5, -98.5}), -600.0, 300.0);
  EXPECT_GT(*terrain.DepthAt({0.0, 0.0}), 3000.0);
  EXPECT_GT(*terrain.DepthAt({0.0, -0.03}), 3000.0);
}

}  // namespace
}  // namespace fathom::feeder
