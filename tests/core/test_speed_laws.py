"""Speed and steering laws: worked values, inverses, and the geometry of the arc to a goal."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cases import each
from fg_mujoco.controllers.control.speed import (
    distance_ahead_speed,
    friction_speed,
    friction_steering,
    mean_range_speed,
)
from fg_mujoco.controllers.control.steering import pursue, saturate
from scan_worlds import MU

WHEELBASE, GRAVITY, LIDAR_OFFSET = 0.3302, 9.81, 0.275
steering_angles = st.floats(1e-4, 1.5)


@each(
    ("steering_angle", "speed"),
    # g mu b = 9.81 * 1.0489 * .3302 = 3.39766; tan .2 = .2027100, tan .4189 = .4452538, tan .05 = .0500417 (by series)
    [(0.2, 4.094044), (0.4189, 2.762398), (0.05, 8.239939)],
)
def test_the_friction_law_has_its_worked_values(steering_angle, speed):
    assert friction_speed(steering_angle, MU, WHEELBASE, GRAVITY) == pytest.approx(speed, rel=1e-6)
    assert friction_speed(-steering_angle, MU, WHEELBASE, GRAVITY) == pytest.approx(speed, rel=1e-6)


@given(steering_angles, st.floats(0.1, 2.0))
def test_at_the_friction_speed_the_circle_takes_all_of_the_tires_force(steering_angle, mu):
    # the axles and the turning centre are the corners of a right triangle: R = b / tan d
    radius = WHEELBASE / math.tan(steering_angle)
    speed = friction_speed(steering_angle, mu, WHEELBASE, GRAVITY)
    assert speed**2 / radius == pytest.approx(mu * GRAVITY, rel=1e-9)


def test_straight_ahead_there_is_no_friction_limit_on_speed():
    assert friction_speed(0.0, MU, WHEELBASE, GRAVITY) == math.inf
    assert friction_speed(-0.0, MU, WHEELBASE, GRAVITY) == math.inf


@given(steering_angles, st.floats(0.1, 2.0))
def test_the_two_readings_of_the_law_are_inverses(steering_angle, mu):
    speed = friction_speed(steering_angle, mu, WHEELBASE, GRAVITY)
    assert friction_steering(speed, mu, WHEELBASE, GRAVITY) == pytest.approx(steering_angle, rel=1e-9)


def test_at_a_standstill_any_steering_angle_holds():
    assert friction_steering(0.0, MU, WHEELBASE, GRAVITY) == pytest.approx(math.pi / 2)


def test_speed_is_in_proportion_to_the_mean_range_up_to_the_top_speed():
    def speed(*ranges, gain=1.0):
        return mean_range_speed(np.array(ranges), lookahead=10.0, gain=gain, top_speed=8.0)

    assert speed(1.0, 3.0) == pytest.approx(1.6)
    assert speed(1.0, 3.0, gain=3.0) == pytest.approx(4.8)
    assert speed(10.0, 10.0) == speed(20.0, 30.0) == speed(9.0, gain=2.0) == 8.0
    assert speed(5.0, 30.0) == pytest.approx(6.0)  # what lies beyond the lookahead counts as no farther
    assert speed(0.0, 0.0) == speed() == 0.0


def test_speed_by_the_distance_ahead_is_linear_between_stop_and_full_speed():
    def speed(distance):
        return distance_ahead_speed(distance, safe=1.0, full_speed=5.0, top_speed=8.0)

    assert [speed(distance) for distance in (0.0, 0.5, 1.0)] == [0.0] * 3
    assert [speed(distance) for distance in (1.5, 2.0, 3.0, 4.5)] == pytest.approx([1.0, 2.0, 4.0, 7.0])
    assert [speed(distance) for distance in (5.0, 8.0, math.inf)] == [8.0] * 3
    assert speed(math.nan) == 0.0


@each(("value", "held"), [(0.7, 0.4), (-0.7, -0.4), (0.3, 0.3), (-0.3, -0.3), (0.4, 0.4)])
def test_beyond_the_limit_it_turns_as_sharply_as_possible(value, held):
    assert saturate(value, 0.4) == held


@given(st.floats(-2.3, 2.3).filter(lambda bearing: abs(math.sin(bearing)) > 1e-3), st.floats(0.1, 10.0))
def test_the_arc_passes_through_the_goal(bearing, distance):
    # the turning centre lies beside the rear axle, b / tan d to the left; the goal is as far from it as the axle is
    radius = WHEELBASE / math.tan(pursue(bearing, distance, LIDAR_OFFSET, WHEELBASE))
    goal = (LIDAR_OFFSET + distance * math.cos(bearing), distance * math.sin(bearing))
    assert math.hypot(goal[0], goal[1] - radius) == pytest.approx(abs(radius), rel=1e-6)
    assert math.copysign(1.0, radius) == math.copysign(1.0, bearing)


def test_a_goal_straight_ahead_is_driven_to_straight():
    assert pursue(0.0, 3.0, LIDAR_OFFSET, WHEELBASE) == 0.0
