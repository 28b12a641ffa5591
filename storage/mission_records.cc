#include "storage/mission_records.h"

namespace fathom::storage {

bool HistoryArea::Holds(const map::GeodeticPoint& point) const {
  if (point.latitude_deg < south_deg || point.latitude_deg > north_deg) {
    return false;
  }
  const bool from_west = point.longitude_deg >= west_deg;
  const bool to_east = point.longitude_deg <= east_deg;
  return west_deg <= east_deg ? from_west && to_east : from_west || to_east;
}

}  // namespace fathom::storage
