"""Many calls at once that break off in every way a client can: cancelled,
out of time after 1 ms, half-closed, cut with their connection - and a SIGTERM
in the middle. The server neither crashes nor leaks calls nor grows, and what
it acknowledged is there afterwards. Seeded; bounded to about half a minute.
"""

import random
import threading
import time
import unittest

import grpc

from live_server import (DEADLINE_S, LiveTest, ask, at, import_chart, ingest,
                         ingest_rpc, mission, mission_rpc, obstacle,
                         obstacle_rpc, ping, point, send_pings, start_activity,
                         types, wait_until)

WORKERS = 8
SECONDS = 4
# What a client that breaks off, or a server that drains or is full, may see.
EXPECTED = {grpc.StatusCode.CANCELLED, grpc.StatusCode.DEADLINE_EXCEEDED,
            grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.RESOURCE_EXHAUSTED}


def region_request(side_m, resolution_m):
    return obstacle.GetRegionRequest(
        south_west=point(0, 0), north_east=point(side_m, side_m),
        resolution_m=resolution_m)


def batch_request(points):
    return obstacle.QueryObstaclesRequest(
        latitude_deg=[41.501] * points, longitude_deg=[-71.399] * points,
        depth_m=[10] * points, time=at(0), confidence=0.9)


class Worker(threading.Thread):
    """One client with a connection of its own; does random calls."""

    def __init__(self, address, number, stop):
        super().__init__()
        self.random = random.Random(number)
        self.number = number
        self.stop = stop
        self.address = address
        self.streams = 0
        # By source: the last number that the server called durable.
        self.durable = {}
        self.unexpected = []
        self.calls = 0

    def run(self):
        while not self.stop.is_set():
            # Options make the connection this worker's own.
            channel = grpc.insecure_channel(
                self.address, options=[("fathom.worker", self.number)])
            self.obstacle = obstacle_rpc.ObstacleServiceStub(channel)
            self.ingest = ingest_rpc.IngestServiceStub(channel)
            self.mission = mission_rpc.MissionServiceStub(channel)
            try:
                for _ in range(self.random.randint(1, 12)):
                    self.one_call()
                    if self.stop.is_set():
                        break
            finally:
                channel.close()

    def one_call(self):
        self.calls += 1
        call = self.random.choice([self.region, self.batch, self.pings,
                                   self.status, self.broken_import])
        try:
            call()
        except grpc.RpcError as error:
            if error.code() not in EXPECTED:
                self.unexpected.append(f"{call.__name__}: {error}")
        except Exception as error:  # noqa: BLE001 - reported by the test.
            self.unexpected.append(f"{call.__name__}: {error!r}")

    def region(self):
        stream = self.obstacle.GetRegion(
            region_request(20_000, 10),
            timeout=self.random.choice([0.001, 0.05, DEADLINE_S]))
        for _ in range(self.random.randint(0, 3)):
            next(stream)
        stream.cancel()

    def batch(self):
        call = self.obstacle.QueryObstacles.future(
            batch_request(self.random.choice([1, 1000, 20_000])),
            timeout=self.random.choice([0.001, DEADLINE_S]))
        if self.random.random() < 0.3:
            call.cancel()
            return
        call.result()

    def status(self):
        self.mission.GetMissionStatus(
            mission.GetMissionStatusRequest(with_digest=True),
            timeout=self.random.choice([0.001, DEADLINE_S]))

    def broken_import(self):
        """A header and an end: a chart of nothing; or a tile without one."""
        parts = [mission.ImportPriorRequest(
            header=mission.PriorHeader(name="empty"))]
        self.mission.ImportPrior(iter(parts), timeout=DEADLINE_S)

    def pings(self):
        self.streams += 1
        source = f"w{self.number}-{self.streams}"
        count = self.random.randint(1, 200)
        hold = threading.Event()
        half_close = self.random.random() < 0.5

        def messages():
            for sequence in range(1, count + 1):
                yield ingest.StreamPingsRequest(ping=ping(
                    sequence, [(105, 105, 20.0, 1.0)] * 20, source=source))
            if not half_close:
                hold.wait(5)
        stream = self.ingest.StreamPings(messages(), timeout=DEADLINE_S)
        try:
            for ack in stream:
                self.durable[source] = ack.durable_sequence
                if not half_close:
                    break
        finally:
            hold.set()
            stream.cancel()


