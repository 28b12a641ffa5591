// The main job through our client library against a real fathomd, and the
// promise that a ping stream makes: a server that is killed and started again
// on the same port costs nothing and doubles nothing.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <set>
#include <string>

#include "base/time.h"
#include "client/client.h"
#include "client/proto_time.h"
#include "tests/integration/live_server.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client {
namespace {

v1::StartActivityRequest Bay() {
  v1::StartActivityRequest request;
  request.set_activity_id("bay");
  auto* parameters = request.mutable_parameters();
  parameters->mutable_south_west()->set_latitude_deg(41.499);
  parameters->mutable_south_west()->set_longitude_deg(-71.402);
  parameters->set_north_extent_m(300);
  parameters->set_east_extent_m(400);
  parameters->set_cell_size_m(10);
  parameters->set_estimator(v1::ESTIMATOR_KALMAN);
  return request;
}

// One beam of 20 m +- 3 m, 50 m east of 41.5 N 71.4 W.
v1::Ping OneBeam() {
  v1::Ping ping;
  ping.set_activity_id("bay");
  ping.mutable_time()->set_seconds(1'767'225'600);
  auto* pose = ping.mutable_pose();
  pose->mutable_position()->set_latitude_deg(41.5);
  pose->mutable_position()->set_longitude_deg(-71.4);
  pose->set_heading_deg(90);
  ping.add_range_m(50);
  ping.add_bearing_deg(0);
  ping.add_depth_m(20);
  ping.add_std_m(3);
  return ping;
}

// 50 / 83 490 degrees east of 71.4 W: where that beam hits.
v1::QueryObstacleRequest WhereItHits(double depth_m, uint64_t min_revision) {
  v1::QueryObstacleRequest request;
  request.mutable_position()->set_latitude_deg(41.5);
  request.mutable_position()->set_longitude_deg(-71.4 + 50 / 83'490.0);
  request.set_depth_m(depth_m);
  request.set_confidence(0.95);
  request.set_min_revision(min_revision);
  return request;
}

TEST_F(ClientLive, MainJobFromAChartToTheGlobalMap) {
  LiveServer server(folder_, /*create=*/true);
  ASSERT_NE(server.port(), 0);
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto client,
                              Client::Connect(server.address(), {}));

  v1::PriorHeader header;
  header.set_name("chart");
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto writer, client->ImportPrior(header));
  v1::DepthTile tile;
  tile.mutable_north_west()->set_latitude_deg(41.51);
  tile.mutable_north_west()->set_longitude_deg(-71.41);
  tile.set_latitude_step_deg(0.001);
  tile.set_longitude_step_deg(0.001);
  tile.set_rows(20);
  tile.set_columns(20);
  tile.mutable_depth_m()->Resize(400, 30);
  tile.add_std_m(4);
  FATHOM_ASSERT_OK(writer->Write(tile));
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto imported, writer->Finish());
  EXPECT_EQ(imported.cells_with_depth(), 400u);

  FATHOM_ASSERT_OK(client->StartActivity(Bay()).status());
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream,
                              client->OpenPingStream({.source_id = "uuv"}));
  v1::Ping ping = OneBeam();
  FATHOM_ASSERT_OK(stream->Send(ping).status());
  FATHOM_ASSERT_OK(stream->Finish());
  EXPECT_EQ(stream->progress().measurements_accepted, 1u);

  // Prior N(30, 16) and sounding N(20, 9), eqs. 4.17, 4.18, 4.20:
  // k = 16/25, mean = 30 - 6.4 = 23.6, std = 4 x 0.6 = 2.4.
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto answer,
                              client->QueryObstacle(WhereItHits(
                                  23.6, stream->progress().map_revision)));
  EXPECT_NEAR(answer.answer().seabed().depth_m(), 23.6, 1e-3);
  EXPECT_NEAR(answer.answer().seabed().std_m(), 2.4, 1e-3);
  EXPECT_NEAR(answer.answer().probability(), 0.5, 1e-3);

  v1::CompleteActivityRequest complete;
  complete.set_activity_id("bay");
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto completed,
                              client->CompleteActivity(complete));
  EXPECT_EQ(completed.transfer().local_cells(), 1u);
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto after,
      client->QueryObstacle(WhereItHits(23.6, completed.map_revision())));
  EXPECT_EQ(after.answer().seabed().layer(), v1::MAP_LAYER_GLOBAL);
  // The global map widens a contradicted prior: 30 - 0.91 x 10 (see
  // main_job_test.py).
  EXPECT_NEAR(after.answer().seabed().depth_m(), 20.9, 0.1);
  EXPECT_EQ(server.Terminate(), 0);
}

