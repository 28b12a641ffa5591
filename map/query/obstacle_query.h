// "Is there an obstacle at this location, at this time, with this level of
// certainty?" (Nervegna 2002, section 1.2): the answer for one point.
//
// With D ~ N(mu, sigma^2) the depth of the seabed or obstacle top there,
// z the depth asked, h the vertical clearance, r the radius, c the confidence
// (domain.md section 1):
//
//   P_static  = P(D <= z + h) = Phi((z + h - mu) / sigma); land: 1
//   P_contact = P(|X - q| <= r_contact + r) where the contact's depths, from
//               top to keel, meet [z - h, z + h]; of a contact whose depth
//               has an uncertainty, times P(they meet)
//   P         = 1 - (1 - P_static) prod(1 - P_contact)
//
//   OCCUPIED if P >= c, else FREE if P <= 1 - c, else UNCERTAIN.
//   At and below a point hazard (DepthEstimate::hazard_m, z + h >= hazard_m)
//   something narrower than the cell was sounded: P_static is then at least
//   kHazardShare, the share of the cell that it is taken to fill, and the
//   state is never FREE.
//   Where neither a measurement nor a chart covers the point the seabed adds
//   nothing and the state is OCCUPIED if the contacts alone make P >= c, else
//   UNKNOWN: never FREE, never dressed up as 0.5.
//
// A map is asked, never changed: age widens sigma in the answer, not in the
// store. Pure functions; thread-safe.

#ifndef FATHOM_MAP_QUERY_OBSTACLE_QUERY_H_
#define FATHOM_MAP_QUERY_OBSTACLE_QUERY_H_

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "base/time.h"
#include "map/contacts/contacts_view.h"
#include "map/geodesy/depth_estimate.h"
#include "map/geodesy/ids.h"
#include "map/geodesy/points.h"

namespace fathom::map {

// One question.
struct ObstacleQuery {
  GeodeticPoint position;
  // z, metres below the mission's datum, in [-100, 12000].
  double depth_m = 0;
  // Past, present or future.
  Time time;
  // c, in (0.5, 1).
  double confidence = 0.95;
  // h, metres, >= 0.
  double vertical_clearance_m = 0;
  // r, metres, >= 0.
  double radius_m = 0;
};

// The least P_static at and below a point hazard: a little more than a reader
// of P alone at the usual confidence of 0.95 takes for free.
inline constexpr double kHazardShare = 0.06;

// The numbers are those of fathom.v1.ObstacleState.
enum class ObstacleState : std::uint8_t {
  kFree = 1,
  kOccupied = 2,
  kUncertain = 3,
  kUnknown = 4,
};

// What the map holds of the seabed under the point.
struct SeabedEstimate {
  DepthEstimate estimate;
  // From an activity's local map, else from the global one.
  bool local = false;
  // The activity, if local; owned by the map's view.
  const ActivityId* activity = nullptr;
};

// The seabed's part in an answer.
struct SeabedReason {
  // As stored: std_m does not hold the age.
  DepthEstimate estimate;
  bool local = false;
  const ActivityId* activity = nullptr;
  // P(D <= z + h), aged.
  double probability = 0;
  // Age of the evidence at the time asked, seconds, >= 0; 0 if it is newer;
  // absent: unknown.
  std::optional<double> age_s;
};

// One contact's part in an answer.
struct ContactReason {
  ContactKey key;
  double probability = 0;
  // From the predicted position to the point, horizontal, metres.
  double distance_m = 0;
  // Since its last report before the time asked, seconds, >= 0.
  double age_s = 0;
  // Its other names; nullptr: none.
  std::shared_ptr<const ContactLinks> links = nullptr;
};

// Contacts below this add to P but are not told.
inline constexpr double kLeastToldProbability = 1e-6;
// Contacts told in one answer; the largest are kept.
inline constexpr std::size_t kMostContactReasons = 16;

// One answer.
struct ObstacleAnswer {
  // Defined out of line: a constructor that the compiler sees to be constant
  // clears the whole object first (5 ns a query).
  ObstacleAnswer();

  ObstacleState state = ObstacleState::kUnknown;
  // P; where the seabed is unknown the contacts' part alone.
  double probability = 0;
  // Absent where unknown.
  std::optional<SeabedReason> seabed;
  // Largest first; equal ones by key.
  std::vector<ContactReason> contacts;
};

// How evidence is judged; one per mission.
struct QueryModel {
  // Variance added per second of age of static evidence, m^2/s, >= 0; 0: the
  // thesis's map, which never ages.
  double ageing_rate_m2_s = 0;
};

// Whether the question can be answered. Errors: INVALID_ARGUMENT naming the
// field, its value and range.
absl::Status ValidateQuery(const ObstacleQuery& query);

// P_static of one estimate at z + h = `solid_above_m`, `age_s` >= 0 seconds
// old. 1 on land; 0 if the kind is kNone. std 0: a step, 1 where the depth is
// <= solid_above_m.
double StaticProbability(const DepthEstimate& estimate, double solid_above_m,
                         double age_s, const QueryModel& model);

// Whether solid_above_m = z + h is at or below a point hazard of the estimate.
inline bool ReachesHazard(const DepthEstimate& estimate, double solid_above_m) {
  // False for a hazard that is NaN: none.
  return solid_above_m >= static_cast<double>(estimate.hazard_m);
}

// P_contact: that a contact, predicted to the query's time, is within its
// radius
// + query.radius_m of the place, from which its predicted position lies
// `offset_m` (north, east in the contact's plane), and their depths meet.
// `position_variance_m2` of the one who asks is added on each axis. About 1 us.
double ContactProbability(const ContactPoint& predicted,
                          const Eigen::Vector2d& offset_m,
                          const ObstacleQuery& query,
                          double position_variance_m2 = 0);

// Joins one contact to an answer: P and, if it is worth telling, its reason.
// Arguments as ContactProbability's. Conclude() must follow the last.
void AddContact(const ObstacleQuery& query, const Contact& contact,
                const ContactPoint& predicted, const Eigen::Vector2d& offset_m,
                double position_variance_m2, ObstacleAnswer& answer);

// The state of an answer whose P is complete, by the rule of the file comment.
void Conclude(const ObstacleQuery& query, ObstacleAnswer& answer);

// The state for P at confidence c, by the rule of the file comment.
ObstacleState ClassifyProbability(double probability, double confidence,
                                  bool seabed_known);

// The answer. `seabed`: what the map holds under the point; nullopt (or kind
// kNone, or not finite) is unknown. REQUIRES: ValidateQuery. About 0.1 us
// without contacts near, 1 us more for each that is.
ObstacleAnswer Answer(const ObstacleQuery& query,
                      const std::optional<SeabedEstimate>& seabed,
                      const ContactsView& contacts,
                      const QueryModel& model = {});

}  // namespace fathom::map

#endif  // FATHOM_MAP_QUERY_OBSTACLE_QUERY_H_
