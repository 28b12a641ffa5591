"""Readers of the three watches: each follows a stream on a thread of its own
and keeps the state that the messages build up."""

import struct
import threading
import time

import grpc

from live_server import DEADLINE_S, obstacle, wait_until

# What of a tile is compared: everything but ages, which count to now.
PLANES = ["depth_m", "std_m", "shoalest_m", "hazard_m", "kind", "layer"]


def cells_of(tile):
    """{(row, column): bytes} of a RegionTile, bit for bit."""
    planes = []
    for name in PLANES:
        values = getattr(tile, name)
        if name in ("kind", "layer"):
            planes.append([bytes([v]) for v in values])
        elif len(values) == 0:  # hazard_m: none in the block.
            planes.append([struct.pack("f", float("nan"))]
                          * (tile.rows * tile.columns))
        else:
            planes.append([struct.pack("f", v) for v in values])
    return {(tile.first_row + i // tile.columns,
             tile.first_column + i % tile.columns):
            b"".join(plane[i] for plane in planes)
            for i in range(tile.rows * tile.columns)}


def region_of(server, request):
    """What GetRegion answers, as cells_of, and its revision."""
    cells, revision = {}, None
    for part in server.obstacle.GetRegion(request, timeout=DEADLINE_S):
        cells.update(cells_of(part.tile))
        revision = part.stamp.map_revision
    return cells, revision


class Reader:
    """Follows one stream until cut."""

    def __init__(self, call, request):
        self.call = call(request)
        self.lock = threading.Condition()
        self.messages = 0
        self.revision = 0      # Of the last progress.
        self.run_id = 0
        self.resyncs = []      # updates_lost of each.
        self.error = None
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self):
        try:
            for message in self.call:
                with self.lock:
                    self._take(message)
                    self.messages += 1
                    self.lock.notify_all()
        except grpc.RpcError as error:
            with self.lock:
                self.error = error
                self.lock.notify_all()

    def _take(self, message):
        if message.HasField("progress"):
            self.revision = message.stamp.map_revision
            self.run_id = message.progress.run_id
        elif message.HasField("resync"):
            self.resyncs.append(message.resync.updates_lost)
            self.forget()
        else:
            self.take(message)

    def wait(self, condition, what):
        deadline = time.monotonic() + DEADLINE_S
        with self.lock:
            while not condition():
                left = deadline - time.monotonic()
                if left <= 0 or self.error is not None and not condition():
                    raise TimeoutError(f"{what}; {self.error}")
                self.lock.wait(left)

    def wait_for_revision(self, revision):
        self.wait(lambda: self.revision >= revision,
                  f"progress to revision {revision}")

    def cut(self):
        self.call.cancel()
        self.thread.join(DEADLINE_S)


class RegionReader(Reader):

    def __init__(self, server, region, **resume):
        self.cells = {}
        self.tiles = []  # (first_row, first_column, stamp) as they came.
        super().__init__(server.obstacle.WatchRegion,
                         obstacle.WatchRegionRequest(region=region, **resume))

    def forget(self):
        self.cells = {}

    def take(self, message):
        tile = message.tile
        self.tiles.append((tile.first_row, tile.first_column,
                           message.stamp.map_revision))
        self.cells.update(cells_of(tile))


class ContactsReader(Reader):

    def __init__(self, server, **options):
        self.contacts = {}
        self.batches = []  # How many estimates each had.
        self.events = []  # (contact_id, report_count, revision) as they came.
        self.times = []   # When, time.monotonic().
        super().__init__(server.obstacle.WatchContacts,
                         obstacle.WatchContactsRequest(**options))

    def forget(self):
        self.contacts = {}

    def take(self, message):
        if message.HasField("estimate"):
            self.note(message.estimate, message.stamp)
            return
        for estimate in message.batch.estimates:
            self.note(estimate, message.stamp)
        self.batches.append(len(message.batch.estimates))
        if message.batch.HasField("progress"):
            self.revision = message.stamp.map_revision
            self.run_id = message.batch.progress.run_id

    def note(self, estimate, stamp):
        self.contacts[(estimate.source_id, estimate.contact_id)] = estimate
        self.events.append((estimate.contact_id, estimate.report_count,
                            stamp.map_revision))
        self.times.append(time.monotonic())


class TrajectoryReader(Reader):

    def __init__(self, server, trajectory, **options):
        self.alert = None
        self.verdict = None
        self.flips = []  # (alert, when) whenever it changed.
        super().__init__(
            server.obstacle.WatchTrajectory,
            obstacle.WatchTrajectoryRequest(trajectory=trajectory, **options))

    def forget(self):
        raise AssertionError("a trajectory is never resynchronised")

    def _take(self, message):
        now = time.monotonic()
        if message.HasField("progress"):
            super()._take(message)
            return
        self.revision = message.stamp.map_revision
        self.verdict = message.verdict
        if message.alert != self.alert:
            self.alert = message.alert
            self.flips.append((message.alert, now))


def wait_for_end(readers):
    wait_until(lambda: all(r.error is not None for r in readers),
               "the watches to end")
