#include "sim_feeder/raster_terrain.h"

#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "base/status_macros.h"

namespace fathom::feeder {
namespace {

// Mean radius of the WGS84 ellipsoid: only sizes of cells come from it.
constexpr double kMetresPerDegree = 6371008.8 * std::numbers::pi / 180.0;

struct DatasetCloser {
  void operator()(GDALDataset* dataset) const { GDALClose(dataset); }
};
using DatasetPtr = std::unique_ptr<GDALDataset, DatasetCloser>;

// Keeps GDAL from printing; the last error is fetched from it instead.
class QuietGdal {
 public:
  QuietGdal() { CPLPushErrorHandler(CPLQuietErrorHandler); }
  QuietGdal(const QuietGdal&) = delete;
  QuietGdal& operator=(const QuietGdal&) = delete;
  ~QuietGdal() { CPLPopErrorHandler(); }
};

std::string LowerCase(std::string text) {
  for (char& c : text) {
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return text;
}

std::string MetadataItem(GDALRasterBand& band, const char* key) {
  const char* value = band.GetMetadataItem(key);
  return value == nullptr ? std::string() : std::string(value);
}

// The affine of the raster and its inverse, with PROJ between where the
// coordinates are projected.
struct ProjectedReference {
  std::array<double, 6> to_world;
  std::array<double, 6> to_pixel;
  std::unique_ptr<OGRCoordinateTransformation> from_wgs84;
  std::unique_ptr<OGRCoordinateTransformation> to_wgs84;
};

Georeference MakeProjected(
    const std::shared_ptr<ProjectedReference>& reference) {
  Georeference result;
  result.to_grid =
      [reference](const map::GeodeticPoint& point) -> std::optional<GridPoint> {
    double x = point.longitude_deg;
    double y = point.latitude_deg;
    if (!reference->from_wgs84->Transform(1, &x, &y)) return std::nullopt;
    const std::array<double, 6>& a = reference->to_pixel;
    return GridPoint{.column = a[0] + a[1] * x + a[2] * y,
                     .row = a[3] + a[4] * x + a[5] * y};
  };
  result.to_geodetic =
      [reference](const GridPoint& place) -> std::optional<map::GeodeticPoint> {
    const std::array<double, 6>& a = reference->to_world;
    double x = a[0] + a[1] * place.column + a[2] * place.row;
    double y = a[3] + a[4] * place.column + a[5] * place.row;
    if (!reference->to_wgs84->Transform(1, &x, &y)) return std::nullopt;
    return map::GeodeticPoint{.latitude_deg = y, .longitude_deg = x};
  };
  return result;
}

bool IsNorthUpGeographic(const OGRSpatialReference* spatial,
                         const std::array<double, 6>& affine) {
  const bool geographic = spatial == nullptr || spatial->IsGeographic();
  // A raster without any system (ETOPO5's netCDF) is taken for degrees only
  // if its corner could be one.
  return geographic && affine[2] == 0.0 && affine[4] == 0.0 &&
         affine[1] > 0.0 && affine[5] < 0.0 && std::abs(affine[0]) <= 360.5 &&
         std::abs(affine[3]) <= 90.5;
}

absl::StatusOr<Georeference> MakeGeoreference(
    const OGRSpatialReference* spatial, const std::array<double, 6>& affine,
    const std::string& path) {
  if (IsNorthUpGeographic(spatial, affine)) {
    return GeographicReference(
        {.latitude_deg = affine[3], .longitude_deg = affine[0]}, -affine[5],
        affine[1]);
  }
  if (spatial == nullptr) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s has no coordinate system; give it one with gdal_translate -a_srs",
        path));
  }
  auto reference = std::make_shared<ProjectedReference>();
  reference->to_world = affine;
  std::array<double, 6> forward = affine;
  if (!GDALInvGeoTransform(forward.data(), reference->to_pixel.data())) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s has a geotransform without inverse", path));
  }
  OGRSpatialReference wgs84;
  wgs84.SetWellKnownGeogCS("WGS84");
  wgs84.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  // Only the horizontal part: a vertical datum would shift our depths.
  OGRSpatialReference horizontal(*spatial);
  if (horizontal.IsCompound()) horizontal.StripVertical();
  horizontal.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  reference->from_wgs84.reset(
      OGRCreateCoordinateTransformation(&wgs84, &horizontal));
  reference->to_wgs84.reset(
      OGRCreateCoordinateTransformation(&horizontal, &wgs84));
  if (reference->from_wgs84 == nullptr || reference->to_wgs84 == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s: no way from WGS84 to its coordinate system: %s",
                        path, CPLGetLastErrorMsg()));
  }
  return MakeProjected(reference);
}

