// Merging another mission's map.

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "map/global/global_map.h"
#include "tests/map/global/scene.h"

namespace fathom::map {
namespace {

constexpr std::uint32_t kNow = 1'000'000;

// Larger, elsewhere, its sides turned by 10 degrees.
RootSquare TurnedSquare(double min_cell_m) {
  return RootSquare::Create({.latitude_deg = 41.0, .longitude_deg = -72.0},
                            {.latitude_deg = 41.9, .longitude_deg = -71.8},
                            min_cell_m)
      .value();
}

using Leaves = std::vector<std::pair<CellKey, Leaf>>;

Leaves KnownLeaves(GlobalMap& map) {
  Leaves leaves;
  map.View().ForEachLeaf([&](const CellKey& cell, const Leaf& leaf) {
    if (leaf.known()) leaves.emplace_back(cell, leaf);
  });
  return leaves;
}

void ExpectSameLeaves(GlobalMap& one, GlobalMap& other) {
  const Leaves a = KnownLeaves(one);
  const Leaves b = KnownLeaves(other);
  ASSERT_GT(a.size(), 0u);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].first, b[i].first) << i;
    ASSERT_EQ(a[i].second, b[i].second) << i;
  }
}

// A survey of noisy, sloping ground with a rock here and there, its depths
// drawn from `seed`.
void Survey(GlobalMap& map, std::array<double, 4> south_north_west_east_m,
            unsigned seed, double cell_m = 10.1) {
  const NedFrame frame(kNarragansett);
  const auto& [south, north, west, east] = south_north_west_east_m;
  map.MergeArea(Rectangle(frame, south, north, west, east), cell_m,
                [&](const GeodeticPoint& p) {
                  const NedPoint ned = frame.ToNed(p);
                  const auto at =
                      static_cast<unsigned>(std::lround(ned.north_m) * 8191 +
                                            std::lround(ned.east_m));
                  std::minstd_rand random(seed * 1'000'003u + at);
                  const auto draw = [&random] {
                    return static_cast<float>(random() % 1000) / 1000.0f;
                  };
                  random.discard(3);
                  DepthEstimate found = Measured(
                      20.0f + 0.01f * static_cast<float>(ned.north_m) + draw(),
                      0.3f + draw(), 100 + at % 50);
                  found.variability_m = 0.2f;
                  if (random() % 20 == 0) found.hazard_m = found.depth_m - 5;
                  return found;
                });
}

class MergeMap : public ::testing::Test {
 protected:
  // No two leaves within the tolerance: conglomeration joins none.
  GlobalMap Empty(double side_m = 1280, double min_cell_m = 10.1) const {
    return GlobalMap(
        {.root = SquareOf(side_m, min_cell_m), .tolerance_m = 1e-6});
  }
  const GlobalMap::MapMergeOptions options_{.now_s = kNow};
};

TEST_F(MergeMap, IntoAnEmptyMapOfTheSameSquareEveryLeafComesBitForBit) {
  GlobalMap from({.root = SquareOf(1280, 10.1)});
  Survey(from, {-300, 300, -300, 200}, 1);
  const GlobalMap::ImportSummary chart =
      from.ImportRaster(FlatRaster({41.504, -71.305}, 0.0005, 20, 20, 30, 1))
          .value();
  ASSERT_GT(chart.leaves_written, 0u);
  from.Conglomerate();
  GlobalMap into({.root = SquareOf(1280, 10.1)});
  const auto summary = into.MergeMap(from.View(), options_);
  EXPECT_EQ(summary.leaves_written, from.View().known_leaf_count());
  EXPECT_EQ(summary.degraded, 0u);
  ExpectSameLeaves(into, from);
  // Nothing is left to be joined.
  into.Conglomerate();
  ExpectSameLeaves(into, from);
}

TEST_F(MergeMap, TwoMissionsMergedEqualOneThatSurveyedBoth) {
  GlobalMap one = Empty();
  GlobalMap two = Empty();
  GlobalMap both = Empty();
  for (GlobalMap* map : {&one, &both}) Survey(*map, {-300, 200, -300, 100}, 1);
  for (GlobalMap* map : {&two, &both}) Survey(*map, {-100, 400, -200, 300}, 2);
  for (GlobalMap* map : {&one, &two, &both}) map->Conglomerate();
  one.MergeMap(two.View(), options_);
  ExpectSameLeaves(one, both);
}

TEST_F(MergeMap, AChartFillsOnlyWhatIsUnknown) {
  GlobalMap from = Empty();
  from.ImportRaster(FlatRaster({41.504, -71.305}, 0.0005, 20, 20, 30, 1))
      .value();
  GlobalMap into = Empty();
  Survey(into, {-100, 100, -100, 100}, 1);
  const auto measured = into.View().At(kNarragansett);
  EXPECT_GT(into.MergeMap(from.View(), options_).kept_measured, 0u);
  EXPECT_EQ(into.View().At(kNarragansett)->depth_m, measured->depth_m);
  // 0.003 degrees north are 333 m, outside the survey.
  const auto charted = into.View().At({41.503, -71.3});
  ASSERT_TRUE(charted);
  EXPECT_EQ(charted->kind, EvidenceKind::kPrior);
  EXPECT_EQ(charted->depth_m, 30.0f);
  // Once more: the same chart is not counted twice.
  const float std_m = charted->std_m;
  into.MergeMap(from.View(), options_);
  EXPECT_EQ(into.View().At({41.503, -71.3})->std_m, std_m);
}

