// DepthRaster on small rasters made here with GDAL, and on real surveys.

#include "client/cli/raster.h"

#include <gdal_priv.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ogr_spatialref.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "client/cli/exit_code.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client::cli {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::FloatEq;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::NanSensitiveFloatEq;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// A temporary folder that goes with the test.
class RasterTest : public ::testing::Test {
 protected:
  RasterTest() {
    GDALAllRegister();
    std::string name =
        std::filesystem::temp_directory_path() / "fathom_raster_test.XXXXXX";
    folder_ = mkdtemp(name.data());
  }
  ~RasterTest() override { std::filesystem::remove_all(folder_); }

  struct Made {
    int columns = 3;
    int rows = 2;
    // Top-left corner and size of a cell.
    double west = -71.5, north = 41.5, step = 0.1;
    bool south_up = false;
    std::string crs = "EPSG:4326";
    std::vector<std::vector<float>> bands = {};
    std::vector<std::string> descriptions = {"", "", ""};
    std::optional<double> nodata = std::nullopt;
    std::string unit = "";
    std::vector<std::pair<std::string, std::string>> metadata = {};
  };

  std::string Make(const Made& made, const std::string& name = "made.tif") {
    std::string path = folder_ / name;
    GDALDataset* dataset =
        GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
            path.c_str(), made.columns, made.rows,
            static_cast<int>(made.bands.size()), GDT_Float32, nullptr);
    double geotransform[6] = {
        made.west,
        made.step,
        0,
        made.south_up ? made.north - made.step * made.rows : made.north,
        0,
        made.south_up ? made.step : -made.step};
    dataset->SetGeoTransform(geotransform);
    if (!made.crs.empty()) {
      OGRSpatialReference reference;
      reference.SetFromUserInput(made.crs.c_str());
      dataset->SetSpatialRef(&reference);
    }
    for (std::size_t i = 0; i < made.bands.size(); ++i) {
      GDALRasterBand* band = dataset->GetRasterBand(static_cast<int>(i) + 1);
      std::vector<float> values = made.bands[i];
      band->SetDescription(made.descriptions[i].c_str());
      band->SetUnitType(made.unit.c_str());
      if (made.nodata) band->SetNoDataValue(*made.nodata);
      for (const auto& [key, value] : made.metadata) {
        band->SetMetadataItem(key.c_str(), value.c_str());
      }
      EXPECT_EQ(
          band->RasterIO(GF_Write, 0, 0, made.columns, made.rows, values.data(),
                         made.columns, made.rows, GDT_Float32, 0, 0, nullptr),
          CE_None);
    }
    GDALClose(dataset);
    return path;
  }

  // The whole raster as one tile.
  static absl::StatusOr<v1::DepthTile> ReadAll(DepthRaster& raster) {
    return raster.Read({0, 0, raster.grid().rows, raster.grid().columns});
  }

  static std::vector<float> Depths(const v1::DepthTile& tile) {
    return {tile.depth_m().begin(), tile.depth_m().end()};
  }

  std::filesystem::path folder_;
};

TEST_F(RasterTest, ElevationsBecomeDepthsAndTheGridIsTheFilesOwn) {
  const std::string path = Make(
      {.bands = {{-1, -2, -3, -4, -5, -6}}, .descriptions = {"elevation"}});
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path, .std_m = 0.5}));
  EXPECT_EQ(raster->summary().positive, Positive::kUp);
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile, ReadAll(*raster));
  EXPECT_THAT(Depths(tile), ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_THAT(tile.std_m(), ElementsAre(0.5f));
  EXPECT_THAT(tile.land(), IsEmpty());
  EXPECT_DOUBLE_EQ(tile.north_west().latitude_deg(), 41.5);
  EXPECT_DOUBLE_EQ(tile.north_west().longitude_deg(), -71.5);
  EXPECT_DOUBLE_EQ(tile.latitude_step_deg(), 0.1);
  EXPECT_DOUBLE_EQ(tile.longitude_step_deg(), 0.1);
  EXPECT_EQ(tile.rows(), 2u);
  EXPECT_EQ(tile.columns(), 3u);
}

