"""Charts in and maps out through the command line and a live server: what is
exported is what the map answers, and it loads again as it was."""

import json
import math
import pathlib
import shutil
import subprocess
import unittest

from commands_test import BAD_FILE, OK, REFUSED, UNREACHABLE, USAGE, run
from live_server import (DEADLINE_S, FATHOM, LiveTest, mission, obstacle,
                         wait_until)

# 30 x 24 cells of 0.001 degrees, a slope with a hill, a strip of land in the
# south and a hole of nodata.
ROWS, COLUMNS = 24, 30
SOUTH, WEST, STEP = 41.49, -71.41, 0.001


def elevation(row, column):
    if row == ROWS - 1:
        return 4.0
    if 5 <= row < 8 and 10 <= column < 13:
        return -9999
    hill = 6 * math.exp(-((row - 12) ** 2 + (column - 20) ** 2) / 8)
    return -20 - 0.5 * column + 0.25 * row + hill


def write_chart(path):
    lines = [f"ncols {COLUMNS}", f"nrows {ROWS}", f"xllcorner {WEST}",
             f"yllcorner {SOUTH}", f"cellsize {STEP}", "NODATA_value -9999"]
    for row in range(ROWS):
        lines.append(" ".join(f"{elevation(row, column):.4f}"
                              for column in range(COLUMNS)))
    path.write_text("\n".join(lines) + "\n")


def read_xyz(path, band):
    """[(longitude, latitude, value)] of a raster, by GDAL's own tool."""
    done = subprocess.run(
        ["gdal_translate", "-q", "-of", "XYZ", "-b", str(band),
         "-a_nodata", "none", str(path), "/vsistdout/"],
        capture_output=True, text=True, check=True, timeout=DEADLINE_S)
    return [tuple(float(word) for word in line.split())
            for line in done.stdout.splitlines()]


