#include "client/cli/raster_writer.h"

#include <cpl_vsi.h>
#include <gdal_utils.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <exception>
#include <filesystem>
#include <fstream>
#include <limits>
#include <system_error>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/exit_code.h"
#include "client/cli/gdal_edge.h"
#include "client/cli/text.h"

namespace fathom::client::cli {
namespace {

// What BAG says for "nothing" (BAG format specification 1.6, NULL_ELEVATION).
constexpr float kBagNodata = 1e6f;

absl::Status Usage(const std::string& message) {
  return UsageError(absl::InvalidArgumentError(message));
}

class StringList {
 public:
  StringList() = default;
  ~StringList() { CSLDestroy(list_); }
  StringList(const StringList&) = delete;
  StringList& operator=(const StringList&) = delete;
  void Add(const std::string& text) {
    list_ = CSLAddString(list_, text.c_str());
  }
  char** get() const { return list_; }

 private:
  char** list_ = nullptr;
};

// Removed when it goes out of scope, with what GDAL put beside it.
class TemporaryFile {
 public:
  // GDAL knows a BAG by its extension alone.
  TemporaryFile(const std::string& final_path, const char* extension)
      : path_(
            absl::StrFormat("%s.%d.part%s", final_path, getpid(), extension)) {}
  ~TemporaryFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
    std::filesystem::remove(path_ + ".aux.xml", ignored);
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  const std::string& path() const { return path_; }

 private:
  const std::string path_;
};

int CPL_STDCALL Progress(double share, const char* /*message*/, void* report) {
  const auto& function =
      *static_cast<const std::function<void(double)>*>(report);
  if (function != nullptr) function(share);
  return TRUE;
}

class Writer {
 public:
  Writer(const ExportInput& input, const ExportOptions& options)
      : region_(input.region),
        layers_(input.layers),
        options_(options),
        bag_(options.format == ExportFormat::kBag),
        nodata_(bag_ ? kBagNodata : std::numeric_limits<float>::quiet_NaN()),
        elevations_(options.format != ExportFormat::kCog) {}

  absl::StatusOr<ExportSummary> Run() {
    FATHOM_RETURN_IF_ERROR(Validate());
    const char* driver_name = bag_                                    ? "BAG"
                              : options_.format == ExportFormat::kCog ? "COG"
                                                                      : "GTiff";
    GDALDriver* driver = GetGDALDriverManager()->GetDriverByName(driver_name);
    if (driver == nullptr || driver->pfnCreateCopy == nullptr) {
      return absl::UnimplementedError(absl::StrFormat(
          "the GDAL installed here writes no %s: use --format tif",
          driver_name));
    }
    FATHOM_ASSIGN_OR_RETURN(DatasetPtr dataset, Fill());
    if (!options_.crs.empty()) {
      FATHOM_ASSIGN_OR_RETURN(dataset, Warp(*dataset));
    }
    const TemporaryFile temporary(options_.path, bag_ ? ".bag" : ".tif");
    FATHOM_RETURN_IF_ERROR(Write(*driver, *dataset, temporary.path()));
    ExportSummary summary;
    summary.driver = driver_name;
    FATHOM_RETURN_IF_ERROR(ReadBack(temporary.path(), *dataset, summary));
    std::error_code error;
    std::filesystem::rename(temporary.path(), options_.path, error);
    if (error) return NotWritable(error.message());
    return summary;
  }

 private:
  absl::Status Validate() const {
    std::error_code error;
    if (const auto type = std::filesystem::status(options_.path, error).type();
        type != std::filesystem::file_type::not_found &&
        type != std::filesystem::file_type::regular) {
      return NotWritable("it is a folder or a device");
    }
    const auto& bands = options_.bands;
    if (bands.size() < 2 || bands[0] != ExportBand::kDepth ||
        bands[1] != ExportBand::kUncertainty) {
      return Usage("bands: must begin with depth,uncertainty");
    }
    if (elevations_ && bands.size() > 2) {
      return Usage(
          "bands: only --format cog holds more than depth and uncertainty");
    }
    for (std::size_t i = 2; i < bands.size(); ++i) {
      if (bands[i] == ExportBand::kLayer &&
          layers_.size() != region_.kind.size()) {
        return absl::InternalError("the layer band came without layers");
      }
    }
    return absl::OkStatus();
  }

