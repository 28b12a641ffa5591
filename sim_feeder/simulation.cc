#include "sim_feeder/simulation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/proto_time.h"
#include "sim_feeder/angles.h"
#include "sim_feeder/named_range.h"
#include "sim_feeder/passive_sonar.h"
#include "sim_feeder/track_plan.h"

namespace fathom::feeder {
namespace {

constexpr double kMaxMarginM = 2'000.0;
constexpr int kMaxShips = 1'000;
// 30 years at 1 s: a run that long is a slip of the pen.
constexpr std::uint64_t kMaxPings = 1'000'000'000;
// Passes over the area that are planned at most.
constexpr int kMaxPasses = 1'000;

// Median over the area of how high the vehicle runs over water that it goes
// over; nullopt without such water.
std::optional<double> MedianAltitudeM(const LocalTerrain& terrain,
                                      const Scenario& scenario) {
  constexpr int kLooks = 48;
  std::vector<double> altitudes_m;
  for (int i = 0; i < kLooks; ++i) {
    for (int j = 0; j < kLooks; ++j) {
      const std::optional<double> water_m =
          terrain.DepthAt((i + 0.5) / kLooks * scenario.area.north_extent_m,
                          (j + 0.5) / kLooks * scenario.area.east_extent_m);
      if (!water_m.has_value() || *water_m < scenario.min_water_m) continue;
      const VehicleOptions& vehicle = scenario.vehicle;
      const double least_m = std::min(vehicle.least_depth_m, 0.5 * *water_m);
      const double wish_m = std::min(
          *water_m - vehicle.altitude_m,
          vehicle.depth_m.value_or(std::numeric_limits<double>::infinity()));
      altitudes_m.push_back(*water_m - std::max(wish_m, least_m));
    }
  }
  if (altitudes_m.empty()) return std::nullopt;
  const auto middle = altitudes_m.begin() + std::ssize(altitudes_m) / 2;
  std::nth_element(altitudes_m.begin(), middle, altitudes_m.end());
  return *middle;
}

}  // namespace

absl::Status ValidateScenario(const Scenario& scenario) {
  FATHOM_RETURN_IF_ERROR(ValidateArea(scenario.area));
  FATHOM_RETURN_IF_ERROR(ValidateForwardSonar(scenario.sonar));
  FATHOM_RETURN_IF_ERROR(ValidateSonarFaults(scenario.faults));
  FATHOM_RETURN_IF_ERROR(ValidateNavigation(scenario.navigation));
  return CheckRanges(
      {{"min_water_m", scenario.min_water_m, 0.1, 12'000.0},
       {"ping_interval_s", scenario.ping_interval_s, 1e-3, 3'600.0},
       {"passive_bearing_std_deg", scenario.passive_bearing_std_deg, 1e-6,
        45.0},
       {"passive_range_m", scenario.passive_range_m, 0.0, 2e7},
       {"report_interval_s", scenario.report_interval_s, 1e-2, 1e6},
       {"fix_interval_s", scenario.fix_interval_s, 0.0, 1e6},
       {"fix_position_std_m", scenario.fix_position_std_m, 0.0, 1e4},
       {"fix_velocity_std_m_s", scenario.fix_velocity_std_m_s, 0.0, 60.0},
       {"crossing_m", scenario.crossing_m, 0.0, 1e5},
       {"ships", static_cast<double>(scenario.ships), 0.0, kMaxShips},
       {"pings", static_cast<double>(scenario.pings), 0.0,
        static_cast<double>(kMaxPings)}});
}

PlaneBox BoxAround(const SurveyArea& area, double max_slant_range_m) {
  const double margin_m = std::min(kMaxMarginM, max_slant_range_m);
  return {.south_m = -margin_m,
          .north_m = area.north_extent_m + margin_m,
          .west_m = -margin_m,
          .east_m = area.east_extent_m + margin_m};
}

absl::StatusOr<std::unique_ptr<Simulation>> Simulation::Create(
    const Scenario& scenario, std::shared_ptr<const LocalTerrain> terrain) {
  FATHOM_RETURN_IF_ERROR(ValidateScenario(scenario));
  std::unique_ptr<Simulation> simulation(
      new Simulation(scenario, std::move(terrain)));
  FATHOM_RETURN_IF_ERROR(simulation->Plan());
  return simulation;
}

Simulation::Simulation(const Scenario& scenario,
                       std::shared_ptr<const LocalTerrain> terrain)
    : scenario_(scenario),
      terrain_(std::move(terrain)),
      navigation_(scenario.navigation, scenario.seed),
      sonar_random_(scenario.seed, RandomStream::kSonar),
      fault_random_(scenario.seed, RandomStream::kSonarFaults),
      passive_random_(scenario.seed, RandomStream::kPassiveSonar) {}

absl::StatusOr<std::vector<Waypoint>> Simulation::PlanWay(int passes) {
  std::vector<Waypoint> way;
  if (!scenario_.waypoints.empty()) {
    for (int pass = 0; pass < passes; ++pass) {
      way.insert(way.end(), scenario_.waypoints.begin(),
                 scenario_.waypoints.end());
    }
    return way;
  }
  FATHOM_ASSIGN_OR_RETURN(const std::vector<PlanePoint> track,
                          PlanTrack(*terrain_, scenario_.area,
                                    {.spacing_m = track_spacing_m_,
                                     .min_water_m = scenario_.min_water_m,
                                     .passes = passes}));
  for (const PlanePoint& corner : track) way.push_back({.place = corner});
  return way;
}

absl::Status Simulation::Plan() {
  if (scenario_.waypoints.empty()) {
    const std::optional<double> altitude_m =
        MedianAltitudeM(*terrain_, scenario_);
    if (!altitude_m.has_value()) {
      return absl::NotFoundError(absl::StrFormat(
          "the area has no water of min_water_m=%g on %s",
          scenario_.min_water_m, terrain_->terrain().grid().name));
    }
    track_spacing_m_ = scenario_.track_spacing_m.value_or(
        2.0 * std::tan(60.0 * kRadiansPerDegree) * *altitude_m);
  }
  const double wanted_s =
      static_cast<double>(scenario_.pings) * scenario_.ping_interval_s;
  for (int passes = 1;;) {
    FATHOM_ASSIGN_OR_RETURN(const std::vector<Waypoint> way, PlanWay(passes));
    FATHOM_ASSIGN_OR_RETURN(vehicle_,
                            Vehicle::Create(*terrain_, way, scenario_.vehicle));
    if (vehicle_->duration_s() >= wanted_s) break;
    const double times = wanted_s / vehicle_->duration_s();
    const int needed = static_cast<int>(
        std::min<double>(kMaxPasses + 1.0, std::ceil(times * passes)));
    passes = std::max(passes + 1, needed);
    if (passes > kMaxPasses) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "pings=%d would cover the area more than %d times; take fewer or a "
          "larger area",
          scenario_.pings, kMaxPasses));
    }
  }
  pings_planned_ = scenario_.pings > 0
                       ? scenario_.pings
                       : static_cast<std::uint64_t>(vehicle_->duration_s() /
                                                    scenario_.ping_interval_s) +
                             1;
  Random ship_random(scenario_.seed, RandomStream::kShips);
  ships_ = MakeShips(*terrain_, scenario_.area, *vehicle_,
                     {.count = scenario_.ships,
                      .duration_s = std::max(1.0, duration_s()),
                      .crossing_m = scenario_.crossing_m},
                     ship_random);
  ships_.insert(ships_.end(), scenario_.scripted_ships.begin(),
                scenario_.scripted_ships.end());
  for (const Pursuit& pursuit : scenario_.pursuits) {
    for (Ship& ship : ships_) {
      if (ship.id == pursuit.ship_id) {
        Chase(*vehicle_, pursuit, duration_s(), ship);
      }
    }
  }
  for (std::size_t i = 0; i < ships_.size(); ++i) {
    // Ships take turns within an interval.
    const double turn =
        static_cast<double>(i) / static_cast<double>(ships_.size());
    schedule_.push_back(
        {.next_report_s = turn * scenario_.report_interval_s,
         .next_fix_s = scenario_.fix_interval_s > 0.0
                           ? (0.5 + 0.5 * turn) * scenario_.fix_interval_s
                           : std::numeric_limits<double>::infinity()});
  }
  return absl::OkStatus();
}

