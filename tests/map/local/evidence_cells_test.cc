// Packed evidence: what comes back is what went in, within what the header
// says is given up.

#include "map/local/evidence_cells.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numeric>
#include <random>

namespace fathom::map {
namespace {

constexpr std::uint32_t kNow = 1'700'000'000;

TEST(EvidenceCells, UntouchedCellsAreEmptyAndCostNothing) {
  const EvidenceCells cells;
  EXPECT_TRUE(cells.size() == 0);
  EXPECT_EQ(cells.memory_bytes(), 0u);
  for (std::size_t k = 0; k < kBlockCells; ++k) {
    EXPECT_FALSE(cells.touched(k));
    EXPECT_FALSE(cells.measured(k));
    EXPECT_TRUE(cells.Fresh(k).empty());
    EXPECT_EQ(cells.Find(k), nullptr);
  }
}

// In steps of eight cells.
TEST(EvidenceCells, ATouchedCellCostsTwentyBytes) {
  EvidenceCells cells;
  cells.Add(7, 20.0f, 0.3f, kNow);
  EXPECT_EQ(cells.memory_bytes(), 8u * 20);
  for (std::size_t k = 0; k < 100; ++k) cells.Add(k, 20.0f, 0.3f, kNow);
  EXPECT_EQ(cells.memory_bytes(), 104u * 20);
  EXPECT_EQ(EvidenceCells(cells).memory_bytes(), cells.memory_bytes());
}

// Each of the 256 cells is found in whatever order they come, the last too,
// whose place has the number that means "nowhere" until then.
TEST(EvidenceCells, AllCellsOfABlockInAnyOrder) {
  std::array<std::size_t, kBlockCells> order;
  std::iota(order.begin(), order.end(), 0);
  std::mt19937 random(5);
  std::shuffle(order.begin(), order.end(), random);
  EvidenceCells cells;
  for (std::size_t n = 0; n < kBlockCells; ++n) {
    ASSERT_FALSE(cells.touched(order[n]));
    ASSERT_TRUE(cells.Add(order[n], static_cast<float>(order[n]), 0.3f, kNow));
    ASSERT_EQ(cells.size(), n + 1);
    for (std::size_t m = 0; m < kBlockCells; ++m) {
      ASSERT_EQ(cells.touched(order[m]), m <= n) << n << " " << m;
    }
  }
  EvidenceCells ordered;
  for (std::size_t k = 0; k < kBlockCells; ++k) {
    ordered.Add(k, static_cast<float>(k), 0.3f, kNow);
    EXPECT_EQ(cells.Fresh(k).mean_m, static_cast<float>(k));
  }
  EXPECT_EQ(cells, ordered);
  EXPECT_FALSE(ordered.Add(9, 9.5f, 0.3f, kNow));
  EXPECT_FALSE(cells == ordered);
  EXPECT_EQ(ordered.CountMeasured(), 256u);
}

// Against Evidence itself, sounding by sounding.
TEST(EvidenceCells, KeepsWhatEvidenceKeeps) {
  std::mt19937 random(6);
  std::uniform_real_distribution<float> depth_m(-99.0f, 11'999.0f);
  std::uniform_real_distribution<float> std_m(0.01f, 3.0f);
  std::uniform_int_distribution<std::uint32_t> later_s(0, 1000);
  EvidenceCells cells;
  std::array<Evidence, kBlockCells> exact;
  for (int n = 0; n < 20'000; ++n) {
    const std::size_t k = random() % kBlockCells;
    const float z = depth_m(random);
    const float s = std_m(random);
    const std::uint32_t time_s = kNow + later_s(random);
    exact[k].Add(z, s, time_s);
    cells.Add(k, z, s, time_s);
    const Evidence got = cells.Fresh(k);
    ASSERT_EQ(got.weight, exact[k].weight);
    ASSERT_EQ(got.mean_m, exact[k].mean_m);
    ASSERT_EQ(got.scatter, exact[k].scatter);
    ASSERT_EQ(got.count, exact[k].count);
    ASSERT_EQ(got.time_s, exact[k].time_s);
    ASSERT_EQ(std::isnan(got.shoalest_m), std::isnan(exact[k].shoalest_m));
    if (!std::isnan(got.shoalest_m)) {
      // To the shoaler, by less than a step.
      ASSERT_LE(got.shoalest_m, exact[k].shoalest_m);
      ASSERT_GT(got.shoalest_m, exact[k].shoalest_m - 1.0f / 1024 - 1e-6f);
    }
  }
}

TEST(EvidenceCells, PackingWhatWasUnpackedChangesNothing) {
  std::mt19937 random(8);
  EvidenceCells cells;
  for (std::size_t k = 0; k < kBlockCells; ++k) {
    const float depth_m = static_cast<float>(random() % 1'000'000) / 99.0f;
    cells.Add(k, depth_m, 0.001f, kNow + static_cast<std::uint32_t>(k));
  }
  EvidenceCells again;
  for (std::size_t k = 0; k < kBlockCells; ++k) {
    again.Set(k, cells.Fresh(k), cells.measured(k));
  }
  EXPECT_EQ(cells, again);
}

TEST(EvidenceCells, ShoalestGoesToTheShoalerOfTwoSteps) {
  EvidenceCells cells;
  // 20.3 * 1024 = 20787.2 and -0.3 * 1024 = -307.2.
  cells.Add(0, 20.3f, 0.1f, kNow);
  EXPECT_EQ(cells.Fresh(0).shoalest_m, 20787.0f / 1024);
  cells.Add(0, -0.3f, 0.1f, kNow);
  EXPECT_EQ(cells.Fresh(0).shoalest_m, -308.0f / 1024);
}

// Half a window is 2^23 s = 97 days.
TEST(EvidenceCells, TimesAreKeptToTheSecondForAtLeast97Days) {
  constexpr std::uint32_t kHalf = 1u << 23;
  for (const std::uint32_t start : {1u, kHalf - 1, 3 * kHalf - 2, kNow}) {
    EvidenceCells cells;
    cells.Add(0, 20.0f, 0.3f, start);
    cells.Add(1, 20.0f, 0.3f, start + kHalf - 1);
    cells.Add(2, 20.0f, 0.3f, start + kHalf / 2);
    EXPECT_EQ(cells.Fresh(0).time_s, start);
    EXPECT_EQ(cells.Fresh(1).time_s, start + kHalf - 1);
    EXPECT_EQ(cells.Fresh(2).time_s, start + kHalf / 2);
  }
}

TEST(EvidenceCells, WhatIsOlderCountsAsOldAsTheWindowsBegin) {
  EvidenceCells cells;
  cells.Add(0, 20.0f, 0.3f, 1000);  // A clock that was not set.
  cells.Add(1, 20.0f, 0.3f, kNow);
  EXPECT_EQ(cells.Fresh(0).time_s, cells.window_s());
  EXPECT_LT(cells.Fresh(0).time_s, kNow - (1u << 23) + 1);
  EXPECT_EQ(cells.Fresh(1).time_s, kNow);
  cells.Add(2, 20.0f, 0.3f, 1000);  // And late.
  EXPECT_EQ(cells.Fresh(2).time_s, cells.window_s());
  EXPECT_EQ(cells.Fresh(2).count, 1);
  // Time without a date stays none.
  cells.Add(3, 20.0f, 0.3f, 0);
  EXPECT_EQ(cells.Fresh(3).time_s, 0u);
  // The end of the clock.
  cells.Add(4, 20.0f, 0.3f, 0xffff'ffffu);
  EXPECT_EQ(cells.Fresh(4).time_s, 0xffff'ffffu);
  EXPECT_EQ(cells.Fresh(1).time_s, cells.window_s());
}

TEST(EvidenceCells, ACellStaysMeasuredWhenItsEvidenceIsTransferred) {
  EvidenceCells cells;
  cells.Set(4, Evidence{.time_s = kNow}, /*measured=*/false);  // Smoothed.
  cells.Add(5, 20.0f, 0.3f, kNow);
  EXPECT_TRUE(cells.touched(4));
  EXPECT_FALSE(cells.measured(4));
  const Evidence before = cells.Fresh(5);
  cells.MarkTransferred();
  EXPECT_EQ(cells.Fresh(4).time_s, kNow);
  EXPECT_TRUE(cells.Fresh(5).empty());
  EXPECT_TRUE(cells.measured(5));
  EXPECT_EQ(cells.Transferred(5).mean_m, before.mean_m);
  EXPECT_EQ(cells.CountMeasured(), 1u);
  EXPECT_EQ(cells.CountFresh(), 0u);
  EXPECT_EQ(cells.memory_bytes(), 2u * 8 * 20);

  // Later soundings are fresh, readers see both.
  EXPECT_TRUE(cells.Add(4, 21.0f, 0.3f, kNow + 1));
  EXPECT_FALSE(cells.Add(5, 22.0f, 0.3f, kNow + 2));
  EXPECT_TRUE(cells.Add(6, 23.0f, 0.3f, kNow + 3));
  EXPECT_EQ(cells.Fresh(5).mean_m, 22.0f);
  EXPECT_EQ(cells.All(5).mean_m, 21.0f);
  EXPECT_EQ(cells.All(5).count, 2);
  EXPECT_EQ(cells.All(6).count, 1);
  cells.MarkTransferred();
  EXPECT_EQ(cells.Transferred(5).mean_m, 21.0f);
  EXPECT_EQ(cells.Transferred(6).mean_m, 23.0f);
  EXPECT_EQ(cells.CountFresh(), 0u);
  EXPECT_EQ(cells, EvidenceCells(cells));

  EvidenceCells restored;
  restored.set_window_s(cells.window_s());
  for (const std::size_t k : {6u, 4u, 5u}) {
    restored.Restore(k, *cells.Find(k), cells.FindTransferred(k));
  }
  EXPECT_EQ(restored, cells);
  EXPECT_EQ(restored.memory_bytes(), cells.memory_bytes());
}

}  // namespace
}  // namespace fathom::map
