#include "map/local/local_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "tests/map/local/local_test_map.h"
#include "tests/testing/status_matchers.h"

namespace fathom::map {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

constexpr EstimatorKind kAll[] = {
    EstimatorKind::kNervegna, EstimatorKind::kKalman, EstimatorKind::kAdaptive};
const CellIndex kCell = {.i = 10, .j = 19};

TEST(LocalMapOptions, RefusesEachBadFieldByName) {
  struct Case {
    const char* field;
    void (*spoil)(LocalMapOptions&);
  };
  const Case cases[] = {
      {"latitude_deg", [](auto& o) { o.south_west.latitude_deg = 91.0; }},
      {"south_west", [](auto& o) { o.south_west.latitude_deg = 89.5; }},
      {"north_extent_m", [](auto& o) { o.north_extent_m = 0.0; }},
      {"east_extent_m", [](auto& o) { o.east_extent_m = std::nan(""); }},
      {"cell_size_m", [](auto& o) { o.cell_size_m = 0.0; }},
      {"estimator", [](auto& o) { o.estimator = EstimatorKind{}; }},
      {"min_range_m", [](auto& o) { o.min_range_m = -1.0; }},
      {"max_range_m", [](auto& o) { o.max_range_m = 0.0; }},
      {"smoothing_scale", [](auto& o) { o.smoothing_scale = 1.0; }},
      {"smoothing_distance_m", [](auto& o) { o.smoothing_distance_m = 160.1; }},
      {"default_depth_m", [](auto& o) { o.default_depth_m.reset(); }},
      {"default_std_m", [](auto& o) { o.default_std_m = 0.0f; }},
  };
  for (const Case& one : cases) {
    LocalMapOptions options = TestOptions(EstimatorKind::kAdaptive);
    one.spoil(options);
    EXPECT_THAT(
        LocalMap::Create(options),
        StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(one.field)));
  }
}

TEST(LocalMapOptions, TakesTheMostCellsAndRefusesOneRowMore) {
  LocalMapOptions options = TestOptions(EstimatorKind::kAdaptive);
  options.cell_size_m = 1.0;
  options.north_extent_m = 10'000.0;
  options.east_extent_m = 10'000.0;
  EXPECT_THAT(LocalMap::Create(options), IsOk());
  options.north_extent_m = 10'001.0;
  EXPECT_THAT(LocalMap::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("at most 100000000")));
  options.north_extent_m = 65'536.0;
  options.east_extent_m = 100.0;
  EXPECT_THAT(LocalMap::Create(options), IsOk());
  options.north_extent_m = 65'537.0;
  EXPECT_FALSE(LocalMap::Create(options).ok());
}

TEST(LocalMap, SoundingFallsInTheCellOfEq4_5) {
  LocalMapOptions options = TestOptions(EstimatorKind::kKalman);
  LocalMap map = MakeMap(options);
  // Vehicle at (100, 200), heading 30, bearing 60 degrees, range 50: theta 90,
  // so (100, 250): i = 10, j = 25. Heading is turned by the convergence,
  // 0.03 mrad here.
  Ping ping;
  ping.pose.position = NedFrame(options.south_west).ToGeodetic(100.5, 200.5);
  ping.pose.heading_deg = 30.0;
  ping.beams = {{.range_m = 50.0f,
                 .bearing_rad = static_cast<float>(std::numbers::pi / 3.0),
                 .depth_m = 25.0f,
                 .std_m = 1.0f}};
  EXPECT_EQ(map.Update(ping, nullptr).accepted, 1u);
  const LocalMapView view = map.View();
  EXPECT_EQ(view.cells_measured(), 1u);
  const DepthEstimate got = *view.AtCell({.i = 10, .j = 25});
  // Prior 20 +- 5: k = 25 / 26, 20 + 5 k = 24.8077; (1 - k) 25 = 0.96154.
  EXPECT_NEAR(got.depth_m, 24.8077f, 1e-4);
  EXPECT_NEAR(got.std_m, std::sqrt(0.96154), 1e-4);
  EXPECT_EQ(got.kind, EvidenceKind::kMeasured);
  EXPECT_EQ(got.cell_size_m, 10.0f);
}

