#include "sim_feeder/vehicle.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "sim_feeder/angles.h"
#include "sim_feeder/named_range.h"

namespace fathom::feeder {
namespace {

// 20 000 km at 2 m: 10 M depths, 80 MB.
constexpr double kMaxTrackM = 2.0e7;
constexpr double kDepthStepM = 2.0;

absl::Status ValidateVehicle(const VehicleOptions& options) {
  return CheckRanges({{"speed_m_s", options.speed_m_s, 1e-3, 60.0},
                      {"turn_rate_deg_s", options.turn_rate_deg_s, 1e-3, 360.0},
                      {"altitude_m", options.altitude_m, 0.1, 12'000.0},
                      {"depth_m", options.depth_m.value_or(0.0), 0.0, 12'000.0},
                      {"least_depth_m", options.least_depth_m, 0.0, 12'000.0},
                      {"max_pitch_deg", options.max_pitch_deg, 0.1, 89.0}});
}

}  // namespace

absl::StatusOr<Vehicle> Vehicle::Create(const LocalTerrain& terrain,
                                        const std::vector<PlanePoint>& track,
                                        const VehicleOptions& options) {
  FATHOM_RETURN_IF_ERROR(ValidateVehicle(options));
  if (track.size() < 2) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "a track needs two points, this one has %d", track.size()));
  }
  Vehicle vehicle;
  double now_s = 0.0;
  double course_rad = 0.0;
  for (std::size_t i = 0; i + 1 < track.size(); ++i) {
    const double north_m = track[i + 1].north_m - track[i].north_m;
    const double east_m = track[i + 1].east_m - track[i].east_m;
    const double length_m = std::hypot(north_m, east_m);
    const double leg_course_rad = std::atan2(east_m, north_m);
    const double turn_rad = WrapToPi(leg_course_rad - course_rad);
    if (i > 0 && turn_rad != 0.0) {
      const double turn_s =
          std::abs(turn_rad) * kDegreesPerRadian / options.turn_rate_deg_s;
      vehicle.pieces_.push_back({.begin_s = now_s,
                                 .end_s = now_s + turn_s,
                                 .from = track[i],
                                 .to = track[i],
                                 .begin_course_rad = course_rad,
                                 .turn_rad = turn_rad,
                                 .along_m = vehicle.length_m_,
                                 .length_m = 0.0});
      now_s += turn_s;
    }
    course_rad = leg_course_rad;
    const double leg_s = length_m / options.speed_m_s;
    vehicle.pieces_.push_back({.begin_s = now_s,
                               .end_s = now_s + leg_s,
                               .from = track[i],
                               .to = track[i + 1],
                               .begin_course_rad = course_rad,
                               .turn_rad = 0.0,
                               .along_m = vehicle.length_m_,
                               .length_m = length_m});
    now_s += leg_s;
    vehicle.length_m_ += length_m;
  }
  if (vehicle.length_m_ > kMaxTrackM) {
    return absl::ResourceExhaustedError(
        absl::StrFormat("the track is %g m long, more than %g m",
                        vehicle.length_m_, kMaxTrackM));
  }
  FATHOM_RETURN_IF_ERROR(vehicle.PlanDepth(terrain, options));
  return vehicle;
}

// The wished depth along the track, then lifted so that no climb is steeper
// than the pitch allows: p(s) = min over s' of wish(s') + |s - s'| slope.
absl::Status Vehicle::PlanDepth(const LocalTerrain& terrain,
                                const VehicleOptions& options) {
  depth_step_m_ = kDepthStepM;
  const std::size_t count =
      static_cast<std::size_t>(std::ceil(length_m_ / depth_step_m_)) + 1;
  depth_m_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const PlanePoint place =
        PlaceAt(std::min(length_m_, static_cast<double>(i) * depth_step_m_));
    const std::optional<double> water_m =
        terrain.DepthAt(place.north_m, place.east_m);
    if (!water_m.has_value() || *water_m <= 0.0) {
      return absl::OutOfRangeError(absl::StrFormat(
          "the track touches land or leaves the terrain at north_m=%.1f "
          "east_m=%.1f",
          place.north_m, place.east_m));
    }
    double wish_m = *water_m - options.altitude_m;
    if (options.depth_m.has_value()) {
      wish_m = std::min(wish_m, *options.depth_m);
    }
    depth_m_[i] =
        std::max(wish_m, std::min(options.least_depth_m, 0.5 * *water_m));
  }
  const double slope_m =
      depth_step_m_ * std::tan(options.max_pitch_deg * kRadiansPerDegree);
  for (std::size_t i = 1; i < count; ++i) {
    depth_m_[i] = std::min(depth_m_[i], depth_m_[i - 1] + slope_m);
  }
  for (std::size_t i = count - 1; i-- > 0;) {
    depth_m_[i] = std::min(depth_m_[i], depth_m_[i + 1] + slope_m);
  }
  return absl::OkStatus();
}

PlanePoint Vehicle::PlaceAt(double along_m) const {
  const auto after = std::upper_bound(
      pieces_.begin(), pieces_.end(), along_m,
      [](double value, const Piece& piece) { return value < piece.along_m; });
  const Piece& piece = after == pieces_.begin() ? *after : *std::prev(after);
  if (piece.length_m <= 0.0) return piece.from;
  const double part =
      std::clamp((along_m - piece.along_m) / piece.length_m, 0.0, 1.0);
  return {.north_m = std::lerp(piece.from.north_m, piece.to.north_m, part),
          .east_m = std::lerp(piece.from.east_m, piece.to.east_m, part)};
}

double Vehicle::DepthAlong(double along_m) const {
  const double place = along_m / depth_step_m_;
  const std::size_t i =
      std::min(static_cast<std::size_t>(place), depth_m_.size() - 1);
  const std::size_t next = std::min(i + 1, depth_m_.size() - 1);
  return std::lerp(depth_m_[i], depth_m_[next],
                   std::min(1.0, place - static_cast<double>(i)));
}

VehicleState Vehicle::StateAt(double seconds) const {
  const double now_s = std::clamp(seconds, 0.0, duration_s());
  const auto found = std::lower_bound(
      pieces_.begin(), pieces_.end(), now_s,
      [](const Piece& piece, double value) { return piece.end_s < value; });
  const Piece& piece = found == pieces_.end() ? pieces_.back() : *found;
  const double span_s = piece.end_s - piece.begin_s;
  const double part =
      span_s > 0.0 ? std::clamp((now_s - piece.begin_s) / span_s, 0.0, 1.0)
                   : 1.0;
  return {
      .north_m = std::lerp(piece.from.north_m, piece.to.north_m, part),
      .east_m = std::lerp(piece.from.east_m, piece.to.east_m, part),
      .depth_m = DepthAlong(piece.along_m + part * piece.length_m),
      .course_rad = WrapToPi(piece.begin_course_rad + part * piece.turn_rad)};
}

}  // namespace fathom::feeder