TEST_F(MergeMap, AsAChartItsHazardsComeAndMeasurementsOutweighIt) {
  GlobalMap from = Empty();
  Survey(from, {-300, 300, -300, 300}, 1);
  GlobalMap into = Empty();
  into.MergeMap(from.View(), {.now_s = kNow, .as_chart = true});
  const Leaves theirs = KnownLeaves(from);
  const Leaves ours = KnownLeaves(into);
  ASSERT_EQ(ours.size(), theirs.size());
  for (std::size_t i = 0; i < ours.size(); ++i) {
    ASSERT_EQ(ours[i].second.kind(), LeafKind::kPrior);
    ASSERT_EQ(ours[i].second.depth_m, theirs[i].second.depth_m);
    ASSERT_EQ(ours[i].second.hazard_m, theirs[i].second.hazard_m);
  }
  // As a chart it may come again.
  into.MergeMap(from.View(), {.now_s = kNow, .as_chart = true});
  ASSERT_EQ(KnownLeaves(into), ours);
}

TEST_F(MergeMap, AgeWidensWhatComes) {
  const CellKey cell{.level = 7, .row = 64, .col = 64};
  GlobalMap from = Empty();
  const auto measure = [&](GlobalMap& map, std::uint32_t time_s) {
    map.MergeArea(
        SquareOf(1280, 10.1).Corners(cell), 10.1,
        [&](const GeodeticPoint&) { return Measured(20.0f, 0.3f, time_s); });
  };
  measure(from, kNow - 1600);
  GlobalMap into = Empty();
  into.MergeMap(from.View(), {.widening_m2_s = 1e-4, .now_s = kNow});
  const GeodeticPoint center = SquareOf(1280, 10.1).Center(cell);
  // 0.3^2 + 1e-4 x 1600 = 0.09 + 0.16 = 0.5^2; codes are 0.2 % apart.
  EXPECT_NEAR(into.View().At(center)->std_m, 0.5, 0.5 * 0.002);
  EXPECT_EQ(into.View().At(center)->time_s, kNow - 1600);
  // A time that is not known is the one that is stated.
  GlobalMap timeless = Empty();
  measure(timeless, 0);
  GlobalMap aged = Empty();
  aged.MergeMap(
      timeless.View(),
      {.widening_m2_s = 1e-4, .now_s = kNow, .unknown_time_s = kNow - 9100});
  // 0.09 + 0.91 = 1.
  EXPECT_NEAR(aged.View().At(center)->std_m, 1.0, 0.002);
}

TEST_F(MergeMap, ThePartOfALeafThatIsCoarserInheritsAsADivisionDoes) {
  GlobalMap from = Empty();
  Survey(from, {-320, 320, -320, 320}, 1, 40);
  GlobalMap into = Empty();
  Survey(into, {0, 10, 0, 10}, 2);  // One fine cell, unknown siblings.
  const GeodeticPoint inside = NedFrame(kNarragansett).ToGeodetic(5, 5);
  const auto fine = into.View().LeafAt(inside);
  const auto coarse = from.View().LeafAt(inside);
  ASSERT_GT(fine->first.level, coarse->first.level);
  into.MergeMap(from.View(), options_);
  const auto sibling =
      into.View().LeafAt(into.View().root().Center({.level = fine->first.level,
                                                    .row = fine->first.row ^ 1,
                                                    .col = fine->first.col}));
  EXPECT_EQ(sibling->first.level, fine->first.level);
  EXPECT_EQ(sibling->second.depth_m, coarse->second.depth_m);
  // The predictive std stays, its parts move (DividedLeaf).
  EXPECT_NEAR(sibling->second.std_m(), coarse->second.std_m(), 0.01);
  EXPECT_LT(sibling->second.variability_m(), coarse->second.variability_m());
}

// Every leaf of theirs is found again in ours, no hazard is lost and no answer
// is free above what they know.
void ExpectNothingLost(GlobalMap& from, GlobalMap& into) {
  const GlobalMapView ours = into.View();
  const GlobalMapView theirs = from.View();
  const RootSquare& root = theirs.root();
  std::size_t hazards = 0;
  theirs.ForEachLeaf([&](const CellKey& cell, const Leaf& leaf) {
    if (!leaf.known()) return;
    float least_hazard_m = kNoHazard;
    bool known = false;
    // 16 x 16 points of the cell.
    for (int i = 0; i < 16; ++i) {
      for (int j = 0; j < 16; ++j) {
        const auto at = ours.At(root.Unproject(
            {.u = std::ldexp(cell.row + (i + 0.5) / 16, -cell.level),
             .v = std::ldexp(cell.col + (j + 0.5) / 16, -cell.level)}));
        if (!at) continue;
        known = true;
        if (!std::isnan(at->hazard_m)) {
          least_hazard_m = std::min(least_hazard_m, at->hazard_m);
        }
      }
    }
    ASSERT_TRUE(known) << cell.row << " " << cell.col;
    if (leaf.hazard_m == kNoHazard) return;
    ++hazards;
    ASSERT_LE(least_hazard_m, leaf.hazard_m) << cell.row << " " << cell.col;
  });
  EXPECT_GT(hazards, 10u);
}

