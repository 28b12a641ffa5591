// The changes that a map accepts beside pings and contact reports: what the
// journal of a mission holds and a restart replays.
//
// Plain values, no invariants beyond those that each field states; ObstacleMap
// checks them when they are applied.
#ifndef FATHOM_MAP_OBSTACLE_MAP_EVENTS_H_
#define FATHOM_MAP_OBSTACLE_MAP_EVENTS_H_

#include <string>

#include "base/time.h"
#include "map/geodesy/ids.h"
#include "map/local/local_map.h"

namespace fathom::map {

// Opens an activity: a new local map over an observation area
// (Nervegna 2002, section 4.3.2).
struct StartActivity {
  // New in this mission.
  ActivityId id;
  // The vehicle that surveys; empty: any.
  std::string vehicle_id;
  // When it starts.
  Time start;
  // Where and how it is mapped.
  LocalMapOptions options;
};

// Closes a contact's track; its history stays.
struct DropContact {
  ContactKey key;
  // When it was gone.
  Time time;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_OBSTACLE_MAP_EVENTS_H_
