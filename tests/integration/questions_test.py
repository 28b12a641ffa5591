"""A planner's questions to a live server: the nearest obstacle, and a timed
trajectory."""

import time
import unittest

import grpc

from live_server import (DEADLINE_S, M_PER_LON, LiveTest, at, chart_tile, fix_report,
                         import_chart, obstacle, ping, point,
                         report_contacts, send_pings, start_activity, types)

FREE = types.OBSTACLE_STATE_FREE
OCCUPIED = types.OBSTACLE_STATE_OCCUPIED
UNKNOWN = types.OBSTACLE_STATE_UNKNOWN
AS_FREE = obstacle.UNKNOWN_TREATMENT_FREE
AS_OCCUPIED = obstacle.UNKNOWN_TREATMENT_OCCUPIED


def search(north_m, east_m, depth_m=10.0, radius_m=5000.0, second=0,
           unknown=AS_FREE, confidence=0.95, **kwargs):
    return obstacle.FindNearestObstacleRequest(
        position=point(north_m, east_m), depth_m=depth_m, time=at(second),
        confidence=confidence, search_radius_m=radius_m,
        treat_unknown_as=unknown, **kwargs)


def path(*places, unknown=AS_FREE, confidence=0.95, **kwargs):
    """A trajectory through (north_m, east_m, depth_m, second)."""
    trajectory = obstacle.Trajectory(confidence=confidence,
                                     treat_unknown_as=unknown, **kwargs)
    for north_m, east_m, depth_m, second in places:
        waypoint = trajectory.waypoints.add(depth_m=depth_m, time=at(second))
        waypoint.position.CopyFrom(point(north_m, east_m))
    return trajectory


def survey_with_wall(server):
    """30 m +- 1 m of water over 4 km, and in the activity a wall of 3 m from
    north 200 to 300 m at east 300 m."""
    import_chart(server, chart_tile(std_m=1.0))
    start_activity(server)
    send_pings(server, [ping(1, [(205 + 10 * k, 305, 3.0, 0.05)
                                 for k in range(10)])])


