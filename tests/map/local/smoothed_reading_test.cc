#include "map/local/smoothed_reading.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "tests/map/local/local_test_map.h"

namespace fathom::map {
namespace {

const CellIndex kAsked = {.i = 10, .j = 10};

MeasuredNear Near(std::int32_t north, std::int32_t east, float depth_m,
                  float std_m, int hits = 1) {
  MeasuredNear near = {.north = north, .east = east, .evidence = {}};
  for (int n = 0; n < hits; ++n) near.evidence.Add(depth_m, std_m, 500);
  return near;
}

TEST(ReadSmoothed, OneNeighbourGivesItsDepthAndItsStdPlusTheDistance) {
  const std::vector<MeasuredNear> near = {Near(4, 0, 30.0f, 0.4f)};
  const std::optional<DepthEstimate> got = ReadSmoothed(near, 0.5, 10.0);
  ASSERT_TRUE(got.has_value());
  EXPECT_EQ(got->kind, EvidenceKind::kSmoothed);
  EXPECT_EQ(got->depth_m, 30.0f);
  EXPECT_EQ(got->time_s, 500u);
  EXPECT_TRUE(std::isnan(got->shoalest_m));
  EXPECT_TRUE(std::isnan(got->hazard_m));
  // R = (0.03 * 10)^2 = 0.09; h^1.5 = 8: 0.72. tau^2 = 0.2 * 0.09 = 0.018.
  // Noise 0.16 + 0.018. (0.72 + 0.178 + 0.018) / 0.5 = 1.832.
  EXPECT_NEAR(got->std_m, std::sqrt(1.832), 1e-5);
  EXPECT_NEAR(got->variability_m, std::sqrt(0.018), 1e-6);
}

TEST(ReadSmoothed, BetweenTwoIsSurerThanBesideTwo) {
  // The same two depths; between them the errors of both sides cancel.
  const std::vector<MeasuredNear> between = {Near(1, 0, 30.0f, 0.1f),
                                             Near(-1, 0, 30.0f, 0.1f)};
  const std::vector<MeasuredNear> beside = {Near(1, 0, 30.0f, 0.1f),
                                            Near(3, 0, 30.0f, 0.1f)};
  EXPECT_LT(ReadSmoothed(between, 0.9, 10.0)->std_m,
            ReadSmoothed(beside, 0.9, 10.0)->std_m);
}

TEST(ReadSmoothed, TwoExactNeighboursFollowTheVariogram) {
  // 1 mm soundings, 1000 a cell, 2 m apart, one cell to either side: R by the
  // pair 4 / 2^1.5 = 1.41421; the guess 0.09 weighs half a pair beside the one
  // step: (1.41421 + 0.5 * 0.09) / 1.5 = 0.97281. One step tells nearly
  // nothing: times 17, R = 16.5378. tau^2 = 3.30756, a thousandth of it in each
  // mean.
  const std::vector<MeasuredNear> near = {Near(1, 0, 30.0f, 0.001f, 1000),
                                          Near(-1, 0, 32.0f, 0.001f, 1000)};
  const DepthEstimate got = *ReadSmoothed(near, 0.8, 10.0);
  EXPECT_NEAR(got.depth_m, 31.0f, 1e-4);
  // Error: R - 1/4 R 2^1.5 = 0.29289 R = 4.84380, and 2 * 1/4 * 0.00331.
  // (4.84380 + 0.00165 + 3.30756) / 0.8 = 10.1913.
  EXPECT_NEAR(got.std_m, std::sqrt(10.1913), 2e-3);
}

TEST(ReadSmoothed, NothingNearOrNoScaleGivesNothing) {
  const std::vector<MeasuredNear> one = {Near(1, 0, 30.0f, 0.4f)};
  EXPECT_FALSE(ReadSmoothed({}, 0.5, 10.0).has_value());
  EXPECT_FALSE(ReadSmoothed(one, 0.0, 10.0).has_value());
}

// On random neighbourhoods: finite, and never surer than the variability
// inside the asked cell.
TEST(ReadSmoothed, IsFiniteAndNeverSurerThanTheCellIsFlat) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  for (int trial = 0; trial < 2000; ++trial) {
    const float filled = unit(random);
    std::vector<MeasuredNear> near;
    for (int north = -2; north <= 2; ++north) {
      for (int east = -2; east <= 2; ++east) {
        if ((north == 0 && east == 0) || unit(random) > filled) continue;
        near.push_back(Near(north, east, 20.0f + 5.0f * unit(random),
                            0.01f + 2.0f * unit(random),
                            1 + static_cast<int>(20 * unit(random))));
      }
    }
    const auto got = ReadSmoothed(near, 0.9, 10.0);
    if (!got.has_value()) continue;
    EXPECT_TRUE(std::isfinite(got->depth_m));
    EXPECT_TRUE(std::isfinite(got->std_m));
    EXPECT_GT(got->std_m, got->variability_m);
    EXPECT_GE(got->depth_m, 20.0f - 1e-3f);
    EXPECT_LE(got->depth_m, 25.0f + 1e-3f);
  }
}

TEST(ReadSmoothed, GrowsWithRoughness) {
  float last_m = 0.0f;
  for (const float step_m : {0.0f, 1.0f, 2.0f, 4.0f}) {
    std::vector<MeasuredNear> near;
    for (int east = -2; east <= 2; ++east) {
      near.push_back(
          Near(1, east, 20.0f + step_m * static_cast<float>(east & 1), 0.1f));
    }
    const DepthEstimate got = *ReadSmoothed(near, 0.9, 10.0);
    EXPECT_GT(got.std_m, last_m);
    last_m = got.std_m;
  }
}

// The safety fault of smoothing on write, and that the reading has it not:
// a thousand pings into one cell, and the cell beside it.
TEST(Smoothing, PingsNextDoorMakeAnUnmeasuredCellCertainOnlyUnderNervegna) {
  for (const EstimatorKind kind :
       {EstimatorKind::kNervegna, EstimatorKind::kKalman,
        EstimatorKind::kAdaptive}) {
    LocalMapOptions options = TestOptions(kind);
    options.smoothing_distance_m = 20.0;
    options.smoothing_scale = 0.5;
    LocalMap map = MakeMap(options);
    float early_m = 0.0f;
    for (int ping = 0; ping < 1000; ++ping) {
      map.Update(PingOn(options, kAsked, 30.0f, 0.1f), nullptr);
      if (ping == 9) early_m = map.View().AtCell({.i = 11, .j = 10})->std_m;
    }
    const LocalMapView view = map.View();
    const DepthEstimate measured = *view.AtCell(kAsked);
    const DepthEstimate beside = *view.AtCell({.i = 11, .j = 10});
    EXPECT_EQ(measured.kind, EvidenceKind::kMeasured);
    EXPECT_EQ(beside.kind, EvidenceKind::kSmoothed);
    std::printf("%s: beside 1000 pings std %.4f m (after ten %.4f)\n",
                std::string(EstimatorName(kind)).c_str(), beside.std_m,
                early_m);
    if (kind == EstimatorKind::kNervegna) {
      EXPECT_LT(beside.std_m, 0.05f);  // The thesis's fault, shown.
    } else {
      EXPECT_GE(beside.std_m, measured.std_m);
      // R = 0.09 m^2, one cell, s = 0.5: not below 0.3 / sqrt(0.5) = 0.424.
      EXPECT_GE(beside.std_m, 0.424f);
      EXPECT_NEAR(beside.std_m, early_m, 0.15f);
    }
  }
}

TEST(Smoothing, ReadingPrefersTheBlocksOwnPriorWhereThatIsMoreCertain) {
  LocalMapOptions options = TestOptions(EstimatorKind::kAdaptive);
  options.smoothing_distance_m = 20.0;
  options.smoothing_scale = 0.5;
  options.default_std_m = 0.2f;
  LocalMap map = MakeMap(options);
  map.Update(PingOn(options, kAsked, 20.1f, 0.5f), nullptr);
  // Smoothing cannot be surer than 0.424 m here; the prior is: 0.2 m.
  EXPECT_FALSE(map.View().AtCell({.i = 11, .j = 10}).has_value());
}

TEST(Smoothing, ReachesNoFartherThanItsDistance) {
  LocalMapOptions options = TestOptions(EstimatorKind::kAdaptive);
  options.smoothing_distance_m = 20.0;  // n = ceil(20 / 10) = 2.
  options.smoothing_scale = 0.5;
  LocalMap map = MakeMap(options);
  map.Update(PingOn(options, kAsked, 20.1f, 0.5f), nullptr);
  const LocalMapView view = map.View();
  EXPECT_TRUE(view.AtCell({.i = 12, .j = 8}).has_value());
  EXPECT_FALSE(view.AtCell({.i = 13, .j = 10}).has_value());
}

}  // namespace
}  // namespace fathom::map