class Stress(LiveTest):

    def run_workers(self, server, seconds, end):
        stop = threading.Event()
        workers = [Worker(server.address, n, stop) for n in range(WORKERS)]
        for worker in workers:
            worker.start()
        time.sleep(seconds)
        taken_s = end()
        stop.set()
        for worker in workers:
            worker.join(timeout=DEADLINE_S)
            self.assertFalse(worker.is_alive(), "a call never ended")
        return workers, taken_s

    def test_calls_that_break_off_leave_nothing_behind(self):
        with self.new_mission() as server:
            import_chart(server)
            start_activity(server)
            self.run_workers(server, 2, lambda: None)  # Warms the allocator.
            before_kb = server.resident_kb()
            workers, _ = self.run_workers(server, SECONDS, lambda: None)
            self.assertEqual([w.unexpected for w in workers if w.unexpected],
                             [])
            self.assertGreater(sum(w.calls for w in workers), 100)
            self.assertIsNone(server.process.poll(), server.log())

            # No call of theirs holds a slot: as many streams as are allowed
            # can be open at once, and one more is refused.
            limit = server.status().limits.max_bulk_streams

            def open_all():
                held = []
                try:
                    for _ in range(limit):
                        stream = server.obstacle.GetRegion(
                            region_request(20_000, 10), timeout=DEADLINE_S)
                        held.append(stream)
                        next(stream)
                    with self.assertRaises(grpc.RpcError) as caught:
                        next(server.obstacle.GetRegion(
                            region_request(500, 10), timeout=DEADLINE_S))
                    self.assertEqual(caught.exception.code(),
                                     grpc.StatusCode.RESOURCE_EXHAUSTED)
                    self.assertIn(str(limit), caught.exception.details())
                    return True
                except grpc.RpcError:
                    return False  # The last of theirs is just ending.
                finally:
                    for stream in held:
                        stream.cancel()
            wait_until(open_all, "every stream of the clients to be let go")
            ingest_limit = server.status().limits.max_ingest_streams
            for number in range(ingest_limit):
                last, _ = send_pings(server, [
                    ping(1, [(105, 105, 20.0, 1.0)], source=f"after-{number}")])
                self.assertEqual(last.durable_sequence, 1)
            # 64 regions of one 1.4 MB block each, and what the heap keeps.
            self.assertLess(server.resident_kb() - before_kb, 400_000)
            self.assertEqual(ask(server, 405, 405, depth_m=5).answer.state,
                             types.OBSTACLE_STATE_FREE)
            self.assertEqual(server.terminate(), 0, server.log())

    def test_sigterm_under_load_drains_in_time(self):
        with self.new_mission() as server:
            import_chart(server)
            start_activity(server)

            def end():
                begin = time.monotonic()
                self.assertEqual(server.terminate(), 0, server.log())
                return time.monotonic() - begin
            workers, taken_s = self.run_workers(server, 2, end)
            # limits.h: calls get 10 s to end, then they are cut.
            self.assertLess(taken_s, 20)
            self.assertEqual([w.unexpected for w in workers if w.unexpected],
                             [])
        durable = {}
        for worker in workers:
            durable.update(worker.durable)
        self.assertGreater(len(durable), 0)
        with self.reopen() as again:
            # A resend of what was called durable is known, number by number.
            for source, sequence in list(durable.items())[:20]:
                if sequence == 0:
                    continue
                last, _ = send_pings(again, [
                    ping(n, [(105, 105, 20.0, 1.0)], source=source)
                    for n in range(1, sequence + 1)])
                self.assertEqual(last.pings_duplicate, sequence, source)
                self.assertEqual(last.pings_applied, 0, source)


if __name__ == "__main__":
    unittest.main()
