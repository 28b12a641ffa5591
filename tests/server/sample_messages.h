// Well-formed messages and domain values that the tests of this room spoil one
// field at a time.

#ifndef FATHOM_TESTS_SERVER_SAMPLE_MESSAGES_H_
#define FATHOM_TESTS_SERVER_SAMPLE_MESSAGES_H_

#include "fathom/v1/ingest_service.pb.h"
#include "fathom/v1/mission_service.pb.h"
#include "fathom/v1/obstacle_service.pb.h"

namespace fathom::server {

// 2002-05-24T00:00:00Z.
inline constexpr int64_t kSampleSeconds = 1'022'198'400;

inline void SetPoint(double latitude_deg, double longitude_deg,
                     v1::GeodeticPoint* point) {
  point->set_latitude_deg(latitude_deg);
  point->set_longitude_deg(longitude_deg);
}

inline v1::Ping SamplePing() {
  v1::Ping ping;
  ping.set_source_id("auv-1");
  ping.set_epoch(1);
  ping.set_sequence(1);
  ping.set_activity_id("leg-1");
  ping.mutable_time()->set_seconds(kSampleSeconds);
  SetPoint(41.5, -71.4, ping.mutable_pose()->mutable_position());
  ping.mutable_pose()->set_depth_m(3);
  ping.mutable_pose()->set_heading_deg(90);
  for (int i = 0; i < 2; ++i) {
    ping.add_range_m(50);
    ping.add_bearing_deg(180);
    ping.add_depth_m(20);
    ping.add_std_m(0.5F);
  }
  return ping;
}

inline v1::ContactReport SampleFix() {
  v1::ContactReport report;
  report.set_source_id("ais");
  report.set_epoch(1);
  report.set_sequence(1);
  report.set_contact_id("MMSI:367000001");
  report.set_contact_class(v1::CONTACT_CLASS_VESSEL);
  report.mutable_time()->set_seconds(kSampleSeconds);
  SetPoint(41.5, -71.4, report.mutable_fix()->mutable_position());
  report.mutable_fix()->set_velocity_north_m_s(3);
  return report;
}

inline v1::ContactReport SampleRangeBearing() {
  v1::ContactReport report = SampleFix();
  v1::RangeBearing* observation = report.mutable_range_bearing();
  SetPoint(41.5, -71.4, observation->mutable_pose()->mutable_position());
  observation->set_range_m(1000);
  observation->set_bearing_deg(30);
  observation->set_range_std_m(10);
  observation->set_bearing_std_deg(1);
  return report;
}

inline v1::QueryObstacleRequest SampleQuery() {
  v1::QueryObstacleRequest request;
  SetPoint(41.5, -71.4, request.mutable_position());
  request.set_depth_m(10);
  request.set_confidence(0.95);
  return request;
}

inline v1::QueryObstaclesRequest SampleBatch(int count = 3) {
  v1::QueryObstaclesRequest request;
  for (int i = 0; i < count; ++i) {
    request.add_latitude_deg(41.5);
    request.add_longitude_deg(-71.4);
    request.add_depth_m(10);
  }
  request.set_confidence(0.95);
  return request;
}

inline v1::StartActivityRequest SampleStart() {
  v1::StartActivityRequest request;
  request.set_activity_id("leg-1");
  request.mutable_time()->set_seconds(kSampleSeconds);
  v1::ActivityParameters* parameters = request.mutable_parameters();
  SetPoint(41.5, -71.4, parameters->mutable_south_west());
  parameters->set_north_extent_m(500);
  parameters->set_east_extent_m(400);
  parameters->set_cell_size_m(10);
  return request;
}

// 2 rows of 3 cells.
inline v1::DepthTile SampleTile() {
  v1::DepthTile tile;
  SetPoint(41.6, -71.4, tile.mutable_north_west());
  tile.set_latitude_step_deg(0.001);
  tile.set_longitude_step_deg(0.002);
  tile.set_rows(2);
  tile.set_columns(3);
  for (int i = 0; i < 6; ++i) tile.add_depth_m(20);
  tile.add_std_m(2);
  return tile;
}

}  // namespace fathom::server

#endif  // FATHOM_TESTS_SERVER_SAMPLE_MESSAGES_H_
