// GeoClaw's topography files (topotypes 2 and 3), which GDAL does not know:
// a header of six lines "value name" (or "name value"), then the values from
// the north-west corner eastwards, row by row, one to a line or one row to a
// line (clawpack.org, "Topography data file formats").
//
// xlower / ylower and xllcenter / yllcenter are the place of the south-western
// value; xllcorner / yllcorner the corner of its cell, half a cell away. The
// format names no coordinate reference system.
//
// Thread safety: as raster.h.

#ifndef FATHOM_CLIENT_CLI_TOPOTYPE_H_
#define FATHOM_CLIENT_CLI_TOPOTYPE_H_

#include <string>

#include "absl/status/statusor.h"
#include "client/cli/gdal_edge.h"

namespace fathom::client::cli {

// Most cells: they are held in memory, 4 bytes each.
inline constexpr double kMaxTopotypeCells = 100e6;

// The file as a raster in memory. Errors: NOT_FOUND (it has no such header:
// another format); DATA_LOSS (values are missing, or no numbers);
// RESOURCE_EXHAUSTED (above kMaxTopotypeCells).
absl::StatusOr<DatasetPtr> OpenTopotype(const std::string& path);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_TOPOTYPE_H_
