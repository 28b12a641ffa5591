#include "map/contacts/tracker.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <variant>

#include "map/geodesy/ned_frame.h"

namespace fathom::map {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;

// A fix is never taken as sharper than this, per axis: a covariance of zero
// has no inverse, and no fix is that good.
constexpr double kLeastFixStdM = 0.01;
constexpr double kLeastFixVelocityStdMPerS = 0.001;

// Places further apart than this on either axis are not laid on one plane (it
// folds at a quarter of the Earth); no track leaps so far.
constexpr double kOnePlaneDeg = 10;

const ContactClassParameters& ParametersOf(ContactClass contact_class,
                                           const ContactClassTable& classes) {
  return classes[static_cast<std::size_t>(contact_class)];
}

// Turns a vector by `angle_rad` clockwise: from north towards east.
Eigen::Matrix2d Turn(double angle_rad) {
  const double c = std::cos(angle_rad);
  const double s = std::sin(angle_rad);
  Eigen::Matrix2d turn;
  turn << c, -s, s, c;
  return turn;
}

PolarMeasurement ToPolar(const RangeBearing& heard) {
  // Thesis fig. 5-4 lines 2 and 3.
  return {.range_m = heard.range_m,
          .azimuth_rad = (std::remainder(heard.pose.heading_deg, 360.0) +
                          std::remainder(heard.bearing_deg, 360.0)) *
                         kRadPerDeg,
          .range_std_m = heard.range_std_m,
          .azimuth_std_rad = heard.bearing_std_deg * kRadPerDeg};
}

PositionMeasurement Convert(const PolarMeasurement& polar, FilterKind filter) {
  return filter == FilterKind::kPerAxis ? ConvertPlain(polar)
                                        : ConvertUnbiased(polar);
}

// The sensor's own place is uncertain too (section 7.2 leaves it open). Each
// report's error of it is taken as its own.
void AddOwn(const RangeBearing& heard, PositionMeasurement& measured) {
  const double own_m2 = heard.pose.position_std_m * heard.pose.position_std_m;
  measured.R(0, 0) += own_m2;
  measured.R(1, 1) += own_m2;
}

bool FarApart(const GeodeticPoint& a, const GeodeticPoint& b) {
  return std::fabs(a.latitude_deg - b.latitude_deg) > kOnePlaneDeg ||
         std::fabs(std::remainder(a.longitude_deg - b.longitude_deg, 360.0)) *
                 std::cos(a.latitude_deg * kRadPerDeg) >
             kOnePlaneDeg;
}

// Lays the plane of `point` anew, at its position.
void Reanchor(ContactPoint& point) {
  GeodeticPoint origin = point.Position();
  origin.latitude_deg = std::clamp(origin.latitude_deg, -kMaxContactLatitudeDeg,
                                   kMaxContactLatitudeDeg);
  point = InPlaneAt(point, origin);
}

// The depths that a contact occupies, on top of what was known of it.
void SetDepths(const ContactReport& report,
               const ContactClassParameters& parameters,
               const ContactPoint* same_life, ContactPoint& point) {
  const bool known =
      same_life != nullptr && same_life->contact_class == report.contact_class;
  if (!report.depth_m.has_value() && known) {
    point.top_depth_m = same_life->top_depth_m;
    point.keel_depth_m = same_life->keel_depth_m;
    point.depth_std_m = same_life->depth_std_m;
    return;
  }
  point.top_depth_m = 0.0;
  point.keel_depth_m = parameters.keel_depth_m;
  point.depth_std_m = 0.0;
  if (!report.depth_m.has_value()) return;
  if (report.contact_class == ContactClass::kSubmerged) {
    point.top_depth_m = *report.depth_m - 0.5 * parameters.height_m;
    point.keel_depth_m = *report.depth_m + 0.5 * parameters.height_m;
    point.depth_std_m = report.depth_std_m.value_or(kDefaultDepthStdM);
  } else {
    point.keel_depth_m = std::max(point.keel_depth_m, *report.depth_m);
  }
}

// What the report says whatever the motion. `held`: the same life's newest
// estimate, or nullptr in a new life.
ContactPoint Outline(const ContactReport& report, const ContactPoint* held,
                     const ContactClassTable& classes) {
  const ContactClassParameters& parameters =
      ParametersOf(report.contact_class, classes);
  ContactPoint point;
  point.contact_class = report.contact_class;
  point.time = report.time;
  point.report_time = report.time;
  point.track_start = held == nullptr ? report.time : held->track_start;
  point.report_count = held == nullptr ? 1 : held->report_count + 1;
  point.status = held == nullptr ? ContactStatus::kNew : ContactStatus::kActive;
  point.radius_m = parameters.radius_m;
  SetDepths(report, parameters, held, point);
  return point;
}

void Overwrite(const ContactFix& fix, ContactPoint& point) {
  point.status = ContactStatus::kActive;  // Its velocity is known.
  point.frame_origin = fix.position;
  point.x << 0.0, 0.0, fix.velocity_north_m_s, fix.velocity_east_m_s;
  const double std_m = std::max(fix.position_std_m, kLeastFixStdM);
  const double std_m_s =
      std::max(fix.velocity_std_m_s, kLeastFixVelocityStdMPerS);
  point.P(0, 0) = point.P(1, 1) = std_m * std_m;
  point.P(2, 2) = point.P(3, 3) = std_m_s * std_m_s;
}

// The first estimate of a life.
ContactPoint Begin(const ContactReport& report, FilterKind filter,
                   const ContactClassTable& classes) {
  ContactPoint point = Outline(report, nullptr, classes);
  if (const auto* fix = std::get_if<ContactFix>(&report.observation)) {
    Overwrite(*fix, point);
    return point;
  }
  const auto& heard = std::get<RangeBearing>(report.observation);
  const NedFrame sensor(heard.pose.position);
  PositionMeasurement measured = Convert(ToPolar(heard), filter);
  AddOwn(heard, measured);
  point.frame_origin = sensor.ToGeodetic(measured.z(0), measured.z(1));
  // Meridians converge: the sensor's north and the plane's differ by 0.2
  // degree 20 km apart.
  const Eigen::Matrix2d turn =
      Turn(-sensor.NorthAzimuthRad(point.frame_origin));
  measured.z.setZero();
  measured.R = turn * measured.R * turn.transpose();
  measured.R(1, 0) = measured.R(0, 1);
  const TrackState state = FirstState(
      measured,
      ParametersOf(report.contact_class, classes).first_velocity_std_m_s);
  point.x = state.x;
  point.P = state.P;
  return point;
}

// A range and bearing against a prediction, in its plane.
struct Heard {
  PositionMeasurement measured;
  // North and east; and the least of the two kinds, see tracker.h.
  double nis = 0;
  double least_nis = 0;
};

Heard Hear(const RangeBearing& heard, const ContactPoint& prior,
           FilterKind filter) {
  PolarMeasurement polar = ToPolar(heard);
  const NedFrame sensor(heard.pose.position);
  const NedFrame plane(prior.frame_origin);
  // The ray in the plane, which turns and shortens it a little.
  const NedPoint from = plane.ToNed(heard.pose.position);
  const NedPoint to = plane.ToNed(
      sensor.ToGeodetic(polar.range_m * std::cos(polar.azimuth_rad),
                        polar.range_m * std::sin(polar.azimuth_rad)));
  polar.range_m =
      std::hypot(to.north_m - from.north_m, to.east_m - from.east_m);
  polar.azimuth_rad =
      std::atan2(to.east_m - from.east_m, to.north_m - from.north_m);
  const Eigen::Vector2d own(from.north_m, from.east_m);
  PositionMeasurement known{.z = prior.x.head<2>() - own,
                            .R = prior.P.topLeftCorner<2, 2>()};
  AddOwn(heard, known);
  const bool plain = filter == FilterKind::kPerAxis;
  const PositionMeasurement first =
      plain ? ConvertPlain(polar) : ConvertAbout(polar, known);
  Heard result{.measured = first, .nis = 0, .least_nis = 0};
  AddOwn(heard, result.measured);
  result.measured.z += own;
  result.nis =
      PositionNis(filter, {.x = prior.x, .P = prior.P}, result.measured);
  result.least_nis = result.nis > kGateNis
                         ? std::min(result.nis, PolarNis(polar, known))
                         : result.nis;
  if (!plain && IsDirectionKnown(known)) {
    result.measured = ConvertAgain(polar, known, first);
    AddOwn(heard, result.measured);
    result.measured.z += own;
  }
  return result;
}

// Whether a contact that was as `held` can have got to the fix.
bool MayBeAt(const ContactFix& fix, Time time, const ContactPoint& held,
             const ContactClassTable& classes) {
  const GeodeticPoint before = held.Position();
  if (FarApart(before, fix.position)) return false;
  const double place_std_m =
      std::sqrt(std::max(0.5 * (held.P(0, 0) + held.P(1, 1)), 0.0));
  const double speed_m_s =
      kGateSigmas *
      ParametersOf(held.contact_class, classes).first_velocity_std_m_s;
  const double reach_m = kGateSigmas * (place_std_m + fix.position_std_m) +
                         speed_m_s * ToSeconds(time - held.time);
  return DistanceM(before, fix.position) <= reach_m;
}

// The estimate that follows from `held`, of the same life; nullopt: gated.
// `nis`: see TrackStep.
std::optional<ContactPoint> Follow(const ContactPoint& held,
                                   const ContactReport& report,
                                   FilterKind filter,
                                   const ContactClassTable& classes,
                                   std::optional<double>& nis) {
  ContactPoint point = Outline(report, &held, classes);
  if (const auto* fix = std::get_if<ContactFix>(&report.observation)) {
    if (!MayBeAt(*fix, report.time, held, classes)) return std::nullopt;
    Overwrite(*fix, point);
    return point;
  }
  const auto& heard = std::get<RangeBearing>(report.observation);
  ContactPoint prior = PredictPoint(held, report.time, classes);
  if (std::hypot(prior.x(0), prior.x(1)) > kReanchorM) Reanchor(prior);
  if (FarApart(prior.frame_origin, heard.pose.position)) return std::nullopt;
  const Heard against = Hear(heard, prior, filter);
  nis = against.nis;
  if (!(against.least_nis <= kGateNis)) return std::nullopt;
  const TrackState state =
      Update(filter, {.x = prior.x, .P = prior.P}, against.measured).state;
  point.frame_origin = prior.frame_origin;
  point.x = state.x;
  point.P = state.P;
  return point;
}

// Inactive by flag or by silence: the track starts anew (section 5.5).
bool IsOver(const ContactPoint& held, Time time,
            const ContactClassTable& classes) {
  return held.status == ContactStatus::kDropped ||
         ToSeconds(time - held.report_time) >
             ParametersOf(held.contact_class, classes).stale_after_s;
}

}  // namespace