double Simulation::duration_s() const {
  return static_cast<double>(pings_planned_ - 1) * scenario_.ping_interval_s;
}

Time Simulation::TimeAt(double seconds) const {
  return scenario_.start_time +
         Duration(static_cast<std::int64_t>(std::llround(seconds * 1e6)));
}

std::optional<Simulation::Message> Simulation::Next() {
  while (next_ping_ < pings_planned_) {
    const double ping_s =
        static_cast<double>(next_ping_) * scenario_.ping_interval_s;
    ShipSchedule* due = nullptr;
    double due_s = ping_s;
    for (ShipSchedule& entry : schedule_) {
      const double entry_s = std::min(entry.next_report_s, entry.next_fix_s);
      if (entry_s < due_s) {
        due_s = entry_s;
        due = &entry;
      }
    }
    now_s_ = due_s;
    state_ = vehicle_->StateAt(due_s);
    navigation_.Advance(due_s);
    if (due == nullptr) {
      ++next_ping_;
      if (FillPing(ping_s)) return &ping_;
      ++pings_silent_;
      continue;
    }
    const Ship& ship = ships_[static_cast<std::size_t>(due - schedule_.data())];
    if (due->next_fix_s <= due->next_report_s) {
      due->next_fix_s += scenario_.fix_interval_s;
      FillFix(ship, due_s);
      return &report_;
    }
    due->next_report_s += scenario_.report_interval_s;
    if (FillRangeBearing(ship, due_s)) return &report_;
  }
  return std::nullopt;
}

