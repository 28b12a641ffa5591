// One leg of a trajectory: where the vehicle is when, and the pieces that it is
// judged by.

#ifndef FATHOM_MAP_OBSTACLE_MAP_TIMED_LEG_H_
#define FATHOM_MAP_OBSTACLE_MAP_TIMED_LEG_H_

#include <cstddef>
#include <vector>

#include "base/time.h"
#include "map/geodesy/ned_frame.h"
#include "map/geodesy/points.h"
#include "map/query/trajectory.h"

namespace fathom::map {

// Pieces are at most so long.
inline constexpr double kPieceM = 200;

// A part of a leg, straight in the plane of `frame`.
struct LegPiece {
  GeodeticPoint from;
  GeodeticPoint to;
  // Of the leg's time and length, 0 to 1.
  double begin_share = 0;
  double end_share = 1;
  double length_m = 0;
  // Lives with the leg; touches the Earth within 2 km.
  const NedFrame* frame = nullptr;

  // The share of the leg that is at `share` of the piece.
  double ShareOfLeg(double share) const {
    return begin_share + share * (end_share - begin_share);
  }
};

// Immutable; thread-safe. A leg up to kFlatM is straight in one plane (off the
// geodesic by less than a micrometre), a longer one is cut along its geodesic.
class TimedLeg {
 public:
  static constexpr double kFlatM = 2000;

  // REQUIRES: waypoints as ValidateTrajectory wants them. 0.2 us, or 1 us a
  // piece where the leg is long.
  TimedLeg(const Waypoint& from, const Waypoint& to);
  TimedLeg(const TimedLeg&) = delete;
  TimedLeg& operator=(const TimedLeg&) = delete;

  std::size_t piece_count() const { return pieces_.size(); }
  const LegPiece& piece(std::size_t i) const { return pieces_[i]; }
  double length_m() const { return length_m_; }

  // At a share of the leg in [0, 1].
  Time TimeAt(double share) const;
  double DepthAt(double share) const {
    return from_.depth_m + share * (to_.depth_m - from_.depth_m);
  }
  GeodeticPoint PlaceAt(double share) const;
  // The share at a time, clamped to [0, 1].
  double ShareAt(Time time) const;
  double duration_s() const { return ToSeconds(to_.time - from_.time); }

 private:
  Waypoint from_;
  Waypoint to_;
  double length_m_ = 0;
  std::vector<NedFrame> frames_;
  std::vector<LegPiece> pieces_;
};

}  // namespace fathom::map

#endif  // FATHOM_MAP_OBSTACLE_MAP_TIMED_LEG_H_
