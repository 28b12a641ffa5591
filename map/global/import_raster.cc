// GlobalMap::ImportRaster: the a-priori load, and the checks of a chart block.

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "map/global/area_writer.h"
#include "map/global/global_map.h"

namespace fathom::map {
namespace {

// Degrees eastward from `from` to `to`, in [0, 360).
double EastwardDeg(double from, double to) {
  const double difference = to - from;
  if (difference >= 0 && difference < 360) return difference;
  const double turn = std::fmod(difference, 360.0);
  return turn < 0 ? turn + 360.0 : turn;
}

// A chart block as a function of position. A cell holds its northern and
// western side.
class Raster {
 public:
  explicit Raster(const RasterBlock& block) : block_(block) {}

  // Index of the cell that holds the point; nullopt outside.
  std::optional<std::size_t> CellAt(const GeodeticPoint& point) const {
    const double row =
        std::floor((block_.north_west.latitude_deg - point.latitude_deg) /
                   block_.latitude_step_deg);
    const double col = std::floor(
        EastwardDeg(block_.north_west.longitude_deg, point.longitude_deg) /
        block_.longitude_step_deg);
    if (!(row >= 0 && row < block_.rows && col < block_.columns)) {
      return std::nullopt;
    }
    return static_cast<std::size_t>(row) * block_.columns +
           static_cast<std::size_t>(col);
  }

  GeodeticPoint CenterOf(std::uint32_t row, std::uint32_t col) const {
    return {.latitude_deg = block_.north_west.latitude_deg -
                            (row + 0.5) * block_.latitude_step_deg,
            .longitude_deg = block_.north_west.longitude_deg +
                             (col + 0.5) * block_.longitude_step_deg};
  }

  bool IsLand(std::size_t cell) const {
    return !block_.land.empty() && block_.land[cell] != 0;
  }

  std::optional<CellEvidence> ValueAt(std::size_t cell) const {
    if (IsLand(cell))
      return CellEvidence{.time_s = block_.time_s, .land = true};
    const float depth_m = block_.depth_m[cell];
    const float std_m =
        block_.std_m.size() == 1 ? block_.std_m[0] : block_.std_m[cell];
    if (std::isnan(depth_m) || std::isnan(std_m)) return std::nullopt;
    return CellEvidence{.mean_m = depth_m,
                        .variance_m2 = static_cast<double>(std_m) * std_m,
                        .time_s = block_.time_s};
  }

  // The smaller side of a cell in the middle of the block, metres.
  double CellSizeM() const {
    const GeodeticPoint middle = CenterOf(block_.rows / 2, block_.columns / 2);
    const GeodeticPoint south{
        .latitude_deg = middle.latitude_deg - block_.latitude_step_deg,
        .longitude_deg = middle.longitude_deg};
    const GeodeticPoint east{
        .latitude_deg = middle.latitude_deg,
        .longitude_deg = middle.longitude_deg + block_.longitude_step_deg};
    return std::min(DistanceM(middle, south), DistanceM(middle, east));
  }

  // Whether the block may hold a point of the cell; true when in doubt.
  bool MayTouch(const RootSquare& root, const CellKey& cell) const;

