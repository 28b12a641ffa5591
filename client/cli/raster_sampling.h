// The depths of a chart at the cells of a region, for comparing the two.
// Thread safety: as the raster.

#ifndef FATHOM_CLIENT_CLI_RASTER_SAMPLING_H_
#define FATHOM_CLIENT_CLI_RASTER_SAMPLING_H_

#include <vector>

#include "absl/status/statusor.h"
#include "client/cli/raster.h"
#include "client/region.h"

namespace fathom::client::cli {

// At the middle of each cell of `region` the depth of the raster's cell there,
// metres; NaN: outside, land or unknown. Reads the raster once, in blocks.
// Errors: as DepthRaster::Read.
absl::StatusOr<std::vector<float>> DepthsAt(DepthRaster& raster,
                                            const Region& region);

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_RASTER_SAMPLING_H_
