"""Flat worlds in which things move: scans of segments and discs from any pose, worked out beam by beam."""

import math

import numpy as np

from drawn_worlds import seen_from
from fg_mujoco.controllers.perception.scan_geometry import SCAN_GEOMETRY, geometry_values
from fg_mujoco.controllers.perception.targets import TARGETS, track_targets
from fg_mujoco.messages import ODOMETRY
from scan_worlds import CAR, INCREMENT, odometry_of, scan_of

PERIOD = 0.025
BEARINGS = INCREMENT * (np.arange(1081) - 540)
GEOMETRY = np.array([geometry_values(scan_of(np.ones(1081)))], SCAN_GEOMETRY)[0]
WALLS = (((-20.0, 1.4), (40.0, 1.4)), ((-20.0, -1.4), (40.0, -1.4)), ((40.0, -1.4), (40.0, 1.4)))


def box(x, y, length=0.3, width=0.4):
    """The sides of a box."""
    a, b, c, d = ((x + i * length / 2, y + j * width / 2) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return ((a, b), (b, c), (c, d), (d, a))


def ranges_of(segments, discs=(), x=0.0, y=0.0, heading=0.0, noise=None):
    """Ranges (1081,) [m] of a LiDAR at a pose among segments ((x, y), (x, y)) and discs (x, y, radius)."""
    cos, sin = np.cos(BEARINGS + heading), np.sin(BEARINGS + heading)
    best = seen_from(np.reshape(segments, (-1, 2, 2)), x, y, BEARINGS + heading)
    with np.errstate(invalid="ignore"):
        for cx, cy, radius in discs:
            along, across = (cx - x) * cos + (cy - y) * sin, (cy - y) * cos - (cx - x) * sin
            near = along - np.sqrt(radius**2 - across**2)
            best = np.where((np.abs(across) < radius) & (near > 0.0), np.minimum(best, near), best)
    return best if noise is None else best + noise.normal(0.0, 0.02, 1081)


def odometry_row(speed=0.0, yaw_rate=0.0):
    row = np.zeros(1, ODOMETRY)
    message = odometry_of(speed)
    for name in ODOMETRY.names:
        row[name][0] = getattr(message, name)
    row["angular_velocity"][0, 2] = yaw_rate
    return row[0]


def watched(world, ticks, speed=0.0, yaw_rate=0.0, *, drift=0.0, noise=None, memory=None, first=0):
    """The memory of the tracker after some ticks, and in which tick something first moved; None: in none.

    `world(time)` returns segments and discs. The car starts at the origin, and drives on a circle; the frame of the
    tracker begins where the LiDAR is in the first tick.
    """
    memory = np.zeros(1, TARGETS)[0] if memory is None else memory
    told, known = odometry_row(speed * (1.0 + drift), yaw_rate * (1.0 + drift)), None
    for tick in range(first, first + ticks):
        time = tick * PERIOD
        heading = yaw_rate * time
        x = speed * time if yaw_rate == 0.0 else speed / yaw_rate * math.sin(heading)
        y = 0.0 if yaw_rate == 0.0 else speed / yaw_rate * (1.0 - math.cos(heading))
        x, y = x + CAR.lidar_offset * math.cos(heading), y + CAR.lidar_offset * math.sin(heading)
        ranges = ranges_of(*world(time), x=x, y=y, heading=heading, noise=noise)
        if track_targets(memory, GEOMETRY, ranges, told, CAR.lidar_offset, 0.0) > 0 and known is None:
            known = tick
    return memory, known


def moving(memory):
    """The targets that move."""
    return [target for target in memory["targets"] if target["age"] > 0 and target["moves"]]
