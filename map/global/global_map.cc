#include "map/global/global_map.h"

#include <bit>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "map/global/conglomerate.h"
#include "map/global/work_tree.h"

namespace fathom::map {

absl::Status GlobalMapOptions::Validate() const {
  if (max_cells == 0) {
    return absl::InvalidArgumentError("max_cells=0 must be at least 1");
  }
  if (!std::isfinite(tolerance_m) || tolerance_m <= 0) {
    return absl::InvalidArgumentError(
        absl::StrFormat("tolerance_m=%g must be finite and > 0", tolerance_m));
  }
  if (root.cell_size_m(0) <= 0) {
    return absl::InvalidArgumentError("the root square was not created");
  }
  return absl::OkStatus();
}

GlobalMap::GlobalMap(const GlobalMapOptions& options)
    : options_(options),
      tree_(std::make_unique<WorkTree>(
          std::make_shared<TileMemory>(options.memory,
                                       static_cast<float>(options.tolerance_m)),
          nullptr, TileLadder(options.root.max_level()), options.max_cells,
          static_cast<float>(options.tolerance_m))),
      guard_(std::make_shared<const TileGuard>(tree_->memory())) {}

GlobalMap::GlobalMap(GlobalMap&&) noexcept = default;
GlobalMap& GlobalMap::operator=(GlobalMap&&) noexcept = default;
GlobalMap::~GlobalMap() = default;

GlobalMap::ConglomerateSummary GlobalMap::Conglomerate(
    MergeRule rule, std::span<const LatticeBox> kept) {
  ConglomerateSummary summary;
  summary.leaves_before = tree_->leaf_count();
  summary.merges = ConglomerateTree(*tree_, rule, kept);
  summary.leaves_after = tree_->leaf_count();
  return summary;
}

GlobalMapView GlobalMap::View() {
  const std::shared_ptr<const TileSlot>& root = tree_->Freeze();
  if (tree_->memory()->Evict()) {
    guard_ = std::make_shared<const TileGuard>(tree_->memory());
  }
  return GlobalMapView(options_.root, root, guard_, tree_->tolerance_m());
}

std::uint64_t GlobalMap::CountKnownLeaves() {
  return tree_->Freeze()->totals().known_leaves;
}

bool GlobalMap::over_budget() const { return tree_->memory()->over_budget(); }

std::uint64_t GlobalMap::leaf_count() const { return tree_->leaf_count(); }

absl::Status GlobalMap::RestoreTile(const TileKey& key, TileContent content) {
  FATHOM_ASSIGN_OR_RETURN(
      RestoredTile tile,
      RestoredTile::Make(key, std::move(content), options_.root.max_level(),
                         tree_->tolerance_m()));
  return RestoreTile(std::move(tile));
}

absl::Status GlobalMap::RestoreTile(RestoredTile tile) {
  const TileKey key = tile.key;
  if (!restored_.emplace(key, std::move(tile)).second) {
    return absl::DataLossError(
        absl::StrFormat("tile level=%d row=%d col=%d is given twice", key.level,
                        key.row, key.col));
  }
  return absl::OkStatus();
}

absl::Status GlobalMap::FinishRestore() {
  std::map<TileKey, RestoredTile> restored = std::move(restored_);
  restored_.clear();
  if (restored.empty()) return absl::OkStatus();
  // Keys are ordered by level first: backwards is children before parents.
  std::map<TileKey, std::shared_ptr<const TileSlot>> built;
  const auto& memory = tree_->memory();
  for (auto it = restored.rbegin(); it != restored.rend(); ++it) {
    const TileKey& key = it->first;
    RestoredTile& tile = it->second;
    if (!tile.packed.empty()) {
      built.emplace(key, std::make_shared<const TileSlot>(
                             memory, key, tile.totals, std::move(tile.packed)));
      continue;
    }
    if (tile.tile != nullptr) {
      built.emplace(
          key, std::make_shared<const TileSlot>(memory, std::move(tile.tile)));
      continue;
    }
    const TileContent& content = tile.content;
    std::vector<std::shared_ptr<const TileSlot>> children;
    std::uint32_t position = 0;
    for (std::size_t i = 0; i < content.levels.size(); ++i) {
      if (content.std_codes[i] == kChildCode) {
        const CellKey cell = CellInTile(key, position, content.levels[i]);
        const auto child = built.find(
            TileKey{.level = cell.level, .row = cell.row, .col = cell.col});
        if (child == built.end()) {
          return absl::DataLossError(
              absl::StrFormat("tile level=%d row=%d col=%d is missing",
                              cell.level, cell.row, cell.col));
        }
        children.push_back(std::move(child->second));
        built.erase(child);
      }
      position += SpanOf(content.levels[i]);
    }
    built.emplace(
        key, std::make_shared<const TileSlot>(
                 memory, Tile::FromContent(key, content, std::move(children),
                                           tree_->tolerance_m())));
  }
  const auto root = built.find(TileKey{});
  if (root == built.end()) {
    return absl::DataLossError("the root tile is missing (level=0)");
  }
  if (built.size() != 1) {
    const TileKey& key = built.rbegin()->first;
    return absl::DataLossError(
        absl::StrFormat("tile level=%d row=%d col=%d hangs on no tile",
                        key.level, key.row, key.col));
  }
  *tree_ = WorkTree(memory, std::move(root->second), tree_->ladder(),
                    options_.max_cells, tree_->tolerance_m());
  return absl::OkStatus();
}

}  // namespace fathom::map