TEST_F(RasterTest, DepthsStayDepths) {
  const std::string path =
      Make({.bands = {{1, 2, 3, 4, 5, 6}}, .descriptions = {"depth"}});
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path, .std_m = 1}));
  EXPECT_EQ(raster->summary().positive, Positive::kDown);
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile, ReadAll(*raster));
  EXPECT_THAT(Depths(tile), ElementsAre(1, 2, 3, 4, 5, 6));
}

TEST_F(RasterTest, SignIsReadFromThePositiveAttributeFirst) {
  const std::string path = Make({.bands = {{1, 2, 3, 4, 5, 6}},
                                 .descriptions = {"elevation"},
                                 .metadata = {{"positive", "down"}}});
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path, .std_m = 1}));
  EXPECT_EQ(raster->summary().positive, Positive::kDown);
  EXPECT_THAT(raster->summary().positive_reason, HasSubstr("attribute"));
}

TEST_F(RasterTest, MostlyNegativeValuesAreElevations) {
  const std::string path = Make({.bands = {{-1, -2, -3, 4, 5, 6}}});
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path, .std_m = 1}));
  EXPECT_EQ(raster->summary().positive, Positive::kUp);
  EXPECT_THAT(raster->summary().positive_reason, HasSubstr("50 %"));
}

TEST_F(RasterTest, SignThatNothingTellsIsRefusedNotGuessed) {
  const std::string path = Make({.bands = {{-1, -2, 3, 4, 5, 6}}});
  const absl::Status status =
      DepthRaster::Open({.path = path, .std_m = 1}).status();
  EXPECT_THAT(status,
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("2 of 6"), HasSubstr("--positive up"))));
  EXPECT_EQ(ExitCodeOf(status), ExitCode::kBadFile);
  EXPECT_THAT(DepthRaster::Open(
                  {.path = path, .positive = Positive::kDown, .std_m = 1}),
              IsOk());
}

TEST_F(RasterTest, NodataAndNanAreUnknownNeverZero) {
  const std::string path = Make({.bands = {{-1, 1e6f, -3, kNan, -5, 0}},
                                 .descriptions = {"elevation"},
                                 .nodata = 1e6});
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path, .std_m = 1}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile, ReadAll(*raster));
  EXPECT_THAT(Depths(tile),
              ElementsAre(FloatEq(1), NanSensitiveFloatEq(kNan), FloatEq(3),
                          NanSensitiveFloatEq(kNan), FloatEq(5), FloatEq(0)));
  EXPECT_FALSE(std::signbit(tile.depth_m(5)));
  EXPECT_EQ(raster->counts().with_depth, 4u);
  EXPECT_EQ(raster->counts().unknown, 2u);
}

TEST_F(RasterTest, SentinelsThatTheFileForgotToDeclareAreUnknownAndCounted) {
  const std::string path = Make({.bands = {{-1, -9999, -3, 9999, -3.4e38f, -6}},
                                 .descriptions = {"elevation"}});
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path, .std_m = 1}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile, ReadAll(*raster));
  EXPECT_TRUE(std::isnan(tile.depth_m(1)));
  EXPECT_TRUE(std::isnan(tile.depth_m(3)));
  EXPECT_TRUE(std::isnan(tile.depth_m(4)));
  EXPECT_EQ(raster->counts().implausible, 3u);
  EXPECT_EQ(raster->counts().land, 0u);
}

