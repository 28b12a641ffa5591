"""fathomd as a process: how it stops, what it refuses to open, where it
listens and whom it lets in."""

import hashlib
import shutil
import sqlite3
import subprocess
import threading
import unittest

import grpc
from google.protobuf import descriptor_pb2

from live_server import (CREATE, DEADLINE_S, FATHOMD, ROOT, LiveTest, Server,
                         ask, import_chart, ingest, mission_rpc, mission,
                         obstacle, ping, point, start_activity, types,
                         wait_until)
# The stubs are importable behind live_server only.
from grpc.health.v1 import health_pb2, health_pb2_grpc  # isort: skip

SERVICES = ["fathom.v1.IngestService", "fathom.v1.MissionService",
            "fathom.v1.ObstacleService"]


def run_fathomd(*flags):
    """Runs fathomd, which is expected to end by itself."""
    return subprocess.run([FATHOMD, *map(str, flags)], capture_output=True,
                          text=True, timeout=DEADLINE_S, check=False)


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


class Stopping(LiveTest):

    def test_sigterm_leaves_one_clean_file(self):
        server = self.new_mission()
        import_chart(server)
        digest = server.status(digest=True).map_digest
        self.assertEqual(server.terminate(), 0, server.log())
        left = sorted(p.name for p in self.folder.iterdir()
                      if p.name.startswith("m.fathom"))
        self.assertNotIn("m.fathom-wal", left)
        self.assertNotIn("m.fathom-shm", left)
        self.assertIn("m.fathom", left)
        with self.reopen() as again:
            self.assertEqual(again.status(digest=True).map_digest, digest)

    def test_sigterm_ends_an_open_stream_after_what_it_sent_is_durable(self):
        server = self.new_mission()
        start_activity(server)
        hold = threading.Event()

        def messages():
            for i in range(1, 201):
                yield ingest.StreamPingsRequest(
                    ping=ping(i, [(105, 105, 20.0, 3.0)]))
            hold.wait(DEADLINE_S)  # An open stream with nothing more to say.

        stream = server.ingest.StreamPings(messages(), timeout=DEADLINE_S)
        acks = []
        code = []

        def read():
            try:
                for ack in stream:
                    acks.append(ack)
            except grpc.RpcError as error:
                code.append(error.code())

        reader = threading.Thread(target=read)
        reader.start()
        wait_until(lambda: acks and acks[-1].applied_sequence == 200,
                   "200 pings to be applied")
        server.process.terminate()
        self.assertEqual(server.process.wait(timeout=DEADLINE_S), 0,
                         server.log())
        reader.join(DEADLINE_S)
        hold.set()
        server.channel.close()
        self.assertEqual(code, [grpc.StatusCode.UNAVAILABLE])
        self.assertEqual(acks[-1].durable_sequence, 200)
        with self.reopen() as again:
            self.assertEqual(
                again.status().activities[0].measurements_accepted, 200)

    def test_a_cancelled_region_does_no_harm(self):
        with self.new_mission() as server:
            import_chart(server)
            for _ in range(5):
                stream = server.obstacle.GetRegion(
                    obstacle.GetRegionRequest(south_west=point(0, 0),
                                              north_east=point(15000, 15000),
                                              resolution_m=10),
                    timeout=DEADLINE_S)
                first = next(stream)
                self.assertGreater(first.total_rows * first.total_columns,
                                   2_000_000)
                stream.cancel()
            self.assertEqual(ask(server, 105, 105).answer.state,
                             types.OBSTACLE_STATE_FREE)
            self.assertEqual(server.terminate(), 0, server.log())


