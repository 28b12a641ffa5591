"""The main job through a foreign client (python3-grpcio): chart, activity,
pings, contacts, questions, transfer, completion, status."""

import math
import unittest

import grpc

from live_server import (DEADLINE_S, LiveTest, ask, at, fix_report,
                         import_chart, ingest, mission, obstacle, ping, point,
                         report_contacts, send_pings, start_activity, types)


class MainJob(LiveTest):

    def test_from_a_chart_to_an_answer_after_the_activity(self):
        with self.new_mission() as server:
            unknown = ask(server, 105, 105).answer
            self.assertEqual(unknown.state, types.OBSTACLE_STATE_UNKNOWN)
            self.assertEqual(unknown.probability, 0)

            imported = import_chart(server)
            self.assertEqual(imported.cells_with_depth, 1000)
            chart = ask(server, 105, 105, depth_m=26).answer
            # P(D <= 26) for D ~ N(30, 4^2): Phi(-1) = 0.158655.
            self.assertAlmostEqual(chart.probability, 0.158655, 4)
            self.assertEqual(chart.seabed.kind, types.EVIDENCE_KIND_PRIOR)

            started = start_activity(server)
            self.assertEqual(started.activity.cells_north, 50)
            ack, _ = send_pings(server, [ping(1, [(105, 105, 20.0, 3.0)])])
            self.assertEqual(ack.durable_sequence, 1)
            self.assertEqual(ack.measurements_accepted, 1)

            # Prior N(30, 16) and sounding N(20, 9), eqs. 4.17, 4.18, 4.20:
            # k = 16/25, mean = 30 - 6.4 = 23.6, variance = 16 x 0.36 = 5.76.
            measured = ask(server, 105, 105, depth_m=23.6).answer
            self.assertEqual(measured.seabed.kind,
                             types.EVIDENCE_KIND_MEASURED)
            self.assertEqual(measured.seabed.layer, types.MAP_LAYER_LOCAL)
            self.assertEqual(measured.seabed.activity_id, "bay")
            self.assertAlmostEqual(measured.seabed.depth_m, 23.6, 3)
            self.assertAlmostEqual(measured.seabed.std_m, 2.4, 3)
            self.assertAlmostEqual(measured.probability, 0.5, 3)

            done = server.mission.CompleteActivity(
                mission.CompleteActivityRequest(activity_id="bay"),
                timeout=DEADLINE_S)
            self.assertEqual(done.transfer.local_cells, 1)
            self.assertGreaterEqual(done.transfer.leaves_written, 1)
            after = ask(server, 105, 105, depth_m=23.6).answer
            self.assertEqual(after.seabed.layer, types.MAP_LAYER_GLOBAL)
            # The local map fuses as its estimator does, the global one widens
            # a prior that the evidence contradicts: 10 m apart, variance
            # 100 - 9 = 91, k = 0.91: 30 - 9.1 = 20.9, 0.09 x 91 = 8.19 m^2.
            # The leaf's std is coded in steps of 0.2 %.
            self.assertAlmostEqual(after.seabed.depth_m, 20.9, 1)
            self.assertAlmostEqual(after.seabed.std_m, 2.862, delta=0.01)

            status = server.status(digest=True)
            self.assertEqual(len(status.map_digest), 16)
            self.assertFalse(status.activities[0].open)
            self.assertEqual(status.vertical_datum, "MLLW")
            self.assertEqual(status.storage.fault, "")
            self.assertGreater(status.limits.max_beams_per_ping, 100)

    def test_a_transfer_keeps_the_activity_open(self):
        with self.new_mission() as server:
            start_activity(server)
            send_pings(server, [ping(1, [(105, 105, 20.0, 1.0)])])
            moved = server.mission.TransferLocalMap(
                mission.TransferLocalMapRequest(activity_id="bay"),
                timeout=DEADLINE_S)
            self.assertEqual(moved.transfer.local_cells, 1)
            again = server.mission.TransferLocalMap(
                mission.TransferLocalMapRequest(activity_id="bay"),
                timeout=DEADLINE_S)
            self.assertEqual(again.transfer.leaves_written, 0)
            self.assertTrue(server.status().activities[0].open)

    def test_water_level_refers_depths_to_the_datum(self):
        with self.new_mission() as server:
            start_activity(server)
            message = ping(1, [(105, 105, 20.0, 0.5)])
            message.vertical_reference.reference = \
                types.DEPTH_REFERENCE_WATER_SURFACE
            message.vertical_reference.water_level_m = 1.5
            send_pings(server, [message])
            # 20 m below a surface 1.5 m above the datum: 18.5 m.
            self.assertAlmostEqual(
                ask(server, 105, 105).answer.seabed.depth_m, 18.5, 3)

    def test_contacts_in_the_past_now_and_in_the_future(self):
        with self.new_mission() as server:
            import_chart(server)
            answer = report_contacts(server, [
                fix_report(1, 0, 0, second=0),
                fix_report(2, 0, 500, second=100)])
            self.assertEqual(answer.reports_applied, 2)

            listed = server.obstacle.ListContacts(
                obstacle.ListContactsRequest(time=at(100)),
                timeout=DEADLINE_S)
            self.assertEqual([c.contact_id for c in listed.contacts], ["ship"])

            # 5 m/s east: at 50 s near 250 m (past), at 160 s near 800 m.
            for second, east_m in [(50, 250), (100, 500), (160, 800)]:
                near = ask(server, 0, east_m, depth_m=1,
                           second=second).answer
                self.assertEqual(near.state, types.OBSTACLE_STATE_OCCUPIED)
                self.assertLess(near.contacts[0].distance_m, 5)
            far = ask(server, 0, 800, depth_m=1, second=0).answer
            self.assertEqual(far.state, types.OBSTACLE_STATE_FREE)
            before = ask(server, 0, -5, depth_m=1, second=-1).answer
            self.assertEqual(len(before.contacts), 0)

            history = server.obstacle.GetContactHistory(
                obstacle.GetContactHistoryRequest(source_id="c4i",
                                                  contact_id="ship"),
                timeout=DEADLINE_S)
            estimates = [e for part in history for e in part.estimates]
            self.assertEqual([e.time.seconds for e in estimates],
                             [at(0).seconds, at(100).seconds])

            server.mission.DropContact(mission.DropContactRequest(
                source_id="c4i", contact_id="ship", time=at(200)),
                timeout=DEADLINE_S)
            gone = ask(server, 0, 1250, depth_m=1, second=250).answer
            self.assertEqual(len(gone.contacts), 0)
            self.assert_status(
                grpc.StatusCode.NOT_FOUND, server.mission.DropContact,
                mission.DropContactRequest(source_id="c4i",
                                           contact_id="nobody"))

    def test_contacts_by_stream(self):
        with self.new_mission() as server:
            def reports():
                for i in range(1, 51):
                    report = fix_report(i, source="uuv-1", contact="boat",
                                        second=i)
                    report.ClearField("fix")
                    bearing = report.range_bearing
                    bearing.pose.position.CopyFrom(point(0, 0))
                    bearing.range_m = 1000 + 5 * i
                    bearing.bearing_deg = 90
                    bearing.range_std_m = 20
                    bearing.bearing_std_deg = 1
                    yield ingest.StreamContactsRequest(report=report)
            acks = list(server.ingest.StreamContacts(reports(),
                                                     timeout=DEADLINE_S))
            self.assertEqual(acks[-1].durable_sequence, 50)
            self.assertEqual(acks[-1].reports_applied, 50)
            listed = server.obstacle.ListContacts(
                obstacle.ListContactsRequest(time=at(50)), timeout=DEADLINE_S)
            boat = listed.contacts[0]
            # East at 5 m/s, 1250 m away; 50 reports of 20 m noise-free data.
            self.assertAlmostEqual(boat.velocity_east_m_s, 5, delta=0.5)
            self.assertAlmostEqual(boat.velocity_north_m_s, 0, delta=0.5)
            self.assertEqual(boat.report_count, 50)

    def test_a_region_shows_what_points_answer(self):
        with self.new_mission() as server:
            import_chart(server)
            start_activity(server)
            send_pings(server, [
                ping(1, [(105, 105, 20.0, 0.5), (405, 305, 25.0, 0.5)])])
            parts = list(server.obstacle.GetRegion(
                obstacle.GetRegionRequest(south_west=point(0, 0),
                                          north_east=point(500, 500),
                                          resolution_m=10),
                timeout=DEADLINE_S))
            cells = 0
            kinds = set()
            for part in parts:
                tile = part.tile
                for index, depth in enumerate(tile.depth_m):
                    row, column = divmod(index, tile.columns)
                    cells += 1
                    if index % 97:
                        continue
                    place = types.GeodeticPoint(
                        latitude_deg=tile.north_west.latitude_deg
                        - (row + 0.5) * tile.latitude_step_deg,
                        longitude_deg=tile.north_west.longitude_deg
                        + (column + 0.5) * tile.longitude_step_deg)
                    answer = server.obstacle.QueryObstacle(
                        obstacle.QueryObstacleRequest(
                            position=place, depth_m=10, confidence=0.9),
                        timeout=DEADLINE_S).answer
                    self.assertAlmostEqual(answer.seabed.depth_m, depth, 3)
                    self.assertEqual(answer.seabed.kind, tile.kind[index])
                kinds |= set(tile.kind)
            self.assertEqual(cells, parts[0].total_rows *
                             parts[0].total_columns)
            self.assertEqual(kinds, {types.EVIDENCE_KIND_PRIOR,
                                     types.EVIDENCE_KIND_MEASURED})

    def test_land_is_land_and_the_unknown_stays_unknown(self):
        with self.new_mission() as server:
            nan = math.nan
            tile = mission.DepthTile(
                north_west=point(300, 0), latitude_step_deg=0.001,
                longitude_step_deg=0.001, rows=3, columns=3,
                depth_m=[10, nan, 10, 10, nan, 10, 10, 10, 10],
                std_m=[1.0], land=bytes([1, 0, 0, 1, 0, 0, 1, 0, 0]))
            done = import_chart(server, tile)
            self.assertEqual(done.cells_land, 3)
            self.assertEqual(done.cells_unknown, 2)
            self.assertEqual(done.cells_with_depth, 4)
            land = ask(server, 240, 40, depth_m=0).answer
            self.assertEqual(land.state, types.OBSTACLE_STATE_OCCUPIED)
            self.assertEqual(land.seabed.kind, types.EVIDENCE_KIND_LAND)
            self.assertEqual(ask(server, 240, 125).answer.state,
                             types.OBSTACLE_STATE_UNKNOWN)


if __name__ == "__main__":
    unittest.main()
