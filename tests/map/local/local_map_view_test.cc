#include "map/local/local_map_view.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <mutex>
#include <thread>
#include <vector>

#include "map/local/local_map.h"
#include "tests/map/local/local_test_map.h"

namespace fathom::map {
namespace {

const CellIndex kCell = {.i = 10, .j = 19};

TEST(LocalMapView, OfNothingContainsNothing) {
  const LocalMapView view;
  EXPECT_FALSE(view.Contains(kTestSouthWest));
  EXPECT_FALSE(view.At(kTestSouthWest).has_value());
  EXPECT_FALSE(view.EvidenceAt(kTestSouthWest).has_value());
  EXPECT_FALSE(view.DefaultPrior().has_value());
  EXPECT_EQ(view.cells_north(), 0u);
  EXPECT_EQ(view.memory_bytes(), 0u);
  EXPECT_EQ(view.Block({}), nullptr);
}

TEST(LocalMapView, ContainsItsSouthAndWestBorderNotNorthAndEast) {
  LocalMap map = MakeMap(TestOptions(EstimatorKind::kAdaptive));
  const LocalMapView view = map.View();
  const NedFrame& frame = view.frame();
  EXPECT_EQ(view.cells_north(), 50u);
  // 1 um inside and outside each border: ToGeodetic is good to 10 nm.
  EXPECT_TRUE(view.Contains(frame.ToGeodetic(1e-6, 1e-6)));
  EXPECT_FALSE(view.Contains(frame.ToGeodetic(-1e-6, 1.0)));
  EXPECT_FALSE(view.Contains(frame.ToGeodetic(1.0, -1e-6)));
  EXPECT_TRUE(view.Contains(frame.ToGeodetic(500.0 - 1e-6, 500.0 - 1e-6)));
  EXPECT_FALSE(view.Contains(frame.ToGeodetic(500.0 + 1e-6, 1.0)));
  EXPECT_FALSE(view.Contains({std::nan(""), -71.3}));
  EXPECT_FALSE(view.Contains({-41.5, 108.7}));  // The other side of the Earth.
}

TEST(LocalMapView, UntouchedCellsAnswerNothingAndTheDefaultIsApart) {
  LocalMap map = MakeMap(TestOptions(EstimatorKind::kAdaptive));
  map.Update(PingOn(map.options(), kCell, 21.0f, 0.5f), nullptr);
  const LocalMapView view = map.View();
  EXPECT_FALSE(view.AtCell({.i = 10, .j = 20}).has_value());
  EXPECT_FALSE(view.AtCell({.i = -1, .j = 0}).has_value());
  EXPECT_FALSE(view.AtCell({.i = 50, .j = 0}).has_value());
  EXPECT_EQ(view.DefaultPrior()->depth_m, 20.0f);
  EXPECT_EQ(view.DefaultPrior()->std_m, 5.0f);
  EXPECT_EQ(view.DefaultPrior()->kind, EvidenceKind::kPrior);
}

TEST(LocalMapView, OldViewDoesNotChangeWhileTheWriterGoesOn) {
  for (const EstimatorKind kind :
       {EstimatorKind::kNervegna, EstimatorKind::kKalman,
        EstimatorKind::kAdaptive}) {
    LocalMapOptions options = TestOptions(kind);
    options.smoothing_distance_m = 10.0;
    options.smoothing_scale = 0.5;
    LocalMap map = MakeMap(options);
    map.Update(PingOn(options, kCell, 25.0f, 0.5f), nullptr);
    const LocalMapView old_view = map.View();
    const DepthEstimate before = *old_view.AtCell(kCell);
    const DepthEstimate beside = *old_view.AtCell({.i = 9, .j = 18});
    const std::uint64_t bytes = old_view.memory_bytes();
    for (int k = 0; k < 50; ++k) {
      map.Update(PingOn(options, kCell, 30.0f, 0.5f), nullptr);
      map.Update(PingOn(options, {.i = k, .j = k}, 30.0f, 0.5f), nullptr);
      if (k == 25) map.MarkTransferred();
      if (k % 7 == 0) map.View();
    }
    EXPECT_EQ(old_view.AtCell(kCell)->depth_m, before.depth_m);
    EXPECT_EQ(old_view.AtCell(kCell)->std_m, before.std_m);
    EXPECT_EQ(old_view.AtCell({.i = 9, .j = 18})->depth_m, beside.depth_m);
    EXPECT_EQ(old_view.cells_measured(), 1u);
    EXPECT_EQ(old_view.memory_bytes(), bytes);
    EXPECT_FALSE(old_view.AtCell({.i = 40, .j = 40}).has_value());
    EXPECT_GT(map.View().AtCell(kCell)->depth_m, 28.0f);
  }
}

TEST(LocalMapView, OutlivesItsMap) {
  LocalMapView view;
  {
    LocalMap map = MakeMap(TestOptions(EstimatorKind::kAdaptive));
    map.Update(PingOn(map.options(), kCell, 25.0f, 0.5f), nullptr);
    view = map.View();
  }
  EXPECT_NEAR(view.AtCell(kCell)->depth_m, 25.0f, 0.1f);
}

TEST(DiffBlocks, VisitsExactlyTheBlocksThatChanged) {
  LocalMapOptions options = TestOptions(EstimatorKind::kAdaptive);
  LocalMap map = MakeMap(options);
  const auto changed = [](const LocalMapView& old_view,
                          const LocalMapView& now) {
    std::vector<BlockIndex> blocks;
    DiffBlocks(old_view, now, [&](BlockIndex index, const LocalBlock&) {
      blocks.push_back(index);
    });
    return blocks;
  };
  const LocalMapView empty = map.View();
  EXPECT_TRUE(changed(LocalMapView(), empty).empty());
  // Cells (40, 2), (3, 40), (3, 20): blocks (2, 0), (0, 2), (0, 1).
  map.Update(PingOn(options, {.i = 40, .j = 2}, 25.0f, 0.5f), nullptr);
  map.Update(PingOn(options, {.i = 3, .j = 40}, 25.0f, 0.5f), nullptr);
  map.Update(PingOn(options, {.i = 3, .j = 20}, 25.0f, 0.5f), nullptr);
  const LocalMapView three = map.View();
  const std::vector<BlockIndex> all = {{0, 1}, {0, 2}, {2, 0}};  // In order.
  EXPECT_EQ(changed(empty, three), all);
  EXPECT_EQ(changed(LocalMapView(), three), all);
  EXPECT_TRUE(changed(three, three).empty());
  EXPECT_TRUE(changed(three, map.View()).empty());
  map.Update(PingOn(options, {.i = 3, .j = 21}, 25.0f, 0.5f), nullptr);
  EXPECT_EQ(changed(three, map.View()), (std::vector<BlockIndex>{{0, 1}}));
}

TEST(LocalMapView, MeasuredAreasAreBlocksCutAtTheBorder) {
  LocalMapOptions options = TestOptions(EstimatorKind::kAdaptive);
  LocalMap map = MakeMap(options);
  // Cells 48 and 49 are the last: block 3 holds two rows and columns.
  map.Update(PingOn(options, {.i = 49, .j = 48}, 25.0f, 0.5f), nullptr);
  map.Update(PingOn(options, {.i = 49, .j = 49}, 25.0f, 0.5f), nullptr);
  const LocalMapView view = map.View();
  int areas = 0;
  view.ForEachMeasuredArea([&](const AreaCorners& corners, std::size_t cells) {
    ++areas;
    EXPECT_EQ(cells, 2u);
    const double expected[4][2] = {
        {480.0, 480.0}, {500.0, 480.0}, {500.0, 500.0}, {480.0, 500.0}};
    for (std::size_t k = 0; k < 4; ++k) {
      const NedPoint at = view.frame().ToNed(corners[k]);
      EXPECT_NEAR(at.north_m, expected[k][0], 1e-6);
      EXPECT_NEAR(at.east_m, expected[k][1], 1e-6);
    }
  });
  EXPECT_EQ(areas, 1);
}

TEST(LocalMapView, TwentyFiveMillionUntouchedCellsCostLessThanAMegabyte) {
  LocalMapOptions options = TestOptions(EstimatorKind::kAdaptive);
  options.north_extent_m = 5000.0;
  options.east_extent_m = 5000.0;
  options.cell_size_m = 1.0;
  LocalMap map = MakeMap(options);
  const LocalMapView view = map.View();
  EXPECT_EQ(std::uint64_t{view.cells_north()} * view.cells_east(), 25'000'000u);
  EXPECT_LT(view.memory_bytes(), 1'000'000u);
  // 313 blocks a side are 20 superblocks: 400 pointers of 16 bytes, 6.4 kB.
  EXPECT_LT(view.memory_bytes(), 10'000u);
}

TEST(LocalMapView, AFullBlockCostsTwentyFiveBytesACellWithAUniformPrior) {
  LocalMapOptions options = TestOptions(EstimatorKind::kAdaptive);
  options.cell_size_m = 1.0;
  LocalMap map = MakeMap(options);
  // 16 x 16 blocks fully measured: one whole superblock.
  for (int i = 0; i < 256; ++i) {
    for (int j = 0; j < 256; ++j) {
      map.Update(PingOn(options, {.i = i, .j = j}, 25.0f, 0.5f), nullptr);
    }
  }
  const LocalMapView view = map.View();
  ASSERT_EQ(view.cells_measured(), 65'536u);
  EXPECT_EQ(view.block_count(), 256u);
  const double bytes_per_cell =
      static_cast<double>(view.memory_bytes()) / 65'536.0;
  std::printf("%.2f bytes per touched cell (24 of them evidence)\n",
              bytes_per_cell);
  EXPECT_LT(bytes_per_cell, 24.6);
}

// The promise of copy on write, for ThreadSanitizer: a reader that takes each
// published view sees whole pings and nothing of what comes later.
TEST(LocalMapView, ReadersAndWriterShareNothingThatChanges) {
  LocalMapOptions options = TestOptions(EstimatorKind::kAdaptive);
  options.smoothing_distance_m = 20.0;
  options.smoothing_scale = 0.5;
  LocalMap map = MakeMap(options);
  std::mutex mutex;
  LocalMapView published = map.View();
  std::atomic<bool> done = false;
  std::atomic<std::uint64_t> reads = 0;

  std::thread reader([&] {
    std::uint64_t last_measured = 0;
    while (!done.load()) {
      LocalMapView view;
      {
        const std::lock_guard<std::mutex> lock(mutex);
        view = published;
      }
      std::uint64_t measured = 0;
      for (int i = 0; i < 50; ++i) {
        for (int j = 18; j < 22; ++j) {
          const auto got = view.AtCell({.i = i, .j = j});
          if (got.has_value() && got->kind == EvidenceKind::kMeasured) {
            ++measured;
          }
        }
      }
      EXPECT_EQ(measured, view.cells_measured());
      EXPECT_GE(measured, last_measured);
      last_measured = measured;
      ++reads;
    }
  });
  for (int k = 0; k < 2000; ++k) {
    map.Update(
        PingOn(options, {.i = k % 50, .j = 18 + k / 50 % 4}, 25.0f, 0.5f),
        nullptr);
    if (k == 1000) map.MarkTransferred();
    if (k % 3 == 0) {
      const LocalMapView view = map.View();
      const std::lock_guard<std::mutex> lock(mutex);
      published = view;
    }
    // On a busy machine the writer would be done before the reader begins.
    while (reads.load() < static_cast<std::uint64_t>(k / 100)) {
      std::this_thread::yield();
    }
  }
  done = true;
  reader.join();
  EXPECT_GE(reads.load(), 19u);                  // 1999 / 100.
  EXPECT_EQ(map.View().cells_measured(), 200u);  // 50 x 4 cells.
}

}  // namespace
}  // namespace fathom::map
