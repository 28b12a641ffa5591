// Readers on views beside the writer (run under ThreadSanitizer).

#include <gtest/gtest.h>

#include <atomic>
#include <mutex>
#include <thread>
#include <vector>

#include "map/global/global_map.h"
#include "tests/map/global/scene.h"

namespace fathom::map {
namespace {

TEST(GlobalMapThreads, ReadersSeeWholeStatesWhileTheWriterGoesOn) {
  const RootSquare root = SquareOf(4096, 4.1);
  GlobalMap map({.root = root});
  const NedFrame frame(kNarragansett);
  std::mutex mutex;
  GlobalMapView published = map.View();
  std::atomic<bool> done = false;
  std::atomic<int> torn = 0;
  std::atomic<int> reads = 0;

  std::vector<std::thread> readers;
  for (int t = 0; t < 3; ++t) {
    readers.emplace_back([&] {
      do {
        GlobalMapView view;
        {
          const std::lock_guard<std::mutex> lock(mutex);
          view = published;
        }
        // Every round fuses the same evidence into every leaf: a view holds
        // one std everywhere, or nothing.
        const auto first = view.At(frame.ToGeodetic(-190, -190));
        for (double x = -190; x < 190; x += 20) {
          const auto other = view.At(frame.ToGeodetic(x, -x));
          if (first.has_value() != other.has_value() ||
              (first && first->std_m != other->std_m)) {
            ++torn;
          }
          ++reads;
        }
        (void)view.Bounds(CellKey{});
      } while (!done);
    });
  }
  for (int round = 1; round <= 40; ++round) {
    map.MergeArea(Rectangle(frame, -200, 200, -200, 200), 4.1,
                  [&](const GeodeticPoint&) { return Measured(10.0f, 0.5f); });
    if (round % 3 == 0) map.Conglomerate();
    const GlobalMapView view = map.View();
    const std::lock_guard<std::mutex> lock(mutex);
    published = view;
  }
  done = true;
  for (std::thread& reader : readers) reader.join();
  EXPECT_EQ(torn, 0);
  EXPECT_GT(reads, 0);
}

}  // namespace
}  // namespace fathom::map