 private:
  const RasterBlock& block_;
};

bool Raster::MayTouch(const RootSquare& root, const CellKey& cell) const {
  // Nine points of the cell, relative to its middle, and half of their extent
  // to each side: more than great circles bulge in a square of 60 degrees.
  const GeodeticPoint middle = root.Center(cell);
  double south = 0, north = 0, west = 0, east = 0;
  for (int i = 0; i <= 2; ++i) {
    for (int j = 0; j <= 2; ++j) {
      const GeodeticPoint p =
          root.Unproject({.u = std::ldexp(cell.row + 0.5 * i, -cell.level),
                          .v = std::ldexp(cell.col + 0.5 * j, -cell.level)});
      const double d_lat = p.latitude_deg - middle.latitude_deg;
      const double d_lon =
          EastwardDeg(middle.longitude_deg + 180, p.longitude_deg) - 180;
      south = std::min(south, d_lat);
      north = std::max(north, d_lat);
      west = std::min(west, d_lon);
      east = std::max(east, d_lon);
    }
  }
  const double lat_margin = 0.5 * (north - south);
  const double lon_margin = 0.5 * (east - west);
  const double cell_north = middle.latitude_deg + north + lat_margin;
  const double cell_south = middle.latitude_deg + south - lat_margin;
  const double block_north = block_.north_west.latitude_deg;
  const double block_south =
      block_north - block_.rows * block_.latitude_step_deg;
  if (cell_south > block_north || cell_north < block_south) return false;
  // Near a pole, or wide: longitudes tell nothing.
  if (cell_north > 80 || cell_south < -80 || east - west > 90) return true;
  const double cell_west = middle.longitude_deg + west - lon_margin;
  const double cell_width = east - west + 2 * lon_margin;
  const double block_width = block_.columns * block_.longitude_step_deg;
  const double block_west = block_.north_west.longitude_deg;
  return EastwardDeg(cell_west, block_west) <= cell_width ||
         EastwardDeg(block_west, cell_west) <= block_width;
}

// A chart, written over what is not measured.
class ChartRule final : public CellRule {
 public:
  ChartRule(const RootSquare& root, const Raster& raster, bool replace)
      : root_(root), raster_(raster), replace_(replace) {}

  std::optional<CellEvidence> Sample(
      const SquarePoint& center, std::span<const Vector3> row_planes,
      std::span<const Vector3> col_planes) override {
    if (row_planes.size() == 1) {
      const auto cell = raster_.CellAt(
          ToGeodetic(RootSquare::Meet(row_planes[0], col_planes[0])));
      return cell ? raster_.ValueAt(*cell) : std::nullopt;
    }
    // A leaf on the seam of two blocks belongs to one of them.
    if (!raster_.CellAt(root_.Unproject(center))) return std::nullopt;
    EvidenceSum sum;
    for (const Vector3& row : row_planes) {
      for (const Vector3& col : col_planes) {
        const auto cell =
            raster_.CellAt(ToGeodetic(RootSquare::Meet(row, col)));
        if (!cell) continue;
        if (const auto value = raster_.ValueAt(*cell)) sum.Add(*value);
      }
    }
    if (sum.empty()) return std::nullopt;
    // Any land makes the leaf land: rocks must not be averaged away.
    return sum.Join(0.0);
  }

  bool MayDivide(const Leaf& leaf) const override {
    return leaf.kind() != LeafKind::kMeasured;
  }

  bool Apply(const CellEvidence& evidence, Leaf& leaf) const override {
    switch (leaf.kind()) {
      case LeafKind::kMeasured:
        return false;
      case LeafKind::kLand:
        if (!replace_) return false;
        break;
      case LeafKind::kPrior:
        if (!replace_ && !evidence.land) {
          FuseLeaf(evidence, LeafKind::kPrior, leaf);
          return true;
        }
        break;
      case LeafKind::kUnknown:
        break;
    }
    leaf = MakeLeaf(LeafKind::kPrior, evidence);
    return true;
  }