TEST(LocalMap, NervegnaIsEqs4_18And4_21InSequence) {
  LocalMapOptions options = TestOptions(EstimatorKind::kNervegna);
  LocalMap map = MakeMap(options);
  map.Update(PingOn(options, kCell, 25.0f, 1.0f), nullptr);
  // k = 25/26 = 0.961538: mean 24.807692; variance 25/26 + k 25 = 0.961538 +
  // 24.038462 = 25.
  DepthEstimate got = *map.View().AtCell(kCell);
  EXPECT_NEAR(got.depth_m, 24.807692f, 1e-5);
  EXPECT_NEAR(got.std_m, 5.0f, 1e-5);
  map.Update(PingOn(options, kCell, 24.0f, 2.0f), nullptr);
  // k = 25/29 = 0.862069: mean 24.807692 - 0.862069 * 0.807692 = 24.111406;
  // variance 25 * 4/29 + 0.862069 * 0.652367 = 3.448276 + 0.562385 = 4.010661.
  got = *map.View().AtCell(kCell);
  EXPECT_NEAR(got.depth_m, 24.111406f, 1e-5);
  EXPECT_NEAR(got.std_m, std::sqrt(4.010661), 1e-5);
}

TEST(LocalMap, NervegnaSmoothsNeighboursThatWereNotDirectlyUpdated) {
  LocalMapOptions options = TestOptions(EstimatorKind::kNervegna);
  options.smoothing_distance_m = 10.0;  // n = 1.
  options.smoothing_scale = 0.5;
  LocalMap map = MakeMap(options);
  const CellIndex other = {.i = 10, .j = 20};
  map.Update(PingOn(options, other, 30.0f, 1.0f), nullptr);
  const DepthEstimate other_before = *map.View().AtCell(other);
  map.Update(PingOn(options, kCell, 25.0f, 1.0f), nullptr);
  const LocalMapView view = map.View();
  // Directly updated cells are not smoothed.
  EXPECT_EQ(view.AtCell(other)->depth_m, other_before.depth_m);
  // (9, 18) touches only kCell, whose cell had been smoothed by `other` first:
  // other: k = 25/26, mean 29.615385, variance 25/26 + (25/26) 100 =
  // 97.115385. kCell: k = 0.5 * 25 / (25 + 97.115385 + 1) = 0.101531; mean
  // 20.976260; variance 0.898469 * 25 + 0.101531 * 92.455622 = 31.848837.
  // Its ping: k = 31.848837 / 32.848837 = 0.969557; mean 20.976260 + k *
  // 4.023740 = 24.877507; variance 0.969557 + k * 16.190483 = 16.667157.
  // (9, 18): k = 0.5 * 25 / (25 + 16.667157 + 1) = 0.292966; mean 20 + k *
  // 4.877507 = 21.428945; variance 0.707034 * 25 + k * 23.790075 = 24.645537.
  EXPECT_NEAR(view.AtCell(kCell)->depth_m, 24.877507f, 1e-4);
  const DepthEstimate got = *view.AtCell({.i = 9, .j = 18});
  EXPECT_EQ(got.kind, EvidenceKind::kSmoothed);
  EXPECT_NEAR(got.depth_m, 21.428945f, 1e-4);
  EXPECT_NEAR(got.std_m, std::sqrt(24.645537), 1e-4);
  // Two cells away: untouched.
  EXPECT_FALSE(view.AtCell({.i = 8, .j = 19}).has_value());
  EXPECT_EQ(view.cells_measured(), 2u);
}

TEST(LocalMap, KalmanIsTheSequenceOfEqs4_18And4_20) {
  LocalMapOptions options = TestOptions(EstimatorKind::kKalman);
  LocalMap map = MakeMap(options);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<float> depth_m(18.0f, 24.0f);
  std::uniform_real_distribution<float> std_m(0.1f, 3.0f);
  double mean_m = 20.0;
  double variance_m2 = 25.0;
  for (int ping = 0; ping < 200; ++ping) {
    const float z_m = depth_m(random);
    const float s_m = std_m(random);
    map.Update(PingOn(options, kCell, z_m, s_m), nullptr);
    const double k = Gain(variance_m2, double{s_m} * s_m);
    variance_m2 = FuseVarianceKalman(k, variance_m2);
    mean_m = CorrectMean(k, mean_m, z_m);
    const DepthEstimate got = *map.View().AtCell(kCell);
    ASSERT_NEAR(got.depth_m, mean_m, 2e-4) << ping;
    ASSERT_NEAR(got.std_m, std::sqrt(variance_m2), 1e-5) << ping;
  }
}

