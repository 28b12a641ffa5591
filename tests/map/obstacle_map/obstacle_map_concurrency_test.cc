// Readers on published views beside the writer: what the server does, without
// the server. Meaningful under the thread sanitizer (preset tsan).
#include <gtest/gtest.h>

#include <atomic>
#include <mutex>
#include <thread>
#include <vector>

#include "tests/map/obstacle_map/test_missions.h"

namespace fathom::map {
namespace {

TEST(ObstacleMapConcurrency, ReadersSeeWholeRevisionsBesideTheWriter) {
  constexpr int kPings = 2000;
  ObstacleMap map(SmallMission());
  ASSERT_TRUE(map.Import(FlatChart(30, 4), true).ok());
  ASSERT_TRUE(map.Start(Survey("a")).ok());

  std::mutex mutex;
  std::shared_ptr<const ObstacleMapView> published = map.View();
  std::atomic<bool> done = false;
  std::vector<std::thread> readers;
  for (int r = 0; r < 2; ++r) {
    readers.emplace_back([&] {
      uint64_t last = 0;
      while (!done) {
        std::shared_ptr<const ObstacleMapView> view;
        {
          const std::lock_guard lock(mutex);
          view = published;
        }
        ASSERT_GE(view->revision(), last);
        last = view->revision();
        // Both cells of a pair are hit between two views, never one alone.
        const auto first = view->SeabedAt(Place(105, 105));
        const auto second = view->SeabedAt(Place(405, 405));
        ASSERT_TRUE(first.has_value() && second.has_value());
        ASSERT_EQ(first->estimate.kind, second->estimate.kind);
        ASSERT_EQ(first->estimate.time_s, second->estimate.time_s);
      }
    });
  }
  for (int i = 0; i < kPings; ++i) {
    ASSERT_TRUE(map.ApplyPing(HitAt("a", 105, 105, 20, 1, i)).ok());
    ASSERT_TRUE(map.ApplyPing(HitAt("a", 405, 405, 20, 1, i)).ok());
    if (i % 500 == 499) {
      ASSERT_TRUE(map.Transfer(ActivityId{"a"}).ok());
    }
    auto view = map.View();
    const std::lock_guard lock(mutex);
    published.swap(view);
  }
  done = true;
  for (std::thread& reader : readers) {
    reader.join();
  }
}

}  // namespace
}  // namespace fathom::map
