// The a-priori load (Nervegna 2002, sections 1.2 and 4.4.3).

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "map/global/global_map.h"
#include "tests/map/global/scene.h"
#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// 0.0005 degrees: 55.5 m north-south, 41.7 m east-west at 41.5 N.
constexpr double kStep = 0.0005;

class ImportRaster : public ::testing::Test {
 protected:
  ImportRaster() : root_(SquareOf(40960, 10.1)), map_({.root = root_}) {}

  GlobalMap::ImportSummary Import(const RasterBlock& block) {
    auto summary = map_.ImportRaster(block);
    EXPECT_THAT(summary, IsOk());
    return summary.ok() ? *summary : GlobalMap::ImportSummary{};
  }
  static RasterBlock Chart(float depth_m, float std_m) {
    return FlatRaster({.latitude_deg = 41.51, .longitude_deg = -71.31}, kStep,
                      40, 40, depth_m, std_m);
  }
  void Measure(float depth_m, float std_m) {
    const CellKey cell = root_.Locate(kNarragansett, 12).value();
    map_.MergeArea(root_.Corners(cell), 10.1, [&](const GeodeticPoint&) {
      return Measured(depth_m, std_m);
    });
  }
  std::optional<DepthEstimate> AtMiddle() {
    return map_.View().At(kNarragansett);
  }

  RootSquare root_;
  GlobalMap map_;
};

TEST_F(ImportRaster, EveryCellOfTheChartCanBeReadBack) {
  RasterBlock chart = Chart(0, 1);
  for (std::size_t i = 0; i < chart.depth_m.size(); ++i) {
    chart.depth_m[i] = static_cast<float>(i);
  }
  const auto summary = Import(chart);
  EXPECT_EQ(summary.cells_with_depth, 1600u);
  EXPECT_EQ(summary.cells_land + summary.cells_unknown + summary.cells_outside +
                summary.degraded,
            0u);
  // The leaves are the coarsest that are not larger than 41.7 m: 40960 / 2^10
  // = 40 m, so 1.3 x 1.04 a cell.
  const auto middle = AtMiddle();
  ASSERT_TRUE(middle);
  EXPECT_NEAR(middle->cell_size_m, 40, 0.2);
  EXPECT_NEAR(static_cast<double>(summary.leaves_written), 1600 * 1.44, 60);
  const GlobalMapView view = map_.View();
  for (std::uint32_t row = 0; row < 40; ++row) {
    for (std::uint32_t col = 0; col < 40; ++col) {
      // The leaf that holds the middle of a chart cell has its own middle
      // within half a leaf (20 m) of it, so in this cell or the next.
      const GeodeticPoint p{.latitude_deg = 41.51 - (row + 0.5) * kStep,
                            .longitude_deg = -71.31 + (col + 0.5) * kStep};
      const auto at = view.At(p);
      ASSERT_TRUE(at);
      const GeodeticPoint leaf_middle = root_.Center(view.LeafAt(p)->first);
      const double expected =
          40 * std::floor((41.51 - leaf_middle.latitude_deg) / kStep) +
          std::floor((leaf_middle.longitude_deg + 71.31) / kStep);
      ASSERT_EQ(at->depth_m, static_cast<float>(expected));
      ASSERT_LE(std::abs(at->depth_m - static_cast<float>(40 * row + col)),
                41.0f);
      ASSERT_EQ(at->kind, EvidenceKind::kPrior);
      ASSERT_EQ(at->time_s, 50u);
    }
  }
}

TEST_F(ImportRaster, UnknownStaysUnknownAndLandIsLand) {
  RasterBlock chart = Chart(20, 1);
  chart.land.assign(1600, 0);
  for (std::uint32_t col = 0; col < 40; ++col) {
    for (std::uint32_t row = 0; row < 10; ++row) {
      chart.depth_m[row * 40 + col] = kNaN;
      chart.land[(row + 30) * 40 + col] = 1;
      chart.depth_m[(row + 30) * 40 + col] = -7;  // Ignored: no elevation.
    }
  }
  const auto summary = Import(chart);
  EXPECT_EQ(summary.cells_unknown, 400u);
  EXPECT_EQ(summary.cells_land, 400u);
  EXPECT_EQ(summary.cells_with_depth, 800u);
  const GlobalMapView view = map_.View();
  const auto row_at = [](double row) {
    return GeodeticPoint{.latitude_deg = 41.51 - row * kStep,
                         .longitude_deg = -71.30};
  };
  EXPECT_FALSE(view.At(row_at(5)));
  EXPECT_EQ(view.At(row_at(20))->depth_m, 20.0f);
  const auto land = view.At(row_at(35));
  ASSERT_TRUE(land);
  EXPECT_EQ(land->kind, EvidenceKind::kLand);
  EXPECT_EQ(land->depth_m, kLandDepthM);
}

