"""The feeder's link: certificates, sockets, fleets, and a server that is away
for long while the feeder itself is killed."""

import json
import pathlib
import shutil
import signal
import struct
import subprocess
import unittest

from link_proxy import LinkProxy
from live_server import (CREATE, DEADLINE_S, FATHOMD, FEEDER, ROOT, LiveTest,
                         Server, wait_until)

WGS84 = ('GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,'
         '298.257223563]],PRIMEM["Greenwich",0],UNIT["degree",'
         '0.0174532925199433]]')
FRAME = struct.Struct("<II")
HEADER_BYTES = 92


def numbers_in(buffer):
    """First and last number of the pings that a buffer holds, read without the
    feeder: 92 bytes of header, then size, checksum, message; a mark is 8 bytes
    behind 2^32 - 1 and a checksum."""
    segments = sorted(pathlib.Path(buffer).glob("pings-*.spool"))
    first = int(segments[0].stem.removeprefix("pings-"))
    last = first - 1
    for segment in segments:
        data = segment.read_bytes()
        place = HEADER_BYTES
        while place + FRAME.size <= len(data):
            size, _ = FRAME.unpack_from(data, place)
            if size == 2**32 - 1:
                place += FRAME.size + 8
                continue
            place += FRAME.size + size
            last += place <= len(data)
    return first, last


