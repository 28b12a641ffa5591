// DepthRaster on the rasters that break importers: real samples, each with
// what it must give, and bad ones made here.

#include <gdal_priv.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ogr_spatialref.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <set>

#include "absl/strings/str_format.h"
#include "client/cli/bag_metadata.h"
#include "client/cli/exit_code.h"
#include "client/cli/raster.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client::cli {
namespace {

using ::fathom::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Everything of a raster, read in blocks.
struct Whole {
  std::vector<float> depths;  // Known ones.
  std::vector<float> stds;    // Beside them.
  RasterCounts counts;
  double Shoalest() const { return *std::ranges::min_element(depths); }
  double Deepest() const { return *std::ranges::max_element(depths); }
};

absl::StatusOr<Whole> ReadWhole(DepthRaster& raster) {
  Whole whole;
  for (const GridBlock& block : CutIntoBlocks(raster.grid(), 65'536)) {
    absl::StatusOr<v1::DepthTile> tile = raster.Read(block);
    if (!tile.ok()) return tile.status();
    for (int i = 0; i < tile->depth_m_size(); ++i) {
      if (std::isnan(tile->depth_m(i))) continue;
      whole.depths.push_back(tile->depth_m(i));
      whole.stds.push_back(tile->std_m(tile->std_m_size() == 1 ? 0 : i));
    }
  }
  whole.counts = raster.counts();
  return whole;
}

// --- The samples of the shared data ---

struct Sample {
  const char* file;
  RasterOptions options = {};
  // Refused with this code and text; or read, as below.
  absl::StatusCode code = absl::StatusCode::kOk;
  const char* text = "";
  std::uint64_t with_depth = 0;
  std::uint64_t land = 0;
  // Metres; the source's own extremes by gdalinfo -mm (a variable-resolution
  // BAG: by -oo MODE=RESAMPLED_GRID), negated where it holds elevations.
  double shoalest = 0;
  double deepest = 0;
  // One sigma, metres.
  double least_std = 1;
  double most_std = 1;
};

const Sample kSamples[] = {
    {.file = "import_cases/BlueTopo_BC25M26L_20221102b.tiff",
     .with_depth = 10'249,
     .shoalest = 791.93,
     .deepest = 3541.02,
     .least_std = 21.08,
     .most_std = 180.06},
    // Overview -20.385..-24.364 and 0.021..0.041; refined as below. Product
    // uncertainty: 0.019 / 1.96 = 0.0097, 0.517 / 1.96 = 0.2638.
    {.file = "import_cases/Sample_VR_BAG-gzip.bag",
     .with_depth = 1'399,
     .shoalest = 20.044,
     .deepest = 24.907,
     .least_std = 0.0097,
     .most_std = 0.2638},
    {.file = "import_cases/bdb_01.bag",
     .options = {.std_m = 1},
     .with_depth = 91,
     .shoalest = 2.8,
     .deepest = 4.516},
    // Product uncertainty: 0.398 / 1.96 = 0.2031, 0.6453 / 1.96 = 0.3293.
    {.file = "import_cases/bdb_02.bag",
     .with_depth = 336,
     .shoalest = 0.823,
     .deepest = 16.776,
     .least_std = 0.2031,
     .most_std = 0.3293},
    {.file = "import_cases/metadata_layer_example.bag",
     .code = absl::StatusCode::kDataLoss,
     .text = "--bag-overview"},
    {.file = "import_cases/metadata_layer_example.bag",
     .options = {.positive = Positive::kUp, .overview_grid = true},
     .land = 10'739},
    // Elevations 0..99.99 in steps of 0.01 (its cells are a ramp): the zeros
    // are water.
    {.file = "import_cases/sample.bag",
     .options = {.std_m = 1},
     .with_depth = 108,
     .land = 10'631,
     .shoalest = 0,
     .deepest = 0},
    {.file = "import_cases/southern_hemi_false_northing.bag",
     .options = {.std_m = 1},
     .with_depth = 3'692,
     .shoalest = 3225.979,
     .deepest = 4183.629},
    {.file = "import_cases/test_interpolated.bag",
     .code = absl::StatusCode::kInvalidArgument,
     .text = "2 to 20 m, are land"},
    {.file = "import_cases/test_offset_ne_corner.bag",
     .options = {.std_m = 1},
     .with_depth = 188,
     .land = 184,
     .shoalest = 0,
     .deepest = 10},
    {.file = "import_cases/test_s102_v2.1.h5",
     .code = absl::StatusCode::kInvalidArgument,
     .text = "S-102 needs GDAL 3.8"},
    {.file = "import_cases/test_s102_v3.0_with_QualityOfBathymetryCoverage.h5",
     .code = absl::StatusCode::kInvalidArgument,
     .text = "S-102 needs GDAL 3.8"},
    {.file = "import_cases/test_vr.bag",
     .options = {.std_m = 1},
     .with_depth = 188,
     .land = 184,
     .shoalest = 0,
     .deepest = 10},
    {.file = "import_cases/true_n_nominal.bag",
     .code = absl::StatusCode::kInvalidArgument,
     .text = "--crs"},
    // It says neither which system nor that its depths are positive.
    {.file = "import_cases/true_n_nominal.bag",
     .options = {.positive = Positive::kDown, .crs = "EPSG:32619"},
     .with_depth = 100,
     .shoalest = 10,
     .deepest = 19.9,
     .least_std = 1,
     .most_std = 1.99},
    {.file = "bathymetry/F00788_SR_8m.bag",
     .with_depth = 6'610,
     .shoalest = 36.185,
     .deepest = 68.443,
     .least_std = 0.057,
     .most_std = 1.915},
    {.file = "bathymetry/F00788_SR_8m.tif",
     .with_depth = 6'610,
     .shoalest = 36.185,
     .deepest = 68.443,
     .least_std = 0.057,
     .most_std = 1.915},
    // Product uncertainty: 0.27 / 1.96 = 0.1378, 0.664 / 1.96 = 0.3388.
    {.file = "bathymetry/JD211_public_Release_1-4_UTM.bag",
     .with_depth = 1'258'302,
     .shoalest = 50.987,
     .deepest = 52.957,
     .least_std = 0.1378,
     .most_std = 0.3388},
    // Values by awk: -16.682..13.339, 1641 of 2990 at most 0.
    {.file = "bathymetry/kahului_sample_1s.tt2",
     .options = {.positive = Positive::kUp, .std_m = 1, .crs = "EPSG:4326"},
     .with_depth = 1'641,
     .land = 1'349,
     .shoalest = 0.001,
     .deepest = 16.682},
    {.file = "bathymetry/narragansett_etopo2022_15s.tif",
     .options = {.std_m = 1},
     .code = absl::StatusCode::kInvalidArgument,
     .text = "--positive"},
    {.file = "bathymetry/narragansett_etopo2022_15s.tif",
     .options = {.positive = Positive::kUp, .std_m = 1},
     .with_depth = 8'191,
     .land = 10'529,
     .shoalest = 0.00015,
     .deepest = 49.255},
    {.file = "bathymetry/wadden_sea_30m_utm31.tif",
     .options = {.std_m = 1},
     .with_depth = 942'900,
     .land = 657'507,
     .shoalest = 0,
     .deepest = 40.57},
    {.file = "bathymetry/woods_hole_buzzards_10m_utm19.tif",
     .options = {.std_m = 1},
     .with_depth = 218'375,
     .land = 71'335,
     .shoalest = 0,
     .deepest = 28.398},
};

TEST(SharedRasters, EachSampleGivesItsCellsOrSaysWhyNot) {
  const std::filesystem::path folder = FATHOM_SHARED_DATA_DIR;
  if (!std::filesystem::exists(folder / "import_cases")) {
    GTEST_SKIP() << "no shared survey data at " << folder;
  }
  std::set<std::string> tested;
  for (const Sample& sample : kSamples) {
    SCOPED_TRACE(sample.file);
    tested.insert(sample.file);
    RasterOptions options = sample.options;
    options.path = folder / sample.file;
    const auto raster = DepthRaster::Open(options);
    if (sample.code != absl::StatusCode::kOk) {
      EXPECT_THAT(raster, StatusIs(sample.code, HasSubstr(sample.text)));
      EXPECT_EQ(ExitCodeOf(raster.status()), ExitCode::kBadFile);
      continue;
    }
    FATHOM_ASSERT_OK(raster);
    FATHOM_ASSERT_OK_AND_ASSIGN(const Whole whole, ReadWhole(**raster));
    EXPECT_EQ(whole.counts.with_depth, sample.with_depth);
    EXPECT_EQ(whole.counts.land, sample.land);
    if (whole.depths.empty()) continue;
    EXPECT_NEAR(whole.Shoalest(), sample.shoalest, 6e-4);
    EXPECT_NEAR(whole.Deepest(), sample.deepest, 6e-4);
    EXPECT_NEAR(*std::ranges::min_element(whole.stds), sample.least_std, 6e-4);
    EXPECT_NEAR(*std::ranges::max_element(whole.stds), sample.most_std, 6e-4);
  }
  for (const char* name : {"import_cases", "bathymetry"}) {
    for (const auto& entry :
         std::filesystem::directory_iterator(folder / name)) {
      EXPECT_TRUE(
          tested.contains(name + ("/" + entry.path().filename().string())))
          << entry.path() << " has no row";
    }
  }
}

// --- Rasters made here ---

class RasterCases : public ::testing::Test {
 protected:
  RasterCases() {
    GDALAllRegister();
    std::string name =
        std::filesystem::temp_directory_path() / "fathom_raster_cases.XXXXXX";
    folder_ = mkdtemp(name.data());
  }
  ~RasterCases() override { std::filesystem::remove_all(folder_); }

  // Elevations -1, -2, ... row by row, at a geotransform.
  std::string MakeCounted(int columns, int rows,
                          const std::array<double, 6>& geotransform,
                          const std::string& crs) {
    std::string path = folder_ / "counted.tif";
    auto* dataset = GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
        path.c_str(), columns, rows, 1, GDT_Float32, nullptr);
    dataset->SetGeoTransform(
        const_cast<double*>(geotransform.data()));  // GDAL's manners.
    OGRSpatialReference reference;
    reference.SetFromUserInput(crs.c_str());
    dataset->SetSpatialRef(&reference);
    std::vector<float> values;
    for (int i = 0; i < columns * rows; ++i) {
      values.push_back(-static_cast<float>(i + 1));
    }
    GDALRasterBand* band = dataset->GetRasterBand(1);
    band->SetDescription("elevation");
    EXPECT_EQ(band->RasterIO(GF_Write, 0, 0, columns, rows, values.data(),
                             columns, rows, GDT_Float32, 0, 0, nullptr),
              CE_None);
    GDALClose(dataset);
    return path;
  }

  std::string Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }

  std::filesystem::path folder_;
};

// A square of cells turned by `degrees` about its corner.
std::array<double, 6> Turned(double x, double y, double step, double degrees) {
  const double a = degrees * std::numbers::pi / 180;
  return {x, step * std::cos(a), step * std::sin(a),
          y, step * std::sin(a), -step * std::cos(a)};
}

TEST_F(RasterCases, EveryCellOfARotatedOrProjectedChartIsTaken) {
  struct Chart {
    const char* crs;
    double x, y, step, degrees;
  };
  for (const Chart& chart :
       {Chart{"EPSG:32619", 300'000, 4'600'000, 10, 0},
        Chart{"EPSG:32619", 300'000, 4'600'000, 10, 10},
        Chart{"EPSG:32619", 300'000, 4'600'000, 10, 30},
        Chart{"EPSG:32619", 300'000, 4'600'000, 10, 45},
        Chart{"EPSG:32619", 300'000, 4'600'000, 10, 117},
        // UTM at 70 N, 9 degrees off its meridian: convergence 8.5 degrees.
        Chart{"EPSG:32633", 160'000, 7'790'000, 500, 0},
        // Lambert conformal, far from its meridian.
        Chart{"EPSG:3034", 2'500'000, 2'000'000, 1000, 0},
        // South-up and mirrored by half a turn.
        Chart{"EPSG:32755", 500'000, 5'900'000, 25, 180},
        // Polar stereographic beside the pole.
        Chart{"EPSG:3413", -1'500'000, -900'000, 5000, 0},
        // Degrees, rotated.
        Chart{"EPSG:4326", -71, 41, 0.01, 20}}) {
    SCOPED_TRACE(absl::StrFormat("%s turned %g", chart.crs, chart.degrees));
    const std::string path = MakeCounted(
        40, 40, Turned(chart.x, chart.y, chart.step, chart.degrees), chart.crs);
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                                DepthRaster::Open({.path = path, .std_m = 1}));
    FATHOM_ASSERT_OK_AND_ASSIGN(const Whole whole, ReadWhole(*raster));
    const std::set<float> taken(whole.depths.begin(), whole.depths.end());
    EXPECT_EQ(taken.size(), 1600u);
    // No more cells than the rotation costs: k = 1/sqrt(2) doubles them, the
    // corners of the box around a turned square as many again.
    EXPECT_LT(raster->grid().rows * raster->grid().columns, 1600 * 5);
  }
}

TEST_F(RasterCases, ChartAroundThePoleIsReadAllRound) {
  // 40 x 40 cells of 5 km about the north pole.
  const std::string path =
      MakeCounted(40, 40, {-100'000, 5000, 0, 100'000, 0, -5000}, "EPSG:3413");
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path, .std_m = 1}));
  const LonLatGrid& grid = raster->grid();
  EXPECT_EQ(grid.north_deg, 90);
  EXPECT_NEAR(static_cast<double>(grid.columns) * grid.longitude_step_deg, 360,
              1e-6);
  FATHOM_ASSERT_OK_AND_ASSIGN(const Whole whole, ReadWhole(*raster));
  const std::set<float> taken(whole.depths.begin(), whole.depths.end());
  EXPECT_EQ(taken.size(), 1600u);
}

TEST_F(RasterCases, DegreesAcrossTheAntimeridianStayInPlace) {
  // Four cells of half a degree from 179 E to 179 W.
  const std::string path =
      MakeCounted(4, 1, {179, 0.5, 0, 10, 0, -0.5}, "EPSG:4326");
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path, .std_m = 1}));
  std::vector<std::pair<double, float>> cells;
  for (const GridBlock& block : CutIntoBlocks(raster->grid(), 100)) {
    FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile, raster->Read(block));
    for (int i = 0; i < tile.depth_m_size(); ++i) {
      cells.emplace_back(tile.north_west().longitude_deg() + 0.5 * i,
                         tile.depth_m(i));
    }
  }
  EXPECT_THAT(cells, ElementsAre(std::pair(179, 1), std::pair(179.5, 2),
                                 std::pair(-180, 3), std::pair(-179.5, 4)));
}

TEST_F(RasterCases, OneCellIsAChartToo) {
  for (const char* crs : {"EPSG:4326", "EPSG:32619"}) {
    const bool degrees = std::string(crs) == "EPSG:4326";
    const std::string path =
        degrees ? MakeCounted(1, 1, {-71, 0.1, 0, 41, 0, -0.1}, crs)
                : MakeCounted(1, 1, {3e5, 10, 0, 4.6e6, 0, -10}, crs);
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                                DepthRaster::Open({.path = path, .std_m = 1}));
    FATHOM_ASSERT_OK_AND_ASSIGN(const Whole whole, ReadWhole(*raster));
    ASSERT_GE(whole.depths.size(), 1u);
    EXPECT_EQ(whole.Deepest(), 1);
  }
}

