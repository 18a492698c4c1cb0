"""From a goal to a command: each speed law by its name, and their minimum."""

import math
from functools import cache

import numpy as np
import pytest

from cases import each
from fg_mujoco.controllers.gap_finder import GapFinder, GapFinderSettings
from fg_mujoco.controllers.perception.scan_filters import valid_ranges, widen_all
from fg_mujoco.controllers.perception.scan_geometry import beams_between, geometry_record
from fg_mujoco.controllers.safety.braking_trajectories import BrakingTrajectories
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from scan_worlds import CAR, MU, corridor, odometry_of, scan_of

TOP = 8.0
ASSISTS = ("full", "distance_ahead", "mean_range", "limiter", "sight")
PERIOD = 0.025


@cache
def made(mu, settings):
    return GapFinder(CAR, mu, TOP, GapFinderSettings(**dict(settings)))


def command(scan, law, speed=0.0, angle=0.0, mu=MU, **settings):
    """What a planner commands that has just been made."""
    planner = made(mu, (("assist", law), ("method", "refined"), *settings.items()))
    planner.reset()
    return planner(scan, odometry_of(speed, angle))


@each(("ahead", "speed"), [(0.4, 0.0), (0.5, 0.0), (1.5, 2.0), (2.5, 4.0), (4.5, 8.0), (9.0, 8.0)])
def test_forward_distance_looks_straight_ahead_only(ahead, speed):
    scan = corridor(1.0, 1.0, ahead=ahead)
    distances = {"safe_distance": 0.5, "full_speed_distance": 4.5}
    assert command(scan, "distance_ahead", **distances).speed == pytest.approx(speed, abs=1e-6)
    assert command(scan, "distance_ahead", speed=7.9, angle=0.4, **distances).speed == pytest.approx(speed, abs=1e-6)


def test_a_single_post_ahead_is_seen_and_one_beside_is_not():
    for beam, seen in ((540, True), (540 + 8, True), (540 - 8, True), (540 + 9, False), (540 - 9, False)):
        ranges = np.full(1081, 9.0)
        ranges[beam] = 0.4
        speed = command(scan_of(ranges), "distance_ahead", safe_distance=0.5, full_speed_distance=4.5).speed
        assert speed == (0.0 if seen else TOP)


@each("reach", [1.0, 2.0, 3.0])
def test_range_ratio_is_by_the_mean_range_towards_the_goal(reach):
    scan = scan_of(np.full(1081, reach))
    asked = command(scan, "mean_range", nearest_bubble=1e-6).speed
    assert asked == pytest.approx(min(TOP, TOP * 3.0 * reach / 10.0), rel=1e-6)


def test_friction_is_the_limiter_and_nothing_else():
    near = corridor(1.0, 1.0, ahead=0.6)  # any law that looks at ranges would stop here
    asked = command(near, "limiter", speed=2.0)
    limiter = FrictionLimiter(CAR, MU)
    expected = limiter(asked.steering_angle, TOP, odometry_of(2.0), PERIOD)
    assert asked == expected
    assert asked.speed > 2.0
    assert command(near, "full", speed=2.0).speed < 2.0


def test_sight_is_the_speed_from_which_the_car_stops_within_what_it_sees():
    scan = corridor(1.0, 1.0, ahead=3.0)
    paths = BrakingTrajectories(CAR, FrictionLimiter(CAR, MU), TOP)
    asked = command(scan, "sight", speed=7.0)
    widened = widen_all(valid_ranges(scan.ranges, scan.range_max), scan.angle_increment, paths.radius)
    assert asked.speed == paths.safe_speed(widened, scan.angle_min, scan.angle_increment, 7.0, 0.0)
    assert asked.speed < 5.0


def test_without_the_friction_law_the_wheels_turn_as_sharply_as_possible():
    scan = corridor(8.0, 0.8, ahead=2.5)
    angles = {law: command(scan, law, speed=7.0).steering_angle for law in ASSISTS}
    assert angles["distance_ahead"] == angles["mean_range"] == angles["sight"] == CAR.max_steering_angle
    assert 0.0 < angles["limiter"] < 0.1 and abs(angles["full"]) < 0.1
    assert 0.0 < command(scan, "mean_range,distance_ahead,sight,limiter", speed=7.0).steering_angle < 0.1


def test_the_beams_between_two_bearings_are_those_within():
    scan = scan_of(np.ones(1081))
    record, bearings = geometry_record(scan)[0], scan.bearings
    for right, left in ((-0.5, 0.5), (-3.0, 3.0), (0.0, 0.0), (2.5, 3.0), (-math.pi / 2, math.pi / 2), (1.0, -1.0)):
        first, end = beams_between(record, 1081, right, left)
        inside = np.flatnonzero((bearings >= right - 1e-9) & (bearings <= left + 1e-9))
        assert list(range(first, end)) == inside.tolist()