class Link(LiveTest):

    def setUp(self):
        super().setUp()
        # A slope from 20 m to 28 m, 0.02 degrees square, cells of 11 m.
        rows = [" ".join(f"{20 + 0.04 * row:.2f}" for _ in range(200))
                for row in range(200)]
        self.truth = self.folder / "slope.asc"
        self.truth.write_text(
            "ncols 200\nnrows 200\nxllcorner -71.41\nyllcorner 41.49\n"
            "cellsize 0.0001\n" + "\n".join(rows) + "\n")
        self.truth.with_suffix(".prj").write_text(WGS84)

    def words(self, address, *flags, activity="bay", ships=0):
        return [str(word) for word in (
            FEEDER, "run", "--server", address, "--activity", activity,
            "--truth", self.truth, "--truth-positive", "down",
            "--south-west", "41.5,-71.4", "--north-extent-m", 300,
            "--east-extent-m", 300, "--start-time", "2026-05-01T06:00:00Z",
            "--ships", ships, "--epoch", 1, *flags)]

    def run_feeder(self, words):
        return subprocess.run([str(w) for w in words], capture_output=True,
                              text=True, timeout=2 * DEADLINE_S, check=False)

    def unbroken_digest(self, *flags, ships=0):
        with self.new_mission(name="whole.fathom") as server:
            done = self.run_feeder(
                self.words(server.address, *flags, ships=ships))
            self.assertEqual(done.returncode, 0, done.stderr)
            return server.status(digest=True).map_digest

    @unittest.skipUnless(shutil.which("openssl"), "openssl is absent")
    def test_certificates_open_the_door_and_nothing_else_does(self):
        pem = self.folder / "pem"
        subprocess.run([ROOT / "deploy" / "make-certificates", pem],
                       check=True, capture_output=True)
        ours = ["--tls-ca", pem / "ca.pem", "--tls-cert", pem / "client.pem",
                "--tls-key", pem / "client.key"]
        with Server(self.folder / "m.fathom", *CREATE,
                    "--tls-cert", str(pem / "server.pem"),
                    "--tls-key", str(pem / "server.key"),
                    "--tls-client-ca", str(pem / "ca.pem")) as server:
            done = self.run_feeder(self.words(
                server.address, "--pings", 50, "--json", *ours))
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(json.loads(done.stdout)["pings_durable"], 50)
            survey = self.folder / "survey.json"
            survey.write_text(done.stdout)
            done = self.run_feeder(
                [FEEDER, "evaluate", "--server", server.address, "--truth",
                 self.truth, "--truth-positive", "down", "--survey", survey,
                 "--points", 100, "--json", *ours])
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertGreater(json.loads(done.stdout)["measured"]["count"], 0)
            for flags, word in (
                    ([], "no Fathom server answers"),
                    (ours[:4], "belong together"),
                    (["--tls-ca", self.truth], "is no PEM file")):
                done = self.run_feeder(
                    self.words(server.address, "--pings", 5, *flags,
                               activity="other"))
                self.assertEqual(done.returncode, 1)
                self.assertIn(word, done.stderr)
                self.assertLessEqual(len(done.stderr.splitlines()), 1)

    def test_a_unix_socket(self):
        path = self.folder / "fathom.sock"
        words = self.words(f"unix:{path}", "--pings", 50, "--json")
        server = self.serve_on(path)
        self.addCleanup(server.wait)
        self.addCleanup(server.kill)
        done = self.run_feeder(words)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["pings_durable"], 50)

    def serve_on(self, path):
        process = subprocess.Popen(
            [FATHOMD, "--mission", str(self.folder / "u.fathom"), *CREATE,
             "--listen", f"unix:{path}"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_until(lambda: path.exists() or process.poll() is not None,
                   "the socket")
        return process

    def test_a_fleet_of_three(self):
        with self.new_mission() as server:
            done = self.run_feeder(self.words(
                server.address, "--vehicles", 3, "--pings", 200, "--json",
                "--complete", ships=2))
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("3 vehicles: sent 600 pings", done.stderr)
            records = [json.loads(line) for line in done.stdout.splitlines()]
            self.assertEqual([r["source_id"] for r in records],
                             ["feeder-1", "feeder-2", "feeder-3"])
            self.assertEqual([r["seed"] for r in records], [1, 2, 3])
            activities = {a.activity_id: a
                          for a in server.status().activities}
            self.assertEqual(sorted(activities), ["bay-1", "bay-2", "bay-3"])
            for record in records:
                self.assertEqual(record["pings_durable"], 200)
                self.assertEqual(
                    activities[record["activity_id"]].measurements_accepted,
                    record["measurements_accepted"])
            # Each has its own noise, and ships of its own.
            self.assertNotEqual(records[0]["ships"], records[1]["ships"])

    def test_a_fleet_in_one_activity(self):
        with self.new_mission() as server:
            done = self.run_feeder(self.words(
                server.address, "--vehicles", 3, "--pings", 200,
                "--share-activity", "--complete", "--json"))
            self.assertEqual(done.returncode, 0, done.stderr)
            records = [json.loads(line) for line in done.stdout.splitlines()]
            (activity,) = server.status().activities
            self.assertEqual(activity.activity_id, "bay")
            self.assertFalse(activity.open)
            self.assertEqual(activity.measurements_accepted,
                             sum(r["measurements_accepted"] for r in records))
            done = self.run_feeder(self.words(
                server.address, "--vehicles", 2, "--track-out",
                self.folder / "track.csv"))
            self.assertEqual(done.returncode, 1)
            self.assertIn("would write to one file", done.stderr)

    def test_what_a_cut_swallowed_is_counted(self):
        with self.new_mission() as server:
            proxy = LinkProxy(server.address, cuts=5, after_bytes=20_000)
            self.addCleanup(proxy.close)
            done = self.run_feeder(self.words(proxy.address, "--pings", 500,
                                              "--json"))
            self.assertEqual(done.returncode, 0, done.stderr)
            record = json.loads(done.stdout)
            self.assertGreater(record["reconnects"], 0)
            self.assertEqual(
                record["measurements_accepted"]
                + sum(record["rejects"].values()), record["measurements"])

    def test_a_run_that_is_evaluated(self):
        out = self.folder / "evaluation"
        with self.new_mission() as server:
            done = self.run_feeder(self.words(server.address, "--pings", 300,
                                              "--evaluate", out))
            self.assertEqual(done.returncode, 0, done.stderr)
            measured = json.loads(
                (out / "evaluation.json").read_text())["measured"]
            self.assertGreater(measured["count"], 100)
            self.assertLess(measured["rmse_m"], 1)
            for name in ("places.csv", "evaluation.png"):
                self.assertTrue((out / name).exists(), name)
            done = self.run_feeder(self.words(
                server.address, "--pings", 300, "--evaluate", out,
                "--vehicles", 2))
            self.assertEqual(done.returncode, 1)
            self.assertIn("one vehicle's at a time", done.stderr)

    def test_a_fleet_that_makes_its_messages_first(self):
        with self.new_mission() as server:
            words = self.words(server.address, "--vehicles", 3, "--pings", 200,
                               "--prepare-mib", 3, "--json")
            done = self.run_feeder(words)
            self.assertEqual(done.returncode, 0, done.stderr)
            records = [json.loads(line) for line in done.stdout.splitlines()]
            self.assertEqual([r["pings_durable"] for r in records], [200] * 3)
            # All wait for all; those that fail hold up nobody, so that this
            # ends: the server takes an activity once.
            done = self.run_feeder(words)
            self.assertEqual(done.returncode, 1)
            self.assertIn("feeder-1 (3 of 3 vehicles failed)", done.stderr)

    def lose(self, server, proxy):
        """Kills the server once it has pings."""
        wait_until(lambda: sum(a.measurements_accepted for a in
                               server.status().activities) > 100,
                   "the first pings")
        server.kill()
        proxy.cut()

    def test_a_server_that_is_away_until_after_the_end(self):
        # A ship too: reports have a buffer of their own.
        flags = ["--pings", 600, "--report-interval-s", 5]
        whole = self.unbroken_digest(*flags, ships=2)
        buffer = self.folder / "outbox"
        server = self.new_mission()
        proxy = LinkProxy(server.address)
        self.addCleanup(proxy.close)
        feeder = subprocess.Popen(
            self.words(proxy.address, *flags, "--rate", 200, "--buffer",
                       buffer, "--patience-s", 1, ships=2),
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.addCleanup(feeder.kill)
        with server:
            self.lose(server, proxy)
            _, words = feeder.communicate(timeout=DEADLINE_S)
        self.assertEqual(feeder.returncode, 1)
        self.assertIn("sent 600 pings", words)
        self.assertRegex(words, r"holds \d+ messages that the server has not")
        self.assertEqual(numbers_in(buffer)[1], 600)
        with self.reopen() as server:
            for attempt in ("what is left", "nothing"):
                done = self.run_feeder([FEEDER, "send", "--server",
                                        server.address, "--buffer", buffer])
                self.assertEqual(done.returncode, 0, (attempt, done.stderr))
            self.assertIn("sent 0 pings and 0 reports", done.stderr)
            self.assertEqual(server.status(digest=True).map_digest, whole)

    def test_a_feeder_that_is_killed_while_the_server_is_away(self):
        flags = ["--pings", 2000]
        buffer = self.folder / "outbox"
        server = self.new_mission()
        proxy = LinkProxy(server.address)
        self.addCleanup(proxy.close)
        feeder = subprocess.Popen(
            self.words(proxy.address, *flags, "--rate", 200, "--buffer",
                       buffer),
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(feeder.wait)
        self.addCleanup(feeder.kill)
        with server:
            self.lose(server, proxy)
            there = numbers_in(buffer)[1]
            wait_until(lambda: numbers_in(buffer)[1] > there + 200,
                       "pings while the server is away")
            self.assertIsNone(feeder.poll())
            feeder.send_signal(signal.SIGKILL)
            feeder.wait(timeout=DEADLINE_S)
        taken = numbers_in(buffer)[1]
        self.assertLess(taken, 2000)
        with self.reopen() as server:
            done = self.run_feeder([FEEDER, "send", "--server",
                                    server.address, "--buffer", buffer])
            self.assertEqual(done.returncode, 0, done.stderr)
            digest = server.status(digest=True).map_digest
            self.assertEqual(digest, self.unbroken_digest("--pings", taken))
            # A new run goes on in the same numbering.
            done = self.run_feeder(self.words(
                server.address, "--pings", 30, "--buffer", buffer,
                "--no-start", "--json"))
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(json.loads(done.stdout)["pings_durable"], 30)
            self.assertEqual(numbers_in(buffer), (taken + 31, taken + 30))

    def test_a_full_buffer_drops_what_is_new_and_says_so(self):
        buffer = self.folder / "outbox"
        # Nobody listens there; 0.3 kB a ping and 16 MiB.
        done = self.run_feeder(self.words(
            "127.0.0.1:1", "--no-start", "--pings", 80_000, "--rate", 1e6,
            "--sonar-cell-m", 1, "--buffer", buffer, "--buffer-mib", 16,
            "--patience-s", 0.5))
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr,
                         r"dropped by a full buffer: \d+ messages")
        bytes_there = sum(p.stat().st_size for p in buffer.glob("*.spool"))
        self.assertLessEqual(bytes_there, 16 << 20)
        self.assertGreater(bytes_there, 15 << 20)

    def test_a_buffer_that_is_not_there_or_not_ours(self):
        with self.new_mission() as server:
            done = self.run_feeder([FEEDER, "send", "--server",
                                    server.address, "--buffer",
                                    self.folder / "none"])
            self.assertEqual(done.returncode, 1)
            self.assertIn("holds no buffered", done.stderr)
            buffer = self.folder / "outbox"
            done = self.run_feeder(self.words(server.address, "--pings", 5,
                                              "--buffer", buffer))
            self.assertEqual(done.returncode, 0, done.stderr)
            done = self.run_feeder(self.words(
                server.address, "--pings", 5, "--buffer", buffer, "--source",
                "other", activity="other"))
            self.assertEqual(done.returncode, 1)
            self.assertIn('holds messages of source "feeder"', done.stderr)


if __name__ == "__main__":
    unittest.main()
