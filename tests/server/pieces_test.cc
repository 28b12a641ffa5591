#include "server/pieces.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstddef>
#include <latch>
#include <thread>
#include <vector>

#include "server/workers.h"

namespace fathom::server {
namespace {

TEST(ForEachPiece, GivesEachIndexOnce) {
  Workers helpers(3);
  for (const std::size_t count : {0u, 1u, 9u, 10u, 11u, 1000u}) {
    for (Workers* others : {static_cast<Workers*>(nullptr), &helpers}) {
      std::vector<std::atomic<int>> given(count);
      ForEachPiece(others, count, 10, [&](std::size_t begin, std::size_t end) {
        EXPECT_LE(end - begin, 10u);
        for (std::size_t i = begin; i < end; ++i) ++given[i];
      });
      for (const auto& times : given) EXPECT_EQ(times, 1) << count;
    }
  }
}

TEST(ForEachPiece, HelpersTakePart) {
  Workers helpers(1);
  // Each of two pieces waits for the other: one thread alone would never end.
  std::latch both(2);
  ForEachPiece(&helpers, 2, 1,
               [&](std::size_t, std::size_t) { both.arrive_and_wait(); });
}

TEST(ForEachPiece, WaitsForNoHelperThatHasNotBegun) {
  std::latch release(1);
  std::atomic<int> done = 0;
  {
    Workers helpers(1);
    helpers.Give([&] { release.wait(); });
    ForEachPiece(&helpers, 100, 1, [&](std::size_t, std::size_t) { ++done; });
    EXPECT_EQ(done, 100);
    // The helper comes when the loop is gone, and does nothing.
    release.count_down();
  }
  EXPECT_EQ(done, 100);
}

TEST(Workers, AreOfferedAsMuchAsTheyAre) {
  std::latch release(1);
  std::latch begun(2);
  std::atomic<int> done = 0;
  {
    Workers two(2);
    for (int n = 0; n < 2; ++n) {
      two.Give([&] {
        begun.count_down();
        release.wait();
      });
    }
    begun.wait();
    EXPECT_TRUE(two.Offer([&] { ++done; }));
    EXPECT_TRUE(two.Offer([&] { ++done; }));
    EXPECT_FALSE(two.Offer([&] { ++done; }));
    release.count_down();
  }
  EXPECT_EQ(done, 2);
}

TEST(ForEachPiece, ManyLoopsShareHelpers) {
  Workers helpers(2);
  std::atomic<int> done = 0;
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 4; ++caller) {
    callers.emplace_back([&] {
      for (int round = 0; round < 200; ++round) {
        ForEachPiece(&helpers, 64, 4, [&](std::size_t begin, std::size_t end) {
          done += static_cast<int>(end - begin);
        });
      }
    });
  }
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(done, 4 * 200 * 64);
}

}  // namespace
}  // namespace fathom::server