 private:
  const RootSquare& root_;
  const Raster& raster_;
  const bool replace_;
};

// Calls visit(range) for the cells of `level` in each tile that the chart may
// touch, north-west to south-east in Z-order.
template <typename Visitor>
void VisitTouched(const RootSquare& root, const Raster& raster,
                  const CellKey& cell, int tile_level, int level,
                  Visitor visit) {
  if (!raster.MayTouch(root, cell)) return;
  if (cell.level == tile_level) {
    const int up = level - tile_level;
    visit(CellRange{.row_begin = cell.row << up,
                    .row_last = ((cell.row + 1) << up) - 1,
                    .col_begin = cell.col << up,
                    .col_last = ((cell.col + 1) << up) - 1});
    return;
  }
  for (std::uint32_t child = 0; child < 4; ++child) {
    VisitTouched(root, raster,
                 {.level = static_cast<std::uint8_t>(cell.level + 1),
                  .row = 2 * cell.row + (child >> 1),
                  .col = 2 * cell.col + (child & 1)},
                 tile_level, level, visit);
  }
}

void CountCells(const RootSquare& root, const RasterBlock& block,
                const Raster& raster, GlobalMap::ImportSummary& summary) {
  const auto outside = [&](std::uint32_t row, std::uint32_t col) {
    return !root.Locate(raster.CenterOf(row, col), 0).has_value();
  };
  // If its border lies in the square, so does the block.
  bool all_inside = true;
  for (std::uint32_t row = 0; row < block.rows && all_inside; ++row) {
    all_inside = !outside(row, 0) && !outside(row, block.columns - 1);
  }
  for (std::uint32_t col = 0; col < block.columns && all_inside; ++col) {
    all_inside = !outside(0, col) && !outside(block.rows - 1, col);
  }
  std::size_t cell = 0;
  for (std::uint32_t row = 0; row < block.rows; ++row) {
    for (std::uint32_t col = 0; col < block.columns; ++col, ++cell) {
      if (raster.IsLand(cell)) {
        ++summary.cells_land;
      } else if (raster.ValueAt(cell)) {
        ++summary.cells_with_depth;
      } else {
        ++summary.cells_unknown;
      }
      if (!all_inside && outside(row, col)) ++summary.cells_outside;
    }
  }
}

}  // namespace

absl::Status ValidateRaster(const RasterBlock& block) {
  FATHOM_RETURN_IF_ERROR(ValidateGeodetic(block.north_west));
  const std::uint64_t cells = std::uint64_t{block.rows} * block.columns;
  if (cells == 0 || cells > RasterBlock::kMaxCells) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "rows=%u columns=%u: a block has 1 to %u cells; cut the chart",
        block.rows, block.columns, RasterBlock::kMaxCells));
  }
  if (!(block.latitude_step_deg > 0) || !(block.longitude_step_deg > 0) ||
      block.north_west.latitude_deg - block.rows * block.latitude_step_deg <
          -90 - 1e-9 ||
      block.columns * block.longitude_step_deg > 360 + 1e-9) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "latitude_step_deg=%g longitude_step_deg=%g must be > 0 and rows=%u "
        "columns=%u of them must fit on the Earth",
        block.latitude_step_deg, block.longitude_step_deg, block.rows,
        block.columns));
  }
  if (block.depth_m.size() != cells ||
      (block.std_m.size() != cells && block.std_m.size() != 1) ||
      (!block.land.empty() && block.land.size() != cells)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "for rows x columns = %u cells there are %u depth_m, %u std_m (or 1) "
        "and %u land (or none)",
        cells, block.depth_m.size(), block.std_m.size(), block.land.size()));
  }
  for (std::size_t i = 0; i < cells; ++i) {
    const float depth_m = block.depth_m[i];
    const bool land = !block.land.empty() && block.land[i] != 0;
    if (!land && !std::isnan(depth_m) &&
        !(depth_m >= kMinChartDepthM && depth_m <= kMaxChartDepthM)) {
      return absl::InvalidArgumentError(
          absl::StrFormat("depth_m[%u]=%g must be in [%g, %g] or NaN", i,
                          depth_m, kMinChartDepthM, kMaxChartDepthM));
    }
  }
  for (std::size_t i = 0; i < block.std_m.size(); ++i) {
    const float std_m = block.std_m[i];
    if (!std::isnan(std_m) && !(std_m > 0 && std::isfinite(std_m))) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "std_m[%u]=%g must be finite and > 0, or NaN", i, std_m));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<GlobalMap::ImportSummary> GlobalMap::ImportRaster(
    const RasterBlock& block) {
  FATHOM_RETURN_IF_ERROR(ValidateRaster(block));
  const RootSquare& root = options_.root;
  const Raster raster(block);
  ImportSummary summary;
  CountCells(root, block, raster, summary);

  const double cell_size_m = raster.CellSizeM();
  const int level = root.LevelFor(cell_size_m);
  const int samples = static_cast<int>(
      std::clamp(std::ceil(root.cell_size_m(level) / cell_size_m - 0.05), 1.0,
                 double{kMaxSamplesPerSide}));
  ChartRule rule(root, raster, block.replace);
  AreaWriter writer(root, *tree_, level, samples, rule);
  VisitTouched(root, raster, CellKey{}, tree_->ladder().TileLevelFor(level),
               level,
               [&](const CellRange& range) { writer.WriteRange(range); });
  const AreaCounts counts = writer.Finish();
  summary.leaves_written = counts.written;
  summary.degraded = counts.degraded;
  summary.kept_measured = counts.refused;
  return summary;
}

}  // namespace fathom::map
