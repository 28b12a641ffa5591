// Readers on views beside the writer (run under ThreadSanitizer).

#include <gtest/gtest.h>

#include <atomic>
#include <mutex>
#include <random>
#include <thread>
#include <vector>

#include "map/global/global_map.h"
#include "tests/map/global/plain_codec.h"
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

// Readers of the newest view and of old ones unpack the same tiles while the
// writer changes and packs them.
TEST(GlobalMapThreads, ReadersUnpackWhileTheWriterPacks) {
  const RootSquare root = SquareOf(20480, 10.1);
  GlobalMap map(
      {.root = root,
       .memory = {.budget_bytes = 30'000, .codec = PlainCodec::Codec()}});
  const NedFrame frame(kNarragansett);
  constexpr double kHalfM = 2500;
  const auto depth_m = [&](const GeodeticPoint& place, int round) {
    const NedPoint at = frame.ToNed(place);
    return static_cast<float>(100 + round + at.north_m / 50);
  };
  map.MergeArea(
      Rectangle(frame, -kHalfM, kHalfM, -kHalfM, kHalfM), 10.1,
      [&](const GeodeticPoint& p) { return Measured(depth_m(p, 0), 0.4f); });
  std::mutex mutex;
  GlobalMapView published = map.View();
  const std::uint64_t unpacks = PlainCodec::unpacks();
  std::atomic<bool> done = false;
  std::atomic<int> wrong = 0;
  std::atomic<int> reads = 0;

  std::vector<std::thread> readers;
  for (int t = 0; t < 3; ++t) {
    readers.emplace_back([&, t] {
      std::mt19937 random(static_cast<unsigned>(t));
      std::uniform_real_distribution<double> within(-kHalfM + 20, kHalfM - 20);
      GlobalMapView held;
      do {
        GlobalMapView view;
        {
          const std::lock_guard<std::mutex> lock(mutex);
          view = published;
        }
        if (held.root_tile() == nullptr || random() % 4 == 0) held = view;
        for (int i = 0; i < 20; ++i) {
          const GeodeticPoint place =
              frame.ToGeodetic(within(random), within(random));
          for (const GlobalMapView* of : {&view, &held}) {
            const auto found = of->At(place);
            // Within a cell of the place, and of some round.
            const float least_m = depth_m(place, 0) - 0.3f;
            if (!found || found->depth_m < least_m ||
                found->depth_m > least_m + 10) {
              ++wrong;
            }
          }
          ++reads;
        }
        if (random() % 16 == 0) {
          std::uint64_t known = 0;
          held.ForEachLeaf([&](const CellKey&, const Leaf& leaf) {
            known += leaf.known() ? 1 : 0;
          });
          if (known != held.known_leaf_count()) ++wrong;
        }
      } while (!done);
    });
  }
  for (int round = 1; round <= 60; ++round) {
    const double south_m = -kHalfM + 70 * round;
    map.MergeArea(Rectangle(frame, south_m, south_m + 200, -kHalfM, kHalfM),
                  10.1, [&](const GeodeticPoint& p) {
                    return Measured(depth_m(p, round % 9), 0.4f);
                  });
    const GlobalMapView view = map.View();
    const std::lock_guard<std::mutex> lock(mutex);
    published = view;
  }
  done = true;
  for (std::thread& reader : readers) reader.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(reads, 0);
  EXPECT_GT(PlainCodec::unpacks() - unpacks, 100u);
  published = {};
  (void)map.View();
  EXPECT_LE(map.View().tile_use().unpacked_bytes, 30'000u);
}

}  // namespace
}  // namespace fathom::map
