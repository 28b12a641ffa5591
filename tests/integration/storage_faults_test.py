"""The mission file of a live server: copies and proofs, a full disk, a failed
fsync, a damaged tile, a damaged page that is to be written. faulty_disk.cc
stands before the C library."""

import hashlib
import json
import os
import queue
import sqlite3
import subprocess
import threading
import unittest

import grpc

from live_server import (DEADLINE_S, FATHOMD, LiveTest, Server, ask,
                         fix_report, import_chart, ingest, mission, ping,
                         report_contacts, send_pings, start_activity, types,
                         wait_until)
from google.rpc import error_details_pb2, status_pb2

EXHAUSTED = grpc.StatusCode.RESOURCE_EXHAUSTED
# As fathomd --help says.
EXIT_FILE_FAILED = 3


def details_of(error):
    """{message name: message} of an error's rich details."""
    found = {}
    for key, value in error.trailing_metadata():
        if key == "grpc-status-details-bin":
            for detail in status_pb2.Status.FromString(value).details:
                for kind in (error_details_pb2.RetryInfo,
                             error_details_pb2.ErrorInfo):
                    message = kind()
                    if detail.Unpack(message):
                        found[kind.DESCRIPTOR.name] = message
    return found


def crc32c(data):
    """CRC-32C (RFC 3720), bit by bit over a table of one byte."""
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
        table.append(byte)
    crc = 0xFFFFFFFF
    for byte in data:
        crc = crc >> 8 ^ table[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFFFFFF


def check_pages_anew(path):
    """Gives every page the checksum of what it holds now, so that a blob's
    own is what finds the damage (docs/storage_format.md, "Pages")."""
    content = bytearray(path.read_bytes())
    for number in range(1, len(content) // 8192 + 1):
        page = content[(number - 1) * 8192:number * 8192 - 4]
        crc = crc32c(number.to_bytes(4, "little")
                     + crc32c(page).to_bytes(4, "little"))
        content[number * 8192 - 4:number * 8192] = crc.to_bytes(4, "little")
    path.write_bytes(content)


class FaultyDisk(LiveTest):

    def setUp(self):
        super().setUp()
        self.fault = self.folder / "fault"
        self.fault.write_text(" ")
        before = dict(os.environ)
        self.addCleanup(lambda: (os.environ.clear(),
                                 os.environ.update(before)))
        os.environ["FATHOM_FAULT_FILE"] = str(self.fault)
        os.environ["LD_PRELOAD"] = os.environ["FATHOM_FAULTY_DISK"]
        # A sanitized server wants to be first; it need not be.
        os.environ["ASAN_OPTIONS"] = (
            os.environ.get("ASAN_OPTIONS", "") + ":verify_asan_link_order=0")

    def accepted(self, server):
        return server.status().activities[0].measurements_accepted

    def test_a_full_disk_refuses_and_service_resumes_by_itself(self):
        beams = [(105, 105, 20.0, 3.0), (115, 105, 21.0, 3.0)]
        server = self.new_mission()
        self.addCleanup(lambda: server.__exit__())
        import_chart(server)
        start_activity(server)
        send_pings(server, [ping(i, beams) for i in range(1, 11)])
        durable = server.status().storage.durable_revision

        self.fault.write_text("f")
        # Applied in RAM, never acknowledged as durable.
        with self.assertRaises(grpc.RpcError) as caught:
            send_pings(server, [ping(i, beams) for i in range(11, 21)])
        self.assertEqual(caught.exception.code(), EXHAUSTED)
        details = details_of(caught.exception)
        self.assertGreater(details["RetryInfo"].retry_delay.ToMilliseconds(),
                           0)
        self.assertEqual(details["ErrorInfo"].reason, "STORAGE_FULL")
        self.assertIn("full", caught.exception.details())
        self.assertEqual(server.status().storage.durable_revision, durable)
        self.assertIn("full", server.status().storage.fault)
        # Nothing new is taken, by any way in.
        self.assert_status(EXHAUSTED, server.mission.TransferLocalMap,
                           mission.TransferLocalMapRequest(activity_id="bay"))
        self.assert_status(EXHAUSTED, server.mission.SaveMission,
                           mission.SaveMissionRequest(file_name="c.fathom"))
        self.assertEqual([p.name for p in self.folder.glob("c.fathom*")], [])
        # Queries go on.
        for _ in range(20):
            self.assertEqual(ask(server, 105, 105).answer.state,
                             types.OBSTACLE_STATE_FREE)

        self.fault.write_text(" ")
        wait_until(lambda: not server.status().storage.fault,
                   "service to resume by itself")
        ack, _ = send_pings(server, [ping(i, beams) for i in range(11, 31)])
        self.assertEqual(ack.durable_sequence, 30)
        self.assertEqual(self.accepted(server), 2 * 30)
        digest = server.status(digest=True).map_digest
        server.kill()
        server = self.reopen()
        self.assertEqual(self.accepted(server), 2 * 30)
        self.assertEqual(server.status(digest=True).map_digest, digest)

    def test_killed_while_the_disk_is_full_loses_nothing_acknowledged(self):
        beams = [(105, 105, 20.0, 3.0)]
        server = self.new_mission()
        self.addCleanup(lambda: server.__exit__())
        start_activity(server)
        send_pings(server, [ping(i, beams) for i in range(1, 11)])
        self.fault.write_text("f")
        with self.assertRaises(grpc.RpcError):
            send_pings(server, [ping(i, beams) for i in range(11, 21)])
        server.kill()
        self.fault.write_text(" ")
        server = self.reopen()
        self.assertEqual(self.accepted(server), 10)
        ack, acks = send_pings(server, [ping(i, beams) for i in range(1, 21)])
        self.assertEqual((ack.pings_duplicate, ack.pings_applied), (10, 10))
        self.assertEqual([g for a in acks for g in a.gaps], [])

    def test_stopped_while_the_disk_is_full_says_so_by_its_exit_code(self):
        beams = [(105, 105, 20.0, 3.0)]
        server = self.new_mission()
        self.addCleanup(lambda: server.__exit__())
        start_activity(server)
        send_pings(server, [ping(1, beams)])
        self.fault.write_text("f")
        with self.assertRaises(grpc.RpcError):
            send_pings(server, [ping(2, beams)])
        self.assertEqual(server.terminate(), EXIT_FILE_FAILED, server.log())
        self.assertIn("nothing acknowledged is lost", server.log())
        self.fault.write_text(" ")
        server = self.reopen()
        self.assertEqual(self.accepted(server), 1)

    def test_a_failed_fsync_ends_the_server_with_its_exit_code(self):
        beams = [(105, 105, 20.0, 3.0)]
        server = self.new_mission()
        self.addCleanup(lambda: server.__exit__())
        start_activity(server)
        send_pings(server, [ping(i, beams) for i in range(1, 11)])
        self.fault.write_text("s")
        acks = []
        hold = threading.Event()

        def messages():
            for i in range(11, 21):
                yield ingest.StreamPingsRequest(ping=ping(i, beams))
            hold.wait(DEADLINE_S)
        with self.assertRaises(grpc.RpcError):
            for ack in server.ingest.StreamPings(messages(),
                                                 timeout=DEADLINE_S):
                acks.append(ack)
        hold.set()
        self.assertEqual([a for a in acks if a.durable_sequence > 10], [])
        self.assertEqual(server.process.wait(timeout=DEADLINE_S),
                         EXIT_FILE_FAILED, server.log())
        self.fault.write_text(" ")
        server = self.reopen()
        held = self.accepted(server)
        # All of the batch that failed, or nothing of it; here it was written.
        self.assertGreaterEqual(held, 10)
        self.assertLessEqual(held, 20)
        ack, _ = send_pings(server, [ping(i, beams) for i in range(1, 21)])
        self.assertEqual(ack.pings_duplicate, held)
        self.assertEqual(self.accepted(server), 20)


class CopiesAndProofs(LiveTest):

    def save(self, server, name):
        return server.mission.SaveMission(
            mission.SaveMissionRequest(file_name=name), timeout=DEADLINE_S)

    def verify(self, server):
        return server.mission.VerifyMission(mission.VerifyMissionRequest(),
                                            timeout=DEADLINE_S)

    def test_a_copy_saved_under_load_is_a_mission_of_its_own(self):
        server = self.new_mission()
        self.addCleanup(lambda: server.__exit__())
        import_chart(server)
        start_activity(server)
        stop = threading.Event()

        def messages():
            i = 0
            while not stop.is_set():
                i += 1
                yield ingest.StreamPingsRequest(
                    ping=ping(i, [(105, 105, 20.0, 3.0)]))
        load = threading.Thread(target=lambda: list(
            server.ingest.StreamPings(messages(), timeout=DEADLINE_S)))
        load.start()
        try:
            copies = []
            last = server.status().storage.durable_revision
            for i in range(3):
                # Copies differ where a ping came between them.
                wait_until(lambda seen=last:
                           server.status().storage.durable_revision > seen,
                           "a ping")
                before = server.status().storage.durable_revision
                copy = self.save(server, f"copy{i}.fathom")
                last = copy.map_revision
                self.assertGreaterEqual(copy.map_revision, before)
                copies.append(copy)
            self.assertTrue(self.verify(server).ok)
        finally:
            stop.set()
            load.join(DEADLINE_S)
        self.assertEqual(len({c.map_digest for c in copies}), 3)
        for i, copy in enumerate(copies):
            path = self.folder / f"copy{i}.fathom"
            self.assertEqual(path.stat().st_size, copy.file_bytes)
            with Server(path) as other:
                status = other.status(digest=True)
                self.assertEqual(status.map_digest, copy.map_digest)
                self.assertEqual(status.stamp.map_revision, copy.map_revision)
        left = [p.name for p in self.folder.glob("*.new*")]
        self.assertEqual(left, [])

    def test_a_proof_gives_the_digest_of_the_durable_map(self):
        with self.new_mission() as server:
            import_chart(server)
            proof = self.verify(server)
            self.assertTrue(proof.ok)
            self.assertEqual(list(proof.problems), [])
            self.assertEqual(proof.map_digest,
                             server.status(digest=True).map_digest)

    def test_names_of_copies(self):
        with self.new_mission() as server:
            for name in ["", "../x.fathom", "a/b", ".hidden", "m.fathom-wal",
                         "m.fathom.lock", "x.new", "x" * 300]:
                self.assert_field("file_name", server.mission.SaveMission,
                                  mission.SaveMissionRequest(file_name=name))
            self.assert_status(
                grpc.StatusCode.ALREADY_EXISTS, server.mission.SaveMission,
                mission.SaveMissionRequest(file_name="m.fathom"))

    def test_a_damaged_tile_is_unknown_and_told_and_the_rest_serves(self):
        server = self.new_mission()
        self.addCleanup(lambda: server.__exit__())
        import_chart(server)
        # At the chart's northern rim, where leaves are small; and in its
        # middle, where they are not.
        self.assertEqual(ask(server, 1480, 5).answer.state,
                         types.OBSTACLE_STATE_FREE)
        self.assertEqual(server.terminate(), 0, server.log())
        path = self.folder / "m.fathom"
        raw = sqlite3.connect(path)
        tiles = raw.execute("SELECT tile_key FROM tile ORDER BY tile_key")
        keys = [key for (key,) in tiles.fetchall()]
        self.assertGreater(len(keys), 2)
        damaged = [k for k in keys if k >> 48 > 0]
        for key in damaged:
            raw.execute("UPDATE tile SET content = zeroblob(100) WHERE "
                        "tile_key = ?", (key,))
        raw.commit()
        raw.close()
        check_pages_anew(path)
        sha = hashlib.sha256(path.read_bytes()).hexdigest()
        server = self.reopen()
        storage = server.status().storage
        self.assertEqual(len(storage.damage), len(damaged))
        self.assertIn("tile level=", storage.damage[0])
        self.assertEqual(storage.fault, "")
        self.assertEqual(ask(server, 1480, 5).answer.state,
                         types.OBSTACLE_STATE_UNKNOWN)
        self.assertEqual(ask(server, 105, 105).answer.state,
                         types.OBSTACLE_STATE_FREE)
        proof = self.verify(server)
        self.assertFalse(proof.ok)
        self.assertTrue(any("tile level=" in p for p in proof.problems))
        self.assert_status(grpc.StatusCode.DATA_LOSS,
                           server.mission.SaveMission,
                           mission.SaveMissionRequest(file_name="c.fathom"))
        server.kill()
        self.assertEqual(hashlib.sha256(path.read_bytes()).hexdigest(), sha)
        # It still takes evidence in.
        server = self.reopen()
        start_activity(server)
        send_pings(server, [ping(1, [(105, 105, 20.0, 0.5)])])
        self.assertEqual(ask(server, 105, 105).answer.state,
                         types.OBSTACLE_STATE_FREE)
        self.assertEqual(server.terminate(), 0, server.log())

    def test_damage_in_the_way_of_a_write_stops_ingest_and_no_query(self):
        with self.new_mission() as server:
            start_activity(server)
            send_pings(server, [ping(1, [(105, 105, 20.0, 3.0)])])
            report_contacts(server, [fix_report(i, 5 * i, second=i)
                                     for i in range(1, 21)])
            self.assertEqual(server.terminate(), 0, server.log())
        path = self.folder / "m.fathom"
        raw = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
        [block] = raw.execute("SELECT content FROM contact_history").fetchone()
        raw.close()
        content = bytearray(path.read_bytes())
        self.assertEqual(content.count(block), 1)
        content[content.index(block) + len(block) // 2] ^= 1
        path.write_bytes(content)

        # Nothing reads the history at a start, and reports do not write it.
        server = self.reopen()
        self.addCleanup(lambda: server.__exit__())
        self.assertEqual(list(server.status().storage.damage), [])
        report_contacts(server, [fix_report(i, 5 * i, second=i)
                                 for i in range(21, 26)])
        digest = server.status(digest=True).map_digest
        # A stream that stays open: what it sends was durable before (the digest
        # stays as it is), more is to come.
        sending = queue.SimpleQueue()
        self.addCleanup(sending.put, None)
        sending.put(ingest.StreamPingsRequest(
            ping=ping(1, [(105, 105, 20.0, 3.0)])))
        held = server.ingest.StreamPings(iter(sending.get, None),
                                         timeout=DEADLINE_S)
        self.assertEqual(next(held).durable_sequence, 1)
        # A snapshot adds what is new to the contact's last block.
        lost = grpc.StatusCode.DATA_LOSS
        error = self.assert_status(
            lost, server.mission.TransferLocalMap,
            mission.TransferLocalMapRequest(activity_id="bay"))
        self.assertIn(f"fathom mission repair {path} NEW", error.details())
        self.assertEqual(details_of(error)["ErrorInfo"].reason,
                         "STORAGE_DAMAGED")
        self.assertNotIn("RetryInfo", details_of(error))
        self.assertIn("checksum", server.status().storage.fault)
        sending.put(ingest.StreamPingsRequest(
            ping=ping(2, [(105, 105, 20.0, 3.0)])))
        with self.assertRaises(grpc.RpcError) as ended:
            list(held)
        self.assertEqual(ended.exception.code(), lost)
        self.assertEqual(details_of(ended.exception)["ErrorInfo"].reason,
                         "STORAGE_DAMAGED")
        self.assert_status(lost, server.ingest.ReportContacts,
                           ingest.ReportContactsRequest(
                               reports=[fix_report(26, 130, second=26)]))
        with self.assertRaises(grpc.RpcError) as caught:
            send_pings(server, [ping(2, [(105, 105, 20.0, 3.0)])])
        self.assertEqual(caught.exception.code(), lost)
        for _ in range(20):
            answer = ask(server, 125, 25, depth_m=0, second=26).answer
            self.assertEqual(answer.state, types.OBSTACLE_STATE_OCCUPIED)
        self.assertEqual(server.terminate(), EXIT_FILE_FAILED, server.log())
        self.assertIn("fathom mission repair", server.log().splitlines()[-1])

        # What was acknowledged is there, also where it starts again as it is,
        with self.reopen() as again:
            self.assertEqual(again.status(digest=True).map_digest, digest)
        # and repaired, but for the damaged block.
        done = subprocess.run(
            [FATHOMD, "mission", "repair", path, self.folder / "new.fathom",
             "--json"],
            capture_output=True, text=True, timeout=DEADLINE_S, check=True)
        repair = json.loads(done.stdout)
        self.assertEqual(repair["history_rows"], 5)
        self.assertIn("contact_history", repair["left_out"][0])
        server = self.reopen("new.fathom")
        self.assertEqual(server.status(digest=True).map_digest, digest)
        self.assertEqual(server.status().storage.fault, "")
        # A resend of all counts what was acknowledged once.
        answer = report_contacts(server, [fix_report(i, 5 * i, second=i)
                                          for i in range(1, 27)])
        self.assertEqual((answer.reports_duplicate, answer.reports_applied),
                         (25, 1))
        ack, _ = send_pings(server, [ping(i, [(105, 105, 20.0, 3.0)])
                                     for i in (1, 2)])
        self.assertEqual((ack.pings_duplicate, ack.pings_applied), (1, 1))
        self.assertEqual(server.terminate(), 0, server.log())


if __name__ == "__main__":
    unittest.main()