TEST_F(RasterTest, LandStaysLandAboveTheLimit) {
  const std::string path = Make(
      {.bands = {{-1, 0, 0.5f, 3, -2, kNan}}, .descriptions = {"elevation"}});
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path, .std_m = 1}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile, ReadAll(*raster));
  EXPECT_EQ(tile.land(), std::string({0, 0, 1, 1, 0, 0}));
  EXPECT_TRUE(std::isnan(tile.depth_m(3)));
  // With the limit at 1 m the flat that dries 0.5 m is water.
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto drying,
      DepthRaster::Open({.path = path, .std_m = 1, .land_above_m = 1}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile flat, ReadAll(*drying));
  EXPECT_EQ(flat.land(), std::string({0, 0, 0, 1, 0, 0}));
  EXPECT_FLOAT_EQ(flat.depth_m(2), -0.5f);
}

TEST_F(RasterTest, NinetyFivePercentIsDividedBy196) {
  const std::string path =
      Make({.bands = {{-1, -2, -3, -4, -5, -6}, {1.96f, 0.98f, 1, 1, 0, kNan}},
            .descriptions = {"elevation", "uncertainty"}});
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto raster,
      DepthRaster::Open(
          {.path = path, .std_band = 2, .std_is_95_percent = true}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile, ReadAll(*raster));
  ASSERT_EQ(tile.std_m_size(), 6);
  // 1.96 / 1.959964 and 0.98 / 1.959964.
  EXPECT_NEAR(tile.std_m(0), 1.0, 1e-4);
  EXPECT_NEAR(tile.std_m(1), 0.5, 1e-4);
  // A depth whose std is zero or missing is not known.
  EXPECT_TRUE(std::isnan(tile.depth_m(4)));
  EXPECT_TRUE(std::isnan(tile.depth_m(5)));
  EXPECT_EQ(raster->counts().without_std, 2u);
}

TEST_F(RasterTest, UncertaintyBandIsFoundAndTakenAsOneSigma) {
  const std::string path =
      Make({.bands = {{-1, -2, -3, -4, -5, -6}, {1, 2, 3, 4, 5, 6}},
            .descriptions = {"elevation", "uncertainty"}});
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path}));
  EXPECT_THAT(raster->summary().std_source, HasSubstr("one sigma"));
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile, ReadAll(*raster));
  EXPECT_THAT(tile.std_m(), ElementsAre(1, 2, 3, 4, 5, 6));
}