  absl::Status NotWritable(const std::string& reason) const {
    return FileError(absl::InvalidArgumentError(absl::StrFormat(
        "%s: cannot be written (%s): choose another place with --out",
        options_.path, reason)));
  }

  bool IsLand(std::size_t i) const {
    return region_.kind[i] == v1::EVIDENCE_KIND_LAND;
  }

  float Value(ExportBand band, std::size_t i) const {
    const auto known = [this](float value) {
      return std::isfinite(value) ? value : nodata_;
    };
    switch (band) {
      case ExportBand::kDepth:
        if (IsLand(i) || !std::isfinite(region_.depth_m[i])) return nodata_;
        return elevations_ ? -region_.depth_m[i] : region_.depth_m[i];
      case ExportBand::kUncertainty:
        if (IsLand(i)) return 0;
        if (!std::isfinite(region_.depth_m[i])) return nodata_;
        return known(region_.std_m[i]);
      case ExportBand::kShoalest:
        return IsLand(i) ? nodata_ : known(region_.shoalest_m[i]);
      case ExportBand::kAge:
        return known(region_.age_s[i]);
      case ExportBand::kLayer:
        return static_cast<float>(layers_[i]);
    }
    return nodata_;
  }

  void Describe(GDALRasterBand& band, ExportBand what) const {
    const auto text = [&](const char* name, const char* long_name,
                          const char* unit) {
      band.SetDescription(name);
      band.SetMetadataItem("long_name", long_name);
      if (*unit != '\0') band.SetUnitType(unit);
    };
    switch (what) {
      case ExportBand::kDepth:
        if (elevations_) {
          text("elevation", "elevation of the sea floor above the datum", "m");
          band.SetMetadataItem("positive", "up");
        } else {
          text("depth", "depth of the sea floor below the datum", "m");
          band.SetMetadataItem("positive", "down");
        }
        break;
      case ExportBand::kUncertainty:
        text("uncertainty",
             "uncertainty of the depth, 1 sigma; 0 where the map marks land",
             "m");
        break;
      case ExportBand::kShoalest:
        text("shoalest", "shoalest depth anywhere in the cell", "m");
        band.SetMetadataItem("positive", "down");
        break;
      case ExportBand::kAge:
        text("age", "age of the newest evidence", "s");
        break;
      case ExportBand::kLayer:
        text("layer", CellLayerLegend(), "");
        break;
    }
    if (what != ExportBand::kLayer) {
      band.SetNoDataValue(static_cast<double>(nodata_));
    }
  }

  absl::StatusOr<DatasetPtr> Fill() const {
    const GdalErrors errors;
    const int columns = static_cast<int>(region_.columns);
    const int rows = static_cast<int>(region_.rows);
    DatasetPtr dataset(GetGDALDriverManager()->GetDriverByName("MEM")->Create(
        "", columns, rows, static_cast<int>(options_.bands.size()), GDT_Float32,
        nullptr));
    if (dataset == nullptr) {
      return absl::ResourceExhaustedError(errors.message());
    }
    double geotransform[6] = {region_.north_west.longitude_deg(),
                              region_.longitude_step_deg,
                              0,
                              region_.north_west.latitude_deg(),
                              0,
                              -region_.latitude_step_deg};
    dataset->SetGeoTransform(geotransform);
    OGRSpatialReference wgs84;
    wgs84.importFromEPSG(4326);
    wgs84.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    dataset->SetSpatialRef(&wgs84);
    if (!bag_) {
      for (const auto& [key, value] : Metadata()) {
        dataset->SetMetadataItem(key.c_str(), value.c_str());
      }
    }
    std::vector<float> line(region_.columns);
    for (std::size_t b = 0; b < options_.bands.size(); ++b) {
      GDALRasterBand& band = *dataset->GetRasterBand(static_cast<int>(b) + 1);
      Describe(band, options_.bands[b]);
      for (std::uint32_t row = 0; row < region_.rows; ++row) {
        for (std::uint32_t column = 0; column < region_.columns; ++column) {
          line[column] = Value(options_.bands[b], region_.Index(row, column));
        }
        if (band.RasterIO(GF_Write, 0, static_cast<int>(row), columns, 1,
                          line.data(), columns, 1, GDT_Float32, 0, 0,
                          nullptr) != CE_None) {
          return absl::InternalError(errors.message());
        }
      }
    }
    return dataset;
  }

