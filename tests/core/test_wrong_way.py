"""A race ends when the car has come back by five metres from its greatest progress, and tells where it turned."""

import functools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.termination import END_REASONS, WRONG_WAY_LIMIT, WrongWay
from hand_planners import driven

TICK, STEP = 0.025, 0.21  # [s], [m] of which five metres are no multiple
world_of = functools.cache(fg.World)


def there_and_back(start, furthest, back):
    """Places along the line [m]: from `start` to `furthest`, and back by `back`; and the index of the furthest."""
    forth = np.append(np.arange(start, furthest, STEP), furthest)
    return np.concatenate((forth, np.append(np.arange(furthest - STEP, furthest - back, -STEP), furthest - back))), (
        len(forth) - 1
    )


def judged(world, places, *, offset=0.0, laps=3):
    """The engine after its car was put at places along the line [m], one a tick, and judged until its race was over."""
    engine = Engine(world, laps=laps, time_limit=1e4)
    engine.place([fg.Start(s=places[0], offset=offset)])
    for tick, s in enumerate(places[1:], start=1):
        x, y, heading = world.track.start_pose(s, offset)
        engine.qpos(0)[:2] = x, y
        engine.qpos(0)[3:7] = math.cos(0.5 * heading), 0.0, 0.0, math.sin(0.5 * heading)
        engine.state(0)[0] = tick * TICK  # mjSTATE_TIME comes first
        engine.judge()
        if not engine.running[0]:
            break
    return engine


def reason(engine):
    return END_REASONS[engine.monitor.reasons[0]]


@each("name", ["oval", "hairpins", "scene:dead_end:0"])
@each(("back", "expected"), ((4.9, ""), (5.1, "wrong_way"), (12.0, "wrong_way")))
def test_five_metres_back_from_the_greatest_progress_end_the_race(name, back, expected):
    world = world_of(name)
    places, turn = there_and_back(0.5, 5.7, back)
    engine = judged(world, places, offset=0.1)
    assert reason(engine) == expected
    timer = engine.monitor.timers[0]
    if expected:  # it ended with the first tick that was so far back, and not with a later one
        fallen = places[turn] - places
        assert engine.time(0) == TICK * int(np.argmax((np.arange(len(places)) > turn) & (fallen >= WRONG_WAY_LIMIT)))
    where = WrongWay.of(timer, world.track.length, 1, 1.0)
    x, y, _ = world.track.start_pose(5.7, 0.1)
    begun = 0.5 if world.track.closed else 0.0  # a scene counts from its own start
    assert (where.x_m, where.y_m) == pytest.approx((x, y))
    assert (where.time_s, where.lap) == (pytest.approx(turn * TICK), 1)
    assert where.s_m == pytest.approx(5.7 - begun, abs=1e-3)


@given(backs=st.lists(st.floats(0.2, 4.8), min_size=1, max_size=6))
@pytest.mark.slow
def test_manoeuvres_of_less_than_five_metres_never_end_a_race(backs):
    """However often the car reverses: what counts is the distance from the greatest progress, not their sum."""
    places, at = [np.array([0.0])], 0.0
    for back in backs:
        leg, _ = there_and_back(at, at + back + 0.1, back)
        places.append(leg)
        at += 0.1
    assert reason(judged(world_of("oval"), np.concatenate(places))) == ""


def test_a_turn_in_a_later_lap_is_told_by_its_lap_and_the_way_in_it():
    world = world_of("oval")
    length, start = world.track.length, 7.0
    places, turn = there_and_back(start, start + length + 1.5, 5.1)  # back over the line
    engine = judged(world, places)
    where = WrongWay.of(engine.monitor.timers[0], length, 3, 1.0)
    assert (reason(engine), where.lap) == ("wrong_way", 2)
    assert where.s_m == pytest.approx(1.5, abs=0.01) and where.time_s == pytest.approx(turn * TICK)
    assert (where.x_m, where.y_m) == pytest.approx(world.track.start_pose(start + 1.5)[:2], abs=1e-6)


def test_beside_the_next_arm_of_a_hairpin_nothing_is_lost():
    """Lanes that run back beside each other are close together in space and far apart in progress."""
    track = world_of("hairpins").track
    places = np.arange(0.0, 0.9 * track.length, STEP)
    for offset in (0.7, -0.7):
        assert reason(judged(world_of("hairpins"), places, offset=offset)) == ""


def wide(half_width=3.0):
    """A round track of 30 m radius, wide enough to turn on, driven counterclockwise from (30, 0)."""
    angles = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    width = np.full(400, half_width)
    line = 30.0 * np.column_stack((np.cos(angles), np.sin(angles)))
    return fg.Track(name="wide", centreline=line, width_right=width, width_left=width)


def test_a_car_that_turns_round_is_told_of():
    """It turns left at full lock at 1.5 m/s: its greatest progress is where its heading is across the course."""

    def law(odometry):
        turned = odometry.pose[2] - 0.5 * math.pi
        return (0.4, 1.5) if odometry.stamp > 2.0 and 0.0 <= turned % (2.0 * math.pi) < math.pi else (0.0, 1.5)

    result = fg.race(wide(), driven(law), laps=1, start=fg.Start(offset=-0.5))
    assert (result.car.end_reason, result.car.finished, result.car.collisions_wall) == ("wrong_way", False, 0)
    turn, progress = result.car.wrong_way, result.car.column("progress_m")
    tick = int(progress.argmax())
    assert turn.s_m == progress[tick] and turn.time_s == result.car.column("time_s")[tick]
    assert (turn.x_m, turn.y_m) == (result.car.column("x_m")[tick], result.car.column("y_m")[tick])
    # the heading [rad] from that of the course there, which is across the circle's radius
    across = result.car.column("heading_rad")[tick] - (math.atan2(turn.y_m, turn.x_m) + 0.5 * math.pi)
    assert across % (2.0 * math.pi) == pytest.approx(0.5 * math.pi, abs=0.1)
    assert progress[-1] > turn.s_m - WRONG_WAY_LIMIT >= progress[-1] - 1.5 * TICK - 0.01
