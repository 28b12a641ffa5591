// What a transfer costs the one who asked for it, and those who query
// meanwhile.
//
// The scene: a chart, and over it a local map of 1 km x 1 km at 1 m, each of
// its 1 M cells measured twice. A reader asks points all over that area, of the
// newest published view as the server's calls do; each timed batch takes the
// view once. First it is alone; then the writer transfers and publishes, as the
// server's mapper does: in one go, then a pointer is swapped.
//
//   seconds     wall time from the start of the transfer until its view is out;
//   cpu_s       of that the writer's own processor time
//   p99_ratio   99th percentile of the batches of kBatch queries that ended
//               before the view was out, over that of the idle time before
//   *_ns        the percentiles behind it, a query; _worst_us: one batch
//   leaves      global leaves written

#include <benchmark/benchmark.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "map/geodesy/ned_frame.h"
#include "map/obstacle_map/check_trajectory.h"
#include "map/obstacle_map/obstacle_map.h"
#include "tests/map/obstacle_map/test_missions.h"

namespace fathom::map {
namespace {

using Clock = std::chrono::steady_clock;
using ViewPtr = std::shared_ptr<const ObstacleMapView>;

constexpr int kSide = 1000;
constexpr std::size_t kBatch = 8;
constexpr std::chrono::milliseconds kIdle(250);

// The view that readers take; MapKeeper's way of publishing.
class Published {
 public:
  ViewPtr Get() const {
    MutexLock lock(mutex_);
    return view_;
  }
  void Put(ViewPtr view) {
    {
      MutexLock lock(mutex_);
      view_.swap(view);
    }
    // `view` now is the replaced one: freed outside the lock.
  }

 private:
  mutable Mutex mutex_;
  ViewPtr view_ FATHOM_GUARDED_BY(mutex_);
};

// 1049 km: 2^20 cells of 1 m.
MissionOptions Mission() {
  MissionOptions options;
  options.global.root =
      RootSquare::CenteredOn(kAreaSouthWest, std::ldexp(1, 20), 1.01).value();
  return options;
}

// A rolling floor of 15 to 25 m.
float DepthAt(int north, int east) {
  return 20 + 3 * std::sin(0.02f * static_cast<float>(north)) +
         2 * std::cos(0.03f * static_cast<float>(east));
}

ObstacleMap SurveyedMission() {
  ObstacleMap map(Mission());
  if (!map.Import(FlatChart(22, 4), true).ok()) std::abort();
  StartActivity survey = Survey("a", EstimatorKind::kAdaptive);
  survey.options.north_extent_m = kSide;
  survey.options.east_extent_m = kSide;
  survey.options.cell_size_m = 1;
  if (!map.Start(survey).ok()) std::abort();
  std::mt19937 random(1);
  std::normal_distribution<float> normal(0, 0.2f);
  std::vector<float> noise_m(4093);
  for (float& error_m : noise_m) error_m = normal(random);
  std::size_t next = 0;
  for (int pass = 0; pass < 2; ++pass) {
    for (int north = 0; north < kSide; ++north) {
      Ping ping;
      ping.activity = ActivityId{"a"};
      ping.time = At(kSide * pass + north);
      ping.pose.position = Place(north + 0.5, 0.5 * kSide);
      for (int east = 0; east < kSide; ++east) {
        const float to_east =
            static_cast<float>(east) + 0.5f - 0.5f * float{kSide};
        ping.beams.push_back(
            {.range_m = std::abs(to_east),
             .bearing_rad = to_east > 0 ? 1.5707963f : -1.5707963f,
             .depth_m = DepthAt(north, east) + noise_m[next++ % 4093],
             .std_m = 0.2f});
      }
      if (!map.ApplyPing(ping).ok()) std::abort();
    }
  }
  return map;
}

// Processor time of the calling thread.
double ThreadSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) +
         1e-9 * static_cast<double>(now.tv_nsec);
}

// Nanoseconds a query at the percentile of the batches.
double Percentile(std::vector<std::int64_t>& batches_ns, double share) {
  if (batches_ns.empty()) return 0;
  const auto nth = batches_ns.begin() +
                   static_cast<std::ptrdiff_t>(
                       share * static_cast<double>(batches_ns.size() - 1));
  std::nth_element(batches_ns.begin(), nth, batches_ns.end());
  return static_cast<double>(*nth) / kBatch;
}