TEST_F(ClientLive, APingStreamSurvivesKillsWithNothingLostOrDoubled) {
  auto server = std::make_unique<LiveServer>(folder_, /*create=*/true);
  ASSERT_NE(server->port(), 0);
  const int port = server->port();
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto client,
                              Client::Connect(server->address(), {}));
  FATHOM_ASSERT_OK(client->StartActivity(Bay()).status());
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const auto stream,
      client->OpenPingStream({.source_id = "uuv", .patience = kDeadline}));

  constexpr uint64_t kKills = 3;
  constexpr uint64_t kPingsBetween = 2000;
  v1::Ping ping = OneBeam();
  for (uint64_t i = 0; i < kKills; ++i) {
    for (uint64_t n = 0; n < kPingsBetween; ++n) {
      FATHOM_ASSERT_OK(stream->Send(ping).status());
    }
    // Half of them applied, the rest on the way: not flushed.
    FATHOM_ASSERT_OK(
        stream->WaitApplied(kPingsBetween * i + kPingsBetween / 2));
    server->Kill();
    server = std::make_unique<LiveServer>(folder_, /*create=*/false, port);
    ASSERT_EQ(server->port(), port);
  }
  FATHOM_ASSERT_OK(stream->Finish());
  constexpr uint64_t kPings = kKills * kPingsBetween;
  EXPECT_EQ(stream->progress().durable_sequence, kPings);
  EXPECT_GE(stream->progress().reconnects, 1u);
  EXPECT_TRUE(stream->progress().gaps.empty());
  EXPECT_TRUE(stream->progress().rejections.empty());

  // Each was counted once.
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto status, client->GetMissionStatus());
  ASSERT_EQ(status.activities_size(), 1);
  EXPECT_EQ(status.activities(0).measurements_accepted(), kPings);
  // And weighed once: n soundings of 3 m without a prior are 3 / sqrt(6000).
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto answer,
                              client->QueryObstacle(WhereItHits(10, 0)));
  EXPECT_NEAR(answer.answer().seabed().std_m(), 0.0387298, 1e-5);
  EXPECT_EQ(server->Terminate(), 0);
}

