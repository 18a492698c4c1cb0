"""What a race tells of a car that is not on its wheels: jumps, and a chassis that rests on the ground."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.ground import Relief
from fg_mujoco.racing.off_the_wheels import JUMP, jumps_of
from fg_mujoco.racing.replay import replay
from fg_mujoco.racing.run_folder import write_run
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.telemetry import TELEMETRY

TICK = 0.025
LOAD = TELEMETRY.index("load_front_left_N")


def straight_on(height, speed, **settings):
    """The oval's first straight with heights that are a function of x [m], and a car that is driven straight on."""
    x = np.arange(-16.0, 16.0, 0.05)
    relief = Relief(heights=np.tile(height(x), (320, 1)), cell=0.05, corner=(-16.0, -4.0))
    course = replace(fg.load_track("oval"), name="a_straight", relief=relief)
    drive = fg.DriveCommand(steering_angle=0.0, speed=speed)
    return fg.race(course, controller=lambda scan, odometry: drive, **settings)


@each(("flies", "ticks"), ((3, 0), (4, 1), (5, 1)))
def test_a_jump_lasts_a_tenth_of_a_second(flies, ticks):
    rows = np.full((20, len(TELEMETRY)), 1.0)
    rows[:, 0] = TICK * np.arange(20)
    rows[6 : 7 + flies, LOAD : LOAD + 4] = np.nan
    rows[2:19, LOAD] = np.nan  # one wheel is no jump
    rows[8 + flies, LOAD + 1] = 50.0
    jumps = jumps_of(rows)
    assert len(jumps) == ticks
    for jump in jumps:
        assert (jump.time_s, jump.lasted_s) == pytest.approx((6 * TICK, flies * TICK))
        assert jump.lasted_s >= JUMP - 1e-9 and jump.landing_load_N == 52.0


def test_a_car_that_leaves_the_ground_falls_freely_and_is_told_to_jump(tmp_path):
    result = straight_on(lambda x: np.clip(0.3 - 0.95 * (x - 3.0), 0.0, 0.3), 3.0, time_limit=2.0)
    (jump,) = result.car.jumps
    assert 3.0 < jump.x_m < 3.2 and jump.landing_load_N > result.world.cars[0].parameters.mass * 9.81
    engine, data = Engine(result.world), mujoco.MjData(result.world.model)
    falls = []
    for time in (jump.time_s, jump.time_s + 3 * TICK):  # then the chassis meets the slope
        engine.load(result.states[round(time / TICK)])
        engine.read(0, data)
        mujoco.mj_forward(result.world.model, data)
        mujoco.mj_subtreeVel(result.world.model, data)
        falls.append(float(data.body("car/base_link").subtree_linvel[2]))
    assert falls[1] - falls[0] == pytest.approx(-9.81 * 3 * TICK, rel=1e-2)  # steps of 5 ms
    folder = write_run(result, tmp_path / "run")
    assert json.loads((folder / "summary.json").read_text())["jumps"][0]["lasted_s"] == jump.lasted_s
    assert replay(folder).holds


def test_a_car_whose_chassis_rests_on_a_ridge_is_told_to_be_stuck():
    def ridge(x):
        return np.clip(0.16 - 0.9 * np.abs(x - 4.0), 0.0, 0.06)

    result = straight_on(ridge, 0.4, laps=1)
    assert result.car.end_reason == "no_progress" and result.car.end.startswith("stuck at (3.")
    assert 0.2 < result.car.stuck.carried < 0.95 and not result.car.jumps
    standing = straight_on(ridge, 0.0, laps=1)
    assert standing.car.end_reason == "no_progress" and standing.car.stuck is None
