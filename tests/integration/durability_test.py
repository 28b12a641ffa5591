"""SIGKILL under load: what was acknowledged durable is there, nothing counts
twice, and a restarted server answers byte for byte as before.

FATHOM_KILL_CYCLES: kills at random moments (default 10). FATHOM_SEED: repeats
a run; the seed is printed.
"""

import os
import random
import threading
import unittest

import grpc

from live_server import (DEADLINE_S, LiveTest, ask, at, fix_report,
                         import_chart, ingest, mission, obstacle, ping, point,
                         query, report_contacts, send_pings, start_activity,
                         types, wait_until)

CYCLES = int(os.environ.get("FATHOM_KILL_CYCLES", "10"))
SEED = int(os.environ.get("FATHOM_SEED", random.SystemRandom().randrange(10**6)))


class Vehicle:
    """A source that keeps all that it ever sent and what was acknowledged.

    The oracle: ping i has beams_of(i) beams, all of them good, so n pings
    taken once each are the sum of beams_of(1..n) measurements.
    """

    def __init__(self, seed, source="uuv-1"):
        self.rng = random.Random(seed)
        self.source = source
        self.pings = []  # pings[i] has sequence i + 1.
        self.lock = threading.Lock()
        self.durable = 0
        self.durable_reports = 0

    def new_ping(self):
        beams = [((self.rng.randrange(50) + 0.5) * 10,
                  (self.rng.randrange(50) + 0.5) * 10,
                  round(self.rng.uniform(15, 35), 2),
                  round(self.rng.uniform(0.2, 3), 2))
                 for _ in range(self.rng.randrange(1, 30))]
        message = ping(len(self.pings) + 1, beams, source=self.source,
                       second=len(self.pings))
        self.pings.append(message)
        return message

    def measurements(self, count):
        return sum(len(p.range_m) for p in self.pings[:count])

    def report(self, sequence):
        return fix_report(sequence, 100, 5 * sequence, second=sequence,
                          source=self.source)


class Load:
    """Feeds a server from threads until it dies: resends what is not durable,
    then new pings; reports in batches of three."""

    def __init__(self, server, vehicle):
        self.vehicle = vehicle
        self.server = server
        self.stop = threading.Event()
        self.codes = []
        self.threads = [threading.Thread(target=self.guard, args=(feed,))
                        for feed in (self.feed_pings, self.feed_reports)]
        for thread in self.threads:
            thread.start()

    def guard(self, feed):
        try:
            feed()
        except grpc.RpcError as error:
            self.codes.append(error.code())
        except ValueError:  # The channel was closed under the call.
            pass

    def feed_pings(self):
        vehicle = self.vehicle
        resend = list(vehicle.pings[vehicle.durable:])

        def messages():
            for message in resend:
                yield ingest.StreamPingsRequest(ping=message)
            while not self.stop.is_set():
                # At most 500 unacknowledged, as a real client's buffer.
                if len(vehicle.pings) - vehicle.durable < 500:
                    yield ingest.StreamPingsRequest(ping=vehicle.new_ping())
                elif self.stop.wait(0.001):
                    return
        for ack in self.server.ingest.StreamPings(messages()):
            vehicle.durable = max(vehicle.durable, ack.durable_sequence)

    def feed_reports(self):
        vehicle = self.vehicle
        while not self.stop.is_set():
            first = vehicle.durable_reports + 1
            report_contacts(self.server, [vehicle.report(i) for i in
                                          range(first, first + 3)])
            vehicle.durable_reports = first + 2

    def join(self):
        self.stop.set()
        for thread in self.threads:
            thread.join(DEADLINE_S)
            assert not thread.is_alive()


def accepted(server):
    return server.status().activities[0].measurements_accepted


def two_hundred_answers(server):
    """Serialised answers to 200 fixed questions, past and future."""
    rng = random.Random(200)
    return [server.obstacle.QueryObstacle(query(
        rng.uniform(-50, 550), rng.uniform(-50, 550), rng.uniform(0, 40),
        second=rng.randrange(3000), clearance_m=rng.choice([0, 2]),
        radius_m=rng.choice([0, 10])),
        timeout=DEADLINE_S).SerializeToString() for _ in range(200)]


