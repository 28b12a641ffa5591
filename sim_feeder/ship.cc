#include "sim_feeder/ship.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "absl/strings/str_format.h"

namespace fathom::feeder {
namespace {

constexpr int kCoursesTried = 32;
constexpr double kWetEnough = 0.95;
constexpr int kLooks = 64;
// A ship needs this much water, metres.
constexpr double kDraughtM = 2.0;

// Ships of one kind and how fast they go.
struct ShipKind {
  v1::ContactClass contact_class;
  double least_m_s;
  double most_m_s;
};
constexpr std::array<ShipKind, 3> kKinds = {{
    {v1::CONTACT_CLASS_VESSEL, 3.0, 8.0},
    {v1::CONTACT_CLASS_SMALL_CRAFT, 2.0, 10.0},
    {v1::CONTACT_CLASS_DEEP_DRAUGHT, 3.0, 7.0},
}};

double WetShare(const LocalTerrain& terrain, const Ship& ship,
                double duration_s) {
  int wet = 0;
  for (int i = 0; i < kLooks; ++i) {
    const PlanePoint place = ship.PlaceAt(duration_s * i / (kLooks - 1));
    const std::optional<double> depth_m =
        terrain.DepthAt(place.north_m, place.east_m);
    if (!depth_m.has_value() || *depth_m >= kDraughtM) ++wet;
  }
  return static_cast<double>(wet) / kLooks;
}

// Passes `crossing_m` abeam of the vehicle at `seconds`.
PlanePoint StartOfCrossing(const Vehicle& vehicle, const Ship& ship,
                           double seconds, double crossing_m, bool to_left) {
  const VehicleState state = vehicle.StateAt(seconds);
  const double speed_m_s = std::hypot(ship.north_m_s, ship.east_m_s);
  const double side = (to_left ? -crossing_m : crossing_m) / speed_m_s;
  return {
      .north_m =
          state.north_m - side * ship.east_m_s - seconds * ship.north_m_s,
      .east_m = state.east_m + side * ship.north_m_s - seconds * ship.east_m_s};
}

}  // namespace

Ship::Motion Ship::MotionAt(double seconds) const {
  Motion motion = {
      .place = start, .north_m_s = north_m_s, .east_m_s = east_m_s};
  double since_s = 0.0;
  const auto go_until = [&](double until_s) {
    motion.place.north_m += (until_s - since_s) * motion.north_m_s;
    motion.place.east_m += (until_s - since_s) * motion.east_m_s;
    since_s = until_s;
  };
  for (const CourseChange& change : changes) {
    if (change.at_s > seconds) break;
    go_until(change.at_s);
    motion.north_m_s = change.north_m_s;
    motion.east_m_s = change.east_m_s;
  }
  go_until(seconds);
  return motion;
}

void Chase(const Vehicle& vehicle, const Pursuit& pursuit, double until_s,
           Ship& ship) {
  const double interval_s = std::max(
      pursuit.interval_s, (until_s - pursuit.from_s) / kMaxPursuitLooks);
  PlanePoint place = ship.PlaceAt(pursuit.from_s);
  for (int look = 0; pursuit.from_s + look * interval_s < until_s; ++look) {
    const double at_s = pursuit.from_s + look * interval_s;
    const VehicleState prey = vehicle.StateAt(at_s);
    const double north_m = prey.north_m - place.north_m;
    const double east_m = prey.east_m - place.east_m;
    const double away_m = std::hypot(north_m, east_m);
    // Per metre away: 0 where it is there already.
    const double speed_per_m =
        away_m > 0.0 ? std::min(pursuit.speed_m_s, away_m / interval_s) / away_m
                     : 0.0;
    const CourseChange change = {.at_s = at_s,
                                 .north_m_s = north_m * speed_per_m,
                                 .east_m_s = east_m * speed_per_m};
    if (at_s <= 0.0) {
      ship.north_m_s = change.north_m_s;
      ship.east_m_s = change.east_m_s;
    } else {
      ship.changes.push_back(change);
    }
    place.north_m += change.north_m_s * interval_s;
    place.east_m += change.east_m_s * interval_s;
  }
}

std::vector<Ship> MakeShips(const LocalTerrain& terrain, const SurveyArea& area,
                            const Vehicle& vehicle, const ShipOptions& options,
                            Random& random) {
  std::vector<Ship> ships;
  for (int i = 0; i < options.count; ++i) {
    const ShipKind& kind = kKinds[static_cast<std::size_t>(i) % kKinds.size()];
    Ship best;
    double best_share = -1.0;
    for (int trial = 0; trial < kCoursesTried && best_share < kWetEnough;
         ++trial) {
      Ship ship;
      ship.id = absl::StrFormat("ship-%d", i + 1);
      ship.contact_class = kind.contact_class;
      const double speed_m_s = random.Uniform(kind.least_m_s, kind.most_m_s);
      const double course_rad = random.Uniform(0.0, 2.0 * std::numbers::pi);
      ship.north_m_s = speed_m_s * std::cos(course_rad);
      ship.east_m_s = speed_m_s * std::sin(course_rad);
      const double north = random.Uniform(-0.2, 1.2);
      const double east = random.Uniform(-0.2, 1.2);
      if (i == 0) {
        ship.start = StartOfCrossing(vehicle, ship, 0.4 * options.duration_s,
                                     options.crossing_m, north < 0.5);
      } else {
        const double pass_s = options.duration_s * i / (options.count - 1);
        ship.start = {
            .north_m = north * area.north_extent_m - pass_s * ship.north_m_s,
            .east_m = east * area.east_extent_m - pass_s * ship.east_m_s};
      }
      const double share = WetShare(terrain, ship, options.duration_s);
      if (share > best_share) {
        best_share = share;
        best = ship;
      }
    }
    ships.push_back(best);
  }
  return ships;
}

}  // namespace fathom::feeder
