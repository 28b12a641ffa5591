// What contacts and point queries cost in process: filters, the probability
// over a disc, reports into the map, and answers with and without contacts.

#include <benchmark/benchmark.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "base/published.h"
#include "map/contacts/contact_map.h"
#include "map/contacts/filter.h"
#include "map/obstacle_map/obstacle_map.h"
#include "map/query/disc_probability.h"
#include "map/query/obstacle_query.h"
#include "tests/map/obstacle_map/test_missions.h"

namespace fathom::map {
namespace {

void StepFilter(benchmark::State& state, FilterKind kind) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::vector<PolarMeasurement> heard;
  for (int i = 0; i < 1024; ++i) {
    heard.push_back({.range_m = 5000 + 20 * normal(random),
                     .azimuth_rad = 0.8 + 0.02 * normal(random),
                     .range_std_m = 20,
                     .azimuth_std_rad = 0.02});
  }
  TrackState track = FirstState(ConvertUnbiased(heard[0]), 8);
  std::size_t i = 0;
  for (auto _ : state) {
    const PolarMeasurement& polar = heard[i++ & 1023];
    track = Update(kind, Predict(track, 1.5, 2e-3),
                   kind == FilterKind::kPerAxis ? ConvertPlain(polar)
                                                : ConvertUnbiased(polar))
                .state;
    benchmark::DoNotOptimize(track);
  }
  state.SetItemsProcessed(state.iterations());
}

// Conversion, prediction and update of one report.
void BM_FilterPerAxis(benchmark::State& state) {
  StepFilter(state, FilterKind::kPerAxis);
}
BENCHMARK(BM_FilterPerAxis);

void BM_FilterFourState(benchmark::State& state) {
  StepFilter(state, FilterKind::kFourState);
}
BENCHMARK(BM_FilterFourState);

// Sigmas from a tenth to ten times the radius, means out to four sigma.
void BM_DiscProbability(benchmark::State& state) {
  struct Case {
    Eigen::Vector2d offset;
    Eigen::Matrix2d covariance;
  };
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<Case> cases(1024);
  for (Case& one : cases) {
    const double major = 100 * std::pow(10, -1 + 2 * unit(random));
    const double minor = major * (0.2 + 0.8 * unit(random));
    one.offset = {unit(random) * (100 + 4 * major),
                  unit(random) * (100 + 4 * minor)};
    const double both = 0.3 * minor * minor;
    one.covariance << major * major, both, both, minor * minor;
  }
  std::size_t i = 0;
  for (auto _ : state) {
    const Case& one = cases[i++ & 1023];
    benchmark::DoNotOptimize(DiscProbability(one.offset, one.covariance, 100));
  }
}
BENCHMARK(BM_DiscProbability);

ContactReport FixOf(int contact, int seconds, const GeodeticPoint& position) {
  return {
      .key = {.source = {"bench"}, .contact = {std::to_string(contact)}},
      .contact_class = ContactClass::kVessel,
      .time = At(seconds),
      .observation = ContactFix{.position = position, .velocity_north_m_s = 3},
      .depth_m = {},
      .depth_std_m = {}};
}

// Reports into a list of contacts, a view after every 16.
void BM_ApplyReport(benchmark::State& state) {
  const int contacts = static_cast<int>(state.range(0));
  ContactMap map(
      ContactMapOptions{.max_contacts = static_cast<std::uint32_t>(contacts)});
  std::vector<GeodeticPoint> sensors;
  for (int i = 0; i < contacts; ++i) {
    sensors.push_back(Place(100.0 * (i % 100), 1.0 * i));
    map.Apply(FixOf(i, 0, sensors.back()));
  }
  ContactReport report = FixOf(0, 0, sensors[0]);
  int step = 0;
  for (auto _ : state) {
    const int i = step % contacts;
    report.key.contact.value = std::to_string(i);
    report.time = At(1 + step / contacts);
    report.observation =
        RangeBearing{.pose = {.position = sensors[static_cast<std::size_t>(i)]},
                     .range_m = 1000,
                     .bearing_deg = 0.1 * (step % 7),
                     .range_std_m = 20,
                     .bearing_std_deg = 1};
    benchmark::DoNotOptimize(map.Apply(report));
    if (++step % 16 == 0) benchmark::DoNotOptimize(map.View());
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(BM_ApplyReport)->Arg(100)->Arg(10'000);

// A warm mission: a chart everywhere, an activity with every tenth cell
// measured, and `contacts` contacts of which each is at least 20 km away.
ObstacleMap WarmMission(int contacts) {
  MissionOptions options = SmallMission();
  options.contacts.max_contacts = 20'000;
  ObstacleMap map(options);
  if (!map.Import(FlatChart(30, 4), true).ok()) std::abort();
  if (!map.Start(Survey("a", EstimatorKind::kAdaptive)).ok()) std::abort();
  for (int i = 0; i < 250; ++i) {
    if (!map.ApplyPing(HitAt("a", 2.0 * i, 1.0 * ((37 * i) % 500), 20, 1, i))
             .ok()) {
      std::abort();
    }
  }
  for (int i = 0; i < contacts; ++i) {
    map.ApplyContact(
        FixOf(i, 0, Direct(kAreaSouthWest, 0.036 * i, 20'000 + 10.0 * i)));
  }
  return map;
}

// Points all over a square of `side_m`.
std::vector<ObstacleQuery> ScatteredQueries(double side_m) {
  std::vector<ObstacleQuery> queries;
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int i = 0; i < 1024; ++i) {
    queries.push_back(
        {.position = Place(side_m * unit(random), side_m * unit(random)),
         .depth_m = 18,
         .time = At(300)});
  }
  return queries;
}

void AskPoints(benchmark::State& state, const ObstacleMapView& view,
               double side_m) {
  const std::vector<ObstacleQuery> queries = ScatteredQueries(side_m);
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(view.Answer(queries[i++ & 1023]));
  }
  state.SetItemsProcessed(state.iterations());
}

// The whole way: local map, global map, probability; no contacts. Points all
// over the surveyed area.
void BM_AnswerStatic(benchmark::State& state) {
  ObstacleMap map = WarmMission(0);
  AskPoints(state, *map.View(), 500);
}
BENCHMARK(BM_AnswerStatic);

// Of a full fan; as often as the server publishes under full load
// (kMaxMessagesPerView of server/limits.h).
constexpr int kBeams = 101;
constexpr int kPingsPerView = 256;

// Soundings of the cells that WarmMission measured, a fan of them.
Ping FanOver(int first, int seconds) {
  Ping fan = HitAt("a", 0, 0, 20, 1, seconds);
  fan.beams.clear();
  for (int i = first; i < first + kBeams; ++i) {
    fan.beams.push_back(
        HitAt("a", 2.0 * (i % 250), 1.0 * ((37 * i) % 500), 20, 1, seconds)
            .beams[0]);
  }
  return fan;
}

// The same while a writer applies fans without pause and publishes as the
// server does; the reader asks the newest view. /0: the writer writes this map.
// /1: another of the same size, so that nothing is shared but the machine:
// what a busy neighbour costs by itself. /2: this map, but the reader keeps to
// its first view: what the writer's copies cost, without reading them.
void BM_AnswerStaticBesideWriter(benchmark::State& state) {
  ObstacleMap map = WarmMission(0);
  ObstacleMap other = WarmMission(0);
  Published<ObstacleMapView> published;
  published.Publish(map.View());
  Published<ObstacleMapView> unread;
  const bool apart = state.range(0) == 1;
  const bool keeps = state.range(0) == 2;
  const std::shared_ptr<const ObstacleMapView> first = published.Get();
  std::atomic<bool> done = false;
  std::uint64_t pings = 0;
  std::thread writer([&] {
    ObstacleMap& written = apart ? other : map;
    Published<ObstacleMapView>& views = apart ? unread : published;
    std::vector<Ping> fans;
    for (int i = 0; i < 250; ++i) fans.push_back(FanOver(i, 250));
    while (!done) {
      if (!written.ApplyPing(fans[pings % 250]).ok()) std::abort();
      if (++pings % kPingsPerView == 0) views.Publish(written.View());
    }
  });
  const std::vector<ObstacleQuery> queries = ScatteredQueries(500);
  std::size_t i = 0;
  for (auto _ : state) {
    const std::shared_ptr<const ObstacleMapView> view =
        keeps ? first : published.Get();
    for (int n = 0; n < 64; ++n) {
      benchmark::DoNotOptimize(view->Answer(queries[i++ & 1023]));
    }
  }
  done = true;
  writer.join();
  state.counters["ns_per_query"] = benchmark::Counter(
      64e-9 * static_cast<double>(state.iterations()),
      benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  state.counters["pings"] = static_cast<double>(pings);
}
BENCHMARK(BM_AnswerStaticBesideWriter)->Arg(0)->Arg(1)->Arg(2)->UseRealTime();

// The same with 10 000 contacts, none near.
void BM_AnswerContactsFar(benchmark::State& state) {
  ObstacleMap map = WarmMission(static_cast<int>(state.range(0)));
  AskPoints(state, *map.View(), 500);
}
BENCHMARK(BM_AnswerContactsFar)->Arg(1)->Arg(10'000);

// Both turn by turn: what ten thousand contacts, none near, cost.
void BM_AnswerTenThousandFar(benchmark::State& state) {
  using Clock = std::chrono::steady_clock;
  ObstacleMap none = WarmMission(0);
  ObstacleMap many = WarmMission(10'000);
  const std::shared_ptr<const ObstacleMapView> views[] = {none.View(),
                                                          many.View()};
  const std::vector<ObstacleQuery> queries = ScatteredQueries(500);
  Clock::duration spent[2] = {};
  for (auto _ : state) {
    for (const int side : {0, 1}) {
      const auto start = Clock::now();
      for (const ObstacleQuery& query : queries) {
        benchmark::DoNotOptimize(views[side]->Answer(query));
      }
      spent[side] += Clock::now() - start;
    }
  }
  state.counters["ratio"] = std::chrono::duration<double>(spent[1]).count() /
                            std::chrono::duration<double>(spent[0]).count();
}
BENCHMARK(BM_AnswerTenThousandFar);

// One contact that reaches every point.
void BM_AnswerContactNear(benchmark::State& state) {
  ObstacleMap map = WarmMission(0);
  map.ApplyContact(FixOf(0, 0, Place(250, 250)));
  AskPoints(state, *map.View(), 500);
}
BENCHMARK(BM_AnswerContactNear);

// The query alone, the seabed given.
void BM_AnswerAlone(benchmark::State& state) {
  const ContactsView contacts;
  const ObstacleQuery query{
      .position = kAreaSouthWest, .depth_m = 18, .time = At(300)};
  const SeabedEstimate seabed{.estimate = {.depth_m = 20,
                                           .std_m = 2,
                                           .kind = EvidenceKind::kMeasured,
                                           .time_s = 1'767'225'600}};
  for (auto _ : state) {
    benchmark::DoNotOptimize(Answer(query, seabed, contacts));
  }
}
BENCHMARK(BM_AnswerAlone);

}  // namespace
}  // namespace fathom::map
