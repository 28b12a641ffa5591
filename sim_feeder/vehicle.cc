#include "sim_feeder/vehicle.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>

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
// Standard gravity (ISO 80000-3).
constexpr double kGravityM_s2 = 9.80665;

absl::Status ValidateVehicle(const VehicleOptions& options) {
  return CheckRanges({{"speed_m_s", options.speed_m_s, 1e-3, 60.0},
                      {"turn_rate_deg_s", options.turn_rate_deg_s, 1e-3, 360.0},
                      {"altitude_m", options.altitude_m, 0.1, 12'000.0},
                      {"depth_m", options.depth_m.value_or(0.0), 0.0, 12'000.0},
                      {"least_depth_m", options.least_depth_m, 0.0, 12'000.0},
                      {"max_pitch_deg", options.max_pitch_deg, 0.1, 89.0}});
}

absl::Status ValidateLoiter(const Waypoint& at, const VehicleOptions& options) {
  FATHOM_RETURN_IF_ERROR(
      CheckRanges({{"loiter_s", at.loiter_s, 0.0, 1e7},
                   {"loiter_radius_m", at.loiter_radius_m, 0.0, 1e5}}));
  const double least_m =
      options.speed_m_s / (options.turn_rate_deg_s * kRadiansPerDegree);
  if (at.loiter_s > 0.0 && at.loiter_radius_m < least_m) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "loiter_radius_m=%g is less than the %.2f m that speed_m_s=%g and "
        "turn_rate_deg_s=%g allow",
        at.loiter_radius_m, least_m, options.speed_m_s,
        options.turn_rate_deg_s));
  }
  return absl::OkStatus();
}

// Course from one place to another, radians; nullopt: they are one place.
std::optional<double> CourseOf(const PlanePoint& from, const PlanePoint& to) {
  const double north_m = to.north_m - from.north_m;
  const double east_m = to.east_m - from.east_m;
  if (north_m == 0.0 && east_m == 0.0) return std::nullopt;
  return std::atan2(east_m, north_m);
}

}  // namespace

absl::StatusOr<Vehicle> Vehicle::Create(const LocalTerrain& terrain,
                                        const std::vector<Waypoint>& track,
                                        const VehicleOptions& options) {
  FATHOM_RETURN_IF_ERROR(ValidateVehicle(options));
  if (track.empty()) return absl::InvalidArgumentError("the track is empty");
  Vehicle vehicle;
  const PlanePoint& first = track.front().place;
  for (std::size_t i = 0; i < track.size(); ++i) {
    FATHOM_RETURN_IF_ERROR(ValidateLoiter(track[i], options));
    const PlanePoint& from = i == 0 ? first : track[i - 1].place;
    // A loiter at the start is entered on the course of the first leg.
    if (i == 0 && track.size() > 1) {
      vehicle.course_rad_ = CourseOf(from, track[1].place).value_or(0.0);
    } else if (const std::optional<double> course_rad =
                   CourseOf(from, track[i].place)) {
      vehicle.AddTurn(from, *course_rad, options);
      vehicle.AddLeg(from, track[i].place, options);
    }
    vehicle.AddLoiter(track[i], options);
  }
  if (vehicle.pieces_.empty()) {
    return absl::InvalidArgumentError(
        "a track needs two places, or one to loiter at");
  }
  if (vehicle.length_m_ > kMaxTrackM) {
    return absl::ResourceExhaustedError(
        absl::StrFormat("the track is %g m long, more than %g m",
                        vehicle.length_m_, kMaxTrackM));
  }
  FATHOM_RETURN_IF_ERROR(vehicle.PlanDepth(terrain, options));
  return vehicle;
}

void Vehicle::AddTurn(const PlanePoint& at, double to_course_rad,
                      const VehicleOptions& options) {
  const double turn_rad = WrapToPi(to_course_rad - course_rad_);
  const double begin_rad = course_rad_;
  course_rad_ = to_course_rad;
  if (turn_rad == 0.0) return;
  const double turn_s =
      std::abs(turn_rad) * kDegreesPerRadian / options.turn_rate_deg_s;
  pieces_.push_back({.begin_s = EndS(),
                     .end_s = EndS() + turn_s,
                     .from = at,
                     .to = at,
                     .begin_course_rad = begin_rad,
                     .turn_rad = turn_rad,
                     .along_m = length_m_,
                     .length_m = 0.0});
}

