"""Every limit that GetMissionStatus publishes, at the limit and one past it:
the refusal says what and how much, and the server goes on."""

import math
import queue
import threading
import time
import unittest

import grpc

from live_server import (DEADLINE_S, LiveTest, ask, at, fix_report,
                         import_chart, ingest, mission, obstacle, ping, point,
                         report_contacts, send_pings, start_activity, types,
                         wait_until)

EXHAUSTED = grpc.StatusCode.RESOURCE_EXHAUSTED


def beams_ping(sequence, count, source="limits"):
    """A ping with `count` beams on one place, 100 m ahead (east)."""
    message = ping(sequence, [(250, 350, 20.0, 1.0)], source=source)
    for field in ("range_m", "bearing_deg", "depth_m", "std_m"):
        values = getattr(message, field)
        values.extend([values[0]] * (count - 1))
    return message


class Limits(LiveTest):

    def refused(self, limit, call, request, *words, count=None):
        """Expects RESOURCE_EXHAUSTED that names the limit and the count."""
        error = self.assert_status(EXHAUSTED, call, request)
        for word in (str(limit), str(limit + 1 if count is None else count),
                     *words):
            self.assertIn(word, error.details())

    def serves(self, server):
        self.assertNotEqual(ask(server, 105, 105).answer.state,
                            types.OBSTACLE_STATE_UNSPECIFIED)

    def test_beams_in_a_ping(self):
        with self.new_mission() as server:
            start_activity(server)
            limit = server.status().limits.max_beams_per_ping
            last, acks = send_pings(server, [
                beams_ping(1, limit), beams_ping(2, limit + 1),
                beams_ping(3, 1)])
            self.assertEqual(last.pings_applied, 2)
            self.assertEqual(last.measurements_accepted, limit + 1)
            rejections = [r for ack in acks for r in ack.rejections]
            self.assertEqual([r.sequence for r in rejections], [2])
            self.assertEqual(rejections[0].reason,
                             types.REJECT_REASON_INVALID_MESSAGE)
            self.assertEqual(rejections[0].field, "ping.range_m")
            self.assertIn(str(limit), rejections[0].description)

    def test_points_in_a_query(self):
        def batch(count):
            return obstacle.QueryObstaclesRequest(
                latitude_deg=[41.5] * count, longitude_deg=[-71.4] * count,
                depth_m=[10] * count, time=at(0), confidence=0.9)
        with self.new_mission() as server:
            import_chart(server)
            limit = server.status().limits.max_points_per_query
            answer = server.obstacle.QueryObstacles(batch(limit),
                                                    timeout=DEADLINE_S)
            self.assertEqual(len(answer.state), limit)
            self.refused(limit, server.obstacle.QueryObstacles,
                         batch(limit + 1), "latitude_deg")
            self.serves(server)

    def test_reports_in_a_request(self):
        with self.new_mission() as server:
            limit = server.status().limits.max_reports_per_request

            def batch(count, source):
                return ingest.ReportContactsRequest(reports=[
                    fix_report(i, 0, 5 * i, second=i, source=source)
                    for i in range(1, count + 1)])
            answer = server.ingest.ReportContacts(batch(limit, "c4i"),
                                                  timeout=DEADLINE_S)
            self.assertEqual(answer.reports_applied, limit)
            self.refused(limit, server.ingest.ReportContacts,
                         batch(limit + 1, "other"), "reports")
            listed = server.obstacle.ListContacts(
                obstacle.ListContactsRequest(time=at(limit)),
                timeout=DEADLINE_S)
            self.assertEqual([c.source_id for c in listed.contacts], ["c4i"],
                             "nothing of the refused batch was applied")

    def test_cells_in_a_tile(self):
        with self.new_mission() as server:
            limit = server.status().limits.max_tile_cells
            side = math.isqrt(limit)
            self.assertEqual(side * side, limit)

            def tile(rows, columns):
                step = 1e-5
                return mission.DepthTile(
                    north_west=point(500, 0), latitude_step_deg=step,
                    longitude_step_deg=step, rows=rows, columns=columns,
                    depth_m=[30.0] * (rows * columns), std_m=[4.0])
            done = import_chart(server, tile(side, side))
            self.assertEqual(done.cells_with_depth, limit)
            before = server.status(digest=True).map_digest
            # 1 row more than the square; limit + side cells.
            self.refused(limit, lambda _, timeout: import_chart(
                server, tile(side + 1, side)), None, "tile",
                count=limit + side)
            self.refused(limit, lambda _, timeout: import_chart(
                server, tile(1, limit + 1)), None, "tile")
            # What rows and columns claim is refused before it is believed.
            liar = tile(1, 1)
            liar.rows = liar.columns = 2 ** 32 - 1
            self.assert_status(EXHAUSTED, lambda _, timeout: import_chart(
                server, liar), None)
            self.assertEqual(server.status(digest=True).map_digest, before)
            self.serves(server)

    def test_cells_in_a_region(self):
        with self.new_mission() as server:
            limit = server.status().limits.max_region_cells
            side = math.isqrt(limit)
            # An area of side x side cells at 4 m, and somewhat more: the grid
            # of the answer is rounded up to whole cells.
            def region(cells):
                extent_m = cells * 4.0
                return obstacle.GetRegionRequest(
                    south_west=point(-extent_m / 2, -extent_m / 2),
                    north_east=point(extent_m / 2, extent_m / 2),
                    resolution_m=4)
            first = next(iter(stream := server.obstacle.GetRegion(
                region(side * 0.99), timeout=DEADLINE_S)))
            stream.cancel()
            self.assertLessEqual(first.total_rows * first.total_columns,
                                 limit)
            self.assertGreater(first.total_rows * first.total_columns,
                               0.95 * limit)
            error = self.assert_status(EXHAUSTED, server.obstacle.GetRegion,
                                       region(side * 1.01))
            self.assertIn(str(limit), error.details())
            self.assertIn("resolution_m", error.details())
            error = self.assert_status(
                EXHAUSTED, server.obstacle.GetRegion,
                obstacle.GetRegionRequest(
                    south_west=types.GeodeticPoint(latitude_deg=-80,
                                                   longitude_deg=-180),
                    north_east=types.GeodeticPoint(latitude_deg=80,
                                                   longitude_deg=180),
                    resolution_m=0.1))
            self.serves(server)

    def test_open_activities(self):
        with self.new_mission() as server:
            limit = server.status().limits.max_open_activities
            small = dict(north_extent_m=20, east_extent_m=20)
            for i in range(limit):
                start_activity(server, f"a{i}", **small)
            error = self.assert_status(
                EXHAUSTED, lambda _, timeout: start_activity(
                    server, "extra", **small), None)
            self.assertIn(str(limit), error.details())
            self.assertIn("max_open_activities", error.details())
            server.mission.CompleteActivity(
                mission.CompleteActivityRequest(activity_id="a0"),
                timeout=DEADLINE_S)
            start_activity(server, "extra", **small)
            status = server.status()
            self.assertEqual(sum(a.open for a in status.activities), limit)

    def test_cells_of_a_local_map(self):
        with self.new_mission() as server:
            limit = server.status().limits.max_local_cells
            # At the limit a map of 2 GB would be made; one row past it and
            # far past it are refused before anything is.
            side_m = math.isqrt(limit) + 1  # 1 m cells.
            for cell_m in (1.0, 0.5):
                error = self.assert_status(
                    EXHAUSTED, lambda _, timeout, cell_m=cell_m:
                    start_activity(
                        server, cell_size_m=cell_m, north_extent_m=side_m,
                        east_extent_m=side_m), None)
                self.assertIn(str(limit), error.details())
                self.assertIn("cells", error.details())
            self.assertEqual(len(server.status().activities), 0)
            self.serves(server)

    def test_cells_along_a_side(self):
        with self.new_mission() as server:
            limit = server.status().limits.max_local_side_cells
            self.assertEqual(limit, 65_536)
            # 0.1 m cells, two of them the other way.
            started = start_activity(server, "side", cell_size_m=0.1,
                                     north_extent_m=limit * 0.1,
                                     east_extent_m=0.2)
            self.assertEqual(started.activity.cells_north, limit)
            for field in ("north_extent_m", "east_extent_m"):
                extents = dict(north_extent_m=0.2, east_extent_m=0.2)
                extents[field] = (limit + 1) * 0.1
                with self.assertRaises(grpc.RpcError) as caught:
                    start_activity(server, "past", cell_size_m=0.1, **extents)
                self.assertEqual(caught.exception.code(),
                                 grpc.StatusCode.INVALID_ARGUMENT)
                self.assertIn(str(limit), caught.exception.details())
                self.assertIn(field, caught.exception.details())

    def test_cells_of_smoothing(self):
        with self.new_mission() as server:
            limit = server.status().limits.max_smoothing_cells
            start_activity(server, "at", cell_size_m=10, smoothing_scale=0.5,
                           smoothing_distance_m=10 * limit)
            with self.assertRaises(grpc.RpcError) as caught:
                start_activity(server, "past", cell_size_m=10,
                               smoothing_scale=0.5,
                               smoothing_distance_m=10 * limit + 1)
            self.assertEqual(caught.exception.code(),
                             grpc.StatusCode.INVALID_ARGUMENT)
            self.assertIn(str(limit), caught.exception.details())

    def test_every_limit_is_published(self):
        with self.new_mission() as server:
            limits = server.status().limits
            for field in limits.DESCRIPTOR.fields:
                self.assertGreater(getattr(limits, field.name), 0, field.name)

    def test_refusals_and_degraded_cells_are_counted_across_a_restart(self):
        with self.new_mission("--max-cells", "1000") as server:
            tile = mission.DepthTile(
                north_west=point(1500, -1000), latitude_step_deg=0.0005,
                longitude_step_deg=0.0005, rows=60, columns=60,
                depth_m=[10 + i % 7 * 5 for i in range(3600)], std_m=[1])
            imported = import_chart(server, tile)
            self.assertGreater(imported.degraded, 0)
            report_contacts(server, [fix_report(1, second=70),
                                     fix_report(2, second=5)])
            before = server.status()
            self.assertEqual(before.global_map.degraded, imported.degraded)
            self.assertEqual([(r.reason, r.count)
                              for r in before.contacts.rejects],
                             [(types.REJECT_REASON_TOO_LATE, 1)])
            self.assertEqual(server.terminate(), 0, server.log())
        with self.reopen() as again:
            after = again.status()
            self.assertEqual(after.global_map.degraded, imported.degraded)
            self.assertEqual(list(after.contacts.rejects),
                             list(before.contacts.rejects))

    def test_bytes_of_a_message(self):
        with self.new_mission() as server:
            limit = server.status().limits.max_message_bytes

            def of_size(size):
                """A query of exactly `size` bytes: filled up with longitudes
                (8 bytes each) and an unknown field."""
                request = obstacle.QueryObstaclesRequest(confidence=0.9)
                base = request.SerializeToString()
                # Field 15, length-delimited: tag 1 byte, length 4 bytes
                # (2^21 <= length < 2^28), then the filling.
                filling = size - len(base) - 5
                length = bytes([filling & 127 | 128,
                                filling >> 7 & 127 | 128,
                                filling >> 14 & 127 | 128, filling >> 21])
                return base + b"\x7a" + length + bytes(filling)
            raw = server.channel.unary_unary(
                "/fathom.v1.ObstacleService/QueryObstacles")
            self.assertEqual(len(of_size(limit)), limit)
            # At the limit it is read, and answered as what it is: no points.
            self.assert_status(grpc.StatusCode.INVALID_ARGUMENT, raw,
                               of_size(limit))
            error = self.assert_status(EXHAUSTED, raw, of_size(limit + 1))
            self.assertIn(str(limit), error.details())
            self.serves(server)

    def test_contacts(self):
        with self.new_mission("--max-contacts", "3") as server:
            self.assertEqual(server.status().contacts.max_contacts, 3)
            answer = report_contacts(server, [
                fix_report(i, 0, 2000 * i, contact=f"c{i}")
                for i in range(1, 5)])
            self.assertEqual(answer.reports_applied, 3)
            self.assertEqual([(r.sequence, r.reason)
                              for r in answer.rejections],
                             [(4, types.REJECT_REASON_CONTACTS_FULL)])
            self.assertIn("full", answer.rejections[0].description)
            self.assertIn("3 of max_contacts=3",
                          server.status().contacts.warning)
            # Those that are tracked go on, and a dropped one makes room.
            answer = report_contacts(server, [
                fix_report(5, 0, 2005, second=1, contact="c1")])
            self.assertEqual(answer.reports_applied, 1)
            server.mission.DropContact(mission.DropContactRequest(
                source_id="c4i", contact_id="c1", time=at(10)),
                timeout=DEADLINE_S)
            self.assertEqual(server.status().contacts.warning, "")
            answer = report_contacts(server, [
                fix_report(6, 0, 9000, second=11, contact="c4")])
            self.assertEqual(answer.reports_applied, 1)
            self.assertEqual(server.status().contacts.live, 3)

    def test_cells_of_the_global_map(self):
        with self.new_mission("--max-cells", "2000") as server:
            self.assertEqual(server.status().global_map.max_cells, 2000)
            # Depths that no neighbour shares: nothing conglomerates.
            side = 100
            tile = mission.DepthTile(
                north_west=point(1000, 0), latitude_step_deg=1e-4,
                longitude_step_deg=1e-4, rows=side, columns=side,
                depth_m=[10.0 + 7 * ((r * 31 + c * 17) % 29)
                         for r in range(side) for c in range(side)],
                std_m=[1.0])
            try:
                import_chart(server, tile)
            except grpc.RpcError as error:
                self.assertEqual(error.code(), EXHAUSTED)
                self.assertIn("2000", error.details())
            self.assertLessEqual(server.status().global_map.leaves, 2000)
            self.serves(server)

    def test_ingest_streams(self):
        with self.new_mission() as server:
            start_activity(server)
            limit = server.status().limits.max_ingest_streams
            done = threading.Event()
            first_acks = queue.Queue()

            def messages(source):
                yield ingest.StreamPingsRequest(
                    ping=ping(1, [(105, 105, 20.0, 1.0)], source=source))
                done.wait(DEADLINE_S)

            def run(source):
                try:
                    for ack in server.ingest.StreamPings(
                            messages(source), timeout=DEADLINE_S):
                        if ack.durable_sequence == 1:
                            first_acks.put(None)
                except grpc.RpcError as error:
                    first_acks.put(error)
            threads = [threading.Thread(target=run, args=(f"s{i}",))
                       for i in range(limit)]
            for thread in threads:
                thread.start()
            for _ in range(limit):
                self.assertIsNone(first_acks.get(timeout=DEADLINE_S))
            with self.assertRaises(grpc.RpcError) as caught:
                send_pings(server, [ping(1, [(105, 105, 20.0, 1.0)],
                                         source="extra")])
            self.assertEqual(caught.exception.code(), EXHAUSTED)
            self.assertIn(str(limit), caught.exception.details())
            done.set()
            for thread in threads:
                thread.join(DEADLINE_S)
            # All have ended: there is room again.
            ack, _ = send_pings(server, [ping(1, [(105, 105, 20.0, 1.0)],
                                              source="extra")])
            self.assertEqual(ack.durable_sequence, 1)
            self.assertEqual(
                server.status().activities[0].measurements_accepted,
                limit + 1)

    def test_a_flood_of_pings_waits_and_loses_nothing(self):
        """More than max_pending_ingest at once: backpressure, no error."""
        with self.new_mission() as server:
            start_activity(server)
            limit = server.status().limits.max_pending_ingest
            count = limit + limit // 4
            beam = [(105, 105, 20.0, 1.0)]
            ack, _ = send_pings(server, [ping(i, beam, source="flood")
                                         for i in range(1, count + 1)])
            self.assertEqual(ack.pings_applied, count)
            self.assertEqual(ack.durable_sequence, count)

    def test_min_revision_waits_no_longer_than_the_deadline(self):
        with self.new_mission() as server:
            revision = server.status().stamp.map_revision
            started = time.monotonic()
            with self.assertRaises(grpc.RpcError) as caught:
                server.obstacle.QueryObstacle(obstacle.QueryObstacleRequest(
                    position=point(0, 0), confidence=0.9,
                    min_revision=revision + 1), timeout=2)
            self.assertLess(time.monotonic() - started, DEADLINE_S / 2)
            self.assertIn(caught.exception.code(),
                          (grpc.StatusCode.UNAVAILABLE,
                           grpc.StatusCode.DEADLINE_EXCEEDED))
            wait_until(lambda: server.status(), "status")


if __name__ == "__main__":
    unittest.main()
