// Opens the file of a chart, whatever the container: plain rasters,
// variable-resolution BAGs at their finest grid, topotypes. GDAL side of
// raster.h. Thread safety: one thread at a time.

#ifndef FATHOM_CLIENT_CLI_RASTER_OPEN_H_
#define FATHOM_CLIENT_CLI_RASTER_OPEN_H_

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cli/gdal_edge.h"
#include "client/cli/raster.h"

namespace fathom::client::cli {

// GDAL's cache of decoded blocks, bytes: the strips under one row of tiles
// (256 rows) of a raster 100 000 cells wide fit.
inline constexpr GIntBig kGdalCacheBytes = 256 << 20;

// The raster with at least one band. Adds remarks on what was chosen. Errors
// as DepthRaster::Open, marked as the file's.
absl::StatusOr<DatasetPtr> OpenChart(const RasterOptions& options,
                                     std::vector<std::string>& remarks);

// The XML inside a BAG; "" for other formats.
std::string BagXml(GDALDataset& dataset);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_RASTER_OPEN_H_