class WrongFiles(LiveTest):

    def refused(self, reason, *flags):
        done = run_fathomd("--listen", "127.0.0.1:0", *flags)
        self.assertNotEqual(done.returncode, 0)
        self.assertGreater(done.returncode, 0, "not killed by a signal")
        self.assertIn(reason, done.stderr)
        self.assertNotIn("ready", done.stdout)
        return done

    def refused_untouched(self, reason, path, *flags):
        before = sha256(path)
        self.refused(reason, "--mission", path, *flags)
        self.assertEqual(sha256(path), before)
        left = [p.name for p in self.folder.iterdir()
                if p.name.startswith(path.name) and p != path
                and not p.name.endswith((".lock", ".log", ".port"))]
        self.assertEqual(left, [])

    def test_a_missing_mission(self):
        path = self.folder / "nowhere.fathom"
        self.refused(str(path), "--mission", path)
        self.assertFalse(path.exists(), "none was made in its place")

    def test_create_on_an_existing_mission(self):
        self.assertEqual(self.new_mission().terminate(), 0)
        self.refused_untouched("exist", self.folder / "m.fathom", *CREATE)

    def test_create_without_a_place(self):
        path = self.folder / "m.fathom"
        self.refused("--center", "--mission", path, "--create")
        self.assertFalse(path.exists())

    def test_a_text_file(self):
        path = self.folder / "notes.txt"
        path.write_text("Dear diary, today I surveyed a bay.\n" * 20)
        self.refused_untouched(str(path), path)
        self.refused_untouched("exist", path, *CREATE)

    def test_an_empty_file_is_no_mission(self):
        path = self.folder / "empty"
        path.touch()
        self.refused_untouched(str(path), path)

    def test_somebody_elses_database(self):
        path = self.folder / "photos.db"
        other = sqlite3.connect(path)
        other.execute("CREATE TABLE photo (name TEXT)")
        other.execute("INSERT INTO photo VALUES ('sunset')")
        other.commit()
        other.close()
        self.refused_untouched("not a Fathom mission", path)

    def test_a_newer_format_is_left_alone(self):
        self.assertEqual(self.new_mission().terminate(), 0)
        path = self.folder / "m.fathom"
        db = sqlite3.connect(path)
        version = db.execute("PRAGMA user_version").fetchone()[0]
        self.assertGreaterEqual(version, 1)
        db.execute(f"PRAGMA user_version = {version + 1}")
        db.close()
        self.refused_untouched(f"version {version + 1}", path)

    def test_a_file_that_a_server_holds(self):
        with self.new_mission() as server:
            import_chart(server)
            done = self.refused("m.fathom", "--mission",
                                self.folder / "m.fathom")
            self.assertRegex(done.stderr, "in use|another|held|open")
            # The one that holds it serves on.
            self.assertEqual(ask(server, 105, 105).answer.state,
                             types.OBSTACLE_STATE_FREE)

    def test_a_port_that_a_server_holds(self):
        with self.new_mission() as server:
            done = run_fathomd("--mission", self.folder / "other.fathom",
                               *CREATE, "--listen", server.address)
            self.assertGreater(done.returncode, 0)
            self.assertIn("in use", done.stderr)
            self.assertIn(server.address, done.stderr)
            server.status()


