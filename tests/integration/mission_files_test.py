"""Mission files that no server holds: `fathomd mission` and `fathom mission`."""

import hashlib
import json
import os
import re
import shutil
import sqlite3
import subprocess
import unittest

from live_server import (DEADLINE_S, FATHOM, FATHOMD, ROOT, LiveTest,
                         fix_report, import_chart, obstacle, ping,
                         report_contacts, send_pings, start_activity)


def run(*command):
    return subprocess.run([str(c) for c in command], capture_output=True,
                          text=True, timeout=DEADLINE_S, check=False,
                          env={**os.environ, "FATHOMD": FATHOMD})


class MissionFiles(LiveTest):

    def setUp(self):
        super().setUp()
        self.path = self.folder / "m.fathom"
        with self.new_mission() as server:
            import_chart(server)
            start_activity(server)
            send_pings(server, [ping(i, [(105, 105, 20.0 + i, 3.0)])
                                for i in range(1, 21)])
            report_contacts(server, [
                fix_report(i, 5 * i, 0, second=i,
                           contact=["ship", "boat", "once"][
                               2 if i == 9 else i % 2])
                for i in range(1, 20)])
            self.digest = server.status(digest=True).map_digest
            self.revision = server.status().stamp.map_revision
            busy = run(FATHOMD, "mission", "verify", self.path)
            self.assertEqual(busy.returncode, 1)
            self.assertIn("in use", busy.stderr)
            server.kill()  # A log is left: part of the mission.

    def verb(self, name, *arguments, code=0):
        done = run(FATHOMD, "mission", name, *arguments, "--json")
        self.assertEqual(done.returncode, code, done.stderr)
        return json.loads(done.stdout)

    def damage(self):
        self.verb("compact", self.path)  # All into one file.
        raw = sqlite3.connect(f"file:{self.path}?mode=ro", uri=True)
        [root] = raw.execute("SELECT rootpage FROM sqlite_schema WHERE name = "
                             "'tile'").fetchone()
        raw.close()
        content = bytearray(self.path.read_bytes())
        content[(root - 1) * 8192 + 4000] ^= 1
        self.path.write_bytes(content)

    def test_what_a_file_holds_is_told_and_the_file_stays_as_it_is(self):
        before = hashlib.sha256(self.path.read_bytes()).hexdigest()
        info = self.verb("info", self.path)
        self.assertEqual(info["name"], "test")
        self.assertEqual(info["vertical_datum"], "MLLW")
        self.assertEqual(info["history_rows"], 19)
        self.assertEqual(info["contacts"], 3)
        proof = self.verb("verify", self.path)
        self.assertEqual(proof["sound"], "yes")
        self.assertEqual(proof["map_digest"], self.digest)
        self.assertEqual(proof["map_revision"], self.revision)
        self.assertEqual(self.verb("digest", self.path)["map_digest"],
                         self.digest)
        self.assertEqual(
            hashlib.sha256(self.path.read_bytes()).hexdigest(), before)

    def test_the_client_hands_files_to_fathomd(self):
        done = run(FATHOM, "--json", "mission", "verify", "--file", self.path)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["map_digest"], self.digest)
        done = run(FATHOM, "mission", "digest", self.path)
        self.assertIn(self.digest, done.stdout)
        missing = run(FATHOM, "mission", "digest", self.folder / "none")
        self.assertEqual(missing.returncode, 1)
        self.assertIn("no such mission", missing.stderr)

    def test_compact_keeps_the_map(self):
        self.assertEqual(
            self.verb("compact", self.path)["file_bytes"],
            self.path.stat().st_size)
        self.assertEqual(self.verb("verify", self.path)["map_digest"],
                         self.digest)

    def test_damage_is_found_and_the_rest_repaired_into_a_new_mission(self):
        self.damage()
        proof = self.verb("verify", self.path, code=4)
        self.assertEqual(proof["sound"], "no")
        self.assertTrue(any("checksum" in p for p in proof["problems"]))
        info = self.verb("info", self.path, code=4)
        self.assertNotIn("tiles", info)
        self.assertIn("checksum", info["damage"][0])
        self.assertEqual(info["history_rows"], 19)
        fixed = self.folder / "fixed.fathom"
        before = hashlib.sha256(self.path.read_bytes()).hexdigest()
        repair = self.verb("repair", self.path, fixed)
        self.assertGreater(len(repair["left_out"]), 0)
        self.assertEqual(repair["history_rows"], 19)
        self.assertEqual(
            hashlib.sha256(self.path.read_bytes()).hexdigest(), before)
        proof = self.verb("verify", fixed)
        self.assertEqual(proof["sound"], "yes")
        self.assertEqual(proof["map_digest"], repair["map_digest"])
        # It goes on where the damaged one was: what was taken is a resend.
        with self.reopen("fixed.fathom") as server:
            ack, _ = send_pings(server, [ping(i, [(105, 105, 20.0 + i, 3.0)])
                                         for i in range(1, 26)])
            self.assertEqual((ack.pings_duplicate, ack.pings_applied), (20, 5))

    def test_bringing_an_old_format_to_this_one_is_told(self):
        old = self.folder / "old.fathom"
        golden = ROOT / "tests" / "golden" / "mission-v7-closed.fathom"
        shutil.copy(golden, old)
        with self.reopen("old.fathom") as server:
            self.assertRegex(server.log(), r"I fathomd: .*is of format 7 and")
            self.assertRegex(server.log(), r"I fathomd: .*is of format 9 now")
        old = self.folder / "old2.fathom"
        shutil.copy(golden, old)
        done = run(FATHOMD, "mission", "compact", old, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("is of format 9 now", done.stderr)

    def test_a_sound_mission_repaired_is_the_same(self):
        fixed = self.folder / "fixed.fathom"
        repair = self.verb("repair", self.path, fixed)
        self.assertEqual(repair["left_out"], [])
        self.assertEqual(repair["map_digest"], self.digest)
        self.assertEqual(self.verb("verify", fixed)["map_digest"], self.digest)

    def test_another_missions_map_is_merged_and_served(self):
        # A new mission from the saved map; it knows what that one knew.
        new = self.folder / "new.fathom"
        done = run(FATHOM, "--json", "mission", "import", self.path, new,
                   "--create")
        self.assertEqual(done.returncode, 0, done.stderr)
        merged = json.loads(done.stdout)
        self.assertGreater(merged["leaves_after"], 0)
        with self.reopen("new.fathom") as server:
            self.assertEqual(server.status(digest=True).map_digest,
                             merged["map_digest"])
            self.assertEqual(len(server.status().activities), 0)
        # Not twice; as a chart it may, and says nothing new.
        again = run(FATHOMD, "mission", "import", self.path, new)
        self.assertEqual(again.returncode, 1)
        self.assertIn("would count twice", again.stderr)
        chart = self.verb("import", self.path, new, "--as-chart",
                          "--ageing-m2-per-day", "0.5")
        self.assertEqual(chart["leaves_after"], chart["leaves_before"])
        self.assertEqual(self.verb("verify", chart["backup"])["map_digest"],
                         merged["map_digest"])
        self.assertEqual(self.verb("verify", self.path)["map_digest"],
                         self.digest)

    def features(self, ogr2ogr, source, layer):
        """{fid: (properties, coordinates)}, as GDAL reads them."""
        done = run(ogr2ogr, "-f", "GeoJSON", "-lco", "COORDINATE_PRECISION=17",
                   "-sql", f"SELECT *, fid + 0 AS number FROM {layer}",
                   "/vsistdout/", source)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stderr, "")
        return {f["properties"]["number"]: (
            f["properties"], f["geometry"] and f["geometry"]["coordinates"])
                for f in json.loads(done.stdout)["features"]}

    def test_the_mission_itself_opens_in_gdal(self):
        ogrinfo, ogr2ogr = map(shutil.which, ("ogrinfo", "ogr2ogr"))
        if ogrinfo is None or ogr2ogr is None:
            self.skipTest("no ogrinfo (gdal-bin)")
        path = self.folder / "gis.fathom"
        with self.new_mission(name=path.name) as server:
            # 300 in turn, one of them late; and one of another contact.
            order = [i for i in range(1, 302) if i != 150]
            order.insert(160, 150)
            for at in range(0, len(order), 50):
                report_contacts(server, [
                    fix_report(number, 5 * i, 0, second=i, vn=5.0, ve=0.0)
                    for number, i in enumerate(order[at:at + 50], at + 1)])
            report_contacts(server, [
                fix_report(302, 0, 200, second=301, contact="once")])
            told = {name: [
                (e.position.longitude_deg, e.position.latitude_deg, e.time)
                for part in server.obstacle.GetContactHistory(
                    obstacle.GetContactHistoryRequest(
                        source_id="c4i", contact_id=name), timeout=DEADLINE_S)
                for e in part.estimates] for name in ("ship", "once")}
            self.assertEqual(len(told["ship"]), 301)
            self.assertEqual(server.terminate(), 0)
        before = hashlib.sha256(path.read_bytes()).hexdigest()
        copy = self.folder / "gis.gpkg"
        shutil.copyfile(path, copy)
        quiet = ("--config", "GPKG_WARN_UNRECOGNIZED_APPLICATION_ID", "NO")
        source = f"GPKG:{path}"
        tracks = self.features(ogr2ogr, source, "tracks")
        points = self.features(ogr2ogr, source, "track_points")
        lines = [place for _, line in tracks.values() for place in line or ()]
        for source in (copy, f"GPKG:{path}"):
            with self.subTest(source):
                layers = run(ogrinfo, "-ro", "-so", "-al", *quiet, source)
                self.assertEqual(layers.returncode, 0, layers.stderr)
                self.assertEqual(layers.stderr, "")
                self.assertEqual(
                    re.findall(r"Layer name: (\w+)", layers.stdout),
                    ["tracks", "track_points", "contact"])
                self.assertEqual(
                    re.findall(r"Geometry: (.+)", layers.stdout),
                    ["Line String", "Point", "None"])
                extents = re.findall(
                    r"Extent: \((.+), (.+)\) - \((.+), (.+)\)",
                    layers.stdout)
                for extent, places in zip(
                        extents, (lines, [place for _, place in
                                          points.values()]), strict=True):
                    # Printed to 1e-6 degrees.
                    for value, expected in zip(extent, (
                            min(p[0] for p in places),
                            min(p[1] for p in places),
                            max(p[0] for p in places),
                            max(p[1] for p in places))):
                        self.assertAlmostEqual(float(value), expected,
                                               delta=6e-7)
        self.assertEqual(tracks.keys(), points.keys())
        vertices = {"ship": [], "once": []}
        for fid in sorted(tracks,
                          key=lambda fid: tracks[fid][0]["start_time"]):
            track, line = tracks[fid]
            point, place = points[fid]
            name = track["contact_id"]
            # No line goes through one point.
            line = line or [place]
            self.assertEqual(len(line), track["estimates"])
            self.assertEqual(line[-1], place)
            first = len(vertices[name])
            vertices[name] += line
            for time, index in ((track["start_time"], first),
                                (track["end_time"], first + len(line) - 1),
                                (point["time"], first + len(line) - 1)):
                self.assertEqual(time, told[name][index][2].ToJsonString())
            self.assertEqual(point["contact_number"], track["contact_number"])
        # Two blocks of 128 or more, or three; and one of the other contact.
        self.assertGreaterEqual(len(tracks), 3)
        self.assertIsNone(next(line for track, line in tracks.values()
                               if track["contact_id"] == "once"))
        for name, places in vertices.items():
            self.assertEqual(len(places), len(told[name]))
            for (lon, lat), expected in zip(places, told[name]):
                self.assertAlmostEqual(lon, expected[0], delta=1e-9)
                self.assertAlmostEqual(lat, expected[1], delta=1e-9)
        # 5 m north a second, told by each report.
        for point, _ in points.values():
            if point["contact_id"] == "ship":
                self.assertAlmostEqual(point["speed_m_s"], 5, delta=0.1)
                self.assertLess(min(point["course_deg"],
                                    360 - point["course_deg"]), 1)
        # A mission that was closed stays as it is.
        self.assertEqual(hashlib.sha256(path.read_bytes()).hexdigest(), before)
        self.assertEqual(self.verb("verify", path)["sound"], "yes")

    def test_contact_history_opens_in_gdal_as_points_and_lines(self):
        out = self.folder / "tracks.gpkg"
        self.assertEqual(self.verb("export", self.path, out),
                         {"points": 19, "tracks": 2})
        ogrinfo = shutil.which("ogrinfo")
        if ogrinfo is None:
            self.skipTest("no ogrinfo (gdal-bin)")
        layers = run(ogrinfo, "-ro", "-so", "-al", out)
        self.assertEqual(layers.returncode, 0, layers.stderr)
        self.assertNotIn("Warning", layers.stderr)
        self.assertIn("Layer name: contact_points", layers.stdout)
        self.assertIn("Geometry: Point", layers.stdout)
        self.assertIn("Feature Count: 19", layers.stdout)
        self.assertIn("Layer name: contact_tracks", layers.stdout)
        self.assertIn("Geometry: Line String", layers.stdout)
        self.assertIn("Feature Count: 2", layers.stdout)
        self.assertIn("WGS 84", layers.stdout)
        boats = run(ogrinfo, "-ro", out, "contact_tracks", "-where",
                    "contact_id = 'boat'")
        # Odd reports: 5 m and more north of 41.5 N, 71.4 W.
        self.assertIn("LINESTRING (-71.4", boats.stdout)
        self.assertIn("start_time (DateTime) = 2026/01/01 00:00:01",
                      boats.stdout)


if __name__ == "__main__":
    unittest.main()
