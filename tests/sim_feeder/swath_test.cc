#include "sim_feeder/swath.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/sim_feeder/plane_terrain.h"

namespace fathom::feeder {
namespace {

constexpr double kPi = std::numbers::pi;
// Beam 80 is 30 beams to starboard of the middle one: 45 degrees; 20: to port.
constexpr int kStarboard45 = 80;
constexpr int kPort45 = 20;

const BeamHit& HitOf(const std::vector<BeamHit>& hits, int beam) {
  for (const BeamHit& hit : hits) {
    if (hit.beam == beam) return hit;
  }
  static const BeamHit kNone = {.beam = -1};
  return kNone;
}

TEST(IntersectSwath, MeetsAFlatFloorAtAltitudeTimesTangent) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 30.0; });
  const std::vector<BeamHit> hits =
      IntersectSwath(*seabed, {}, {.depth_m = 10.0, .course_rad = 0.0});
  ASSERT_EQ(hits.size(), 101u);
  for (int beam = 0; beam <= 100; ++beam) {
    const BeamHit& hit = hits[static_cast<std::size_t>(beam)];
    EXPECT_EQ(hit.beam, beam);
    // 20 m above the floor; course north, so starboard is east.
    EXPECT_NEAR(hit.east_m, 20.0 * std::tan((beam - 50) * 1.5 * kPi / 180.0),
                1e-9);
    EXPECT_NEAR(hit.north_m, 0.0, 1e-9);
    EXPECT_DOUBLE_EQ(hit.depth_m, 30.0);
  }
}

TEST(IntersectSwath, MeetsASlopeWhereRayAndPlaneCross) {
  // D = 20 + 0.1 e; from the surface at 45 degrees the ray's depth is s.
  // Starboard (east, downhill): s = 20 + 0.1 s, s = 20 / 0.9 = 22.2222.
  // Port (west, uphill): s = 20 - 0.1 s, s = 20 / 1.1 = 18.1818.
  const auto seabed =
      MakePlaneSeabed([](double, double east_m) { return 20 + 0.1 * east_m; });
  const std::vector<BeamHit> hits = IntersectSwath(*seabed, {}, {});
  // Depths are kept as float: 1e-5 m.
  EXPECT_NEAR(HitOf(hits, kStarboard45).east_m, 20.0 / 0.9, 1e-4);
  EXPECT_NEAR(HitOf(hits, kStarboard45).depth_m, 20.0 / 0.9, 1e-4);
  EXPECT_NEAR(HitOf(hits, kPort45).east_m, -20.0 / 1.1, 1e-4);
  EXPECT_NEAR(HitOf(hits, kPort45).depth_m, 20.0 / 1.1, 1e-4);
  EXPECT_NEAR(HitOf(hits, 50).depth_m, 20.0, 1e-4);
}

TEST(IntersectSwath, StarboardIsTheCourseAndNinetyDegrees) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 20.0; });
  struct Case {
    double course_rad;
    double north_m;
    double east_m;
  };
  // Starboard of north is east, of east south, of south west, of west north.
  for (const Case& expected :
       {Case{0.0, 0.0, 20.0}, Case{kPi / 2, -20.0, 0.0}, Case{kPi, 0.0, -20.0},
        Case{-kPi / 2, 20.0, 0.0}}) {
    const std::vector<BeamHit> hits =
        IntersectSwath(*seabed, {}, {.course_rad = expected.course_rad});
    EXPECT_NEAR(HitOf(hits, kStarboard45).north_m, expected.north_m, 1e-9);
    EXPECT_NEAR(HitOf(hits, kStarboard45).east_m, expected.east_m, 1e-9);
    EXPECT_NEAR(HitOf(hits, kPort45).north_m, -expected.north_m, 1e-9);
    EXPECT_NEAR(HitOf(hits, kPort45).east_m, -expected.east_m, 1e-9);
  }
}