// Side of a cell in metres, at the raster's middle.
double CellSizeM(const OGRSpatialReference* spatial,
                 const std::array<double, 6>& affine, double rows) {
  const double width = std::hypot(affine[1], affine[4]);
  const double height = std::hypot(affine[2], affine[5]);
  if (spatial != nullptr && spatial->IsProjected()) {
    return std::sqrt(width * height) * spatial->GetLinearUnits();
  }
  const double middle_deg = affine[3] + affine[5] * 0.5 * rows;
  const double shrink =
      std::max(0.01, std::cos(middle_deg * std::numbers::pi / 180.0));
  return std::sqrt(width * height * shrink) * kMetresPerDegree;
}

absl::Status ReadBand(GDALRasterBand& band, const std::string& path,
                      TerrainGrid& grid) {
  grid.depth_m.resize(grid.rows * grid.columns);
  if (band.RasterIO(GF_Read, 0, 0, static_cast<int>(grid.columns),
                    static_cast<int>(grid.rows), grid.depth_m.data(),
                    static_cast<int>(grid.columns), static_cast<int>(grid.rows),
                    GDT_Float32, 0, 0, nullptr) != CE_None) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: cannot read band 1: %s", path, CPLGetLastErrorMsg()));
  }
  int has_nodata = 0;
  const float nodata = static_cast<float>(band.GetNoDataValue(&has_nodata));
  int has_scale = 0;
  const double scale = band.GetScale(&has_scale);
  const double offset = band.GetOffset();
  for (float& value : grid.depth_m) {
    const bool missing =
        !std::isfinite(value) || (has_nodata != 0 && value == nodata);
    // Beyond any place on Earth: an undeclared sentinel (1e6, -9999e30...).
    if (missing || std::abs(value) > 20'000.0f) {
      value = std::numeric_limits<float>::quiet_NaN();
    } else if (has_scale != 0) {
      value = static_cast<float>(value * scale + offset);
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<double> MeanOfValid(const TerrainGrid& grid) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const float value : grid.depth_m) {
    if (std::isnan(value)) continue;
    sum += value;
    ++count;
  }
  if (count == 0) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s has no valid value", grid.name));
  }
  return sum / static_cast<double>(count);
}

}  // namespace

absl::StatusOr<Positive> ParsePositive(std::string_view name) {
  if (name == "auto") return Positive::kAuto;
  if (name == "up") return Positive::kUp;
  if (name == "down") return Positive::kDown;
  return absl::InvalidArgumentError(absl::StrFormat(
      "positive=\"%s\" is unknown; say auto, up or down", name));
}

absl::StatusOr<Positive> DetectPositive(const BandDescription& band) {
  const std::string attribute = LowerCase(band.positive);
  if (attribute == "up") return Positive::kUp;
  if (attribute == "down") return Positive::kDown;
  if (band.driver == "BAG") return Positive::kUp;
  const std::string text = LowerCase(band.description);
  struct Word {
    std::string_view word;
    Positive positive;
  };
  static constexpr std::array<Word, 9> kWords = {{
      {"positive_up", Positive::kUp},
      {"positive_down", Positive::kDown},
      {"elevation", Positive::kUp},
      {"height", Positive::kUp},
      {"altitude", Positive::kUp},
      {"relief", Positive::kUp},
      {"topograph", Positive::kUp},
      {"depth", Positive::kDown},
      {"sounding", Positive::kDown},
  }};
  for (const Word& candidate : kWords) {
    if (text.find(candidate.word) != std::string::npos) {
      return candidate.positive;
    }
  }
  if (band.mean < 0.0) return Positive::kUp;
  return absl::InvalidArgumentError(absl::StrFormat(
      "cannot tell whether \"%s\" (mean %g) holds elevations or depths; say "
      "--truth-positive up or down",
      band.description, band.mean));
}

