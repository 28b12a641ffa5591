#include "map/local/reading_cache.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "tests/map/local/local_test_map.h"

namespace fathom::map {
namespace {

using Bits = std::array<std::uint32_t, 9>;

// All cells of a view, as this thread reads them; zeros: no answer.
std::vector<Bits> ReadAll(const LocalMapView& view) {
  std::vector<Bits> all;
  for (std::uint32_t row = 0; row < view.cells_north(); ++row) {
    for (std::uint32_t col = 0; col < view.cells_east(); ++col) {
      const auto read = view.AtCell({.i = static_cast<std::int32_t>(row),
                                     .j = static_cast<std::int32_t>(col)});
      Bits& bits = all.emplace_back();
      if (!read.has_value()) continue;
      bits = {std::bit_cast<std::uint32_t>(read->depth_m),
              std::bit_cast<std::uint32_t>(read->std_m),
              std::bit_cast<std::uint32_t>(read->shoalest_m),
              std::bit_cast<std::uint32_t>(read->hazard_m),
              std::bit_cast<std::uint32_t>(read->variability_m),
              std::bit_cast<std::uint32_t>(read->cell_size_m),
              read->time_s,
              std::uint32_t{read->soundings},
              static_cast<std::uint32_t>(read->kind)};
    }
  }
  return all;
}

// A thread that never read anything has nothing kept.
std::vector<Bits> ReadAllCold(const LocalMapView& view) {
  std::vector<Bits> all;
  std::thread([&] { all = ReadAll(view); }).join();
  return all;
}

// Two maps of one area, views old and new, in any order: what was kept is what
// would be reckoned. 17 x 33 cells are 2 x 3 blocks, the last ones one cell
// wide, so that each cell near a border of a block or of the map is among them.
TEST(ReadingCache, GivesWhatWouldBeReckonedWhateverWasReadBefore) {
  LocalMapOptions options = TestOptions(EstimatorKind::kAdaptive);
  options.north_extent_m = 170;
  options.east_extent_m = 330;
  std::mt19937_64 random(7);
  const auto below = [&random](std::size_t n) {
    return std::uniform_int_distribution<std::size_t>(0, n - 1)(random);
  };
  std::array<LocalMap, 2> maps = {MakeMap(options), MakeMap(options)};
  std::vector<LocalMapView> views;
  for (int round = 0; round < 400; ++round) {
    // In turn, so that both count the same epochs.
    LocalMap& map = maps[static_cast<std::size_t>(round) % 2];
    // Few soundings, so that some blocks stay and others change.
    for (std::size_t n = below(4); n > 0; --n) {
      const CellIndex cell = {.i = static_cast<std::int32_t>(below(17)),
                              .j = static_cast<std::int32_t>(below(33))};
      // A gross shoal among twenty, to wait for a second one.
      const bool gross = below(20) == 0;
      map.Update(PingOn(options, cell,
                        gross ? 2.0f : 20.0f + 0.1f * static_cast<float>(n),
                        0.3f, 1'000 + round),
                 nullptr);
    }
    if (below(50) == 0) map.MarkTransferred();
    views.push_back(map.View());
    if (round == 0) continue;
    // One of any age, then the newest of either map.
    for (const std::size_t which :
         {below(views.size()), views.size() - 2, views.size() - 1}) {
      ASSERT_EQ(ReadAll(views[which]), ReadAllCold(views[which]))
          << "view " << which << " in round " << round;
    }
  }
  EXPECT_GT(views.back().cells_measured(), 200u);
}

TEST(ReadingCache, CellsOfTwoMapsAndFarCellsHavePlaces) {
  ReadingCache& cache = ReadingCache::OfThisThread();
  const ReadingName name = {.map = 5, .epoch = 3, .cell = {.i = 7, .j = 9}};
  EXPECT_EQ(&cache.At(name),
            &cache.At({.map = 5, .epoch = 9, .cell = {.i = 7, .j = 9}}));
  EXPECT_NE(&cache.At(name),
            &cache.At({.map = 6, .epoch = 3, .cell = {.i = 7, .j = 9}}));
  EXPECT_NE(&cache.At(name),
            &cache.At({.map = 5, .epoch = 3, .cell = {.i = 7, .j = 10}}));
  // 128 columns off.
  EXPECT_EQ(&cache.At(name),
            &cache.At({.map = 5, .epoch = 3, .cell = {.i = 7, .j = 137}}));
}

}  // namespace
}  // namespace fathom::map