// Each threshold at its border and one step inside.
TEST(LocalMap, RefusesAndCountsEachReason) {
  LocalMapOptions options = TestOptions(EstimatorKind::kAdaptive);
  options.min_range_m = 2.0;
  options.max_range_m = 100.0;
  LocalMap map = MakeMap(options);
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  Ping ping;
  ping.pose.position = NedFrame(options.south_west).ToGeodetic(50.0, 50.0);
  ping.beams = {
      {kNaN, 0.0f, 20.0f, 0.5f},       // kNotFinite, each field.
      {10.0f, kInf, 20.0f, 0.5f},      //
      {10.0f, 0.0f, -kInf, 0.5f},      //
      {10.0f, 0.0f, 20.0f, kNaN},      //
      {2.0f, 0.0f, 20.0f, 0.5f},       // kBelowMinRange: at R_min.
      {-5.0f, 0.0f, 20.0f, 0.5f},      // kBelowMinRange.
      {100.0f, 0.0f, 20.0f, 0.5f},     // kAboveMaxRange: at R_max.
      {10.0f, 0.0f, 20.0f, 0.0f},      // kBadStd: at 0.
      {10.0f, 0.0f, 20.0f, -1.0f},     // kBadStd.
      {10.0f, 0.0f, 20.0f, 100.01f},   // kBadStd.
      {10.0f, 0.0f, -100.01f, 0.5f},   // kBadDepth.
      {10.0f, 0.0f, 12000.01f, 0.5f},  // kBadDepth.
      {60.0f, 3.14159f, 20.0f, 0.5f},  // kOutsideArea: 10 m south of it.
      {2.01f, 0.0f, 20.0f, 0.5f},      // Accepted from here on.
      {99.9f, 0.0f, 20.0f, 100.0f},    //
      {10.0f, 0.0f, -100.0f, 1e-9f},   //
      {10.0f, 0.0f, 12000.0f, 0.5f},   //
      {10.0f, 1e6f, 20.0f, 0.5f},      // A bearing of many turns is one.
  };
  const LocalMap::UpdateResult result = map.Update(ping, nullptr);
  EXPECT_EQ(result.rejects.count(RejectReason::kNotFinite), 4u);
  EXPECT_EQ(result.rejects.count(RejectReason::kBelowMinRange), 2u);
  EXPECT_EQ(result.rejects.count(RejectReason::kAboveMaxRange), 1u);
  EXPECT_EQ(result.rejects.count(RejectReason::kBadStd), 3u);
  EXPECT_EQ(result.rejects.count(RejectReason::kBadDepth), 2u);
  EXPECT_EQ(result.rejects.count(RejectReason::kOutsideArea), 1u);
  EXPECT_EQ(result.rejects.total(), 13u);
  EXPECT_EQ(result.accepted, 5u);
}

TEST(LocalMap, APoseThatIsNotFiniteRefusesTheWholePing) {
  LocalMapOptions options = TestOptions(EstimatorKind::kAdaptive);
  LocalMap map = MakeMap(options);
  Ping ping = PingOn(options, kCell, 20.0f, 0.5f);
  ping.beams.push_back(ping.beams[0]);
  ping.pose.heading_deg = std::nan("");
  const LocalMap::UpdateResult result = map.Update(ping, nullptr);
  EXPECT_EQ(result.accepted, 0u);
  EXPECT_EQ(result.rejects.count(RejectReason::kNotFinite), 2u);
  EXPECT_EQ(map.View().block_count(), 0u);
}

TEST(LocalMap, BadBeamsLeaveTheGoodOnesAsIfAlone) {
  for (const EstimatorKind kind : kAll) {
    LocalMapOptions options = TestOptions(kind);
    LocalMap alone = MakeMap(options);
    LocalMap mixed = MakeMap(options);
    Ping ping = PingOn(options, kCell, 22.0f, 0.5f);
    alone.Update(ping, nullptr);
    Beam bad = ping.beams[0];
    bad.std_m = -1.0f;
    ping.beams = {bad, ping.beams[0], bad};
    mixed.Update(ping, nullptr);
    EXPECT_EQ(alone.View().AtCell(kCell)->depth_m,
              mixed.View().AtCell(kCell)->depth_m);
  }
}