  std::string Description() const {
    return absl::StrFormat(
        "Fathom obstacle map of mission %s, revision %d: %s relative to %s; "
        "uncertainty is 1 sigma; land: no depth and uncertainty 0. Not for "
        "navigation.",
        options_.mission, region_.stamp.map_revision(),
        elevations_ ? "elevation (positive up)" : "depth (positive down)",
        options_.vertical_datum.empty() ? "an unnamed datum"
                                        : options_.vertical_datum);
  }

  std::vector<std::pair<std::string, std::string>> Metadata() const {
    return {
        {"AREA_OR_POINT", "Area"},
        {"TIFFTAG_SOFTWARE", "Fathom"},
        {"TIFFTAG_IMAGEDESCRIPTION", Description()},
        {"VERTICAL_DATUM", options_.vertical_datum},
        {"POSITIVE", elevations_ ? "up" : "down"},
        {"UNCERTAINTY", "1 sigma"},
        {"FATHOM_MISSION", options_.mission},
        {"FATHOM_MAP_REVISION",
         absl::StrFormat("%d", region_.stamp.map_revision())},
        {"FATHOM_AS_OF", TimeText(region_.stamp.as_of())},
        {"FATHOM_LAND", "uncertainty=0"},
    };
  }

  absl::StatusOr<DatasetPtr> Warp(GDALDataset& source) const {
    std::string crs = options_.crs;
    if (crs == "utm") {
      const double middle_deg =
          region_.north_west.longitude_deg() +
          region_.longitude_step_deg * region_.columns / 2;
      const double latitude_deg = region_.north_west.latitude_deg() -
                                  region_.latitude_step_deg * region_.rows / 2;
      // Zones of 6 degrees from 180 W, numbered from 1; EPSG 326zz north,
      // 327zz south.
      const double turned =
          middle_deg - 360 * std::floor((middle_deg + 180) / 360);
      const int zone = static_cast<int>(std::floor((turned + 180) / 6)) + 1;
      crs =
          absl::StrFormat("EPSG:%d", (latitude_deg < 0 ? 32700 : 32600) + zone);
    }
    const GdalErrors errors;
    OGRSpatialReference target;
    if (target.SetFromUserInput(crs.c_str()) != OGRERR_NONE) {
      return Usage(absl::StrFormat(
          "crs=\"%s\": not a coordinate reference system; say for example "
          "EPSG:32619, or utm",
          options_.crs));
    }
    StringList arguments;
    for (const std::string& word :
         {std::string("-of"), std::string("MEM"), std::string("-t_srs"), crs,
          std::string("-r"), std::string("near")}) {
      arguments.Add(word);
    }
    if (target.IsProjected() && options_.resolution_m > 0) {
      const std::string step = absl::StrFormat(
          "%.10g", options_.resolution_m / target.GetLinearUnits());
      for (const std::string& word : {std::string("-tr"), step, step}) {
        arguments.Add(word);
      }
    }
    GDALWarpAppOptions* warp_options =
        GDALWarpAppOptionsNew(arguments.get(), nullptr);
    GDALDatasetH sources[] = {GDALDataset::ToHandle(&source)};
    int usage_error = FALSE;
    DatasetPtr warped(GDALDataset::FromHandle(
        GDALWarp("", nullptr, 1, sources, warp_options, &usage_error)));
    GDALWarpAppOptionsFree(warp_options);
    if (warped == nullptr) {
      return Usage(
          absl::StrFormat("crs=\"%s\": this area cannot be shown in it (%s)",
                          options_.crs, errors.message()));
    }
    // The warper leaves names and units behind.
    for (int b = 1; b <= warped->GetRasterCount(); ++b) {
      Describe(*warped->GetRasterBand(b),
               options_.bands[static_cast<std::size_t>(b) - 1]);
    }
    return warped;
  }

