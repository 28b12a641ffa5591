#include "client/cli/cell_layers.h"

#include <algorithm>

#include "base/status_macros.h"

namespace fathom::client::cli {

std::vector<CellLayer> CellLayers(const Region& joined, const Region* local) {
  if (local != nullptr && local->kind.size() != joined.kind.size()) {
    local = nullptr;
  }
  std::vector<CellLayer> layers(joined.kind.size());
  for (std::size_t i = 0; i < layers.size(); ++i) {
    switch (joined.kind[i]) {
      case v1::EVIDENCE_KIND_PRIOR:
        layers[i] = CellLayer::kPrior;
        break;
      case v1::EVIDENCE_KIND_SMOOTHED:
        layers[i] = CellLayer::kSmoothed;
        break;
      case v1::EVIDENCE_KIND_LAND:
        layers[i] = CellLayer::kLand;
        break;
      case v1::EVIDENCE_KIND_MEASURED:
        layers[i] =
            local != nullptr && local->kind[i] == v1::EVIDENCE_KIND_MEASURED
                ? CellLayer::kLocal
                : CellLayer::kGlobal;
        break;
      default:
        layers[i] = CellLayer::kUnknown;
    }
  }
  return layers;
}

absl::StatusOr<std::vector<CellLayer>> FetchCellLayers(
    const Client& client, const v1::GetMissionStatusResponse& status,
    const v1::GetRegionRequest& request, const Region& joined) {
  const bool open = std::any_of(
      status.activities().begin(), status.activities().end(),
      [](const v1::ActivityStatus& activity) { return activity.open(); });
  if (!open) return CellLayers(joined, nullptr);
  v1::GetRegionRequest local_request = request;
  local_request.set_layer(v1::MAP_LAYER_LOCAL);
  FATHOM_ASSIGN_OR_RETURN(const Region local, client.GetRegion(local_request));
  return CellLayers(joined, &local);
}

const char* CellLayerLegend() {
  return "0 unknown, 1 prior, 2 smoothed, 3 measured (global map), 4 land, "
         "5 measured (local map)";
}

}  // namespace fathom::client::cli
