// The map as a file and back: what WriteRaster writes, GDAL and our own
// importer read.

#include "client/cli/raster_writer.h"

#include <gdal_priv.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>

#include "client/cli/exit_code.h"
#include "client/cli/raster.h"
#include "client/cli/raster_sampling.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client::cli {
namespace {

using ::fathom::testing::StatusIs;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// 2 x 3 cells of 0.001 degrees: known, unknown, land / drying, deep, known.
Region SmallRegion() {
  Region region;
  region.rows = 2;
  region.columns = 3;
  region.north_west.set_latitude_deg(41.5);
  region.north_west.set_longitude_deg(-71.5);
  region.latitude_step_deg = region.longitude_step_deg = 0.001;
  region.depth_m = {12.25f, kNan, kNan, -0.75f, 4021.5f, 3};
  region.std_m = {0.5f, kNan, kNan, 0.25f, 20, 1};
  region.age_s = {60, kNan, kNan, 120, kNan, 0};
  region.shoalest_m = {11, kNan, kNan, -1, 4000, 3};
  region.kind = {v1::EVIDENCE_KIND_MEASURED, v1::EVIDENCE_KIND_UNSPECIFIED,
                 v1::EVIDENCE_KIND_LAND,     v1::EVIDENCE_KIND_SMOOTHED,
                 v1::EVIDENCE_KIND_PRIOR,    v1::EVIDENCE_KIND_MEASURED};
  region.stamp.set_map_revision(17);
  return region;
}

class RasterWriterTest : public ::testing::Test {
 protected:
  RasterWriterTest() {
    GDALAllRegister();
    std::string name =
        std::filesystem::temp_directory_path() / "fathom_writer_test.XXXXXX";
    folder_ = mkdtemp(name.data());
  }
  ~RasterWriterTest() override { std::filesystem::remove_all(folder_); }

  static std::vector<float> ReadBand(const std::string& path, int number) {
    auto* dataset =
        static_cast<GDALDataset*>(GDALOpen(path.c_str(), GA_ReadOnly));
    if (dataset == nullptr) return {};
    const int columns = dataset->GetRasterXSize();
    const int rows = dataset->GetRasterYSize();
    std::vector<float> values(static_cast<std::size_t>(columns * rows));
    EXPECT_EQ(dataset->GetRasterBand(number)->RasterIO(
                  GF_Read, 0, 0, columns, rows, values.data(), columns, rows,
                  GDT_Float32, 0, 0, nullptr),
              CE_None);
    GDALClose(dataset);
    return values;
  }

  std::vector<std::string> Files() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
      names.push_back(entry.path().filename().string());
    }
    return names;
  }

  std::filesystem::path folder_;
  const Region region_ = SmallRegion();
};

MATCHER_P(SameFloats, expected, "") {
  if (arg.size() != expected.size()) return false;
  for (std::size_t i = 0; i < arg.size(); ++i) {
    if (std::isnan(arg[i]) != std::isnan(expected[i])) return false;
    if (!std::isnan(arg[i]) && arg[i] != expected[i]) return false;
  }
  return true;
}

TEST_F(RasterWriterTest, CogHoldsDepthsAndSigmasCellForCellAndSaysWhatTheyAre) {
  const std::string path = folder_ / "map.tif";
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const ExportSummary summary,
      WriteRaster({.region = region_},
                  {.path = path, .mission = "bay", .vertical_datum = "MLLW"}));
  EXPECT_EQ(summary.columns, 3);
  EXPECT_EQ(summary.rows, 2);
  EXPECT_EQ(summary.file_bytes, std::filesystem::file_size(path));
  // Land (cell 2) has no depth and the uncertainty 0.
  EXPECT_THAT(ReadBand(path, 1), SameFloats(std::vector<float>{
                                     12.25f, kNan, kNan, -0.75f, 4021.5f, 3}));
  EXPECT_THAT(ReadBand(path, 2),
              SameFloats(std::vector<float>{0.5f, kNan, 0, 0.25f, 20, 1}));
  auto* dataset =
      static_cast<GDALDataset*>(GDALOpen(path.c_str(), GA_ReadOnly));
  ASSERT_NE(dataset, nullptr);
  EXPECT_STREQ(dataset->GetMetadataItem("LAYOUT", "IMAGE_STRUCTURE"), "COG");
  EXPECT_STREQ(dataset->GetMetadataItem("VERTICAL_DATUM"), "MLLW");
  EXPECT_STREQ(dataset->GetMetadataItem("FATHOM_MAP_REVISION"), "17");
  GDALRasterBand* depth = dataset->GetRasterBand(1);
  EXPECT_STREQ(depth->GetDescription(), "depth");
  EXPECT_STREQ(depth->GetUnitType(), "m");
  EXPECT_STREQ(depth->GetMetadataItem("positive"), "down");
  EXPECT_TRUE(std::isnan(depth->GetNoDataValue()));
  EXPECT_THAT(dataset->GetRasterBand(2)->GetMetadataItem("long_name"),
              HasSubstr("1 sigma"));
  double geotransform[6];
  dataset->GetGeoTransform(geotransform);
  EXPECT_THAT(geotransform, ElementsAre(-71.5, 0.001, 0, 41.5, 0, -0.001));
  GDALClose(dataset);
  EXPECT_THAT(Files(), ElementsAre("map.tif"));  // Nothing beside it.
}

