"""The three watches of a live server: state, changes, resumption, slow
readers, alerts, limits."""

import random
import time
import unittest

import grpc

from live_server import (DEADLINE_S, LiveTest, at, chart_tile, fix_report,
                         import_chart, memory_bound_kb, mission, obstacle,
                         obstacle_rpc, ping, point, report_contacts,
                         send_pings, start_activity, types, wait_until)
from questions_test import AS_FREE, path
from watchers import (ContactsReader, RegionReader, TrajectoryReader,
                      region_of, wait_for_end)

def bay(resolution_m=10.0, south=-100, west=-100, north=600, east=600):
    return obstacle.GetRegionRequest(
        south_west=point(south, west), north_east=point(north, east),
        resolution_m=resolution_m)


def beams(rng, count=20):
    return [(rng.uniform(5, 495), rng.uniform(5, 495), rng.uniform(18, 22),
             0.3) for _ in range(count)]


class Regions(LiveTest):

    def test_state_and_changes_are_the_region_at_every_progress(self):
        rng = random.Random(5)
        with self.new_mission() as server:
            import_chart(server)
            start_activity(server, smoothing_distance_m=30,
                           smoothing_scale=0.9)
            # Cells of an odd size, and a part that the chart does not cover.
            area = bay(resolution_m=7.3, north=1700)
            reader = RegionReader(server, area)
            self.addCleanup(reader.cut)
            for step in range(1, 12):
                if step == 10:
                    server.mission.TransferLocalMap(
                        mission.TransferLocalMapRequest(activity_id="bay"),
                        timeout=DEADLINE_S)
                elif step == 11:
                    server.mission.CompleteActivity(
                        mission.CompleteActivityRequest(activity_id="bay"),
                        timeout=DEADLINE_S)
                else:
                    send_pings(server, [ping(step, beams(rng))])
                expected, revision = region_of(server, area)
                reader.wait_for_revision(revision)
                with reader.lock:
                    self.assertEqual(reader.revision, revision)
                    self.assertEqual(reader.cells, expected, step)
            self.assertEqual(reader.resyncs, [])
            stamps = [stamp for _, _, stamp in reader.tiles]
            self.assertEqual(stamps, sorted(stamps))

    def test_a_ping_costs_the_tiles_that_it_touches(self):
        with self.new_mission() as server:
            import_chart(server)
            start_activity(server)
            reader = RegionReader(server, bay(resolution_m=2))
            self.addCleanup(reader.cut)
            reader.wait_for_revision(1)
            # 350 x 350 cells are 22 x 22 tiles of 16 x 16.
            self.assertEqual(len(reader.tiles), 22 * 22)
            revision = server.status().stamp.map_revision
            send_pings(server, [ping(1, [(105, 105, 20, 0.3)])])
            reader.wait_for_revision(revision + 1)
            # A block of 32 x 32 local cells of 10 m is 320 m; with six cells
            # and two of ours to each side at most 448 m: 14 tiles of 32 m, 15
            # if it begins inside one.
            self.assertLessEqual(len(reader.tiles) - 22 * 22, 15 * 15)
            # A progress a second, though nothing in the area changes.
            report_contacts(server, [fix_report(1)])
            tiles = len(reader.tiles)
            reader.wait_for_revision(revision + 2)
            self.assertEqual(len(reader.tiles), tiles)

    def test_resumption_misses_nothing_and_sends_only_what_changed(self):
        rng = random.Random(6)
        with self.new_mission() as server:
            import_chart(server)
            start_activity(server)
            area = bay(resolution_m=2)
            reader = RegionReader(server, area)
            revision = server.status().stamp.map_revision
            reader.wait_for_revision(revision)
            cells = dict(reader.cells)
            everything = len(reader.tiles)
            reader.cut()
            send_pings(server, [ping(1, [(105, 105, 20, 0.3)])])
            again = RegionReader(server, area, from_revision=reader.revision,
                                 run_id=reader.run_id)
            expected, revision = region_of(server, area)
            again.wait_for_revision(revision)
            self.assertEqual(again.resyncs, [])
            self.assertLess(len(again.tiles), everything // 2)
            cells.update(again.cells)
            self.assertEqual(cells, expected)
            again.cut()
            # Of another run, or from the future: told, and sent anew.
            for resume in [dict(from_revision=revision, run_id=again.run_id + 1),
                           dict(from_revision=revision + 1000,
                                run_id=again.run_id)]:
                lost = RegionReader(server, area, **resume)
                lost.wait_for_revision(revision)
                self.assertEqual(len(lost.resyncs), 1)
                self.assertEqual(lost.cells, expected)
                lost.cut()
            del rng

    def test_an_activity_that_ends_ends_its_watch(self):
        with self.new_mission() as server:
            start_activity(server)
            area = bay()
            area.activity_id = "bay"
            reader = RegionReader(server, area)
            reader.wait_for_revision(1)
            server.mission.CompleteActivity(
                mission.CompleteActivityRequest(activity_id="bay"),
                timeout=DEADLINE_S)
            wait_for_end([reader])
            self.assertEqual(reader.error.code(),
                             grpc.StatusCode.FAILED_PRECONDITION)
            missing = bay()
            missing.activity_id = "never"
            self.assert_status(
                grpc.StatusCode.NOT_FOUND, server.obstacle.WatchRegion,
                obstacle.WatchRegionRequest(region=missing))
            self.assert_field(
                "region.resolution_m", server.obstacle.WatchRegion,
                obstacle.WatchRegionRequest(region=bay(resolution_m=0)))


class Contacts(LiveTest):

    def test_state_changes_and_drop(self):
        with self.new_mission() as server:
            report_contacts(server, [fix_report(i, contact=f"ship{i}")
                                     for i in range(1, 6)])
            reader = ContactsReader(server)
            self.addCleanup(reader.cut)
            reader.wait_for_revision(5)
            self.assertEqual(sorted(c for _, c in reader.contacts),
                             [f"ship{i}" for i in range(1, 6)])
            report_contacts(server, [fix_report(6, second=10, contact="ship3")])
            reader.wait_for_revision(6)
            self.assertEqual(reader.events[5:], [("ship3", 2, 6)])
            server.mission.DropContact(
                mission.DropContactRequest(source_id="c4i",
                                           contact_id="ship2"),
                timeout=DEADLINE_S)
            reader.wait_for_revision(7)
            self.assertEqual(reader.contacts[("c4i", "ship2")].status,
                             types.CONTACT_STATUS_DROPPED)
            # The estimate is the one that ListContacts gives for its time.
            told = reader.contacts[("c4i", "ship3")]
            listed = server.obstacle.ListContacts(
                obstacle.ListContactsRequest(time=told.time),
                timeout=DEADLINE_S)
            self.assertIn(told, listed.contacts)

    def test_resumption_misses_nothing_and_doubles_nothing(self):
        with self.new_mission() as server:
            report_contacts(server, [fix_report(i, contact=f"ship{i}")
                                     for i in range(1, 401)])
            reader = ContactsReader(server)
            reader.wait_for_revision(400)
            self.assertEqual(len(reader.events), 400)
            reader.cut()
            # 300 change, every other one twice.
            reports = [fix_report(1000 + i, second=10, contact=f"ship{i}")
                       for i in range(1, 301)]
            reports += [fix_report(2000 + i, second=20, contact=f"ship{i}")
                        for i in range(1, 301, 2)]
            report_contacts(server, reports)
            again = ContactsReader(server, from_revision=reader.revision,
                                   run_id=reader.run_id)
            self.addCleanup(again.cut)
            again.wait_for_revision(850)
            self.assertEqual(again.resyncs, [])
            self.assertEqual(
                sorted((c, n) for c, n, _ in again.events),
                sorted((f"ship{i}", 3 if i % 2 else 2) for i in range(1, 301)))

    def test_batches_tell_the_same_in_fewer_messages(self):
        with self.new_mission() as server:
            report_contacts(server, [fix_report(i, contact=f"ship{i}")
                                     for i in range(1, 251)])
            reader = ContactsReader(server, batched=True)
            reader.wait_for_revision(250)
            self.assertEqual(reader.batches, [100, 100, 50])
            report_contacts(server, [fix_report(251, second=10,
                                                contact="ship3")])
            reader.wait_for_revision(251)
            self.assertEqual(reader.batches, [100, 100, 50, 1])
            self.assertEqual(reader.events[250:], [("ship3", 2, 251)])
            reader.cut()
            report_contacts(server, [
                fix_report(1000 + i, second=20, contact=f"ship{i}")
                for i in range(1, 151)])
            again = ContactsReader(server, batched=True, run_id=reader.run_id,
                                   from_revision=reader.revision)
            self.addCleanup(again.cut)
            again.wait_for_revision(401)
            self.assertEqual(again.resyncs, [])
            self.assertEqual(again.batches, [100, 50])
            self.assertEqual(sorted((c, n) for c, n, _ in again.events),
                             sorted((f"ship{i}", 3 if i == 3 else 2)
                                    for i in range(1, 151)))

    def test_a_restarted_server_resynchronises(self):
        with self.new_mission() as server:
            report_contacts(server, [fix_report(1)])
            reader = ContactsReader(server)
            reader.wait_for_revision(1)
            server.kill()
        with self.reopen() as server:
            report_contacts(server, [fix_report(2, contact="other")])
            again = ContactsReader(server, from_revision=reader.revision,
                                   run_id=reader.run_id)
            self.addCleanup(again.cut)
            again.wait_for_revision(2)
            self.assertEqual(len(again.resyncs), 1)
            self.assertEqual(len(again.contacts), 2)


class SlowReaders(LiveTest):

    def test_are_told_and_resynchronised_and_cost_no_memory(self):
        with self.new_mission() as server:
            kept = server.status().limits.max_kept_changes
            start_activity(server, north_extent_m=5000, east_extent_m=5000,
                           cell_size_m=1, max_range_m=8000)
            area = bay(resolution_m=10, south=0, west=0, north=5000, east=5000)
            # Nobody reads these: each sends until its window is full. Without
            # the probe the window stays at 64 KiB: a quick machine would else
            # widen it until all that comes fits into it.
            narrow = grpc.insecure_channel(
                server.address, options=[("grpc.http2.bdp_probe", 0)])
            self.addCleanup(narrow.close)
            unread = obstacle_rpc.ObstacleServiceStub(narrow)
            stuck = [unread.WatchRegion(
                obstacle.WatchRegionRequest(region=area)) for _ in range(20)]
            for call in stuck:
                next(call)
            report_contacts(server, [fix_report(1)])
            reader = RegionReader(server, area)
            self.addCleanup(reader.cut)
            # One beam into each block of 32 m: more than are remembered.
            centres = [(32 * i + 16, 32 * j + 16, 20.0, 0.3)
                       for i in range(156) for j in range(156)]
            self.assertGreater(len(centres), kept)
            grown_kb, accepted = [], 0
            for turn in range(3):
                before_kb = server.resident_kb()
                messages = [ping(1 + 100 * turn + n // 500,
                                 centres[n:n + 500], second=turn)
                            for n in range(0, len(centres), 500)]
                for message in messages:
                    ack, _ = send_pings(server, [message])
                    accepted += ack.measurements_accepted
                grown_kb.append(server.resident_kb() - before_kb)
            self.assertEqual(accepted, 3 * len(centres))
            revision = server.status().stamp.map_revision
            # The first turn makes the map. Then 20 stuck readers of 250 000
            # cells keep nothing of the 24 336 blocks that were replaced twice:
            # views held for them would be 32 MB a turn and more.
            self.assertLess(grown_kb[2], memory_bound_kb(16_000), grown_kb)
            print("grown by kB a turn:", grown_kb)
            reader.wait_for_revision(revision)
            expected, _ = region_of(server, area)
            self.assertEqual(reader.cells, expected)
            # A stuck one reads on: it is told, and has all in the end.
            late = RegionReader.__new__(RegionReader)
            late.cells, late.tiles = {}, []
            super(RegionReader, late).__init__(lambda _: stuck[0], None)
            late.wait_for_revision(revision)
            self.assertEqual(len(late.resyncs), 1)
            self.assertGreater(late.resyncs[0], 0)
            self.assertEqual(late.cells, expected)
            for call in stuck:
                call.cancel()


class Trajectories(LiveTest):

    def along(self, **kwargs):
        """East along north 255 m at 10 m depth, a minute long."""
        return path((255, 50, 10, 0), (255, 450, 10, 60), unknown=AS_FREE,
                    **kwargs)

    def test_a_ping_raises_the_alert_and_better_ones_clear_it(self):
        with self.new_mission() as server:
            import_chart(server, chart_tile(std_m=1.0))
            start_activity(server)
            reader = TrajectoryReader(server, self.along(), hysteresis=0.2)
            self.addCleanup(reader.cut)
            reader.wait(lambda: reader.alert is False, "the first verdict")
            sent = time.monotonic()
            send_pings(server, [ping(1, [(255, 305, 3.0, 0.05)])])
            reader.wait(lambda: reader.alert is True, "the alert")
            took_s = reader.flips[-1][1] - sent
            print(f"alert after {1000 * took_s:.1f} ms (with the ping's ack)")
            self.assertEqual(reader.verdict.first_conflict.leg_index, 0)
            asked = server.obstacle.CheckTrajectory(
                obstacle.CheckTrajectoryRequest(trajectory=self.along()),
                timeout=DEADLINE_S)
            told = obstacle.CheckTrajectoryResponse()
            told.CopyFrom(reader.verdict)
            told.ClearField("stamp")
            asked.ClearField("stamp")
            self.assertEqual(told, asked)
            # Elsewhere nothing changes; a progress says so.
            send_pings(server, [ping(2, [(455, 45, 20.0, 0.5)])])
            reader.wait_for_revision(server.status().stamp.map_revision)
            self.assertEqual(len(reader.flips), 2)

    def test_a_contact_raises_the_alert_and_its_drop_clears_it(self):
        with self.new_mission() as server:
            import_chart(server, chart_tile(std_m=1.0))
            reader = TrajectoryReader(server, path(
                (250, 50, 3, 0), (250, 450, 3, 60), unknown=AS_FREE))
            self.addCleanup(reader.cut)
            reader.wait(lambda: reader.alert is False, "the first verdict")
            report_contacts(server, [fix_report(1, 250, 250, ve=0)])
            reader.wait(lambda: reader.alert is True, "the alert")
            conflict = reader.verdict.first_conflict
            self.assertEqual(conflict.answer.contacts[0].contact_id, "ship")
            server.mission.DropContact(
                mission.DropContactRequest(source_id="c4i", contact_id="ship",
                                           time=at(1)),
                timeout=DEADLINE_S)
            reader.wait(lambda: reader.alert is False, "the end of the alert")

    def test_bad_requests(self):
        with self.new_mission() as server:
            for field, request in [
                    ("hysteresis", obstacle.WatchTrajectoryRequest(
                        trajectory=self.along(), hysteresis=0.5)),
                    ("hysteresis", obstacle.WatchTrajectoryRequest(
                        trajectory=self.along(), hysteresis=float("nan"))),
                    ("trajectory.confidence", obstacle.WatchTrajectoryRequest(
                        trajectory=self.along(confidence=0.4)))]:
                self.assert_field(field, server.obstacle.WatchTrajectory,
                                  request)


class Bounds(LiveTest):

    def test_watchers_at_the_limit_and_past_it(self):
        with self.new_mission() as server:
            limits = server.status().limits
            along = Trajectories().along()
            watch = obstacle.WatchTrajectoryRequest(trajectory=along)
            paths = [server.obstacle.WatchTrajectory(watch)
                     for _ in range(limits.max_trajectory_watchers)]
            for call in paths:
                next(call)
            error = self.assert_status(grpc.StatusCode.RESOURCE_EXHAUSTED,
                                       server.obstacle.WatchTrajectory, watch)
            self.assertIn("trajectory watches", error.details())
            others = [server.obstacle.WatchContacts(
                obstacle.WatchContactsRequest())
                for _ in range(limits.max_watchers - len(paths))]
            for call in others:
                next(call)
            error = self.assert_status(grpc.StatusCode.RESOURCE_EXHAUSTED,
                                       server.obstacle.WatchContacts,
                                       obstacle.WatchContactsRequest())
            self.assertIn(str(limits.max_watchers), error.details())
            # One that ends makes room.
            others[0].cancel()

            def there_is_room():
                try:
                    next(server.obstacle.WatchContacts(
                        obstacle.WatchContactsRequest()))
                    return True
                except grpc.RpcError:
                    return False
            wait_until(there_is_room, "room for another watch")

    def test_a_path_through_too_many_cells_is_refused(self):
        with self.new_mission() as server:
            limit = server.status().limits.max_watch_cells
            # 1 km x 1 km at 1 m; a radius of 480 m sweeps nearly all of it.
            start_activity(server, north_extent_m=1000, east_extent_m=1000,
                           cell_size_m=1)
            wide = path((500, 490, 10, 0), (500, 510, 10, 60), radius_m=480)
            self.assertGreater(480 * 480 * 3, limit)
            error = self.assert_status(
                grpc.StatusCode.RESOURCE_EXHAUSTED,
                server.obstacle.WatchTrajectory,
                obstacle.WatchTrajectoryRequest(trajectory=wide))
            self.assertIn(str(limit), error.details())
            # CheckTrajectory has room for it; a narrower one can be watched.
            server.obstacle.CheckTrajectory(
                obstacle.CheckTrajectoryRequest(trajectory=wide),
                timeout=DEADLINE_S)
            narrow = path((500, 490, 10, 0), (500, 510, 10, 60), radius_m=200)
            call = server.obstacle.WatchTrajectory(
                obstacle.WatchTrajectoryRequest(trajectory=narrow))
            self.assertTrue(next(call).HasField("verdict"))
            call.cancel()

    def test_fifty_subscribers_all_see_everything(self):
        rng = random.Random(7)
        with self.new_mission() as server:
            import_chart(server)
            start_activity(server)
            area = bay(resolution_m=20)
            regions = [RegionReader(server, area) for _ in range(10)]
            contacts = [ContactsReader(server, batched=i % 2 == 0)
                        for i in range(30)]
            paths = [TrajectoryReader(server, Trajectories().along())
                     for _ in range(10)]
            sequence = 0
            for step in range(1, 21):
                send_pings(server, [ping(step, beams(rng))])
                reports = []
                for k in range(50):
                    sequence += 1
                    reports.append(fix_report(sequence, second=step,
                                              contact=f"ship{k}"))
                report_contacts(server, reports)
            expected, revision = region_of(server, area)
            for reader in regions + contacts + paths:
                reader.wait_for_revision(revision)
                self.assertEqual(reader.resyncs, [])
            for reader in regions:
                self.assertEqual(reader.cells, expected)
            for reader in contacts:
                self.assertEqual(len(reader.contacts), 50)
                for estimate in reader.contacts.values():
                    self.assertEqual(estimate.report_count, 20)
            # A server that stops tells all of them.
            self.assertEqual(server_stops(server, regions + contacts + paths),
                             {grpc.StatusCode.UNAVAILABLE})


def server_stops(server, readers):
    """SIGTERM; the codes with which the watches end."""
    server.process.terminate()
    wait_for_end(readers)
    server.process.wait(timeout=DEADLINE_S)
    return {reader.error.code() for reader in readers}


if __name__ == "__main__":
    unittest.main()
