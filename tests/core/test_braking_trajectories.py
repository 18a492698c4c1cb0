"""Stopping in sight: the closed form of a straight stop, and what holds for any scan."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cases import each
from fg_mujoco.controllers.perception.scan_filters import valid_ranges, widen_all
from fg_mujoco.controllers.safety.braking_trajectories import BrakingSettings, BrakingTrajectories
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter, longitudinal_share
from scan_worlds import CAR, INCREMENT, MU, corridor

TOP_SPEED = 8.0
LIMITER = FrictionLimiter(CAR, MU)
STOPPING = BrakingTrajectories(CAR, LIMITER, TOP_SPEED)
SPEED_STEP = STOPPING.speeds[1] - STOPPING.speeds[0]
BUMPER = CAR.length - CAR.rear_overhang - CAR.lidar_offset  # [m] ahead of the LiDAR


def safe_speed(scan, speed=0.0, steering_angle=0.0, stopping=STOPPING):
    readings = valid_ranges(scan.ranges, scan.range_max)
    widened = widen_all(readings, scan.angle_increment, stopping.radius)
    return stopping.safe_speed(widened, scan.angle_min, scan.angle_increment, speed, steering_angle)


def straight_stop(wall, stopping=STOPPING, limiter=LIMITER):
    """The speed [m/s] whose stop, v t + v^2 / (2 a), ends the margin short of a wall this far from the bumper [m]."""
    chosen = stopping.settings
    braking = min(chosen.braking_share * limiter.lateral, limiter.braking)
    room = max(wall - chosen.margin, 0.0)
    return math.sqrt((braking * chosen.reaction) ** 2 + 2.0 * braking * room) - braking * chosen.reaction


@each("wall", [1.5, 3.0, 5.0, 8.0])
def test_towards_a_dead_end_it_is_the_closed_form_of_a_straight_stop(wall):
    # the corridor is so narrow that a path that turns aside has no room
    scan = corridor(0.30, 0.30, BUMPER + wall)
    expected = min(straight_stop(wall), TOP_SPEED)
    # the speeds are a grid, and the integration's step is a quarter of the reaction time
    assert safe_speed(scan) == pytest.approx(expected, abs=SPEED_STEP + 0.05)
    assert safe_speed(scan) <= expected + 0.05


@each("top", [8.0, 12.0, 20.0, 50.0])
def test_speeds_are_looked_at_as_finely_up_to_any_limit(top):
    speeds = BrakingTrajectories(CAR, LIMITER, top).speeds
    assert speeds[-1] == min(top, CAR.max_speed)
    assert np.diff(speeds).max() < 0.1601


# -- the search, against one of all paths


def exhaustive_safe_speed(widened, angle_min, increment, speed, steering_angle, stopping=STOPPING):
    """The fastest of all speeds that have a path, of all to both sides, whose points are all in sight."""
    table = stopping.record[0]
    shares = np.array([-0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0])
    share = speed**2 * math.tan(steering_angle) / CAR.wheelbase / LIMITER.lateral
    fastest = 0.0
    for side in (1, -1):
        present = np.argmin(np.abs(shares - side * share))
        beams = np.round((side * table["bearings"][present].astype(float) - angle_min) / increment)
        beams = np.clip(beams, 0, len(widened) - 1).astype(int)
        free = (widened[beams] > table["distances"][present]).all(axis=-1).any(axis=-1)
        fastest = max(fastest, table["speeds"][free].max(initial=0.0))
    return fastest


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.5, 12.0), st.floats(-8.0, 9.0), st.floats(-0.4, 0.4))
def test_it_finds_what_a_search_of_all_paths_finds(seed, size, speed, steering_angle):
    rng = np.random.default_rng(seed)
    count = int(rng.choice([1, 2, 1080, 1081]))
    corners = np.interp(np.arange(count), np.linspace(0, count, 12), rng.uniform(0.0, size, 12))
    ranges = np.where(rng.uniform(size=count) < 0.01, rng.uniform(0.0, size, count), corners)
    start = -0.5 * INCREMENT * (count - 1)
    for widened in (widen_all(ranges, INCREMENT, STOPPING.radius), ranges):  # what is not widened fails at any point
        expected = exhaustive_safe_speed(widened, start, INCREMENT, speed, steering_angle)
        assert STOPPING.safe_speed(widened, start, INCREMENT, speed, steering_angle) == expected


@given(st.floats(), st.floats(), st.floats(), st.floats())
@settings(deadline=None)
def test_whatever_it_is_told_it_answers_a_speed_of_the_grid(angle_min, increment, speed, steering_angle):
    # compiled code that left its arrays would take the process with it
    widened = np.full(5, 4.0)
    assert STOPPING.safe_speed(widened, angle_min, increment, speed, steering_angle) in (0.0, *STOPPING.speeds)


# -- the paths


def far_end(speed, present, turning):
    """Bearing [rad] and distance [m] of the end of a path to the left, by steps ten times as short."""
    chosen, step = STOPPING.settings, 1e-3
    tightest = math.tan(CAR.max_steering_angle) / CAR.wheelbase
    braking = chosen.braking_share * LIMITER.lateral
    curvature = np.clip(present * LIMITER.lateral / speed**2, -tightest, tightest)
    place, heading, time = 0j, 0.0, 0.0
    while speed > 0.0:
        if time >= chosen.reaction:
            wanted = min(turning * LIMITER.lateral / max(speed, 0.1) ** 2, tightest)
            curvature += (wanted - curvature) * speed * step / LIMITER.yaw_lag
            used = min(abs(curvature) * speed**2 / LIMITER.lateral, 0.999)
            speed = max(speed - braking * longitudinal_share(LIMITER.record[0], used, True) * step, 0.0)
        heading += curvature * speed * step
        place += speed * step * np.exp(1j * heading)
        time += step
    ahead = CAR.length - CAR.rear_overhang + chosen.margin  # of the rear axle
    end = place + ahead * np.exp(1j * heading) - CAR.lidar_offset
    return np.angle(end), abs(end)


@each("fast", [0, 10, 25, 47])
@each(
    ("present", "turning"),
    # places in the grid, and the shares there
    [((3, 0.0), (0, 0.0)), ((3, 0.0), (4, 0.6)), ((7, 1.0), (1, 0.15)), ((0, -0.75), (6, 0.8))],
)
def test_a_path_ends_where_a_finer_integration_says(fast, present, turning):
    bearing, distance = far_end(STOPPING.speeds[fast], present[1], turning[1])
    paths, path = STOPPING.record[0], (present[0], fast, turning[0], -1)
    assert paths["distances"][path] == pytest.approx(distance, rel=0.03, abs=0.02)
    assert paths["bearings"][path] == pytest.approx(bearing, abs=0.03)


def test_cars_of_the_same_kind_share_one_table_that_cannot_be_written_to():
    shared = BrakingTrajectories(CAR, FrictionLimiter(CAR, MU), TOP_SPEED).record
    assert np.shares_memory(shared, BrakingTrajectories(CAR, FrictionLimiter(CAR, MU), TOP_SPEED).record)
    with pytest.raises(ValueError, match="read-only"):
        shared["distances"][0] = 0.0
    for other in (
        BrakingTrajectories(CAR, FrictionLimiter(CAR, 0.9 * MU), TOP_SPEED),
        BrakingTrajectories(CAR, LIMITER, 0.9 * TOP_SPEED),
        BrakingTrajectories(CAR, LIMITER, TOP_SPEED, BrakingSettings(margin=0.6)),
    ):
        assert not np.shares_memory(other.record, STOPPING.record)
        assert not np.array_equal(other.record["distances"], STOPPING.record["distances"])
