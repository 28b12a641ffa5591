// GlobalMap: the writer of the coarse map of the whole mission area, a quadtree
// over a square on the Earth (Nervegna 2002, section 4.4).
//
// Invariants
//   1. The leaves cover the root square exactly, disjointly.
//   2. A leaf is unknown, prior, measured or land; unknown is never dressed up
//      as a number, and a chart never replaces a measurement.
//   3. At most max_cells leaves (unknown ones count): when a division would
//      pass the bound the coarser leaf is updated instead (fig. 4-15, lines
//      11-13) and the summary counts it.
//   4. Every mean that Conglomerate() replaced lies within tolerance_m of the
//      mean that replaced it, however often merging ran (rule kRange).
//   5. Two surveys (MergeArea) of unknown ground with cells of one size give
//   the
//      same leaves in either order, bit for bit, as long as Conglomerate() has
//      not joined one of them in between; over a chart they differ by code
//      steps (map/global/fuse.h).
//   6. The same calls in the same order give bit-identical leaves, whether or
//      not views were taken, or the map was stored and restored, in between.
//
// Working form: immutable tiles are expanded into dense ones of 64 x 64
// positions when they are first written, edited in place for the whole batch,
// and frozen by View(). A tile whose content ended as it began keeps its
// identity. So a batch costs what it touches, and never a tile per leaf.
//
// Departures from the thesis, reasons in docs/adr/0002 and domain.md, section
// 5: transfer visits global cells, not local midpoints (no pinholes); only
// evidence is transferred (a prior counts once); angles replace planes; merged
// means are bounded.
//
// Thread safety: one thread at a time; the views are free.

#ifndef FATHOM_MAP_GLOBAL_GLOBAL_MAP_H_
#define FATHOM_MAP_GLOBAL_GLOBAL_MAP_H_

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "map/geodesy/depth_estimate.h"
#include "map/geodesy/points.h"
#include "map/global/global_map_view.h"
#include "map/global/raster_block.h"
#include "map/global/root_square.h"
#include "map/global/tile.h"
#include "map/global/tile_memory.h"

namespace fathom::map {

class WorkTree;

struct GlobalMapOptions {
  RootSquare root;
  // 50 M leaves are 600 MB at most: what a vehicle's small computer can give.
  std::uint64_t max_cells = 50'000'000;
  // How far a merged mean may be from what it replaced, metres, > 0. Part of
  // the stored map: a map is opened with the tolerance it was made with.
  double tolerance_m = 0.5;
  // What its tiles may take unpacked; not part of the stored map.
  TileMemoryOptions memory = {};

  // Errors: INVALID_ARGUMENT: max_cells of 0, a tolerance that is not finite
  // and > 0, or a root that was not Create()d.
  absl::Status Validate() const;
};

// Which leaves Conglomerate() joins.
enum class MergeRule {
  // Four sibling leaves of one kind become one if every fine mean that they
  // stand for lies within tolerance_m of the middle of their range, which
  // becomes the mean. Std by moments about it: mean variance plus mean squared
  // distance; and only if no answer becomes FREE more than tolerance_m deeper
  // than the part's was. The default: fewer leaves and a bound (invariant 4).
  kRange,
  // Fig. 4-18 as printed: four siblings whose means agree pairwise within
  // tolerance_m become one with the average mean and the average std. The
  // error grows with every round. For comparison with the thesis only.
  kPairwise,
};

class GlobalMap {
 public:
  // What one writing call did.
  struct WriteSummary {
    // Updates of a leaf with evidence or a chart.
    std::uint64_t leaves_written = 0;
    // Fine cells whose evidence went to a coarser leaf, max_cells being
    // reached. Each such coarser leaf got one update a call, of all of them.
    std::uint64_t degraded = 0;
    // Chart cells that met a measured leaf and left it alone.
    std::uint64_t kept_measured = 0;
    // Answers of the source that were no measurement or not a valid number.
    std::uint64_t ignored = 0;
  };

