// Joining leaves that agree (Nervegna 2002, fig. 4-18).

#include "map/global/conglomerate.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "map/global/fuse.h"
#include "map/global/global_map.h"
#include "tests/map/global/scene.h"

namespace fathom::map {
namespace {

constexpr float kTolerance = 0.5f;

Leaf LeafOf(float depth_m, float std_m = 0.25f,
            LeafKind kind = LeafKind::kMeasured, std::uint32_t time_s = 10) {
  return {.depth_m = depth_m,
          .time_s = time_s,
          .std_code = MakeStdCode(kind, std_m)};
}

std::array<Leaf, 4> Four(float a, float b, float c, float d) {
  return {LeafOf(a), LeafOf(b), LeafOf(c), LeafOf(d)};
}

TEST(JoinByRange, VariabilityStaysApartFromWhatIsNotKnownOfTheMean) {
  std::array<Leaf, 4> four;
  // Means 10, 10, 10.4, 10.4; variance of each 0.01, variability 0.09:
  // predictive 0.1.
  for (std::size_t i = 0; i < 4; ++i) {
    four[i] = MakeLeaf(LeafKind::kMeasured, {.mean_m = i < 2 ? 10.0 : 10.4,
                                             .variance_m2 = 0.01,
                                             .variability_m2 = 0.09});
  }
  const auto joined = JoinFour(four, MergeRule::kRange, kTolerance);
  ASSERT_TRUE(joined);
  // About the mid-range 10.2: variance of the mean 0.01 + 0.2^2 = 0.05.
  EXPECT_NEAR(joined->mean_std_m(), std::sqrt(0.05), 0.001);
  EXPECT_NEAR(joined->variability_m(), 0.3, 0.01);
  // Two roundings to a spread code.
  EXPECT_NEAR(joined->std_m(), std::sqrt(0.14), 0.018 * 0.374);
}

TEST(JoinByRange, HazardsJoinOnlyWithHazardsAndTheShoalestStays) {
  std::array<Leaf, 4> four;
  four.fill(LeafOf(10, 0.25f));
  four[2].hazard_m = 4.0f;
  EXPECT_FALSE(JoinFour(four, MergeRule::kRange, kTolerance));
  four[0].hazard_m = 3.0f;
  four[1].hazard_m = 5.0f;
  EXPECT_FALSE(JoinFour(four, MergeRule::kRange, kTolerance));
  four[3].hazard_m = 6.0f;
  for (const MergeRule rule : {MergeRule::kRange, MergeRule::kPairwise}) {
    const auto joined = JoinFour(four, rule, kTolerance);
    ASSERT_TRUE(joined);
    EXPECT_EQ(joined->hazard_m, 3.0f);
  }
}

TEST(JoinByRange, TakesTheMiddleOfTheRange) {
  const auto joined = JoinFour(Four(10.0f, 10.25f, 10.25f, 10.75f),
                               MergeRule::kRange, kTolerance);
  ASSERT_TRUE(joined);
  // (10 + 10.75) / 2; residual 0.375 of 0.5: 191.25 of 255, rounded up.
  EXPECT_EQ(joined->depth_m, 10.375f);
  EXPECT_EQ(joined->residual_code, 192);
  // Moments about 10.375: 0.0625 + (0.140625 + 2 * 0.015625 + 0.140625) / 4
  // = 0.140625; the root is 0.375.
  EXPECT_NEAR(joined->std_m(), 0.375f, 0.375f * 0x1p-10f);
  EXPECT_EQ(joined->kind(), LeafKind::kMeasured);
}

TEST(JoinByRange, StopsWhereAMeanWouldLieBeyondTheTolerance) {
  EXPECT_TRUE(
      JoinFour(Four(10, 10.5f, 11, 10.5f), MergeRule::kRange, kTolerance));
  EXPECT_FALSE(
      JoinFour(Four(10, 10.5f, 11.01f, 10.5f), MergeRule::kRange, kTolerance));
}

TEST(JoinByRange, StopsWhereAnAnswerWouldBeFreeFartherDown) {
  // 19 +- 2 is FREE from 19 - 1.645 * 2 = 15.71 upward. Joined with three of 20
  // +- 0.1: mean 19.5, variance (0.25 + 4 + 3 * (0.25 + 0.01)) / 4 = 1.2575,
  // FREE from 19.5 - 1.645 * 1.1214 = 17.66: 1.9 m deeper.
  auto four = Four(20, 20, 20, 19);
  for (Leaf& leaf : four) leaf = LeafOf(leaf.depth_m, 0.1f);
  EXPECT_TRUE(JoinFour(four, MergeRule::kRange, kTolerance));
  four[3] = LeafOf(19, 2.0f);
  EXPECT_FALSE(JoinFour(four, MergeRule::kRange, kTolerance));
  // 0.2 beside three of 0.1, all 20 m deep: variance 0.0175, FREE from 20 -
  // 1.645 * 0.1323 = 19.782 in place of 19.671: 0.111 m of the 0.5 are spent.
  for (Leaf& leaf : four) leaf = LeafOf(20, 0.1f);
  four[3] = LeafOf(20, 0.2f);
  const auto joined = JoinFour(four, MergeRule::kRange, kTolerance);
  ASSERT_TRUE(joined);
  EXPECT_NEAR(DecodeResidualM(joined->residual_code, kTolerance), 0.111, 0.003);
}

TEST(JoinByRange, RemembersWhatWasJoinedBefore) {
  auto four = Four(10, 10, 10, 10);
  four[0].residual_code = 255;  // Stands for 9.5 to 10.5.
  auto joined = JoinFour(four, MergeRule::kRange, kTolerance);
  ASSERT_TRUE(joined);
  EXPECT_EQ(joined->depth_m, 10.0f);
  EXPECT_EQ(joined->residual_code, 255);
  // 9.5 to 10.6 is 1.1 m wide: too much, though all values are within 0.6.
  four[3].depth_m = 10.6f;
  EXPECT_FALSE(JoinFour(four, MergeRule::kRange, kTolerance));
}

TEST(JoinPairwise, IsFigure418AsPrinted) {
  auto four = Four(10, 10.2f, 10.4f, 10.4f);
  four[3] = LeafOf(10.4f, 0.5f);
  const auto joined = JoinFour(four, MergeRule::kPairwise, kTolerance);
  ASSERT_TRUE(joined);
  // (10 + 10.2 + 10.4 + 10.4) / 4; (3 * 0.25 + 0.5) / 4 = 0.3125.
  EXPECT_FLOAT_EQ(joined->depth_m, 10.25f);
  EXPECT_FLOAT_EQ(joined->std_m(), 0.3125f);
  // The pair 10 and 10.6 differs by more than 0.5; by range they would join.
  const auto wide = Four(10, 10.2f, 10.4f, 10.6f);
  EXPECT_FALSE(JoinFour(wide, MergeRule::kPairwise, kTolerance));
  EXPECT_TRUE(JoinFour(wide, MergeRule::kRange, kTolerance));
}

TEST(Join, KindsNeverMix) {
  for (const MergeRule rule : {MergeRule::kRange, MergeRule::kPairwise}) {
    for (const Leaf& odd : {Leaf{}, LeafOf(10, 0.25f, LeafKind::kPrior),
                            LeafOf(10, 0.25f, LeafKind::kLand)}) {
      auto four = Four(10, 10, 10, 10);
      four[2] = odd;
      EXPECT_FALSE(JoinFour(four, rule, kTolerance));
    }
  }
}

TEST(Join, UnknownJoinsUnknownAndLandLand) {
  EXPECT_EQ(JoinFour({}, MergeRule::kRange, kTolerance), Leaf{});
  const Leaf land = LeafOf(kLandDepthM, 0.001f, LeafKind::kLand);
  EXPECT_EQ(JoinFour({land, land, land, land}, MergeRule::kRange, kTolerance),
            land);
}

TEST(Join, AnAnswerLooksNoFresherThanItsOldestPart) {
  auto four = Four(10, 10, 10, 10);
  four[1].time_s = 3;
  EXPECT_EQ(JoinFour(four, MergeRule::kRange, kTolerance)->time_s, 3u);
  four[1].time_s = 0;
  EXPECT_EQ(JoinFour(four, MergeRule::kRange, kTolerance)->time_s, 0u);
}

// ---- In the tree. ----

// A root of 10.24 km in cells of 10 m: level 10, two layers of tiles.
class Conglomerate : public ::testing::Test {
 protected:
  Conglomerate() : root_(SquareOf(10240, 10.1)), map_({.root = root_}) {}

