"""Tracking: a kinematic car with a steering that lags stays on motions made of arcs."""

import math

import numpy as np
import pytest

from cases import each
from fg_mujoco.controllers.safety.motions import CURVATURE, HEADING, LAG, X, Y, errors, next_point, steer_along
from fg_mujoco.vehicle.vehicle import Vehicle

CAR = Vehicle.load().parameters
TIGHTEST = 0.87 * math.tan(CAR.max_steering_angle) / CAR.wheelbase


def motion(*arcs, length=0.3):
    """Points of arcs one after another: so many of a curvature."""
    x = y = heading = 0.0
    points = []
    for count, curvature in arcs:
        for _ in range(count):
            middle = heading + 0.5 * curvature * length
            chord = length * np.sinc(0.5 * curvature * length / math.pi)
            x, y, heading = x + chord * math.cos(middle), y + chord * math.sin(middle), heading + curvature * length
            points.append((x, y, heading, curvature))
    return np.array(points)


def follow(points, speed, beside=0.0, heading=0.0, step=0.005, tick=0.025, late=0.0, path_lag=0.0, told=None):
    """Distances from the motion [m] of a car with a steering of a lag of first order; a command a tick.

    Its steering is `late` [s] later than the F1TENTH car's and its curvature by `path_lag` [s] later than that, both by
    lags of first order; `told` is what it is told of the sum.
    """
    x, y, angle, curvature, place, off = 0.0, beside, 0.0, 0.0, 0, []
    told = late + path_lag if told is None else told
    command = 0.0
    for number in range(10000):
        if number % round(tick / step) == 0:
            place = next_point(points, place, x, y, heading)
            if place + 1 >= len(points):
                return np.array(off)
            command = steer_along(points, place, (x, y, heading), speed, CAR.wheelbase, late, told)
            command = max(-CAR.max_steering_angle, min(command, CAR.max_steering_angle))
            off.append(errors(points[place], x, y, heading)[1])
        angle += (command - angle) * (1.0 - math.exp(-step / (0.5 * LAG + late)))
        curvature += (math.tan(angle) / CAR.wheelbase - curvature) * (1.0 - math.exp(-step / max(path_lag, 1e-9)))
        way = speed * step
        turn = way * curvature
        x, y = x + way * math.cos(heading + 0.5 * turn), y + way * math.sin(heading + 0.5 * turn)
        heading += turn
    raise AssertionError("the motion has no end")


@each("speed", (0.5, 1.5, 2.4))
@each("sign", (1, -1))
def test_through_a_hairpin_at_nearly_full_lock_it_stays_within_five_centimetres(speed, sign):
    points = motion((4, 0.0), (1, 0.5 * sign * TIGHTEST), (8, sign * TIGHTEST), (1, 0.5 * sign * TIGHTEST), (6, 0.0))
    assert np.abs(follow(points, speed)).max() < 0.05


@each("speed", (0.5, 2.0, 4.0))
@each(("beside", "heading"), ((0.2, 0.0), (-0.2, 0.0), (0.0, 0.4), (0.1, -0.3)))
def test_errors_fall_and_do_not_swing(speed, beside, heading):
    off = follow(motion((20, 0.0)), speed, beside, heading)
    assert abs(off[-1]) < 0.02
    assert np.abs(off[len(off) // 2 :]).max() < 0.05
    assert (np.diff(np.sign(off[np.abs(off) > 0.01])) != 0).sum() <= 1


@each("speed", (3.0, 5.0))
def test_a_car_that_answers_late_does_not_swing_because_its_errors_fall_over_a_longer_way(speed):
    late, path_lag = 0.046, 0.028 * speed  # those of the vehicle ipz
    points = motion((40, 0.0))
    swings, settles = (follow(points, speed, 0.2, 0.0, late=late, path_lag=path_lag, told=told) for told in (0.0, None))
    assert settles.min() > -0.02 and abs(settles[-1]) < 0.02  # 1 cm beyond the motion at most
    assert swings.min() < -0.04  # 5 cm at 3 m/s; at 5 m/s the swings grow


def test_on_an_arc_the_errors_are_those_to_the_arc():
    points = motion((3, 1.0))
    for along in (0.05, 0.15, 0.25):
        x, y = math.sin(along), 1.0 - math.cos(along)  # on the arc of radius 1 m
        ahead, beside, angle = errors(points[0], x, y, along)
        assert ahead == pytest.approx(0.3 - along, abs=4e-3)  # it is measured along the tangent
        assert beside == pytest.approx(0.0, abs=2e-3) and angle == pytest.approx(0.0, abs=4e-3)
        assert errors(points[0], x - 0.1 * math.sin(along), y + 0.1 * math.cos(along), along)[1] == pytest.approx(
            0.1, abs=5e-3
        )


@each("turns", (-2, -1, 1))
def test_whole_turns_between_the_headings_are_no_error(turns):
    point, heading = motion((1, 1.0))[0], 0.3 + 2.0 * math.pi * turns
    assert errors(point, 0.1, 0.02, heading) == pytest.approx(errors(point, 0.1, 0.02, 0.3), abs=1e-12)


def test_the_next_place_is_ahead_of_the_car_and_at_last_the_last():
    points = motion((5, 0.0))
    assert [next_point(points, 0, x, 0.0, 0.0) for x in (-1.0, 0.29, 0.31, 1.4, 9.0)] == [0, 0, 1, 4, 4]
    assert points[:, [X, Y, HEADING, CURVATURE]].shape == (5, 4)
