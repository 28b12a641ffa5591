#include "server/convert_common.h"

#include <chrono>
#include <cstdint>

namespace fathom::server {

void WriteTime(Time time, google::protobuf::Timestamp* out) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(time);
  out->set_seconds(seconds.time_since_epoch().count());
  out->set_nanos(static_cast<int32_t>((time - seconds).count() * 1000));
}

void WritePoint(const map::GeodeticPoint& point, v1::GeodeticPoint* out) {
  out->set_latitude_deg(point.latitude_deg);
  out->set_longitude_deg(point.longitude_deg);
}

void WriteStamp(const map::ObstacleMapView& view, v1::MapStamp* out) {
  out->set_map_revision(view.revision());
  if (view.as_of() != Time{}) WriteTime(view.as_of(), out->mutable_as_of());
}

void WriteRejects(const map::RejectCounts& counts,
                  google::protobuf::RepeatedPtrField<v1::RejectCount>* out) {
  for (size_t i = 1; i < map::kRejectReasonEnd; ++i) {
    const auto reason = static_cast<map::RejectReason>(i);
    if (counts.count(reason) == 0) continue;
    v1::RejectCount* entry = out->Add();
    entry->set_reason(static_cast<v1::RejectReason>(i));
    entry->set_count(counts.count(reason));
  }
}

void WriteNames(const std::vector<map::ContactKey>& names,
                google::protobuf::RepeatedPtrField<v1::ContactName>* out) {
  for (const map::ContactKey& name : names) {
    v1::ContactName* entry = out->Add();
    entry->set_source_id(name.source.value);
    entry->set_contact_id(name.contact.value);
  }
}

void WriteContact(const map::ContactEstimate& estimate,
                  v1::ContactEstimate* out) {
  out->set_contact_id(estimate.key.contact.value);
  out->set_source_id(estimate.key.source.value);
  out->set_contact_class(static_cast<v1::ContactClass>(estimate.contact_class));
  out->set_status(static_cast<v1::ContactStatus>(estimate.status));
  WriteTime(estimate.time, out->mutable_time());
  WritePoint(estimate.Position(), out->mutable_position());
  out->set_velocity_north_m_s(estimate.x(2));
  out->set_velocity_east_m_s(estimate.x(3));
  out->mutable_covariance()->Reserve(10);
  for (int row = 0; row < 4; ++row) {
    for (int column = row; column < 4; ++column) {
      out->mutable_covariance()->Add(estimate.P(row, column));
    }
  }
  out->set_top_depth_m(estimate.top_depth_m);
  out->set_keel_depth_m(estimate.keel_depth_m);
  out->set_radius_m(estimate.radius_m);
  out->set_report_count(estimate.report_count);
  WriteNames(estimate.linked, out->mutable_also_known_as());
}

}  // namespace fathom::server