void Simulation::FillPose(const VehicleState& state,
                          v1::VehiclePose& pose) const {
  const PlanePoint error = navigation_.error();
  const map::GeodeticPoint position = terrain_->frame().ToGeodetic(
      state.north_m + error.north_m, state.east_m + error.east_m);
  if (!scenario_.navigation.exact()) {
    pose.set_position_std_m(navigation_.stated_std_m());
  }
  pose.mutable_position()->set_latitude_deg(position.latitude_deg);
  pose.mutable_position()->set_longitude_deg(position.longitude_deg);
  pose.set_depth_m(state.depth_m);
  pose.set_roll_deg(state.roll_rad * kDegreesPerRadian);
  pose.set_pitch_deg(state.pitch_rad * kDegreesPerRadian);
  // The course is in the plane; a heading counts from the meridian.
  pose.set_heading_deg(WrapTo360(
      (state.course_rad - terrain_->frame().NorthAzimuthRad(position)) *
      kDegreesPerRadian));
}

bool Simulation::FillPing(double seconds) {
  const SonarPlace sonar = {.north_m = state_.north_m,
                            .east_m = state_.east_m,
                            .depth_m = state_.depth_m,
                            .course_rad = state_.course_rad};
  const std::vector<SonarMeasurement> measurements = WithFaults(
      scenario_.faults, sonar.depth_m,
      MeasureForward(*terrain_, scenario_.sonar, sonar, sonar_random_),
      fault_random_);
  ping_.Clear();
  ping_.set_activity_id(scenario_.activity_id);
  *ping_.mutable_time() = client::ToProto(TimeAt(seconds));
  FillPose(state_, *ping_.mutable_pose());
  for (const SonarMeasurement& measurement : measurements) {
    ping_.add_range_m(static_cast<float>(measurement.range_m));
    ping_.add_bearing_deg(
        static_cast<float>(measurement.bearing_rad * kDegreesPerRadian));
    ping_.add_depth_m(static_cast<float>(measurement.depth_m));
    ping_.add_std_m(static_cast<float>(measurement.std_m));
  }
  return !measurements.empty();
}

bool Simulation::FillRangeBearing(const Ship& ship, double seconds) {
  const PlanePoint place = ship.PlaceAt(seconds);
  if (scenario_.passive_range_m > 0.0 &&
      std::hypot(place.north_m - state_.north_m, place.east_m - state_.east_m) >
          scenario_.passive_range_m) {
    return false;
  }
  const PassiveMeasurement measurement = MeasurePassive(
      {.sonar_north_m = state_.north_m,
       .sonar_east_m = state_.east_m,
       .course_rad = state_.course_rad,
       .target_north_m = place.north_m,
       .target_east_m = place.east_m},
      scenario_.passive_bearing_std_deg * kRadiansPerDegree, passive_random_);
  if (measurement.range_m <= 0.0) return false;
  report_.Clear();
  report_.set_contact_id(ship.id);
  report_.set_contact_class(ship.contact_class);
  *report_.mutable_time() = client::ToProto(TimeAt(seconds));
  v1::RangeBearing& observation = *report_.mutable_range_bearing();
  FillPose(state_, *observation.mutable_pose());
  observation.set_range_m(measurement.range_m);
  observation.set_bearing_deg(measurement.bearing_rad * kDegreesPerRadian);
  observation.set_range_std_m(measurement.range_std_m);
  observation.set_bearing_std_deg(measurement.bearing_std_rad *
                                  kDegreesPerRadian);
  return true;
}

void Simulation::FillFix(const Ship& ship, double seconds) {
  const double position_std_m = scenario_.fix_position_std_m;
  const double velocity_std_m_s = scenario_.fix_velocity_std_m_s;
  const Ship::Motion motion = ship.MotionAt(seconds);
  PlanePoint place = motion.place;
  place.north_m += passive_random_.Normal(0.0, position_std_m);
  place.east_m += passive_random_.Normal(0.0, position_std_m);
  report_.Clear();
  report_.set_contact_id(ship.id);
  report_.set_contact_class(ship.contact_class);
  *report_.mutable_time() = client::ToProto(TimeAt(seconds));
  v1::ContactFix& fix = *report_.mutable_fix();
  const map::GeodeticPoint position =
      terrain_->frame().ToGeodetic(place.north_m, place.east_m);
  fix.mutable_position()->set_latitude_deg(position.latitude_deg);
  fix.mutable_position()->set_longitude_deg(position.longitude_deg);
  fix.set_velocity_north_m_s(motion.north_m_s +
                             passive_random_.Normal(0.0, velocity_std_m_s));
  fix.set_velocity_east_m_s(motion.east_m_s +
                            passive_random_.Normal(0.0, velocity_std_m_s));
  fix.set_position_std_m(position_std_m);
  fix.set_velocity_std_m_s(velocity_std_m_s);
}

}  // namespace fathom::feeder