class Reaching(LiveTest):

    def test_help_and_version_end_well(self):
        done = run_fathomd("--help")
        self.assertEqual(done.returncode, 0)
        for word in ("--mission", "--listen", "--create", "--tls-cert"):
            self.assertIn(word, done.stdout)
        done = run_fathomd("--version")
        self.assertEqual(done.returncode, 0)
        self.assertRegex(done.stdout, r"\d+\.\d+")

    def test_flags_that_make_no_sense(self):
        for flags in ([], ["--mission", "x", "--nonsense"],
                      ["--mission", "x", "--log-level", "loud"]):
            with self.subTest(flags=flags):
                done = run_fathomd(*flags)
                self.assertEqual(done.returncode, 2)
                self.assertTrue(done.stderr)

    def test_other_machines_only_with_mutual_tls(self):
        path = self.folder / "m.fathom"
        for address in ("0.0.0.0:0", "[::]:0", "127.evil.example:0"):
            with self.subTest(address=address):
                done = run_fathomd("--mission", path, *CREATE, "--listen",
                                   address)
                self.assertEqual(done.returncode, 2)
                self.assertIn("TLS", done.stderr)
                self.assertFalse(path.exists(), "refused before it is made")

    def test_half_of_tls_is_refused(self):
        done = run_fathomd("--mission", self.folder / "m.fathom", *CREATE,
                           "--listen", "127.0.0.1:0", "--tls-cert", "x.pem")
        self.assertEqual(done.returncode, 2)
        self.assertIn("--tls-client-ca", done.stderr)

    @unittest.skipUnless(shutil.which("openssl"), "openssl is not installed")
    def test_mutual_tls_lets_in_whom_the_authority_knows(self):
        certificates = self.folder / "tls"
        subprocess.run([ROOT / "deploy" / "make-certificates", certificates],
                       check=True, capture_output=True, timeout=DEADLINE_S)
        pem = {p.name: p.read_bytes() for p in certificates.iterdir()}
        tls = ["--tls-cert", str(certificates / "server.pem"),
               "--tls-key", str(certificates / "server.key"),
               "--tls-client-ca", str(certificates / "ca.pem")]

        def status(credentials, address):
            with grpc.secure_channel(address, credentials) as channel:
                return mission_rpc.MissionServiceStub(
                    channel).GetMissionStatus(
                        mission.GetMissionStatusRequest(), timeout=DEADLINE_S)

        strangers = self.folder / "strangers"
        subprocess.run([ROOT / "deploy" / "make-certificates", strangers],
                       check=True, capture_output=True, timeout=DEADLINE_S)
        server = Server(self.folder / "m.fathom", *CREATE, *tls,
                        listen="0.0.0.0:0")
        with server:
            known = grpc.ssl_channel_credentials(
                pem["ca.pem"], pem["client.key"], pem["client.pem"])
            self.assertEqual(status(known, server.address).name, "test")
            nobody = grpc.ssl_channel_credentials(pem["ca.pem"])
            stranger = grpc.ssl_channel_credentials(
                pem["ca.pem"], (strangers / "client.key").read_bytes(),
                (strangers / "client.pem").read_bytes())
            for who in (nobody, stranger):
                with self.assertRaises(grpc.RpcError) as caught:
                    status(who, server.address)
                self.assertEqual(caught.exception.code(),
                                 grpc.StatusCode.UNAVAILABLE)
            # Without TLS at all.
            with self.assertRaises(grpc.RpcError):
                server.status()
            self.assertEqual(status(known, server.address).name, "test")
            self.assertEqual(server.terminate(), 0)

    def test_health_of_every_service(self):
        with self.new_mission() as server:
            health = health_pb2_grpc.HealthStub(server.channel)
            for service in [""] + SERVICES:
                answer = health.Check(
                    health_pb2.HealthCheckRequest(service=service),
                    timeout=DEADLINE_S)
                self.assertEqual(answer.status,
                                 health_pb2.HealthCheckResponse.SERVING)
            self.assert_status(
                grpc.StatusCode.NOT_FOUND, health.Check,
                health_pb2.HealthCheckRequest(service="fathom.v1.Nothing"))
            watch = health.Watch(health_pb2.HealthCheckRequest(),
                                 timeout=DEADLINE_S)
            self.assertEqual(next(watch).status,
                             health_pb2.HealthCheckResponse.SERVING)
            server.process.terminate()
            self.assertEqual(next(watch).status,
                             health_pb2.HealthCheckResponse.NOT_SERVING)
            self.assertEqual(server.process.wait(timeout=DEADLINE_S), 0)

    def test_a_unix_socket(self):
        socket = self.folder / "fathom.sock"
        server = subprocess.Popen(
            [FATHOMD, "--mission", self.folder / "m.fathom", *CREATE,
             "--listen", f"unix:{socket}"], stdout=subprocess.PIPE, text=True)
        self.addCleanup(server.stdout.close)
        self.addCleanup(server.wait)
        self.addCleanup(server.kill)
        self.assertIn("ready on unix:", server.stdout.readline())
        with grpc.insecure_channel(f"unix:{socket}") as channel:
            stub = mission_rpc.MissionServiceStub(channel)
            answer = stub.GetMissionStatus(mission.GetMissionStatusRequest(),
                                           timeout=DEADLINE_S)
            self.assertEqual(answer.name, "test")
        done = run_fathomd("--mission", self.folder / "b.fathom", *CREATE,
                           "--listen", f"unix:{socket}")
        self.assertGreater(done.returncode, 0)
        self.assertIn("in use", done.stderr)
        server.terminate()
        self.assertEqual(server.wait(timeout=DEADLINE_S), 0)

    def test_reflection_lists_the_services_and_their_files(self):
        # grpc.reflection.v1alpha has no Python stub on Debian; its messages
        # are few enough to write by hand: list_services is field 7 (string),
        # file_containing_symbol field 4 (string).
        def request(field, text):
            return bytes([field << 3 | 2, len(text)]) + text.encode()

        with self.new_mission() as server:
            call = server.channel.stream_stream(
                "/grpc.reflection.v1alpha.ServerReflection/"
                "ServerReflectionInfo")
            answers = list(call(iter([
                request(7, "*"),
                request(4, "fathom.v1.ObstacleService")]),
                timeout=DEADLINE_S))
            for service in SERVICES + ["grpc.health.v1.Health"]:
                self.assertIn(service.encode(), answers[0])
            # The second answer holds FileDescriptorProtos of our contract.
            name = obstacle.DESCRIPTOR.serialized_pb
            file = descriptor_pb2.FileDescriptorProto.FromString(name)
            self.assertIn(file.name.encode(), answers[1])
            self.assertIn(b"QueryObstacles", answers[1])


if __name__ == "__main__":
    unittest.main()
