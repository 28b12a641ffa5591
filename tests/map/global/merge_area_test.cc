// Transfer of local evidence (Nervegna 2002, section 4.4.4).

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "map/global/global_map.h"
#include "tests/map/global/scene.h"

namespace fathom::map {
namespace {

// A square of 640 m in cells of 10 m: level 6, one tile.
class MergeArea : public ::testing::Test {
 protected:
  MergeArea() : root_(SquareOf(640, 10.1)), map_({.root = root_}) {}

  // Measures one cell of the finest level.
  GlobalMap::WriteSummary Measure(const CellKey& cell, float depth_m,
                                  float std_m, std::uint32_t time_s = 100) {
    return map_.MergeArea(root_.Corners(cell), 10.1, [&](const GeodeticPoint&) {
      return Measured(depth_m, std_m, time_s);
    });
  }
  std::optional<DepthEstimate> At(const CellKey& cell) {
    return map_.View().At(root_.Center(cell));
  }

  RootSquare root_;
  GlobalMap map_;
  const CellKey cell_{.level = 6, .row = 20, .col = 30};
};

TEST_F(MergeArea, AnUnknownLeafTakesTheEvidence) {
  EXPECT_FALSE(At(cell_));
  const auto summary = Measure(cell_, 12.5f, 0.25f);
  EXPECT_EQ(summary.leaves_written, 1u);
  EXPECT_EQ(summary.degraded, 0u);
  const auto estimate = At(cell_);
  ASSERT_TRUE(estimate);
  EXPECT_EQ(estimate->depth_m, 12.5f);
  EXPECT_EQ(estimate->std_m, 0.25f);
  EXPECT_EQ(estimate->kind, EvidenceKind::kMeasured);
  EXPECT_EQ(estimate->time_s, 100u);
  EXPECT_NEAR(estimate->cell_size_m, 10, 0.1);
  EXPECT_TRUE(std::isnan(estimate->shoalest_m));
}

TEST_F(MergeArea, TouchesNoOtherLeaf) {
  Measure(cell_, 12.5f, 0.25f);
  // One measured leaf; three unknown siblings at each of six levels.
  EXPECT_EQ(map_.View().known_leaf_count(), 1u);
  EXPECT_EQ(map_.leaf_count(), 1u + 3u * 6u);
  EXPECT_FALSE(At({.level = 6, .row = 20, .col = 31}));
}

TEST_F(MergeArea, FusesByEquations417To420) {
  Measure(cell_, 10.0f, 0.5f, 100);
  Measure(cell_, 11.0f, 1.0f, 90);
  // k = 0.25 / (0.25 + 1) = 0.2; mean = 10 + 0.2 * 1 = 10.2;
  // variance = 0.8 * 0.25 = 0.2, std = 0.44721; the newer time stays.
  const auto estimate = At(cell_);
  ASSERT_TRUE(estimate);
  EXPECT_FLOAT_EQ(estimate->depth_m, 10.2f);
  EXPECT_NEAR(estimate->std_m, std::sqrt(0.2), 0.44721 * 0x1p-10);
  EXPECT_EQ(estimate->time_s, 100u);
}

TEST_F(MergeArea, PriorCountsOnceAndManyTransfersEqualTheBatch) {
  // Prior 20 +- 6 over the whole square; three surveys of the same cell. The
  // batch solution: weights 1/36, 1/0.25, 1/0.16, 1/1. (A prior of less than
  // 5.98 would be contradicted by 14 +- 0.5, and widened.)
  const GeodeticPoint corner = Direct(kNarragansett, 315, 600);
  ASSERT_TRUE(
      map_.ImportRaster(FlatRaster(corner, 0.002, 8, 8, 20.0f, 6.0f)).ok());
  EXPECT_EQ(At(cell_)->kind, EvidenceKind::kPrior);
  Measure(cell_, 14.0f, 0.5f);
  Measure(cell_, 14.6f, 0.4f);
  Measure(cell_, 13.0f, 1.0f);
  const double weight = 1 / 36.0 + 1 / 0.25 + 1 / 0.16 + 1;
  const double mean = (20.0 / 36 + 14.0 / 0.25 + 14.6 / 0.16 + 13.0) / weight;
  const auto estimate = At(cell_);
  // Each stored std errs by 2^-10 at most, so each weight by 2^-9, four times;
  // the means lie within 7 m of each other.
  EXPECT_NEAR(estimate->depth_m, mean, 4 * 0x1p-9 * 0.6);
  EXPECT_NEAR(estimate->std_m, 1 / std::sqrt(weight),
              4 * 0x1p-10 / std::sqrt(weight));
  EXPECT_EQ(estimate->kind, EvidenceKind::kMeasured);
}

TEST_F(MergeArea, VariabilityDoesNotShrinkWithMoreEvidence) {
  // Predictive 0.5 of which 0.4 is variability: the mean is known to 0.3. Nine
  // such surveys know it to 0.1, and the cell still varies by 0.4.
  for (int i = 0; i < 9; ++i) {
    map_.MergeArea(root_.Corners(cell_), 10.1, [](const GeodeticPoint&) {
      DepthEstimate estimate = Measured(12, 0.5f);
      estimate.variability_m = 0.4f;
      return estimate;
    });
  }
  const auto estimate = At(cell_);
  // A spread code is right to 0.9 %, and was rounded nine times.
  EXPECT_NEAR(estimate->std_m, std::sqrt(0.01 + 0.16), 0.025 * 0.412);
  EXPECT_NEAR(estimate->variability_m, 0.4, 0.025 * 0.4);
}

TEST_F(MergeArea, TheShoalestHazardStaysAndASeabedIsNone) {
  const auto survey = [this](float depth_m, float hazard_m) {
    map_.MergeArea(root_.Corners(cell_), 10.1, [=](const GeodeticPoint&) {
      DepthEstimate estimate = Measured(depth_m, 0.5f);
      estimate.hazard_m = hazard_m;
      return estimate;
    });
  };
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  survey(12, kNone);
  EXPECT_TRUE(std::isnan(At(cell_)->hazard_m));
  survey(12, 12.5f);  // Below the seabed.
  EXPECT_TRUE(std::isnan(At(cell_)->hazard_m));
  survey(12, 6.3f);
  EXPECT_EQ(At(cell_)->hazard_m, 6.3f);
  survey(12, 4.1f);
  survey(12, 8.0f);
  survey(12, kNone);
  EXPECT_EQ(At(cell_)->hazard_m, 4.1f);
  EXPECT_NEAR(At(cell_)->depth_m, 12, 1e-5);
  EXPECT_EQ(map_.View().Bounds({})->shoalest_m, 4.1f);
  EXPECT_EQ(map_.View().Bounds(cell_)->shoalest_m, 4.1f);
}

TEST_F(MergeArea, ChildrenInheritTheValueOfADividedLeaf) {
  const GeodeticPoint corner = Direct(kNarragansett, 315, 600);
  ASSERT_TRUE(
      map_.ImportRaster(FlatRaster(corner, 0.002, 8, 8, 20.0f, 5.0f)).ok());
  ASSERT_LT(map_.leaf_count(), 200u);
  Measure(cell_, 14.0f, 0.5f);
  const auto beside = At({.level = 6, .row = 20, .col = 31});
  ASSERT_TRUE(beside);
  EXPECT_EQ(beside->depth_m, 20.0f);
  EXPECT_EQ(beside->kind, EvidenceKind::kPrior);
}

TEST_F(MergeArea, WaterFoundOnChartedLandIsBelieved) {
  RasterBlock land =
      FlatRaster(Direct(kNarragansett, 315, 600), 0.002, 8, 8, 0.0f, 1.0f);
  land.land.assign(64, 1);
  ASSERT_TRUE(map_.ImportRaster(land).ok());
  EXPECT_EQ(At(cell_)->kind, EvidenceKind::kLand);
  Measure(cell_, 6.0f, 0.5f);
  EXPECT_EQ(At(cell_)->kind, EvidenceKind::kMeasured);
  EXPECT_EQ(At(cell_)->depth_m, 6.0f);
  EXPECT_EQ(At(cell_)->std_m, 0.5f);
}

TEST_F(MergeArea, OnlySoundMeasurementsCount) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  DepthEstimate prior = Measured(5, 1);
  prior.kind = EvidenceKind::kPrior;
  DepthEstimate smoothed = Measured(5, 1);
  smoothed.kind = EvidenceKind::kSmoothed;
  for (const DepthEstimate& bad :
       {Measured(nan, 1), Measured(inf, 1), Measured(5, nan), Measured(5, inf),
        Measured(5, 0), Measured(5, -1), Measured(1e6f, 1), prior, smoothed}) {
    const auto summary = map_.MergeArea(
        root_.Corners(cell_), 10.1, [&](const GeodeticPoint&) { return bad; });
    EXPECT_EQ(summary.leaves_written, 0u);
    EXPECT_EQ(summary.ignored, 1u);
  }
  EXPECT_EQ(map_.View().known_leaf_count(), 0u);
}

TEST_F(MergeArea, AreasOutsideTheSquareWriteNothing) {
  const NedFrame far(Direct(kNarragansett, 90, 50000));
  const auto source = [](const GeodeticPoint&) { return Measured(5, 1); };
  EXPECT_EQ(map_.MergeArea(Rectangle(far, -100, 100, -100, 100), 10, source)
                .leaves_written,
            0u);
  const NedFrame antipode({.latitude_deg = -41.5, .longitude_deg = 108.7});
  EXPECT_EQ(
      map_.MergeArea(Rectangle(antipode, -100, 100, -100, 100), 10, source)
          .leaves_written,
      0u);
  EXPECT_EQ(map_.leaf_count(), 1u);
}

TEST_F(MergeArea, AnAreaAcrossTheBorderWritesWhatIsInside) {
  const NedFrame frame(kNarragansett);
  // East of 280 m there are 40 m, 4 columns of 10 m, in the square; north to
  // south 20 m, 2 rows.
  const auto summary =
      map_.MergeArea(Rectangle(frame, -10, 10, 280, 500), 10.1,
                     [](const GeodeticPoint&) { return Measured(5, 1); });
  EXPECT_EQ(summary.leaves_written, 8u);
}

TEST_F(MergeArea, WhenNoCellIsLeftTheCoarserLeafIsUpdatedOnce) {
  // Room for the root and five divisions: the sixth is refused, so level 5
  // (20 m) is as fine as it gets (fig. 4-15, lines 11-13).
  GlobalMap small({.root = root_, .max_cells = 1 + 3 * 5});
  const CellKey parent{.level = 5, .row = 10, .col = 15};
  int calls = 0;
  const auto summary =
      small.MergeArea(root_.Corners(parent), 10.1, [&](const GeodeticPoint&) {
        return Measured(calls++ % 2 == 0 ? 10.0f : 12.0f, 0.5f);
      });
  EXPECT_EQ(calls, 4);
  EXPECT_EQ(summary.degraded, 4u);
  EXPECT_EQ(summary.leaves_written, 1u);
  EXPECT_EQ(small.leaf_count(), 16u);
  const auto estimate = small.View().At(root_.Center(parent));
  ASSERT_TRUE(estimate);
  EXPECT_NEAR(estimate->cell_size_m, 20, 0.1);
  // Mean 11; variance 0.25 + 1 (two 10 and two 12), not 0.25 / 4. The 1 is
  // variability inside the cell. (A spread code is right to 0.9 %.)
  EXPECT_FLOAT_EQ(estimate->depth_m, 11.0f);
  EXPECT_NEAR(estimate->std_m, std::sqrt(1.25), 0.009 * 1.12);
  EXPECT_NEAR(estimate->variability_m, 1.0, 0.012);
}

TEST_F(MergeArea, AMapOfOneCellStillTakesEvidence) {
  GlobalMap tiny({.root = root_, .max_cells = 1});
  const auto summary =
      tiny.MergeArea(root_.Corners(cell_), 10.1,
                     [](const GeodeticPoint&) { return Measured(10, 0.5f); });
  EXPECT_EQ(summary.degraded, 1u);
  EXPECT_EQ(tiny.leaf_count(), 1u);
  EXPECT_EQ(tiny.View().At(kNarragansett)->depth_m, 10.0f);
}

TEST_F(MergeArea, ACellLargerThanLocalOnesHearsThemAll) {
  // Local cells of 5 m, global ones of 10 m: four points a cell. In this cell
  // the northern half is 8 m deep, the southern 10 m.
  const double middle = root_.Center(cell_).latitude_deg;
  int calls = 0;
  map_.MergeArea(root_.Corners(cell_), 5.0, [&](const GeodeticPoint& point) {
    ++calls;
    return Measured(point.latitude_deg > middle ? 8.0f : 10.0f, 0.5f);
  });
  EXPECT_EQ(calls, 4);
  // Mean 9; variance 0.25 + 1.
  EXPECT_FLOAT_EQ(At(cell_)->depth_m, 9.0f);
  EXPECT_NEAR(At(cell_)->std_m, std::sqrt(1.25), 0.009 * 1.12);
}

TEST_F(MergeArea, WhereTheMapIsFinerEachLeafIsAskedFor) {
  Measure(cell_, 10.0f, 0.5f);
  // Now evidence in cells of 20 m over the parent: the parent is divided, so
  // its four children are offered.
  const CellKey parent{.level = 5, .row = 10, .col = 15};
  int calls = 0;
  const auto summary =
      map_.MergeArea(root_.Corners(parent), 20.01, [&](const GeodeticPoint&) {
        ++calls;
        return Measured(12.0f, 0.5f);
      });
  EXPECT_EQ(calls, 4);
  EXPECT_EQ(summary.leaves_written, 4u);
  EXPECT_FLOAT_EQ(At(cell_)->depth_m, 11.0f);  // Halfway: equal weights.
  EXPECT_FLOAT_EQ(At({.level = 6, .row = 21, .col = 31})->depth_m, 12.0f);
}

// domain.md, section 5, departure (a): 10 m local against 8.95 m global cells
// leave one pinhole in five when local midpoints are searched.
TEST(MergeAreaPinholes, TenMetresAgainstNineLeavesNone) {
  const RootSquare root = ThesisSquare();
  GlobalMap map({.root = root});
  const NedFrame frame(Direct(kNarragansett, 45, 30000));
  const auto local =
      [&frame](
          const GeodeticPoint& point) -> std::optional<std::pair<int, int>> {
    const NedPoint p = frame.ToNed(point);
    if (p.north_m < 0 || p.north_m >= 500 || p.east_m < 0 || p.east_m >= 500) {
      return std::nullopt;
    }
    return std::pair{static_cast<int>(p.north_m / 10),
                     static_cast<int>(p.east_m / 10)};
  };
  const auto summary = map.MergeArea(
      Rectangle(frame, 0, 500, 0, 500), 10.0,
      [&](const GeodeticPoint& point) -> std::optional<DepthEstimate> {
        if (!local(point)) return std::nullopt;
        return Measured(10, 0.5f);
      });
  const GlobalMapView view = map.View();
  EXPECT_EQ(summary.leaves_written, view.known_leaf_count());

  // Every global cell whose middle lies in the local map is measured.
  const auto corners = Rectangle(frame, 0, 500, 0, 500);
  const CellKey a = root.Locate(corners[1], 18).value();
  const CellKey b = root.Locate(corners[3], 18).value();
  int cells = 0;
  int pinholes = 0;
  std::set<std::pair<std::uint32_t, std::uint32_t>> by_midpoints;
  for (int i = 0; i < 50; ++i) {
    for (int j = 0; j < 50; ++j) {
      const CellKey hit =
          root.Locate(frame.ToGeodetic(10 * i + 5, 10 * j + 5), 18).value();
      by_midpoints.insert({hit.row, hit.col});
    }
  }
  for (std::uint32_t row = a.row - 10; row <= b.row + 10; ++row) {
    for (std::uint32_t col = a.col - 10; col <= b.col + 10; ++col) {
      const GeodeticPoint middle =
          root.Center({.level = 18, .row = row, .col = col});
      if (!local(middle)) continue;
      ++cells;
      pinholes += !view.At(middle).has_value();
    }
  }
  EXPECT_EQ(pinholes, 0);
  EXPECT_EQ(summary.leaves_written, static_cast<std::uint64_t>(cells));
  // The thesis's search would have left about one in five (the scene must be
  // one in which there is something to lose).
  EXPECT_GT(cells, 2900);
  EXPECT_LT(by_midpoints.size(), 0.87 * cells);
}

// Blocks of a local map share their corners; a cell must belong to exactly one
// of them, or its evidence would count twice.
TEST(MergeAreaBlocks, AdjoiningBlocksShareNoCellAndLeaveNoneOut) {
  const RootSquare root = SquareOf(4000, 1.0);
  GlobalMap whole({.root = root});
  GlobalMap blocks({.root = root});
  // A frame away from the square's middle, so that its rows are not the
  // square's.
  const NedFrame frame(Direct(kNarragansett, 200, 1500));
  const auto source = [](const GeodeticPoint& point) {
    return Measured(static_cast<float>(10 + 100 * (point.latitude_deg - 41.48)),
                    0.5f);
  };
  const auto all =
      whole.MergeArea(Rectangle(frame, 0, 320, 0, 320), 1.0, source);
  std::uint64_t written = 0;
  for (int i = 0; i < 20; ++i) {
    for (int j = 0; j < 20; ++j) {
      written += blocks
                     .MergeArea(Rectangle(frame, 16 * i, 16 * i + 16, 16 * j,
                                          16 * j + 16),
                                1.0, source)
                     .leaves_written;
    }
  }
  EXPECT_GT(all.leaves_written, 100000u);
  // The chords of 20 short sides and of one long side part by
  // 320^2 / (8 R) = 2 mm: fewer than one middle in a row of 320.
  EXPECT_NEAR(static_cast<double>(written),
              static_cast<double>(all.leaves_written), 4);
  // No cell was fused twice: one fusion halves the variance.
  int doubled = 0;
  blocks.View().ForEachLeaf([&](const CellKey&, const Leaf& leaf) {
    doubled += leaf.known() && leaf.std_m() < 0.45f;
  });
  EXPECT_EQ(doubled, 0);
  EXPECT_EQ(written, blocks.View().known_leaf_count());
}

TEST(MergeAreaDeterminism, ViewsInBetweenChangeNothing) {
  const RootSquare root = SquareOf(4000, 1.0);
  GlobalMap quiet({.root = root});
  GlobalMap watched({.root = root});
  std::mt19937 random(9);
  std::uniform_real_distribution<double> place(-1000, 1000);
  std::uniform_real_distribution<float> depth(5, 6);
  const NedFrame frame(kNarragansett);
  for (int i = 0; i < 40; ++i) {
    const double n = place(random);
    const double e = place(random);
    const float d = depth(random);
    const auto area = Rectangle(frame, n, n + 50, e, e + 50);
    const auto source = [d](const GeodeticPoint&) { return Measured(d, 0.3f); };
    quiet.MergeArea(area, 2.0, source);
    watched.MergeArea(area, 2.0, source);
    watched.View();
    if (i % 10 == 9) {
      quiet.Conglomerate();
      watched.Conglomerate();
    }
  }
  EXPECT_EQ(LeavesOf(quiet.View()), LeavesOf(watched.View()));
  EXPECT_EQ(quiet.leaf_count(), watched.View().leaf_count());
}

}  // namespace
}  // namespace fathom::map