TEST(LocalMap, AsksThePriorOncePerBlockAndFallsBackOnTheDefault) {
  LocalMapOptions options = TestOptions(EstimatorKind::kKalman);
  LocalMap map = MakeMap(options);
  int asked = 0;
  const NedFrame frame(options.south_west);
  // Known west of 195 m only: 40 +- 1 m.
  const PriorSource prior =
      [&](const GeodeticPoint& point) -> std::optional<DepthEstimate> {
    ++asked;
    if (frame.ToNed(point).east_m > 195.0) return std::nullopt;
    return DepthEstimate{
        .depth_m = 40.0f, .std_m = 1.0f, .kind = EvidenceKind::kPrior};
  };
  // (10, 18) is at 185 m, (10, 20) at 205 m: one block (cells 16 to 31).
  map.Update(PingOn(options, {.i = 10, .j = 18}, 42.0f, 1.0f), prior);
  map.Update(PingOn(options, {.i = 10, .j = 20}, 42.0f, 1.0f), prior);
  EXPECT_EQ(asked, 256);
  const LocalMapView view = map.View();
  // Equal variances: halfway, 41.
  EXPECT_NEAR(view.AtCell({.i = 10, .j = 18})->depth_m, 41.0f, 1e-5);
  // Default 20 +- 5: k = 25/26, 20 + 22 k = 41.153846.
  EXPECT_NEAR(view.AtCell({.i = 10, .j = 20})->depth_m, 41.153846f, 1e-5);
}

TEST(LocalMap, WithoutAnyPriorTheEvidenceStandsAlone) {
  for (const EstimatorKind kind : kAll) {
    LocalMapOptions options = TestOptions(kind);
    options.default_depth_m.reset();
    options.default_std_m.reset();
    LocalMap map = MakeMap(options);
    map.Update(PingOn(options, kCell, 33.0f, 0.5f), nullptr);
    const DepthEstimate got = *map.View().AtCell(kCell);
    EXPECT_EQ(got.depth_m, 33.0f);
    // `adaptive` adds what a cell of 10 m may vary by: a typical 0.0075 m^2
    // that is known to a factor (std 0.0122), cut off below 0: 0.0130, once for
    // the mean and once for the place: sqrt(0.25 + 0.0260) = 0.5253.
    EXPECT_NEAR(got.std_m, kind == EstimatorKind::kAdaptive ? 0.5253f : 0.5f,
                1e-3f);
    EXPECT_FALSE(map.View().DefaultPrior().has_value());
  }
}

TEST(LocalMap, LandInThePriorDoesNotPullAMeasuredCell) {
  for (const EstimatorKind kind : kAll) {
    LocalMapOptions options = TestOptions(kind);
    LocalMap map = MakeMap(options);
    const PriorSource land = [](const GeodeticPoint&) {
      return DepthEstimate{.kind = EvidenceKind::kLand};
    };
    map.Update(PingOn(options, kCell, 3.0f, 0.5f), land);
    EXPECT_EQ(map.View().AtCell(kCell)->depth_m, 3.0f);
  }
}

TEST(LocalMap, TransferMovesOnlyWhatCameSinceAndChangesNoAnswer) {
  for (const EstimatorKind kind : kAll) {
    LocalMapOptions options = TestOptions(kind);
    LocalMap map = MakeMap(options);
    const GeodeticPoint there = map.View().CellCenter(kCell);
    for (const float depth_m : {24.0f, 25.0f, 26.0f}) {
      map.Update(PingOn(options, kCell, depth_m, 0.5f), nullptr);
    }
    const LocalMapView before = map.View();
    EXPECT_EQ(before.EvidenceAt(there)->depth_m, 25.0f);
    map.MarkTransferred();
    const LocalMapView after = map.View();
    EXPECT_EQ(after.At(there)->depth_m, before.At(there)->depth_m);
    EXPECT_EQ(after.At(there)->std_m, before.At(there)->std_m);
    EXPECT_EQ(after.At(there)->shoalest_m, 24.0f);
    EXPECT_EQ(after.At(there)->time_s, 1000u);
    EXPECT_EQ(after.cells_measured(), 1u);
    EXPECT_FALSE(after.EvidenceAt(there).has_value());
    int areas = 0;
    const auto count = [&](const AreaCorners&, std::size_t) { ++areas; };
    after.ForEachMeasuredArea(count);
    EXPECT_EQ(areas, 0);

    map.Update(PingOn(options, kCell, 27.0f, 0.5f), nullptr);
    const LocalMapView later = map.View();
    EXPECT_EQ(later.EvidenceAt(there)->depth_m, 27.0f);  // The new one alone.
    EXPECT_EQ(later.cells_measured(), 1u);
    later.ForEachMeasuredArea(count);
    EXPECT_EQ(areas, 1);
    // The answer is that of a map that never transferred.
    LocalMap whole = MakeMap(options);
    for (const float depth_m : {24.0f, 25.0f, 26.0f, 27.0f}) {
      whole.Update(PingOn(options, kCell, depth_m, 0.5f), nullptr);
    }
    EXPECT_NEAR(later.At(there)->depth_m, whole.View().At(there)->depth_m,
                1e-5);
    EXPECT_NEAR(later.At(there)->std_m, whole.View().At(there)->std_m, 1e-5);
  }
}

