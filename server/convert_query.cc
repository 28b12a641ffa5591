#include "server/convert_query.h"

#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "server/convert_common.h"
#include "server/errors.h"
#include "server/field_checks.h"
#include "server/limits.h"
#include "server/pieces.h"

namespace fathom::server {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// What a single question and a batch share.
template <typename Request>
absl::Status ConvertShared(const Request& request, Time now,
                           const FieldPath& root, map::ObstacleQuery& query,
                           double& water_level_m) {
  query.time = now;
  if (request.has_time()) {
    FATHOM_ASSIGN_OR_RETURN(query.time,
                            CheckTime(request.time(), FieldPath(root, "time")));
  }
  FATHOM_ASSIGN_OR_RETURN(
      water_level_m,
      CheckVerticalReference(request.has_vertical_reference()
                                 ? &request.vertical_reference()
                                 : nullptr,
                             FieldPath(root, "vertical_reference")));
  FATHOM_RETURN_IF_ERROR(CheckNumber(request.confidence(),
                                     {.min = 0.5,
                                      .max = 1,
                                      .unit = "",
                                      .lower = Bound::kOpen,
                                      .upper = Bound::kOpen},
                                     FieldPath(root, "confidence")));
  FATHOM_RETURN_IF_ERROR(
      CheckNumber(request.vertical_clearance_m(),
                  {.min = 0, .max = kMaxClearanceM, .unit = "m"},
                  FieldPath(root, "vertical_clearance_m")));
  FATHOM_RETURN_IF_ERROR(CheckNumber(
      request.radius_m(), {.min = 0, .max = kMaxRadiusM, .unit = "m"},
      FieldPath(root, "radius_m")));
  query.confidence = request.confidence();
  query.vertical_clearance_m = request.vertical_clearance_m();
  query.radius_m = request.radius_m();
  return absl::OkStatus();
}

void WriteContactReason(const map::ContactReason& reason,
                        v1::ContactEvidence* out) {
  out->set_contact_id(reason.key.contact.value);
  out->set_source_id(reason.key.source.value);
  out->set_probability(reason.probability);
  out->set_distance_m(reason.distance_m);
  out->set_age_s(reason.age_s);
  if (reason.links != nullptr) {
    WriteNames(reason.links->names, out->mutable_also_known_as());
  }
}

absl::Status CheckLength(int count, int expected, const FieldPath& path) {
  if (count == expected) return absl::OkStatus();
  return InvalidField(path.ToString(),
                      absl::StrFormat("has %d values where latitude_deg has %d",
                                      count, expected));
}

// Points that a thread answers at once, between two looks whether they are
// still wanted: 50 us, or 1 ms where each is near a hundred contacts.
constexpr size_t kPointsPerPiece = 128;

// Lengths and every point's numbers; `time` is the base time.
absl::Status CheckPoints(const v1::QueryObstaclesRequest& request,
                         double water_level_m, const FieldPath& root) {
  const int count = request.latitude_deg_size();
  if (count == 0) {
    return Missing(FieldPath(root, "latitude_deg"), "at least one point");
  }
  if (static_cast<size_t>(count) > kMaxPointsPerQuery) {
    return LimitExceeded("latitude_deg", static_cast<uint64_t>(count),
                         kMaxPointsPerQuery);
  }
  FATHOM_RETURN_IF_ERROR(CheckLength(request.longitude_deg_size(), count,
                                     FieldPath(root, "longitude_deg")));
  FATHOM_RETURN_IF_ERROR(
      CheckLength(request.depth_m_size(), count, FieldPath(root, "depth_m")));
  const bool timed = request.time_offset_us_size() != 0;
  if (timed) {
    FATHOM_RETURN_IF_ERROR(CheckLength(request.time_offset_us_size(), count,
                                       FieldPath(root, "time_offset_us")));
  }
  for (int i = 0; i < count; ++i) {
    const double latitude_deg = request.latitude_deg(i);
    const double longitude_deg = request.longitude_deg(i);
    const double depth_m = request.depth_m(i) - water_level_m;
    // One compound test for the good case; the checks below say what failed.
    if (latitude_deg >= -90 && latitude_deg <= 90 && longitude_deg >= -180 &&
        longitude_deg <= 180 && depth_m >= kMinDepthM &&
        depth_m <= kMaxDepthM) {
      continue;
    }
    const size_t index = static_cast<size_t>(i);
    FATHOM_RETURN_IF_ERROR(CheckNumber(latitude_deg,
                                       {.min = -90, .max = 90, .unit = "deg"},
                                       FieldPath(root, "latitude_deg", index)));
    FATHOM_RETURN_IF_ERROR(
        CheckNumber(longitude_deg, {.min = -180, .max = 180, .unit = "deg"},
                    FieldPath(root, "longitude_deg", index)));
    FATHOM_RETURN_IF_ERROR(
        CheckDepth(depth_m, FieldPath(root, "depth_m", index)));
  }
  for (int i = 0; timed && i < count; ++i) {
    const int64_t offset_us = request.time_offset_us(i);
    if (offset_us < -kMaxTimeOffsetUs || offset_us > kMaxTimeOffsetUs) {
      return InvalidField(
          FieldPath(root, "time_offset_us", static_cast<size_t>(i)).ToString(),
          absl::StrFormat("%d us is more than ten years", offset_us));
    }
  }
  return absl::OkStatus();
}

// The answer to the point `index` of `count`.
void WriteReasons(const map::ObstacleAnswer& answer, int index, int count,
                  v1::QueryObstaclesResponse* out) {
  const map::SeabedReason* seabed =
      answer.seabed.has_value() ? &*answer.seabed : nullptr;
  out->mutable_mean_depth_m()->AddAlreadyReserved(
      seabed == nullptr ? kNaN : seabed->estimate.depth_m);
  out->mutable_std_m()->AddAlreadyReserved(
      seabed == nullptr ? kNaN : seabed->estimate.std_m);
  out->mutable_age_s()->AddAlreadyReserved(
      seabed == nullptr ? kNaN
                        : static_cast<float>(seabed->age_s.value_or(kNaN)));
  out->mutable_kind()->AddAlreadyReserved(
      seabed == nullptr ? static_cast<int>(v1::EVIDENCE_KIND_UNSPECIFIED)
                        : static_cast<int>(seabed->estimate.kind));
  if (seabed != nullptr && !std::isnan(seabed->estimate.hazard_m)) {
    // Rare: the array is made when the first hazard is met.
    if (out->hazard_m().empty()) {
      out->mutable_hazard_m()->Resize(count, kNaN);
    }
    out->set_hazard_m(index, seabed->estimate.hazard_m);
  }
  for (const map::ContactReason& reason : answer.contacts) {
    v1::PointContact* contact = out->add_contacts();
    contact->set_point_index(static_cast<uint32_t>(index));
    WriteContactReason(reason, contact->mutable_evidence());
  }
}

}  // namespace