// Metres of a degree about 41.5 N, good to 0.1 %.
v1::GeodeticPoint Place(double north_m, double east_m) {
  v1::GeodeticPoint point;
  point.set_latitude_deg(41.5 + north_m / 111'073);
  point.set_longitude_deg(-71.4 + east_m / 83'490);
  return point;
}

constexpr Time kStart = TimeFromUnixMicros(1'767'225'600'000'000);

v1::ContactReport Fix(const char* contact, std::uint64_t sequence, int second,
                      double east_m) {
  v1::ContactReport report;
  report.set_source_id("c4i");
  report.set_epoch(1);
  report.set_sequence(sequence);
  report.set_contact_id(contact);
  report.set_contact_class(v1::CONTACT_CLASS_VESSEL);
  *report.mutable_time() = ToProto(kStart + std::chrono::seconds(second));
  *report.mutable_fix()->mutable_position() = Place(0, east_m);
  report.mutable_fix()->set_velocity_east_m_s(5);
  return report;
}

TEST_F(ClientLive, EveryQuestionOfAPlanner) {
  LiveServer server(folder_, /*create=*/true);
  ASSERT_NE(server.port(), 0);
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto client,
                              Client::Connect(server.address(), {}));
  // Cells of 10 m that begin at the place itself; 30 m +- 1 m of water, and
  // 3 m in the cell from 50 m to 60 m east.
  v1::StartActivityRequest start = Bay();
  *start.mutable_parameters()->mutable_south_west() = Place(0, 0);
  start.mutable_parameters()->mutable_default_prior()->set_depth_m(30);
  start.mutable_parameters()->mutable_default_prior()->set_std_m(1);
  FATHOM_ASSERT_OK(client->StartActivity(start).status());
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream,
                              client->OpenPingStream({.source_id = "uuv"}));
  v1::Ping ping = OneBeam();
  *ping.mutable_pose()->mutable_position() = Place(105, 5);
  ping.set_depth_m(0, 3);
  ping.set_std_m(0, 0.0625);
  FATHOM_ASSERT_OK(stream->Send(ping).status());
  FATHOM_ASSERT_OK(stream->Finish());
  const std::uint64_t revision = stream->progress().map_revision;

  v1::CheckTrajectoryRequest check;
  check.set_min_revision(revision);
  check.mutable_trajectory()->set_confidence(0.95);
  for (int i = 0; i < 2; ++i) {
    v1::Waypoint& waypoint = *check.mutable_trajectory()->add_waypoints();
    *waypoint.mutable_position() = Place(105, 5 + 100 * i);
    waypoint.set_depth_m(10);
    *waypoint.mutable_time() = ToProto(kStart + std::chrono::seconds(50 * i));
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto verdict,
                              client->CheckTrajectory(check));
  EXPECT_EQ(verdict.state(), v1::OBSTACLE_STATE_OCCUPIED);
  // 45 m at 2 m/s: 22.5 s; earlier by (sqrt(1/2) - 1/2) 10 m at most.
  const double met_s =
      ToSeconds(FromProto(verdict.first_conflict().time()) - kStart);
  EXPECT_LT(met_s, 22.6);
  EXPECT_GT(met_s, 22.5 - 1.04 - 0.1);

  v1::FindNearestObstacleRequest nearest;
  *nearest.mutable_position() = Place(105, 5);
  nearest.set_depth_m(10);
  *nearest.mutable_time() = ToProto(kStart);
  nearest.set_confidence(0.95);
  nearest.set_search_radius_m(500);
  nearest.set_treat_unknown_as(v1::UNKNOWN_TREATMENT_FREE);
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto found,
                              client->FindNearestObstacle(nearest));
  ASSERT_TRUE(found.found());
  EXPECT_NEAR(found.distance_m(), 45, 0.1);
  EXPECT_NEAR(found.bearing_deg(), 90, 0.5);

  v1::GetRegionRequest area;
  *area.mutable_south_west() = Place(0, 0);
  *area.mutable_north_east() = Place(300, 400);
  area.set_resolution_m(10);
  area.set_activity_id("bay");
  FATHOM_ASSERT_OK_AND_ASSIGN(const Region region, client->GetRegion(area));
  // k = 256/257 (eq. 4.17): 30 - 27 k = 3.105 in one cell, 30 in the others.
  EXPECT_NEAR(std::ranges::min(region.depth_m), 30 - 27 * 256.0 / 257, 1e-4);
  EXPECT_EQ(std::ranges::count(region.kind, v1::EVIDENCE_KIND_MEASURED), 1);
  EXPECT_EQ(region.stamp.map_revision(), revision);

  v1::ReportContactsRequest reports;
  *reports.add_reports() = Fix("ship", 1, 0, 0);
  *reports.add_reports() = Fix("boat", 2, 0, 1000);
  *reports.add_reports() = Fix("ship", 3, 10, 50);
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto reported,
                              client->ReportContacts(reports));
  EXPECT_EQ(reported.reports_applied(), 3u);
  v1::DropContactRequest drop;
  drop.set_source_id("c4i");
  drop.set_contact_id("boat");
  *drop.mutable_time() = ToProto(kStart + std::chrono::seconds(5));
  FATHOM_ASSERT_OK(client->DropContact(drop).status());
  v1::ListContactsRequest list;
  *list.mutable_time() = ToProto(kStart + std::chrono::seconds(30));
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto contacts, client->ListContacts(list));
  ASSERT_EQ(contacts.contacts_size(), 1);
  // 50 m, and 20 s on at 5 m/s.
  EXPECT_NEAR((contacts.contacts(0).position().longitude_deg() + 71.4) * 83'490,
              150, 0.5);
  v1::GetContactHistoryRequest history;
  history.set_source_id("c4i");
  history.set_contact_id("ship");
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto track,
                              client->GetContactHistory(history));
  EXPECT_EQ(track.size(), 2u);

  v1::TransferLocalMapRequest transfer;
  transfer.set_activity_id("bay");
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto moved,
                              client->TransferLocalMap(transfer));
  EXPECT_EQ(moved.transfer().local_cells(), 1u);
  v1::SaveMissionRequest save;
  save.set_file_name("copy.fathom");
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto saved, client->SaveMission(save));
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto proof, client->VerifyMission());
  EXPECT_TRUE(proof.ok());
  EXPECT_EQ(proof.map_digest(), saved.map_digest());
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::uint64_t tiles,
                              client->GetImport("none"));
  EXPECT_EQ(tiles, 0u);
}