TEST_F(RasterTest, RasterWithoutAnyStdIsRefused) {
  const std::string path = Make(
      {.bands = {{-1, -2, -3, -4, -5, -6}}, .descriptions = {"elevation"}});
  EXPECT_THAT(
      DepthRaster::Open({.path = path}),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--std-m")));
}

TEST_F(RasterTest, RasterWithoutReferenceSystemIsRefusedUnlessStated) {
  const std::string path = Make({.crs = "",
                                 .bands = {{-1, -2, -3, -4, -5, -6}},
                                 .descriptions = {"elevation"}});
  EXPECT_THAT(DepthRaster::Open({.path = path, .std_m = 1}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--crs")));
  EXPECT_THAT(DepthRaster::Open({.path = path, .std_m = 1, .crs = "EPSG:4326"}),
              IsOk());
  EXPECT_THAT(DepthRaster::Open({.path = path, .std_m = 1, .crs = "nonsense"}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("crs=\"nonsense\"")));
}

TEST_F(RasterTest, RasterOfNothingIsRefused) {
  const std::string path = Make({.bands = {{9, 9, 9, 9, 9, 9}},
                                 .descriptions = {"elevation"},
                                 .nodata = 9});
  EXPECT_THAT(DepthRaster::Open({.path = path, .std_m = 1}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("every cell is nodata")));
}

TEST_F(RasterTest, FileThatIsCutOffIsDataLoss) {
  Made made{.columns = 400, .rows = 400, .step = 0.001};
  made.bands = {std::vector<float>(160'000, -5)};
  made.descriptions = {"elevation"};
  const std::string path = Make(made);
  std::filesystem::resize_file(path, 300'000);  // Of 640 kB.
  const absl::Status status =
      DepthRaster::Open({.path = path, .std_m = 1}).status();
  EXPECT_EQ(ExitCodeOf(status), ExitCode::kBadFile);
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kDataLoss,
                               HasSubstr("damaged or cut off")));
}

TEST_F(RasterTest, WhatIsNoRasterIsNotFound) {
  const std::string path = folder_ / "text.tif";
  std::ofstream(path) << "no raster";
  EXPECT_THAT(DepthRaster::Open({.path = path, .std_m = 1}),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("text.tif")));
  EXPECT_THAT(DepthRaster::Open({.path = folder_ / "absent.tif", .std_m = 1}),
              StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(RasterTest, SouthUpRasterIsTurned) {
  // The file's first row is the southern one.
  const std::string path = Make({.south_up = true,
                                 .bands = {{-4, -5, -6, -1, -2, -3}},
                                 .descriptions = {"elevation"}});
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path, .std_m = 1}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile, ReadAll(*raster));
  EXPECT_THAT(Depths(tile), ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_NEAR(tile.north_west().latitude_deg(), 41.5, 1e-9);
}

TEST_F(RasterTest, FeetBecomeMetres) {
  const std::string path = Make({.bands = {{-10, -2, -3, -4, -5, -6}},
                                 .descriptions = {"elevation"},
                                 .unit = "ft"});
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path, .std_m = 1}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile, ReadAll(*raster));
  EXPECT_NEAR(tile.depth_m(0), 3.048, 1e-5);
}

TEST_F(RasterTest, ClipKeepsTheCellsThatTouchTheBox) {
  const std::string path = Make(
      {.bands = {{-1, -2, -3, -4, -5, -6}}, .descriptions = {"elevation"}});
  // Cells are 0.1 degrees from (41.5, -71.5): the box touches row 0 and
  // columns 1 and 2.
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto raster,
      DepthRaster::Open({.path = path,
                         .std_m = 1,
                         .clip = GeoBox{41.45, -71.35, 42, -71.25}}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile, ReadAll(*raster));
  EXPECT_THAT(Depths(tile), ElementsAre(2, 3));
  EXPECT_NEAR(tile.north_west().longitude_deg(), -71.4, 1e-9);
  EXPECT_THAT(DepthRaster::Open(
                  {.path = path, .std_m = 1, .clip = GeoBox{10, 10, 11, 11}}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("inside the mission's area")));
}

TEST_F(RasterTest, LongitudesFrom0To360WrapAroundTheBox) {
  // 36 columns of 10 degrees from 0: column k holds depth k + 1.
  Made made{.columns = 36, .rows = 1, .west = 0, .north = 5, .step = 10};
  made.bands.emplace_back();
  for (int k = 0; k < 36; ++k) {
    made.bands[0].push_back(-static_cast<float>(k + 1));
  }
  made.descriptions = {"elevation"};
  const std::string path = Make(made);
  // -75..-55: columns 28 (280..290 = -80..-70) to 30.
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto west,
      DepthRaster::Open(
          {.path = path, .std_m = 1, .clip = GeoBox{-4, -75, 4, -55}}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile, ReadAll(*west));
  EXPECT_THAT(Depths(tile), ElementsAre(29, 30, 31));
  EXPECT_NEAR(tile.north_west().longitude_deg(), -80, 1e-9);
  // Across Greenwich, where the file ends and begins: -15..15.
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto greenwich,
      DepthRaster::Open(
          {.path = path, .std_m = 1, .clip = GeoBox{-4, -15, 4, 15}}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile seam, ReadAll(*greenwich));
  EXPECT_THAT(Depths(seam), ElementsAre(35, 36, 1, 2));
  EXPECT_NEAR(seam.north_west().longitude_deg(), -20, 1e-9);
}

TEST_F(RasterTest, ProjectedRasterAcrossTheAntimeridianStaysTogether) {
  // UTM zone 60 reaches 180 E at easting 721 km at 40 N; four cells of 1 km
  // around it.
  Made made{.columns = 4, .rows = 1, .step = 1000, .crs = "EPSG:32660"};
  made.west = 754'000;
  made.north = 4'430'000;
  made.bands = {{-1, -2, -3, -4}};
  made.descriptions = {"elevation"};
  const std::string path = Make(made);
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path, .std_m = 1}));
  // 4 km at 40 N are 0.047 degrees, not 360.
  const LonLatGrid& grid = raster->grid();
  EXPECT_LT(static_cast<double>(grid.columns) * grid.longitude_step_deg, 0.1);
  EXPECT_GE(grid.west_deg, 179.9);
  double deepest = 0;
  for (const GridBlock& block : CutIntoBlocks(grid, 1000)) {
    FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile, raster->Read(block));
    for (const float depth : tile.depth_m()) {
      if (depth > deepest) deepest = depth;
    }
    EXPECT_GE(tile.north_west().longitude_deg(), -180.1);
    EXPECT_LT(tile.north_west().longitude_deg(), 180);
  }
  EXPECT_EQ(deepest, 4);
}

