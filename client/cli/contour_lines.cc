#include "client/cli/contour_lines.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>
#include <utility>

namespace fathom::client::cli {
namespace {

// Edges between neighbouring middles are numbered: 2 i goes right from cell i,
// 2 i + 1 goes down.
using Edge = std::uint64_t;

struct Segment {
  std::array<Edge, 2> edges;
  bool used = false;
};

class Tracer {
 public:
  Tracer(const std::vector<float>& values, std::uint32_t rows,
         std::uint32_t columns, double level)
      : values_(values), rows_(rows), columns_(columns), level_(level) {}

  std::vector<ContourLine> Run() {
    for (std::uint32_t row = 0; row + 1 < rows_; ++row) {
      for (std::uint32_t column = 0; column + 1 < columns_; ++column) {
        AddSquare(static_cast<std::size_t>(row) * columns_ + column);
      }
    }
    std::vector<ContourLine> lines;
    // Open lines first, from their ends; what is left is closed.
    for (const bool ends_only : {true, false}) {
      for (std::size_t i = 0; i < segments_.size(); ++i) {
        if (segments_[i].used) continue;
        const auto [first, second] = segments_[i].edges;
        if (!ends_only || touching_[first].size() == 1) {
          lines.push_back(Follow(i, first));
        } else if (touching_[second].size() == 1) {
          lines.push_back(Follow(i, second));
        }
      }
    }
    return lines;
  }

 private:
  void AddSquare(std::size_t at) {
    // Corners clockwise from the north-west, and the edge behind each.
    const std::array<std::size_t, 4> corner = {at, at + 1, at + columns_ + 1,
                                               at + columns_};
    const std::array<Edge, 4> edge = {2 * at, 2 * (at + 1) + 1,
                                      2 * (at + columns_), 2 * at + 1};
    std::array<bool, 4> below;
    for (std::size_t k = 0; k < 4; ++k) {
      const float value = values_[corner[k]];
      if (!std::isfinite(value)) return;
      below[k] = value < level_;
    }
    std::array<Edge, 4> crossed;
    std::size_t count = 0;
    // Start behind a corner above the level whose next one is below, so that
    // at a saddle each pair encloses a corner below.
    std::size_t start = 0;
    while (start < 4 && !(!below[start] && below[(start + 1) % 4])) ++start;
    if (start == 4) return;
    for (std::size_t n = 0; n < 4; ++n) {
      const std::size_t k = (start + n) % 4;
      if (below[k] != below[(k + 1) % 4]) crossed[count++] = edge[k];
    }
    for (std::size_t k = 0; k + 1 < count; k += 2) {
      const std::size_t number = segments_.size();
      segments_.push_back({{crossed[k], crossed[k + 1]}});
      touching_[crossed[k]].push_back(number);
      touching_[crossed[k + 1]].push_back(number);
    }
  }

  GridPoint Crossing(Edge edge) const {
    const std::size_t from = edge / 2;
    const bool down = edge % 2 == 1;
    const std::size_t to = down ? from + columns_ : from + 1;
    const double t = (level_ - values_[from]) /
                     (static_cast<double>(values_[to]) - values_[from]);
    const std::size_t row = from / columns_;
    const double x = static_cast<double>(from % columns_) + 0.5;
    const double y = static_cast<double>(row) + 0.5;
    return down ? GridPoint{x, y + t} : GridPoint{x + t, y};
  }

  ContourLine Follow(std::size_t segment, Edge from) {
    ContourLine line;
    line.level = level_;
    line.points.push_back(Crossing(from));
    while (true) {
      Segment& current = segments_[segment];
      current.used = true;
      from = current.edges[0] == from ? current.edges[1] : current.edges[0];
      line.points.push_back(Crossing(from));
      const std::vector<std::size_t>& next = touching_[from];
      const auto unused =
          std::find_if(next.begin(), next.end(),
                       [this](std::size_t i) { return !segments_[i].used; });
      if (unused == next.end()) return line;
      segment = *unused;
    }
  }

  const std::vector<float>& values_;
  const std::uint32_t rows_;
  const std::uint32_t columns_;
  const double level_;
  std::vector<Segment> segments_;
  std::unordered_map<Edge, std::vector<std::size_t>> touching_;
};

}  // namespace

std::vector<ContourLine> TraceContour(const std::vector<float>& values,
                                      std::uint32_t rows, std::uint32_t columns,
                                      double level) {
  if (rows < 2 || columns < 2) return {};
  return Tracer(values, rows, columns, level).Run();
}

}  // namespace fathom::client::cli
