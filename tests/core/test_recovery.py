"""Recovery: the car reverses exactly along the path it came by, when it stands without a frontier, and not for ever."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.controllers.control.planner_settings import for_car, record_type, record_values
from fg_mujoco.controllers.safety.recovery import (
    PATH_HISTORY,
    RecoverySettings,
    angle_along_history,
    extend_history,
    reverses,
)
from fg_mujoco.course.random_obstacles import random_boxes
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED
from scan_worlds import CAR

PERIOD = 0.025
WHEELBASE = 0.33
DEFAULTS = for_car(RecoverySettings(), CAR)


def new():
    return np.zeros(1, PATH_HISTORY)[0], np.array([record_values(DEFAULTS)], record_type(RecoverySettings))[0]


def stand(history, settings, seconds, waits=True):
    """Stand without a way on; return the number of ticks in which the car is to go back."""
    return sum(bool(reverses(history, settings, True, False, waits, PERIOD)) for _ in range(round(seconds / PERIOD)))


def come(history, settings, meters, speed=2.0):
    for _ in range(round(meters / (speed * PERIOD))):
        extend_history(history, settings, speed, 0.0, PERIOD)
        reverses(history, settings, False, True, True, PERIOD)


@each("speed", [0.5, 2.0, 6.0])
def test_it_comes_back_along_its_own_path(speed):
    """A single-track car drives a wave, and back from its end; the path is known in closed form nowhere: it is kept."""
    history, settings = new()
    x, y, heading, path = 0.0, 0.0, 0.0, []
    for tick in range(round(3.0 / (speed * PERIOD))):
        yaw_rate = speed * math.tan(0.3 * math.sin(2.0 * tick * speed * PERIOD)) / WHEELBASE
        heading += 0.5 * yaw_rate * PERIOD
        x, y = x + speed * PERIOD * math.cos(heading), y + speed * PERIOD * math.sin(heading)
        heading += 0.5 * yaw_rate * PERIOD
        path.append((x, y))
        extend_history(history, settings, speed, yaw_rate, PERIOD)
    assert (history["x"], history["y"], history["heading"]) == pytest.approx((x, y, heading))
    assert stand(history, settings, DEFAULTS.patience) == 1
    end, gone, off = (x, y), 0.0, []
    while reverses(history, settings, False, True, True, PERIOD):
        yaw_rate = -DEFAULTS.speed * math.tan(angle_along_history(history, WHEELBASE)) / WHEELBASE
        heading += 0.5 * yaw_rate * PERIOD
        x, y = x - DEFAULTS.speed * PERIOD * math.cos(heading), y - DEFAULTS.speed * PERIOD * math.sin(heading)
        heading += 0.5 * yaw_rate * PERIOD
        gone += DEFAULTS.speed * PERIOD
        off.append(np.hypot(*(np.array(path) - (x, y)).T).min() - 0.5 * speed * PERIOD)
        extend_history(history, settings, -DEFAULTS.speed, yaw_rate, PERIOD)
    assert gone == pytest.approx(DEFAULTS.distance, abs=DEFAULTS.speed * PERIOD + 1e-9)
    assert max(off) < 0.03
    assert math.hypot(x - end[0], y - end[1]) > 0.9 * DEFAULTS.distance


def test_it_waits_first_and_a_moment_without_being_stuck_starts_that_anew():
    history, settings = new()
    come(history, settings, 3.0)
    assert stand(history, settings, DEFAULTS.patience - PERIOD) == 0
    reverses(history, settings, False, True, True, PERIOD)
    assert stand(history, settings, DEFAULTS.patience - PERIOD) == 0
    assert stand(history, settings, PERIOD) == 1


def test_each_time_it_goes_back_farther_and_after_some_tries_it_stays():
    history, settings = new()
    come(history, settings, 6.0)
    for number in range(1, DEFAULTS.tries + 1):
        assert stand(history, settings, DEFAULTS.patience if number == 1 else DEFAULTS.patience_again) == 1
        assert history["back"] == pytest.approx(DEFAULTS.distance * number)
        while reverses(history, settings, False, True, True, PERIOD):
            extend_history(history, settings, -DEFAULTS.speed, 0.0, PERIOD)
        come(history, settings, DEFAULTS.distance * number + 0.9 * DEFAULTS.come_on)  # not far enough to forget
    assert stand(history, settings, 10.0) == 0


def test_it_goes_back_sooner_where_a_frontier_is_known_and_nothing_moves():
    for waits, patience in ((True, DEFAULTS.patience), (False, DEFAULTS.patience_known)):
        history, settings = new()
        come(history, settings, 6.0)
        assert stand(history, settings, patience - PERIOD, waits) == 0, waits
        assert stand(history, settings, PERIOD, waits) == 1, waits


def test_it_goes_back_no_farther_than_it_came_and_not_at_all_where_it_was_put():
    history, settings = new()
    assert stand(history, settings, 5.0) == 0
    history, settings = new()
    come(history, settings, 0.8)
    assert stand(history, settings, DEFAULTS.patience) == 1
    gone = 0.0
    while reverses(history, settings, False, True, True, PERIOD):
        extend_history(history, settings, -DEFAULTS.speed, 0.0, PERIOD)
        gone += DEFAULTS.speed * PERIOD
    assert 0.4 < gone < 0.8


@each("motion", [(math.nan, 0.0), (1.0, math.inf), (1.0, math.nan)])
def test_after_a_motion_that_is_none_it_does_not_know_the_way_back(motion):
    history, settings = new()
    come(history, settings, 3.0)
    extend_history(history, settings, *motion, PERIOD)
    assert stand(history, settings, 5.0) == 0
    assert np.isfinite(history["x"]) and np.isfinite(history["heading"])


@pytest.mark.slow
@each("seed", [20, 39])
def test_a_car_askew_before_a_box_gets_past_and_without_going_back_it_stands(seed):
    boxes = random_boxes(fg.load_track("chicanes"), 4, seed, car=CAR)
    for kept, expected in ((True, "finished"), (False, "no_progress")):
        race = fg.race("chicanes", "gap_finder", laps=1, obstacles=boxes, assist="safe" if kept else "safe-recovery")
        assert race.car.end_reason == expected and race.car.collisions_wall == 0
        assert race.car.max_slide_m_s <= SLIDING_SPEED
        assert (race.car.column("speed_m_s").min() < -0.5) == kept