TEST_F(RasterCases, TurnedSignIsRefusedNotLoadedAsLand) {
  // Depths under the name of elevations.
  const std::string path = Write(
      "depths.asc",
      "ncols 2\nnrows 2\nxllcorner -71\nyllcorner 41\ncellsize 0.1\n12 13\n14 "
      "15\n");
  const absl::Status status =
      DepthRaster::Open({.path = path, .std_m = 1, .crs = "EPSG:4326"})
          .status();
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kInvalidArgument,
                               HasSubstr("--positive")));
  // The file says elevation: all would be land.
  const std::string tif = folder_ / "up.tif";
  auto* dataset = GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
      tif.c_str(), 2, 1, 1, GDT_Float32, nullptr);
  double geotransform[6] = {-71, 0.1, 0, 41, 0, -0.1};
  dataset->SetGeoTransform(geotransform);
  OGRSpatialReference reference;
  reference.importFromEPSG(4326);
  dataset->SetSpatialRef(&reference);
  float values[] = {12, 15};
  dataset->GetRasterBand(1)->SetDescription("elevation");
  EXPECT_EQ(dataset->GetRasterBand(1)->RasterIO(GF_Write, 0, 0, 2, 1, values, 2,
                                                1, GDT_Float32, 0, 0, nullptr),
            CE_None);
  GDALClose(dataset);
  EXPECT_THAT(DepthRaster::Open({.path = tif, .std_m = 1}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("12 to 15 m, are land"),
                             HasSubstr("--positive down"))));
  // An island is one if the caller says so.
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto island,
      DepthRaster::Open({.path = tif, .positive = Positive::kUp, .std_m = 1}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const Whole whole, ReadWhole(*island));
  EXPECT_EQ(whole.counts.land, 2u);
}