TEST_F(ClientLive, AStreamOfContactsAndEveryWatch) {
  constexpr int kContacts = 150;
  LiveServer server(folder_, /*create=*/true);
  ASSERT_NE(server.port(), 0);
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto client,
                              Client::Connect(server.address(), {}));
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto stream,
                              client->OpenContactStream({.source_id = "ais"}));
  for (int k = 0; k < kContacts; ++k) {
    v1::ContactReport report;
    report.set_contact_id("ship-" + std::to_string(k));
    report.set_contact_class(v1::CONTACT_CLASS_VESSEL);
    report.mutable_time()->set_seconds(1'767'225'600);
    report.mutable_fix()->mutable_position()->set_latitude_deg(41.5);
    report.mutable_fix()->mutable_position()->set_longitude_deg(-71.4);
    FATHOM_ASSERT_OK(stream->Send(report).status());
  }
  FATHOM_ASSERT_OK(stream->Finish());

  // They come in two messages and are told one by one, then that this was all.
  const auto contacts = client->WatchContacts();
  std::set<std::string> told;
  while (true) {
    FATHOM_ASSERT_OK_AND_ASSIGN(const auto event, contacts->Next());
    if (event.has_progress()) {
      EXPECT_EQ(event.stamp().map_revision(), std::uint64_t{kContacts});
      break;
    }
    ASSERT_TRUE(event.has_estimate()) << event.ShortDebugString();
    EXPECT_TRUE(told.insert(event.estimate().contact_id()).second);
  }
  EXPECT_EQ(told.size(), std::size_t{kContacts});

  // Whoever cancels is told nothing more, though some of a message is left.
  const auto cancelled = client->WatchContacts();
  FATHOM_ASSERT_OK(cancelled->Next().status());
  cancelled->Cancel();
  EXPECT_TRUE(absl::IsCancelled(cancelled->Next().status()));

  v1::WatchRegionRequest area;
  *area.mutable_region()->mutable_south_west() = WhereItHits(0, 0).position();
  *area.mutable_region()->mutable_north_east() = WhereItHits(0, 0).position();
  area.mutable_region()->mutable_north_east()->set_latitude_deg(41.501);
  area.mutable_region()->mutable_north_east()->set_longitude_deg(-71.398);
  area.mutable_region()->set_resolution_m(20);
  const auto region = client->WatchRegion(area);
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto tile, region->Next());
  EXPECT_TRUE(tile.has_tile());
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto all, region->Next());
  EXPECT_TRUE(all.has_progress());

  v1::WatchTrajectoryRequest way;
  way.mutable_trajectory()->set_confidence(0.95);
  for (const int k : {0, 1}) {
    v1::Waypoint* waypoint = way.mutable_trajectory()->add_waypoints();
    *waypoint->mutable_position() = WhereItHits(0, 0).position();
    waypoint->mutable_position()->set_latitude_deg(41.5 + 0.001 * k);
    waypoint->mutable_time()->set_seconds(1'767'225'600 + 100 * k);
  }
  const auto trajectory = client->WatchTrajectory(way);
  FATHOM_ASSERT_OK_AND_ASSIGN(const auto verdict, trajectory->Next());
  // Nothing is known of the water there, which counts as occupied.
  EXPECT_TRUE(verdict.alert());
}

}  // namespace
}  // namespace fathom::client