TEST_F(RasterWriterTest, FurtherBandsHoldShoalestAgeAndLayer) {
  const std::string path = folder_ / "map.tif";
  Region local = region_;
  local.kind[5] = v1::EVIDENCE_KIND_UNSPECIFIED;
  FATHOM_ASSERT_OK(
      WriteRaster({.region = region_, .layers = CellLayers(region_, &local)},
                  {.path = path,
                   .bands = {ExportBand::kDepth, ExportBand::kUncertainty,
                             ExportBand::kShoalest, ExportBand::kAge,
                             ExportBand::kLayer}}));
  EXPECT_THAT(ReadBand(path, 3),
              SameFloats(std::vector<float>{11, kNan, kNan, -1, 4000, 3}));
  EXPECT_THAT(ReadBand(path, 4),
              SameFloats(std::vector<float>{60, kNan, kNan, 120, kNan, 0}));
  // Local, unknown, land, smoothed, prior, global.
  EXPECT_THAT(ReadBand(path, 5),
              SameFloats(std::vector<float>{5, 0, 4, 2, 1, 3}));
}

TEST_F(RasterWriterTest, EveryFormatComesBackThroughTheImporterAsItWas) {
  for (const auto& [format, name] : {std::pair{ExportFormat::kCog, "a.tif"},
                                     std::pair{ExportFormat::kTif, "b.tif"},
                                     std::pair{ExportFormat::kBag, "c.bag"}}) {
    SCOPED_TRACE(name);
    const std::string path = folder_ / name;
    FATHOM_ASSERT_OK(
        WriteRaster({.region = region_}, {.path = path,
                                          .format = format,
                                          .mission = "a <b> & c",
                                          .vertical_datum = "MLLW"}));
    // A cell that dries 0.75 m is no land.
    FATHOM_ASSERT_OK_AND_ASSIGN(
        const auto raster,
        DepthRaster::Open({.path = path, .land_above_m = 2}));
    FATHOM_ASSERT_OK_AND_ASSIGN(const v1::DepthTile tile,
                                raster->Read({0, 0, 2, 3}));
    EXPECT_NEAR(tile.north_west().latitude_deg(), 41.5, 1e-9);
    EXPECT_NEAR(tile.north_west().longitude_deg(), -71.5, 1e-9);
    EXPECT_NEAR(tile.latitude_step_deg(), 0.001, 1e-12);
    EXPECT_EQ(tile.land(), std::string({0, 0, 1, 0, 0, 0}));
    for (const int i : {0, 3, 4, 5}) {
      const auto at = static_cast<std::size_t>(i);
      EXPECT_EQ(tile.depth_m(i), region_.depth_m[at]) << i;
      EXPECT_EQ(tile.std_m(i), region_.std_m[at]) << i;
    }
    EXPECT_TRUE(std::isnan(tile.depth_m(1)));
    EXPECT_TRUE(std::isnan(tile.depth_m(2)));
  }
}

TEST_F(RasterWriterTest, BagSaysOneSigmaDatumAndNodata) {
  const std::string path = folder_ / "map.bag";
  FATHOM_ASSERT_OK(
      WriteRaster({.region = region_}, {.path = path,
                                        .format = ExportFormat::kBag,
                                        .mission = "a <b> & c",
                                        .vertical_datum = "MLLW"}));
  auto* dataset =
      static_cast<GDALDataset*>(GDALOpen(path.c_str(), GA_ReadOnly));
  ASSERT_NE(dataset, nullptr);
  EXPECT_STREQ(dataset->GetDriver()->GetDescription(), "BAG");
  EXPECT_EQ(dataset->GetRasterBand(1)->GetNoDataValue(), 1e6);
  const std::string xml = dataset->GetMetadata("xml:BAG")[0];
  EXPECT_THAT(xml, HasSubstr("codeListValue=\"rawStdDev\""));
  EXPECT_THAT(xml, HasSubstr("VERT_DATUM[\"MLLW\""));
  EXPECT_THAT(xml, HasSubstr("mission a &lt;b&gt; &amp; c"));
  GDALClose(dataset);
  // Elevations: up.
  EXPECT_EQ(ReadBand(path, 1)[0], -12.25f);
  EXPECT_EQ(ReadBand(path, 1)[1], 1e6f);
}