  // What ImportRaster did; cells_* count the chart's cells.
  struct ImportSummary {
    std::uint64_t cells_with_depth = 0;
    std::uint64_t cells_land = 0;
    std::uint64_t cells_unknown = 0;
    std::uint64_t cells_outside = 0;  // Also counted by what they hold.
    std::uint64_t leaves_written = 0;
    std::uint64_t degraded = 0;       // As WriteSummary.
    std::uint64_t kept_measured = 0;  // As WriteSummary.
  };

  struct ConglomerateSummary {
    std::uint64_t leaves_before = 0;
    std::uint64_t leaves_after = 0;
    std::uint64_t merges = 0;  // Four leaves into one.
  };

  // Evidence at a point, from measurements alone (the prior that a local map
  // was loaded with left out); nullopt where there is none.
  using CellSource =
      std::function<std::optional<DepthEstimate>(const GeodeticPoint& point)>;

  // An empty map: one unknown leaf. REQUIRES: options.Validate() is OK.
  explicit GlobalMap(const GlobalMapOptions& options);
  GlobalMap(GlobalMap&&) noexcept;
  GlobalMap& operator=(GlobalMap&&) noexcept;
  ~GlobalMap();

  // Transfers the evidence of one area (section 4.4.4). `corners` are those of
  // a convex quadrilateral: south-west, north-west, north-east, south-east.
  //
  // Every global cell of the level that matches `cell_size_m` (the coarsest
  // with cells not larger, at most max_level; deeper where the map already is)
  // whose middle lies in the area is offered to `source`; where it answers,
  // the leaf is divided down to the cell, its value inherited, and fused
  //   with an unknown or land leaf: takes the evidence;
  //   with a prior one: 4.17, 4.18, 4.20, the prior widened where it is
  //     contradicted (FusePrior);
  //   with a measured one: the same as independent; only std^2 - variability^2
  //     shrinks, disagreement widens (map/global/fuse.h states the rule).
  // A hazard stays: of two the shoalest.
  // Areas that share a side with bit-identical corners share no cell and leave
  // none out, so an area may be cut into blocks in any way.
  //
  // Where max_level bounds the level, a cell is larger than `cell_size_m`: the
  // source is then asked at a grid of points over the cell, so close that no
  // local cell is missed (at most kMaxSamplesPerSide squared), and the answers
  // count as one evidence by moments, with a hazard where one of them is a
  // shoal (map/global/fuse.h). Blocks should be no smaller than a global cell.
  //
  // Only answers of kind kMeasured with a finite depth and std > 0 count.
  // Cells outside the root square are left out. REQUIRES: cell_size_m > 0.
  // About 0.5 us a cell and the source.
  WriteSummary MergeArea(const std::array<GeodeticPoint, 4>& corners,
                         double cell_size_m, const CellSource& source);

  // The other half of MergeArea where global cells are larger than local ones:
  // for areas beside measured ones, with cells that have their middle here and
  // reach over there. Too little of such a cell was seen for a mean; but if its
  // leaf is known, and its answers would be FREE at the shoalest of what was
  // seen, that becomes its hazard. Writes nothing where cells are not larger.
  WriteSummary MergeShoals(const std::array<GeodeticPoint, 4>& corners,
                           double cell_size_m, const CellSource& source);

  // Loads a block of a chart (section 4.4.3): leaves of kind prior or land, of
  // the coarsest level whose cells are not larger than the chart's (at most
  // max_level; a leaf larger than the chart's cells joins them by moments, and
  // is land if any of them is). A leaf belongs to the block that holds its
  // middle. Cells without a value touch nothing. Against earlier charts:
  // replaced if block.replace; else depths are fused as independent (4.18,
  // 4.20) and land stays land. Measured leaves stay as they are, undivided.
  // Errors: INVALID_ARGUMENT (see ValidateRaster), nothing changed.
  // About 0.3 us a leaf.
  absl::StatusOr<ImportSummary> ImportRaster(const RasterBlock& block);

