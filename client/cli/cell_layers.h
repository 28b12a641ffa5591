// What stands behind each cell of a region, as one small number: for the
// layer picture and the layer band of an export. Thread-safe.

#ifndef FATHOM_CLIENT_CLI_CELL_LAYERS_H_
#define FATHOM_CLIENT_CLI_CELL_LAYERS_H_

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "client/client.h"
#include "client/region.h"
#include "fathom/v1/mission_service.pb.h"
#include "fathom/v1/obstacle_service.pb.h"

namespace fathom::client::cli {

// The numbers are written into files: never change one.
enum class CellLayer : std::uint8_t {
  kUnknown = 0,
  // A chart or a default depth.
  kPrior = 1,
  // Estimated from measured neighbours.
  kSmoothed = 2,
  // Measured, in the global map.
  kGlobal = 3,
  kLand = 4,
  // Measured, in an open activity's local map.
  kLocal = 5,
};

// One per cell of `joined`. `local` is the same region of the local layer
// alone, or null where no activity is open; of another size it is ignored.
std::vector<CellLayer> CellLayers(const Region& joined, const Region* local);

// As above; asks the server for the local layer if an activity is open.
absl::StatusOr<std::vector<CellLayer>> FetchCellLayers(
    const Client& client, const v1::GetMissionStatusResponse& status,
    const v1::GetRegionRequest& request, const Region& joined);

// "0 unknown, 1 prior, ...".
const char* CellLayerLegend();

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_CELL_LAYERS_H_
