// The vehicle's motion along a track: constant speed on the legs, turns on
// the spot at a stated rate, circles where it loiters, depth kept by altitude
// or by depth.
//
// Pure kinematics, exact and without noise (thesis 3.5.1: "the exact position
// and attitude of the UUV at the time of each ping"). Immutable after Create;
// thread-safe.

#ifndef FATHOM_SIM_FEEDER_VEHICLE_H_
#define FATHOM_SIM_FEEDER_VEHICLE_H_

#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "sim_feeder/local_terrain.h"
#include "sim_feeder/track_plan.h"

namespace fathom::feeder {

struct VehicleOptions {
  // Over ground, m/s, > 0.
  double speed_m_s = 2.0;
  // Turning on the spot, degrees per second, > 0.
  double turn_rate_deg_s = 15.0;
  // Height above the seabed to keep, metres, > 0; the vehicle never goes lower
  // (at an edge by 1 m times the slope of its climb: depths are planned every
  // 2 m).
  double altitude_m = 15.0;
  // If given: the depth to keep, metres, where the altitude allows it.
  std::optional<double> depth_m = {};
  // Never shallower than this, metres, >= 0. In water shallower than altitude
  // plus this the vehicle runs at half the water depth at most.
  double least_depth_m = 1.0;
  // Steepest climb or dive, degrees, in (0, 90).
  double max_pitch_deg = 20.0;
};

// A corner of the track; with a loiter the vehicle circles there before it
// goes on: to starboard, in whole circles that begin and end in the corner with
// the course on which it came, for loiter_s at least.
struct Waypoint {
  PlanePoint place = {};
  // Metres, at least speed over turn rate (2 m/s and 15 degrees/s: 7.64 m).
  double loiter_radius_m = 0.0;
  // Seconds; 0: no circle.
  double loiter_s = 0.0;
};

struct VehicleState {
  double north_m = 0.0;
  double east_m = 0.0;
  double depth_m = 0.0;
  // In the plane, radians clockwise from its north axis, (-pi, pi].
  double course_rad = 0.0;
  // Starboard down positive: that of a coordinated turn, atan(v^2 / (g r)), on
  // a circle; 0 elsewhere. Radians.
  double roll_rad = 0.0;
  // Bow up positive: along the planned depth. Radians.
  double pitch_rad = 0.0;
};

class Vehicle {
 public:
  // Errors: INVALID_ARGUMENT (options, a track that goes nowhere, a circle
  // tighter than the turn rate allows);
  // OUT_OF_RANGE where the track leaves the terrain or touches ground;
  // RESOURCE_EXHAUSTED for a track above 20 000 km.
  static absl::StatusOr<Vehicle> Create(const LocalTerrain& terrain,
                                        const std::vector<Waypoint>& track,
                                        const VehicleOptions& options);

  // Where it is `seconds` after the start; before it: the start, after
  // duration_s: the end. O(log corners).
  VehicleState StateAt(double seconds) const;

  // Time for the whole track, seconds.
  double duration_s() const { return pieces_.back().end_s; }
  // Its length, metres.
  double length_m() const { return length_m_; }

 private:
  // A straight leg; or, where both places are equal, a turn on the spot or
  // circles that begin and end there.
  struct Piece {
    double begin_s;
    double end_s;
    PlanePoint from;
    PlanePoint to;
    double begin_course_rad;
    double turn_rad;  // Course gained over the piece.
    double along_m;   // Length of track before the piece.
    double length_m;
    double radius_m = 0.0;  // Of the circles; 0: none.

    PlanePoint PlaceAt(double part) const;
  };

  void AddTurn(const PlanePoint& at, double to_course_rad,
               const VehicleOptions& options);
  void AddLeg(const PlanePoint& from, const PlanePoint& to,
              const VehicleOptions& options);
  void AddLoiter(const Waypoint& at, const VehicleOptions& options);
  // Where and when the next piece begins, and on which course.
  double EndS() const { return pieces_.empty() ? 0.0 : pieces_.back().end_s; }

  Vehicle() = default;
  absl::Status PlanDepth(const LocalTerrain& terrain,
                         const VehicleOptions& options);
  PlanePoint PlaceAt(double along_m) const;
  double DepthAlong(double along_m) const;
  // Metres deeper for each metre along the track.
  double SlopeAlong(double along_m) const;

  std::vector<Piece> pieces_;
  double length_m_ = 0.0;
  double course_rad_ = 0.0;  // At the end of the last piece.
  double depth_step_m_ = 1.0;
  std::vector<double> depth_m_;  // Every depth_step_m_ along the track.
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_VEHICLE_H_
