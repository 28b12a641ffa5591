// What a sounding costs, what a reading costs, what a cell costs.
//
// The scene: a vehicle goes north at 1 m/s and pings four times a second; 101
// beams over 150 degrees find bottom at 20 to 100 m; 1 m cells. Every 64 pings
// a view is taken and kept until the next, as the server's publication does, so
// that copy on write is part of the price. The track (2048 pings, 512 m) is
// gone over again and again. Times are of one core.
//
//   ns_per_measurement  time of Update and View over accepted measurements
//   ns_per_cell         the same over cells touched ((2 n + 1)^2 each)
//   bytes_per_cell      memory_bytes() over measured cells at the end
//   fill                measured cells over cells of allocated blocks

#include <benchmark/benchmark.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "map/geodesy/ned_frame.h"
#include "map/local/local_map.h"

namespace fathom::map {
namespace {

constexpr std::size_t kPings = 2048;
// As often as the server publishes under full load (kMaxMessagesPerView of
// server/limits.h): each view makes the writer copy what it writes next.
constexpr std::size_t kPingsPerView = 256;

LocalMapOptions Scene(EstimatorKind estimator) {
  LocalMapOptions options;
  options.south_west = {41.5, -71.3};
  options.north_extent_m = 1000.0;
  options.east_extent_m = 1000.0;
  options.cell_size_m = 1.0;
  options.estimator = estimator;
  options.default_depth_m = 25.0f;
  options.default_std_m = 5.0f;
  return options;
}

std::vector<Ping> Track(const LocalMapOptions& options) {
  std::mt19937 random(2002);
  std::uniform_real_distribution<float> range_m(20.0f, 100.0f);
  std::normal_distribution<float> noise;
  const NedFrame frame(options.south_west);
  std::vector<Ping> pings(kPings);
  for (std::size_t k = 0; k < kPings; ++k) {
    const double along_m = 0.25 * static_cast<double>(k);
    pings[k].time = Time(std::chrono::milliseconds(250 * k));
    pings[k].pose.position = frame.ToGeodetic(200.0 + along_m, 500.0);
    for (int beam = -50; beam <= 50; ++beam) {
      pings[k].beams.push_back(
          {.range_m = range_m(random),
           .bearing_rad = 0.0261799f * static_cast<float>(beam),  // 1.5 deg.
           .depth_m = 25.0f + 0.3f * noise(random),
           .std_m = 0.3f});
    }
  }
  return pings;
}

LocalMap MakeMap(const LocalMapOptions& options) {
  absl::StatusOr<LocalMap> map = LocalMap::Create(options);
  if (!map.ok()) {
    std::fprintf(stderr, "%s\n", map.status().ToString().c_str());
    std::abort();
  }
  return *std::move(map);
}

// A counter that shows nanoseconds of the benchmark's time per one of `count`
// (a total over all iterations).
benchmark::Counter NanosecondsPer(std::uint64_t count) {
  return benchmark::Counter(
      static_cast<double>(count) * 1e-9,
      benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

void RunUpdates(benchmark::State& state, const LocalMapOptions& options,
                std::uint64_t cells_per_measurement) {
  const std::vector<Ping> pings = Track(options);
  LocalMap map = MakeMap(options);
  LocalMapView published = map.View();
  std::size_t next = 0;
  std::uint64_t accepted = 0;
  for (auto _ : state) {
    for (std::size_t k = 0; k < kPingsPerView; ++k) {
      accepted += map.Update(pings[next], nullptr).accepted;
      next = (next + 1) % kPings;
    }
    published = map.View();
  }
  state.counters["ns_per_measurement"] = NanosecondsPer(accepted);
  state.counters["ns_per_cell"] =
      NanosecondsPer(accepted * cells_per_measurement);
  state.counters["bytes_per_cell"] =
      static_cast<double>(published.memory_bytes()) /
      static_cast<double>(published.cells_measured());
  state.counters["fill"] =
      static_cast<double>(published.cells_measured()) /
      static_cast<double>(published.block_count() * kBlockCells);
}

void BM_UpdateAdaptive(benchmark::State& state) {
  RunUpdates(state, Scene(EstimatorKind::kAdaptive), 1);
}
BENCHMARK(BM_UpdateAdaptive);

void BM_UpdateKalman(benchmark::State& state) {
  RunUpdates(state, Scene(EstimatorKind::kKalman), 1);
}
BENCHMARK(BM_UpdateKalman);

// Smoothing over n = 2: 25 cells are touched by each measurement.
void BM_UpdateNervegna(benchmark::State& state) {
  LocalMapOptions options = Scene(EstimatorKind::kNervegna);
  options.smoothing_distance_m = 2.0;
  options.smoothing_scale = 0.5;
  RunUpdates(state, options, 25);
}
BENCHMARK(BM_UpdateNervegna);

// One point by latitude and longitude: projection, look-up, estimate. The
// argument: 0 scattered over the track's area, 1 along a line (a path), over
// and over, so that readings are kept; 2 scattered, in pairs of cells that
// take each other's place there (map/local/reading_cache.h): none is kept.
void BM_ReadPoint(benchmark::State& state) {
  const LocalMapOptions options = Scene(EstimatorKind::kAdaptive);
  LocalMap map = MakeMap(options);
  for (const Ping& ping : Track(options)) map.Update(ping, nullptr);
  const LocalMapView view = map.View();
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<GeodeticPoint> points(4096);
  for (std::size_t k = 0; k < points.size(); k += 2) {
    const double share = static_cast<double>(k) / 4096.0;
    const double north_m = 250.0 + 450.0 * unit(random);
    const double east_m = 430.0 + 140.0 * unit(random);
    const NedFrame& frame = view.frame();
    switch (state.range(0)) {
      case 0:
        points[k] = frame.ToGeodetic(north_m, east_m);
        points[k + 1] = frame.ToGeodetic(950.0 - north_m, east_m);
        break;
      case 1:
        points[k] = frame.ToGeodetic(250.0 + 450.0 * share, 480.0);
        points[k + 1] = frame.ToGeodetic(250.1 + 450.0 * share, 480.0);
        break;
      default: {
        const double south_m = 250.0 + 0.7 * (north_m - 250.0);
        points[k] = frame.ToGeodetic(south_m, east_m);
        points[k + 1] = frame.ToGeodetic(south_m + 128.0, east_m);
      }
    }
  }
  std::size_t next = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(view.At(points[next]));
    next = (next + 1) % points.size();
  }
}
BENCHMARK(BM_ReadPoint)->Arg(0)->Arg(1)->Arg(2);

// As BM_ReadPoint, for cells that were never measured, smoothing n = 2.
void BM_ReadSmoothed(benchmark::State& state) {
  LocalMapOptions options = Scene(EstimatorKind::kAdaptive);
  options.smoothing_distance_m = 2.0;
  options.smoothing_scale = 0.5;
  LocalMap map = MakeMap(options);
  for (const Ping& ping : Track(options)) map.Update(ping, nullptr);
  const LocalMapView view = map.View();
  std::vector<CellIndex> cells;
  for (std::int32_t i = 250; i < 700; ++i) {
    for (std::int32_t j = 430; j < 570; ++j) {
      const auto got = view.AtCell({.i = i, .j = j});
      if (got.has_value() && got->kind == EvidenceKind::kSmoothed) {
        cells.push_back({.i = i, .j = j});
      }
    }
  }
  std::size_t next = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(view.AtCell(cells[next]));
    next = (next + 1) % cells.size();
  }
}
BENCHMARK(BM_ReadSmoothed);

void BM_ToNed(benchmark::State& state) {
  const NedFrame frame({41.5, -71.3});
  GeodeticPoint point = {41.51, -71.29};
  for (auto _ : state) {
    benchmark::DoNotOptimize(point);
    benchmark::DoNotOptimize(frame.ToNed(point));
  }
}
BENCHMARK(BM_ToNed);

}  // namespace
}  // namespace fathom::map
