// What the global map costs: a point query, a leaf's memory, transfer, chart
// import, conglomeration, publishing. See docs/adr/0002-global-map-tiles.md.

#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "map/geodesy/ned_frame.h"
#include "map/global/global_map.h"

namespace fathom::map {
namespace {

constexpr GeodeticPoint kCenter{.latitude_deg = 41.5, .longitude_deg = -71.3};

// The thesis's root: 1267 nmi, cells of at least 10 m, 18 levels.
const RootSquare& Root() {
  static const RootSquare root =
      RootSquare::CenteredOn(kCenter, 1267 * 1852.0, 10).value();
  return root;
}

// A chart of side x side cells of 10 m with a rolling, slightly noisy floor.
RasterBlock Chart(std::uint32_t side) {
  RasterBlock chart;
  chart.north_west = {.latitude_deg = 41.6, .longitude_deg = -71.5};
  chart.latitude_step_deg = 10 / 111000.0;
  chart.longitude_step_deg = 10 / 83000.0;
  chart.rows = side;
  chart.columns = side;
  chart.std_m = {1.5f};
  chart.time_s = 1;
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0, 0.2f);
  for (std::uint32_t r = 0; r < side; ++r) {
    for (std::uint32_t c = 0; c < side; ++c) {
      chart.depth_m.push_back(20 +
                              5 * std::sin(0.01f * static_cast<float>(r)) *
                                  std::cos(0.013f * static_cast<float>(c)) +
                              noise(random));
    }
  }
  return chart;
}

GeodeticPoint RandomPoint(const RasterBlock& chart, std::mt19937& random) {
  std::uniform_real_distribution<double> part(0, chart.rows);
  return {.latitude_deg = chart.north_west.latitude_deg -
                          part(random) * chart.latitude_step_deg,
          .longitude_deg = chart.north_west.longitude_deg +
                           part(random) * chart.longitude_step_deg};
}

double BytesPerLeaf(const GlobalMapView& view) {
  return static_cast<double>(view.memory_bytes()) /
         static_cast<double>(view.leaf_count());
}

// Point queries on a map of 1 M leaves; range(0) points asked in turn: 1000
// stay in cache (warm), 65536 at random do not.
void BM_At(benchmark::State& state) {
  const RasterBlock chart = Chart(900);
  GlobalMap map({.root = Root()});
  map.ImportRaster(chart).value();
  const GlobalMapView view = map.View();
  std::mt19937 random(2);
  std::vector<GeodeticPoint> points;
  for (std::int64_t i = 0; i < state.range(0); ++i) {
    points.push_back(RandomPoint(chart, random));
  }
  std::size_t next = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(view.At(points[next]));
    if (++next == points.size()) next = 0;
  }
  state.counters["leaves"] = static_cast<double>(view.leaf_count());
  state.counters["bytes_per_leaf"] = BytesPerLeaf(view);
}
BENCHMARK(BM_At)->Arg(1000)->Arg(65536);

// The first half of a query: which cell holds a point.
void BM_Locate(benchmark::State& state) {
  const RasterBlock chart = Chart(8);
  std::mt19937 random(2);
  std::vector<GeodeticPoint> points;
  for (int i = 0; i < 1024; ++i) points.push_back(RandomPoint(chart, random));
  std::size_t next = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(Root().LocateLattice(points[next++ & 1023]));
  }
}
BENCHMARK(BM_Locate);

// A local map of 10 km x 10 km at 10 m, 1.2 M global cells: first onto unknown
// ground, then onto what is there.
void BM_MergeArea(benchmark::State& state) {
  const NedFrame frame(kCenter);
  const std::array<GeodeticPoint, 4> area{
      frame.ToGeodetic(-5000, -5000), frame.ToGeodetic(5000, -5000),
      frame.ToGeodetic(5000, 5000), frame.ToGeodetic(-5000, 5000)};
  const auto source = [](const GeodeticPoint&) {
    return DepthEstimate{.depth_m = 20,
                         .std_m = 0.3f,
                         .kind = EvidenceKind::kMeasured,
                         .time_s = 5};
  };
  auto map = std::make_unique<GlobalMap>(GlobalMapOptions{.root = Root()});
  std::uint64_t cells = 0;
  for (auto _ : state) {
    if (state.range(0) == 0) {
      state.PauseTiming();
      map = std::make_unique<GlobalMap>(GlobalMapOptions{.root = Root()});
      state.ResumeTiming();
    }
    cells += map->MergeArea(area, 10, source).leaves_written;
    benchmark::DoNotOptimize(map->View());
  }
  state.counters["cells/s"] = benchmark::Counter(static_cast<double>(cells),
                                                 benchmark::Counter::kIsRate);
}
BENCHMARK(BM_MergeArea)
    ->ArgName("onto_known")
    ->Arg(0)
    ->Arg(1)
    ->Unit(benchmark::kMillisecond);

// A chart of 10 M cells of 10 m, then its conglomeration.
void BM_ImportRaster(benchmark::State& state) {
  const RasterBlock chart = Chart(static_cast<std::uint32_t>(state.range(0)));
  for (auto _ : state) {
    GlobalMap map({.root = Root()});
    map.ImportRaster(chart).value();
    const GlobalMapView view = map.View();
    state.counters["leaves"] = static_cast<double>(view.leaf_count());
  }
  state.counters["cells/s"] =
      benchmark::Counter(static_cast<double>(chart.depth_m.size()) *
                             static_cast<double>(state.iterations()),
                         benchmark::Counter::kIsRate);
}
BENCHMARK(BM_ImportRaster)->Arg(3162)->Unit(benchmark::kMillisecond);

void BM_Conglomerate(benchmark::State& state) {
  const RasterBlock chart = Chart(900);
  std::uint64_t leaves = 0;
  for (auto _ : state) {
    state.PauseTiming();
    GlobalMap map({.root = Root()});
    map.ImportRaster(chart).value();
    map.View();
    state.ResumeTiming();
    leaves += map.Conglomerate().leaves_before;
    const GlobalMapView view = map.View();
    state.counters["leaves_after"] = static_cast<double>(view.leaf_count());
    state.counters["bytes_per_leaf"] = BytesPerLeaf(view);
  }
  state.counters["leaves/s"] = benchmark::Counter(static_cast<double>(leaves),
                                                  benchmark::Counter::kIsRate);
}
BENCHMARK(BM_Conglomerate)->Unit(benchmark::kMillisecond);

// A block of 16 x 16 local cells of 1 m into a map of 1 M leaves, and a view:
// the price of one small change.
void BM_MergeBlockAndView(benchmark::State& state) {
  const RasterBlock chart = Chart(900);
  GlobalMap map({.root = Root()});
  map.ImportRaster(chart).value();
  map.View();
  const NedFrame frame({.latitude_deg = 41.56, .longitude_deg = -71.45});
  const std::array<GeodeticPoint, 4> area{
      frame.ToGeodetic(0, 0), frame.ToGeodetic(16, 0), frame.ToGeodetic(16, 16),
      frame.ToGeodetic(0, 16)};
  const auto source = [](const GeodeticPoint&) {
    return DepthEstimate{.depth_m = 20,
                         .std_m = 0.3f,
                         .kind = EvidenceKind::kMeasured,
                         .time_s = 5};
  };
  for (auto _ : state) {
    map.MergeArea(area, 1, source);
    benchmark::DoNotOptimize(map.View());
  }
}
BENCHMARK(BM_MergeBlockAndView)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace fathom::map
