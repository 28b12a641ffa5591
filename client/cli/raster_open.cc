#include "client/cli/raster_open.h"

#include <cstring>
#include <utility>

#include "absl/strings/str_format.h"
#include "client/cli/exit_code.h"
#include "client/cli/topotype.h"

namespace fathom::client::cli {
namespace {

DatasetPtr OpenDataset(const std::string& path,
                       const char* const* open_options = nullptr) {
  return DatasetPtr(GDALDataset::Open(
      path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR,
      nullptr, open_options, nullptr));
}

// A container without a band of its own: which one is meant?
absl::Status ManyInside(const std::string& path, GDALDataset& dataset) {
  std::string names;
  char** items = dataset.GetMetadata("SUBDATASETS");
  for (int i = 0; items != nullptr && items[i] != nullptr; ++i) {
    const std::string item = items[i];
    const std::size_t at = item.find("_NAME=");
    if (at != std::string::npos) names += "\n  " + item.substr(at + 6);
  }
  if (!names.empty()) {
    return FileError(absl::InvalidArgumentError(
        path + ": holds several rasters; name one of them instead:" + names));
  }
  // S-102 is HDF5 of compounds: GDAL before 3.8 shows no band of it.
  const std::string driver = dataset.GetDriver()->GetDescription();
  return FileError(absl::InvalidArgumentError(absl::StrFormat(
      "%s: holds no raster that GDAL %s can read (%s%s): turn it into a "
      "GeoTIFF or BAG with newer tools first",
      path, GDALVersionInfo("RELEASE_NAME"), driver,
      driver == "HDF5" ? "; S-102 needs GDAL 3.8" : "")));
}

// GDAL 3.6 does not flag every variable-resolution BAG; the list of its
// refined grids tells for sure.
bool HasSupergrids(GDALDataset& dataset, const std::string& path) {
  const char* has = dataset.GetMetadataItem("HAS_SUPERGRIDS");
  if (has != nullptr && std::strcmp(has, "TRUE") == 0) return true;
  if (std::strcmp(dataset.GetDriver()->GetDescription(), "BAG") != 0) {
    return false;
  }
  const GdalErrors ignored;
  const char* const kList[] = {"MODE=LIST_SUPERGRIDS", nullptr};
  const DatasetPtr list = OpenDataset(path, kList);
  return list != nullptr && list->GetMetadata("SUBDATASETS") != nullptr;
}

}  // namespace

absl::StatusOr<DatasetPtr> OpenChart(const RasterOptions& options,
                                     std::vector<std::string>& remarks) {
  GDALAllRegister();
  GDALSetCacheMax64(kGdalCacheBytes);
  const GdalErrors errors;
  DatasetPtr dataset = OpenDataset(options.path);
  if (dataset == nullptr) {
    absl::StatusOr<DatasetPtr> topotype = OpenTopotype(options.path);
    if (topotype.ok()) {
      remarks.emplace_back("read as GeoClaw topotype 2 or 3");
      return topotype;
    }
    if (!absl::IsNotFound(topotype.status())) {
      return FileError(absl::Status(
          topotype.status().code(),
          absl::StrFormat("%s: %s", options.path,
                          std::string(topotype.status().message()))));
    }
    return FileError(absl::NotFoundError(
        absl::StrFormat("%s: not a raster that GDAL can open (%s)",
                        options.path, errors.message())));
  }
  if (dataset->GetRasterCount() == 0) return ManyInside(options.path, *dataset);
  if (!HasSupergrids(*dataset, options.path)) return dataset;
  if (options.overview_grid) {
    remarks.emplace_back(
        "variable-resolution BAG: only its overview grid was read, which may "
        "hide rocks");
    return dataset;
  }
  // The plain grid of a variable-resolution BAG is an overview that hides
  // rocks: take the finest grid, and in it the shoalest of each cell.
  const char* const kFinest[] = {"MODE=RESAMPLED_GRID", "RES_STRATEGY=MIN",
                                 "VALUE_POPULATION=MAX", nullptr};
  dataset = OpenDataset(options.path, kFinest);
  if (dataset == nullptr) {
    return FileError(absl::DataLossError(absl::StrFormat(
        "%s: its variable-resolution grids are damaged (%s): --bag-overview "
        "reads the coarse grid alone, which may hide rocks",
        options.path, errors.message())));
  }
  remarks.emplace_back(
      "variable-resolution BAG: read at its finest resolution, the shoalest "
      "node of each cell");
  return dataset;
}

std::string BagXml(GDALDataset& dataset) {
  char** xml = dataset.GetMetadata("xml:BAG");
  return xml == nullptr || xml[0] == nullptr ? "" : xml[0];
}

}  // namespace fathom::client::cli
