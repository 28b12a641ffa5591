// What the mission file costs: durable pings a second, bytes a ping and a
// leaf, and the time from a closed mission of ten million leaves to its first
// answer. Files go to a folder of their own under the system's temporary one
// (TMPDIR): measure on the disk that matters.

#include <benchmark/benchmark.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "storage/journal_codec.h"
#include "storage/mission_file.h"
#include "storage/restore.h"
#include "storage/tile_codec.h"
#include "tests/storage/sample_records.h"
#include "tests/storage/temp_dir.h"

namespace fathom::storage {
namespace {

constexpr int kBeams = 101;

// Pings of a vehicle that moves at 2 m/s over a sloping floor, no two alike.
std::vector<JournalRecord> Pings(int count) {
  std::mt19937 random(1);
  std::vector<JournalRecord> records;
  for (int i = 0; i < count; ++i) {
    records.push_back(
        {static_cast<std::uint64_t>(i + 1),
         PingRecord{.source = {"sonar"},
                    .epoch = 1,
                    .sequence = static_cast<std::uint64_t>(i + 1),
                    .ping = SamplePing(random, "survey", i, kBeams)}});
  }
  return records;
}

void SetPingCounters(benchmark::State& state, double pings, double bytes) {
  state.counters["pings_per_s"] =
      benchmark::Counter(pings, benchmark::Counter::kIsRate);
  state.counters["bytes_per_ping"] = bytes / pings;
}

void BM_EncodeJournal(benchmark::State& state) {
  const std::vector<JournalRecord> records = Pings(2000);
  double pings = 0;
  double bytes = 0;
  for (auto _ : state) {
    const auto segments = EncodeJournal(records);
    for (const JournalSegment& segment : *segments) {
      bytes += static_cast<double>(segment.content.size());
    }
    pings += static_cast<double>(records.size());
  }
  SetPingCounters(state, pings, bytes);
}
BENCHMARK(BM_EncodeJournal)->Unit(benchmark::kMillisecond);

void BM_DecodeJournal(benchmark::State& state) {
  const auto segments = EncodeJournal(Pings(2000));
  double pings = 0;
  for (auto _ : state) {
    std::vector<JournalRecord> records;
    for (const JournalSegment& segment : *segments) {
      DecodeJournal(segment.content, "segment", records).IgnoreError();
    }
    pings += static_cast<double>(records.size());
  }
  SetPingCounters(state, pings, 0);
}
BENCHMARK(BM_DecodeJournal)->Unit(benchmark::kMillisecond);

// Durable pings a second with so many in a transaction; real time, the log's
// copying included. A checkpoint of an empty map every 20 000 pings trims the
// journal, as a server's does.
void BM_CommitPings(benchmark::State& state) {
  const int batch_size = static_cast<int>(state.range(0));
  const TempDir dir;
  auto file = MissionFile::Create(dir.File("m"), SampleMetadata());
  const auto options = OptionsOf(SampleMetadata());
  map::ObstacleMap map(*options);
  const std::vector<JournalRecord> pings = Pings(batch_size);
  std::uint64_t revision = 0;
  std::uint64_t trimmed = 0;
  std::shared_ptr<const map::ObstacleMapView> previous;
  Batch batch;
  for (auto _ : state) {
    state.PauseTiming();
    batch.journal = pings;
    for (JournalRecord& record : batch.journal) {
      record.revision = ++revision;
      std::get<PingRecord>(record.event).sequence = revision;
    }
    batch.checkpoint.reset();
    if (revision - trimmed >= 20'000) {
      trimmed = revision;
      map.AdvanceRevision(revision);
      batch.checkpoint = Checkpoint{.now = map.View(), .previous = previous};
    }
    state.ResumeTiming();
    const absl::Status status = (*file)->Commit(batch);
    if (!status.ok()) {
      state.SkipWithError(status.ToString().c_str());
      break;
    }
    if (batch.checkpoint.has_value()) previous = batch.checkpoint->now;
  }
  SetPingCounters(state, static_cast<double>(revision), 0);
  state.counters["wal_mib"] =
      static_cast<double>((*file)->Status().wal_bytes) / 1048576;
  state.counters["file_mib"] =
      static_cast<double>((*file)->Status().file_bytes) / 1048576;
}
BENCHMARK(BM_CommitPings)
    ->Arg(1)
    ->Arg(10)
    ->Arg(100)
    ->Arg(1000)
    ->Arg(4000)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

// Reports about ships on courses of their own, in turn, every 10 ms one.
class Ships {
 public:
  std::uint64_t revision() const { return revision_; }

