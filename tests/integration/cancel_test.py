"""Work that nobody waits for any more is not gone on with: the processor time
that the server spends on a call with a tenth of the time it needs, or cancelled
after that, beside what the whole call takes it."""

import os
import time
import unittest

import grpc

from live_server import (DEADLINE_S, LiveTest, at, fix_report, import_chart,
                         ingest, obstacle, point, report_contacts,
                         start_activity, wait_until)
from questions_test import path, search

TICK_S = 1 / os.sysconf("SC_CLK_TCK")
CALLS = 4


def cpu_s(server):
    with open(f"/proc/{server.process.pid}/stat", encoding="ascii") as stat:
        fields = stat.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) * TICK_S


def at_rest(server):
    """Processor time so far, once the server does nothing more."""
    seen = [cpu_s(server)]

    def quiet():
        time.sleep(0.1)
        seen.append(cpu_s(server))
        return seen[-1] - seen[-2] < 2 * TICK_S
    wait_until(quiet, "the server to be at rest")
    return seen[-1]


def zigzag(server, waypoints):
    """10 m legs up and down 1 km x 1 km, which with 3 m to each side touch
    some 150 cells of 1 m each: 1.5 million."""
    places = []
    for k in range(waypoints):
        row, step = divmod(k, 80)
        east_m = 100 + 10 * (step if row % 2 == 0 else 79 - step)
        places.append((100 + 6 * row, east_m, 5, 10 * k))
    return obstacle.CheckTrajectoryRequest(
        trajectory=path(*places, radius_m=3))


class Cancelled(LiveTest):

    def assert_ends_early(self, server, name, call,
                          read=lambda answer: answer.result()):
        """`call(timeout)` begins one, `read` waits for all of its answer."""
        def work_s(end):
            before = at_rest(server)
            for _ in range(CALLS):
                end()
            return (at_rest(server) - before) / CALLS

        whole_s = work_s(lambda: read(call(DEADLINE_S)))
        self.assertGreater(CALLS * whole_s, 8 * TICK_S, f"{name} is too short")
        # Of the processor's time: a call that was merely kept waiting would
        # else have time enough the next time.
        cut_s = whole_s / 10

        def cut_by_deadline():
            with self.assertRaises(grpc.RpcError) as caught:
                read(call(cut_s))
            self.assertEqual(caught.exception.code(),
                             grpc.StatusCode.DEADLINE_EXCEEDED)

        def cut_by_hand():
            answer = call(DEADLINE_S)
            time.sleep(cut_s)
            answer.cancel()

        for cut in (cut_by_deadline, cut_by_hand):
            each_s = work_s(cut)
            print(f"{name}: {1000 * whole_s:.0f} ms of work; {cut.__name__} "
                  f"after {1000 * cut_s:.1f} ms: {1000 * each_s:.1f} ms")
            self.assertLess(each_s, whole_s / 2, (name, cut.__name__))

    def test_work_ends_with_the_deadline_or_the_call(self):
        with self.new_mission() as server:
            # 7 million cells of water of 30 m +- 4 m.
            import_chart(server)
            start_activity(server, south_west=point(-900, -900),
                           north_extent_m=2300, east_extent_m=3100,
                           cell_size_m=1)
            limits = server.status().limits
            self.assert_ends_early(
                server, "CheckTrajectory",
                lambda timeout, ways=zigzag(server, limits.max_waypoints):
                server.obstacle.CheckTrajectory.future(ways, timeout=timeout))
            # At 31 m none may be skipped, P = Phi(0.25) = 0.6, none counts.
            self.assert_ends_early(
                server, "FindNearestObstacle",
                lambda timeout: server.obstacle.FindNearestObstacle.future(
                    search(250, 650, depth_m=31, radius_m=800),
                    timeout=timeout))
            self.assert_ends_early(
                server, "GetRegion",
                lambda timeout: server.obstacle.GetRegion(
                    obstacle.GetRegionRequest(
                        south_west=point(0, 0), north_east=point(1000, 1000),
                        resolution_m=1), timeout=timeout), read=list)
            # Near ten contacts, each of which is reckoned with.
            report_contacts(server, [
                fix_report(k, 50 * k, 500, ve=0.0, contact=f"ship{k}")
                for k in range(1, 11)])
            points = limits.max_points_per_query
            batch = obstacle.QueryObstaclesRequest(
                latitude_deg=[point(250, 500).latitude_deg] * points,
                longitude_deg=[point(250, 500).longitude_deg] * points,
                depth_m=[1.0] * points, time=at(60), confidence=0.95,
                radius_m=500)
            self.assert_ends_early(
                server, "QueryObstacles",
                lambda timeout: server.obstacle.QueryObstacles.future(
                    batch, timeout=timeout))

    def test_a_history_is_not_read_for_nobody(self):
        reports = 60_000
        with self.new_mission() as server:
            list(server.ingest.StreamContacts(
                (ingest.StreamContactsRequest(report=fix_report(
                    k, 0, 5 * k, second=k)) for k in range(1, reports + 1)),
                timeout=DEADLINE_S))
            request = obstacle.GetContactHistoryRequest
            ways = {
                "of one contact": request(source_id="c4i", contact_id="ship"),
                "of an area": request(south_west=point(-1000, -1000),
                                      north_east=point(1000, 5 * reports))}
            for name, way in ways.items():
                self.assertEqual(sum(
                    len(part.estimates) for part in
                    server.obstacle.GetContactHistory(way)), reports, name)
                self.assert_ends_early(
                    server, f"GetContactHistory {name}",
                    lambda timeout, way=way:
                    server.obstacle.GetContactHistory(way, timeout=timeout),
                    read=list)


if __name__ == "__main__":
    unittest.main()