class Nearest(LiveTest):

    def find(self, server, *args, **kwargs):
        return server.obstacle.FindNearestObstacle(search(*args, **kwargs),
                                                   timeout=DEADLINE_S)

    def test_a_wall_is_found_with_distance_bearing_and_reason(self):
        with self.new_mission() as server:
            survey_with_wall(server)
            # West of the wall: its nearest cell begins at east 300 m.
            found = self.find(server, 255, 105)
            self.assertTrue(found.found)
            # The metres per degree of the test are good to 0.1 %.
            self.assertAlmostEqual(found.distance_m, 195, delta=0.5)
            self.assertAlmostEqual(found.bearing_deg, 90, delta=0.5)
            self.assertEqual(found.answer.state, OCCUPIED)
            self.assertEqual(found.answer.seabed.activity_id, "bay")
            self.assertEqual(found.contact_id, "")
            self.assertEqual(found.stamp.map_revision,
                             server.status().stamp.map_revision)
            # The place told is indeed so far away and next to the wall.
            there = server.obstacle.QueryObstacle(
                obstacle.QueryObstacleRequest(
                    position=point(255, 301), depth_m=10, confidence=0.95),
                timeout=DEADLINE_S)
            self.assertEqual(there.answer.state, OCCUPIED)
            # South of it: bearing north, to its end at north 200 m.
            south = self.find(server, 55, 305)
            self.assertAlmostEqual(south.distance_m, 145, delta=0.5)
            self.assertTrue(min(south.bearing_deg, 360 - south.bearing_deg)
                            < 1, south.bearing_deg)
            # None nearer than 190 m; none at 1 m of depth; at once inside.
            self.assertFalse(self.find(server, 255, 105, radius_m=190).found)
            self.assertFalse(self.find(server, 255, 105, depth_m=1,
                                       radius_m=400).found)
            inside = self.find(server, 255, 305)
            self.assertEqual((inside.distance_m, inside.bearing_deg), (0, 0))

    def test_unknown_counts_as_it_is_asked(self):
        with self.new_mission() as server:
            import_chart(server)
            self.assertFalse(self.find(server, 250, 250, depth_m=5).found)
            unknown = self.find(server, 250, 250, depth_m=5,
                                unknown=AS_OCCUPIED)
            self.assertTrue(unknown.found)
            self.assertEqual(unknown.answer.state, UNKNOWN)
            # Unspecified is the safe reading.
            self.assertEqual(
                self.find(server, 250, 250, depth_m=5,
                          unknown=obstacle.UNKNOWN_TREATMENT_UNSPECIFIED)
                .distance_m, unknown.distance_m)
            # The chart ends 1000 m west of the area's corner: 1250 m away,
            # give or take half a leaf of its 83 m cells.
            self.assertAlmostEqual(unknown.distance_m, 1250, delta=42)
            # There, to a metre, the known ends.
            for metres, state in [(-1, FREE), (1, UNKNOWN)]:
                place = types.GeodeticPoint(
                    latitude_deg=unknown.position.latitude_deg,
                    longitude_deg=unknown.position.longitude_deg
                    - metres / M_PER_LON)
                answer = server.obstacle.QueryObstacle(
                    obstacle.QueryObstacleRequest(
                        position=place, depth_m=5, confidence=0.95),
                    timeout=DEADLINE_S).answer
                self.assertEqual(answer.state, state, metres)

    def test_a_contact_is_found_where_it_will_be(self):
        with self.new_mission() as server:
            import_chart(server)
            report_contacts(server, [fix_report(1, 100, 400)])
            vessel = [c for c in server.status().contacts.classes
                      if c.contact_class == types.CONTACT_CLASS_VESSEL][0]
            found = self.find(server, 100, 0, depth_m=5, second=60)
            self.assertEqual((found.source_id, found.contact_id),
                             ("c4i", "ship"))
            # 400 m + 60 s x 5 m/s less its radius.
            self.assertAlmostEqual(found.distance_m,
                                   700 - vessel.radius_m, delta=2)
            self.assertAlmostEqual(found.bearing_deg, 90, delta=0.5)
            self.assertEqual(found.answer.contacts[0].contact_id, "ship")
            self.assertFalse(self.find(server, 100, 0, depth_m=20,
                                       second=60, confidence=0.99,
                                       radius_m=900).found)

    def test_a_long_search_has_a_limit_and_ends_when_it_is_not_wanted(self):
        with self.new_mission() as server:
            # 7 million cells of water of 30 m +- 4 m and a vehicle at 31 m:
            # none may be skipped, P = Phi(0.25) = 0.6, none is OCCUPIED.
            import_chart(server)
            start_activity(server, south_west=point(-900, -900),
                           north_extent_m=2300, east_extent_m=3100,
                           cell_size_m=1)
            long = search(250, 650, depth_m=31, radius_m=3000)
            call = server.obstacle.FindNearestObstacle
            begin = time.monotonic()
            error = self.assert_status(grpc.StatusCode.RESOURCE_EXHAUSTED,
                                       call, long)
            whole_s = time.monotonic() - begin
            self.assertIn("search_radius_m", error.details())
            limit = server.status().limits.max_search_cells
            self.assertIn(str(limit), error.details())
            # Eight of them, four a thread, are cancelled; were they worked
            # on, a question after them would wait for two at least.
            begin = time.monotonic()
            running = [call.future(long, timeout=DEADLINE_S)
                       for _ in range(4)]
            running += [call.future(long, timeout=0.02) for _ in range(4)]
            for future in running[4:]:
                self.assertEqual(future.exception().code(),
                                 grpc.StatusCode.DEADLINE_EXCEEDED)
            for future in running[:4]:
                self.assertTrue(future.cancel())
            cancelled = time.monotonic()
            self.find(server, 250, 650, depth_m=5, radius_m=10)
            waited_s = time.monotonic() - cancelled
            print(f"a whole search {1000 * whole_s:.0f} ms; a question after "
                  f"eight that were cancelled {1000 * waited_s:.1f} ms")
            self.assertLess(waited_s, whole_s)