class Export(LiveTest):

    def setUp(self):
        super().setUp()
        self.server = self.new_mission("--tolerance-m", "0.05",
                                       "--min-cell-m", "5")
        self.addCleanup(self.server.__exit__)
        self.chart = self.folder / "slope.asc"
        write_chart(self.chart)

    def fathom(self, *arguments, code=OK):
        done = run(FATHOM, *arguments, server=self.server)
        self.assertEqual(done.returncode, code, (arguments, done.stdout,
                                                 done.stderr))
        return done

    def load(self):
        self.fathom("prior", "import", self.chart, "--crs", "EPSG:4326",
                    "--positive", "up", "--std-m", 2)

    AREA = "41.492,-71.405,41.51,-71.385"

    @unittest.skipUnless(shutil.which("gdal_translate"), "gdal-bin is absent")
    def test_exported_cells_are_what_the_map_answers(self):
        self.load()
        out = self.folder / "map.tif"
        told = json.loads(self.fathom(
            "--json", "export", "--area", self.AREA, "--resolution-m", 40,
            "-o", out).stdout)
        self.assertEqual(told["driver"], "COG")
        self.assertEqual(told["vertical_datum"], "MLLW")
        self.assertGreater(told["cells_known"], 1000)
        depths = read_xyz(out, 1)
        stds = read_xyz(out, 2)
        self.assertEqual(len(depths), told["rows"] * told["columns"])
        known = [i for i, cell in enumerate(depths)
                 if not math.isnan(cell[2])]
        self.assertEqual(len(known), told["cells_known"])
        self.assertAlmostEqual(min(depths[i][2] for i in known),
                               told["min_depth_m"], places=4)
        answers = self.server.obstacle.QueryObstacles(
            obstacle.QueryObstaclesRequest(
                longitude_deg=[depths[i][0] for i in known],
                latitude_deg=[depths[i][1] for i in known],
                depth_m=[10] * len(known), confidence=0.9,
                with_reasons=True),
            timeout=DEADLINE_S)
        # GDAL's text has six digits or more of the 32-bit value.
        for at, i in enumerate(known):
            self.assertAlmostEqual(depths[i][2], answers.mean_depth_m[at],
                                   delta=1e-3)
            self.assertAlmostEqual(stds[i][2], answers.std_m[at], delta=1e-3)

    def test_an_export_loads_into_another_mission_as_it_was(self):
        self.load()
        area = ("--area", self.AREA, "--resolution-m", 40)
        for name in ("map.tif", "map.bag"):
            out = self.folder / name
            form = "bag" if name.endswith("bag") else "cog"
            first = json.loads(self.fathom("--json", "export", *area,
                                           "--format", form, "-o",
                                           out).stdout)
            checked = json.loads(run(FATHOM, "--json", "prior", "import", out,
                                     "--dry-run").stdout)["chart"]
            self.assertEqual(checked["cells_with_depth"],
                             first["cells_known"])
            self.assertEqual(checked["cells_land"], first["cells_land"])
            self.assertEqual(checked["cells_unknown"],
                             first["cells_unknown"])

    def test_a_map_does_not_differ_from_its_own_export(self):
        self.load()
        area = ("--area", self.AREA, "--resolution-m", 40)
        out = self.folder / "map.tif"
        told = json.loads(self.fathom("--json", "export", *area, "-o",
                                      out).stdout)
        picture = self.folder / "difference.png"
        drawn = json.loads(self.fathom(
            "--json", "render", *area, "--show", "depth,age,layer",
            "--against", out, "-o", picture).stdout)
        self.assertEqual(drawn["difference"]["cells"], told["cells_known"])
        self.assertEqual(drawn["difference"]["most_m"], 0)
        self.assertGreater(picture.stat().st_size, 10_000)
        # A mission whose chart is 1 m deeper everywhere.
        with self.new_mission("--tolerance-m", "0.05", "--min-cell-m", "5",
                              name="other.fathom") as other:
            lines = self.chart.read_text().splitlines()
            deeper = lines[:6] + [
                " ".join(str(float(v) - 1) if v != "-9999.0000" else v
                         for v in line.split()) for line in lines[6:]]
            chart = self.folder / "deeper.asc"
            chart.write_text("\n".join(deeper) + "\n")
            done = run(FATHOM, "prior", "import", chart, "--crs", "EPSG:4326",
                       "--positive", "up", "--std-m", 2, server=other)
            self.assertEqual(done.returncode, OK, done.stderr)
            drawn = json.loads(self.fathom(
                "--json", "render", *area, "--against-server", other.address,
                "-o", picture).stdout)
        # Conglomerated within 0.05 m each.
        self.assertAlmostEqual(drawn["difference"]["mean_m"], -1, delta=0.1)
        self.assertLessEqual(drawn["difference"]["most_m"], 1.1)

    def test_errors_say_what_to_do(self):
        out = self.folder / "map.tif"
        # Nothing is known yet.
        done = self.fathom("export", "--area", self.AREA, "-o", out,
                           code=REFUSED)
        self.assertIn("knows nothing", done.stderr)
        self.load()
        done = self.fathom("export", "--area", "41,-72,42,-71",
                           "--resolution-m", "0.5", "-o", out, code=USAGE)
        self.assertIn("--resolution-m", done.stderr)
        done = self.fathom("export", "--activity", "none", "-o", out,
                           code=REFUSED)
        self.assertIn("none", done.stderr)
        done = self.fathom("export", "--area", self.AREA, "-o",
                           self.folder / "no" / "map.tif", code=BAD_FILE)
        self.assertIn("--out", done.stderr)
        self.fathom("export", "--area", self.AREA, "--format", "bag",
                    "--bands", "age", "-o", out, code=USAGE)
        self.fathom("export", "--area", self.AREA, "--crs", "EPSG:x", "-o",
                    out, code=USAGE)
        self.assertFalse(out.exists())
        left = [p.name for p in pathlib.Path(self.folder).iterdir()
                if "part" in p.name]
        self.assertEqual(left, [])


