"""The command lines `fathom` and `fathom-feeder` against a live server: what
they print, with and without --json, and how they end."""

import json
import os
import pathlib
import subprocess
import unittest

from live_server import (CREATE, DEADLINE_S, FATHOM, FEEDER, LiveTest, Server)

OK, USAGE, REFUSED, UNREACHABLE, BAD_FILE, CONFLICT, UNCERTAIN = range(7)
ETOPO = pathlib.Path("/usr/share/ferret-vis/data/etopo5.cdf")


def run(program, *arguments, stdin="", server=None):
    environment = {k: v for k, v in os.environ.items()
                   if k != "FATHOM_SERVER"}
    if server:
        environment["FATHOM_SERVER"] = server.address
    return subprocess.run([program, *map(str, arguments)], input=stdin,
                          capture_output=True, text=True, check=False,
                          env=environment, timeout=4 * DEADLINE_S)


class Commands(LiveTest):

    @classmethod
    def setUpClass(cls):
        cls.holder = LiveTest()
        cls.holder.setUp()
        cls.folder_of_class = cls.holder.folder
        cls.server = cls.holder.new_mission()
        # 20 x 20 cells of 0.001 degrees about 41.5 N 71.4 W, elevation -30 m;
        # the southernmost row is land.
        cls.chart = cls.folder_of_class / "flat.asc"
        rows = [" ".join(["-30"] * 20)] * 19 + [" ".join(["5"] * 20)]
        cls.chart.write_text(
            "ncols 20\nnrows 20\nxllcorner -71.41\nyllcorner 41.49\n"
            "cellsize 0.001\nNODATA_value -9999\n" + "\n".join(rows) + "\n")
        done = run(FATHOM, "prior", "import", cls.chart, "--crs", "EPSG:4326",
                   "--positive", "up", "--std-m", 4, server=cls.server)
        assert done.returncode == OK, done.stderr
        assert "380 cells with depth, 20 land" in done.stdout, done.stdout

    @classmethod
    def tearDownClass(cls):
        exit_code = cls.server.terminate()
        cls.holder.doCleanups()
        assert exit_code == 0

    def fathom(self, *arguments, code=OK, stdin="", said=True):
        done = run(FATHOM, *arguments, stdin=stdin, server=self.server)
        self.assertEqual(done.returncode, code, (arguments, done.stdout,
                                                 done.stderr))
        if code != OK and said:
            self.assertTrue(done.stderr, "a failure says why")
        return done.stdout

    def both(self, *arguments, stdin=""):
        """Output for people, and the JSON document."""
        text = self.fathom(*arguments, stdin=stdin)
        self.assertTrue(text)
        return text, json.loads(self.fathom(*arguments, "--json",
                                            stdin=stdin))

    def test_status_and_mission(self):
        text, document = self.both("status")
        self.assertIn("MLLW", text)
        self.assertEqual(document["vertical_datum"], "MLLW")
        self.assertGreater(int(document["global_map"]["leaves"]), 0)
        document = json.loads(self.fathom("status", "--digest", "--json"))
        self.assertRegex(document["map_digest"], "^[0-9a-f]{16}$")
        text, document = self.both("mission", "info")
        self.assertIn("MLLW", text)

    def test_prior(self):
        arguments = ("prior", "import", self.chart, "--crs", "EPSG:4326",
                     "--positive", "up", "--std-m", 4)
        # The mission holds this chart already.
        document = json.loads(self.fathom(*arguments, "--json"))
        self.assertTrue(document["already_loaded"])
        document = json.loads(self.fathom(*arguments, "--again", "--json"))
        self.assertEqual(document["chart"]["cells_with_depth"], 380)
        self.assertEqual(int(document["import"]["cells_land"]), 20)
        # A dry run needs no server.
        done = run(FATHOM, "--server", "127.0.0.1:1", *arguments, "--dry-run",
                   "--json")
        self.assertEqual(done.returncode, OK, done.stderr)
        self.assertEqual(json.loads(done.stdout)["chart"]["cells_land"], 20)

    def test_query(self):
        # P(D <= 26), D ~ N(30, 4^2): Phi(-1) = 0.158655.
        text, document = self.both("query", "--at", "41.5,-71.4",
                                   "--depth-m", 26)
        self.assertIn("UNCERTAIN", text)
        self.assertIn("0.158655", text)
        self.assertAlmostEqual(document["answer"]["probability"], 0.158655, 5)
        # 26 m below a surface 2 m above datum is 24 m: Phi(-1.5) = 0.066807.
        document = json.loads(self.fathom(
            "query", "--at", "41.5,-71.4", "--depth-m", 26,
            "--water-level-m", 2, "--json"))
        self.assertAlmostEqual(document["answer"]["probability"], 0.066807, 5)
        text = self.fathom("query", "--at", "41.495,-71.45", "--depth-m", 1)
        self.assertIn("UNKNOWN", text)

    def test_query_of_a_file(self):
        points = "41.5,-71.4,26\n41.4905,-71.4005,1\n41.5,-71.45,35\n"
        text, document = self.both("query", "--points-file", "-",
                                   stdin=points)
        lines = text.splitlines()
        self.assertEqual(len(lines), 4, "a header and three answers")
        self.assertEqual([line.split(",")[4] for line in lines[1:]],
                         ["UNCERTAIN", "OCCUPIED", "UNKNOWN"])
        self.assertEqual([a["state"] for a in document["answers"]],
                         ["OBSTACLE_STATE_UNCERTAIN",
                          "OBSTACLE_STATE_OCCUPIED",
                          "OBSTACLE_STATE_UNKNOWN"])
        self.assertIsNone(document["answers"][2]["mean_depth_m"])

    def test_nearest(self):
        # The chart's southernmost row is land: up to 41.491 N, 111.06 km a
        # degree: 1000 m south of 41.5 N.
        arguments = ("nearest", "--at", "41.5,-71.4", "--depth-m", 10,
                     "--unknown-is-free")
        text, document = self.both(*arguments)
        self.assertIn("OCCUPIED", text)
        self.assertIn("land", text)
        self.assertTrue(document["found"])
        self.assertAlmostEqual(document["distance_m"], 999.5, delta=42)
        self.assertAlmostEqual(document["bearing_deg"], 180, delta=1)
        text, document = self.both(*arguments, "--radius-m", 900)
        self.assertIn("nothing within 900 m", text)
        self.assertFalse(document["found"])
        # The chart ends 0.01 degree west and east: 835 m, give or take half
        # a leaf of its 83 m cells.
        document = json.loads(self.fathom(
            "nearest", "--at", "41.5,-71.4", "--depth-m", 10, "--json"))
        self.assertEqual(document["answer"]["state"],
                         "OBSTACLE_STATE_UNKNOWN")
        self.assertAlmostEqual(document["distance_m"], 835, delta=42)
        self.fathom("nearest", "--at", "41.5", "--depth-m", 10, code=USAGE)
        self.fathom("nearest", "--at", "41.5,-71.4", "--depth-m", 10,
                    "--radius-m", 50001, code=REFUSED)

    def test_check(self):
        # South along 71.4 W from 41.5 N over 30 m +- 4 m of water to the
        # land, which begins at 41.491 N: 1000 m.
        plan = ("lat,lon,depth,time\n41.500,-71.4,10,now\n"
                "41.495,-71.4,10,+5min\n41.4905,-71.4,10,+10min\n")
        text = self.fathom("check", "-", stdin=plan, code=CONFLICT,
                           said=False)
        self.assertIn("first conflict on leg 1", text)
        self.assertIn("land", text)
        document = json.loads(self.fathom("check", "-", "--json", stdin=plan,
                                          code=CONFLICT, said=False))
        self.assertEqual(document["state"], "OBSTACLE_STATE_OCCUPIED")
        self.assertEqual(document["first_conflict"]["leg_index"], 1)
        self.assertEqual(len(document["legs"]), 2)
        # GeoJSON at 2 m/s, 10 m deep: free. At 26 m P = Phi(-1) = 0.16.
        line = {"type": "LineString",
                "coordinates": [[-71.4, 41.5, -10], [-71.4, 41.499, -10]]}
        text = self.fathom("check", "-", "--speed-m-s", 2,
                           stdin=json.dumps(line))
        self.assertIn("FREE", text)
        for place in line["coordinates"]:
            place[2] = -26
        text = self.fathom("check", "-", "--speed-m-s", 2,
                           stdin=json.dumps(line), code=UNCERTAIN, said=False)
        self.assertIn("UNCERTAIN", text)
        # Unknown water west of the chart, asked both ways.
        away = "41.5,-71.45,5,now\n41.501,-71.45,5,+5min\n"
        self.fathom("check", "-", stdin=away, code=CONFLICT, said=False)
        self.fathom("check", "-", "--unknown-is-free", stdin=away)
        self.fathom("check", "-", stdin="41.5,-71.45,5,now\n",
                    code=BAD_FILE)
        self.fathom("check", "-", "--radius-m", 1001, stdin=away,
                    code=REFUSED)

    def test_activity(self):
        area = ("--south-west", "41.496,-71.404", "--size-m", 200)
        self.assertIn("one", self.fathom("activity", "start", "one", *area))
        document = json.loads(self.fathom("activity", "start", "two", *area,
                                          "--json"))
        self.assertEqual(document["activity"]["cells_north"], 20)
        text, document = self.both("activity", "list")
        self.assertIn("two", text)
        self.assertLessEqual({"one", "two"}, {
            a["activity_id"] for a in document["activities"]})
        text, document = self.both("activity", "transfer", "one")
        self.assertEqual(int(document["transfer"]["local_cells"]), 0)
        self.assertIn("ended", self.fathom("activity", "complete", "one"))
        document = json.loads(self.fathom("activity", "complete", "two",
                                          "--discard", "--json"))
        self.assertIn("map_revision", document)
        self.fathom("activity", "complete", "two", code=REFUSED)

    def test_contacts(self):
        time = "2026-01-01T12:00:00Z"
        report = ("contacts", "report", "bridge/ferry", "--at",
                  "41.505,-71.4", "--class", "vessel", "--velocity-east-m-s",
                  "5", "--time", time)
        self.assertIn("bridge/ferry", self.fathom(*report))
        text, document = self.both("contacts", "list", "--time",
                                   "2026-01-01T12:01:00Z")
        self.assertIn("bridge/ferry", text)
        ferry = [c for c in document["contacts"]
                 if c["contact_id"] == "ferry"][0]
        # 60 s at 5 m/s east: 300 m / 83 490 m per degree = 0.00359 degrees.
        self.assertAlmostEqual(ferry["position"]["longitude_deg"],
                               -71.4 + 0.00359, 4)
        text, document = self.both("contacts", "history", "bridge/ferry")
        self.assertEqual(len(document["estimates"]), 1)
        text = self.fathom("query", "--at", "41.505,-71.4", "--depth-m", 1,
                           "--time", time)
        self.assertIn("OCCUPIED", text)
        self.assertIn("ferry", text)
        self.fathom("contacts", "drop", "bridge/ferry")
        self.fathom("contacts", "drop", "bridge/nobody", code=REFUSED)
        self.fathom("contacts", "history", "bridge/nobody", code=REFUSED)

    def test_render(self):
        picture = self.folder / "map.png"
        area = ("--area", "41.485,-71.415,41.515,-71.385", "--width-px", 600)
        self.fathom("render", *area, "--out", picture)
        content = picture.read_bytes()
        # PNG signature, then IHDR with the width, big-endian.
        self.assertEqual(content[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(int.from_bytes(content[16:20], "big"), 600)
        document = json.loads(self.fathom("render", *area, "--json", "--out",
                                          self.folder / "second.png"))
        self.assertTrue(document)
        self.fathom("render", *area, "--out", "/nonexistent/map.png",
                    code=BAD_FILE)

    def test_wrong_command_lines_send_nothing(self):
        for arguments in (["nonsense"], [], ["query"],
                          ["query", "--at", "95,0", "--depth-m", "1"],
                          ["query", "--at", "41.5,-71.4", "--depth-m", "x"],
                          ["query", "--at", "41.5,-71.4", "--depth-m", "1",
                           "--time", "yesterday"],
                          ["activity", "start"],
                          ["contacts", "report", "a/b", "--at", "0,0",
                           "--class", "whale"]):
            with self.subTest(arguments=arguments):
                self.fathom(*arguments, code=USAGE)

    def test_what_the_server_refuses(self):
        self.fathom("query", "--at", "41.5,-71.4", "--depth-m", 1,
                    "--confidence", "0.2", code=REFUSED)
        self.fathom("activity", "start", "far", "--center", "10,10",
                    "--size-m", 100, code=REFUSED)

    def test_nobody_answers(self):
        done = run(FATHOM, "--server", "127.0.0.1:1", "--timeout-s", 2,
                   "status")
        self.assertEqual(done.returncode, UNREACHABLE)
        self.assertIn("127.0.0.1:1", done.stderr)

    def test_bad_files(self):
        text = self.folder / "text.tif"
        text.write_text("no raster")
        for path in (self.folder / "missing.tif", text):
            with self.subTest(path=path):
                self.fathom("prior", "import", path, "--std-m", 1,
                            code=BAD_FILE)
        self.fathom("query", "--points-file", self.folder / "missing.csv",
                    code=BAD_FILE)
        self.fathom("query", "--points-file", "-", stdin="41.5,-71.4\n",
                    code=BAD_FILE)

    def test_every_verb_helps(self):
        for verb in ("status", "mission", "activity", "query", "contacts",
                     "prior", "render"):
            self.assertIn("Usage", self.fathom(verb, "--help"))


class Feeder(LiveTest):

    @unittest.skipUnless(ETOPO.exists(), f"{ETOPO} is not installed")
    def test_a_short_survey_and_its_evaluation(self):
        truth = ("--etopo", "--center", "41.3,-71.3", "--relief-std-m", 2)
        # A mission wide enough for the feeder's area about 41.3 N 71.3 W.
        with Server(self.folder / "m.fathom", *CREATE[:4], "60",
                    *CREATE[5:]) as server:
            done = run(FEEDER, "run", "--server", server.address, "--activity",
                       "survey", *truth, "--auto-area", 300, "--json",
                       "--complete", "--start-time", "2026-01-01T00:00:00Z")
            self.assertEqual(done.returncode, 0, done.stderr)
            survey = json.loads(done.stdout)
            self.assertEqual(survey["activity_id"], "survey")
            record = self.folder / "survey.json"
            record.write_text(done.stdout)
            status = server.status()
            self.assertFalse(status.activities[0].open)
            self.assertGreater(status.activities[0].measurements_accepted, 500)
            self.assertGreater(status.global_map.leaves, 20)
            self.assertEqual(status.contacts.live, len(survey["ships"]))

            done = run(FEEDER, "evaluate", "--server", server.address, *truth,
                       "--survey", record, "--points", 2000, "--json")
            self.assertEqual(done.returncode, 0, done.stderr)
            score = json.loads(done.stdout)
            self.assertEqual(score["points"], 2000)
            self.assertLess(score["unknown_share"], 0.5)
            # The relief alone has 2 m; the map must know it far better.
            self.assertGreater(score["measured"]["count"], 500)
            self.assertLess(score["measured"]["rmse_m"], 1.0)
            self.assertLess(abs(score["measured"]["bias_m"]), 0.3)
            self.assertEqual(score["contacts"]["missing"], 0)

            done = run(FEEDER, "run", "--server", server.address, "--activity",
                       "survey", *truth, "--auto-area", 300, "--pings", 3)
            self.assertNotEqual(done.returncode, 0, "the id was used before")
            self.assertIn("survey", done.stderr)

    def test_how_it_fails(self):
        self.assertEqual(run(FEEDER, "--help").returncode, 0)
        for arguments, word in (
                (["run"], "--activity"),
                (["run", "--activity", "x", "--auto-area", "300",
                  "--truth", "/nonexistent.tif"],
                 "/nonexistent.tif"),
                (["evaluate", "--server", "127.0.0.1:1", "--survey",
                  "/nonexistent.json"], "/nonexistent.json")):
            with self.subTest(arguments=arguments):
                done = run(FEEDER, *arguments)
                self.assertGreater(done.returncode, 0)
                self.assertIn(word, done.stderr)


if __name__ == "__main__":
    unittest.main()
