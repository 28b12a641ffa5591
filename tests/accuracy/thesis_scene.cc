#include "tests/accuracy/thesis_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "map/geodesy/ned_frame.h"
#include "map/global/global_map.h"

namespace fathom::accuracy {
namespace {

constexpr map::GeodeticPoint kSouthWest{.latitude_deg = 41.5,
                                        .longitude_deg = -71.3};
constexpr double kCellM = 10;
constexpr int kSide = 50;
constexpr double kToleranceM = 0.5;

// The south-west node of a window.
using Corner = std::pair<int, int>;

bool IsWet(const Terrain& terrain, Corner corner) {
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) {
      if (!terrain.DepthAt((corner.first + i) * kCellM,
                           (corner.second + j) * kCellM)) {
        return false;
      }
    }
  }
  return true;
}

std::vector<Corner> WetWindows(const Terrain& terrain, int windows) {
  std::vector<Corner> corners;
  const int rows = static_cast<int>(terrain.north_extent_m() / kCellM) + 1;
  const int cols = static_cast<int>(terrain.east_extent_m() / kCellM) + 1;
  for (int row = 0; row + kSide <= rows; row += 7) {
    for (int col = 0; col + kSide <= cols; col += 7) {
      corners.emplace_back(row, col);
    }
  }
  std::mt19937 random(1);
  // std::shuffle differs between libraries.
  for (std::size_t i = corners.size(); i > 1; --i) {
    std::swap(corners[i - 1], corners[random() % i]);
  }
  std::vector<Corner> wet;
  for (const Corner& corner : corners) {
    if (static_cast<int>(wet.size()) >= windows) break;
    if (IsWet(terrain, corner)) wet.push_back(corner);
  }
  return wet;
}

std::uint64_t Median(std::vector<std::uint64_t> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

struct Outcome {
  std::uint64_t leaves = 0;
  std::uint64_t bytes = 0;
  double worst_m = 0;
};

// The window's corners: south-west, north-west, north-east, south-east.
std::array<map::GeodeticPoint, 4> CornersOf(const map::NedFrame& frame,
                                            Corner corner) {
  const double south_m = corner.first * kCellM;
  const double west_m = corner.second * kCellM;
  const double north_m = south_m + kSide * kCellM;
  const double east_m = west_m + kSide * kCellM;
  return {frame.ToGeodetic(south_m, west_m), frame.ToGeodetic(north_m, west_m),
          frame.ToGeodetic(north_m, east_m), frame.ToGeodetic(south_m, east_m)};
}

// The window as it is transferred, before any leaves are merged.
template <typename DepthOf>
map::GlobalMap Transferred(const map::RootSquare& root,
                           const map::NedFrame& frame, Corner corner,
                           DepthOf depth_of) {
  map::GlobalMap map({.root = root, .tolerance_m = kToleranceM});
  map.MergeArea(
      CornersOf(frame, corner), kCellM,
      [&](const map::GeodeticPoint& point)
          -> std::optional<map::DepthEstimate> {
        const map::NedPoint ned = frame.ToNed(point);
        const int i = static_cast<int>(std::floor(ned.north_m / kCellM));
        const int j = static_cast<int>(std::floor(ned.east_m / kCellM));
        if (i < corner.first || i >= corner.first + kSide ||
            j < corner.second || j >= corner.second + kSide) {
          return std::nullopt;
        }
        return map::DepthEstimate{
            .depth_m = static_cast<float>(depth_of(i, j)),
            .std_m = 0.3f,
            .kind = map::EvidenceKind::kMeasured,
            .time_s = static_cast<std::uint32_t>(1'000'000 + kSide * j + i)};
      });
  return map;
}

// Transfers the window and conglomerates it.
template <typename DepthOf>
Outcome Run(const map::RootSquare& root, const map::NedFrame& frame,
            Corner corner, map::MergeRule rule, DepthOf depth_of) {
  map::GlobalMap map = Transferred(root, frame, corner, depth_of);
  const map::GlobalMapView fine = map.View();
  map.Conglomerate(rule);
  const map::GlobalMapView view = map.View();
  Outcome outcome{.leaves = view.leaf_count(), .bytes = view.memory_bytes()};
  fine.ForEachLeaf([&](const map::CellKey& cell, const map::Leaf& leaf) {
    if (!leaf.known()) return;
    const double merged_m = view.At(root.Center(cell))->depth_m;
    outcome.worst_m =
        std::max(outcome.worst_m, std::abs(merged_m - leaf.depth_m));
  });
  return outcome;
}

map::RootSquare ThesisRoot() {
  return map::RootSquare::CenteredOn(kSouthWest, 1267 * 1852.0, kCellM).value();
}

}  // namespace

std::optional<ThesisWindow> FirstThesisWindow(const Terrain& terrain) {
  const std::vector<Corner> corners = WetWindows(terrain, 1);
  if (corners.empty()) return std::nullopt;
  const Corner corner = corners.front();
  const map::NedFrame frame(kSouthWest);
  map::GlobalMap map =
      Transferred(ThesisRoot(), frame, corner, [&terrain](int i, int j) {
        return *terrain.DepthAt(i * kCellM, j * kCellM);
      });
  const std::uint64_t fine_leaves = map.View().leaf_count();
  map.Conglomerate();
  return ThesisWindow{.view = map.View(),
                      .fine_leaves = fine_leaves,
                      .frame = frame,
                      .corners = CornersOf(frame, corner)};
}

ThesisScene MeasureThesisScene(const Terrain& terrain, int windows) {
  const map::RootSquare root = ThesisRoot();
  const map::NedFrame frame(kSouthWest);
  const auto depth_of = [&terrain](int i, int j) {
    return *terrain.DepthAt(i * kCellM, j * kCellM);
  };
  ThesisScene scene;
  std::vector<std::uint64_t> leaves;
  std::vector<std::uint64_t> bytes;
  std::vector<std::uint64_t> pairwise_leaves;
  std::vector<std::uint64_t> flat_leaves;
  for (const Corner& corner : WetWindows(terrain, windows)) {
    ++scene.windows;
    const Outcome range =
        Run(root, frame, corner, map::MergeRule::kRange, depth_of);
    leaves.push_back(range.leaves);
    bytes.push_back(range.bytes);
    scene.most_bytes = std::max(scene.most_bytes, range.bytes);
    scene.worst_m = std::max(scene.worst_m, range.worst_m);
    const Outcome pairwise =
        Run(root, frame, corner, map::MergeRule::kPairwise, depth_of);
    pairwise_leaves.push_back(pairwise.leaves);
    scene.pairwise_worst_m = std::max(scene.pairwise_worst_m, pairwise.worst_m);
    flat_leaves.push_back(
        Run(root, frame, corner, map::MergeRule::kRange, [](int, int) {
          return 10.0;
        }).leaves);
  }
  scene.median_leaves = Median(std::move(leaves));
  scene.median_bytes = Median(std::move(bytes));
  scene.pairwise_median_leaves = Median(std::move(pairwise_leaves));
  scene.flat_median_leaves = Median(std::move(flat_leaves));
  return scene;
}

}  // namespace fathom::accuracy