TEST_F(ImportRaster, AStdThatIsNoNumberMakesTheCellUnknown) {
  RasterBlock chart = Chart(20, 1);
  chart.std_m.assign(1600, 1.0f);
  chart.std_m[0] = kNaN;
  EXPECT_EQ(Import(chart).cells_unknown, 1u);
}

TEST_F(ImportRaster, AChartNeverReplacesAMeasurement) {
  Measure(14, 0.5f);
  RasterBlock chart = Chart(20, 0.1f);
  for (const bool replace : {false, true}) {
    chart.replace = replace;
    const auto summary = Import(chart);
    EXPECT_EQ(summary.kept_measured, 1u);
    EXPECT_EQ(AtMiddle()->depth_m, 14.0f);
    EXPECT_EQ(AtMiddle()->std_m, 0.5f);
    EXPECT_EQ(AtMiddle()->kind, EvidenceKind::kMeasured);
  }
  // Its unknown neighbours took the chart.
  EXPECT_EQ(map_.View().At(Direct(kNarragansett, 0, 30))->depth_m, 20.0f);
}

TEST_F(ImportRaster, AMergedMeasuredLeafIsNotDividedForAChart) {
  map_.MergeArea(Rectangle(NedFrame(kNarragansett), -500, 500, -500, 500), 10.1,
                 [](const GeodeticPoint&) { return Measured(9, 0.5f); });
  map_.Conglomerate();
  const auto before = map_.View().LeafAt(kNarragansett);
  ASSERT_LT(before->first.level, 10);
  const auto summary = Import(Chart(20, 1));
  EXPECT_GT(summary.kept_measured, 0u);
  EXPECT_EQ(map_.View().LeafAt(kNarragansett), before);
}

TEST_F(ImportRaster, ASecondChartIsFusedOrReplaces) {
  Import(Chart(20, 2));
  RasterBlock second = Chart(25, 1);
  Import(second);
  // k = 4 / (4 + 1) = 0.8: 20 + 0.8 * 5 = 24; variance of the mean 0.2 * 4 =
  // 0.8. They are 5 m apart where two sigma are 2 sqrt(4 + 1) = 4.5: 0.8 * 0.2
  // * (25 - 20) = 0.8 of variability. Together 1.6, right to a spread code.
  EXPECT_FLOAT_EQ(AtMiddle()->depth_m, 24.0f);
  EXPECT_NEAR(AtMiddle()->std_m, std::sqrt(1.6), 0.01 * 1.265);
  EXPECT_EQ(AtMiddle()->kind, EvidenceKind::kPrior);
  second.replace = true;
  Import(second);
  EXPECT_EQ(AtMiddle()->depth_m, 25.0f);
  EXPECT_EQ(AtMiddle()->std_m, 1.0f);
}

TEST_F(ImportRaster, ChartedLandStandsUnlessReplaced) {
  RasterBlock land = Chart(0, 1);
  land.land.assign(1600, 1);
  Import(land);
  RasterBlock water = Chart(20, 1);
  Import(water);
  EXPECT_EQ(AtMiddle()->kind, EvidenceKind::kLand);
  water.replace = true;
  Import(water);
  EXPECT_EQ(AtMiddle()->kind, EvidenceKind::kPrior);
  // And land from a later chart stands over an older depth.
  Import(land);
  EXPECT_EQ(AtMiddle()->kind, EvidenceKind::kLand);
}

