// A vehicle's day at sea, as the messages that it sends.
//
// Pings come every ping_interval_s along a lawnmower or waypoints; each ship is
// reported by range and bearing in turn, and now and then fixed by C4I.
// Messages come in order of time and carry no source, epoch or sequence: the
// stream that sends them numbers them.
//
// Deterministic: same scenario and terrain, same bytes. Not thread-safe.

#ifndef FATHOM_SIM_FEEDER_SIMULATION_H_
#define FATHOM_SIM_FEEDER_SIMULATION_H_

#include <cstdint>
#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "base/time.h"
#include "fathom/v1/ingest_service.pb.h"
#include "sim_feeder/local_terrain.h"
#include "sim_feeder/navigation.h"
#include "sim_feeder/random.h"
#include "sim_feeder/scenario.h"
#include "sim_feeder/ship.h"
#include "sim_feeder/vehicle.h"

namespace fathom::feeder {

// The plane about the area's south-west corner that a simulation needs of the
// terrain: the area and a margin as wide as the sonar reaches, at most 2 km.
PlaneBox BoxAround(const SurveyArea& area, double max_slant_range_m);

class Simulation {
 public:
  // Plans the track and the ships. The terrain's plane must be that of the
  // area (origin south-west, box BoxAround).
  //
  // Errors: INVALID_ARGUMENT (a field, with its range), NOT_FOUND (no water to
  // survey), OUT_OF_RANGE (area not on the terrain).
  static absl::StatusOr<std::unique_ptr<Simulation>> Create(
      const Scenario& scenario, std::shared_ptr<const LocalTerrain> terrain);

  // The next message of the run; nullopt when all were given. The pointer is
  // valid until the next call (messages are reused). A ping that heard
  // nothing is left out (the contract asks for at least one measurement).
  using Message = std::variant<v1::Ping*, v1::ContactReport*>;
  std::optional<Message> Next();

  // Time of the last message, since the start, seconds.
  double now_s() const { return now_s_; }
  // Where the vehicle was then.
  const VehicleState& vehicle_state() const { return state_; }
  Time TimeAt(double seconds) const;

  // Ping times in the whole run, and how many are over.
  std::uint64_t pings_planned() const { return pings_planned_; }
  std::uint64_t pings_done() const { return next_ping_; }
  // Pings left out because no beam returned.
  std::uint64_t pings_silent() const { return pings_silent_; }
  double duration_s() const;

  const Scenario& scenario() const { return scenario_; }
  const std::vector<Ship>& ships() const { return ships_; }
  const Vehicle& vehicle() const { return *vehicle_; }
  const LocalTerrain& terrain() const { return *terrain_; }
  double track_spacing_m() const { return track_spacing_m_; }

 private:
  Simulation(const Scenario& scenario,
             std::shared_ptr<const LocalTerrain> terrain);

  absl::Status Plan();
  // The way, `passes` times.
  absl::StatusOr<std::vector<Waypoint>> PlanWay(int passes);
  void FillPose(const VehicleState& state, v1::VehiclePose& pose) const;
  bool FillPing(double seconds);
  bool FillRangeBearing(const Ship& ship, double seconds);
  void FillFix(const Ship& ship, double seconds);

  // When a ship is next heard and fixed, seconds.
  struct ShipSchedule {
    double next_report_s;
    double next_fix_s;
  };

  Scenario scenario_;
  std::shared_ptr<const LocalTerrain> terrain_;
  std::optional<Vehicle> vehicle_;
  std::vector<Ship> ships_;
  std::vector<ShipSchedule> schedule_;
  Navigation navigation_;
  Random sonar_random_;
  Random fault_random_;
  Random passive_random_;
  double track_spacing_m_ = 0.0;
  std::uint64_t pings_planned_ = 0;
  std::uint64_t next_ping_ = 0;
  std::uint64_t pings_silent_ = 0;
  double now_s_ = 0.0;
  VehicleState state_;
  v1::Ping ping_;
  v1::ContactReport report_;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_SIMULATION_H_
