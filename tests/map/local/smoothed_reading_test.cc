#include "map/local/smoothed_reading.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "tests/map/local/local_test_map.h"

namespace fathom::map {
namespace {

const CellIndex kAsked = {.i = 10, .j = 10};

struct Cell {
  std::int32_t north = 0;
  std::int32_t east = 0;
  Evidence evidence;
};

Cell Near(std::int32_t north, std::int32_t east, float depth_m, float std_m,
          int hits = 1) {
  Cell cell = {.north = north, .east = east, .evidence = {}};
  for (int n = 0; n < hits; ++n) cell.evidence.Add(depth_m, std_m, 500);
  return cell;
}

// The reading of the first kMaxMeasuredNear.
std::optional<DepthEstimate> Read(const std::vector<Cell>& cells, double scale,
                                  double cell_size_m) {
  MeasuredNear near;
  for (const Cell& cell : cells) {
    if (near.full()) break;
    near.Add(cell.north, cell.east, cell.evidence);
  }
  return ReadSmoothed(near, scale, cell_size_m);
}

TEST(ReadSmoothed, OneNeighbourGivesItsDepthAndItsStdPlusTheDistance) {
  const std::vector<Cell> near = {Near(4, 0, 30.0f, 0.4f)};
  const std::optional<DepthEstimate> got = Read(near, 0.5, 10.0);
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
  const std::vector<Cell> between = {Near(1, 0, 30.0f, 0.1f),
                                     Near(-1, 0, 30.0f, 0.1f)};
  const std::vector<Cell> beside = {Near(1, 0, 30.0f, 0.1f),
                                    Near(3, 0, 30.0f, 0.1f)};
  EXPECT_LT(Read(between, 0.9, 10.0)->std_m, Read(beside, 0.9, 10.0)->std_m);
}

TEST(ReadSmoothed, TwoExactNeighboursFollowTheVariogram) {
  // 1 mm soundings, 1000 a cell, 2 m apart, one cell to either side: R by the
  // pair 4 / 2^1.5 = 1.41421; the guess 0.09 weighs half a pair beside the one
  // step: (1.41421 + 0.5 * 0.09) / 1.5 = 0.97281. One step tells nearly
  // nothing: times 17, R = 16.5378. tau^2 = 3.30756, a thousandth of it in each
  // mean.
  const std::vector<Cell> near = {Near(1, 0, 30.0f, 0.001f, 1000),
                                  Near(-1, 0, 32.0f, 0.001f, 1000)};
  const DepthEstimate got = *Read(near, 0.8, 10.0);
  EXPECT_NEAR(got.depth_m, 31.0f, 1e-4);
  // Error: R - 1/4 R 2^1.5 = 0.29289 R = 4.84380, and 2 * 1/4 * 0.00331.
  // (4.84380 + 0.00165 + 3.30756) / 0.8 = 10.1913.
  EXPECT_NEAR(got.std_m, std::sqrt(10.1913), 2e-3);
}

TEST(ReadSmoothed, NothingNearOrNoScaleGivesNothing) {
  const std::vector<Cell> one = {Near(1, 0, 30.0f, 0.4f)};
  EXPECT_FALSE(Read({}, 0.5, 10.0).has_value());
  EXPECT_FALSE(Read(one, 0.0, 10.0).has_value());
}

struct Oracle {
  double depth_m;
  double std_m;
  double variability_m;
};

// The formulas of the header, term by term and in double.
Oracle ByTheBook(const std::vector<Cell>& cells, double scale,
                 double cell_size_m) {
  const std::size_t count = cells.size();
  const auto power = [](double north, double east) {
    return std::pow(std::hypot(north, east), 1.5);
  };
  const auto apart = [&](std::size_t a, std::size_t b) {
    return power(cells[a].north - cells[b].north,
                 cells[a].east - cells[b].east);
  };
  std::vector<double> noise_m2;
  double excess_m2 = 0.0;
  double stated_m2 = 0.0;
  double freedom = 0.0;
  for (const Cell& cell : cells) {
    const double n = cell.evidence.count;
    noise_m2.push_back(1.0 / double{cell.evidence.weight});
    excess_m2 +=
        (double{cell.evidence.scatter} - (n - 1.0)) * n * noise_m2.back();
    stated_m2 += (n - 1.0) * n * noise_m2.back();
    freedom += n - 1.0;
  }
  const double scatter_m2 =
      freedom > 0.0
          ? (excess_m2 - stated_m2 * std::sqrt(2.0 / freedom)) / freedom
          : 0.0;
  // R: the mean over the pairs, the noise taken off, beside the guess.
  double rough_m2 = std::pow(0.03 * cell_size_m, 2.0);
  if (count > 1) {
    double pairs = 0.0;
    double rough_sum = 0.0;
    double noise_sum = 0.0;
    for (std::size_t a = 0; a < count; ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        const double step_m =
            double{cells[a].evidence.mean_m} - double{cells[b].evidence.mean_m};
        const double both_m2 = noise_m2[a] + noise_m2[b];
        rough_sum += (step_m * step_m - both_m2) / apart(a, b);
        noise_sum += both_m2 / apart(a, b);
        pairs += 1.0;
      }
    }
    const double steps = static_cast<double>(count) - 1.0;
    const double by_pairs = std::max(
        rough_sum / pairs, 0.15 * std::sqrt(2.0 / steps) * noise_sum / pairs);
    const double guess = std::min(rough_m2, 4.0 * by_pairs + 0.001);
    rough_m2 = (steps * by_pairs + 0.5 * guess) / (steps + 0.5) *
               (1.0 + 16.0 / (steps * steps));
  }
  const double variability_m2 = std::max(scatter_m2, 0.2 * rough_m2);
  std::vector<double> weight;
  double all = 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    noise_m2[k] += variability_m2 / cells[k].evidence.count;
    weight.push_back(
        1.0 / (noise_m2[k] + rough_m2 * power(cells[k].north, cells[k].east)));
    all += weight[k];
  }
  double mean_m = 0.0;
  double error_m2 = 0.0;
  for (std::size_t a = 0; a < count; ++a) {
    const double w = weight[a] / all;
    mean_m += w * double{cells[a].evidence.mean_m};
    error_m2 += w * rough_m2 * power(cells[a].north, cells[a].east) +
                w * w * noise_m2[a];
    for (std::size_t b = 0; b < count; ++b) {
      if (a == b) continue;
      error_m2 -= 0.5 * w * (weight[b] / all) * rough_m2 * apart(a, b);
    }
  }
  return {
      .depth_m = mean_m,
      .std_m = std::sqrt((std::max(error_m2, 0.0) + variability_m2) / scale),
      .variability_m = std::sqrt(variability_m2)};
}

