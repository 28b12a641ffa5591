#include "tests/bench/rpc/bench_rpc_scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "base/status_macros.h"

namespace fathom::bench {
namespace {

constexpr double kAreaM = 1000;
// Metres of a degree at 41.5 N: good to 0.3 %, enough to stay in the area.
constexpr double kMetresPerLatitudeDeg = 111'070;
constexpr double kMetresPerLongitudeDeg = 83'480;
constexpr int64_t kStartSeconds = 1'767'225'600;  // 2026-01-01T00:00:00Z

double Uniform(std::mt19937_64& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

void FillPlace(double north_m, double east_m, v1::GeodeticPoint& place) {
  place.set_latitude_deg(kLatitudeDeg + north_m / kMetresPerLatitudeDeg);
  place.set_longitude_deg(kLongitudeDeg + east_m / kMetresPerLongitudeDeg);
}

absl::Status ImportChart(const client::Client& server) {
  v1::PriorHeader header;
  header.set_name("bench chart");
  FATHOM_ASSIGN_OR_RETURN(const auto writer, server.ImportPrior(header));
  v1::DepthTile tile;
  FillPlace(kAreaM * 3, -kAreaM * 2, *tile.mutable_north_west());
  tile.set_latitude_step_deg(0.001);
  tile.set_longitude_step_deg(0.001);
  tile.set_rows(50);
  tile.set_columns(70);
  for (int i = 0; i < 50 * 70; ++i) {
    tile.add_depth_m(static_cast<float>(20 + 5 * std::sin(i * 0.37)));
  }
  tile.add_std_m(3);
  FATHOM_RETURN_IF_ERROR(writer->Write(tile));
  return writer->Finish().status();
}

}  // namespace

absl::Status PrepareScene(const client::Client& server, int pings) {
  FATHOM_RETURN_IF_ERROR(ImportChart(server));
  v1::StartActivityRequest start;
  start.set_activity_id("bench");
  v1::ActivityParameters& area = *start.mutable_parameters();
  FillPlace(0, 0, *area.mutable_south_west());
  area.set_north_extent_m(kAreaM);
  area.set_east_extent_m(kAreaM);
  area.set_cell_size_m(10);
  FATHOM_RETURN_IF_ERROR(server.StartActivity(start).status());
  FATHOM_ASSIGN_OR_RETURN(const auto stream,
                          server.OpenPingStream({.source_id = "prepare"}));
  std::mt19937_64 random(1);
  for (int i = 0; i < pings; ++i) {
    v1::Ping ping;
    FillPing(random, ping);
    FATHOM_RETURN_IF_ERROR(stream->Send(ping).status());
  }
  return stream->Finish();
}

void FillPing(std::mt19937_64& random, v1::Ping& ping) {
  ping.set_activity_id("bench");
  ping.mutable_time()->set_seconds(kStartSeconds);
  FillPlace(Uniform(random, 150, 850), Uniform(random, 150, 850),
            *ping.mutable_pose()->mutable_position());
  ping.mutable_pose()->set_depth_m(5);
  ping.mutable_pose()->set_heading_deg(Uniform(random, 0, 360));
  for (int beam = 0; beam < kBeams; ++beam) {
    // A swath across the track, 1.5 m from beam to beam.
    constexpr int kMiddle = kBeams / 2;
    const float across_m = 1.5f * static_cast<float>(beam - kMiddle);
    ping.add_range_m(std::abs(across_m) + 0.5f);
    ping.add_bearing_deg(across_m < 0 ? -90.0f : 90.0f);
    ping.add_depth_m(static_cast<float>(Uniform(random, 18, 22)));
    ping.add_std_m(0.5f);
  }
}

void FillReport(std::mt19937_64& random, int contact,
                v1::ContactReport& report) {
  std::normal_distribution<double> normal;
  report.set_contact_id("v" + std::to_string(contact));
  report.set_contact_class(v1::CONTACT_CLASS_VESSEL);
  report.mutable_time()->set_seconds(kStartSeconds);
  v1::RangeBearing& heard = *report.mutable_range_bearing();
  FillPlace(500, 500, *heard.mutable_pose()->mutable_position());
  heard.set_range_m(2000 + 100 * contact + 20 * normal(random));
  heard.set_bearing_deg(3.6 * contact - 180 + normal(random));
  heard.set_range_std_m(20);
  heard.set_bearing_std_deg(1);
}

void FillQuery(std::mt19937_64& random, v1::QueryObstacleRequest& query) {
  FillPlace(Uniform(random, 50, 950), Uniform(random, 50, 950),
            *query.mutable_position());
  query.set_depth_m(Uniform(random, 10, 25));
  query.mutable_time()->set_seconds(kStartSeconds + 60);
  query.set_confidence(0.95);
  query.set_vertical_clearance_m(1);
  query.set_radius_m(2);
}

void FillBatch(std::mt19937_64& random, int points,
               v1::QueryObstaclesRequest& batch) {
  v1::GeodeticPoint place;
  for (int i = 0; i < points; ++i) {
    FillPlace(Uniform(random, 50, 950), Uniform(random, 50, 950), place);
    batch.add_latitude_deg(place.latitude_deg());
    batch.add_longitude_deg(place.longitude_deg());
    batch.add_depth_m(static_cast<float>(Uniform(random, 10, 25)));
  }
  batch.mutable_time()->set_seconds(kStartSeconds + 60);
  batch.set_confidence(0.95);
  batch.set_vertical_clearance_m(1);
  batch.set_radius_m(2);
}

void MoveBatch(std::mt19937_64& random, int chosen,
               v1::QueryObstaclesRequest& batch) {
  constexpr double kAheadM = 20;
  double north_m =
      (batch.latitude_deg(chosen) - kLatitudeDeg) * kMetresPerLatitudeDeg;
  double east_m =
      (batch.longitude_deg(chosen) - kLongitudeDeg) * kMetresPerLongitudeDeg;
  if (std::min({north_m, east_m, kAreaM - north_m, kAreaM - east_m}) < 50) {
    north_m = east_m = kAreaM / 2;
  }
  const double heading_rad = Uniform(random, 0, 2 * std::numbers::pi);
  const int count = batch.latitude_deg_size();
  v1::GeodeticPoint place;
  for (int i = 0; i < count; ++i) {
    const double bearing_rad =
        heading_rad + std::numbers::pi * (static_cast<double>(i) / count - 0.5);
    FillPlace(north_m + kAheadM * std::cos(bearing_rad),
              east_m + kAheadM * std::sin(bearing_rad), place);
    batch.set_latitude_deg(i, place.latitude_deg());
    batch.set_longitude_deg(i, place.longitude_deg());
  }
}

}  // namespace fathom::bench
