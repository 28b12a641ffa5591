"""Clients that mean harm: more streams than anyone needs, messages that never
end, readers that never read, connections that say nothing, calls that are
cancelled as soon as they are made. Whatever they do the server's memory stays
within a stated bound of what it was, others are answered meanwhile, and nothing
is left behind. (Malformed bytes: bad_input_test.py; calls that break off:
stress_test.py.)
"""

import contextlib
import json
import math
import socket
import struct
import threading
import time
import unittest

import grpc

from live_server import (DEADLINE_S, SANITIZED, LiveTest, import_chart,
                         ingest_rpc, memory_bound_kb, obstacle, obstacle_rpc,
                         point, types)

# More than before, at the most, where a test does not say otherwise: 128 MB for
# what is on the way (limits.h), 64 bulk streams of 1.5 MB, and as much again
# for what the allocator keeps.
MEMORY_BOUND_MB = 384
# Other clients ask again when a connection was let go, or a call was ended to
# make room (gRPC does not look whose it was). Five times is gRPC's most: 1.5 s
# in all, twice that with a sanitizer, where all is slower.
FIRST_S, LONGEST_S = (0.2, 2) if SANITIZED else (0.1, 1)
RETRY = json.dumps({"methodConfig": [{
    "name": [{}], "retryPolicy": {
        "maxAttempts": 5, "initialBackoff": f"{FIRST_S}s",
        "maxBackoff": f"{LONGEST_S}s",
        "backoffMultiplier": 2, "retryableStatusCodes": ["UNAVAILABLE", "RESOURCE_EXHAUSTED"]}}]})
# limits.h: a silent connection is asked after 20 s and let go 10 s later.
SILENCE_S = 30

STREAMS = 10_000
QUERY = "/fathom.v1.ObstacleService/QueryObstacles"
DATA, HEADERS, RST_STREAM, SETTINGS = 0, 1, 3, 4
END_HEADERS = 4


def frame(kind, flags, stream, payload=b""):
    return (struct.pack(">I", len(payload))[1:] + bytes([kind, flags])
            + struct.pack(">I", stream) + payload)


def headers(method, stream):
    """HEADERS of a call, HPACK literals without indexing (RFC 7541, 6.2.2)."""
    block = b""
    for name, value in [(":method", "POST"), (":scheme", "http"),
                        (":path", method), (":authority", "map"),
                        ("content-type", "application/grpc"),
                        ("te", "trailers")]:
        block += bytes([0, len(name)]) + name.encode()
        block += bytes([len(value)]) + value.encode()
    return frame(HEADERS, END_HEADERS, stream, block)


class RawConnection:
    """HTTP/2 by hand: sends what it likes; throws away what comes, or leaves
    it lying."""

    def __init__(self, address, handshake=True, reads=False):
        host, port = address.rsplit(":", 1)
        self.socket = socket.create_connection((host, int(port)), timeout=5)
        if handshake:
            self.send(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
                      + frame(SETTINGS, 0, 0))
        if reads:
            threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        with contextlib.suppress(OSError):
            while self.socket.recv(65536):
                pass

    def send(self, data):
        """False once the server has closed the connection."""
        try:
            self.socket.sendall(data)
            return True
        except OSError:
            return False

    def close(self):
        self.socket.close()


