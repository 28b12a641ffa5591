"""Bad input in every RPC that works: INVALID_ARGUMENT with the field's path,
and nothing else lost. Each row: what is wrong, the path that must be named."""

import math
import time
import unittest

import grpc

from live_server import (DEADLINE_S, LiveTest, ask, at, chart_tile,
                         fields_of, fix_report, import_chart, ingest, mission, obstacle,
                         ping, point, query, send_pings, start_activity, types)

NAN, INF = math.nan, math.inf


def changed(message, path, value):
    """A copy of `message` with the field at `path` set (None: cleared)."""
    copy = type(message)()
    copy.CopyFrom(message)
    *parents, last = path.split(".")
    target = copy
    for name in parents:
        target = getattr(target, name)
    if value is None:
        target.ClearField(last)
    elif isinstance(value, list):
        del getattr(target, last)[:]
        getattr(target, last).extend(value)
    else:
        setattr(target, last, value)
    return copy


class BadInput(LiveTest):

    @classmethod
    def setUpClass(cls):
        cls.holder = LiveTest()
        cls.holder.setUp()
        cls.server = cls.holder.new_mission()
        import_chart(cls.server)
        start_activity(cls.server)

    @classmethod
    def tearDownClass(cls):
        exit_code = cls.server.terminate()
        cls.holder.doCleanups()
        assert exit_code == 0, "the server survived all bad input"

    def check(self, call, good, rows, prefix=""):
        before = self.server.status(digest=True).map_digest
        for path, value in rows:
            with self.subTest(path=path, value=value):
                self.assert_field(prefix + path, call,
                                  changed(good, path, value))
        self.assertEqual(self.server.status(digest=True).map_digest, before)

    def test_query_obstacle(self):
        call = self.server.obstacle.QueryObstacle
        call(query(100, 100), timeout=DEADLINE_S)
        self.check(call, query(100, 100), [
            ("position", None),
            ("position.latitude_deg", NAN), ("position.latitude_deg", 90.01),
            ("position.longitude_deg", INF),
            ("position.longitude_deg", -180.01),
            ("depth_m", NAN), ("depth_m", -101), ("depth_m", 12001),
            ("confidence", 0.5), ("confidence", 1.0), ("confidence", NAN),
            ("vertical_clearance_m", -1), ("vertical_clearance_m", NAN),
            ("radius_m", -1), ("radius_m", INF),
        ])
        self.assert_field("time", call, changed(query(100, 100),
                                                "time.nanos", -1))
        level = query(100, 100)
        level.vertical_reference.reference = \
            types.DEPTH_REFERENCE_WATER_SURFACE
        self.assert_field("vertical_reference.water_level_m", call, level)
        level.vertical_reference.water_level_m = NAN
        self.assert_field("vertical_reference.water_level_m", call, level)

    def test_query_obstacles(self):
        good = obstacle.QueryObstaclesRequest(
            latitude_deg=[41.5], longitude_deg=[-71.4], depth_m=[10],
            time=at(0), confidence=0.9)
        call = self.server.obstacle.QueryObstacles
        call(good, timeout=DEADLINE_S)
        self.check(call, good, [
            ("longitude_deg", []), ("depth_m", [1, 2]),
            ("time_offset_us", [1, 2]), ("confidence", 0.3),
            ("radius_m", NAN),
        ])
        for field, value in [("latitude_deg", 91), ("longitude_deg", NAN),
                             ("depth_m", NAN)]:
            self.assert_field(f"{field}[0]", call,
                              changed(good, field, [value]))

    def test_find_nearest_obstacle(self):
        good = obstacle.FindNearestObstacleRequest(
            position=point(0, 0), depth_m=5, time=at(0), confidence=0.9,
            search_radius_m=100)
        call = self.server.obstacle.FindNearestObstacle
        call(good, timeout=DEADLINE_S)
        self.check(call, good, [
            ("position", None), ("position.latitude_deg", NAN),
            ("position.longitude_deg", 181), ("depth_m", NAN),
            ("depth_m", 12001), ("confidence", 0.5), ("confidence", NAN),
            ("vertical_clearance_m", -1), ("vertical_clearance_m", INF),
            ("search_radius_m", 0), ("search_radius_m", NAN),
            ("search_radius_m", 50000.1), ("treat_unknown_as", 7),
        ])
        self.assert_field("time", call, changed(good, "time.nanos", -1))
        level = changed(good, "depth_m", 5)
        level.vertical_reference.reference = \
            types.DEPTH_REFERENCE_WATER_SURFACE
        self.assert_field("vertical_reference.water_level_m", call, level)

    def test_check_trajectory(self):
        trajectory = obstacle.Trajectory(confidence=0.9)
        for i in range(3):
            waypoint = trajectory.waypoints.add(depth_m=5, time=at(10 * i))
            waypoint.position.CopyFrom(point(10 * i, 0))
        good = obstacle.CheckTrajectoryRequest(trajectory=trajectory)
        call = self.server.obstacle.CheckTrajectory
        call(good, timeout=DEADLINE_S)
        self.check(call, good, [("trajectory." + field, value)
                                for field, value in [
            ("radius_m", -1), ("radius_m", NAN), ("radius_m", 1000.1),
            ("vertical_clearance_m", -1), ("vertical_clearance_m", INF),
            ("position_std_m", -1), ("position_std_m", NAN),
            ("position_std_m", 1000.1), ("confidence", 1.0),
            ("confidence", NAN), ("treat_unknown_as", 3)]])
        self.assert_field("trajectory.waypoints", call,
                          obstacle.CheckTrajectoryRequest())
        for path, value, field in [
            ("position", None, "position"),
            ("position.latitude_deg", NAN, "position.latitude_deg"),
            ("position.longitude_deg", -181, "position.longitude_deg"),
            # A degree of latitude: longer than a leg may be.
            ("position.latitude_deg", 42.5, "position"),
            ("depth_m", NAN, "depth_m"), ("depth_m", 12001, "depth_m"),
            ("time", None, "time"), ("time.nanos", -1, "time"),
            ("time.seconds", at(0).seconds, "time"),
        ]:
            with self.subTest(path=path, value=value):
                bad = obstacle.CheckTrajectoryRequest()
                bad.CopyFrom(good)
                bad.trajectory.waypoints[1].CopyFrom(
                    changed(good.trajectory.waypoints[1], path, value))
                self.assert_field("trajectory.waypoints[1]." + field, call,
                                  bad)

    def test_start_activity(self):
        good = mission.StartActivityRequest(
            activity_id="other", time=at(0),
            parameters=mission.ActivityParameters(
                south_west=point(0, 0), north_extent_m=100,
                east_extent_m=100, cell_size_m=10))
        call = self.server.mission.StartActivity
        self.check(call, good, [
            ("activity_id", ""), ("activity_id", "a b"),
            ("activity_id", "x" * 65), ("vehicle_id", "a/b"),
            ("parameters", None), ("parameters.south_west", None),
            ("parameters.south_west.latitude_deg", 91),
            ("parameters.north_extent_m", 0),
            ("parameters.north_extent_m", NAN),
            ("parameters.east_extent_m", -1),
            ("parameters.cell_size_m", 0), ("parameters.cell_size_m", INF),
            ("parameters.min_range_m", -1),
            ("parameters.max_range_m", NAN),
            ("parameters.smoothing_distance_m", -1),
            ("parameters.smoothing_scale", 1),
            ("parameters.default_prior.depth_m", NAN),
        ])
        no_std = changed(good, "parameters.default_prior.depth_m", 10)
        self.assert_field("parameters.default_prior.std_m", call, no_std)
        self.assert_status(grpc.StatusCode.ALREADY_EXISTS, call,
                           changed(good, "activity_id", "bay"))
        far = changed(good, "parameters.south_west.latitude_deg", -60)
        self.assert_status(grpc.StatusCode.OUT_OF_RANGE, call, far)

    def test_complete_transfer_drop_history(self):
        mission_stub = self.server.mission
        for call, request in [
            (mission_stub.CompleteActivity,
             mission.CompleteActivityRequest(activity_id="none")),
            (mission_stub.TransferLocalMap,
             mission.TransferLocalMapRequest(activity_id="none")),
        ]:
            self.assert_status(grpc.StatusCode.NOT_FOUND, call, request)
        self.assert_field("activity_id", mission_stub.CompleteActivity,
                          mission.CompleteActivityRequest(activity_id="a b"))
        self.assert_field("activity_id", mission_stub.TransferLocalMap,
                          mission.TransferLocalMapRequest())
        self.assert_field("contact_id", mission_stub.DropContact,
                          mission.DropContactRequest(source_id="c4i"))
        self.assert_field("source_id", mission_stub.DropContact,
                          mission.DropContactRequest(contact_id="x"))
        self.assert_status(
            grpc.StatusCode.NOT_FOUND, self.server.obstacle.GetContactHistory,
            obstacle.GetContactHistoryRequest(source_id="c4i",
                                              contact_id="nobody"))

    def test_get_region(self):
        good = obstacle.GetRegionRequest(
            south_west=point(0, 0), north_east=point(100, 100),
            resolution_m=10)
        self.check(self.server.obstacle.GetRegion, good, [
            ("south_west", None), ("north_east", None),
            ("south_west.latitude_deg", NAN),
            ("north_east.latitude_deg", 41.4),
            ("resolution_m", 0), ("resolution_m", NAN),
        ])

    def test_import_prior(self):
        def call(request, timeout):
            header = mission.ImportPriorRequest(
                header=mission.PriorHeader(name="chart"))
            return self.server.mission.ImportPrior(
                iter([header, request]), timeout=timeout)
        good = mission.ImportPriorRequest(tile=chart_tile())
        before = self.server.status(digest=True).map_digest
        for path, value in [
            ("north_west", None), ("north_west.latitude_deg", NAN),
            ("latitude_step_deg", 0), ("longitude_step_deg", NAN),
            ("rows", 0), ("columns", 0), ("rows", 24),
            ("std_m", []), ("std_m", [0.0]), ("std_m", [NAN]),
            ("std_m", [1.0, 2.0]), ("land", b"\x00"),
        ]:
            with self.subTest(path=path, value=value):
                field = "depth_m" if path == "rows" and value == 24 else path
                error = self.assert_status(
                    grpc.StatusCode.INVALID_ARGUMENT, call,
                    changed(good, "tile." + path, value))
                self.assertTrue(
                    any(f.startswith("tile." + field)
                        for f in fields_of(error)),
                    (fields_of(error), error.details()))
        self.assertEqual(self.server.status(digest=True).map_digest, before)
        with self.assertRaises(grpc.RpcError) as caught:
            self.server.mission.ImportPrior(iter([good]), timeout=DEADLINE_S)
        self.assertEqual(caught.exception.code(),
                         grpc.StatusCode.FAILED_PRECONDITION)

    def test_report_contacts_all_or_nothing(self):
        good = fix_report(1, source="bad")
        rows = [
            ("source_id", ""), ("epoch", 0), ("sequence", 0),
            ("contact_id", ""), ("contact_id", "a b"),
            ("contact_class", types.CONTACT_CLASS_UNSPECIFIED),
            ("contact_class", 99), ("time", None),
            ("fix.position", None), ("fix.position.latitude_deg", NAN),
            ("fix.velocity_north_m_s", 61), ("fix.velocity_east_m_s", NAN),
            ("fix.position_std_m", -1), ("fix.velocity_std_m_s", NAN),
            ("depth_m", NAN),
        ]
        call = self.server.ingest.ReportContacts
        for path, value in rows:
            with self.subTest(path=path, value=value):
                batch = ingest.ReportContactsRequest(reports=[
                    good, changed(good, path, value)])
                batch.reports[1].sequence = 2 if path != "sequence" else 0
                self.assert_field("reports[1]." + path, call, batch)
        bearing = changed(good, "fix", None)
        self.assert_field("reports[0].observation", call,
                          ingest.ReportContactsRequest(reports=[bearing]))
        bearing.range_bearing.pose.position.CopyFrom(point(0, 0))
        bearing.range_bearing.range_m = 100
        bearing.range_bearing.range_std_m = 5
        bearing.range_bearing.bearing_std_deg = 1
        for path, value in [("range_m", -1), ("range_m", NAN),
                            ("range_std_m", 0), ("bearing_std_deg", 61),
                            ("bearing_deg", 361), ("pose.heading_deg", NAN),
                            ("pose.position", None)]:
            with self.subTest(path=path, value=value):
                bad = changed(bearing, "range_bearing." + path, value)
                self.assert_field(
                    "reports[0].range_bearing." + path, call,
                    ingest.ReportContactsRequest(reports=[bad]))
        ahead = changed(good, "time", None)
        ahead.time.FromSeconds(int(time.time()) + 25 * 3600)
        self.assert_field("reports[0].time", call,
                          ingest.ReportContactsRequest(reports=[ahead]))
        self.assertEqual(self.server.status().contacts.live, 0)

    def test_a_bad_ping_costs_only_itself(self):
        good = [(205, 205, 20.0, 1.0)]
        messages = [ping(1, good, source="mixed")]
        rows = [
            ("pose", None), ("pose.position", None),
            ("pose.position.latitude_deg", NAN),
            ("pose.heading_deg", 361), ("pose.depth_m", NAN),
            ("time", None), ("activity_id", "a b"),
            ("range_m", []), ("bearing_deg", [1, 2]), ("depth_m", []),
            ("std_m", [1, 2, 3]),
        ]
        for path, value in rows:
            messages.append(changed(
                ping(len(messages) + 1, good, source="mixed"), path, value))
        nowhere = ping(len(messages) + 1, good, source="mixed",
                       activity="closed")
        messages.append(nowhere)
        messages.append(ping(len(messages) + 1, good, source="mixed"))
        last, acks = send_pings(self.server, messages)
        self.assertEqual(last.durable_sequence, len(messages))
        self.assertEqual(last.pings_applied, 2)
        rejections = [r for ack in acks for r in ack.rejections]
        self.assertEqual([r.sequence for r in rejections],
                         list(range(2, len(rows) + 3)))
        for rejection, (path, value) in zip(rejections, rows):
            self.assertEqual(rejection.field, "ping." + path)
            not_finite = isinstance(value, float) and math.isnan(value)
            self.assertEqual(rejection.reason,
                             types.REJECT_REASON_NOT_FINITE if not_finite
                             else types.REJECT_REASON_INVALID_MESSAGE)
        self.assertEqual(rejections[-1].reason,
                         types.REJECT_REASON_NO_ACTIVITY)

    def test_bad_beams_are_counted_by_reason_and_the_good_ones_kept(self):
        message = ping(1, [(305, 305, 20.0, 1.0)] * 6, source="beams")
        message.depth_m[1] = NAN
        message.std_m[2] = 0
        message.depth_m[3] = 42949672.92  # A recorder's real sentinel.
        message.range_m[4] = 1e6
        message.range_m[5] = 400  # Outside the area.
        ack, _ = send_pings(self.server, [message])
        self.assertEqual(ack.pings_applied, 1)
        self.assertEqual(ack.measurements_accepted, 1)
        self.assertEqual(
            {r.reason: r.count for r in ack.rejects},
            {types.REJECT_REASON_NOT_FINITE: 1, types.REJECT_REASON_BAD_STD: 1,
             types.REJECT_REASON_BAD_DEPTH: 1,
             types.REJECT_REASON_ABOVE_MAX_RANGE: 1,
             types.REJECT_REASON_OUTSIDE_AREA: 1})
        self.assertAlmostEqual(
            ask(self.server, 305, 305).answer.seabed.depth_m, 20.6, 0)

    def test_a_stream_may_not_change_its_source(self):
        stream = self.server.ingest.StreamPings(iter([
            ingest.StreamPingsRequest(ping=ping(1, [(5, 5, 20, 1)],
                                                source="one")),
            ingest.StreamPingsRequest(ping=ping(2, [(5, 5, 20, 1)],
                                                source="two"))]),
            timeout=DEADLINE_S)
        with self.assertRaises(grpc.RpcError) as caught:
            list(stream)
        self.assertEqual(caught.exception.code(),
                         grpc.StatusCode.INVALID_ARGUMENT)


if __name__ == "__main__":
    unittest.main()
