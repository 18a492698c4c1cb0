"""Scans for the tests of the planners: flat worlds of straight walls, worked out beam by beam, no ray caster."""

import math
from dataclasses import replace

import numpy as np

from fg_mujoco.controllers.control.planner_settings import for_car, record_type, record_values
from fg_mujoco.controllers.perception.frontiers import FRONTIER_SEARCH
from fg_mujoco.controllers.perception.scan_geometry import SCAN_GEOMETRY
from fg_mujoco.controllers.safety.friction_limiter import LIMITER_MEMORY
from fg_mujoco.controllers.safety.judge import JudgeSettings, Situation
from fg_mujoco.messages import ODOMETRY, LaserScan, Odometry
from fg_mujoco.vehicle.tires import IDEAL_TIRES, Tires
from fg_mujoco.vehicle.vehicle import Vehicle

CAR = replace(Vehicle.load(), tires=Tires.load(IDEAL_TIRES)).parameters  # its paths are as steered
INCREMENT = math.radians(0.25)
MU = 1.0489  # of the community's F1TENTH models


def scan_of(ranges, increment=INCREMENT, angle_min=None, range_max=30.0, stamp=0.0, **fields):
    """A scan of these ranges, straight ahead in its middle."""
    ranges = np.asarray(ranges, dtype=float)
    span = increment * max(len(ranges) - 1, 0)
    start = -0.5 * span if angle_min is None else angle_min
    limits = {"angle_min": start, "angle_max": start + span, "range_min": 0.02, "range_max": range_max}
    return LaserScan(stamp=stamp, angle_increment=increment, ranges=ranges, **limits, **fields)


def odometry_of(speed=0.0, steering_angle=0.0):
    zeros = np.zeros(3)
    return Odometry(stamp=0.0, speed=speed, steering_angle=steering_angle, angular_velocity=zeros,
                    linear_acceleration=zeros, wheel_speeds=np.full(4, speed))  # fmt: skip


def situation(
    limiter, widened, angle, speed, *, movers=(), ground=None, radius=0.17, angle_min=None, increment=INCREMENT,
    ranges=None, **settings,
):  # fmt: skip
    """What the judge knows, of widened readings (n,) [m], straight ahead in their middle; of `ranges`: ground known."""
    values = for_car(JudgeSettings(**settings), CAR)
    row = np.array([record_values(values)], record_type(JudgeSettings))[0]
    geometry = np.zeros(1, SCAN_GEOMETRY)[0]
    geometry["angle_min"] = -0.5 * increment * (len(widened) - 1) if angle_min is None else angle_min
    geometry["angle_increment"], geometry["range_max"] = increment, 30.0
    return Situation(
        limiter, np.zeros(1, LIMITER_MEMORY)[0], row, geometry, widened if ranges is None else ranges, widened, radius,
        np.array(movers).reshape(-1, 12), np.zeros(1, FRONTIER_SEARCH)[0] if ground is None else ground, float(angle),
        float(speed), 0.025, ranges is not None,
    )  # fmt: skip


def room(*walls, count=1081):
    """A scan in a room of endless walls, each given as its normal's bearing [rad] and its distance [m]."""
    bearings = INCREMENT * (np.arange(count) - (count - 1) / 2)
    towards = [np.cos(bearings - normal) for normal, _ in walls]
    with np.errstate(divide="ignore"):
        hits = [np.where(t > 1e-9, distance / t, math.inf) for t, (_, distance) in zip(towards, walls, strict=True)]
    return scan_of(np.minimum.reduce([*hits, np.full(count, math.inf)]))


def corridor(left, right, ahead=math.inf):
    """A scan in a straight corridor: distances [m] from the LiDAR to its walls."""
    return room((math.pi / 2, left), (-math.pi / 2, right), (0.0, ahead))


def mirrored(scan):
    return scan_of(scan.ranges[::-1], scan.angle_increment, -scan.bearings[-1], scan.range_max)


def rough_scan(seed):
    """A scan of 60 faces at random, no two alike, and a nearest point on a round post: no ties."""
    rng = np.random.default_rng(seed)
    ranges = np.interp(np.arange(1081), np.linspace(0, 1080, 60), rng.uniform(0.9, 9.5, 60))
    post = 0.5 + np.abs(np.arange(1081) - rng.integers(0, 1081)) / 200.0
    return scan_of(np.where(post < 0.8, post, ranges))


def rows_of(odometries):
    """Odometries as a batch of planners gets them, a row each."""
    rows = np.zeros(len(odometries), ODOMETRY)
    for row, odometry in zip(rows, odometries, strict=True):
        for name in ODOMETRY.names:
            row[name] = getattr(odometry, name)
    return rows
