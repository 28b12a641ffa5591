#include "map/contacts/contact_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <variant>

#include "absl/strings/str_format.h"
#include "map/contacts/contact_set.h"
#include "map/geodesy/ned_frame.h"

namespace fathom::map {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;

// A fix is never taken as sharper than this, per axis: a covariance of zero
// has no inverse, and no fix is that good.
constexpr double kLeastFixStdM = 0.01;
constexpr double kLeastFixVelocityStdMPerS = 0.001;

// Turns a vector by `angle_rad` clockwise: from north towards east.
Eigen::Matrix2d Turn(double angle_rad) {
  const double c = std::cos(angle_rad);
  const double s = std::sin(angle_rad);
  Eigen::Matrix2d turn;
  turn << c, -s, s, c;
  return turn;
}

// Where a sensor heard something, on the plane at the sensor.
struct HeardPlace {
  NedFrame sensor;
  PositionMeasurement measured;
  GeodeticPoint place;
};

HeardPlace Hear(const RangeBearing& heard, FilterKind filter) {
  // Thesis fig. 5-4 lines 2 and 3.
  const PolarMeasurement polar{
      .range_m = heard.range_m,
      .azimuth_rad = (std::remainder(heard.pose.heading_deg, 360.0) +
                      std::remainder(heard.bearing_deg, 360.0)) *
                     kRadPerDeg,
      .range_std_m = heard.range_std_m,
      .azimuth_std_rad = heard.bearing_std_deg * kRadPerDeg};
  HeardPlace result{.sensor = NedFrame(heard.pose.position),
                    .measured = filter == FilterKind::kPerAxis
                                    ? ConvertPlain(polar)
                                    : ConvertUnbiased(polar),
                    .place = {}};
  // The sensor's own place is uncertain too (section 7.2 leaves it open).
  const double own_m2 = heard.pose.position_std_m * heard.pose.position_std_m;
  result.measured.R(0, 0) += own_m2;
  result.measured.R(1, 1) += own_m2;
  result.place =
      result.sensor.ToGeodetic(result.measured.z(0), result.measured.z(1));
  return result;
}

// The measurement in the plane of `frame`. Meridians converge: the sensor's
// north and the frame's differ by 0.2 degree 20 km apart, 70 m at that range.
PositionMeasurement InFrame(const HeardPlace& heard, const NedFrame& frame) {
  const NedPoint place = frame.ToNed(heard.place);
  const Eigen::Matrix2d turn = Turn(frame.NorthAzimuthRad(heard.place) -
                                    heard.sensor.NorthAzimuthRad(heard.place));
  PositionMeasurement measured{.z = {place.north_m, place.east_m},
                               .R = turn * heard.measured.R * turn.transpose()};
  measured.R(1, 0) = measured.R(0, 1);
  return measured;
}

// Lays the plane of `point` anew, at its position.
void Reanchor(ContactPoint& point) {
  const NedFrame old_frame(point.frame_origin);
  GeodeticPoint origin = point.Position();
  origin.latitude_deg = std::clamp(origin.latitude_deg, -kMaxContactLatitudeDeg,
                                   kMaxContactLatitudeDeg);
  // A direction at `origin` is turned by what north is turned by there.
  const Eigen::Matrix2d turn = Turn(-old_frame.NorthAzimuthRad(origin));
  Eigen::Matrix4d both = Eigen::Matrix4d::Zero();
  both.topLeftCorner<2, 2>() = turn;
  both.bottomRightCorner<2, 2>() = turn;
  point.frame_origin = origin;
  point.x.head<2>().setZero();
  point.x.tail<2>() = turn * Eigen::Vector2d(point.x.tail<2>());
  const Eigen::Matrix4d turned = both * point.P * both.transpose();
  point.P = 0.5 * (turned + turned.transpose());
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

bool IsFinite(const ContactPoint& point) {
  return point.x.allFinite() && point.P.allFinite() &&
         std::isfinite(point.frame_origin.latitude_deg) &&
         std::isfinite(point.frame_origin.longitude_deg) &&
         std::isfinite(point.top_depth_m + point.keel_depth_m +
                       point.depth_std_m + point.radius_m);
}

}  // namespace

ContactMap::ContactMap(ContactMapOptions options)
    : options_(std::make_shared<const ContactMapOptions>(options)),
      set_(std::make_shared<ContactSet>()) {
  set_->epoch = epoch_;
  set_->max_contacts = options_->max_contacts;
  set_->classes =
      std::shared_ptr<const ContactClassTable>(options_, &options_->classes);
}

ContactMap::ContactMap(ContactMap&&) noexcept = default;
ContactMap& ContactMap::operator=(ContactMap&&) noexcept = default;
ContactMap::~ContactMap() = default;

std::size_t ContactMap::live_count() const { return set_->live_count; }

ContactPoint ContactMap::Fuse(const ContactReport& report,
                              const ContactPoint* held) const {
  const ContactClassParameters& parameters =
      options_->classes[static_cast<std::size_t>(report.contact_class)];
  // Inactive by flag or by silence: the track starts anew (section 5.5).
  const bool fresh =
      held == nullptr || held->status == ContactStatus::kDropped ||
      ToSeconds(report.time - held->report_time) >
          options_->classes[static_cast<std::size_t>(held->contact_class)]
              .stale_after_s;
  ContactPoint point;
  point.contact_class = report.contact_class;
  point.time = report.time;
  point.report_time = report.time;
  point.track_start = fresh ? report.time : held->track_start;
  point.report_count = fresh ? 1 : held->report_count + 1;
  point.status = fresh ? ContactStatus::kNew : ContactStatus::kActive;
  point.radius_m = parameters.radius_m;
  SetDepths(report, parameters, fresh ? nullptr : held, point);

  if (const auto* fix = std::get_if<ContactFix>(&report.observation)) {
    point.status = ContactStatus::kActive;  // Its velocity is known.
    point.frame_origin = fix->position;
    point.x << 0.0, 0.0, fix->velocity_north_m_s, fix->velocity_east_m_s;
    const double std_m = std::max(fix->position_std_m, kLeastFixStdM);
    const double std_m_s =
        std::max(fix->velocity_std_m_s, kLeastFixVelocityStdMPerS);
    point.P(0, 0) = point.P(1, 1) = std_m * std_m;
    point.P(2, 2) = point.P(3, 3) = std_m_s * std_m_s;
    return point;
  }

  const HeardPlace heard =
      Hear(std::get<RangeBearing>(report.observation), options_->filter);
  TrackState state;
  if (fresh) {
    point.frame_origin = heard.place;
    state = FirstState(InFrame(heard, NedFrame(heard.place)),
                       parameters.first_velocity_std_m_s);
  } else {
    ContactPoint prior = PredictPoint(*held, report.time, options_->classes);
    if (std::hypot(prior.x(0), prior.x(1)) > kReanchorM) Reanchor(prior);
    point.frame_origin = prior.frame_origin;
    state = Update(options_->filter, {.x = prior.x, .P = prior.P},
                   InFrame(heard, NedFrame(prior.frame_origin)))
                .state;
  }
  point.x = state.x;
  point.P = state.P;
  return point;
}

ContactOutcome ContactMap::Append(const ContactKey& key,
                                  const ContactPoint& point) {
  if (set_->epoch != epoch_) {
    set_ = std::make_shared<ContactSet>(*set_);
    set_->epoch = epoch_;
  }
  if (const Contact* held = set_->Get(key);
      held != nullptr && held->dropped()) {
    gone_.erase({held->newest().time, key});
  }
  set_->Append(key, point);
  if (point.status == ContactStatus::kDropped) {
    gone_.insert({point.time, key});
    ForgetLongestGone();
  }
  ContactOutcome outcome{.applied = true, .reason = {}, .estimate = {}};
  if (const Contact* held = set_->Get(key)) {
    outcome.estimate = held->NewestEstimate();
  }
  return outcome;
}

void ContactMap::ForgetLongestGone() {
  while (gone_.size() > options_->max_contacts) {
    set_->Erase(gone_.begin()->second);
    gone_.erase(gone_.begin());
  }
}

ContactOutcome ContactMap::Apply(const ContactReport& report) {
  const Contact* held = set_->Get(report.key);
  ContactOutcome refused;
  if (held != nullptr) refused.estimate = held->NewestEstimate();
  refused.reason = CheckContactReport(report);
  if (refused.reason.has_value()) return refused;
  if (held != nullptr && report.time < held->newest().time) {
    refused.reason = RejectReason::kTooLate;
    return refused;
  }
  if (report.inactive) {
    if (held != nullptr && !held->dropped()) {
      return Drop(report.key, report.time);
    }
    refused.applied = true;
    return refused;
  }
  if ((held == nullptr || held->dropped()) &&
      set_->live_count >= options_->max_contacts) {
    refused.reason = RejectReason::kContactsFull;
    return refused;
  }
  const ContactPoint point =
      Fuse(report, held == nullptr ? nullptr : &held->newest());
  if (!IsFinite(point)) {
    refused.reason = RejectReason::kNotFinite;
    return refused;
  }
  if (std::fabs(point.frame_origin.latitude_deg) > kMaxContactLatitudeDeg) {
    refused.reason = RejectReason::kOutsideArea;
    return refused;
  }
  return Append(report.key, point);
}

ContactOutcome ContactMap::Drop(const ContactKey& key, Time time) {
  const Contact* held = set_->Get(key);
  if (held == nullptr) return {};
  if (held->dropped()) {
    return {.applied = false, .reason = {}, .estimate = held->NewestEstimate()};
  }
  ContactPoint point = PredictPoint(
      held->newest(), std::max(time, held->newest().time), options_->classes);
  point.status = ContactStatus::kDropped;
  return Append(key, point);
}

ContactsView ContactMap::View() {
  ++epoch_;
  return ContactsView(set_);
}

absl::Status ContactMap::Restore(StoredContact stored) {
  const auto invalid = [&stored](const char* what) {
    return absl::InvalidArgumentError(
        absl::StrFormat("stored contact %s/%s: %s", stored.key.source.value,
                        stored.key.contact.value, what));
  };
  if (stored.estimates.empty()) return invalid("has no estimates");
  auto contact = std::make_shared<Contact>(stored.key);
  for (std::size_t i = 0; i < stored.estimates.size(); ++i) {
    const ContactEstimate& estimate = stored.estimates[i];
    if (estimate.key != stored.key) return invalid("an estimate of another");
    if (!IsContactClass(estimate.contact_class) || !IsFinite(estimate)) {
      return invalid("an estimate is not finite or has no class");
    }
    if (i > 0 && estimate.time < stored.estimates[i - 1].time) {
      return invalid("estimates are not in order of time");
    }
    contact->Append(estimate);
  }
  if (set_->Get(stored.key) != nullptr) {
    return absl::AlreadyExistsError(absl::StrFormat("contact %s/%s is held",
                                                    stored.key.source.value,
                                                    stored.key.contact.value));
  }
  if (!contact->dropped() && set_->live_count >= options_->max_contacts) {
    return absl::ResourceExhaustedError(absl::StrFormat(
        "max_contacts=%u are held; raise it", options_->max_contacts));
  }
  if (set_->epoch != epoch_) {
    set_ = std::make_shared<ContactSet>(*set_);
    set_->epoch = epoch_;
  }
  if (contact->dropped()) gone_.insert({contact->newest().time, stored.key});
  set_->Add(std::move(contact));
  ForgetLongestGone();
  return absl::OkStatus();
}

}  // namespace fathom::map