TEST_F(ImportRaster, AChartFinerThanTheMapIsJoinedAndAnyLandIsLand) {
  // Cells of 1e-5 degrees, about 1 m, into leaves of 10 m. One chart cell in
  // the middle is a rock.
  RasterBlock chart =
      FlatRaster({.latitude_deg = 41.5005, .longitude_deg = -71.3005}, 1e-5,
                 100, 100, 20, 1);
  for (std::size_t i = 0; i < chart.depth_m.size(); ++i) {
    chart.depth_m[i] = i % 2 == 0 ? 19.0f : 21.0f;
  }
  // Even columns 19, odd ones 21: mean 20, variance 1 + 1.
  Import(chart);
  const auto leaf = AtMiddle();
  ASSERT_TRUE(leaf);
  EXPECT_NEAR(leaf->cell_size_m, 10, 0.1);
  EXPECT_NEAR(leaf->depth_m, 20, 0.25);
  EXPECT_NEAR(leaf->std_m, std::sqrt(2.0), 0.05);

  chart.replace = true;
  chart.land.assign(10000, 0);
  for (std::uint32_t row = 48; row < 52; ++row) {
    for (std::uint32_t col = 48; col < 52; ++col) {
      chart.land[row * 100 + col] = 1;
    }
  }
  Import(chart);
  EXPECT_EQ(AtMiddle()->kind, EvidenceKind::kLand);
}

TEST_F(ImportRaster, BlocksOfOneChartEqualTheWhole) {
  RasterBlock chart = Chart(0, 1);
  std::mt19937 random(8);
  std::uniform_real_distribution<float> depth(5, 40);
  for (float& d : chart.depth_m) d = depth(random);
  Import(chart);
  const Leaves whole = LeavesOf(map_.View());

  GlobalMap in_blocks({.root = root_});
  for (std::uint32_t i = 0; i < 4; ++i) {
    for (std::uint32_t j = 0; j < 4; ++j) {
      RasterBlock block = FlatRaster({.latitude_deg = 41.51 - 10 * i * kStep,
                                      .longitude_deg = -71.31 + 10 * j * kStep},
                                     kStep, 10, 10, 0, 1);
      for (std::uint32_t r = 0; r < 10; ++r) {
        for (std::uint32_t c = 0; c < 10; ++c) {
          block.depth_m[r * 10 + c] =
              chart.depth_m[(10 * i + r) * 40 + 10 * j + c];
        }
      }
      ASSERT_THAT(in_blocks.ImportRaster(block), IsOk());
    }
  }
  EXPECT_EQ(LeavesOf(in_blocks.View()), whole);
}

TEST_F(ImportRaster, CountsWhatLiesOutsideTheSquare) {
  // Half of the block lies north of the square, whose side is 20.48 km away.
  const GeodeticPoint edge = Direct(kNarragansett, 0, 20480);
  RasterBlock chart = FlatRaster(
      {.latitude_deg = edge.latitude_deg + 20 * kStep, .longitude_deg = -71.31},
      kStep, 40, 40, 20, 1);
  const auto summary = Import(chart);
  EXPECT_NEAR(static_cast<double>(summary.cells_outside), 800, 40);
  EXPECT_EQ(summary.cells_with_depth, 1600u);
  EXPECT_GT(summary.leaves_written, 1000u);
}

TEST_F(ImportRaster, AChartOfAnotherOceanWritesNothing) {
  const auto summary = Import(FlatRaster(
      {.latitude_deg = -41.0, .longitude_deg = 108}, 0.01, 50, 50, 20, 1));
  EXPECT_EQ(summary.cells_outside, 2500u);
  EXPECT_EQ(summary.leaves_written, 0u);
  EXPECT_EQ(map_.leaf_count(), 1u);
}

TEST_F(ImportRaster, AWorldChartReachesIntoTheSquare) {
  // One degree cells, the square within a few of them.
  RasterBlock world = FlatRaster({.latitude_deg = 90, .longitude_deg = -180},
                                 1.0, 180, 360, 0, 10);
  for (std::uint32_t r = 0; r < 180; ++r) {
    for (std::uint32_t c = 0; c < 360; ++c) {
      world.depth_m[r * 360 + c] = static_cast<float>(r);
    }
  }
  const auto summary = Import(world);
  // Row 48 is 42 N to 41 N.
  EXPECT_EQ(AtMiddle()->depth_m, 48.0f);
  EXPECT_EQ(map_.View().known_leaf_count(), summary.leaves_written);
  EXPECT_GT(summary.cells_outside, 64790u);
}