// A sparse file of 100 000 x 100 000 cells (40 GB if it were stored).
std::string MakeHuge(const std::filesystem::path& folder, bool with_rock) {
  std::string path = folder / "huge.tif";
  char** options = nullptr;
  options = CSLSetNameValue(options, "SPARSE_OK", "TRUE");
  options = CSLSetNameValue(options, "TILED", "YES");
  options = CSLSetNameValue(options, "BIGTIFF", "YES");
  auto* dataset = GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
      path.c_str(), 100'000, 100'000, 1, GDT_Float32, options);
  CSLDestroy(options);
  // 10 degrees: 0.0001 a cell.
  double geotransform[6] = {-75, 1e-4, 0, 45, 0, -1e-4};
  dataset->SetGeoTransform(geotransform);
  OGRSpatialReference reference;
  reference.importFromEPSG(4326);
  dataset->SetSpatialRef(&reference);
  GDALRasterBand* band = dataset->GetRasterBand(1);
  band->SetDescription("elevation");
  band->SetNoDataValue(-9999);
  if (with_rock) {
    float rock = -7;
    EXPECT_EQ(band->RasterIO(GF_Write, 70'001, 30'002, 1, 1, &rock, 1, 1,
                             GDT_Float32, 0, 0, nullptr),
              CE_None);
  }
  GDALClose(dataset);
  return path;
}

long PeakKilobytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

TEST_F(RasterCases, HugeSparseChartIsReadInBoundedMemory) {
  const std::string path = MakeHuge(folder_, true);
  const long before = PeakKilobytes();
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                              DepthRaster::Open({.path = path, .std_m = 1}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const Whole whole, ReadWhole(*raster));
  EXPECT_THAT(whole.depths, ElementsAre(7));
  EXPECT_EQ(whole.counts.with_depth, 1u);
  EXPECT_EQ(whole.counts.unknown, 9'999'999'999u);
  // GDAL's cache of 256 MB, its table of tiles and our blocks.
  EXPECT_LT(PeakKilobytes() - before, 600'000);
}

TEST_F(RasterCases, HugeChartOfNothingIsRefusedSoon) {
  EXPECT_THAT(DepthRaster::Open({.path = MakeHuge(folder_, false), .std_m = 1}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("every cell is nodata")));
}

TEST_F(RasterCases, BagThatIsCutOffIsRefused) {
  const std::filesystem::path source =
      std::filesystem::path(FATHOM_SHARED_DATA_DIR) / "bathymetry" /
      "F00788_SR_8m.bag";
  if (!std::filesystem::exists(source)) {
    GTEST_SKIP() << "no shared survey data";
  }
  for (const int kept : {0, 100, 5'000, 40'000, 69'000}) {
    const std::filesystem::path path = folder_ / "cut.bag";
    std::filesystem::copy_file(
        source, path, std::filesystem::copy_options::overwrite_existing);
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
    std::filesystem::resize_file(path, static_cast<std::uintmax_t>(kept));
    const auto raster = DepthRaster::Open({.path = path});
    const absl::Status status =
        raster.ok() ? ReadWhole(**raster).status() : raster.status();
    EXPECT_FALSE(status.ok()) << kept;
    EXPECT_EQ(ExitCodeOf(status), ExitCode::kBadFile) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("cut.bag"));
  }
}

TEST_F(RasterCases, BagSaysWhatItsUncertaintyIs) {
  struct Case {
    const char* code;
    bool as_stated;
    double std;
  };
  for (const Case& c :
       {Case{"productUncert", false, 1.96 / 1.959964},
        Case{"rawStdDev", false, 1.96}, Case{"unknown", false, 1.96},
        // --std-band 2 overrides the file.
        Case{"productUncert", true, 1.96}}) {
    SCOPED_TRACE(c.code);
    GDALDataset* source =
        GetGDALDriverManager()->GetDriverByName("MEM")->Create(
            "", 3, 3, 2, GDT_Float32, nullptr);
    double geotransform[6] = {3e5, 10, 0, 4.6e6, 0, -10};
    source->SetGeoTransform(geotransform);
    OGRSpatialReference utm;
    utm.importFromEPSG(32619);
    source->SetSpatialRef(&utm);
    source->GetRasterBand(1)->Fill(-20);
    source->GetRasterBand(2)->Fill(1.96);
    char** options =
        CSLSetNameValue(nullptr, "VAR_VERTICAL_UNCERT_CODE", c.code);
    const std::string path = folder_ / "made.bag";
    GDALClose(GetGDALDriverManager()->GetDriverByName("BAG")->CreateCopy(
        path.c_str(), source, FALSE, options, nullptr, nullptr));
    CSLDestroy(options);
    GDALClose(source);
    FATHOM_ASSERT_OK_AND_ASSIGN(
        const auto raster,
        DepthRaster::Open({.path = path, .std_band = c.as_stated ? 2 : 0}));
    FATHOM_ASSERT_OK_AND_ASSIGN(const Whole whole, ReadWhole(*raster));
    EXPECT_NEAR(whole.stds.front(), c.std, 1e-6);
    EXPECT_THAT(raster->summary().std_source,
                HasSubstr(c.as_stated ? "as stated" : c.code));
  }
}

TEST(BagMetadata, BothGenerationsOfTheSchemaAreRead) {
  const BagUncertainty old_schema = ReadBagUncertainty(
      "<verticalUncertaintyType>Product Uncert</verticalUncertaintyType>");
  EXPECT_TRUE(old_schema.is_95_percent);
  EXPECT_EQ(old_schema.code, "Product Uncert");
  const BagUncertainty new_schema = ReadBagUncertainty(
      "<bag:verticalUncertaintyType>\n <bag:BAG_VertUncertCode x=\"y\">"
      "cubeStdDev</bag:BAG_VertUncertCode></bag:verticalUncertaintyType>");
  EXPECT_FALSE(new_schema.is_95_percent);
  EXPECT_TRUE(new_schema.stated);
  EXPECT_FALSE(ReadBagUncertainty("<a>b</a>").stated);
  EXPECT_FALSE(ReadBagUncertainty("verticalUncertaintyType").stated);
  EXPECT_EQ(ReadBagEpsg("<gmd:code><gco:CharacterString>6339</gco:"
                        "CharacterString></gmd:code><gmd:codeSpace><gco:"
                        "CharacterString>EPSG</gco:CharacterString>"),
            6339);
  EXPECT_EQ(ReadBagEpsg(">EPSG<"), std::nullopt);
}

TEST_F(RasterCases, TopotypesTwoAndThreeAreReadWhereTheyLie) {
  // 3 x 2 values at 0.1 degrees, the south-western one at 41 N 71 W.
  const std::string header =
      "3 mx\n2 my\n-71 xlower\n41 ylower\n0.1 dx\n0.1 dy\n";
  for (const std::string& text :
       {header + "-1\n-2\n-3\n-4\n-5\n-6\n", header + "-1 -2 -3\n-4 -5 -6\n",
        std::string("ncols 3\nnrows 2\nxllcenter -71\nyllcenter 41\n"
                    "cellsize 0.1 0.1\nnodata_value 5\n-1 -2 -3\n-4 -5 5\n")}) {
    SCOPED_TRACE(text);
    const std::string path = Write("chart.tt3", text);
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto raster,
                                DepthRaster::Open({.path = path,
                                                   .positive = Positive::kUp,
                                                   .std_m = 1,
                                                   .crs = "EPSG:4326"}));
    FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile,
                                raster->Read({0, 0, 2, 3}));
    EXPECT_EQ(tile.depth_m(0), 1);
    EXPECT_EQ(tile.depth_m(4), 5);
    // Middles of cells are the values' places: the corner is half a step off.
    EXPECT_NEAR(tile.north_west().latitude_deg(), 41.15, 1e-9);
    EXPECT_NEAR(tile.north_west().longitude_deg(), -71.05, 1e-9);
  }
  const RasterOptions options{.path = Write("cut.tt2", header + "-1\n-2\n"),
                              .std_m = 1,
                              .crs = "EPSG:4326"};
  EXPECT_THAT(DepthRaster::Open(options),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("row 1 of 2")));
  const RasterOptions large{
      .path = Write("large.tt2",
                    "1e6 mx\n1e6 my\n0 xlower\n0 ylower\n1 dx\n1 dy\n"),
      .std_m = 1};
  EXPECT_THAT(
      DepthRaster::Open(large),
      StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("GeoTIFF")));
}

}  // namespace
}  // namespace fathom::client::cli