class Trajectories(LiveTest):

    def check(self, server, trajectory, **kwargs):
        return server.obstacle.CheckTrajectory(
            obstacle.CheckTrajectoryRequest(trajectory=trajectory, **kwargs),
            timeout=DEADLINE_S)

    def test_a_wall_is_met_on_the_right_leg_at_the_right_time(self):
        with self.new_mission() as server:
            survey_with_wall(server)
            # North along east 105 m, then east at 2 m/s along north 255 m:
            # the wall's cells begin at east 300 m, so a vehicle of 5 m
            # touches them at east 295 m: 20 s + 190 m / 2 m/s = 115 s.
            trajectory = path((215, 105, 10, 0), (255, 105, 10, 20),
                              (255, 455, 10, 195), (275, 455, 10, 205),
                              radius_m=5)
            verdict = self.check(server, trajectory)
            self.assertEqual(verdict.state, OCCUPIED)
            self.assertEqual([leg.state for leg in verdict.legs],
                             [FREE, OCCUPIED, FREE])
            conflict = verdict.first_conflict
            self.assertEqual(conflict.leg_index, 1)
            self.assertEqual(conflict.depth_m, 10)
            met_s = (conflict.time.seconds + conflict.time.nanos * 1e-9
                     - at(0).seconds)
            # Told no later, and earlier by what the cell's corner reaches
            # beyond its side at most: (sqrt(1/2) - 1/2) 10 m / 2 m/s.
            self.assertLess(met_s, 115.1)
            self.assertGreater(met_s, 115 - 1.036 - 0.1)
            self.assertEqual(conflict.answer.state, OCCUPIED)
            self.assertEqual(conflict.answer.seabed.activity_id, "bay")
            self.assertGreater(verdict.legs[1].worst_probability, 0.99)
            # 30 m of chart under 10 m; 3 m (fused with the chart) at the wall.
            self.assertAlmostEqual(verdict.legs[0].least_clearance_m, 20,
                                   delta=0.1)
            self.assertAlmostEqual(verdict.legs[1].least_clearance_m, -7,
                                   delta=0.2)
            first = self.check(server, trajectory, stop_at_first=True)
            self.assertEqual(len(first.legs), 2)
            self.assertEqual(first.first_conflict, conflict)
            # Over it at 1 m, and past its southern end, it is free.
            for free in (path((255, 105, 1, 0), (255, 455, 1, 175)),
                         path((150, 105, 10, 0), (150, 455, 10, 175),
                              radius_m=5)):
                verdict = self.check(server, free)
                self.assertEqual(verdict.state, FREE)
                self.assertFalse(verdict.HasField("first_conflict"))

    def test_own_uncertainty_widens_the_way(self):
        with self.new_mission() as server:
            survey_with_wall(server)
            # 25 m south of the wall's end at north 200 m. w = r + s
            # sqrt(-2 ln 0.05) = 2.448 s: 24.5 m at 10 m, 29.4 m at 12 m.
            for std_m, state in [(0, FREE), (10, FREE), (12, OCCUPIED)]:
                verdict = self.check(server, path(
                    (175, 105, 10, 0), (175, 455, 10, 175),
                    position_std_m=std_m))
                self.assertEqual(verdict.state, state, std_m)

    def test_unknown_counts_as_it_is_asked(self):
        with self.new_mission() as server:
            import_chart(server)
            # The chart ends 1000 m west of the corner.
            away = [(250, -500, 5, 0), (250, -1500, 5, 500)]
            free = self.check(server, path(*away))
            self.assertEqual(free.state, FREE)
            for unknown in (AS_OCCUPIED,
                            obstacle.UNKNOWN_TREATMENT_UNSPECIFIED):
                verdict = self.check(server, path(*away, unknown=unknown))
                self.assertEqual(verdict.state, UNKNOWN)
                conflict = verdict.first_conflict
                self.assertEqual(conflict.answer.state, UNKNOWN)
                # 500 m at 2 m/s, cells of 10 m and coarser.
                met_s = conflict.time.seconds - at(0).seconds
                self.assertAlmostEqual(met_s, 250, delta=12)

    def test_a_contact_that_crosses_is_met_in_time_or_not_at_all(self):
        with self.new_mission() as server:
            import_chart(server)
            # A ship goes east at 5 m/s along north 100 m; at 100 s it is at
            # east 500 m.
            report_contacts(server, [fix_report(1, 100, 0)])
            crossing = path((-100, 500, 3, 0), (300, 500, 3, 200), radius_m=2,
                            confidence=0.6)
            verdict = self.check(server, crossing)
            self.assertEqual(len(verdict.approaches), 1)
            approach = verdict.approaches[0]
            self.assertEqual((approach.source_id, approach.contact_id),
                             ("c4i", "ship"))
            self.assertAlmostEqual(approach.time.seconds - at(0).seconds, 100,
                                   delta=2)
            self.assertLess(approach.distance_m, 5)
            self.assertGreater(verdict.legs[0].worst_probability, 0.05)
            # A minute later it is 300 m further.
            late = path((-100, 500, 3, 600), (300, 500, 3, 800), radius_m=2)
            verdict = self.check(server, late)
            self.assertEqual(verdict.state, FREE)
            # Deep below its keel it does not matter.
            deep = path((-100, 500, 20, 0), (300, 500, 20, 200), radius_m=2)
            self.assertLess(
                self.check(server, deep).legs[0].worst_probability, 0.01)

    def test_waypoints_at_the_limit_and_past_it(self):
        with self.new_mission() as server:
            import_chart(server)
            limit = server.status().limits.max_waypoints
            places = [(100 + i % 100, 100, 5, i) for i in range(limit + 1)]
            verdict = self.check(server, path(*places[:limit]))
            self.assertEqual(len(verdict.legs), limit - 1)
            error = self.assert_status(
                grpc.StatusCode.RESOURCE_EXHAUSTED,
                server.obstacle.CheckTrajectory,
                obstacle.CheckTrajectoryRequest(trajectory=path(*places)))
            self.assertIn("trajectory.waypoints", error.details())
            self.assertIn(str(limit), error.details())

    def test_it_reads_ones_own_writes(self):
        with self.new_mission() as server:
            survey_with_wall(server)
            revision = server.status().stamp.map_revision
            way = path((255, 105, 10, 0), (255, 455, 10, 175))
            verdict = self.check(server, way, min_revision=revision)
            self.assertGreaterEqual(verdict.stamp.map_revision, revision)
            with self.assertRaises(grpc.RpcError) as caught:
                server.obstacle.CheckTrajectory(
                    obstacle.CheckTrajectoryRequest(
                        trajectory=way, min_revision=revision + 1),
                    timeout=0.5)
            self.assertIn(caught.exception.code(),
                          (grpc.StatusCode.UNAVAILABLE,
                           grpc.StatusCode.DEADLINE_EXCEEDED))


if __name__ == "__main__":
    unittest.main()
