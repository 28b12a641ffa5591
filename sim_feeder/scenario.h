// Everything that decides what a simulated run sends. Plain values: the same
// scenario over the same terrain gives the same messages, byte for byte.

#ifndef FATHOM_SIM_FEEDER_SCENARIO_H_
#define FATHOM_SIM_FEEDER_SCENARIO_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/time.h"
#include "sim_feeder/forward_sonar.h"
#include "sim_feeder/navigation.h"
#include "sim_feeder/ship.h"
#include "sim_feeder/sonar_faults.h"
#include "sim_feeder/survey_area.h"
#include "sim_feeder/vehicle.h"

namespace fathom::feeder {

struct Scenario {
  std::uint64_t seed = 1;
  std::string activity_id;
  SurveyArea area;
  Time start_time;

  VehicleOptions vehicle;
  // Where it goes, one after the other, and again from the first on while the
  // run lasts; empty: to and fro over the area, legs `track_spacing_m` apart.
  std::vector<Waypoint> waypoints = {};
  // Between legs, metres; absent: 2 tan(60 deg) times the altitude over the
  // area's median water, so that neighbouring swaths (which reach to 75 deg)
  // overlap.
  std::optional<double> track_spacing_m = {};
  // Least water that the vehicle goes over, metres.
  double min_water_m = 4.0;

  NavigationOptions navigation = {};

  ForwardSonarOptions sonar;
  SonarFaults faults = {};
  // Between pings, seconds, > 0.
  double ping_interval_s = 1.0;
  // How many pings; 0: as many as cover the area once.
  std::uint64_t pings = 0;

  // Ships about the vehicle.
  int ships = 3;
  double crossing_m = 120.0;
  // Besides these.
  std::vector<Ship> scripted_ships = {};
  // Of these, those that chase the vehicle once their script is over.
  std::vector<Pursuit> pursuits = {};
  // Bearing noise of the passive sonar, 1 sigma degrees, in (0, 45].
  double passive_bearing_std_deg = 1.5;
  // How far it hears, metres; 0: any distance, as in the thesis (3.6.1). On a
  // long run a ship of constant velocity would else be reported from another
  // sea.
  double passive_range_m = 20'000.0;
  // Between two reports on one ship, seconds, > 0.
  double report_interval_s = 10.0;
  // Between two C4I fixes of one ship, seconds; 0: none.
  double fix_interval_s = 300.0;
  // Noise of a C4I fix per axis (the thesis takes it for the truth; we state
  // what it is), 1 sigma.
  double fix_position_std_m = 10.0;
  double fix_velocity_std_m_s = 0.3;
};

// Errors: INVALID_ARGUMENT naming the field and its range. The sonar's and the
// vehicle's own options are checked by themselves.
absl::Status ValidateScenario(const Scenario& scenario);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_SCENARIO_H_
