// Moving obstacles: points with constant velocity, independent of the vehicle
// (Nervegna 2002, section 3.6.1); or as a scenario scripts them: turns,
// stops, a chase.

#ifndef FATHOM_SIM_FEEDER_SHIP_H_
#define FATHOM_SIM_FEEDER_SHIP_H_

#include <string>
#include <vector>

#include "fathom/v1/types.pb.h"
#include "sim_feeder/local_terrain.h"
#include "sim_feeder/random.h"
#include "sim_feeder/survey_area.h"
#include "sim_feeder/track_plan.h"
#include "sim_feeder/vehicle.h"

namespace fathom::feeder {

// A velocity from a time on.
struct CourseChange {
  // Since the start of the simulation, seconds, > 0.
  double at_s = 0.0;
  double north_m_s = 0.0;
  double east_m_s = 0.0;
};

struct Ship {
  // Contact id, "ship-1" and so on.
  std::string id = {};
  v1::ContactClass contact_class = v1::CONTACT_CLASS_VESSEL;
  // At the start of the simulation, in the plane about the area's south-west.
  PlanePoint start = {};
  double north_m_s = 0.0;
  double east_m_s = 0.0;
  // In order of time; a stop is one of 0 m/s.
  std::vector<CourseChange> changes = {};

  // Where it is `seconds` after the start.
  PlanePoint PlaceAt(double seconds) const { return MotionAt(seconds).place; }

  struct Motion {
    PlanePoint place;
    double north_m_s = 0.0;
    double east_m_s = 0.0;
  };
  // That and how it moves there: O(changes).
  Motion MotionAt(double seconds) const;
};

// A ship that chases the vehicle: it heads for where the vehicle is, again and
// again.
struct Pursuit {
  std::string ship_id = {};
  // Since the start of the simulation, seconds: when its script is over.
  double from_s = 0.0;
  // Metres per second, > 0; less where it would run past the vehicle.
  double speed_m_s = 5.0;
  // Between two looks at where the vehicle is, seconds, > 0.
  double interval_s = 10.0;
};

// Course changes at most that a pursuit is made of: a longer run looks less
// often.
inline constexpr double kMaxPursuitLooks = 10'000;

// Gives `ship` the course changes of the pursuit until `until_s`.
void Chase(const Vehicle& vehicle, const Pursuit& pursuit, double until_s,
           Ship& ship);

struct ShipOptions {
  // 0 to 1000.
  int count = 3;
  // Of the run, seconds, > 0.
  double duration_s = 600.0;
  // How near the first ship comes to the vehicle, 40 % into the run, metres.
  double crossing_m = 120.0;
};

// The first ship crosses near the vehicle. The others pass the area one after
// the other, the last at the end of the run: ships of constant velocity are
// soon far away on a long one. Of 32 drawn courses a ship takes the first that
// is 95 % over water (places off the terrain count as water), else the
// wettest. Classes take turns. Deterministic in `random`.
std::vector<Ship> MakeShips(const LocalTerrain& terrain, const SurveyArea& area,
                            const Vehicle& vehicle, const ShipOptions& options,
                            Random& random);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_SHIP_H_
