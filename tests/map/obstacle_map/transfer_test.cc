// What a transfer must not lose: no hole inside what was surveyed, no measured
// cell, no shoal; wherever the mission lies and whatever the sizes of local
// and global cells.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include "map/geodesy/ned_frame.h"
#include "map/obstacle_map/obstacle_map.h"
#include "tests/map/obstacle_map/test_missions.h"

namespace fathom::map {
namespace {

// A mission and a survey in it.
struct Scene {
  const char* name;
  double latitude_deg;
  // Where the survey lies from the mission's middle; far off the middle the
  // grids are turned against each other.
  double north_m;
  double east_m;
  double side_m;
  double min_cell_m;
  double local_cell_m;
};

void PrintTo(const Scene& scene, std::ostream* out) { *out << scene.name; }

class TransferTest : public ::testing::TestWithParam<Scene> {
 protected:
  static constexpr int kCells = 70;  // Of the local map, each way: 4.4 blocks.
  using DepthOf = std::function<std::optional<float>(CellIndex)>;

  TransferTest() : map_(Options()) {
    const Scene& scene = GetParam();
    const NedFrame middle(Center());
    StartActivity survey;
    survey.id = ActivityId{"a"};
    survey.start = At(0);
    survey.options = {
        .south_west = middle.ToGeodetic(scene.north_m, scene.east_m),
        .north_extent_m = kCells * scene.local_cell_m,
        .east_extent_m = kCells * scene.local_cell_m,
        .cell_size_m = scene.local_cell_m};
    EXPECT_TRUE(map_.Start(survey).ok());
    frame_ = NedFrame(survey.options.south_west);
  }

  static GeodeticPoint Center() {
    return {.latitude_deg = GetParam().latitude_deg, .longitude_deg = 12.3};
  }
  static MissionOptions Options() {
    MissionOptions options;
    options.global.root = RootSquare::CenteredOn(Center(), GetParam().side_m,
                                                 GetParam().min_cell_m)
                              .value();
    return options;
  }

  // The point at (i, j) cells from the south-west corner.
  GeodeticPoint PointAt(double i, double j) const {
    const double cell_m = GetParam().local_cell_m;
    return frame_.ToGeodetic(i * cell_m, j * cell_m);
  }

  // Three soundings of 5 cm in the middle of each cell that has a depth.
  void Measure(const DepthOf& depth_of) {
    const double cell_m = GetParam().local_cell_m;
    const double middle_m = 0.5 * kCells * cell_m + 0.01;
    Ping ping;
    ping.activity = ActivityId{"a"};
    ping.pose.position = frame_.ToGeodetic(middle_m, middle_m);
    for (int i = 0; i < kCells; ++i) {
      for (int j = 0; j < kCells; ++j) {
        const auto depth_m = depth_of({.i = i, .j = j});
        if (!depth_m) continue;
        const double north_m = (i + 0.5) * cell_m - middle_m;
        const double east_m = (j + 0.5) * cell_m - middle_m;
        ping.beams.push_back(
            {.range_m = static_cast<float>(std::hypot(north_m, east_m)),
             .bearing_rad = static_cast<float>(std::atan2(east_m, north_m)),
             .depth_m = *depth_m,
             .std_m = 0.05f});
        ++cells_;
      }
    }
    for (int pass = 1; pass <= 3; ++pass) {
      ping.time = At(pass);
      const auto taken = map_.ApplyPing(ping);
      ASSERT_TRUE(taken.ok());
      ASSERT_EQ(taken->accepted, ping.beams.size());
    }
    ASSERT_EQ(map_.View()->activities()[0]->cells_measured, cells_);
  }

  TransferResult Complete() {
    return map_.Complete(ActivityId{"a"}, false).value();
  }

  bool MeasuredAt(const ObstacleMapView& view, const GeodeticPoint& point) {
    const auto leaf = view.global().At(point);
    return leaf && leaf->kind == EvidenceKind::kMeasured;
  }

  // The side of the global cells that the survey is written to.
  double LeafM() const {
    const RootSquare& root = map_.options().global.root;
    return root.cell_size_m(root.LevelFor(GetParam().local_cell_m));
  }

