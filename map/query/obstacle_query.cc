#include "map/query/obstacle_query.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_format.h"
#include "map/query/disc_probability.h"
#include "map/query/tabulated_normal.h"

namespace fathom::map {
namespace {

absl::Status CheckRange(const char* field, double value, double low,
                        double high) {
  if (value >= low && value <= high) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrFormat("%s=%g must be in [%g, %g]", field, value, low, high));
}

// Whether there is something to reckon with.
bool IsKnown(const DepthEstimate& estimate) {
  if (estimate.kind == EvidenceKind::kNone) return false;
  if (estimate.kind == EvidenceKind::kLand) return true;
  return std::isfinite(estimate.depth_m) && std::isfinite(estimate.std_m);
}

std::optional<double> AgeS(const DepthEstimate& estimate, Time time) {
  if (estimate.time_s == 0) return std::nullopt;
  const Time newest(std::chrono::seconds(estimate.time_s));
  return std::max(0.0, ToSeconds(time - newest));
}

// P(the depths of the contact meet those asked about).
double DepthOverlap(const ContactPoint& contact, const ObstacleQuery& query) {
  const double shallow_m = query.depth_m - query.vertical_clearance_m;
  const double deep_m = query.depth_m + query.vertical_clearance_m;
  if (contact.depth_std_m > 0.0) {
    // Both ends shift together by N(0, depth_std^2).
    return NormalInterval(
        (shallow_m - contact.keel_depth_m) / contact.depth_std_m,
        (deep_m - contact.top_depth_m) / contact.depth_std_m);
  }
  // A surface contact is solid from the surface up as well: what is asked
  // about above its top is met too.
  if (shallow_m > contact.keel_depth_m) return 0.0;
  if (contact.top_depth_m > 0.0 && deep_m < contact.top_depth_m) return 0.0;
  return 1.0;
}

// Keeps the kMostContactReasons largest, in order.
void Tell(ContactReason reason, std::vector<ContactReason>& told) {
  const auto place =
      std::upper_bound(told.begin(), told.end(), reason,
                       [](const ContactReason& a, const ContactReason& b) {
                         if (a.probability != b.probability) {
                           return a.probability > b.probability;
                         }
                         return a.key < b.key;
                       });
  if (told.size() == kMostContactReasons && place == told.end()) return;
  told.insert(place, std::move(reason));
  if (told.size() > kMostContactReasons) told.pop_back();
}

}  // namespace

ObstacleAnswer::ObstacleAnswer() = default;

absl::Status ValidateQuery(const ObstacleQuery& query) {
  if (absl::Status status = ValidateGeodetic(query.position); !status.ok()) {
    return status;
  }
  if (absl::Status status = CheckRange("depth_m", query.depth_m, -100, 12'000);
      !status.ok()) {
    return status;
  }
  if (!(query.confidence > 0.5 && query.confidence < 1.0)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("confidence=%g must be in (0.5, 1)", query.confidence));
  }
  // 12 km of clearance and 1000 km of radius: beyond any vehicle, and finite.
  if (absl::Status status = CheckRange("vertical_clearance_m",
                                       query.vertical_clearance_m, 0, 12'000);
      !status.ok()) {
    return status;
  }
  return CheckRange("radius_m", query.radius_m, 0, 1e6);
}

double StaticProbability(const DepthEstimate& estimate, double solid_above_m,
                         double age_s, const QueryModel& model) {
  if (!IsKnown(estimate)) return 0.0;
  if (estimate.kind == EvidenceKind::kLand) return 1.0;
  const double std_m = static_cast<double>(estimate.std_m);
  const double above_m = solid_above_m - static_cast<double>(estimate.depth_m);
  const double aged_m2 = model.ageing_rate_m2_s * age_s;
  const double aged_std_m =
      aged_m2 == 0.0 ? std_m : std::sqrt(std_m * std_m + aged_m2);
  if (!(aged_std_m > 0.0)) return above_m >= 0.0 ? 1.0 : 0.0;
  return TabulatedNormalCdf(above_m / aged_std_m);
}

double ContactProbability(const ContactPoint& predicted,
                          const Eigen::Vector2d& offset_m,
                          const ObstacleQuery& query,
                          double position_variance_m2) {
  const double overlap = DepthOverlap(predicted, query);
  if (overlap == 0.0) return 0.0;
  const Eigen::Matrix2d covariance_m2 =
      predicted.P.topLeftCorner<2, 2>() +
      position_variance_m2 * Eigen::Matrix2d::Identity();
  return overlap * DiscProbability(offset_m, covariance_m2,
                                   predicted.radius_m + query.radius_m);
}

ObstacleState ClassifyProbability(double probability, double confidence,
                                  bool seabed_known) {
  if (probability >= confidence) return ObstacleState::kOccupied;
  if (!seabed_known) return ObstacleState::kUnknown;
  if (probability <= 1.0 - confidence) return ObstacleState::kFree;
  return ObstacleState::kUncertain;
}

void AddContact(const ObstacleQuery& query, const Contact& contact,
                const ContactPoint& predicted, const Eigen::Vector2d& offset_m,
                double position_variance_m2, ObstacleAnswer& answer) {
  const double probability =
      ContactProbability(predicted, offset_m, query, position_variance_m2);
  if (probability == 0.0) return;
  // 1 - (1 - P)(1 - p), without losing small ones to rounding.
  answer.probability += (1.0 - answer.probability) * probability;
  if (probability < kLeastToldProbability) return;
  Tell({.key = contact.key(),
        .probability = probability,
        .distance_m = offset_m.norm(),
        .age_s = std::max(0.0, ToSeconds(query.time - predicted.report_time)),
        .links = contact.links()},
       answer.contacts);
}

void Conclude(const ObstacleQuery& query, ObstacleAnswer& answer) {
  answer.state = ClassifyProbability(answer.probability, query.confidence,
                                     answer.seabed.has_value());
  const bool at_hazard =
      answer.seabed.has_value() &&
      ReachesHazard(answer.seabed->estimate,
                    query.depth_m + query.vertical_clearance_m);
  if (at_hazard && answer.state == ObstacleState::kFree) {
    answer.state = ObstacleState::kUncertain;
  }
}

ObstacleAnswer Answer(const ObstacleQuery& query,
                      const std::optional<SeabedEstimate>& seabed,
                      const ContactsView& contacts, const QueryModel& model) {
  ObstacleAnswer answer;
  if (seabed.has_value() && IsKnown(seabed->estimate)) {
    const double solid_above_m = query.depth_m + query.vertical_clearance_m;
    SeabedReason& reason = answer.seabed.emplace();
    reason.estimate = seabed->estimate;
    reason.local = seabed->local;
    reason.activity = seabed->activity;
    reason.age_s = AgeS(seabed->estimate, query.time);
    reason.probability = StaticProbability(seabed->estimate, solid_above_m,
                                           reason.age_s.value_or(0.0), model);
    if (ReachesHazard(seabed->estimate, solid_above_m)) {
      reason.probability = std::max(reason.probability, kHazardShare);
    }
    answer.probability = reason.probability;
  }
  contacts.ForEachNear(query.position, query.radius_m, query.time,
                       [&](const NearContact& near) {
                         AddContact(query, *near.contact, near.predicted,
                                    {near.north_m, near.east_m}, 0.0, answer);
                       });
  Conclude(query, answer);
  return answer;
}

}  // namespace fathom::map