TEST(LocalMap, EvidenceLeavesThePriorOut) {
  LocalMapOptions options = TestOptions(EstimatorKind::kKalman);
  options.default_std_m = 0.1f;
  LocalMap map = MakeMap(options);
  map.Update(PingOn(options, kCell, 25.0f, 0.5f), nullptr);
  const LocalMapView view = map.View();
  EXPECT_LT(view.AtCell(kCell)->depth_m, 20.5f);  // Held by the prior.
  const DepthEstimate evidence = *view.EvidenceAt(view.CellCenter(kCell));
  EXPECT_EQ(evidence.depth_m, 25.0f);
  EXPECT_EQ(evidence.std_m, 0.5f);
}

// 40 pings of 21 beams from a seed, over three blocks and the map's border.
std::vector<Ping> Pings(const LocalMapOptions& options) {
  std::mt19937 random(17);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  std::vector<Ping> pings(40);
  const NedFrame frame(options.south_west);
  for (std::size_t k = 0; k < pings.size(); ++k) {
    pings[k].time = Time(std::chrono::seconds(1000 + k));
    pings[k].pose.position =
        frame.ToGeodetic(100.0 + 8.0 * static_cast<double>(k), 200.0);
    pings[k].pose.heading_deg = 20.0;
    for (int beam = -10; beam <= 10; ++beam) {
      pings[k].beams.push_back({.range_m = 20.0f + 60.0f * unit(random),
                                .bearing_rad = 0.12f * static_cast<float>(beam),
                                .depth_m = 20.0f + 2.0f * unit(random),
                                .std_m = 0.1f + unit(random)});
    }
  }
  return pings;
}

bool SameBits(const LocalMapView& a, const LocalMapView& b) {
  bool same = a.cells_measured() == b.cells_measured() &&
              a.block_count() == b.block_count() &&
              a.memory_bytes() == b.memory_bytes();
  a.ForEachBlock([&](BlockIndex index, const LocalBlock& block) {
    const LocalBlock* other = b.Block(index);
    same = same && other != nullptr && block.evidence == other->evidence &&
           block.nervegna == other->nervegna;
  });
  return same;
}

TEST(LocalMap, IsDeterministicWhereverItIsViewedSavedAndRestored) {
  for (const EstimatorKind kind : kAll) {
    LocalMapOptions options = TestOptions(kind);
    options.smoothing_distance_m = 20.0;
    options.smoothing_scale = 0.4;
    const std::vector<Ping> pings = Pings(options);
    LocalMap straight = MakeMap(options);
    for (const Ping& ping : pings) straight.Update(ping, nullptr);

    LocalMap halting = MakeMap(options);
    for (std::size_t k = 0; k < pings.size(); ++k) {
      halting.Update(pings[k], nullptr);
      if (k % 3 == 0) halting.View();
      if (k % 10 == 9) {  // A restart.
        LocalMap restored = MakeMap(options);
        halting.View().ForEachBlock(
            [&](BlockIndex index, const LocalBlock& block) {
              ASSERT_THAT(restored.RestoreBlock(index, block), IsOk());
            });
        halting = std::move(restored);
      }
    }
    EXPECT_TRUE(SameBits(straight.View(), halting.View()))
        << EstimatorName(kind);
    EXPECT_GT(straight.View().cells_measured(), 300u);
  }
}

TEST(LocalMap, RestoreRefusesWhatDoesNotFit) {
  LocalMap map = MakeMap(TestOptions(EstimatorKind::kNervegna));
  // 50 cells are 4 blocks: rows 0 to 3.
  LocalBlock block;
  block.nervegna.resize(kBlockCells);
  EXPECT_THAT(map.RestoreBlock({.row = 3, .col = 3}, block), IsOk());
  EXPECT_FALSE(map.RestoreBlock({.row = 4, .col = 0}, block).ok());
  EXPECT_FALSE(map.RestoreBlock({.row = 0, .col = 4}, block).ok());
  EXPECT_FALSE(map.RestoreBlock({}, LocalBlock{}).ok());
}