void Vehicle::AddLeg(const PlanePoint& from, const PlanePoint& to,
                     const VehicleOptions& options) {
  const double length_m =
      std::hypot(to.north_m - from.north_m, to.east_m - from.east_m);
  pieces_.push_back({.begin_s = EndS(),
                     .end_s = EndS() + length_m / options.speed_m_s,
                     .from = from,
                     .to = to,
                     .begin_course_rad = course_rad_,
                     .turn_rad = 0.0,
                     .along_m = length_m_,
                     .length_m = length_m});
  length_m_ += length_m;
}

void Vehicle::AddLoiter(const Waypoint& at, const VehicleOptions& options) {
  if (at.loiter_s <= 0.0) return;
  const double around_m = 2.0 * std::numbers::pi * at.loiter_radius_m;
  const double circles = std::ceil(at.loiter_s * options.speed_m_s / around_m);
  const double length_m = circles * around_m;
  pieces_.push_back({.begin_s = EndS(),
                     .end_s = EndS() + length_m / options.speed_m_s,
                     .from = at.place,
                     .to = at.place,
                     .begin_course_rad = course_rad_,
                     .turn_rad = circles * 2.0 * std::numbers::pi,
                     .along_m = length_m_,
                     .length_m = length_m,
                     .radius_m = at.loiter_radius_m});
  length_m_ += length_m;
}

PlanePoint Vehicle::Piece::PlaceAt(double part) const {
  if (radius_m <= 0.0) {
    return {.north_m = std::lerp(from.north_m, to.north_m, part),
            .east_m = std::lerp(from.east_m, to.east_m, part)};
  }
  // The centre lies to starboard of the course c, along (-sin c, cos c); on
  // course d the vehicle is to port of the centre.
  const double course_rad = begin_course_rad + part * turn_rad;
  return {.north_m = from.north_m + radius_m * (std::sin(course_rad) -
                                                std::sin(begin_course_rad)),
          .east_m = from.east_m - radius_m * (std::cos(course_rad) -
                                              std::cos(begin_course_rad))};
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
  return piece.PlaceAt(
      std::clamp((along_m - piece.along_m) / piece.length_m, 0.0, 1.0));
}

double Vehicle::DepthAlong(double along_m) const {
  const double place = along_m / depth_step_m_;
  const std::size_t i =
      std::min(static_cast<std::size_t>(place), depth_m_.size() - 1);
  const std::size_t next = std::min(i + 1, depth_m_.size() - 1);
  return std::lerp(depth_m_[i], depth_m_[next],
                   std::min(1.0, place - static_cast<double>(i)));
}

double Vehicle::SlopeAlong(double along_m) const {
  const std::size_t i = std::min(
      static_cast<std::size_t>(along_m / depth_step_m_), depth_m_.size() - 1);
  const std::size_t next = std::min(i + 1, depth_m_.size() - 1);
  return (depth_m_[next] - depth_m_[i]) / depth_step_m_;
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
  const PlanePoint place = piece.PlaceAt(part);
  const double along_m = piece.along_m + part * piece.length_m;
  const double speed_m_s = span_s > 0.0 ? piece.length_m / span_s : 0.0;
  return {
      .north_m = place.north_m,
      .east_m = place.east_m,
      .depth_m = DepthAlong(along_m),
      .course_rad = WrapToPi(piece.begin_course_rad + part * piece.turn_rad),
      .roll_rad = piece.radius_m > 0.0
                      ? std::atan(speed_m_s * speed_m_s /
                                  (kGravityM_s2 * piece.radius_m))
                      : 0.0,
      .pitch_rad = speed_m_s > 0.0 ? -std::atan(SlopeAlong(along_m)) : 0.0};
}

}  // namespace fathom::feeder
