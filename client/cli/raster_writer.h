// The map out: a region as a raster file that other programs open.
//
// Formats and their bands:
//   kCog   Cloud Optimized GeoTIFF (GDAL's COG driver): depth in metres below
//          the datum, positive down; uncertainty, 1 sigma metres; and any of
//          shoalest, age (seconds), layer (CellLayer). Unknown is NaN.
//   kTif   GeoTIFF laid out as a BAG: elevation (positive up), uncertainty.
//   kBag   Bathymetric Attributed Grid: elevation, uncertainty; unknown is
//          1e6, as the format says.
// Land: the depth (or elevation) is nodata and the uncertainty is 0, which no
// known cell has; so no program takes land for a depth, and `fathom prior
// import` reads it as land again.
//
// Sign, unit, sigma, datum and the map's revision stand in the metadata. The
// file is written beside its place under another name, read back and then
// renamed, so that a reader never sees half a file and an error leaves what
// was there.
//
// Memory: the region once more (bands are filled in memory), a BAG also itself.
//
// Thread safety: one thread at a time.

#ifndef FATHOM_CLIENT_CLI_RASTER_WRITER_H_
#define FATHOM_CLIENT_CLI_RASTER_WRITER_H_

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cli/cell_layers.h"
#include "client/region.h"

namespace fathom::client::cli {

enum class ExportFormat { kCog, kBag, kTif };
enum class ExportBand { kDepth, kUncertainty, kShoalest, kAge, kLayer };

// "depth", "uncertainty", ...
const char* BandName(ExportBand band);

struct ExportOptions {
  std::string path;
  ExportFormat format = ExportFormat::kCog;
  // The first two are depth and uncertainty; others only with kCog.
  std::vector<ExportBand> bands = {ExportBand::kDepth,
                                   ExportBand::kUncertainty};
  // "": WGS 84 latitude and longitude, cell for cell. Else warped, each cell
  // taking its nearest one's values: no value is mixed. "utm": WGS 84 UTM in
  // the zone of the middle.
  std::string crs = "";
  // Side of a cell in `crs`, metres, if that is projected.
  double resolution_m = 0;
  // For the metadata.
  std::string mission = "";
  std::string vertical_datum = "";
  // Told the share done, 0 to 1.
  std::function<void(double)> progress = nullptr;
};

// Region and, for ExportBand::kLayer, its layers.
struct ExportInput {
  const Region& region;
  std::vector<CellLayer> layers = {};
};

struct ExportSummary {
  std::string driver;
  std::string crs;
  int columns = 0;
  int rows = 0;
  std::uint64_t file_bytes = 0;
};

// Errors: INVALID_ARGUMENT (bands or crs that do not do; marked as the
// user's; or a place that cannot be written, marked as the file's);
// UNIMPLEMENTED (this GDAL cannot write the format); DATA_LOSS (written but
// not readable again: disk full).
absl::StatusOr<ExportSummary> WriteRaster(const ExportInput& input,
                                          const ExportOptions& options);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_RASTER_WRITER_H_