absl::StatusOr<map::ObstacleQuery> ConvertQuery(
    const v1::QueryObstacleRequest& request, Time now) {
  const FieldPath root;
  map::ObstacleQuery query;
  double water_level_m = 0;
  if (!request.has_position()) {
    return Missing(FieldPath(root, "position"), "the place asked about");
  }
  FATHOM_ASSIGN_OR_RETURN(
      query.position,
      CheckPoint(request.position(), FieldPath(root, "position")));
  FATHOM_RETURN_IF_ERROR(
      ConvertShared(request, now, root, query, water_level_m));
  query.depth_m = request.depth_m() - water_level_m;
  FATHOM_RETURN_IF_ERROR(CheckDepth(query.depth_m, FieldPath(root, "depth_m")));
  return query;
}

void WriteAnswer(const map::ObstacleAnswer& answer, v1::ObstacleAnswer* out) {
  out->set_state(static_cast<v1::ObstacleState>(answer.state));
  out->set_probability(answer.probability);
  if (answer.seabed.has_value()) {
    const map::SeabedReason& reason = *answer.seabed;
    v1::StaticEvidence* seabed = out->mutable_seabed();
    seabed->set_probability(reason.probability);
    seabed->set_layer(reason.local ? v1::MAP_LAYER_LOCAL
                                   : v1::MAP_LAYER_GLOBAL);
    seabed->set_kind(static_cast<v1::EvidenceKind>(reason.estimate.kind));
    seabed->set_depth_m(reason.estimate.depth_m);
    seabed->set_std_m(reason.estimate.std_m);
    if (reason.age_s.has_value()) seabed->set_age_s(*reason.age_s);
    seabed->set_cell_size_m(reason.estimate.cell_size_m);
    if (!std::isnan(reason.estimate.shoalest_m)) {
      seabed->set_shoalest_m(reason.estimate.shoalest_m);
    }
    if (!std::isnan(reason.estimate.hazard_m)) {
      seabed->set_hazard_m(reason.estimate.hazard_m);
    }
    if (reason.activity != nullptr) {
      seabed->set_activity_id(reason.activity->value);
    }
  }
  for (const map::ContactReason& reason : answer.contacts) {
    WriteContactReason(reason, out->add_contacts());
  }
}

