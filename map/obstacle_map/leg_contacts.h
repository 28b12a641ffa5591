// The contacts that may meet a vehicle on one leg of its trajectory.

#ifndef FATHOM_MAP_OBSTACLE_MAP_LEG_CONTACTS_H_
#define FATHOM_MAP_OBSTACLE_MAP_LEG_CONTACTS_H_

#include <set>
#include <vector>

#include "absl/functional/function_ref.h"
#include "map/contacts/contacts_view.h"
#include "map/obstacle_map/timed_leg.h"
#include "map/query/obstacle_query.h"
#include "map/query/trajectory.h"

namespace fathom::map {

// A leg's contacts are those near it (ContactsView::ForEachNear) at its begin,
// middle or end, if none is quicker than kQuickestContactMS.
inline constexpr double kQuickestContactMS = 50;

// Not thread-safe. The view of the contacts and the leg must outlive it.
class LegContacts {
 public:
  // A time at which a contact has to be reckoned with.
  struct Meeting {
    Time time;
    GeodeticPoint vehicle;
    double depth_m = 0;
    GeodeticPoint contact_place;
  };

  // `query`: radius and clearance are used. `reach_m`: the swept half width.
  LegContacts(const ContactsView& contacts, const TimedLeg& leg,
              const ObstacleQuery& query, double position_std_m,
              double reach_m);

  bool empty() const { return near_.empty(); }

  // Joins the contacts at query.time, at the vehicle's place then, to an answer
  // of the seabed alone (obstacle_query.h: P and state; reasons).
  void AddTo(const ObstacleQuery& query, ObstacleAnswer& answer) const;

  // Calls `visit` for the times at which a contact matters: those at which its
  // probability was looked at and is at least kLeastToldProbability. Enters
  // into `near` the contacts that may come within kNearSigmas standard
  // deviations of the swept disc.
  //
  // A contact and the vehicle are taken to move straight between times no
  // further apart than it takes them to close by the sum of their radii and one
  // sigma; between two such times the closest place is looked at too, and about
  // the greatest probability found a golden section search refines it.
  void ForEachMeeting(std::set<const Contact*>& near,
                      absl::FunctionRef<void(const Meeting&)> visit) const;

 private:
  // A contact and the vehicle at one time.
  struct Look {
    double share = 0;
    double probability = 0;
    double distance_m = 0;
    // From the vehicle to the contact, in the contact's plane.
    Eigen::Vector2d offset_m = Eigen::Vector2d::Zero();
    double reach_m = 0;  // Radii and one sigma.
    double std_m = 0;
    GeodeticPoint contact_place;
    bool present = false;
  };
  Look LookAt(const Contact& contact, double share) const;
  std::vector<Look> LooksAt(const Contact& contact) const;

  const ContactsView& contacts_;
  const TimedLeg& leg_;
  ObstacleQuery query_;
  double position_variance_m2_;
  double reach_m_;
  std::vector<const Contact*> near_;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_OBSTACLE_MAP_LEG_CONTACTS_H_
