#!/usr/bin/python3
"""An avoidance loop: steer for the goal, and around what is in the way.

    PYTHONPATH=build/dev/python client/examples/avoidance.py \\
        127.0.0.1:7430 41.5022,-71.3994 41.5022,-71.3946 10

At every step the vehicle asks CheckTrajectory about the next 100 m on each
heading of a fan, the one towards the goal first, and takes the first that is
FREE: one question joins the sea floor, the chart and every contact where it
will be by then. If none is free it stays, and FindNearestObstacle says what
holds it. Real vehicles do this every second while a planner thinks about the
whole way (planner.cc).

Needs python3-grpcio and the stubs that `ninja -C build/dev
fathom_python_proto` makes. Exit code: 0 the goal was reached, 3 it was not.
"""

import math
import sys
import time

import grpc
from fathom.v1 import obstacle_service_pb2 as pb
from fathom.v1 import obstacle_service_pb2_grpc as rpc
from fathom.v1 import types_pb2 as types

SPEED_M_S = 2.0
STEP_S = 10
LOOK_AHEAD_M = 100.0
RADIUS_M = 5.0
CLEARANCE_M = 2.0
ARRIVED_M = 20.0
MAX_STEPS = 500
# Of heading, degrees: straight ahead first, then ever further.
TURNS_DEG = range(0, 181, 10)


def fan(side):
    """Turns to try, the best first: to both sides (0) as long as nothing was
    in the way, then to the side (+1 starboard, -1 port) on which we go round;
    changing it at every step would lead nowhere."""
    if side == 0:
        return [sign * turn for turn in TURNS_DEG for sign in (1, -1)]
    return [sign * turn for sign in (side, -side) for turn in TURNS_DEG]


def moved(place, bearing_deg, distance_m):
    """The place so far away; a flat Earth will do for a hundred metres."""
    north = distance_m * math.cos(math.radians(bearing_deg))
    east = distance_m * math.sin(math.radians(bearing_deg))
    per_lon = 111_320 * math.cos(math.radians(place[0]))
    return place[0] + north / 111_132, place[1] + east / per_lon


def offset(a, b):
    """Distance and bearing from a to b."""
    north = (b[0] - a[0]) * 111_132
    east = (b[1] - a[1]) * 111_320 * math.cos(math.radians(a[0]))
    return math.hypot(north, east), math.degrees(math.atan2(east, north)) % 360


def is_free(map_, place, heading_deg, distance_m, depth_m, now_s):
    """Whether the vehicle may go so far on that heading."""
    trajectory = pb.Trajectory(
        radius_m=RADIUS_M, vertical_clearance_m=CLEARANCE_M, confidence=0.95,
        treat_unknown_as=pb.UNKNOWN_TREATMENT_OCCUPIED)
    for along_m in (0.0, distance_m):
        at = moved(place, heading_deg, along_m)
        waypoint = trajectory.waypoints.add(depth_m=depth_m)
        waypoint.position.latitude_deg, waypoint.position.longitude_deg = at
        waypoint.time.FromNanoseconds(
            int((now_s + along_m / SPEED_M_S) * 1e9))
    verdict = map_.CheckTrajectory(pb.CheckTrajectoryRequest(
        trajectory=trajectory, stop_at_first=True), timeout=2)
    return verdict.state == types.OBSTACLE_STATE_FREE


def what_holds(map_, place, depth_m, now_s):
    """The nearest obstacle, in words."""
    request = pb.FindNearestObstacleRequest(
        depth_m=depth_m, vertical_clearance_m=CLEARANCE_M, confidence=0.95,
        search_radius_m=1000)
    request.position.latitude_deg, request.position.longitude_deg = place
    request.time.FromNanoseconds(int(now_s * 1e9))
    found = map_.FindNearestObstacle(request, timeout=2)
    if not found.found:
        return "nothing certain within 1000 m"
    return (f"{found.contact_id or 'the sea floor'} {found.distance_m:.0f} m "
            f"away, bearing {found.bearing_deg:.0f}")


def main(server, start, goal, depth_m):
    map_ = rpc.ObstacleServiceStub(grpc.insecure_channel(server))
    place, now_s = start, time.time()
    side = 0
    for step in range(MAX_STEPS):
        distance_m, bearing_deg = offset(place, goal)
        if distance_m <= ARRIVED_M:
            print(f"arrived after {step * STEP_S} s")
            return 0
        look_m = min(LOOK_AHEAD_M, distance_m)
        for turn_deg in fan(side):
            heading_deg = (bearing_deg + turn_deg) % 360
            if is_free(map_, place, heading_deg, look_m, depth_m, now_s):
                if turn_deg != 0:
                    side = 1 if turn_deg > 0 else -1
                place = moved(place, heading_deg,
                              min(SPEED_M_S * STEP_S, distance_m))
                print(f"{place[0]:.6f},{place[1]:.6f} {step * STEP_S:5d} s "
                      f"heading {heading_deg:3.0f} ({turn_deg:+d})")
                break
        else:
            print("holding: " + what_holds(map_, place, depth_m, now_s))
        now_s += STEP_S
    print(f"not arrived after {MAX_STEPS * STEP_S} s")
    return 3


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit("usage: avoidance.py SERVER LAT,LON LAT,LON DEPTH_M")
    sys.exit(main(sys.argv[1],
                  *[tuple(map(float, text.split(",")))
                    for text in sys.argv[2:4]], float(sys.argv[4])))
