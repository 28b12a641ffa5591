// How near a contact comes to a vehicle, when, and how probably within d.
//
// Both move at constant rate between the times looked at, so relative to the
// vehicle the contact runs along straight pieces; the closest point of approach
// (CPA) of a piece p + v t is at t = -p.v / v.v, kept within it.
//
// The probability of passing within d is that of the error, N(0, S) with S the
// contact's covariance at the CPA plus the vehicle's own, bringing the piece
// within d: the integral of a bivariate normal over a stadium (two half discs
// and what is between). It holds the disc's probability as the special case of
// no motion. S is taken as constant along the piece; over the pieces of a path
// the greatest counts, which is no more than the whole. (Held to Monte Carlo
// with uncertain velocity in the test: within 0.02 for encounters of 10
// minutes.) Pure functions; thread-safe.

#ifndef FATHOM_MAP_QUERY_CLOSEST_APPROACH_H_
#define FATHOM_MAP_QUERY_CLOSEST_APPROACH_H_

#include <Eigen/Core>
#include <optional>
#include <span>

#include "base/time.h"
#include "map/contacts/contact.h"
#include "map/contacts/contact_class.h"
#include "map/geodesy/points.h"

namespace fathom::map {

// Relative motion in a plane: metres, m/s, seconds.
struct RelativeMotion {
  // Of the contact from the vehicle.
  Eigen::Vector2d offset_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity_m_s = Eigen::Vector2d::Zero();
};

struct PlaneApproach {
  // From now; negative: they have passed. 0 if nothing moves.
  double tcpa_s = 0;
  double distance_m = 0;
};

// The CPA of unending motion, or between low_s and high_s from now.
PlaneApproach FindApproach(const RelativeMotion& motion);
PlaneApproach FindApproach(const RelativeMotion& motion, double low_s,
                           double high_s);

// P(some point of the segment from `from_m` to `to_m`, moved by an error
// N(0, covariance), is within radius_m of the origin). covariance: 2x2,
// symmetric, positive definite. Relative error 1e-6. About 2 us.
double PassProbability(const Eigen::Vector2d& from_m,
                       const Eigen::Vector2d& to_m,
                       const Eigen::Matrix2d& covariance_m2, double radius_m);

// A vehicle at a time.
struct TimedPlace {
  GeodeticPoint position;
  Time time;
};

struct Approach {
  Time time;
  // Where both are then.
  GeodeticPoint vehicle;
  GeodeticPoint contact;
  double distance_m = 0;
  // Of passing within the distance asked about.
  double probability = 0;
};

struct ApproachQuestion {
  // d, metres, >= 0, between the vehicle's place and the contact's.
  double within_m = 0;
  // 1 sigma of the vehicle's place per axis, metres, >= 0.
  double own_std_m = 0;
};

// The CPA of a contact and a vehicle on straight legs at constant rate.
// nullopt: the contact is nowhere during the path, or beyond kFarthestM of it.
// REQUIRES: at least one place; times ascend. A leg of which the past is known
// is cut at the contact's estimates, and between such as are 5 s or more apart
// in four, and just before the later one, where a fix may make it leap.
std::optional<Approach> ClosestApproach(const Contact& contact,
                                        const ContactClassTable& classes,
                                        std::span<const TimedPlace> path,
                                        const ApproachQuestion& question);

// The same for a vehicle that keeps its velocity (true north and east, m/s)
// from `start` on for horizon_s.
struct SteadyVehicle {
  TimedPlace start;
  double north_m_s = 0;
  double east_m_s = 0;
  double horizon_s = 0;
};
std::optional<Approach> ClosestApproach(const Contact& contact,
                                        const ContactClassTable& classes,
                                        const SteadyVehicle& vehicle,
                                        const ApproachQuestion& question);

}  // namespace fathom::map

#endif  // FATHOM_MAP_QUERY_CLOSEST_APPROACH_H_