// Asks without pause until told to stop; the times of the batches go to what
// was set as the present phase when they began.
class Reader {
 public:
  enum Phase { kWarm, kBefore, kTransfer, kAfter, kStop };

  explicit Reader(const Published& published) : published_(published) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> place(0, kSide);
    for (int i = 0; i < 1 << 16; ++i) {
      queries_.push_back({.position = Place(place(random), place(random)),
                          .depth_m = 18,
                          .time = At(4 * kSide)});
    }
    for (auto& batches : batches_ns_) batches.reserve(10'000'000 / kBatch);
    thread_ = std::thread([this] { Run(); });
  }
  ~Reader() { Finish(); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  void Enter(Phase phase) { phase_ = phase; }
  void Finish() {
    phase_ = kStop;
    if (thread_.joinable()) thread_.join();
  }
  // REQUIRES: Finish() was called.
  std::vector<std::int64_t>& batches_ns(Phase phase) {
    return batches_ns_[phase];
  }

 private:
  void Run() {
    std::size_t next = 0;
    Clock::time_point begin = Clock::now();
    for (Phase phase; (phase = phase_.load()) != kStop;) {
      const ViewPtr view = published_.Get();
      for (std::size_t i = 0; i < kBatch; ++i) {
        benchmark::DoNotOptimize(view->Answer(queries_[next]));
        next = (next + 1) % queries_.size();
      }
      const Clock::time_point end = Clock::now();
      batches_ns_[phase].push_back(
          std::chrono::nanoseconds(end - begin).count());
      begin = end;
    }
  }

  const Published& published_;
  std::vector<ObstacleQuery> queries_;
  std::array<std::vector<std::int64_t>, kStop> batches_ns_;
  std::atomic<Phase> phase_ = kWarm;
  std::thread thread_;
};

// Global cells of 1 m, so that each local cell becomes a leaf.
void BM_Transfer1MCells(benchmark::State& state) {
  for (auto _ : state) {
    ObstacleMap map = SurveyedMission();
    Published published;
    published.Put(map.View());
    Reader reader(published);
    std::this_thread::sleep_for(kIdle / 5);
    reader.Enter(Reader::kBefore);
    std::this_thread::sleep_for(kIdle);

    reader.Enter(Reader::kTransfer);
    const Clock::time_point begin = Clock::now();
    const double cpu_begin_s = ThreadSeconds();
    const auto moved = map.Transfer(ActivityId{"a"});
    published.Put(map.View());
    const double seconds =
        std::chrono::duration<double>(Clock::now() - begin).count();
    const double cpu_s = ThreadSeconds() - cpu_begin_s;
    reader.Enter(Reader::kAfter);
    std::this_thread::sleep_for(kIdle / 2);
    reader.Finish();
    if (!moved.ok() || moved->local_cells != kSide * kSide) std::abort();

    state.SetIterationTime(seconds);
    auto& before = reader.batches_ns(Reader::kBefore);
    auto& during = reader.batches_ns(Reader::kTransfer);
    auto& after = reader.batches_ns(Reader::kAfter);
    const double idle_ns = Percentile(before, 0.99);
    state.counters["seconds"] = seconds;
    state.counters["cpu_s"] = cpu_s;
    state.counters["leaves"] = static_cast<double>(moved->leaves_written);
    state.counters["p99_ratio"] = Percentile(during, 0.99) / idle_ns;
    state.counters["idle_p50_ns"] = Percentile(before, 0.5);
    state.counters["idle_p99_ns"] = idle_ns;
    state.counters["idle_worst_us"] = kBatch * 1e-3 * Percentile(before, 1);
    state.counters["p50_ns"] = Percentile(during, 0.5);
    state.counters["p99_ns"] = Percentile(during, 0.99);
    state.counters["worst_us"] = kBatch * 1e-3 * Percentile(during, 1);
    state.counters["after_p50_ns"] = Percentile(after, 0.5);
    state.counters["after_p99_ns"] = Percentile(after, 0.99);
    state.counters["after_worst_us"] = kBatch * 1e-3 * Percentile(after, 1);
  }
}