absl::StatusOr<Terrain> LoadRasterTerrain(const std::string& path,
                                          Positive positive) {
  GDALAllRegister();
  const QuietGdal quiet;
  std::error_code ignored;
  // "NETCDF:file:variable" and the like name no file: let GDAL judge them.
  if (path.find(':') == std::string::npos &&
      !std::filesystem::exists(path, ignored)) {
    return absl::NotFoundError(absl::StrFormat("no such file: %s", path));
  }
  const DatasetPtr dataset(GDALDataset::FromHandle(GDALOpenEx(
      path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR,
      nullptr, nullptr, nullptr)));
  if (dataset == nullptr || dataset->GetRasterCount() < 1) {
    return absl::InvalidArgumentError(
        absl::StrFormat("GDAL cannot read %s: %s", path, CPLGetLastErrorMsg()));
  }
  std::array<double, 6> affine = {};
  if (dataset->GetGeoTransform(affine.data()) != CE_None) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s has no geotransform", path));
  }
  const OGRSpatialReference* spatial = dataset->GetSpatialRef();
  GDALRasterBand& band = *dataset->GetRasterBand(1);
  TerrainGrid grid;
  grid.rows = static_cast<std::size_t>(band.GetYSize());
  grid.columns = static_cast<std::size_t>(band.GetXSize());
  grid.name = path;
  if (grid.rows * grid.columns > kMaxTerrainCells) {
    return absl::ResourceExhaustedError(absl::StrFormat(
        "%s has %d cells, more than %d; cut a piece out with gdal_translate "
        "-projwin",
        path, grid.rows * grid.columns, kMaxTerrainCells));
  }
  grid.cell_size_m = CellSizeM(spatial, affine, static_cast<double>(grid.rows));
  FATHOM_ASSIGN_OR_RETURN(Georeference georeference,
                          MakeGeoreference(spatial, affine, path));
  if (IsNorthUpGeographic(spatial, affine)) {
    const double width_deg = affine[1] * static_cast<double>(grid.columns);
    grid.wraps_east = std::abs(width_deg - 360.0) < 0.5 * affine[1];
  }
  FATHOM_RETURN_IF_ERROR(ReadBand(band, path, grid));
  if (positive == Positive::kAuto) {
    FATHOM_ASSIGN_OR_RETURN(const double mean, MeanOfValid(grid));
    FATHOM_ASSIGN_OR_RETURN(
        positive,
        DetectPositive({.driver = dataset->GetDriver()->GetDescription(),
                        .description = std::string(band.GetDescription()) +
                                       " " + MetadataItem(band, "long_name"),
                        .positive = MetadataItem(band, "positive"),
                        .mean = mean}));
  }
  if (positive == Positive::kUp) {
    for (float& value : grid.depth_m) value = -value;
  }
  return Terrain::Create(std::move(grid), std::move(georeference));
}

absl::StatusOr<Terrain> RefineTerrain(const Terrain& coarse,
                                      const RefinedTerrainOptions& options) {
  if (!(options.half_side_m > 0.0) || !(options.cell_size_m > 0.0)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("half_side_m=%g cell_size_m=%g must both be > 0",
                        options.half_side_m, options.cell_size_m));
  }
  const double side =
      std::ceil(2.0 * options.half_side_m / options.cell_size_m);
  if (side > 2'000.0) {
    return absl::ResourceExhaustedError(absl::StrFormat(
        "a fine terrain of %g x %g cells is too large; at most 2000 x 2000: "
        "take larger truth cells or a smaller area",
        side, side));
  }
  if (!coarse.DepthAt(options.middle).has_value()) {
    return absl::OutOfRangeError(absl::StrFormat(
        "%s has no value at latitude=%.5f longitude=%.5f", coarse.grid().name,
        options.middle.latitude_deg, options.middle.longitude_deg));
  }
  const double latitude_step_deg = options.cell_size_m / kMetresPerDegree;
  const double longitude_step_deg =
      latitude_step_deg /
      std::cos(options.center.latitude_deg * std::numbers::pi / 180.0);
  // Whole cells south and east from the centre to the window's first cell.
  const double first_row =
      std::round((options.center.latitude_deg - options.middle.latitude_deg) /
                     latitude_step_deg -
                 0.5 * side);
  const double first_column =
      std::round(map::NormalizeLongitudeDeg(options.middle.longitude_deg -
                                            options.center.longitude_deg) /
                     longitude_step_deg -
                 0.5 * side);
  const map::GeodeticPoint north_west = {
      .latitude_deg =
          options.center.latitude_deg - first_row * latitude_step_deg,
      .longitude_deg = map::NormalizeLongitudeDeg(
          options.center.longitude_deg + first_column * longitude_step_deg)};
  const Georeference georeference =
      GeographicReference(north_west, latitude_step_deg, longitude_step_deg);
  TerrainGrid grid;
  grid.rows = static_cast<std::size_t>(side);
  grid.columns = grid.rows;
  grid.cell_size_m = options.cell_size_m;
  grid.name =
      absl::StrFormat("%s + relief std_m=%g correlation_length_m=%g seed=%d",
                      coarse.grid().name, options.relief.std_m,
                      options.relief.correlation_length_m, options.relief.seed);
  grid.depth_m.reserve(grid.rows * grid.columns);
  const Relief relief(options.relief);
  for (std::size_t i = 0; i < grid.rows; ++i) {
    for (std::size_t j = 0; j < grid.columns; ++j) {
      const GridPoint center = {.column = static_cast<double>(j) + 0.5,
                                .row = static_cast<double>(i) + 0.5};
      const std::optional<double> base_m =
          coarse.DepthAt(*georeference.to_geodetic(center));
      if (!base_m.has_value()) {
        grid.depth_m.push_back(std::numeric_limits<float>::quiet_NaN());
        continue;
      }
      double depth_m = *base_m;
      if (depth_m > options.min_water_m) {
        depth_m +=
            relief.At(-(first_row + center.row) * options.cell_size_m,
                      (first_column + center.column) * options.cell_size_m);
        depth_m = std::max(depth_m, options.min_water_m);
      }
      grid.depth_m.push_back(static_cast<float>(depth_m));
    }
  }
  return Terrain::Create(std::move(grid), georeference);
}

}  // namespace fathom::feeder