TEST(LonLatGrid, BlocksDoNotCrossTheAntimeridian) {
  // Ten cells of 1 degree from 175.5: middles 176..185; 180 is the fifth.
  const LonLatGrid grid{.north_deg = 1,
                        .west_deg = 175.5,
                        .latitude_step_deg = 1,
                        .longitude_step_deg = 1,
                        .rows = 2,
                        .columns = 10};
  const std::vector<GridBlock> blocks = CutIntoBlocks(grid, 1'000);
  ASSERT_EQ(blocks.size(), 2u);
  EXPECT_EQ(blocks[0].columns + blocks[1].columns, 10);
  EXPECT_EQ(blocks[1].first_column, blocks[0].columns);
  EXPECT_LE(grid.CenterLongitude(blocks[0].columns - 1), 180);
  EXPECT_GE(grid.CenterLongitude(blocks[1].first_column), 180);
  // One cell a block: as many blocks as cells.
  EXPECT_EQ(CutIntoBlocks(grid, 1).size(), 20u);
}

TEST(SharedRasters, BagAndTiffOfF00788HoldIdenticalCells) {
  const std::filesystem::path folder =
      std::filesystem::path(FATHOM_SHARED_DATA_DIR) / "bathymetry";
  if (!std::filesystem::exists(folder / "F00788_SR_8m.bag")) {
    GTEST_SKIP() << "no shared survey data at " << folder;
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto bag, DepthRaster::Open({.path = folder / "F00788_SR_8m.bag"}));
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto tif, DepthRaster::Open({.path = folder / "F00788_SR_8m.tif"}));
  ASSERT_EQ(bag->grid().rows, tif->grid().rows);
  ASSERT_EQ(bag->grid().columns, tif->grid().columns);
  const GridBlock all{0, 0, bag->grid().rows, bag->grid().columns};
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile from_bag, bag->Read(all));
  FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile from_tif, tif->Read(all));
  EXPECT_NEAR(from_bag.north_west().latitude_deg(),
              from_tif.north_west().latitude_deg(), 1e-9);
  EXPECT_NEAR(from_bag.north_west().longitude_deg(),
              from_tif.north_west().longitude_deg(), 1e-9);
  EXPECT_GT(bag->counts().with_depth, 6000u);
  for (int i = 0; i < from_bag.depth_m_size(); ++i) {
    if (std::isnan(from_bag.depth_m(i))) {
      ASSERT_TRUE(std::isnan(from_tif.depth_m(i))) << i;
    } else {
      ASSERT_EQ(from_bag.depth_m(i), from_tif.depth_m(i)) << i;
      ASSERT_EQ(from_bag.std_m(i), from_tif.std_m(i)) << i;
      // The survey lies between 36 and 69 m (its README).
      ASSERT_GT(from_bag.depth_m(i), 36);
      ASSERT_LT(from_bag.depth_m(i), 69);
    }
  }
}

}  // namespace
}  // namespace fathom::client::cli