  // How MergeMap takes what another map holds.
  struct MapMergeOptions {
    // Variance that a depth gains for each second of its evidence's age at
    // `now_s`, m^2/s, >= 0.
    double widening_m2_s = 0;
    // Unix seconds; the second stands for times that are not known.
    std::uint32_t now_s = 0;
    std::uint32_t unknown_time_s = 0;
    // Whether its measured leaves come as charted ones.
    bool as_chart = false;
  };

  // Takes over what another mission's map holds. But for a chart it is evidence
  // of its own: it must share none with this map. Measured leaves are fused as
  // in MergeArea; charted ones fill only what is unknown here, for both may
  // come from one chart (land also replaces charted depths). Times, hazards and
  // residuals stay. In the same square (bit-identical corners) leaves meet
  // leaves: into an empty map with as fine cells the same leaves come, bit for
  // bit. In another square each cell of ours takes four or more points' answers
  // by moments, so that no leaf is missed; a shore in a measured cell is a
  // hazard. What lies outside our square is left out. If `degraded` is not 0
  // the map is to be thrown away: max_cells was reached.
  WriteSummary MergeMap(const GlobalMapView& other,
                        const MapMergeOptions& options);

  // Merges siblings that agree, from the leaves up, over the whole map (fig.
  // 4-18); tiles that did not change since the last time are not opened.
  // Kinds never mix: unknown merges with unknown, land with land; nor do leaves
  // with a point hazard and such without (the shoalest hazard stays). A merged
  // leaf's time is the oldest of the four (0 if any is 0).
  //
  // Nothing is joined that touches one of `kept`: where evidence is still to
  // come, so that it meets the leaves as they were measured and the order in
  // which surveys arrive does not matter (a joined mean is up to tolerance_m
  // off the means that it replaced).
  ConglomerateSummary Conglomerate(MergeRule rule = MergeRule::kRange,
                                   std::span<const LatticeBox> kept = {});

  // Freezes what was written, packs tiles if the budget of
  // GlobalMapOptions::memory is passed, and returns the map as it is now.
  // O(what was written or unpacked since the last call).
  GlobalMapView View();

  // Freezes what was written. Leaves that hold a value.
  std::uint64_t CountKnownLeaves();

  // Whether readers have unpacked so much that View should be called for that
  // alone, so that tiles are packed.
  bool over_budget() const;

  // Leaves now, unknown ones too.
  std::uint64_t leaf_count() const;

  const GlobalMapOptions& options() const { return options_; }

  // Restoring a stored map: give every tile, in any order, then FinishRestore,
  // before any other call.
  // Errors: DATA_LOSS: a bad key or content (see ValidateContent), or a key
  // given twice.
  absl::Status RestoreTile(const TileKey& key, TileContent content);
  // The same for one made elsewhere, with this map's max_level and tolerance_m.
  absl::Status RestoreTile(RestoredTile tile);
  // Errors: DATA_LOSS: a tile is missing or hangs on none. The map is then
  // empty. OK without any tile: an empty map.
  absl::Status FinishRestore();

  // Samples along a side of a cell that is larger than the local ones. Local
  // cells of less than 1/32 of a global one are not all asked: they would let a
  // 0.1 m map stall the transfer.
  static constexpr int kMaxSamplesPerSide = 32;

 private:
  WriteSummary WriteEvidence(const std::array<GeodeticPoint, 4>& corners,
                             double cell_size_m, const CellSource& source,
                             bool shoals_only);

  GlobalMapOptions options_;
  std::unique_ptr<WorkTree> tree_;
  // That of the views from now on.
  std::shared_ptr<const TileGuard> guard_;
  std::map<TileKey, RestoredTile> restored_;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_GLOBAL_GLOBAL_MAP_H_