  ObstacleMap map_;
  NedFrame frame_;
  std::uint64_t cells_ = 0;
};

// Every global cell whose middle lies in a measured local cell (domain.md,
// section 5, departure (a)), in patches with ragged rims and holes.
TEST_P(TransferTest, LeavesNoPinhole) {
  const auto measured = [](CellIndex cell) {
    return std::hypot(cell.i - 30, cell.j - 40) < 29 &&
           (cell.i * 7 + cell.j * 3) % 11 != 0;
  };
  Measure([&](CellIndex cell) -> std::optional<float> {
    if (!measured(cell)) return std::nullopt;
    return 20 + 0.05f * static_cast<float>(cell.i);
  });
  const auto before = map_.View();
  const LocalMapView& local = *before->activities()[0]->local;
  Complete();
  const auto view = map_.View();
  const RootSquare& root = map_.options().global.root;
  const int level = root.LevelFor(GetParam().local_cell_m);
  const LatticeBox box =
      root.BoxAround({PointAt(0, 0), PointAt(kCells, 0),
                      PointAt(kCells, kCells), PointAt(0, kCells)})
          .value();
  const int up = kMaxLevel - level;
  int inside = 0;
  int pinholes = 0;
  for (auto row = box.row_first >> up; row <= box.row_last >> up; ++row) {
    for (auto col = box.col_first >> up; col <= box.col_last >> up; ++col) {
      const GeodeticPoint middle = root.Center(
          {.level = static_cast<std::uint8_t>(level), .row = row, .col = col});
      const auto cell = local.CellAt(middle);
      if (!cell || !measured(*cell)) continue;
      ++inside;
      pinholes += MeasuredAt(*view, middle) ? 0 : 1;
    }
  }
  EXPECT_EQ(pinholes, 0) << "of " << inside;
  // As many as the measured area holds.
  const double expected = static_cast<double>(cells_) *
                          std::pow(GetParam().local_cell_m / LeafM(), 2);
  EXPECT_NEAR(inside, expected, 0.15 * expected + 4);
}

// Cells measured alone, each with leaves of its own: in the scenes whose leaves
// are not larger than local cells. (Of larger ones only those with their middle
// in a measured area take its mean: domain.md's rule again. No shoal is lost:
// see below.)
class LoneCellTest : public TransferTest {};

TEST_P(LoneCellTest, IsNotSkipped) {
  ASSERT_LE(LeafM(), GetParam().local_cell_m);
  std::vector<CellIndex> cells;
  for (int i = 0; i < kCells; i += 3) {
    for (int j = (i / 3) % 2; j < kCells; j += 3) {
      cells.push_back({.i = i, .j = j});
    }
  }
  Measure([&](CellIndex cell) -> std::optional<float> {
    for (const CellIndex& one : cells) {
      if (one.i == cell.i && one.j == cell.j) return 20.0f;
    }
    return std::nullopt;
  });
  Complete();
  const auto view = map_.View();
  int skipped = 0;
  for (const CellIndex& cell : cells) {
    bool found = false;
    for (double i = 0.05; i < 1; i += 0.1) {
      for (double j = 0.05; j < 1; j += 0.1) {
        found = found || MeasuredAt(*view, PointAt(cell.i + i, cell.j + j));
      }
    }
    skipped += found ? 0 : 1;
  }
  EXPECT_EQ(skipped, 0) << "of " << cells.size();
}

// Rocks that fill one local cell: where the local map would not call their tops
// free the global map must not either.
class ShoalTest : public TransferTest {
 protected:
  static constexpr float kRockM = 16;
  static constexpr float kFloorM = 20;

  // At random places, of which four are in the corners of the local map.
  static std::vector<CellIndex> Rocks() {
    std::mt19937 random(4);
    std::uniform_int_distribution<int> place(0, kCells - 1);
    std::vector<CellIndex> rocks = {
        {0, 0}, {0, kCells - 1}, {kCells - 1, 0}, {kCells - 1, kCells - 1}};
    for (int n = 0; n < 40; ++n) {
      rocks.push_back({.i = place(random), .j = place(random)});
    }
    return rocks;
  }

  static bool IsIn(const std::vector<CellIndex>& cells, CellIndex cell) {
    return std::any_of(cells.begin(), cells.end(), [&](const CellIndex& one) {
      return one.i == cell.i && one.j == cell.j;
    });
  }