class Durability(LiveTest):

    def test_killed_at_random_moments_under_load(self):
        print(f"FATHOM_SEED={SEED} FATHOM_KILL_CYCLES={CYCLES}", flush=True)
        rng = random.Random(SEED)
        vehicle = Vehicle(SEED)
        server = self.new_mission()
        self.addCleanup(lambda: server.__exit__())
        import_chart(server)
        start_activity(server)
        for cycle in range(CYCLES):
            where = f"cycle {cycle} of FATHOM_SEED={SEED}"
            pings_before = vehicle.durable
            reports_before = vehicle.durable_reports
            load = Load(server, vehicle)
            wait_until(lambda: vehicle.durable > pings_before
                       and vehicle.durable_reports > reports_before,
                       f"acks in {where}")
            # Not synchronisation: the random moment of the kill.
            load.stop.wait(rng.uniform(0, 0.3))
            server.process.kill()
            server.process.wait(timeout=DEADLINE_S)
            load.join()
            server.kill()
            durable = vehicle.durable
            self.assertTrue(set(load.codes) <= {
                grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED,
                grpc.StatusCode.UNKNOWN}, (where, load.codes))

            # All that was durable is there, and only whole pings beyond.
            server = self.reopen()
            held = accepted(server)
            prefix_sums = {}
            total = 0
            for count, message in enumerate(vehicle.pings, start=1):
                total += len(message.range_m)
                prefix_sums[total] = count
            self.assertGreaterEqual(held, vehicle.measurements(durable), where)
            self.assertIn(held, set(prefix_sums) | {0}, where)

            # A second kill without new input changes nothing at all.
            digest = server.status(digest=True).map_digest
            answers = two_hundred_answers(server)
            server.kill()
            server = self.reopen()
            self.assertEqual(server.status(digest=True).map_digest, digest,
                             where)
            self.assertEqual(two_hundred_answers(server), answers, where)

            # Resent from the last durable: the rest is taken, nothing twice.
            have = prefix_sums.get(held, 0)
            rest = vehicle.pings[durable:]
            if rest:
                ack, acks = send_pings(server, rest)
                self.assertEqual(ack.durable_sequence, len(vehicle.pings),
                                 where)
                self.assertEqual(ack.pings_duplicate, have - durable, where)
                self.assertEqual([g for a in acks for g in a.gaps], [], where)
                vehicle.durable = len(vehicle.pings)
            self.assertEqual(accepted(server),
                             vehicle.measurements(len(vehicle.pings)), where)

            # Resent from 1: all duplicates, the map stays as it is.
            digest = server.status(digest=True).map_digest
            ack, _ = send_pings(server, vehicle.pings)
            self.assertEqual(ack.pings_duplicate, len(vehicle.pings), where)
            self.assertEqual(ack.measurements_accepted, 0, where)
            resent = list(range(1, vehicle.durable_reports + 1))[-999:]
            answer = report_contacts(server, [vehicle.report(i)
                                              for i in resent])
            self.assertEqual(answer.reports_duplicate, len(resent), where)
            self.assertEqual(server.status(digest=True).map_digest, digest,
                             where)

            # The contact's history: every acknowledged report, each once.
            history = [e.time.seconds
                       for part in server.obstacle.GetContactHistory(
                           obstacle.GetContactHistoryRequest(
                               source_id=vehicle.source, contact_id="ship"),
                           timeout=DEADLINE_S) for e in part.estimates]
            self.assertEqual(len(history), len(set(history)), where)
            self.assertEqual(
                history[:vehicle.durable_reports],
                [at(i).seconds
                 for i in range(1, vehicle.durable_reports + 1)], where)
        print(f"{CYCLES} kills, {len(vehicle.pings)} pings, "
              f"{vehicle.measurements(len(vehicle.pings))} measurements, "
              f"{vehicle.durable_reports} reports", flush=True)
        # The survivor of all kills is the map of an undisturbed server.
        calm = self.new_mission(name="calm.fathom")
        with calm:
            import_chart(calm)
            start_activity(calm)
            send_pings(calm, vehicle.pings)
            for i in range(0, 200):
                rng2 = random.Random(i)
                place = (rng2.uniform(0, 500), rng2.uniform(0, 500))
                self.assertEqual(ask(server, *place).answer.seabed,
                                 ask(calm, *place).answer.seabed)

    def test_what_a_command_did_survives_the_kill_right_after_it(self):
        server = self.new_mission()
        self.addCleanup(lambda: server.__exit__())
        imported = import_chart(server)
        server.kill()
        server = self.reopen()
        self.assertEqual(server.status().stamp.map_revision,
                         imported.map_revision)
        self.assertEqual(ask(server, 105, 105).answer.seabed.kind,
                         types.EVIDENCE_KIND_PRIOR)

        start_activity(server)
        server.kill()
        server = self.reopen()
        self.assertTrue(server.status().activities[0].open)

        send_pings(server, [ping(1, [(105, 105, 20.0, 3.0)])])
        server.kill()
        server = self.reopen()
        # Eqs. 4.17 and 4.18: 30 + 16/25 x (20 - 30) = 23.6.
        local = ask(server, 105, 105).answer.seabed
        self.assertAlmostEqual(local.depth_m, 23.6, 3)
        self.assertEqual(local.layer, types.MAP_LAYER_LOCAL)

        moved = server.mission.TransferLocalMap(
            mission.TransferLocalMapRequest(activity_id="bay"),
            timeout=DEADLINE_S)
        self.assertEqual(moved.transfer.local_cells, 1)
        server.kill()
        server = self.reopen()
        again = server.mission.TransferLocalMap(
            mission.TransferLocalMapRequest(activity_id="bay"),
            timeout=DEADLINE_S)
        self.assertEqual(again.transfer.leaves_written, 0)

        done = server.mission.CompleteActivity(
            mission.CompleteActivityRequest(activity_id="bay"),
            timeout=DEADLINE_S)
        server.kill()
        server = self.reopen()
        self.assertGreaterEqual(server.status().stamp.map_revision,
                                done.map_revision)
        self.assertFalse(server.status().activities[0].open)
        after = ask(server, 105, 105).answer.seabed
        self.assertEqual(after.layer, types.MAP_LAYER_GLOBAL)
        # The global map widens a contradicted prior: see main_job_test.py.
        self.assertAlmostEqual(after.depth_m, 20.9, 1)

        report_contacts(server, [fix_report(1, 0, 0)])
        server.mission.DropContact(mission.DropContactRequest(
            source_id="c4i", contact_id="ship", time=at(10)),
            timeout=DEADLINE_S)
        server.kill()
        server = self.reopen()
        self.assertEqual(server.status().contacts.dropped, 1)

    def test_a_kill_in_the_middle_of_an_import_leaves_a_usable_mission(self):
        server = self.new_mission()
        self.addCleanup(lambda: server.__exit__())
        hold = threading.Event()
        sent = threading.Event()

        def parts():
            yield mission.ImportPriorRequest(
                header=mission.PriorHeader(name="chart"))
            for i in range(20):
                yield mission.ImportPriorRequest(tile=mission.DepthTile(
                    north_west=point(1000, 100 * i), latitude_step_deg=1e-4,
                    longitude_step_deg=1e-4, rows=50, columns=10,
                    depth_m=[20.0 + i] * 500, std_m=[1.0]))
            sent.set()
            hold.wait(DEADLINE_S)
        call = server.mission.ImportPrior.future(parts())
        self.assertTrue(sent.wait(DEADLINE_S))
        server.process.kill()
        server.process.wait(timeout=DEADLINE_S)
        with self.assertRaises(grpc.RpcError):
            call.result(timeout=DEADLINE_S)
        hold.set()
        server.kill()
        server = self.reopen()
        done = import_chart(server)
        self.assertEqual(done.cells_with_depth, 1000)
        self.assertEqual(ask(server, 105, -500).answer.seabed.kind,
                         types.EVIDENCE_KIND_PRIOR)

    def test_read_your_own_writes_by_min_revision(self):
        with self.new_mission() as server:
            start_activity(server)
            for i in range(1, 51):
                ack, _ = send_pings(server, [ping(i, [(105, 105, 20, 1.0)])])
                answer = server.obstacle.QueryObstacle(
                    query(105, 105, min_revision=ack.map_revision),
                    timeout=DEADLINE_S)
                self.assertGreaterEqual(answer.stamp.map_revision,
                                        ack.map_revision)
                # No prior: i soundings of 1 m are 1 / sqrt(i).
                self.assertAlmostEqual(answer.answer.seabed.std_m,
                                       i ** -0.5, 3)

    def test_a_question_waits_for_its_revision(self):
        with self.new_mission() as server:
            start_activity(server)
            now = server.status().stamp.map_revision
            waiting = server.obstacle.QueryObstacle.future(
                query(105, 105, min_revision=now + 1), timeout=DEADLINE_S)
            ack, _ = send_pings(server, [ping(1, [(105, 105, 20, 1.0)])])
            self.assertGreater(ack.map_revision, now)
            answer = waiting.result(timeout=DEADLINE_S)
            self.assertAlmostEqual(answer.answer.seabed.depth_m, 20, 3)

    def test_gaps_duplicates_and_new_epochs_are_told(self):
        beams = [(105, 105, 20.0, 1.0)]
        with self.new_mission() as server:
            start_activity(server)
            ack, acks = send_pings(server, [
                ping(i, beams) for i in (1, 2, 5, 3, 5, 9)])
            self.assertEqual(
                [(g.first_sequence, g.last_sequence)
                 for a in acks for g in a.gaps], [(3, 4), (6, 8)])
            # 3 comes after 5: it was reported missing and is a resend now.
            self.assertEqual(ack.pings_applied, 4)
            self.assertEqual(ack.pings_duplicate, 2)
            self.assertEqual(ack.durable_sequence, 9)
            self.assertEqual(accepted(server), 4)

            ack, _ = send_pings(server, [ping(1, beams, epoch=2)])
            self.assertEqual((ack.epoch, ack.pings_applied), (2, 1))
            ack, acks = send_pings(server, [ping(10, beams, epoch=1)])
            self.assertEqual(ack.pings_applied, 0)
            rejection = [r for a in acks for r in a.rejections][0]
            self.assertEqual(rejection.field, "ping.epoch")
            self.assertEqual(accepted(server), 5)

            # The other stream of the source is numbered by itself.
            answer = report_contacts(server, [fix_report(1, source="uuv-1")])
            self.assertEqual(answer.reports_applied, 1)


if __name__ == "__main__":
    unittest.main()