// 1000 waypoints, 10 km, 10 m cells: a chart, and an activity over 5 km of the
// way with every other cell measured; a vehicle of 2 m, 1 m sure of its place.
void BM_CheckTrajectory(benchmark::State& state) {
  MissionOptions options = SmallMission();
  ObstacleMap map(options);
  if (!map.Import(FlatChart(30, 4), true).ok()) std::abort();
  StartActivity survey = Survey("a", EstimatorKind::kAdaptive);
  survey.options.north_extent_m = 5000;
  survey.options.east_extent_m = 500;
  if (!map.Start(survey).ok()) std::abort();
  std::mt19937 random(4);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int i = 0; i < 12'500; ++i) {
    Ping ping;
    ping.activity = ActivityId{"a"};
    ping.time = At(i / 100);
    ping.pose.position = Place(5000 * unit(random), 500 * unit(random));
    ping.beams = {
        Beam{.range_m = 1, .bearing_rad = 0, .depth_m = 28, .std_m = 1}};
    if (!map.ApplyPing(ping).ok()) std::abort();
  }
  Trajectory path;
  path.radius_m = 2;
  path.position_std_m = 1;
  for (int i = 0; i < 1000; ++i) {
    path.waypoints.push_back(
        {.position = Place(10.01 * i, 250 + 40 * std::sin(0.02 * i)),
         .depth_m = 10,
         .time = At(1000 + 5 * i)});
  }
  const ViewPtr view = map.View();
  std::uint64_t cells = 0;
  for (auto _ : state) {
    const auto verdict = CheckTrajectory(*view, path);
    if (!verdict.ok() || verdict->legs.size() != 999) std::abort();
    cells = verdict->cells;
  }
  state.counters["cells"] = static_cast<double>(cells);
}
BENCHMARK(BM_CheckTrajectory)->Unit(benchmark::kMillisecond);

// 5 km over a chart of 10 m cells, no two alike, that falls a metre in range(1)
// metres, by a vehicle that knows its place to 100 m. range(0): 1 as asked, 0
// with every leaf read.
void BM_CheckWideTrajectory(benchmark::State& state) {
  ObstacleMap map(SmallMission());
  std::mt19937 random(4);
  std::uniform_real_distribution<float> relief(-0.5f, 0.5f);
  RasterBlock chart = FlatChart(0, 0.5f);
  chart.north_west = Place(5500, 0);
  chart.latitude_step_deg = 10 / 111'000.0;
  chart.longitude_step_deg = 10 / 83'000.0;
  chart.rows = 550;
  chart.columns = 100;
  chart.depth_m.clear();
  for (std::uint32_t k = 0; k < chart.rows * chart.columns; ++k) {
    // Rows go from north, where it is deepest, to south.
    const auto north_m =
        10.0f * static_cast<float>(chart.rows - 1 - k / chart.columns);
    chart.depth_m.push_back(30 + north_m / static_cast<float>(state.range(1)) +
                            relief(random));
  }
  if (!map.Import(chart, true).ok()) std::abort();
  Trajectory path;
  path.radius_m = 2;
  path.position_std_m = 100;
  path.unknown_is_free = true;
  path.waypoints = {
      {.position = Place(100, 500), .depth_m = 10, .time = At(0)},
      {.position = Place(5100, 500), .depth_m = 10, .time = At(2500)}};
  const ViewPtr view = map.View();
  std::uint64_t cells = 0;
  for (auto _ : state) {
    const auto verdict =
        CheckTrajectory(*view, path, {.skip_deep = state.range(0) == 1});
    if (!verdict.ok()) std::abort();
    cells = verdict->cells;
  }
  state.counters["cells"] = static_cast<double>(cells);
}
BENCHMARK(BM_CheckWideTrajectory)
    ->ArgsProduct({{1, 0}, {100, 1'000'000}})
    ->Unit(benchmark::kMillisecond);

BENCHMARK(BM_Transfer1MCells)
    ->Iterations(1)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace fathom::map