  template <typename Depth>
  void MeasureAll(double side_m, Depth depth) {
    const NedFrame frame(kNarragansett);
    const double h = side_m / 2;
    map_.MergeArea(
        Rectangle(frame, -h, h, -h, h), 10.1, [&](const GeodeticPoint& point) {
          const NedPoint p = frame.ToNed(point);
          return Measured(static_cast<float>(depth(p.north_m, p.east_m)), 0.2f);
        });
  }

  RootSquare root_;
  GlobalMap map_;
};

TEST_F(Conglomerate, AFlatSquareBecomesOneLeaf) {
  MeasureAll(11000, [](double, double) { return 12.0; });
  EXPECT_EQ(map_.leaf_count(), 1024u * 1024u);
  const auto summary = map_.Conglomerate();
  EXPECT_EQ(summary.leaves_before, 1024u * 1024u);
  EXPECT_EQ(summary.leaves_after, 1u);
  // 4^0 + 4^1 + ... + 4^9 = (4^10 - 1) / 3.
  EXPECT_EQ(summary.merges, 349525u);
  const GlobalMapView view = map_.View();
  EXPECT_EQ(view.leaf_count(), 1u);
  EXPECT_EQ(view.root_tile()->totals().tiles, 1u);
  EXPECT_EQ(view.At(kNarragansett)->depth_m, 12.0f);
}

TEST_F(Conglomerate, UnknownSiblingsGoBackToLargeLeaves) {
  const CellKey cell{.level = 10, .row = 500, .col = 700};
  map_.MergeArea(root_.Corners(cell), 10.1,
                 [](const GeodeticPoint&) { return Measured(12, 0.2f); });
  map_.Conglomerate();
  // One cell of level 10: itself and three siblings at each of ten levels.
  EXPECT_EQ(map_.View().known_leaf_count(), 1u);
  EXPECT_EQ(map_.leaf_count(), 1u + 3u * 10u);
}

TEST_F(Conglomerate, TheSecondRunFindsNothingAndKeepsEveryTile) {
  MeasureAll(3000, [](double n, double e) {
    return 20 + 3 * std::sin(n / 150) * std::cos(e / 200);
  });
  map_.Conglomerate();
  const GlobalMapView before = map_.View();
  EXPECT_EQ(map_.Conglomerate().merges, 0u);
  EXPECT_EQ(map_.View().root_tile(), before.root_tile());
}

TEST_F(Conglomerate, AfterAWriteTheWholePathIsSeenAgain) {
  MeasureAll(11000, [](double, double) { return 12.0; });
  map_.Conglomerate();
  map_.View();
  // The same value again in one cell: divided, and joined again.
  const CellKey cell = root_.Locate(kNarragansett, 10).value();
  map_.MergeArea(root_.Corners(cell), 10.1,
                 [](const GeodeticPoint&) { return Measured(12, 0.2f); });
  EXPECT_EQ(map_.leaf_count(), 1u + 3u * 10u);
  map_.View();
  map_.Conglomerate();
  EXPECT_EQ(map_.leaf_count(), 1u);
}

TEST_F(Conglomerate, AWriteBetweenTwoRunsIsSeenWithoutAView) {
  MeasureAll(11000, [](double, double) { return 12.0; });
  map_.Conglomerate();
  const CellKey cell = root_.Locate(kNarragansett, 10).value();
  map_.MergeArea(root_.Corners(cell), 10.1,
                 [](const GeodeticPoint&) { return Measured(12, 0.2f); });
  map_.Conglomerate();
  EXPECT_EQ(map_.leaf_count(), 1u);
}

// The safety property: whatever is measured, in whatever order, and however
// often leaves are joined, no mean is farther than the tolerance from what
// the cell would hold had nothing ever been joined.
TEST_F(Conglomerate, NoMeanDriftsFartherThanTheTolerance) {
  GlobalMap fine({.root = root_});
  const NedFrame frame(kNarragansett);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> place(-1500, 1100);
  for (int round = 0; round < 30; ++round) {
    // A patch of new ground each time (unknown leaves take the evidence), in
    // slopes that fig. 4-18 would join step by step.
    const double n = place(random);
    const double e = place(random);
    const auto source =
        [&](const GeodeticPoint& point) -> std::optional<DepthEstimate> {
      if (fine.View().At(point)) return std::nullopt;
      const NedPoint p = frame.ToNed(point);
      return Measured(static_cast<float>(20 + 0.004 * p.north_m +
                                         0.3 * std::sin(p.east_m / 70)),
                      0.2f);
    };
    // The same cells for both: gathered before either is written.
    Leaves known;
    std::map<std::pair<double, double>, DepthEstimate> answers;
    const auto remember =
        [&](const GeodeticPoint& point) -> std::optional<DepthEstimate> {
      const auto answer = source(point);
      if (answer) {
        answers[{point.latitude_deg, point.longitude_deg}] = *answer;
      }
      return answer;
    };
    const auto area = Rectangle(frame, n, n + 300, e, e + 300);
    GlobalMap scratch({.root = root_});
    scratch.MergeArea(area, 10.1, remember);
    const auto replay =
        [&](const GeodeticPoint& point) -> std::optional<DepthEstimate> {
      const auto it = answers.find({point.latitude_deg, point.longitude_deg});
      if (it == answers.end()) return std::nullopt;
      return it->second;
    };
    fine.MergeArea(area, 10.1, replay);
    map_.MergeArea(area, 10.1, replay);
    map_.Conglomerate();
  }
  const GlobalMapView joined = map_.View();
  const GlobalMapView truth = fine.View();
  EXPECT_LT(joined.known_leaf_count(), truth.known_leaf_count() / 3);
  double worst = 0;
  int compared = 0;
  truth.ForEachLeaf([&](const CellKey& cell, const Leaf& leaf) {
    if (!leaf.known()) return;
    const auto at = joined.LeafAt(root_.Center(cell));
    ASSERT_TRUE(at && at->second.known());
    const double off = std::abs(at->second.depth_m - leaf.depth_m);
    worst = std::max(worst, off);
    ++compared;
    // What the leaf remembers is true, too.
    ASSERT_LE(off, DecodeResidualM(at->second.residual_code, 0.5f) + 1e-5);
  });
  EXPECT_GT(compared, 10000);
  EXPECT_LE(worst, 0.5 + 1e-5);
  EXPECT_GT(worst, 0.3);  // The scene does use the tolerance.
}

// Why fig. 4-18 is not the default: it joins averages of averages.
TEST_F(Conglomerate, Figure418DriftsBeyondItsTolerance) {
  // A ramp of 0.35 m per 10 m column in the north-south mean: neighbours agree
  // within 0.5 m, and after each round the averages of rounds still do, where
  // rows compensate. Built directly: a 4 x 4 patch whose quarters have means
  // 10.0, 10.3, 10.3, 10.4 but whose cells reach from 9.75 on.
  const CellKey patch{.level = 8, .row = 100, .col = 100};
  const auto value = [](std::uint32_t quarter, std::uint32_t part) {
    const float mean[4] = {10.0f, 10.3f, 10.3f, 10.4f};
    const float offset[4] = {-0.25f, 0.25f, -0.25f, 0.25f};
    return mean[quarter] + offset[part];
  };
  for (std::uint32_t z = 0; z < 16; ++z) {
    const CellKey cell{.level = 10,
                       .row = 4 * patch.row + ZOrderRow(z),
                       .col = 4 * patch.col + ZOrderCol(z)};
    map_.MergeArea(root_.Corners(cell), 10.1, [&](const GeodeticPoint&) {
      return Measured(value(z / 4, z % 4), 0.2f);
    });
  }
  map_.Conglomerate(MergeRule::kPairwise);
  const auto at = map_.View().LeafAt(root_.Center(patch));
  ASSERT_TRUE(at);
  EXPECT_EQ(at->first, patch);
  // (10 + 10.3 + 10.3 + 10.4) / 4 = 10.25, half a metre from 9.75 already;
  // two such levels more and it is a metre. The code is at its end.
  EXPECT_NEAR(at->second.depth_m, 10.25, 1e-5);
  EXPECT_EQ(at->second.residual_code, 255);
}

TEST(ConglomerateAreas, LeavesWhatIsKeptAsItWasUntilItIsFree) {
  const RootSquare root = SquareOf(640, 10.1);
  GlobalMap map({.root = root});
  map.MergeArea(root.Corners({}), 10.1,
                [](const GeodeticPoint&) { return Measured(10, 0.25f); });
  ASSERT_EQ(map.leaf_count(), 4096u);
  // The cells of level 1: the north-western quarter is kept.
  const CellKey quarter{.level = 1, .row = 0, .col = 0};
  std::array<GeodeticPoint, 4> inner = root.Corners(quarter);
  const GeodeticPoint middle = root.Center(quarter);
  for (GeodeticPoint& corner : inner) {
    // A tenth towards the middle: no rounding reaches the neighbours.
    corner.latitude_deg += 0.1 * (middle.latitude_deg - corner.latitude_deg);
    corner.longitude_deg += 0.1 * (middle.longitude_deg - corner.longitude_deg);
  }
  const std::array<LatticeBox, 1> kept{root.BoxAround(inner).value()};
  map.Conglomerate(MergeRule::kRange, kept);
  // Three quarters became one leaf each; of the kept one only the rim outside
  // the box may have joined: 0.9 x 0.9 of its 1024 cells are inside, 829.
  const auto at = map.View().LeafAt(middle);
  EXPECT_EQ(at->first.level, 6);
  EXPECT_EQ(map.View().LeafAt(root.Center({1, 1, 1}))->first.level, 1);
  EXPECT_GT(map.leaf_count(), 3u + 829u);
  // Again: nothing is free yet.
  const auto before = LeavesOf(map.View());
  map.Conglomerate(MergeRule::kRange, kept);
  EXPECT_EQ(LeavesOf(map.View()), before);
  // Free: all becomes one.
  map.Conglomerate();
  EXPECT_EQ(map.leaf_count(), 1u);
}

TEST(ConglomerateAreas, AHazardStaysAsSmallAsItWasFound) {
  const RootSquare root = SquareOf(640, 10.1);
  GlobalMap map({.root = root});
  const GeodeticPoint rock = root.Center({.level = 6, .row = 20, .col = 30});
  map.MergeArea(root.Corners({}), 10.1, [&](const GeodeticPoint& p) {
    DepthEstimate estimate = Measured(10, 0.25f);
    if (DistanceM(p, rock) < 3) estimate.hazard_m = 2.0f;
    return estimate;
  });
  map.Conglomerate();
  EXPECT_EQ(map.View().LeafAt(rock)->first.level, 6);
  EXPECT_EQ(map.View().At(rock)->hazard_m, 2.0f);
  int hazards = 0;
  map.View().ForEachLeaf([&](const CellKey&, const Leaf& leaf) {
    hazards += leaf.has_hazard() ? 1 : 0;
  });
  EXPECT_EQ(hazards, 1);
  // Three leaves at each of six levels, and its own.
  EXPECT_EQ(map.leaf_count(), 3u * 6u + 1u);
}

}  // namespace
}  // namespace fathom::map
