"""The programs of client/examples as their heads say they are run, each
against a live server, and what they find held against the scene."""

import math
import os
import pathlib
import re
import subprocess
import sys
import unittest

import node_tools
from live_server import (AREA, DEADLINE_S, M_PER_LAT, M_PER_LON, ROOT,
                         LiveTest, chart_tile, fix_report, import_chart,
                         mission, ping, point, report_contacts, send_pings,
                         start_activity, types)

EXAMPLES = ROOT / "client" / "examples"
BUILT = pathlib.Path(os.environ["FATHOM_EXAMPLES"])

# A wall of 3 m in 30 m of water, across the whole activity.
WALL_EAST_M = 250.0
WALL_NORTH_M = (0.0, 500.0)
RADIUS_M = 5.0


def survey_with_wall(server, std_m=1.0):
    import_chart(server, chart_tile(std_m=std_m))
    start_activity(server)
    send_pings(server, [ping(1, [(5.0 + 10 * k, WALL_EAST_M + 5, 3.0, 0.05)
                                 for k in range(50)])])


def text_of(north_m, east_m):
    place = point(north_m, east_m)
    return f"{place.latitude_deg:.7f},{place.longitude_deg:.7f}"


def places_in(text):
    """(north_m, east_m) of each line that begins with LAT,LON."""
    return [((float(lat) - AREA[0]) * M_PER_LAT,
             (float(lon) - AREA[1]) * M_PER_LON)
            for lat, lon in re.findall(r"^ *(-?[\d.]+),(-?[\d.]+) ", text,
                                       re.MULTILINE)]


def length_m(places):
    return sum(math.dist(a, b) for a, b in zip(places, places[1:]))


def wall_distance_m(a, b, wall_north_m=WALL_NORTH_M):
    """Least distance of the leg a-b from the wall's cells, every few metres."""
    steps = 200
    return min(
        math.hypot(max(wall_north_m[0] - n, 0, n - wall_north_m[1]),
                   max(WALL_EAST_M - e, 0, e - WALL_EAST_M - 10))
        for n, e in ((a[0] + (b[0] - a[0]) * i / steps,
                      a[1] + (b[1] - a[1]) * i / steps)
                     for i in range(steps + 1)))


