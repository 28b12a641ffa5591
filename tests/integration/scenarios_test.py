"""The scenarios that ship, each against a live server of its own: they must
meet their own expectations. bad_day's link is cut on top."""

import csv
import json
import math
import pathlib
import struct
import subprocess
import unittest

from link_proxy import LinkProxy
from live_server import DEADLINE_S, FEEDER, LiveTest, Server

SCENARIOS = pathlib.Path(__file__).parents[2] / "sim_feeder" / "scenarios"
ETOPO = pathlib.Path("/usr/share/ferret-vis/data/etopo5.cdf")


def run(*arguments):
    return subprocess.run([FEEDER, "scenario", *map(str, arguments)],
                          capture_output=True, text=True,
                          timeout=4 * DEADLINE_S, check=False)


@unittest.skipUnless(ETOPO.exists(), f"{ETOPO} is not installed")
class Scenarios(LiveTest):

    def server(self, name="m.fathom", side_nmi=1267):
        return Server(self.folder / name, "--create", "--center", "41.6,-71.4",
                      "--side-nmi", str(side_nmi))

    def scenario(self, name, address, *flags):
        done = run(SCENARIOS / f"{name}.yaml", "--server", address, "--json",
                   *flags)
        self.assertEqual(done.returncode, 0, done.stderr)
        result = json.loads(done.stdout)
        self.assertEqual(result["missed"], [])
        return result

    def test_thesis_local_map(self):
        with self.server() as server:
            self.scenario("thesis_local_map", server.address)

    def test_thesis_global_map(self):
        with self.server() as server:
            self.scenario("thesis_global_map", server.address)
            # Section 6.1.2: what was local is leaves of the quadtree now.
            self.assertGreater(server.status().global_map.leaves, 100)

    def test_thesis_contact(self):
        with self.server() as server:
            out = self.folder / "evaluation"
            result = self.scenario("thesis_contact", server.address, "--out",
                                   out)
            with open(out / "tracks.csv", encoding="utf-8") as file:
                rows = list(csv.DictReader(file))
            contacts = result["evaluation"]["contacts"]
            self.assertEqual(len(rows), contacts["count"])
            # The figures are those of the rows.
            self.assertAlmostEqual(
                math.fsum(float(row["nees"]) for row in rows) / len(rows),
                contacts["nees"], 3)
            squares = [(float(row["north_m"]) - float(row["truth_north_m"]))**2
                       + (float(row["east_m"]) - float(row["truth_east_m"]))**2
                       for row in rows]
            self.assertAlmostEqual(
                math.sqrt(math.fsum(squares) / len(rows)), contacts["rmse_m"],
                1)
            picture = (out / "tracks.png").read_bytes()
            self.assertEqual(struct.unpack(">II", picture[16:24]), (800, 860))

    def test_harbour_survey(self):
        with self.server() as server:
            out = self.folder / "evaluation"
            result = self.scenario("harbour_survey", server.address, "--out",
                                   out)
            self.assertEqual(json.loads((out / "evaluation.json").read_text()),
                             result["evaluation"])
            with open(out / "places.csv", encoding="utf-8") as file:
                rows = list(csv.DictReader(file))
            self.assertEqual(len(rows), 20000)
            # The figures are those of the places.
            errors = [float(row["mean_m"]) - float(row["truth_m"])
                      for row in rows if row["kind"] == "MEASURED"]
            measured = result["evaluation"]["measured"]
            self.assertEqual(len(errors), measured["count"])
            self.assertAlmostEqual(
                math.sqrt(math.fsum(e * e for e in errors) / len(errors)),
                measured["rmse_m"], 3)
            picture = (out / "evaluation.png").read_bytes()
            # Width and height stand in a PNG's first chunk.
            self.assertEqual(struct.unpack(">II", picture[16:24]), (1600, 640))

    def test_busy_strait(self):
        with self.server() as server:
            result = self.scenario("busy_strait", server.address)
            # And the ferry.
            self.assertEqual(len(result["survey"]["ships"]), 201)

    def test_wreck_inspection(self):
        with self.server() as server:
            out = self.folder / "evaluation"
            result = self.scenario("wreck_inspection", server.address, "--out",
                                   out)
        with open(out / "places.csv", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        # Well inside the wreck: 60 m by 12 m at 45 degrees about (300, 300).
        wreck = []
        for row in rows:
            north, east = (float(row[key]) - 300
                           for key in ("north_m", "east_m"))
            if abs(north + east) < 25 and abs(north - east) < 5:
                wreck.append(row)
        # 20 000 places over 360 000 m^2, 35.4 m by 7.1 m of which are asked
        # for: 14.
        self.assertGreaterEqual(len(wreck), 7)
        for row in wreck:
            self.assertEqual(row["kind"], "MEASURED")
            # It is 6 m high; 2 m cells far from its sides do not mix.
            self.assertLess(abs(float(row["mean_m"]) - float(row["truth_m"])),
                            1)
        # The shadow gets to where the vehicle was one look of 20 s ago: at
        # 2 m/s 40 m behind it; and the last ping is up to 0.5 s, 1 m, before
        # the way's end in (60, 60).
        shadow = result["survey"]["ships"][0]
        end_s = (result["survey"]["pings"] - 1) * 0.5
        north, east = shadow["start_north_m"], shadow["start_east_m"]
        changes = [{"at_s": 0} | {key: shadow[key] for key in (
            "velocity_north_m_s", "velocity_east_m_s")},
                   *shadow["course_changes"]]
        for change, after in zip(changes, [*changes[1:], {"at_s": end_s}]):
            seconds = after["at_s"] - change["at_s"]
            north += seconds * change["velocity_north_m_s"]
            east += seconds * change["velocity_east_m_s"]
        self.assertLess(math.hypot(north - 60, east - 60), 41.01)

    def test_bad_day_with_a_link_that_is_cut(self):
        with self.server() as server:
            whole = self.scenario("bad_day", server.address, "--epoch", 1)
            digest = server.status(digest=True).map_digest
        self.assertGreater(sum(whole["survey"]["rejects"].values()), 0,
                           "crosstalk is gated")
        with self.server(name="cut.fathom") as server:
            proxy = LinkProxy(server.address, cuts=20, after_bytes=20_000)
            self.addCleanup(proxy.close)
            cut = self.scenario("bad_day", proxy.address, "--epoch", 1)
            self.assertGreaterEqual(proxy.made, 10)
            self.assertEqual(server.status(digest=True).map_digest, digest)
            self.assertEqual(cut["evaluation"], whole["evaluation"])
            # Acks that a cut swallowed are counted all the same.
            for key in ("measurements_accepted", "rejects"):
                self.assertEqual(cut["survey"][key], whole["survey"][key])

    def test_a_seed_repeats_a_run_byte_for_byte(self):
        digests = []
        for name, seed in (("a", 5), ("b", 5), ("c", 6)):
            with self.server(name=f"{name}.fathom") as server:
                self.scenario("thesis_local_map", server.address, "--seed",
                              seed, "--epoch", 1)
                digests.append(server.status(digest=True).map_digest)
        self.assertEqual(digests[0], digests[1])
        self.assertNotEqual(digests[0], digests[2])

    def test_bad_files_end_with_one_clear_line(self):
        good = (SCENARIOS / "bad_day.yaml").read_text()
        missing = self.folder / "missing_raster.yaml"
        missing.write_text(good.replace("truth: {", "truth: {raster: no.tif, "))
        # Two by two cells of nobody knows which system.
        (self.folder / "plain.asc").write_text(
            "ncols 2\nnrows 2\nxllcorner 500000\nyllcorner 4560000\n"
            "cellsize 1000\n-20 -20\n-20 -20\n")
        no_crs = self.folder / "no_crs.yaml"
        no_crs.write_text(good.replace("truth: {",
                                       "truth: {raster: plain.asc, "))
        unknown = self.folder / "unknown.yaml"
        unknown.write_text(good.replace("seed:", "sead:"))
        for arguments, word in (
                (["/nonexistent.yaml"], "cannot read /nonexistent.yaml"),
                ([missing], "no.tif"),
                ([no_crs], "plain.asc has no coordinate system"),
                ([unknown], "unknown.yaml:5: unknown key sead"),
                ([SCENARIOS / "bad_day.yaml", "--server", "127.0.0.1:1"],
                 "127.0.0.1:1")):
            with self.subTest(arguments=arguments):
                done = run(*arguments)
                self.assertGreater(done.returncode, 0)
                self.assertIn(word, done.stderr)
                self.assertLessEqual(len(done.stderr.splitlines()), 2)

    def test_an_expectation_that_is_missed_fails_the_run(self):
        strict = self.folder / "strict.yaml"
        strict.write_text(
            (SCENARIOS / "thesis_local_map.yaml").read_text()
            + "  - {figure: /measured/rmse_m, at_most: 0.001}\n")
        with self.server() as server:
            done = run(strict, "--server", server.address, "--json")
            self.assertGreater(done.returncode, 0)
            self.assertIn("/measured/rmse_m is ", done.stderr)
            self.assertEqual(len(json.loads(done.stdout)["missed"]), 1)


if __name__ == "__main__":
    unittest.main()
