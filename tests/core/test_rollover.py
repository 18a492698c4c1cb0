"""A car that rolls over ends its race so, at every door; one that lifts wheels and comes back goes on."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.racing.replay import replay
from fg_mujoco.simulation.cars import WorldCar
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.settings import Start
from fg_mujoco.simulation.termination import END_REASONS
from fg_mujoco.vehicle.motion import ROLLED_OVER, uprightness
from hand_planners import driven

STEP_STEER = "step_steer[speed=6,angle=0.3]"
TALL = {"mu": 1.3, "changes": fg.CarChanges(center_of_gravity_height=0.16)}
"""mu h / (track width / 2) is 1.8: such a car tips over before it slides. The default one, .66, slides."""


def tilt(engine, degrees, row=0):
    """Turn a car about its own axis ahead, in place, and lift it clear of the ground."""
    first = engine.world.cars[row].constants[0]["free_qpos"]
    qpos, half = engine.qpos(0), 0.5 * math.radians(degrees)
    heading = 2.0 * math.atan2(qpos[first + 6], qpos[first + 3])
    cos, sin = math.cos(0.5 * heading), math.sin(0.5 * heading)
    qpos[first + 2] += 0.2 * abs(math.sin(half))
    qpos[first + 3 : first + 7] = (
        math.cos(half) * cos, math.sin(half) * cos, math.sin(half) * sin, math.cos(half) * sin
    )  # fmt: skip


@each("vehicle", fg.vehicle_names())
@each("tires", ("contact", "coulomb"))
def test_a_tall_car_rolls_over_in_a_step_steer_and_a_low_one_slides(vehicle, tires):
    """Oracle: mu times the height of the CoG over half the track width, on both sides of 1."""
    if (vehicle, tires) == ("autodrive", "contact"):
        pytest.skip("its drag is refused there")
    tall = fg.drive(STEP_STEER, vehicle=vehicle, tires=tires, **TALL)
    car = tall.car
    assert car.end_reason == "rolled_over" and not car.finished and car.collisions_wall == 0 and car.crash is None
    assert tall.sim_time_s < 2.0
    low = fg.drive(STEP_STEER, vehicle=vehicle, tires="coulomb")
    assert low.car.end_reason == "finished" and low.car.rollover is None


def test_a_race_ends_in_the_tick_in_which_the_car_is_tilted_by_more_than_80_degrees():
    engine = Engine(fg.World("oval"))
    for degrees, reason in ((79.0, ""), (81.0, "rolled_over"), (-81.0, "rolled_over"), (180.0, "rolled_over")):
        engine.place([Start()])
        tilt(engine, degrees)
        constants = engine.world.car.constants
        assert uprightness(engine.qpos(0), constants) == pytest.approx(math.cos(math.radians(degrees)), abs=1e-9)
        engine.judge()
        assert END_REASONS[engine.monitor.reasons[0]] == reason and engine.running[0] == (reason == "")
    assert math.degrees(ROLLED_OVER) == pytest.approx(80.0)


@each("degrees", (-35.0, 20.0, 35.0))
def test_a_car_that_lifts_two_wheels_and_comes_back_goes_on(degrees):
    """Below the 58 degrees at which its CoG is over its wheels it falls back on them; nor is its landing a crash."""
    engine = Engine(fg.World("oval"))
    engine.place([Start()])
    tilt(engine, degrees)
    for _ in range(60):
        engine.commands[:] = 0.0
        engine.drive()
        engine.judge()
    assert engine.running[0] and not engine.crashed[0]
    assert uprightness(engine.qpos(0), engine.world.car.constants) > 0.999


@each("degrees", (85.0, 120.0, 180.0))
def test_a_car_that_lies_stays_on_the_ground_and_has_not_crashed(degrees):
    engine = Engine(fg.World("oval"))
    engine.place([Start()])
    tilt(engine, degrees)
    engine.judge()
    assert END_REASONS[engine.monitor.reasons[0]] == "rolled_over"
    for _ in range(60):
        engine.running[:] = True
        engine.drive()
    first = engine.world.car.constants[0]["free_qpos"]
    assert not engine.crashed[0] and engine.qpos(0)[first + 2] > 0.04
    assert uprightness(engine.qpos(0), engine.world.car.constants) < 0.2


def test_one_of_two_cars_that_rolls_over_is_out_and_the_other_goes_on():
    engine = Engine(fg.World("oval", others=(WorldCar(),)))
    engine.place([Start(), Start(s=3.0)])
    tilt(engine, 90.0, row=1)
    engine.judge()
    assert [END_REASONS[reason] for reason in engine.monitor.reasons] == ["", "rolled_over"]
    for _ in range(80):
        engine.running[1] = True
        engine.commands[:] = 0.0
        engine.drive()
    assert not engine.crashed.any()
    first = engine.world.cars[1].constants[0]["free_qpos"]
    assert engine.qpos(0)[first + 2] > 0.04


@pytest.fixture(scope="module")
def rolled():
    swerves = driven(lambda odometry: (0.4 if odometry.stamp > 0.2 else 0.0, 7.0))
    return fg.race("oval", swerves, tires="coulomb", start=Start(speed=7.0, offset=-0.5), planner_mu=math.inf, **TALL)


@pytest.mark.slow
def test_its_run_is_proved_by_its_replay(rolled, tmp_path):
    folder = fg.write_run(rolled, tmp_path / "run", picture=False)
    report = replay(folder)
    assert not report.differences and "end_reason" not in report.unproved and rolled.car.end_reason == "rolled_over"


def test_an_episode_ends_terminated_and_costs_as_a_crash():
    pytest.importorskip("gymnasium")
    from fg_mujoco.envs.gym_environment import F1TenthEnv
    from fg_mujoco.envs.rewards import Rewards

    with F1TenthEnv(beam_step=20) as env:
        env.reset(seed=0)
        tilt(env._episodes.worlds.engine, 170.0)
        _, reward, terminated, truncated, info = env.step(np.zeros(2, np.float32))
        assert terminated and not truncated and info["end_reason"] == "rolled_over"
        assert reward == pytest.approx(-Rewards().collision, abs=0.2)
