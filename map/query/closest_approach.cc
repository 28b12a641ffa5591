#include "map/query/closest_approach.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <numbers>
#include <vector>

#include "map/contacts/contacts_view.h"
#include "map/geodesy/ned_frame.h"
#include "map/query/disc_probability.h"

namespace fathom::map {
namespace {

// Nodes and weights of Gauss and Legendre on [-1, 1], 10 points (Abramowitz and
// Stegun 1964, table 25.4); half of them, the others mirror.
constexpr std::array<double, 5> kNodes = {0.148874338981631, 0.433395394129247,
                                          0.679409568299024, 0.865063366688985,
                                          0.973906528517172};
constexpr std::array<double, 5> kWeights = {
    0.295524224714753, 0.269266719309996, 0.219086362515982, 0.149451349150581,
    0.066671344308688};

// The integral over y is cut into so many pieces.
constexpr int kPieces = 8;
// Beyond so many standard deviations nothing is left that counts.
constexpr double kTail = 8;

// Between estimates further apart than this a smoothed track may bend: it is
// cut in so many pieces there.
constexpr std::chrono::seconds kLongestStraight{5};
constexpr int kCuts = 4;

// Both at the ends of a piece of time, in the contact's plane.
struct Ends {
  ContactPoint contact;
  Eigen::Vector2d vehicle;
  Time time;
};

Ends Look(const Contact& contact, const ContactClassTable& classes,
          const GeodeticPoint& origin, const GeodeticPoint& vehicle, Time time,
          bool& there) {
  Ends ends;
  ends.time = time;
  const std::optional<ContactPoint> point = contact.At(time, classes);
  there = point.has_value() &&
          DistanceM(point->frame_origin, vehicle) < kFarthestM &&
          std::hypot(point->x(0), point->x(1)) < kFarthestM;
  if (!there) return ends;
  ends.contact = InPlaneAt(*point, origin);
  const NedPoint place = NedFrame(origin).ToNed(vehicle);
  ends.vehicle = {place.north_m, place.east_m};
  return ends;
}

GeodeticPoint Between(const TimedPlace& a, const TimedPlace& b, Time time) {
  const double span_s = ToSeconds(b.time - a.time);
  if (span_s <= 0.0) return a.position;
  const RangeAzimuth way = Inverse(a.position, b.position);
  return Direct(a.position, way.azimuth_deg,
                way.distance_m * ToSeconds(time - a.time) / span_s);
}

// The times between which the contact's known past is taken as straight, in
// order: its estimates, and where these are far apart times between them.
std::vector<Time> Turns(const Contact& contact) {
  std::vector<Time> turns;
  const auto turn_at = [&turns](Time time) {
    if (!turns.empty() && time - turns.back() >= kLongestStraight) {
      const Time before = turns.back();
      for (int i = 1; i < kCuts; ++i) {
        turns.push_back(before + i * (time - before) / kCuts);
      }
      // A fix overwrites: the track may leap there.
      turns.push_back(time - Duration(1));
    }
    turns.push_back(time);
  };
  for (std::size_t i = 0; i < contact.older().size(); ++i) {
    turn_at(contact.older()[i].time);
  }
  for (std::size_t i = 0; i < contact.history().size(); ++i) {
    turn_at(contact.history()[i].time);
  }
  return turns;
}

}  // namespace

PlaneApproach FindApproach(const RelativeMotion& motion) {
  const double speed2 = motion.velocity_m_s.squaredNorm();
  PlaneApproach approach;
  if (speed2 > 0.0) {
    approach.tcpa_s = -motion.offset_m.dot(motion.velocity_m_s) / speed2;
  }
  approach.distance_m =
      (motion.offset_m + approach.tcpa_s * motion.velocity_m_s).norm();
  return approach;
}

PlaneApproach FindApproach(const RelativeMotion& motion, double low_s,
                           double high_s) {
  PlaneApproach approach = FindApproach(motion);
  approach.tcpa_s = std::clamp(approach.tcpa_s, low_s, high_s);
  approach.distance_m =
      (motion.offset_m + approach.tcpa_s * motion.velocity_m_s).norm();
  return approach;
}

double PassProbability(const Eigen::Vector2d& from_m,
                       const Eigen::Vector2d& to_m,
                       const Eigen::Matrix2d& covariance_m2, double radius_m) {
  const double length_m = (to_m - from_m).norm();
  if (length_m < 1e-6 * (radius_m + std::sqrt(covariance_m2.trace()))) {
    return DiscProbability(from_m, covariance_m2, radius_m);
  }
  // The origin, seen from the piece: x along it, y across, is normal about
  // (mx, my); it must be within the radius of [0, length] on the x axis.
  const Eigen::Vector2d u = (to_m - from_m) / length_m;
  const Eigen::Vector2d n(-u.y(), u.x());
  const double mx = -u.dot(from_m);
  const double my = -n.dot(from_m);
  const double yy = n.dot(covariance_m2 * n);
  const double xy = u.dot(covariance_m2 * n);
  const double xx = u.dot(covariance_m2 * u);
  const double sy = std::sqrt(yy);
  const double sx = std::sqrt(std::max(xx - xy * xy / yy, 1e-12 * xx));
  const double low = std::max(-radius_m, my - kTail * sy);
  const double high = std::min(radius_m, my + kTail * sy);
  if (low >= high) return 0.0;
  // y = r sin t where the ends of the disc are in reach: the half discs' edge
  // is smooth in t.
  const double t_low = std::asin(std::clamp(low / radius_m, -1.0, 1.0));
  const double t_high = std::asin(std::clamp(high / radius_m, -1.0, 1.0));
  const double half = 0.5 * (t_high - t_low) / kPieces;
  double sum = 0;
  for (int piece = 0; piece < kPieces; ++piece) {
    const double middle = t_low + (2 * piece + 1) * half;
    for (std::size_t k = 0; k < 2 * kNodes.size(); ++k) {
      const std::size_t i = k / 2;
      const double t = middle + (k % 2 == 0 ? half : -half) * kNodes[i];
      const double y = radius_m * std::sin(t);
      const double edge = radius_m * std::cos(t);
      const double z = (y - my) / sy;
      const double mean = mx + xy / yy * (y - my);
      sum += kWeights[i] * std::exp(-0.5 * z * z) * edge *
             NormalInterval((-edge - mean) / sx, (length_m + edge - mean) / sx);
    }
  }
  return std::clamp(sum * half / (sy * std::sqrt(2 * std::numbers::pi)), 0.0,
                    1.0);
}

std::optional<Approach> ClosestApproach(const Contact& contact,
                                        const ContactClassTable& classes,
                                        std::span<const TimedPlace> path,
                                        const ApproachQuestion& question) {
  const std::vector<Time> turns = Turns(contact);
  // The times at which one of the two may turn.
  std::vector<TimedPlace> places;
  for (std::size_t leg = 0; leg + 1 < path.size(); ++leg) {
    places.push_back(path[leg]);
    for (auto time =
             std::upper_bound(turns.begin(), turns.end(), path[leg].time);
         time != turns.end() && *time < path[leg + 1].time; ++time) {
      if (*time == places.back().time) continue;
      places.push_back({Between(path[leg], path[leg + 1], *time), *time});
    }
  }
  places.push_back(path.back());

  std::optional<Approach> nearest;
  const GeodeticPoint& origin = contact.newest().frame_origin;
  bool before_there = false;
  Ends before;
  for (std::size_t i = 0; i < places.size(); ++i) {
    bool there = false;
    const Ends now = Look(contact, classes, origin, places[i].position,
                          places[i].time, there);
    if (there) {
      // A piece of its own, without length, where the contact begins.
      const Ends& from = before_there ? before : now;
      const double span_s = ToSeconds(now.time - from.time);
      const Eigen::Vector2d a = from.contact.x.head<2>() - from.vehicle;
      const Eigen::Vector2d b = now.contact.x.head<2>() - now.vehicle;
      RelativeMotion motion{.offset_m = a,
                            .velocity_m_s = Eigen::Vector2d::Zero()};
      if (span_s > 0.0) motion.velocity_m_s = (b - a) / span_s;
      const PlaneApproach approach = FindApproach(motion, 0.0, span_s);
      const Time time =
          from.time + std::chrono::round<Duration>(
                          std::chrono::duration<double>(approach.tcpa_s));
      const ContactPoint at =
          InPlaneAt(contact.At(time, classes).value_or(now.contact), origin);
      Eigen::Matrix2d S = at.P.topLeftCorner<2, 2>();
      S.diagonal().array() += question.own_std_m * question.own_std_m;
      const double probability = PassProbability(a, b, S, question.within_m);
      if (!nearest.has_value() || approach.distance_m < nearest->distance_m) {
        const double most = nearest.has_value() ? nearest->probability : 0.0;
        const std::size_t leg = before_there ? i - 1 : i;
        nearest = Approach{.time = time,
                           .vehicle = Between(places[leg], places[i], time),
                           .contact = at.Position(),
                           .distance_m = approach.distance_m,
                           .probability = most};
      }
      nearest->probability = std::max(nearest->probability, probability);
    }
    before = now;
    before_there = there;
  }
  return nearest;
}

std::optional<Approach> ClosestApproach(const Contact& contact,
                                        const ContactClassTable& classes,
                                        const SteadyVehicle& vehicle,
                                        const ApproachQuestion& question) {
  const double azimuth_deg = std::atan2(vehicle.east_m_s, vehicle.north_m_s) *
                             180.0 / std::numbers::pi;
  const double way_m =
      std::hypot(vehicle.north_m_s, vehicle.east_m_s) * vehicle.horizon_s;
  const TimedPlace path[] = {
      vehicle.start,
      {Direct(vehicle.start.position, azimuth_deg, way_m),
       vehicle.start.time +
           std::chrono::round<Duration>(
               std::chrono::duration<double>(vehicle.horizon_s))}};
  return ClosestApproach(contact, classes, path, question);
}

}  // namespace fathom::map