class Hostile(LiveTest):

    bound_mb = MEMORY_BOUND_MB

    def setUp(self):
        super().setUp()
        self.server = self.enterContext(self.new_mission())
        import_chart(self.server)
        self.others_are_answered()
        self.before_mb = self.server.resident_kb() / 1024
        self.peak_mb = self.before_mb

    def others_are_answered(self):
        """A client with a connection of its own, which knows no harm."""
        with grpc.insecure_channel(
                self.server.address,
                options=[("grpc.use_local_subchannel_pool", 1),
                         ("grpc.service_config", RETRY)]) as channel:
            stub = obstacle_rpc.ObstacleServiceStub(channel)
            for _ in range(20):
                answer = stub.QueryObstacle(
                    obstacle.QueryObstacleRequest(
                        position=point(105, 105), depth_m=5, confidence=0.95),
                    timeout=DEADLINE_S).answer
                self.assertEqual(answer.state, types.OBSTACLE_STATE_FREE)

    def look(self):
        self.assertIsNone(self.server.process.poll(), self.server.log())
        self.peak_mb = max(self.peak_mb, self.server.resident_kb() / 1024)

    def tearDown(self):
        self.look()
        self.others_are_answered()
        grown = self.peak_mb - self.before_mb
        print(f"{self._testMethodName}: {grown:.0f} MB more at the most")
        self.assertLess(1024 * grown, memory_bound_kb(1024 * self.bound_mb))
        # Streams and calls that are gone hold nothing: SIGTERM ends at once.
        self.assertEqual(self.server.terminate(), 0, self.server.log())
        super().tearDown()

    @contextlib.contextmanager
    def connections(self, count, **kwargs):
        opened = [RawConnection(self.server.address, **kwargs)
                  for _ in range(count)]
        try:
            yield opened
        finally:
            for connection in opened:
                connection.close()

    def send_parts(self, opened, streams, rounds):
        """On each connection so many calls, each of which claims a message of
        8 MiB and sends rounds x 60 kB of it, all at once."""
        begin = struct.pack(">BI", 0, 8 << 20)
        for round_ in range(rounds):
            for n in range(streams):
                stream = 2 * n + 1
                part = b"".join(frame(DATA, 0, stream, bytes(15_000))
                                for _ in range(4))
                if round_ == 0:
                    part = headers(QUERY, stream) + frame(
                        DATA, 0, stream, begin) + part
                for connection in opened:
                    connection.send(part)
            self.look()

    def test_ten_thousand_messages_that_never_end(self):
        # 60 kB of each came before anything can be done about it, and 10 kB
        # are gRPC's own: 700 MB.
        self.bound_mb = 800
        with self.connections(20) as opened:
            self.send_parts(opened, STREAMS // 20, 1)
            self.others_are_answered()

    def test_messages_that_grow_for_ever(self):
        # 4 x 100 x 6 MB: 2.4 GB, were they all kept, as they were without the
        # bound. gRPC ends streams beside the flood, which loopback's 1 GB/s
        # outruns: 0.5 to 0.7 GB met.
        self.bound_mb = 1200
        with self.connections(4, reads=True) as opened:
            self.send_parts(opened, 100, 100)
            self.others_are_answered()

    def test_giant_messages(self):
        giant = bytes(100 << 20)

        def send(channel, codes, reasons):
            until = time.monotonic() + DEADLINE_S
            while time.monotonic() < until:
                try:
                    channel.unary_unary(QUERY)(giant, timeout=DEADLINE_S,
                                               wait_for_ready=True)
                    return
                except grpc.RpcError as error:
                    reasons.append(error.details())
                    # The server may end the connection (GOAWAY) where giants
                    # fill its memory before their size is looked at. Who is cut
                    # off so asks again, and is to be told the reason.
                    if error.code() != grpc.StatusCode.UNAVAILABLE:
                        codes.append(error.code())
                        return
        codes = []
        reasons = []
        with contextlib.ExitStack() as stack:
            channels = [stack.enter_context(grpc.insecure_channel(
                self.server.address,
                options=[("grpc.use_local_subchannel_pool", 1),
                         ("grpc.max_send_message_length", -1)]))
                        for _ in range(4)]
            threads = [threading.Thread(target=send,
                                        args=(channel, codes, reasons))
                       for channel in channels]
            for thread in threads:
                thread.start()
            self.others_are_answered()
            for thread in threads:
                thread.join(DEADLINE_S)
                self.look()
        self.assertEqual(codes, [grpc.StatusCode.RESOURCE_EXHAUSTED] * 4,
                         reasons)

    def test_slow_readers(self):
        """200 regions of 12 M cells each, of which nobody reads a byte more
        than comes by itself."""
        half_m = 4 * math.isqrt(12_000_000) / 2
        request = obstacle.GetRegionRequest(
            south_west=point(-half_m, -half_m),
            north_east=point(half_m, half_m), resolution_m=4)
        with contextlib.ExitStack() as stack:
            streams = []
            for _ in range(20):
                channel = stack.enter_context(grpc.insecure_channel(
                    self.server.address,
                    options=[("grpc.use_local_subchannel_pool", 1)]))
                stub = obstacle_rpc.ObstacleServiceStub(channel)
                streams += [stub.GetRegion(request) for _ in range(10)]
            limit = self.server.status().limits.max_bulk_streams
            # The first message of those that were let in; the others are
            # refused.
            outcomes = [self.first(stream) for stream in streams]
            self.assertEqual(outcomes.count("tile"), limit)
            self.assertEqual(
                outcomes.count(grpc.StatusCode.RESOURCE_EXHAUSTED),
                200 - limit)
            self.look()
            self.others_are_answered()
            for stream in streams:
                stream.cancel()

    @staticmethod
    def first(stream):
        try:
            next(stream)
            return "tile"
        except grpc.RpcError as error:
            return error.code()

    def test_half_open_connections_are_let_go(self):
        """A cable is pulled: no FIN, no answer to a sign of life."""
        with self.connections(1000, handshake=False), \
                self.connections(200) as opened:
            for connection in opened:
                connection.send(headers("/fathom.v1.IngestService/StreamPings",
                                        1))
            self.look()
            self.others_are_answered()
            for connection in opened:
                connection.socket.settimeout(SILENCE_S + DEADLINE_S)
                # Reads the server's frames without answering any, to the end.
                with contextlib.suppress(ConnectionError):
                    while connection.socket.recv(4096):
                        pass
            self.look()
        # Their streams are let go with them.
        self.assertEqual(self.refused_ingest_streams(), 0)

    def refused_ingest_streams(self):
        """How many of as many streams as are allowed are refused now."""
        limit = self.server.status().limits.max_ingest_streams
        with grpc.insecure_channel(self.server.address) as channel:
            stub = ingest_rpc.IngestServiceStub(channel)
            hold = threading.Event()

            def nothing():
                hold.wait(DEADLINE_S)
                yield from ()
            streams = [stub.StreamPings(nothing()) for _ in range(limit)]
            threads = []
            refused = []

            def drain(stream):
                try:
                    list(stream)
                except grpc.RpcError as error:
                    refused.append(error.code())
            for stream in streams:
                thread = threading.Thread(target=drain, args=(stream,))
                thread.start()
                threads.append(thread)
            hold.set()
            for thread in threads:
                thread.join(DEADLINE_S)
        return len(refused)

    def test_ten_thousand_calls_cancelled_at_once(self):
        points = 1000
        request = obstacle.QueryObstaclesRequest(
            latitude_deg=[41.501] * points, longitude_deg=[-71.399] * points,
            depth_m=[10] * points, confidence=0.9)
        for batch in range(20):
            calls = [self.server.obstacle.QueryObstacles.future(request)
                     for _ in range(STREAMS // 20)]
            for call in calls:
                call.cancel()
            if batch % 5 == 0:
                self.look()
                self.others_are_answered()

    def test_streams_that_are_reset_at_once(self):
        """CVE-2023-44487, ten connections of a thousand streams."""
        cancel = struct.pack(">I", 8)
        with self.connections(10, reads=True) as opened:
            for n in range(STREAMS // 10):
                stream = 2 * n + 1
                for connection in opened:
                    connection.send(headers(QUERY, stream) + frame(
                        RST_STREAM, 0, stream, cancel))
                if n % 200 == 0:
                    self.look()
            self.others_are_answered()


if __name__ == "__main__":
    unittest.main()