// A block whose seal was right and whose weight was no weight made a reading
// NaN, and the fuzzer found it (tests/fuzz/corpus/tiles/weightless).
TEST(LocalMap, RestoreRefusesWhatNoSoundingLeaves) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  LocalMap map = MakeMap(TestOptions(EstimatorKind::kAdaptive));
  const PackedEvidence sound = {.weight = 4.0f,
                                .mean_m = 20.0f,
                                .scatter = 1.0f,
                                .time_count = 2u << 16 | 1u << 31};
  const auto restore =
      [&](const PackedEvidence& fresh, const CellPrior& prior = {},
          const PendingShoal& pending = {.depth_m = 3.0f, .std_m = 0.1f}) {
        LocalBlock block;
        block.evidence.Restore(7, fresh, nullptr);
        block.uniform_prior = prior;
        block.pending = {pending};
        return map.RestoreBlock({}, block);
      };
  EXPECT_THAT(restore(sound), IsOk());
  for (const float bad : {kNan, -1.0f, 0.0f, 1e-9f, 1e20f}) {
    PackedEvidence cell = sound;
    cell.weight = bad;
    EXPECT_FALSE(restore(cell).ok()) << "weight " << bad;
  }
  for (const float bad : {kNan, -102.0f, 12002.0f}) {
    PackedEvidence cell = sound;
    cell.mean_m = bad;
    EXPECT_FALSE(restore(cell).ok()) << "mean " << bad;
    EXPECT_FALSE(restore(sound, {}, {.depth_m = bad, .std_m = 0.1f}).ok())
        << "pending " << bad;
  }
  // Four soundings of 1 m scatter by less than 4 (12 100 m)^2 m^-2.
  for (const float bad : {kNan, 1e9f, -1e9f}) {
    PackedEvidence cell = sound;
    cell.scatter = bad;
    EXPECT_FALSE(restore(cell).ok()) << "scatter " << bad;
  }
  PackedEvidence uncounted = sound;
  uncounted.time_count = 1u << 31;
  EXPECT_FALSE(restore(uncounted).ok());
  // Measured, and yet nothing counted; counted, and yet not measured.
  EXPECT_FALSE(restore({.time_count = 1u << 31}).ok());
  PackedEvidence unmeasured = sound;
  unmeasured.time_count = 2u << 16;
  EXPECT_FALSE(restore(unmeasured).ok());
  for (const float bad : {kNan, 0.0f, -1.0f, 1e9f}) {
    EXPECT_FALSE(
        restore(sound,
                {.depth_m = 20.0f, .std_m = bad, .kind = EvidenceKind::kPrior})
            .ok())
        << "prior std " << bad;
    EXPECT_FALSE(restore(sound, {}, {.depth_m = 3.0f, .std_m = bad}).ok())
        << "pending std " << bad;
  }
  for (const float bad : {kNan, -1e9f, 1e9f}) {
    EXPECT_FALSE(
        restore(sound,
                {.depth_m = bad, .std_m = 1.0f, .kind = EvidenceKind::kPrior})
            .ok())
        << "prior " << bad;
    EXPECT_FALSE(restore(sound, {.depth_m = 20.0f,
                                 .std_m = 1.0f,
                                 .kind = EvidenceKind::kPrior,
                                 .hazard_m = bad})
                     .ok())
        << "hazard " << bad;
  }
  // Land has no depth.
  EXPECT_THAT(restore(sound, {.depth_m = kNan, .kind = EvidenceKind::kLand}),
              IsOk());
  LocalMap nervegna = MakeMap(TestOptions(EstimatorKind::kNervegna));
  LocalBlock block;
  block.nervegna.resize(kBlockCells);
  EXPECT_THAT(nervegna.RestoreBlock({}, block), IsOk());
  for (const float bad : {kNan, -1.0f}) {
    block.nervegna[255] = {.mean_m = 20.0f, .variance_m2 = bad};
    EXPECT_FALSE(nervegna.RestoreBlock({}, block).ok()) << "variance " << bad;
  }
  block.nervegna[255] = {.mean_m = kNan, .variance_m2 = 1.0f};
  EXPECT_FALSE(nervegna.RestoreBlock({}, block).ok());
  block.nervegna[255] = {};
  block.pending = {{.depth_m = 3.0f, .std_m = 0.1f}};
  EXPECT_FALSE(nervegna.RestoreBlock({}, block).ok());
}

}  // namespace
}  // namespace fathom::map
