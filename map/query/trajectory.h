// A timed path and what the map says of it: the words of the question "can I
// go there?". The answer is worked out by map/obstacle_map/check_trajectory.h,
// which knows all layers.
//
// The vehicle is a disc of radius r that moves on straight legs (geodesics) at
// a constant rate from waypoint to waypoint, its depth changing evenly. Its
// own position is N(planned, s^2) on each axis, so with probability c it is
// within
//
//   w = r + s sqrt(-2 ln(1 - c))
//
// of where it should be (Rayleigh's quantile): the swept half width. Every
// place within w of a leg is judged as obstacle_query.h says, at the vehicle's
// depth there. Contacts are judged at the time, their covariance widened by
// s^2 I, over the disc r_contact + r. (The papers are silent on s.)

#ifndef FATHOM_MAP_QUERY_TRAJECTORY_H_
#define FATHOM_MAP_QUERY_TRAJECTORY_H_

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "base/time.h"
#include "map/geodesy/ids.h"
#include "map/geodesy/points.h"
#include "map/query/obstacle_query.h"

namespace fathom::map {

struct Waypoint {
  GeodeticPoint position;
  // Metres below the mission's datum, in [-100, 12000].
  double depth_m = 0;
  Time time;
};

struct Trajectory {
  // At least two; times ascend strictly; legs of at most kMaxLegM.
  std::vector<Waypoint> waypoints;
  // r, metres, in [0, 1000].
  double radius_m = 0;
  // h, metres, >= 0.
  double vertical_clearance_m = 0;
  // s, 1 sigma per axis, metres, in [0, 1000].
  double position_std_m = 0;
  // c, in (0.5, 1).
  double confidence = 0.95;
  // A place without evidence counts as FREE; else as OCCUPIED.
  bool unknown_is_free = false;
};

// The longest leg: a day at 1 m/s.
inline constexpr double kMaxLegM = 100'000;

// The length of a leg between two places, metres, if it is beyond kMaxLegM;
// absent where the leg may be flown. Near places cost no geodesic.
std::optional<double> TooLongLegM(const GeodeticPoint& a,
                                  const GeodeticPoint& b);

// w, metres.
double SweptHalfWidthM(const Trajectory& trajectory);

// One leg, from waypoint i to i + 1.
struct LegVerdict {
  // The worst on the leg: OCCUPIED, then UNKNOWN (where that is not free), then
  // UNCERTAIN, then FREE.
  ObstacleState state = ObstacleState::kFree;
  // The greatest P of any place and time on it.
  double worst_probability = 0;
  // The least mean depth minus the vehicle's depth, metres, over known places;
  // absent: none is known. Minus infinity over land.
  std::optional<double> least_clearance_m;
};

// The first place in time that is OCCUPIED, or UNKNOWN where that counts so, or
// has a point hazard that the vehicle reaches, however small P is there.
struct Conflict {
  std::uint32_t leg = 0;
  // The obstacle's: the middle of the cell, or the contact's predicted place.
  GeodeticPoint position;
  // The vehicle's depth when it is nearest.
  double depth_m = 0;
  // When the cell's middle, seen along the leg, is w and half the cell's
  // diagonal ahead: never later than the swept disc touches the cell; of a
  // contact, when P first reaches c at a time looked at.
  Time time;
  ObstacleAnswer answer;
};

// Closest point of approach of one contact.
struct ContactApproach {
  ContactKey key;
  Time time;
  // Between the vehicle's planned and the contact's predicted place, metres.
  double distance_m = 0;
  // Of passing within r_contact + r of it, at whatever depth
  // (map/query/closest_approach.h).
  double probability = 0;
  // Its other names; nullptr: none.
  std::shared_ptr<const ContactLinks> links = nullptr;
};

struct TrajectoryVerdict {
  // The worst of all legs.
  ObstacleState state = ObstacleState::kFree;
  std::optional<Conflict> first_conflict;
  // One for each leg; up to the conflict's if the check stopped there.
  std::vector<LegVerdict> legs;
  // Contacts that may come within kNearSigmas standard deviations of the swept
  // disc, nearest first.
  std::vector<ContactApproach> approaches;
  // Cells of the map that were read.
  std::uint64_t cells = 0;
};

// Whether the question can be answered. Errors: INVALID_ARGUMENT naming the
// field ("waypoints[3].depth_m"), its value and range.
absl::Status ValidateTrajectory(const Trajectory& trajectory);

}  // namespace fathom::map

#endif  // FATHOM_MAP_QUERY_TRAJECTORY_H_