class Examples(LiveTest):

    def run_example(self, *command, code=0, **environment):
        done = subprocess.run(
            [str(word) for word in command], capture_output=True, text=True,
            check=False, timeout=4 * DEADLINE_S,
            env=dict(os.environ, **environment))
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout

    def assert_goes_round(self, places):
        for a, b in zip(places, places[1:]):
            # The metres per degree here are good to 0.1 %: 0.5 m in 500 m.
            self.assertGreater(wall_distance_m(a, b), RADIUS_M - 0.5, (a, b))
        self.assertTrue(any(not 0 <= north <= 500 for north, _ in places))

    def test_planner_finds_the_shortest_way_round_a_wall(self):
        with self.new_mission() as server:
            survey_with_wall(server)
            printed = self.run_example(BUILT / "planner", server.address,
                                       text_of(200, 50), text_of(200, 450),
                                       10)
            places = places_in(printed)
            self.assertLess(math.dist(places[0], (200, 50)), 10)
            self.assertLess(math.dist(places[-1], (200, 450)), 10)
            self.assert_goes_round(places)
            # Round the southern end with 10 m to spare: 2 hypot(210, 200) =
            # 580 m; cells of 10 m cost a few more.
            self.assertGreater(length_m(places), 575)
            self.assertLess(length_m(places), 640)

    def test_planner_says_when_there_is_no_way(self):
        with self.new_mission() as server:
            survey_with_wall(server)
            printed = self.run_example(
                BUILT / "planner", server.address, text_of(200, 50),
                text_of(200, WALL_EAST_M + 5), 10, code=3)
            self.assertIn("no way", printed)

    def test_planner_goes_round_what_moves_there(self):
        """A container drifts on the straight way: only CheckTrajectory
        knows."""
        with self.new_mission() as server:
            import_chart(server, chart_tile(std_m=1.0))
            report = fix_report(1, 200, 250, ve=0.0, contact="container")
            report.contact_class = types.CONTACT_CLASS_DRIFTING
            report.fix.velocity_std_m_s = 0.05
            report.time.GetCurrentTime()
            report_contacts(server, [report])
            printed = self.run_example(BUILT / "planner", server.address,
                                       text_of(200, 50), text_of(200, 450), 1)
            self.assertIn("refused", printed)
            places = places_in(printed)
            self.assertGreater(len(places), 2)
            self.assertGreater(length_m(places), 400)

    def test_planner_replans_when_its_way_is_no_longer_safe(self):
        wall_north_m = (190.0, 220.0)
        start, goal = (205, 205), (205, 305)
        with self.new_mission() as server:
            import_chart(server, chart_tile(std_m=1.0))
            start_activity(server)
            lines = []
            with subprocess.Popen(
                    [str(BUILT / "planner"), server.address,
                     text_of(*start), text_of(*goal), "10", "--go"],
                    stdout=subprocess.PIPE, text=True) as planner:
                self.addCleanup(planner.kill)
                for line in planner.stdout:
                    lines.append(line)
                    places = places_in("".join(lines))
                    if places and math.dist(places[-1], goal) < 10:
                        break
                # Under way, it meets a wall: 3 cells of 10 m, 45 m ahead.
                send_pings(server, [ping(1, [
                    (north_m, WALL_EAST_M + 5, 3.0, 0.05)
                    for north_m in (195.0, 205.0, 215.0)])])
                lines += planner.stdout.readlines()
            printed = "".join(lines)
            self.assertEqual(planner.returncode, 0, printed)
            before, after = printed.split("alert: stopped at ")
            self.assertTrue(after.endswith("arrived\n"), printed)
            old, new = places_in(before), places_in(after)
            self.assertEqual(min(wall_distance_m(a, b, wall_north_m)
                                 for a, b in zip(old, old[1:])), 0)
            for a, b in zip(new, new[1:]):
                self.assertGreater(wall_distance_m(a, b, wall_north_m),
                                   RADIUS_M - 0.5, printed)
            # It had not come far; cells of 10 m.
            self.assertLess(math.dist(new[0], old[0]), 40)
            self.assertLess(math.dist(new[-1], goal), 10)

    def test_map_matching_recovers_a_drift_of_40_m(self):
        def depth_m(north_m, east_m):
            return (25 + 4 * math.sin(north_m / 40) * math.cos(east_m / 55)
                    + 2 * math.sin((north_m + 2 * east_m) / 70))

        def survey(server, name, source, drift):
            """Every cell of the activity once, from a vehicle that is
            `drift` away from where it believes to be, on a tide that is 0.4 m
            higher for the second."""
            beams = []
            for i in range(60):
                for j in range(60):
                    n, e = 10 * i + 5, 10 * j + 5
                    beams.append((n, e, depth_m(n + drift[0], e + drift[1])
                                  + (0.4 if drift[0] else 0), 0.1))
            start_activity(server, name, north_extent_m=600,
                           east_extent_m=600,
                           estimator=mission.ESTIMATOR_ADAPTIVE)
            ack, _ = send_pings(server, [
                ping(k + 1, beams[100 * k:100 * k + 100], source=source,
                     activity=name) for k in range(36)])
            self.assertEqual(ack.measurements_accepted, 3600)

        with self.new_mission() as server:
            survey(server, "first", "uuv-1", (0.0, 0.0))
            server.mission.CompleteActivity(
                mission.CompleteActivityRequest(activity_id="first"),
                timeout=DEADLINE_S)
            drift = (24.0, -32.0)  # 40 m.
            survey(server, "second", "uuv-2", drift)
            printed = self.run_example(BUILT / "map_matching", server.address,
                                       "second")
            found = re.search(r"add (-?[\d.]+) m north and (-?[\d.]+) m east",
                              printed)
            error_m = math.dist(drift, [float(x) for x in found.groups()])
            print(f"map matching: 40 m of drift recovered to {error_m:.1f} m")
            self.assertLess(error_m, 10, printed)

    def test_map_matching_refuses_a_flat_floor(self):
        with self.new_mission() as server:
            for name in ("first", "second"):
                start_activity(server, name)
                send_pings(server, [
                    ping(k + 1, [(10 * k + 5, 10 * j + 5, 25.0 + 0.01 *
                                  ((7 * k + 3 * j) % 5), 0.1)
                                 for j in range(50)], source=name,
                         activity=name) for k in range(50)])
                if name == "first":
                    server.mission.CompleteActivity(
                        mission.CompleteActivityRequest(activity_id=name),
                        timeout=DEADLINE_S)
            printed = self.run_example(BUILT / "map_matching", server.address,
                                       "second", code=3)
            self.assertIn("flat", printed)

    def test_avoidance_reaches_its_goal_round_a_wall(self):
        with self.new_mission() as server:
            survey_with_wall(server)
            printed = self.run_example(
                sys.executable, EXAMPLES / "avoidance.py", server.address,
                text_of(100, 50), text_of(100, 450), 10,
                PYTHONPATH=os.environ["FATHOM_STUBS"])
            self.assertIn("arrived", printed)
            self.assert_goes_round([(100.0, 50.0)] + places_in(printed))

    def test_avoidance_holds_where_nothing_is_known(self):
        with self.new_mission() as server:
            printed = self.run_example(
                sys.executable, EXAMPLES / "avoidance.py", server.address,
                text_of(100, 50), text_of(100, 450), 10, code=3,
                PYTHONPATH=os.environ["FATHOM_STUBS"])
            self.assertNotIn("heading", printed)
            self.assertIn("holding: the sea floor 0 m away", printed)

    def test_situation_draws_floor_contacts_and_the_nearest(self):
        node_tools.install()
        with self.new_mission() as server:
            survey_with_wall(server)
            report = fix_report(1, 625, 655, vn=0.0, ve=0.0)
            report.time.GetCurrentTime()
            report_contacts(server, [report])
            printed = self.run_example(
                "node", EXAMPLES / "situation.js", server.address,
                ROOT / "proto", text_of(250, 130), 10,
                NODE_PATH=node_tools.NODE / "node_modules")
            lines = printed.splitlines()
            chart = lines[:40]
            # 50 m a sign; the place is at row and column 20, and each sign
            # stands for the middle of its square. The wall, 0 to 500 m north
            # at 255 m east: column 22 (130 + 125), rows 15 to 24.
            self.assertEqual(chart[20][20], "@")
            for row in (15, 24):
                self.assertEqual(chart[row][21:24], ".#.", printed)
            self.assertEqual(chart[25][21:24], "...", printed)
            # The ship, 375 m north and 525 m east: row 20 - 7.5, column 30.5.
            self.assertEqual(chart[12][30], "A", printed)
            self.assertIn("1 contacts", printed)
            self.assertIn("A c4i/ship 0.0 m/s north, 0.0 m/s east", printed)
            # The wall's cells begin at east 250: 120 m away.
            self.assertIn("nearest: sea floor 120 m, bearing 90", printed)


if __name__ == "__main__":
    unittest.main()
