"""Laps by progress along the centreline, with direction."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fg_mujoco.course.lap_timer import LapTimer
from fg_mujoco.course.track import Track
from fg_mujoco.simulation.course_loading import load_track

TICK = 0.025  # [s]


@pytest.fixture(scope="module")
def oval():
    return load_track("oval")


def drive(timer, track, places, *, offset=0.0, start_time=0.0):
    """Put the car at each place along the line [m], a tick apart; answer the time of the last."""
    time = start_time
    for k, s in enumerate(places):
        time = start_time + k * TICK
        timer.update(time, track.position(s, offset))
    return time


@settings(deadline=None, max_examples=20)
@given(start=st.floats(0.0, 50.0), offset=st.floats(-0.8, 0.8))
def test_line_is_where_the_car_is_first_seen(oval, start, offset):
    timer = LapTimer(oval)
    places = np.arange(start, start + oval.length, 0.2)
    drive(timer, oval, places, offset=offset)
    assert timer.laps_completed == 0
    drive(timer, oval, [places[-1] + 0.2, places[-1] + 0.4], offset=offset, start_time=1e3)
    assert timer.laps_completed == 1
    assert timer.offset == pytest.approx(offset, abs=0.01)


def test_progress_at_accelerating_speed_is_interpolated_within_a_tick(oval):
    timer, acceleration = LapTimer(oval), 2.0
    time = TICK * np.arange(400)
    drive(timer, oval, 0.5 * acceleration * time**2)
    exact = math.sqrt(2.0 * oval.length / acceleration)
    assert timer.lap_times[0] == pytest.approx(exact, abs=acceleration * TICK**2)  # linear within the tick


def test_reversing_over_the_line_and_coming_back_counts_nothing(oval):
    timer = LapTimer(oval)
    to_and_fro = np.concatenate((np.arange(0.0, -3.0, -0.2), np.arange(-3.0, 3.0, 0.2), np.arange(3.0, -3.0, -0.2)))
    drive(timer, oval, np.tile(to_and_fro, 3))
    assert timer.laps_completed == 0
    length = oval.length
    over = np.concatenate((np.arange(-3.0, length + 1.0, 0.2), np.arange(length + 1.0, length - 1.0, -0.2)))
    drive(timer, oval, np.concatenate((over, np.arange(length - 1.0, length + 2.0, 0.2))), start_time=100.0)
    assert timer.laps_completed == 1


def test_lap_after_reversing_over_the_line_needs_the_whole_length(oval):
    timer = LapTimer(oval)
    length = oval.length
    places = np.concatenate(
        (
            np.arange(0.0, length + 1.0, 0.2),
            np.arange(length + 1.0, length - 2.0, -0.2),
            np.arange(length - 2.0, 2 * length + 0.3, 0.2),
        )
    )
    drive(timer, oval, places)
    assert timer.laps_completed == 2
    assert sum(timer.lap_times) == pytest.approx(TICK * (len(places) - 1), abs=2 * TICK)


def test_beside_the_other_arm_progress_stays():
    """A car pushed right up to a thin wall, nearer to the other arm's centreline than to its own."""
    line = [(x, 0.0) for x in np.arange(0.0, 20.0, 0.2)] + [(20.0, y) for y in np.arange(0.0, 8.0, 0.2)]
    line += [(x, 8.0) for x in np.arange(20.0, 12.0, -0.2)] + [(12.0, y) for y in np.arange(8.0, 2.0, -0.2)]
    line += [(x, 2.0) for x in np.arange(12.0, 0.0, -0.2)] + [(0.0, y) for y in np.arange(2.0, 0.0, -0.2)]
    line = np.array(line)
    left = np.where(line[:, 1] < 0.1, 1.4, 0.5)
    track = Track(name="arms", centreline=line, width_right=np.full(len(line), 0.5), width_left=left)
    timer = LapTimer(track)
    for k, x in enumerate(np.arange(2.0, 10.0, 0.2)):
        timer.update(k * TICK, (x, 1.3))
    assert timer.progress == pytest.approx(7.8)
    assert timer.offset == pytest.approx(1.3)


def test_no_progress_leaves_its_time_behind(oval):
    timer = LapTimer(oval)
    assert math.isnan(timer.last_progress_time)
    end = drive(timer, oval, np.arange(0.0, 10.0, 0.2))
    assert timer.last_progress_time == pytest.approx(end)
    drive(timer, oval, np.full(100, 9.8), start_time=end + TICK)
    assert timer.last_progress_time == pytest.approx(end)
    drive(timer, oval, np.arange(9.8, 5.0, -0.2), start_time=end + 10.0)  # backward is no progress
    drive(timer, oval, np.arange(5.0, 9.8, 0.2), start_time=end + 20.0)  # nor is what was driven before
    assert timer.last_progress_time == pytest.approx(end)
    drive(timer, oval, [9.8, 10.2], start_time=end + 30.0)
    assert timer.last_progress_time == pytest.approx(end + 30.0 + TICK)