  absl::Status Write(GDALDriver& driver, GDALDataset& dataset,
                     const std::string& path) const {
    StringList creation;
    if (bag_) {
      const std::string datum =
          options_.vertical_datum.empty() ? "unknown" : options_.vertical_datum;
      creation.Add("VAR_ABSTRACT=" + Description());
      creation.Add("VAR_VERTICAL_UNCERT_CODE=rawStdDev");
      creation.Add("VAR_PROCESS_STEP_DESCRIPTION=fathom export");
      creation.Add(
          absl::StrFormat("VAR_VERT_WKT=VERT_CS[\"%s\",VERT_DATUM[\"%s\","
                          "2000]]",
                          datum, datum));
    } else {
      creation.Add("COMPRESS=DEFLATE");
      creation.Add("BIGTIFF=IF_SAFER");
      if (options_.format == ExportFormat::kCog) {
        creation.Add("PREDICTOR=FLOATING_POINT");
        // Overviews for looking from afar; an average would invent depths.
        creation.Add("OVERVIEW_RESAMPLING=NEAREST");
      } else {
        creation.Add("PREDICTOR=3");
        creation.Add("TILED=YES");
      }
    }
    // HDF5 does not survive a disk that is full: a BAG is built in memory.
    const std::string target = bag_ ? "/vsimem/fathom_export.bag" : path;
    const GdalErrors errors;
    {
      const DatasetPtr copy(driver.CreateCopy(
          target.c_str(), &dataset, FALSE, creation.get(), &Progress,
          const_cast<std::function<void(double)>*>(&options_.progress)));
      if (copy == nullptr) return NotWritable(errors.message());
    }
    // Closing flushes; that fails on a full disk.
    if (errors.failed()) return NotWritable(errors.message());
    return bag_ ? MoveFromMemory(target, path) : absl::OkStatus();
  }

  absl::Status MoveFromMemory(const std::string& from,
                              const std::string& to) const {
    vsi_l_offset bytes = 0;
    GByte* const content = VSIGetMemFileBuffer(from.c_str(), &bytes, TRUE);
    std::ofstream out(to, std::ios::binary | std::ios::trunc);
    out.write(reinterpret_cast<const char*>(content),
              static_cast<std::streamsize>(bytes));
    out.close();
    const bool written = content != nullptr && out.good();
    CPLFree(content);
    if (written) return absl::OkStatus();
    return NotWritable(std::generic_category().message(errno));
  }

  absl::Status ReadBack(const std::string& path, GDALDataset& written,
                        ExportSummary& summary) const {
    const GdalErrors errors;
    const DatasetPtr dataset(
        GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY));
    if (dataset == nullptr ||
        dataset->GetRasterXSize() != written.GetRasterXSize() ||
        dataset->GetRasterYSize() != written.GetRasterYSize() ||
        dataset->GetRasterCount() < written.GetRasterCount()) {
      return FileError(absl::DataLossError(absl::StrFormat(
          "%s: could not be read back after writing (%s): is the disk full?",
          options_.path, errors.message())));
    }
    summary.columns = dataset->GetRasterXSize();
    summary.rows = dataset->GetRasterYSize();
    if (const OGRSpatialReference* reference = dataset->GetSpatialRef()) {
      if (const char* name = reference->GetName()) summary.crs = name;
    }
    std::error_code error;
    const std::uintmax_t bytes = std::filesystem::file_size(path, error);
    if (!error) summary.file_bytes = bytes;
    return absl::OkStatus();
  }

  const Region& region_;
  const std::vector<CellLayer>& layers_;
  const ExportOptions& options_;
  const bool bag_;
  const float nodata_;
  // Positive up, as BAG has it.
  const bool elevations_;
};

}  // namespace

const char* BandName(ExportBand band) {
  switch (band) {
    case ExportBand::kDepth:
      return "depth";
    case ExportBand::kUncertainty:
      return "uncertainty";
    case ExportBand::kShoalest:
      return "shoalest";
    case ExportBand::kAge:
      return "age";
    case ExportBand::kLayer:
      return "layer";
  }
  return "";
}

absl::StatusOr<ExportSummary> WriteRaster(const ExportInput& input,
                                          const ExportOptions& options) {
  try {
    GDALAllRegister();
    return Writer(input, options).Run();
  } catch (const std::exception& error) {
    return absl::ResourceExhaustedError(
        absl::StrFormat("%s: %s", options.path, error.what()));
  }
}

}  // namespace fathom::client::cli
