"""A scene is a course that is driven once: its progress, its goal, its stop, alone and in a batch."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.lap_timer import LapTimer
from hand_planners import driven
from scene_search import corridor_walls

TICK = 0.025


def scene(**changes):
    """A corridor of 2 m, 20 m long, from its start at x = 0 to its goal at x = 12."""
    values = {
        "name": "test", "way": np.array([[-3.0, 0.0], [5.0, 0.0], [20.0, 0.0]]), "start": 3.0, "goal": 15.0,
        "walls": corridor_walls(-4.0, 20.0, 2.0), "time_limit": 30.0,
    }  # fmt: skip
    return fg.Scene(**values | changes)


# Its line


def test_the_lap_timer_counts_from_the_start_to_the_goal_and_back_again():
    timer = LapTimer(scene())
    for tick, x in enumerate((1.0, 0.5, -2.0, -4.5, -2.0, 5.0, 11.0, 13.0, 11.0, 13.0, 18.0)):
        timer.update(float(tick), (x, 0.1))
    assert timer.lap_times == (6.5,)  # x = 12 between 11 and 13, once
    assert timer.progress == pytest.approx(18.0) and timer.offset == pytest.approx(0.1)
    assert timer.laps_completed == 1


@each(
    "changes",
    (
        {"start": 1.9}, {"goal": 3.0}, {"goal": math.nan}, {"time_limit": 0.0}, {"way": np.zeros((2, 3))},
        {"way": np.array([[0.0, 0.0]])}, {"way": np.array([[0.0, 0.0], [0.0, 0.0], [30.0, 0.0]])},
        {"way": np.array([[0.0, 0.0], [math.nan, 0.0]])},
    ),
)  # fmt: skip
def test_a_scene_that_cannot_be_raced_is_refused(changes):
    with pytest.raises(fg.SettingsError, match="accepted"):
        scene(**changes)


# Its race


def test_finished_is_the_goal_passed():
    result = fg.race(scene(), driven((0.0, 2.0)), start=fg.Start(speed=2.0), tires="coulomb")
    assert (result.car.end_reason, result.laps_requested, result.car.laps_completed) == ("finished", 1, 1)
    assert result.car.lap_times_s[0] == pytest.approx(6.0, rel=0.01)
    assert result.car.column("progress_m")[0] == pytest.approx(0.0, abs=1e-9)
    assert 12.0 - 2.0 * TICK - 1e-6 < result.car.column("progress_m")[-1] < 12.0


# Where the goal is to stop


STOP = {
    "goal_is_to_stop": True,
    "walls": corridor_walls(-4.0, 15.0, 2.0),
    "way": np.array([[-3.0, 0.0], [15.0, 0.0]]),
}


def test_to_stand_two_seconds_behind_the_goal_is_to_finish():
    brakes = driven(lambda odometry: (0.0, 2.0 if odometry.stamp < 6.3 else 0.0))
    result = fg.race(scene(**STOP), brakes, start=fg.Start(speed=2.0), tires="coulomb")
    assert result.car.finished and result.car.collisions_wall == 0
    speed, time = result.car.column("speed_m_s"), result.car.column("time_s")
    stood = time[np.abs(speed) >= 0.05][-1] + TICK
    assert result.sim_time_s == pytest.approx(stood + 2.0, abs=2.0 * TICK)
    assert result.car.lap_times_s[0] == pytest.approx(6.0, rel=0.01)  # when it came to the goal


@each(
    ("when", "then", "time_limit", "end_reason", "laps"),
    [
        (6.3, lambda _: 0.1, 15.0, "time_limit", 1),  # it creeps
        (5.0, lambda _: 0.0, None, "no_progress", 0),  # before the goal
        (6.5, lambda stamp: -2.0 if stamp < 8.5 else 0.0, None, "no_progress", 1),  # it comes back
    ],
)
def test_to_do_else_is_not_to_finish(when, then, time_limit, end_reason, laps):
    planner = driven(lambda odometry: (0.0, 2.0 if odometry.stamp < when else then(odometry.stamp)))
    result = fg.race(scene(**STOP), planner, start=fg.Start(speed=2.0), time_limit=time_limit)
    assert (result.car.end_reason, result.car.laps_completed) == (end_reason, laps)
