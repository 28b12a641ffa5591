#include "map/obstacle_map/timed_leg.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace fathom::map {

TimedLeg::TimedLeg(const Waypoint& from, const Waypoint& to)
    : from_(from), to_(to) {
  const NedFrame start(from.position);
  // ToNed means nothing on the other side of the Earth; a leg is 100 km at
  // most, so only its length has to be trusted, and only where it is short.
  const NedPoint end = start.ToNed(to.position);
  length_m_ = std::hypot(end.north_m, end.east_m);
  const bool flat = length_m_ <= kFlatM;
  RangeAzimuth course;
  if (!flat) {
    course = Inverse(from.position, to.position);
    length_m_ = course.distance_m;
  }
  const auto count = static_cast<std::size_t>(
      std::max(1.0, std::ceil(length_m_ / kPieceM - 1e-6)));
  const auto node = [&](std::size_t k) {
    if (k == 0) return from.position;
    if (k == count) return to.position;
    const double share = static_cast<double>(k) / static_cast<double>(count);
    return flat ? start.ToGeodetic(share * end.north_m, share * end.east_m)
                : Direct(from.position, course.azimuth_deg,
                         share * course.distance_m);
  };
  pieces_.reserve(count);
  frames_.reserve(flat ? 1 : count);
  GeodeticPoint here = from.position;
  for (std::size_t k = 0; k < count; ++k) {
    if (k == 0) {
      frames_.push_back(start);
    } else if (!flat) {
      frames_.emplace_back(here);
    }
    const GeodeticPoint next = node(k + 1);
    const auto share = [count](std::size_t n) {
      return static_cast<double>(n) / static_cast<double>(count);
    };
    pieces_.push_back({.from = here,
                       .to = next,
                       .begin_share = share(k),
                       .end_share = share(k + 1),
                       .length_m = length_m_ / static_cast<double>(count),
                       .frame = &frames_.back()});
    here = next;
  }
}

Time TimedLeg::TimeAt(double share) const {
  const auto span = static_cast<double>((to_.time - from_.time).count());
  return from_.time + Duration(static_cast<std::int64_t>(share * span));
}

double TimedLeg::ShareAt(Time time) const {
  const auto span = static_cast<double>((to_.time - from_.time).count());
  const auto gone = static_cast<double>((time - from_.time).count());
  return std::clamp(gone / span, 0.0, 1.0);
}

GeodeticPoint TimedLeg::PlaceAt(double share) const {
  const double at = share * static_cast<double>(pieces_.size());
  const std::size_t k =
      std::min(static_cast<std::size_t>(at), pieces_.size() - 1);
  const LegPiece& piece = pieces_[k];
  const double inside = at - static_cast<double>(k);
  const NedPoint from = piece.frame->ToNed(piece.from);
  const NedPoint to = piece.frame->ToNed(piece.to);
  return piece.frame->ToGeodetic(
      from.north_m + inside * (to.north_m - from.north_m),
      from.east_m + inside * (to.east_m - from.east_m));
}

}  // namespace fathom::map