bool IsFinite(const ContactPoint& point) {
  return point.x.allFinite() && point.P.allFinite() &&
         std::isfinite(point.frame_origin.latitude_deg) &&
         std::isfinite(point.frame_origin.longitude_deg) &&
         std::isfinite(point.top_depth_m + point.keel_depth_m +
                       point.depth_std_m + point.radius_m);
}

ContactPoint DropPoint(const ContactPoint& newest, Time time,
                       const ContactClassTable& classes) {
  ContactPoint point =
      PredictPoint(newest, std::max(time, newest.time), classes);
  point.status = ContactStatus::kDropped;
  return point;
}

TrackStep Step(const TrackMemory& memory, const ContactReport& report,
               FilterKind filter, const ContactClassTable& classes) {
  TrackStep step;
  const auto add = [&step](const ContactPoint& point) {
    step.points[step.count++] = point;
  };
  const ContactPoint* const held = memory.newest;
  if (report.inactive) {
    if (held != nullptr && held->status != ContactStatus::kDropped) {
      add(DropPoint(*held, report.time, classes));
    }
    return step;
  }
  if (held == nullptr || IsOver(*held, report.time, classes)) {
    add(Begin(report, filter, classes));
  } else if (const auto next =
                 Follow(*held, report, filter, classes, step.nis)) {
    add(*next);
  } else if (memory.gated != nullptr) {
    const ContactPoint other = Begin(*memory.gated, filter, classes);
    if (!IsOver(other, report.time, classes)) {
      std::optional<double> unused;
      if (const auto anew = Follow(other, report, filter, classes, unused)) {
        add(other);
        add(*anew);
      }
    }
  }
  if (step.count == 0) {
    step.refused = RejectReason::kGated;
    return step;
  }
  for (std::size_t i = 0; i < step.count; ++i) {
    const ContactPoint& point = step.points[i];
    if (!IsFinite(point)) {
      step.refused = RejectReason::kNotFinite;
    } else if (std::fabs(point.frame_origin.latitude_deg) >
               kMaxContactLatitudeDeg) {
      step.refused = RejectReason::kOutsideArea;
    }
  }
  if (step.refused.has_value()) step.count = 0;
  return step;
}

}  // namespace fathom::map
