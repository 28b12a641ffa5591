"""Real fathomd processes on free loopback ports, for the integration tests.

The programs come from the environment (tests/integration/CMakeLists.txt sets
it): FATHOMD, FATHOM_CLI, FATHOM_FEEDER and FATHOM_STUBS (folder of the
generated Python stubs). Waiting is polling on observable state with a
deadline, never a fixed sleep.
"""

import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "testing"))
import fathom_stubs  # noqa: E402

fathom_stubs.use(os.environ["FATHOM_STUBS"])

import grpc  # noqa: E402
from fathom.v1 import ingest_service_pb2 as ingest  # noqa: E402
from fathom.v1 import ingest_service_pb2_grpc as ingest_rpc  # noqa: E402
from fathom.v1 import mission_service_pb2 as mission  # noqa: E402
from fathom.v1 import mission_service_pb2_grpc as mission_rpc  # noqa: E402
from fathom.v1 import obstacle_service_pb2 as obstacle  # noqa: E402
from fathom.v1 import obstacle_service_pb2_grpc as obstacle_rpc  # noqa: E402
from fathom.v1 import types_pb2 as types  # noqa: E402
from google.rpc import error_details_pb2, status_pb2  # noqa: E402

FATHOMD = os.environ["FATHOMD"]
FATHOM = os.environ["FATHOM_CLI"]
FEEDER = os.environ["FATHOM_FEEDER"]
SANITIZED = bool(os.environ.get("FATHOM_SANITIZE"))

# Sanitizer builds are several times slower.
DEADLINE_S = 60
START_S = 1_767_225_600  # 2026-01-01T00:00:00Z

CREATE = ["--create", "--center", "41.5,-71.4", "--side-nmi", "20",
          "--datum", "MLLW", "--name", "test"]


def wait_until(condition, what):
    """Polls until condition() is true; fails naming `what`."""
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError(f"waited {DEADLINE_S} s for: {what}")
        time.sleep(0.01)


def memory_bound_kb(plain_kb):
    """What a process may hold that holds plain_kb in a plain build: with a
    sanitizer each piece is larger, and what was freed is kept for a while."""
    return 3 * plain_kb + 1_000_000 if SANITIZED else plain_kb


class Server:
    """One fathomd process. Use as a context manager: it is killed at exit."""

    def __init__(self, mission_file, *flags, listen="127.0.0.1:0"):
        self.mission_file = pathlib.Path(mission_file)
        port_file = self.mission_file.with_suffix(".port")
        port_file.unlink(missing_ok=True)
        self.log_path = self.mission_file.with_suffix(".log")
        with open(self.log_path, "ab") as log:
            self.process = subprocess.Popen(
                [FATHOMD, "--mission", str(mission_file), "--listen", listen,
                 "--port-file", str(port_file), *flags],
                stdout=log, stderr=log)
        wait_until(lambda: self.process.poll() is not None
                   or (port_file.exists() and port_file.read_text().strip()),
                   "fathomd to serve")
        if self.process.poll() is not None:
            raise RuntimeError(f"fathomd ended with {self.process.returncode}:"
                               f"\n{self.log()}")
        self.address = "127.0.0.1:" + port_file.read_text().strip()
        self.connect()

    def connect(self):
        self.channel = grpc.insecure_channel(self.address)
        self.obstacle = obstacle_rpc.ObstacleServiceStub(self.channel)
        self.ingest = ingest_rpc.IngestServiceStub(self.channel)
        self.mission = mission_rpc.MissionServiceStub(self.channel)

    def log(self):
        return self.log_path.read_text(errors="replace")

    def resident_kb(self):
        """Memory of the process now."""
        path = f"/proc/{self.process.pid}/status"
        with open(path, encoding="ascii") as status:
            for line in status:
                if line.startswith("VmRSS:"):
                    return int(line.split()[1])
        raise RuntimeError("no VmRSS")

    def kill(self):
        """SIGKILL: as near to a power cut as a process can come."""
        self.channel.close()
        self.process.kill()
        self.process.wait(timeout=DEADLINE_S)

    def terminate(self):
        """SIGTERM; returns the exit code."""
        self.channel.close()
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout=DEADLINE_S)

    def status(self, digest=False):
        return self.mission.GetMissionStatus(
            mission.GetMissionStatusRequest(with_digest=digest),
            timeout=DEADLINE_S)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.channel.close()
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait(timeout=DEADLINE_S)