absl::Status CheckBatch(const v1::QueryObstaclesRequest& request) {
  const FieldPath root;
  map::ObstacleQuery query;
  double water_level_m = 0;
  FATHOM_RETURN_IF_ERROR(
      ConvertShared(request, Time{}, root, query, water_level_m));
  return CheckPoints(request, water_level_m, root);
}

absl::Status AnswerBatch(const v1::QueryObstaclesRequest& request, Time now,
                         const map::ObstacleMapView& view,
                         v1::QueryObstaclesResponse* out,
                         absl::FunctionRef<bool()> unwanted, Workers* helpers) {
  const FieldPath root;
  map::ObstacleQuery shared;
  double water_level_m = 0;
  FATHOM_RETURN_IF_ERROR(
      ConvertShared(request, now, root, shared, water_level_m));
  FATHOM_RETURN_IF_ERROR(CheckPoints(request, water_level_m, root));
  const int count = request.latitude_deg_size();
  const bool timed = request.time_offset_us_size() != 0;
  const bool with_reasons = request.with_reasons();
  out->mutable_probability()->Resize(count, 0.0f);
  out->mutable_state()->Resize(count, v1::OBSTACLE_STATE_UNSPECIFIED);
  if (with_reasons) {
    out->mutable_mean_depth_m()->Reserve(count);
    out->mutable_std_m()->Reserve(count);
    out->mutable_age_s()->Reserve(count);
    out->mutable_kind()->Reserve(count);
  }
  float* const probabilities = out->mutable_probability()->mutable_data();
  int* const states = out->mutable_state()->mutable_data();
  std::atomic<bool> dropped = false;
  const auto answer_piece = [&](size_t begin, size_t end) {
    if (begin > 0 && !dropped && unwanted()) dropped = true;
    if (dropped) return;
    map::ObstacleQuery query = shared;
    for (int i = static_cast<int>(begin); i < static_cast<int>(end); ++i) {
      query.position = {.latitude_deg = request.latitude_deg(i),
                        .longitude_deg = request.longitude_deg(i)};
      query.depth_m = request.depth_m(i) - water_level_m;
      if (timed) {
        query.time = shared.time + Duration(request.time_offset_us(i));
      }
      const map::ObstacleAnswer answer = view.Answer(query);
      probabilities[i] = static_cast<float>(answer.probability);
      states[i] = static_cast<int>(answer.state);
      if (with_reasons) WriteReasons(answer, i, count, out);
    }
  };
  // Reasons are appended, so in order.
  ForEachPiece(with_reasons ? nullptr : helpers, static_cast<size_t>(count),
               kPointsPerPiece, answer_piece);
  if (dropped) return absl::CancelledError("the client has gone");
  WriteStamp(view, out->mutable_stamp());
  return absl::OkStatus();
}

void ListContacts(const map::ObstacleMapView& view, Time time,
                  bool include_inactive, v1::ListContactsResponse* out) {
  const map::ContactClassTable& classes = view.contacts().classes();
  view.contacts().ForEach([&](const map::Contact& contact) {
    const auto estimate = contact.EstimateAt(time, classes);
    if (estimate.has_value()) {
      if (estimate->status != map::ContactStatus::kStale || include_inactive) {
        WriteContact(*estimate, out->add_contacts());
      }
    } else if (include_inactive && contact.dropped() &&
               contact.newest().time <= time) {
      WriteContact(contact.NewestEstimate(), out->add_contacts());
    }
  });
  WriteStamp(view, out->mutable_stamp());
}

}  // namespace fathom::server