class Import(LiveTest):
    """An import that breaks off goes on where the mission stands."""

    # 700 x 700 cells of about 8 m: tiles of 256 x 256, nine in all.
    SIDE = 700

    def setUp(self):
        super().setUp()
        self.chart = self.folder / "large.asc"
        lines = [f"ncols {self.SIDE}", f"nrows {self.SIDE}",
                 "xllcorner -71.43", "yllcorner 41.47", "cellsize 0.0001"]
        for row in range(self.SIDE):
            lines.append(" ".join(
                str(-10 - (row * 7 + column * 3) % 50 / 10)
                for column in range(self.SIDE)))
        self.chart.write_text("\n".join(lines) + "\n")
        self.arguments = ["--json", "prior", "import", str(self.chart),
                          "--crs", "EPSG:4326", "--positive", "up",
                          "--std-m", "2"]

    def load(self, server, *more, code=OK):
        done = run(FATHOM, *self.arguments, *more, server=server)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return json.loads(done.stdout), done.stderr

    def whole(self):
        """The digest that an undisturbed import gives, and its tiles."""
        with self.new_mission(name="whole.fathom") as server:
            told, _ = self.load(server)
            return server.status(digest=True).map_digest, told

    def test_the_same_chart_again_changes_nothing_and_says_so(self):
        with self.new_mission() as server:
            first, _ = self.load(server)
            self.assertFalse(first["already_loaded"])
            before = server.status(digest=True)
            second, _ = self.load(server)
            self.assertTrue(second["already_loaded"])
            self.assertEqual(second["tiles_held_before"],
                             first["chart"]["tiles"])
            self.assertNotIn("import", second)
            # Under another name it is the same chart.
            moved = self.folder / "moved.asc"
            shutil.copy(self.chart, moved)
            self.arguments[3] = str(moved)
            third, _ = self.load(server)
            self.assertEqual(third["import_id"], first["import_id"])
            after = server.status(digest=True)
            self.assertEqual(after.map_digest, before.map_digest)
            self.assertEqual(after.stamp.map_revision,
                             before.stamp.map_revision)
            # Another option is another import, and so is --again.
            other, _ = self.load(server, "--land-above", "1")
            self.assertNotEqual(other["import_id"], first["import_id"])
            again, _ = self.load(server, "--again")
            self.assertFalse(again["already_loaded"])
            self.assertEqual(again["tiles_held_before"], 0)

    def test_a_killed_client_is_resumed(self):
        digest, told = self.whole()
        with self.new_mission() as server:
            client = subprocess.Popen(
                [FATHOM, *self.arguments],
                env={"FATHOM_SERVER": server.address}, text=True,
                stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            # Killed as soon as a tile is in the map.
            wait_until(lambda: client.poll() is not None
                       or server.status().global_map.leaves > 0,
                       "the first tile")
            client.kill()
            client.communicate(timeout=DEADLINE_S)
            wait_until(lambda: self.held(server, told) > 0, "tiles held")
            resumed, notes = self.load(server)
            if resumed["tiles_held_before"] < told["chart"]["tiles"]:
                self.assertIn("resume", notes)
            self.assertGreater(resumed["tiles_held_before"], 0)
            self.assertEqual(server.status(digest=True).map_digest, digest)

    def test_a_killed_server_is_resumed(self):
        digest, told = self.whole()
        server = self.new_mission()
        client = subprocess.Popen(
            [FATHOM, *self.arguments], env={"FATHOM_SERVER": server.address},
            text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        wait_until(lambda: client.poll() is not None
                   or server.status().global_map.leaves > 0, "the first tile")
        server.kill()
        _, stderr = client.communicate(timeout=2 * DEADLINE_S)
        if client.returncode != OK:
            self.assertEqual(client.returncode, UNREACHABLE, stderr)
            self.assertIn("run the same command again", stderr)
        with self.reopen() as server:
            held = self.held(server, told)
            resumed, _ = self.load(server)
            self.assertEqual(resumed["tiles_held_before"], held)
            self.assertEqual(resumed["chart"]["tiles"],
                             told["chart"]["tiles"])
            self.assertEqual(server.status(digest=True).map_digest, digest)

    def held(self, server, told):
        return server.mission.GetImport(
            mission.GetImportRequest(import_id=told["import_id"]),
            timeout=DEADLINE_S).tiles


if __name__ == "__main__":
    unittest.main()