TEST_F(MergeMap, AnotherSquareLosesNoLeafAndNoHazard) {
  GlobalMap from = Empty();
  Survey(from, {-300, 300, -300, 300}, 1);
  for (const double min_cell_m : {8.0, 10.0, 33.0, 80.0}) {
    SCOPED_TRACE(min_cell_m);
    GlobalMap into({.root = TurnedSquare(min_cell_m), .tolerance_m = 1e-6});
    const auto summary = into.MergeMap(from.View(), options_);
    EXPECT_EQ(summary.degraded, 0u);
    ExpectNothingLost(from, into);
    // No cell far from the survey: 600 m square and a cell to each side.
    std::size_t known = 0;
    double area_m2 = 0;
    into.View().ForEachLeaf([&](const CellKey& cell, const Leaf& leaf) {
      if (!leaf.known()) return;
      ++known;
      const double side_m = into.View().root().cell_size_m(cell.level);
      area_m2 += side_m * side_m;
    });
    EXPECT_GT(known, 0u);
    const double outer_m = 600 + 2 * std::max(10.0, min_cell_m);
    EXPECT_LT(area_m2, 1.05 * outer_m * outer_m);
    EXPECT_GT(area_m2, 0.9 * 600 * 600);
  }
}

TEST_F(MergeMap, DepthsOfAnotherSquareAreThoseOfTheGround) {
  GlobalMap from = Empty();
  const NedFrame frame(kNarragansett);
  from.MergeArea(Rectangle(frame, -300, 300, -300, 300), 10.1,
                 [&](const GeodeticPoint& p) {
                   return Measured(
                       20 + 0.02f * static_cast<float>(frame.ToNed(p).east_m),
                       0.3f);
                 });
  GlobalMap into({.root = SquareOf(50'000, 12), .tolerance_m = 1e-6});
  into.MergeMap(from.View(), options_);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(-280, 280);
  for (int i = 0; i < 500; ++i) {
    const double north_m = place(random);
    const double east_m = place(random);
    const auto at = into.View().At(frame.ToGeodetic(north_m, east_m));
    ASSERT_TRUE(at);
    // A cell's middle and the leaf's that is asked are each up to half a
    // diagonal of 12 m off: 17 m x 0.02 = 0.34 m.
    EXPECT_NEAR(at->depth_m, 20 + 0.02 * east_m, 0.34);
    // The mean of four parts is not more certain than one of them.
    EXPECT_GE(at->std_m, 0.299f);
  }
}

TEST_F(MergeMap, AShoreInAMeasuredCellIsAHazard) {
  GlobalMap from = Empty();
  Survey(from, {-300, 300, -300, 0}, 1);
  RasterBlock land = FlatRaster({41.504, -71.29999}, 0.0001, 80, 20, 0, 1);
  land.land.assign(std::size_t{80} * 20, 1);
  ASSERT_TRUE(from.ImportRaster(land).ok());
  // Cells of up to 60 m over a shore of 10 m cells.
  GlobalMap into({.root = TurnedSquare(60), .tolerance_m = 1e-6});
  into.MergeMap(from.View(), options_);
  std::size_t shores = 0;
  into.View().ForEachLeaf([&](const CellKey&, const Leaf& leaf) {
    if (leaf.kind() == LeafKind::kMeasured && leaf.hazard_m == kLandDepthM) {
      ++shores;
    }
  });
  EXPECT_GE(shores, 8u);  // 600 m / 60 m, two at the ends.
}

TEST_F(MergeMap, TooFewCellsAreCounted) {
  GlobalMap from = Empty();
  Survey(from, {-300, 300, -300, 300}, 1);
  GlobalMap into(
      {.root = SquareOf(1280, 10.1), .max_cells = 100, .tolerance_m = 1e-6});
  EXPECT_GT(into.MergeMap(from.View(), options_).degraded, 0u);
}

TEST_F(MergeMap, NothingInCommonChangesNothing) {
  GlobalMap from = Empty();
  Survey(from, {-300, 300, -300, 300}, 1);
  GlobalMap into(
      {.root = RootSquare::CenteredOn({.latitude_deg = 10, .longitude_deg = 20},
                                      10'000, 10)
                   .value()});
  EXPECT_EQ(into.MergeMap(from.View(), options_).leaves_written, 0u);
  EXPECT_EQ(into.View().known_leaf_count(), 0u);
  EXPECT_EQ(from.MergeMap(into.View(), options_).leaves_written, 0u);
}

}  // namespace
}  // namespace fathom::map