TEST(ReadSmoothed, SaysWhatTheFormulasSayTermByTerm) {
  std::mt19937_64 random(15);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  std::normal_distribution<float> normal;
  double worst = 0.0;
  for (int trial = 0; trial < 5000; ++trial) {
    const std::size_t count = 1 + random() % kMaxMeasuredNear;
    const int reach = 2 + static_cast<int>(random() % 19);  // Up to 20.
    const double cell_size_m = std::pow(10.0, 3.0 * unit(random) - 1.0);
    const float std_m = std::pow(10.0f, 2.5f * unit(random) - 2.0f);
    const float rough_m = std::pow(10.0f, 4.0f * unit(random) - 3.0f);
    const int hits = 1 << (random() % 8);
    std::vector<Cell> cells;
    while (cells.size() < count) {
      const auto along = [&] {
        return static_cast<std::int32_t>(random() %
                                         static_cast<unsigned>(2 * reach + 1)) -
               reach;
      };
      Cell cell = {.north = along(), .east = along(), .evidence = {}};
      if (cell.north == 0 && cell.east == 0) continue;
      const bool taken =
          std::any_of(cells.begin(), cells.end(), [&](const Cell& other) {
            return other.north == cell.north && other.east == cell.east;
          });
      if (taken) continue;
      const float depth_m = 60.0f + rough_m * normal(random);
      for (int n = 0; n < hits; ++n) {
        const float stated_m = std_m * (0.5f + unit(random));
        cell.evidence.Add(depth_m + stated_m * normal(random), stated_m, 500);
      }
      cells.push_back(cell);
    }
    const std::optional<DepthEstimate> got = Read(cells, 0.7, cell_size_m);
    ASSERT_TRUE(got.has_value());
    const Oracle want = ByTheBook(cells, 0.7, cell_size_m);
    // A float resolves 4e-6 m at 60 m.
    EXPECT_NEAR(got->depth_m, want.depth_m, 4e-6 + 1e-5 * want.std_m) << trial;
    const double off = std::fabs(got->std_m / want.std_m - 1.0);
    worst = std::fmax(worst, off);
    EXPECT_LT(off, 1e-5) << trial;
    // Scatter less what chance brings: a difference of near numbers.
    EXPECT_LT(std::fabs(got->variability_m / want.variability_m - 1.0), 1e-4)
        << trial;
  }
  std::printf("std off by at most %.1e of itself\n", worst);
}

// On random neighbourhoods: finite, and never surer than the variability
// inside the asked cell.
TEST(ReadSmoothed, IsFiniteAndNeverSurerThanTheCellIsFlat) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  for (int trial = 0; trial < 2000; ++trial) {
    const float filled = unit(random);
    std::vector<Cell> near;
    for (int north = -2; north <= 2; ++north) {
      for (int east = -2; east <= 2; ++east) {
        if ((north == 0 && east == 0) || unit(random) > filled) continue;
        near.push_back(Near(north, east, 20.0f + 5.0f * unit(random),
                            0.01f + 2.0f * unit(random),
                            1 + static_cast<int>(20 * unit(random))));
      }
    }
    const auto got = Read(near, 0.9, 10.0);
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
    std::vector<Cell> near;
    for (int east = -2; east <= 2; ++east) {
      near.push_back(
          Near(1, east, 20.0f + step_m * static_cast<float>(east & 1), 0.1f));
    }
    const DepthEstimate got = *Read(near, 0.9, 10.0);
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