  // A chart of the floor that knows of no rock, over the survey and beyond.
  void ImportChart() {
    RasterBlock chart;
    const GeodeticPoint a = PointAt(0, 0);
    const GeodeticPoint b = PointAt(kCells, kCells);
    chart.latitude_step_deg = (b.latitude_deg - a.latitude_deg) / 4;
    chart.longitude_step_deg = (b.longitude_deg - a.longitude_deg) / 4;
    chart.north_west = {
        .latitude_deg = b.latitude_deg + 4 * chart.latitude_step_deg,
        .longitude_deg = a.longitude_deg - 4 * chart.longitude_step_deg};
    chart.rows = chart.columns = 12;
    chart.depth_m.assign(144, kFloorM);
    chart.std_m = {0.5f};
    const auto imported = map_.Import(chart, true);
    ASSERT_TRUE(imported.ok()) << imported.status();
    ASSERT_TRUE(map_.View()->global().At(PointAt(-1, -1)).has_value());
  }

  int FreeOf(const std::vector<CellIndex>& rocks) {
    const auto view = map_.View();
    int free = 0;
    for (const CellIndex& rock : rocks) {
      const ObstacleAnswer answer =
          view->Answer({.position = PointAt(rock.i + 0.5, rock.j + 0.5),
                        .depth_m = kRockM,
                        .time = At(3)});
      free += answer.state == ObstacleState::kFree ? 1 : 0;
    }
    return free;
  }
};

TEST_P(ShoalTest, IsNotAveragedAway) {
  const std::vector<CellIndex> rocks = Rocks();
  Measure([&](CellIndex cell) { return IsIn(rocks, cell) ? kRockM : kFloorM; });
  EXPECT_EQ(FreeOf(rocks), 0);
  Complete();
  EXPECT_EQ(FreeOf(rocks), 0);
}

TEST_P(ShoalTest, IsNotLostInAChart) {
  ImportChart();
  const std::vector<CellIndex> rocks = Rocks();
  EXPECT_EQ(FreeOf(rocks), static_cast<int>(rocks.size()));
  Measure([&](CellIndex cell) { return IsIn(rocks, cell) ? kRockM : kFloorM; });
  Complete();
  EXPECT_EQ(FreeOf(rocks), 0);
}

// Nothing but the rocks was measured.
TEST_P(ShoalTest, MeasuredAloneIsNotLostInAChart) {
  ImportChart();
  const std::vector<CellIndex> rocks = Rocks();
  Measure([&](CellIndex cell) -> std::optional<float> {
    if (!IsIn(rocks, cell)) return std::nullopt;
    return kRockM;
  });
  EXPECT_EQ(FreeOf(rocks), 0);
  Complete();
  EXPECT_EQ(FreeOf(rocks), 0);
}

constexpr double kThesisSideM = 1267 * 1852.0;

const auto kScenes = ::testing::Values(
    Scene{"ThesisMiddle", 41.5, 3000, -2000, kThesisSideM, 10, 10},
    Scene{"ThesisCorner", 41.5, 800e3, 900e3, kThesisSideM, 10, 10},
    Scene{"Equator", 0.1, -500, 7000, 20000, 10, 10},
    Scene{"South", -60, 4000, 4000, 100e3, 5, 5},
    Scene{"North", 77, -3000, 5000, 50e3, 2, 2},
    Scene{"LocalCoarse", 41.5, 30e3, -20e3, 200e3, 3, 7.3});

// Leaves are larger than local cells.
const auto kFineScenes = ::testing::Values(
    Scene{"LocalFine", 41.5, 30e3, 20e3, kThesisSideM, 10, 5},
    Scene{"LocalOneMetre", -33, 5000, 6000, 40e3, 10, 1},
    Scene{"LocalOneMetreCorner", 60, 500e3, 600e3, kThesisSideM, 10, 1},
    Scene{"LocalHalfMetre", 12, 700, 800, 40e3, 10, 0.5});

std::string NameOf(const ::testing::TestParamInfo<Scene>& scene) {
  return scene.param.name;
}

INSTANTIATE_TEST_SUITE_P(Scenes, TransferTest, kScenes, NameOf);
INSTANTIATE_TEST_SUITE_P(FineScenes, TransferTest, kFineScenes, NameOf);
INSTANTIATE_TEST_SUITE_P(Scenes, LoneCellTest, kScenes, NameOf);
INSTANTIATE_TEST_SUITE_P(Scenes, ShoalTest, kScenes, NameOf);
INSTANTIATE_TEST_SUITE_P(FineScenes, ShoalTest, kFineScenes, NameOf);

}  // namespace
}  // namespace fathom::map