TEST(IntersectSwath, ARidgeHidesWhatLiesBehindIt) {
  // A ridge 15 m high whose crest is the cell at 35 m east (D = 5 there, 20
  // elsewhere, the flanks from 25 to 35 and from 35 to 45 m). From the surface
  // the crest is seen at atan(35 / 5) = 81.9 degrees: every ray between
  // atan(25 / 20) = 51.3 and 75 degrees ends on the near flank.
  const auto seabed = MakePlaneSeabed([](double, double east_m) {
    return std::abs(east_m - 35.0) < 1.0 ? 5.0 : 20.0;
  });
  for (const BeamHit& hit : IntersectSwath(*seabed, {}, {})) {
    EXPECT_LT(hit.east_m, 35.0);
    if ((hit.beam - 50) * 1.5 > 51.4) {
      EXPECT_GT(hit.east_m, 25.0);
    }
  }
  // 60 degrees: the flank is D = 20 - 1.5 (s - 25), the ray s cot 60 =
  // 0.57735 s: s = 57.5 / 2.07735 = 27.679.
  EXPECT_NEAR(HitOf(IntersectSwath(*seabed, {}, {}), 90).east_m,
              57.5 / (1.5 + 1.0 / std::sqrt(3.0)), 1e-4);
}

TEST(IntersectSwath, BeamsBeyondTheRangeDoNotReturn) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 20.0; });
  // Slant range is 20 / cos(angle): 28.2842 m at 45 degrees, 29.0 at 46.5.
  const std::vector<BeamHit> hits =
      IntersectSwath(*seabed, {.max_slant_range_m = 28.5}, {});
  EXPECT_EQ(hits.front().beam, kPort45);
  EXPECT_EQ(hits.back().beam, kStarboard45);
  EXPECT_EQ(hits.size(), 61u);
}

TEST(IntersectSwath, RaysEndWhereTheTerrainHasNoValue) {
  const auto seabed = MakePlaneSeabed([](double, double east_m) {
    return east_m > 40.0 ? std::numeric_limits<double>::quiet_NaN() : 20.0;
  });
  const std::vector<BeamHit> hits = IntersectSwath(*seabed, {}, {});
  // The last centre with a value lies at 35 m: 60 degrees is 34.6 m, 61.5
  // degrees 36.8 m.
  EXPECT_EQ(hits.back().beam, 90);
  EXPECT_EQ(hits.front().beam, 0);
}

TEST(IntersectSwath, HearsNothingInTheGroundOrOffTheTerrain) {
  const auto seabed = MakePlaneSeabed([](double, double) { return 20.0; });
  EXPECT_TRUE(IntersectSwath(*seabed, {}, {.depth_m = 20.0}).empty());
  EXPECT_TRUE(IntersectSwath(*seabed, {}, {.north_m = 600.0}).empty());
}

TEST(IntersectSwath, FirstMeetingAgreesWithAFineMarchAlongEachRay) {
  // Oracle: march each ray in 1 cm steps over rough ground.
  const auto seabed = MakePlaneSeabed([](double north_m, double east_m) {
    return 25.0 + 4.0 * std::sin(north_m / 23.0) +
           5.0 * std::cos(east_m / 17.0);
  });
  const SonarPlace sonar = {
      .north_m = 12.0, .east_m = -31.0, .depth_m = 6.0, .course_rad = 0.7};
  const std::vector<BeamHit> hits = IntersectSwath(*seabed, {}, sonar);
  ASSERT_EQ(hits.size(), 101u);
  for (const BeamHit& hit : hits) {
    const double angle = (hit.beam - 50) * 1.5 * kPi / 180.0;
    double slant_m = 0.0;
    double north_m = 0.0;
    double east_m = 0.0;
    do {
      slant_m += 0.01;
      const double across_m = slant_m * std::sin(angle);
      north_m = sonar.north_m - across_m * std::sin(sonar.course_rad);
      east_m = sonar.east_m + across_m * std::cos(sonar.course_rad);
    } while (sonar.depth_m + slant_m * std::cos(angle) <
             *seabed->DepthAt(north_m, east_m));
    // The profile is straight over 2.5 m; twist and grazing rays allow for
    // 2.5^2 / 8 * twist(0.0007 / m... 0.01 / m) / (slope of the ray) < 0.1 m.
    EXPECT_NEAR(hit.north_m, north_m, 0.1) << "beam " << hit.beam;
    EXPECT_NEAR(hit.east_m, east_m, 0.1) << "beam " << hit.beam;
  }
}

}  // namespace
}  // namespace fathom::feeder
