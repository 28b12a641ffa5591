#include "map/global/area_writer.h"

#include <algorithm>
#include <cmath>

namespace fathom::map {
namespace {

// Fraction of the square at part `part` of `parts` of row or column `index`.
double FractionAt(std::uint32_t index, int level, int part, int parts) {
  return std::ldexp(index + (part + 0.5) / parts, -level);
}

}  // namespace

AreaWriter::AreaWriter(const RootSquare& root, WorkTree& tree, int level,
                       int samples_per_side, CellRule& rule)
    : root_(root),
      tree_(tree),
      level_(level),
      samples_(samples_per_side),
      rule_(rule) {}

void AreaWriter::WriteRange(const CellRange& range) {
  const int tile_level = tree_.ladder().TileLevelFor(level_);
  const int up = level_ - tile_level;
  for (std::uint32_t row = range.row_begin >> up; row <= range.row_last >> up;
       ++row) {
    for (std::uint32_t col = range.col_begin >> up; col <= range.col_last >> up;
         ++col) {
      tree_.FreezeIfLarge();
      WriteTile({.level = static_cast<std::uint8_t>(tile_level),
                 .row = row,
                 .col = col},
                {.row_begin = std::max(range.row_begin, row << up),
                 .row_last = std::min(range.row_last, ((row + 1) << up) - 1),
                 .col_begin = std::max(range.col_begin, col << up),
                 .col_last = std::min(range.col_last, ((col + 1) << up) - 1)});
    }
  }
}

void AreaWriter::WriteTile(const TileKey& key, const CellRange& range) {
  const int below = level_ - key.level;
  row_planes_.clear();
  col_planes_.clear();
  for (std::uint32_t row = range.row_begin; row <= range.row_last; ++row) {
    for (int part = 0; part < samples_; ++part) {
      row_planes_.push_back(
          root_.RowPlane(FractionAt(row, level_, part, samples_)));
    }
  }
  for (std::uint32_t col = range.col_begin; col <= range.col_last; ++col) {
    for (int part = 0; part < samples_; ++part) {
      col_planes_.push_back(
          root_.ColPlane(FractionAt(col, level_, part, samples_)));
    }
  }
  const auto planes_of = [this](const std::vector<Vector3>& planes,
                                std::uint32_t nth) {
    const auto samples = static_cast<std::size_t>(samples_);
    return std::span(planes).subspan(nth * samples, samples);
  };

  WorkTile* tile = tree_.OpenTile(key);
  for (std::uint32_t row = range.row_begin; row <= range.row_last; ++row) {
    for (std::uint32_t col = range.col_begin; col <= range.col_last; ++col) {
      const CellKey cell{
          .level = static_cast<std::uint8_t>(level_), .row = row, .col = col};
      const std::uint32_t position = PositionInTile(cell, key.level);
      if (tile != nullptr &&
          (tile->levels[position] > below || tile->IsChild(position))) {
        WriteDeeper(*tile, position, position + SpanOf(below));
        continue;
      }
      const std::optional<CellEvidence> evidence =
          rule_.Sample({.u = FractionAt(row, level_, 0, 1),
                        .v = FractionAt(col, level_, 0, 1)},
                       planes_of(row_planes_, row - range.row_begin),
                       planes_of(col_planes_, col - range.col_begin));
      if (!evidence) continue;
      const auto may_divide = [this](const Leaf& leaf) {
        return rule_.MayDivide(leaf);
      };
      const WorkTree::Place place = tree_.Reach(cell, may_divide);
      if (place.exact) {
        tile = place.tile;
        Update(*tile, place.start, *evidence);
      } else if (!rule_.MayDivide(place.leaf())) {
        ++counts_.refused;
      } else {
        ++counts_.degraded;
        pending_[place.cell()].Add(*evidence);
      }
    }
  }
}

void AreaWriter::WriteDeeper(WorkTile& tile, std::uint32_t begin,
                             std::uint32_t end) {
  for (std::uint32_t start = begin; start < end;) {
    const int level = tile.levels[start];
    if (tile.leaves[start].std_code == kChildCode) {
      WorkNode& node = tile.ChildAt(start);
      const bool was_frozen = node.work == nullptr;
      WorkTile& child = tree_.Open(node);
      child.settled = false;
      WriteDeeper(child, 0, kTileCells);
      if (was_frozen) tree_.FreezeNode(node);
    } else {
      const CellKey cell = CellInTile(tile.key, start, level);
      if (const auto evidence = SampleCell(cell)) {
        Update(tile, start, DividedEvidence(*evidence, cell.level - level_));
      }
    }
    start += SpanOf(level);
  }
}

std::optional<CellEvidence> AreaWriter::SampleCell(const CellKey& cell) {
  // Finer than the level by some powers of two: fewer samples do.
  const int finer = std::min(cell.level - level_, 8);
  const int samples = std::max(1, (samples_ + (1 << finer) - 1) >> finer);
  std::vector<Vector3> rows;
  std::vector<Vector3> cols;
  for (int part = 0; part < samples; ++part) {
    rows.push_back(
        root_.RowPlane(FractionAt(cell.row, cell.level, part, samples)));
    cols.push_back(
        root_.ColPlane(FractionAt(cell.col, cell.level, part, samples)));
  }
  return rule_.Sample({.u = FractionAt(cell.row, cell.level, 0, 1),
                       .v = FractionAt(cell.col, cell.level, 0, 1)},
                      rows, cols);
}

void AreaWriter::Update(WorkTile& tile, std::uint32_t start,
                        const CellEvidence& evidence) {
  if (rule_.Apply(evidence, tile.leaves[start])) {
    tile.modified = true;
    ++counts_.written;
  } else {
    ++counts_.refused;
  }
}

AreaCounts AreaWriter::Finish() {
  // Once the bound is reached nothing more was divided in this call, so the
  // cells that wait are still leaves.
  const auto never = [](const Leaf&) { return false; };
  for (const auto& [cell, sum] : pending_) {
    const WorkTree::Place place = tree_.Reach(cell, never);
    Update(*place.tile, place.start, sum.Join(0.5));
  }
  pending_.clear();
  return counts_;
}

}  // namespace fathom::map
