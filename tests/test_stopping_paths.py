"""Stopping in sight: the closed form of a straight stop, and what holds for any scan."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scan_worlds import CAR, INCREMENT, MU, corridor, mirrored, odometry_of, room, scan_of

from fg_mujoco.controllers.friction_guard import FrictionGuard
from fg_mujoco.controllers.scan_filters import valid_ranges, widen_all
from fg_mujoco.controllers.stopping_paths import StoppingPaths

TOP_SPEED = 8.0
GUARD = FrictionGuard(CAR, MU)
STOPPING = StoppingPaths(CAR, GUARD, TOP_SPEED)
SPEED_STEP = STOPPING.speeds[1] - STOPPING.speeds[0]
BUMPER = CAR.length - CAR.rear_overhang - CAR.lidar_offset  # [m] ahead of the LiDAR


def safe_speed(scan, speed=0.0, steering_angle=0.0, stopping=STOPPING):
    readings = valid_ranges(scan.ranges, scan.range_max)
    widened = widen_all(readings, scan.angle_increment, stopping.radius)
    return stopping.safe_speed(widened, scan.angle_min, scan.angle_increment, speed, steering_angle)


def straight_stop(wall, stopping=STOPPING, guard=GUARD):
    """The speed [m/s] whose stop, v t + v^2 / (2 a), ends the margin short of a wall this far from the bumper [m]."""
    chosen = stopping.settings
    braking = min(chosen.braking_share * guard.lateral, guard.braking)
    room = max(wall - chosen.margin, 0.0)
    return math.sqrt((braking * chosen.reaction) ** 2 + 2.0 * braking * room) - braking * chosen.reaction


@pytest.mark.parametrize("wall", [1.5, 3.0, 5.0, 8.0])
def test_towards_a_dead_end_it_is_the_closed_form_of_a_straight_stop(wall):
    # the corridor is so narrow that a path that turns aside has no room
    scan = corridor(0.30, 0.30, BUMPER + wall)
    expected = min(straight_stop(wall), TOP_SPEED)
    # the speeds are a grid, and the integration's step is a quarter of the reaction time
    assert safe_speed(scan) == pytest.approx(expected, abs=SPEED_STEP + 0.05)
    assert safe_speed(scan) <= expected + 0.05


def test_a_straight_stop_takes_less_room_on_better_ground():
    scan, wet = corridor(0.30, 0.30, BUMPER + 4.0), FrictionGuard(CAR, 0.6)
    paths = StoppingPaths(CAR, wet, TOP_SPEED)
    assert safe_speed(scan, stopping=paths) < safe_speed(scan)
    assert safe_speed(scan, stopping=paths) == pytest.approx(straight_stop(4.0, paths, wet), abs=SPEED_STEP + 0.05)


def test_on_an_open_plain_any_speed_is_safe():
    assert safe_speed(scan_of(np.full(1081, math.inf))) == TOP_SPEED
    assert safe_speed(corridor(1.0, 1.0)) == TOP_SPEED


@pytest.mark.parametrize("distance", [0.0, 0.2, 0.4])
def test_in_a_closed_box_none_is(distance):
    walls = [(quarter * math.pi / 2, distance) for quarter in range(4)]
    assert safe_speed(room(*walls)) == 0.0


def test_against_a_wall_that_touches_the_bumper_none_is():
    assert safe_speed(corridor(3.0, 3.0, BUMPER + 0.01)) == 0.0


def test_the_farther_the_wall_the_faster():
    speeds = [safe_speed(corridor(0.8, 0.8, ahead)) for ahead in np.linspace(0.2, 12.0, 60)]
    assert (np.diff(speeds) >= 0.0).all()
    assert speeds[0] == 0.0
    assert speeds[-1] > 5.0


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 8.0), st.floats(-0.4, 0.4))
def test_more_room_never_makes_it_slower(seed, speed, steering_angle):
    rng = np.random.default_rng(seed)
    near = np.repeat(rng.uniform(0.2, 12.0, 47), 23)
    far = near + np.repeat(rng.uniform(0.0, 3.0, 47), 23)
    widened = [widen_all(ranges, INCREMENT, STOPPING.radius) for ranges in (near, far)]
    start = scan_of(near).angle_min
    slow, fast = (STOPPING.safe_speed(ranges, start, INCREMENT, speed, steering_angle) for ranges in widened)
    assert slow <= fast


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 8.0), st.floats(-0.4, 0.4))
def test_left_and_right_are_alike(seed, speed, steering_angle):
    scan = scan_of(np.repeat(np.random.default_rng(seed).uniform(0.5, 12.0, 47), 23))
    assert safe_speed(scan, speed, steering_angle) == safe_speed(mirrored(scan), speed, -steering_angle)


def test_a_corner_that_has_opened_lets_it_turn_aside():
    # a wall 3 m ahead; the way to the left is open, or it is not
    open_left, closed = corridor(math.inf, 0.4, 3.0), corridor(0.3, 0.3, 3.0)
    assert safe_speed(open_left) > safe_speed(closed) + SPEED_STEP


def test_a_car_that_turns_right_needs_room_on_its_right():
    # the same scan, a wall close by on the right: while turning towards it the car has to be slower
    scan, angle = corridor(5.0, 0.25, 6.0), 0.1
    assert safe_speed(scan, 5.0, -angle) < safe_speed(scan, 5.0, angle)


def test_every_speed_of_the_grid_is_at_most_the_fastest_of_interest():
    assert STOPPING.speeds[-1] == TOP_SPEED
    assert StoppingPaths(CAR, GUARD, 0.1).speeds.max() == 0.5  # the least it plans for


def test_the_scan_is_not_changed():
    scan = corridor(1.0, 1.0, 4.0)
    widened = widen_all(valid_ranges(scan.ranges, 30.0), INCREMENT, STOPPING.radius)
    before = widened.copy()
    STOPPING.safe_speed(widened, scan.angle_min, INCREMENT, odometry_of(2.0).speed, 0.1)
    np.testing.assert_array_equal(widened, before)
