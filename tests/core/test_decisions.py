"""Decision times, the limit of a decision, and commands that the car clamps."""

import signal
import threading
import time

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.racing.decision_times import DecisionTimes
from hand_planners import driven

TICK = 0.025


def race(before, **settings):
    """Race a planner that calls a function of the time before each of its commands."""
    calls = driven(lambda odometry: before(odometry.stamp) or (0.0, 1.0))
    return fg.race("oval", calls, **({"laps": 1, "time_limit": 0.5, "decision_limit": 0.2} | settings))


def loop(now):
    while now > 0.09:
        pass


def sleep(now):
    if now > 0.09:
        time.sleep(60.0)


def wait_for_a_lock(now):
    if now > 0.09:
        lock = threading.Lock()
        lock.acquire()
        lock.acquire()


def catch_errors(now):
    while now > 0.09:
        try:
            time.sleep(60.0)
        except Exception:  # as planners do
            continue


def catch_all_once(now):
    if now > 0.09:
        try:
            time.sleep(60.0)
        except BaseException:
            time.sleep(60.0)


@each("hang", (loop, sleep, wait_for_a_lock, catch_errors, catch_all_once))
def test_a_planner_that_never_answers_ends_the_race(hang):
    result = race(hang)
    assert (result.car.end_reason, result.car.finished, result.car.collisions_wall) == ("decision_limit", False, 0)
    assert len(result.ctrl) == 4 and result.sim_time_s == pytest.approx(4 * TICK)
    assert result.car.decision_times.decisions == 5 and result.car.decision_times.worst_s >= 0.2
    assert result.setup.decision_limit == 0.2
    whole = race(lambda now: None)
    assert whole.car.end_reason == "time_limit" and np.array_equal(result.states, whole.states[:5])


def test_a_race_leaves_the_handler_of_signals_as_it_was():
    before = signal.getsignal(signal.SIGALRM)
    for planner, reason in ((lambda now: None, "time_limit"), (sleep, "decision_limit")):
        assert race(planner).car.end_reason == reason and signal.getsignal(signal.SIGALRM) is before


# What is counted


def test_99_percent_of_the_decisions_took_no_longer_and_each_figure_is_one_of_them():
    times = DecisionTimes.of([0.001 * k for k in range(100, 0, -1)], TICK)
    assert (times.median_s, times.percentile_99_s, times.worst_s) == (0.05, 0.099, 0.1)
    assert (times.decisions, times.over_period) == (100, 75)
    assert str(times) == "median 50.00 ms, 99 % 99.00 ms, worst 100.00 ms; 75 of 100 over 25 ms"
    few = DecisionTimes.of([0.001, 0.5, 0.001], TICK)
    assert (few.median_s, few.percentile_99_s, few.worst_s, few.over_period) == (0.001, 0.5, 0.5, 1)


# Commands outside the car's limits


@each(
    ("steering_angle", "speed", "clamped"),
    [
        (0.0, 1.0, 0), (0.4189, 1.0, 0), (-0.4189, 1.0, 0), (0.42, 1.0, 4), (-0.42, 1.0, 4),
        (0.0, 20.0, 0), (0.0, -5.0, 0), (0.0, 20.1, 4), (0.0, -5.1, 4),
    ],
)  # fmt: skip
def test_commands_outside_the_limits_of_the_car_are_counted(steering_angle, speed, clamped):
    result = fg.race("oval", driven((steering_angle, speed)), laps=1, time_limit=0.1)
    assert result.car.clamped_commands == clamped == result.summary()["clamped_commands"]
