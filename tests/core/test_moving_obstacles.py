"""Boxes that move are where a closed form says, in the physics, in the scan, in a batch and in a replay."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from hand_planners import driven
from scene_search import corridor_walls

TICK = 0.025
ANYWHERE = st.floats(-20.0, 20.0)


def scene(*moving, width=4.0):
    """A straight corridor of 20 m, and in it what moves."""
    return fg.Scene(
        name="test", way=np.array([[-3.0, 0.0], [20.0, 0.0]]), start=3.0, goal=15.0, moving=moving, time_limit=40.0,
        walls=corridor_walls(-4.0, 20.0, width),
    )  # fmt: skip


def box(**changes):
    values = {"length": 0.4, "width": 0.3, "start": (6.0, 0.0), "end": (1.0, 0.0), "speed": 1.3}
    return fg.MovingObstacle(**values | changes)


CROSSING = box(start=(4.0, -1.0), end=(4.0, 1.0), back_and_forth=True, headway=0.5, heading=0.4)


# Where it is


def test_it_goes_from_start_to_end_and_stays_there():
    obstacle = box(start=(0.0, 0.0), end=(3.0, 4.0), speed=2.0)  # 5 m in 2.5 s
    assert obstacle.position(0.0) == (0.0, 0.0)
    assert obstacle.position(1.0) == pytest.approx((1.2, 1.6))
    assert obstacle.position(2.5) == obstacle.position(100.0) == (3.0, 4.0)


def test_back_and_forth_it_turns_at_both_ends():
    obstacle = box(start=(1.0, -1.0), end=(1.0, 1.0), speed=0.5, back_and_forth=True, headway=1.0)
    at = [obstacle.position(time) for time in (0.0, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0)]
    assert [y for _, y in at] == pytest.approx([0.0, 0.5, 1.0, 0.0, -1.0, 0.0, 1.0])
    assert {x for x, _ in at} == {1.0}


@given(
    start=st.tuples(ANYWHERE, ANYWHERE), end=st.tuples(ANYWHERE, ANYWHERE), speed=st.floats(0.01, 5.0),
    headway=st.floats(0.0, 50.0), back_and_forth=st.booleans(), time=st.floats(0.0, 100.0),
)  # fmt: skip
def test_it_never_leaves_its_path_nor_is_faster_than_its_speed(start, end, speed, headway, back_and_forth, time):
    if math.dist(start, end) < 1e-3:
        return
    obstacle = box(start=start, end=end, speed=speed, headway=headway, back_and_forth=back_and_forth)
    here, there = obstacle.position(time), obstacle.position(time + 0.1)
    assert math.dist(start, here) + math.dist(here, end) == pytest.approx(math.dist(start, end), abs=1e-9)
    assert math.dist(here, there) <= 0.1 * speed + 1e-9
    period = 2.0 * obstacle.way / speed
    if back_and_forth:
        assert obstacle.position(time + period) == pytest.approx(here, abs=1e-6)


# In the model


def test_it_is_where_the_closed_form_says_at_every_tick():
    simulation = fg.Simulation(fg.World(scene(CROSSING)))
    for tick in range(200):
        np.testing.assert_allclose(simulation.data.mocap_pos[0, :2], CROSSING.position(tick * TICK), atol=1e-9)
        np.testing.assert_array_equal(simulation.data.body("moving_0").xpos, simulation.data.mocap_pos[0])
        simulation.step(fg.STOP)
    simulation.reset()
    np.testing.assert_allclose(simulation.data.mocap_pos[0, :2], CROSSING.position(0.0), atol=1e-12)


@pytest.mark.slow
@each("lidar", ("raycast", "rangefinder"))
def test_the_lidar_sees_it_without_lag(lidar):
    oncoming = box()
    simulation = fg.Simulation(fg.World(scene(oncoming), lidar=lidar))
    scan, _ = simulation.reset()
    eye = simulation.data.body("car/lidar/hokuyo")
    for tick in range(1, 80):
        scan, _ = simulation.step(fg.STOP)
        nearer_side = oncoming.position(tick * TICK)[0] - 0.5 * oncoming.length
        assert scan.ranges[540] == pytest.approx(nearer_side - eye.xpos[0], abs=1e-3)  # a tick is 33 mm


def test_it_runs_into_a_standing_car_when_the_closed_form_says():
    oncoming = box(end=(-2.0, 0.0))
    result = fg.race(scene(oncoming), driven((0.0, 0.0)))
    car = result.world.parameters
    gap = 6.0 - 0.2 - (car.length - car.rear_overhang)
    assert result.car.end_reason == "crash"
    assert result.sim_time_s == pytest.approx(gap / oncoming.speed, abs=TICK + 0.01)