  // The next `count`, with their rows of history, and with the journal or
  // without. No two estimates are alike, so blocks are as large as in earnest.
  Batch Next(std::uint64_t count, bool journal) {
    Batch batch;
    for (std::uint64_t i = 0; i < count; ++i) {
      ++revision_;
      const int ship = static_cast<int>(revision_ % kShips);
      const map::ContactKey key = {.source = {"ais"},
                                   .contact = {std::to_string(ship)}};
      if (journal) {
        batch.journal.push_back(
            {revision_,
             ContactRecord{.epoch = 1,
                           .sequence = revision_,
                           .report = SampleReport(static_cast<int>(i),
                                                  key.contact.value)}});
      }
      batch.contact_history.push_back({.revision = revision_,
                                       .estimate = Believed(ship),
                                       .revises = false});
      batch.contact_history.back().estimate.key = key;
    }
    return batch;
  }

 private:
  static constexpr int kShips = 100;
  static constexpr Duration kBetween{10'000};

  map::ContactEstimate Believed(int ship) {
    map::ContactEstimate estimate;
    static_cast<map::ContactPoint&>(estimate) = SampleContactPoint(1);
    const Duration since = static_cast<std::int64_t>(revision_) * kBetween;
    estimate.time = TimeFromUnixMicros(1'700'000'000'000'000) + since;
    estimate.report_time = estimate.time;
    // To and fro across 40 km, once in four hours.
    const double way = std::sin(static_cast<double>(since.count()) * 4.4e-10 +
                                static_cast<double>(ship));
    estimate.frame_origin = {.latitude_deg = 41 + 0.001 * ship,
                             .longitude_deg = -70 + 0.25 * way};
    for (int i = 0; i < 4; ++i) estimate.x(i) += noise_(random_);
    estimate.P *= 1 + 0.01 * noise_(random_);
    return estimate;
  }

  std::mt19937 random_{5};
  std::normal_distribution<double> noise_;
  std::uint64_t revision_ = 0;
};

// A mission that takes contact reports, 1000 a transaction, and makes a
// checkpoint every 20 000, as the server does (kJournalMaxRecords).
class ContactMission {
 public:
  explicit ContactMission(std::uint64_t thousands)
      : file_(*MissionFile::Create(dir_.File("m"), SampleMetadata())),
        map_(*OptionsOf(SampleMetadata())) {
    for (std::uint64_t i = 0; i < thousands; i += 20) {
      Check(file_->Commit(ships_.Next(20'000, /*journal=*/false)));
    }
    CheckpointNow();
    if (thousands == 0) return;
    // Full from here on: as much goes as comes.
    file_->LimitHistory({.max_age = std::nullopt,
                         .max_bytes = file_->Status().history.bytes()});
  }

  // Seconds that 20 000 durable reports take, a checkpoint and what retention
  // deletes included.
  double TakeReports() {
    double seconds = 0;
    for (int i = 0; i < 20; ++i) {
      const Batch batch = ships_.Next(1000, /*journal=*/true);
      const auto start = std::chrono::steady_clock::now();
      Check(file_->Commit(batch));
      seconds += Since(start);
    }
    const auto start = std::chrono::steady_clock::now();
    CheckpointNow();
    return seconds + Since(start);
  }

  MissionFileStatus Status() const { return file_->Status(); }

 private:
  static void Check(const absl::Status& status) {
    if (!status.ok()) std::abort();
  }
  static double Since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() -
                                         start)
        .count();
  }
  void CheckpointNow() {
    map_.AdvanceRevision(ships_.revision());
    Batch batch;
    batch.checkpoint = Checkpoint{.now = map_.View(), .previous = saved_};
    Check(file_->Commit(batch));
    saved_ = batch.checkpoint->now;
  }

  TempDir dir_;
  std::unique_ptr<MissionFile> file_;
  map::ObstacleMap map_;
  std::shared_ptr<const map::ObstacleMapView> saved_;
  Ships ships_;
};

// What so many thousand estimates behind it cost a mission that takes reports:
// 20 000 reports to it, 20 000 to one without a past, in turn. `time_x_empty`
// is the median of the rounds' ratios.
void BM_ReportsBehindHistory(benchmark::State& state) {
  ContactMission empty(0);
  ContactMission full(static_cast<std::uint64_t>(state.range(0)));
  std::vector<double> ratios;
  double empty_s = 0;
  double full_s = 0;
  for (auto _ : state) {
    const double empty_round_s = empty.TakeReports();
    const double full_round_s = full.TakeReports();
    empty_s += empty_round_s;
    full_s += full_round_s;
    ratios.push_back(full_round_s / empty_round_s);
  }
  const auto middle =
      ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  const double reports = 20'000 * static_cast<double>(ratios.size());
  state.counters["time_x_empty"] = *middle;
  state.counters["reports_per_s"] = reports / full_s;
  state.counters["empty_reports_per_s"] = reports / empty_s;
  state.counters["estimates"] =
      static_cast<double>(full.Status().history.estimates);
  state.counters["forgotten"] =
      static_cast<double>(full.Status().history.forgotten_estimates);
  state.counters["file_mb"] =
      static_cast<double>(full.Status().file_bytes) / 1e6;
}
// FATHOM_HISTORY_THOUSANDS adds a size: 10 000 take 0.9 GB and a minute, 100
// 000 take 9 GB and a quarter of an hour.
BENCHMARK(BM_ReportsBehindHistory)
    ->Apply([](auto* benchmark) {
      benchmark->Arg(1000);
      const char* more = std::getenv("FATHOM_HISTORY_THOUSANDS");
      if (more != nullptr) benchmark->Arg(std::atoll(more));
    }) -> Iterations(21) -> Unit(benchmark::kMillisecond);

// A block of a local map, all cells measured a few times.
void BM_EncodeBlock(benchmark::State& state) {
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0.0f, 0.3f);
  map::LocalBlock block;
  for (std::size_t k = 0; k < map::kBlockCells; ++k) {
    const float depth_m = 20.0f + 0.05f * static_cast<float>(k % 16);
    for (std::uint32_t hit = 0; hit < 1 + k % 5; ++hit) {
      block.evidence.Add(k, depth_m + noise(random), 0.3f, 1'000'000'000 + hit);
    }
  }
  const BlockKey key{.activity_number = 1, .index = {}};
  double bytes = 0;
  for (auto _ : state) {
    bytes = static_cast<double>(EncodeBlock(key, block).size());
  }
  state.counters["bytes_per_cell"] = bytes / map::kBlockCells;
}
BENCHMARK(BM_EncodeBlock)->Unit(benchmark::kMicrosecond);

// A square of 40.5 km whose finest cells are 9.9 m: 4096 x 4096.
MissionMetadata LargeMission() {
  MissionMetadata metadata = SampleMetadata();
  metadata.root_south_west = {.latitude_deg = 41.3, .longitude_deg = -71.0};
  metadata.root_north_west = {.latitude_deg = 41.3 + 0.3650,
                              .longitude_deg = -71.0};
  return metadata;
}

// A chart of near ten million cells of 10 m on that square: hills of 50 m,
// ripples of half a metre and 5 cm of noise, so that nothing conglomerates and
// no two means are alike.
map::RasterBlock LargeChart() {
  constexpr std::uint32_t kSide = 3170;
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0.0f, 0.05f);
  map::RasterBlock block;
  block.north_west = {.latitude_deg = 41.3 + 0.33, .longitude_deg = -70.95};
  block.latitude_step_deg = 10.0 / 111'000;
  block.longitude_step_deg = 10.0 / 83'300;
  block.rows = kSide;
  block.columns = kSide;
  block.std_m.reserve(std::size_t{kSide} * kSide);
  for (std::uint32_t row = 0; row < kSide; ++row) {
    for (std::uint32_t col = 0; col < kSide; ++col) {
      const float north = static_cast<float>(row) / 300.0f;
      const float east = static_cast<float>(col) / 200.0f;
      block.depth_m.push_back(60.0f + 25.0f * std::sin(north) * std::cos(east) +
                              0.5f * std::sin(20 * east) + noise(random));
      block.std_m.push_back(0.3f + 0.01f * std::abs(std::sin(30 * north)));
    }
  }
  block.time_s = 1'000'000'000;
  return block;
}

// The mission file of the benchmark below, made once.
class LargeFile {
 public:
  LargeFile() {
    const auto options = OptionsOf(LargeMission());
    map::ObstacleMap map(*options);
    const auto imported = map.Import(LargeChart(), false);
    if (!imported.ok()) std::abort();
    leaves_ = map.View()->global().leaf_count();
    auto file = MissionFile::Create(path(), LargeMission());
    Batch batch;
    batch.checkpoint = Checkpoint{.now = map.View(), .previous = nullptr};
    const auto start = std::chrono::steady_clock::now();
    if (!file.ok() || !(*file)->Commit(batch).ok()) std::abort();
    write_s_ =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
            .count();
    if (!(*file)->Close().ok()) std::abort();
    bytes_ = std::filesystem::file_size(path());
  }

  std::string path() const { return dir_.File("m"); }
  double leaves() const { return static_cast<double>(leaves_); }
  double bytes() const { return static_cast<double>(bytes_); }
  double write_s() const { return write_s_; }

 private:
  TempDir dir_;
  std::uint64_t leaves_ = 0;
  std::uint64_t bytes_ = 0;
  double write_s_ = 0;
};

// A line of /proc/self/status ("VmRSS:", "VmHWM:"), bytes.
double MemoryOf(const std::string& line) {
  std::ifstream status("/proc/self/status");
  std::string word;
  double kilobytes = 0;
  while (status >> word && word != line) {
  }
  status >> kilobytes;
  return kilobytes * 1024;
}

// Gives back what is free and lets the peak (VmHWM) start from here.
void ForgetPeak() {
  malloc_trim(0);
  std::ofstream("/proc/self/clear_refs") << 5;
}

const LargeFile& Large() {
  static const LargeFile large;
  return large;
}

// The large mission, its tiles within the budget.
absl::StatusOr<RestoredMap> Restore(MissionFile& file,
                                    std::uint64_t budget_bytes) {
  auto loaded = file.Load(budget_bytes);
  if (!loaded.ok()) return loaded.status();
  auto options = OptionsOf(loaded->metadata);
  if (!options.ok()) return options.status();
  options->global.memory = {.budget_bytes = budget_bytes, .codec = kTileCodec};
  return RestoreMap(*std::move(loaded), *options);
}

// From the closed file to the first answer (the file is in the page cache).
void OpenLarge(benchmark::State& state, std::uint64_t budget_bytes) {
  const LargeFile& large = Large();
  map::TileUse use;
  double seconds = 0;
  double peak_bytes = 0;
  double held_bytes = 0;
  for (auto _ : state) {
    state.PauseTiming();
    ForgetPeak();
    const double before_bytes = MemoryOf("VmRSS:");
    state.ResumeTiming();
    const auto start = std::chrono::steady_clock::now();
    auto file = MissionFile::Open(large.path());
    auto restored = Restore(**file, budget_bytes);
    if (!restored.ok()) std::abort();
    const auto answer = restored->map->View()->SeabedAt(
        {.latitude_deg = 41.5, .longitude_deg = -70.8});
    if (!answer.has_value()) std::abort();
    const auto end = std::chrono::steady_clock::now();
    seconds += std::chrono::duration<double>(end - start).count();
    state.PauseTiming();
    peak_bytes = MemoryOf("VmHWM:") - before_bytes;
    malloc_trim(0);
    held_bytes = MemoryOf("VmRSS:") - before_bytes;
    use = restored->map->tile_use();
    restored->map.reset();
    restored->checkpoint.reset();
    file->reset();
    state.ResumeTiming();
  }
  const double rounds = static_cast<double>(state.iterations());
  state.counters["seconds"] = seconds / rounds;
  state.counters["leaves"] = large.leaves();
  state.counters["disk_bytes_per_leaf"] = large.bytes() / large.leaves();
  state.counters["write_s"] = large.write_s();
  state.counters["peak_mb"] = peak_bytes / 1e6;
  state.counters["ram_bytes_per_leaf"] = held_bytes / large.leaves();
  state.counters["told_mb"] = static_cast<double>(use.memory_bytes) / 1e6;
  state.counters["packed_mb"] = static_cast<double>(use.packed_bytes) / 1e6;
  state.counters["packed_tiles"] = static_cast<double>(use.packed_tiles);
}

void BM_Open10MLeaves(benchmark::State& state) {
  OpenLarge(state, map::TileMemoryOptions::kUnlimited);
}
BENCHMARK(BM_Open10MLeaves)->UseRealTime()->Unit(benchmark::kMillisecond);

// The same, tiles beyond so many MiB packed.
void BM_OpenPacked10MLeaves(benchmark::State& state) {
  OpenLarge(state, static_cast<std::uint64_t>(state.range(0)) << 20);
}
BENCHMARK(BM_OpenPacked10MLeaves)
    ->Arg(64)
    ->Arg(8)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

// A point in a tile that is packed, and packing it again (its bytes are there):
// `unpack_us` and `evict_us`.
void BM_FirstTouch(benchmark::State& state) {
  auto file = MissionFile::Open(Large().path());
  auto restored = Restore(**file, 0);
  if (!restored.ok()) std::abort();
  std::vector<map::GeodeticPoint> places;
  for (int i = 0; i < 200; ++i) {
    // 640 m tiles: no two places in one.
    places.push_back({.latitude_deg = 41.45 + 0.01 * (i % 14),
                      .longitude_deg = -70.85 + 0.012 * (i / 14)});
  }
  using Clock = std::chrono::steady_clock;
  const auto micros = [](Clock::time_point from) {
    return std::chrono::duration<double, std::micro>(Clock::now() - from)
        .count();
  };
  double unpack_us = 0;
  double evict_us = 0;
  std::uint64_t tiles = 0;
  for (auto _ : state) {
    const auto view = restored->map->View();
    const auto start = Clock::now();
    for (const map::GeodeticPoint& place : places) {
      benchmark::DoNotOptimize(view->SeabedAt(place));
    }
    unpack_us += micros(start);
    tiles += view->global().tile_use().unpacked_tiles;
    const auto packing = Clock::now();
    benchmark::DoNotOptimize(restored->map->View());
    evict_us += micros(packing);
  }
  state.counters["tiles"] =
      static_cast<double>(tiles) / static_cast<double>(state.iterations());
  state.counters["unpack_us"] = unpack_us / static_cast<double>(tiles);
  state.counters["evict_us"] = evict_us / static_cast<double>(tiles);
}
BENCHMARK(BM_FirstTouch)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace fathom::storage