TEST_F(RasterWriterTest, DepthsAtAreThoseOfTheCellsThatHoldTheMiddles) {
  const std::string path = folder_ / "map.tif";
  FATHOM_ASSERT_OK(WriteRaster({.region = region_}, {.path = path}));
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto raster, DepthRaster::Open({.path = path, .land_above_m = 2}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::vector<float> same,
                              DepthsAt(*raster, region_));
  EXPECT_THAT(same, SameFloats(region_.depth_m));
  // Two cells of twice the size, half a cell north-west of the grid: middles
  // at 41.4995 N, 71.4995 W (cell 0) and 71.4975 W (cell 2, land).
  Region coarse;
  coarse.rows = 1;
  coarse.columns = 2;
  coarse.north_west.set_latitude_deg(41.5005);
  coarse.north_west.set_longitude_deg(-71.5005);
  coarse.latitude_step_deg = coarse.longitude_step_deg = 0.002;
  coarse.depth_m.assign(2, 0);
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::vector<float> there,
                              DepthsAt(*raster, coarse));
  EXPECT_THAT(there, SameFloats(std::vector<float>{12.25f, kNan}));
  // Elsewhere.
  coarse.north_west.set_longitude_deg(100);
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::vector<float> elsewhere,
                              DepthsAt(*raster, coarse));
  EXPECT_THAT(elsewhere, SameFloats(std::vector<float>{kNan, kNan}));
}

TEST_F(RasterWriterTest, UtmKeepsValuesOfNearestCells) {
  const std::string path = folder_ / "utm.tif";
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const ExportSummary summary,
      WriteRaster({.region = region_},
                  {.path = path, .crs = "utm", .resolution_m = 100}));
  // 71.5 W lies in zone 19 (72 to 66 W).
  EXPECT_EQ(summary.crs, "WGS 84 / UTM zone 19N");
  // 3 cells of 0.001 degrees are 250 m wide (83.4 m each at 41.5 N), 2 are
  // 222 m high: about 3 x 2 cells of 100 m, with the meridian's turn.
  EXPECT_NEAR(summary.columns, 3, 1);
  EXPECT_NEAR(summary.rows, 2, 1);
  int known = 0;
  for (const float depth : ReadBand(path, 1)) {
    if (std::isnan(depth)) continue;
    ++known;
    EXPECT_TRUE(depth == 12.25f || depth == -0.75f || depth == 4021.5f ||
                depth == 3)
        << depth;
  }
  EXPECT_GE(known, 3);
}

TEST_F(RasterWriterTest, WhatCannotBeWrittenLeavesWhatWasThere) {
  const std::string path = folder_ / "map.tif";
  std::ofstream(path) << "old";
  EXPECT_THAT(
      WriteRaster({.region = region_}, {.path = path, .crs = "EPSG:nonsense"}),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("EPSG:32619")));
  EXPECT_EQ(std::filesystem::file_size(path), 3u);
  const absl::Status status =
      WriteRaster({.region = region_}, {.path = folder_ / "no" / "such.tif"})
          .status();
  EXPECT_THAT(status,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("--out")));
  EXPECT_EQ(ExitCodeOf(status), ExitCode::kBadFile);
  EXPECT_THAT(
      WriteRaster({.region = region_}, {.path = folder_}),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("folder")));
  EXPECT_THAT(
      WriteRaster({.region = region_},
                  {.path = path,
                   .format = ExportFormat::kBag,
                   .bands = {ExportBand::kDepth, ExportBand::kUncertainty,
                             ExportBand::kAge}}),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("cog")));
  EXPECT_THAT(Files(), ElementsAre("map.tif"));
}

TEST_F(RasterWriterTest, FullDiskIsAnErrorThatLeavesNothingBehind) {
  // A limit on the size of files stands in for the disk: 40 kB for 300 x 300
  // cells of noise, which no format makes smaller than that.
  Region large;
  large.rows = large.columns = 300;
  large.north_west = region_.north_west;
  large.latitude_step_deg = large.longitude_step_deg = 1e-4;
  std::uint32_t random = 1;
  for (int i = 0; i < 90'000; ++i) {
    random = random * 1'664'525 + 1'013'904'223;  // Numerical Recipes.
    large.depth_m.push_back(static_cast<float>(random) * 1e-8f);
    large.std_m.push_back(static_cast<float>(random % 1000) + 1);
    large.kind.push_back(v1::EVIDENCE_KIND_MEASURED);
  }
  large.age_s = large.shoalest_m = large.std_m;
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{40'000, before.rlim_max};
  for (const ExportFormat format :
       {ExportFormat::kCog, ExportFormat::kTif, ExportFormat::kBag}) {
    setrlimit(RLIMIT_FSIZE, &small);
    const absl::Status status =
        WriteRaster({.region = large},
                    {.path = folder_ / "map", .format = format})
            .status();
    setrlimit(RLIMIT_FSIZE, &before);
    EXPECT_EQ(ExitCodeOf(status), ExitCode::kBadFile) << status;
  }
  std::signal(SIGXFSZ, handler);
  EXPECT_THAT(Files(), ::testing::IsEmpty());
}

}  // namespace
}  // namespace fathom::client::cli