TEST(ImportAcrossTheAntimeridian, FindsBothSides) {
  const RootSquare root =
      RootSquare::CenteredOn({.latitude_deg = -17, .longitude_deg = 180}, 40000,
                             100)
          .value();
  GlobalMap map({.root = root});
  RasterBlock chart = FlatRaster(
      {.latitude_deg = -16.9, .longitude_deg = 179.9}, 0.01, 20, 20, 7, 1);
  ASSERT_THAT(map.ImportRaster(chart), IsOk());
  const GlobalMapView view = map.View();
  for (const double longitude : {179.95, 179.999, -179.999, -179.95}) {
    EXPECT_TRUE(view.At({.latitude_deg = -17, .longitude_deg = longitude}))
        << longitude;
  }
  EXPECT_FALSE(view.At({.latitude_deg = -17, .longitude_deg = -179.85}));
}

TEST(ImportIntoAFullMap, GoesToCoarserLeavesAndSaysSo) {
  const RootSquare root = SquareOf(40960, 10.1);
  GlobalMap map({.root = root, .max_cells = 1000});
  RasterBlock chart = FlatRaster(
      {.latitude_deg = 41.51, .longitude_deg = -71.31}, kStep, 40, 40, 20, 1);
  const auto summary = map.ImportRaster(chart);
  ASSERT_THAT(summary, IsOk());
  EXPECT_GT(summary->degraded, 500u);
  EXPECT_LE(map.leaf_count(), 1000u);
  const GlobalMapView view = map.View();
  for (int i = 0; i < 40; ++i) {
    EXPECT_TRUE(view.At({.latitude_deg = 41.51 - (i + 0.5) * kStep,
                         .longitude_deg = -71.31 + (i + 0.5) * kStep}));
  }
}

class BadRaster : public ::testing::Test {
 protected:
  void ExpectRefused(const char* text) {
    GlobalMap map({.root = SquareOf(40960, 10.1)});
    EXPECT_THAT(map.ImportRaster(chart_),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(text)));
    EXPECT_EQ(map.leaf_count(), 1u);
  }
  RasterBlock chart_ = FlatRaster(
      {.latitude_deg = 41.51, .longitude_deg = -71.31}, kStep, 4, 4, 20, 1);
};

TEST_F(BadRaster, StartsOutGood) {
  EXPECT_THAT(ValidateRaster(chart_), IsOk());
}
TEST_F(BadRaster, Empty) {
  chart_.rows = 0;
  ExpectRefused("rows=0");
}
TEST_F(BadRaster, SizesThatWouldOverflow) {
  chart_.rows = 0xffffffff;
  chart_.columns = 0xffffffff;
  ExpectRefused("columns=4294967295");
}
TEST_F(BadRaster, OneCellMoreThanTheLimit) {
  chart_.rows = 1;
  chart_.columns = (1u << 24) + 1;
  ExpectRefused("16777216");
}
TEST_F(BadRaster, ArraysOfAnotherSize) {
  chart_.depth_m.pop_back();
  ExpectRefused("15 depth_m");
}
TEST_F(BadRaster, StepsThatAreNoSteps) {
  chart_.latitude_step_deg = std::numeric_limits<double>::quiet_NaN();
  ExpectRefused("latitude_step_deg");
}
TEST_F(BadRaster, BeyondThePole) {
  chart_.latitude_step_deg = 50;
  ExpectRefused("fit on the Earth");
}
TEST_F(BadRaster, InfiniteDepth) {
  chart_.depth_m[3] = std::numeric_limits<float>::infinity();
  ExpectRefused("depth_m[3]=inf");
}
TEST_F(BadRaster, NoDataThatNobodyReplaced) {
  chart_.depth_m[3] = 1e6f;
  ExpectRefused("depth_m[3]");
}
TEST_F(BadRaster, StdOfZero) {
  chart_.std_m[0] = 0;
  ExpectRefused("std_m[0]=0");
}

}  // namespace
}  // namespace fathom::map