class LiveTest(unittest.TestCase):
    """A test with a folder of its own, removed afterwards."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="fathom-live-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def new_mission(self, *flags, name="m.fathom"):
        return Server(self.folder / name, *(list(CREATE) + list(flags)))

    def reopen(self, name="m.fathom"):
        return Server(self.folder / name)

    def assert_status(self, code, call, request, **kwargs):
        """Calls and expects an error; returns it."""
        with self.assertRaises(grpc.RpcError) as caught:
            result = call(request, timeout=DEADLINE_S, **kwargs)
            if hasattr(result, "__next__"):
                list(result)
        error = caught.exception
        self.assertEqual(error.code(), code, error.details())
        self.assertTrue(error.details())
        return error

    def assert_field(self, field, call, request):
        """Expects INVALID_ARGUMENT whose BadRequest detail names `field`."""
        error = self.assert_status(grpc.StatusCode.INVALID_ARGUMENT, call,
                                   request)
        self.assertIn(field, fields_of(error), error.details())


def fields_of(error):
    """Field paths of google.rpc.BadRequest in an error's details."""
    fields = []
    for key, value in error.trailing_metadata():
        if key != "grpc-status-details-bin":
            continue
        for detail in status_pb2.Status.FromString(value).details:
            bad = error_details_pb2.BadRequest()
            if detail.Unpack(bad):
                fields += [v.field for v in bad.field_violations]
    return fields


# ---- Messages of a small, known scene: 500 m x 500 m at 10 m, kalman. ----

# Metres of a degree about 41.5 N, to place beams in cells (good to 0.1 %).
M_PER_LAT = 111_073.0
M_PER_LON = 83_490.0
AREA = (41.5, -71.4)


def point(north_m, east_m):
    return types.GeodeticPoint(latitude_deg=AREA[0] + north_m / M_PER_LAT,
                               longitude_deg=AREA[1] + east_m / M_PER_LON)


def at(seconds):
    stamp = obstacle.QueryObstacleRequest().time
    stamp.seconds = START_S + seconds
    return stamp


def start_activity(server, name="bay", **parameters):
    values = dict(south_west=point(0, 0), north_extent_m=500,
                  east_extent_m=500, cell_size_m=10,
                  estimator=mission.ESTIMATOR_KALMAN)
    values.update(parameters)
    return server.mission.StartActivity(
        mission.StartActivityRequest(
            activity_id=name, vehicle_id="uuv-1", time=at(0),
            parameters=mission.ActivityParameters(**values)),
        timeout=DEADLINE_S)


def chart_tile(depth_m=30.0, std_m=4.0):
    """A flat chart over the area and a kilometre around it."""
    north_west = point(1500, -1000)
    return mission.DepthTile(
        north_west=north_west, latitude_step_deg=0.001,
        longitude_step_deg=0.001, rows=25, columns=40,
        depth_m=[depth_m] * (25 * 40), std_m=[std_m])


def import_chart(server, *tiles):
    def parts():
        yield mission.ImportPriorRequest(
            header=mission.PriorHeader(name="chart"))
        for tile in tiles or (chart_tile(),):
            yield mission.ImportPriorRequest(tile=tile)
    return server.mission.ImportPrior(parts(), timeout=DEADLINE_S)


def ping(sequence, beams, source="uuv-1", epoch=1, activity="bay", second=0):
    """A ping from (250, 250), heading east (90 degrees), that hits `beams`:
    a list of (north_m, east_m, depth_m, std_m)."""
    import math
    message = ingest.Ping(source_id=source, epoch=epoch, sequence=sequence,
                          activity_id=activity, time=at(second))
    message.pose.position.CopyFrom(point(250, 250))
    message.pose.heading_deg = 90
    for north_m, east_m, depth_m, std_m in beams:
        dn, de = north_m - 250, east_m - 250
        message.range_m.append(math.hypot(dn, de))
        message.bearing_deg.append(math.degrees(math.atan2(de, dn)) - 90)
        message.depth_m.append(depth_m)
        message.std_m.append(std_m)
    return message


def send_pings(server, messages):
    """Sends pings on one stream until it ends; returns the last ack and all."""
    acks = list(server.ingest.StreamPings(
        iter([ingest.StreamPingsRequest(ping=m) for m in messages]),
        timeout=DEADLINE_S))
    return acks[-1], acks


def fix_report(sequence, north_m=0.0, east_m=0.0, second=0, contact="ship",
               source="c4i", epoch=1, vn=0.0, ve=5.0):
    return ingest.ContactReport(
        source_id=source, epoch=epoch, sequence=sequence, contact_id=contact,
        contact_class=types.CONTACT_CLASS_VESSEL, time=at(second),
        fix=ingest.ContactFix(position=point(north_m, east_m),
                              velocity_north_m_s=vn, velocity_east_m_s=ve,
                              position_std_m=10, velocity_std_m_s=0.5))


def report_contacts(server, reports):
    return server.ingest.ReportContacts(
        ingest.ReportContactsRequest(reports=reports), timeout=DEADLINE_S)


def query(north_m, east_m, depth_m=10.0, second=0, confidence=0.95,
          clearance_m=0.0, radius_m=0.0, **kwargs):
    return obstacle.QueryObstacleRequest(
        position=point(north_m, east_m), depth_m=depth_m, time=at(second),
        confidence=confidence, vertical_clearance_m=clearance_m,
        radius_m=radius_m, **kwargs)


def ask(server, *args, **kwargs):
    return server.obstacle.QueryObstacle(query(*args, **kwargs),
                                         timeout=DEADLINE_S)
