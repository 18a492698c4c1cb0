"""The tires `f1tenth_gym` beside f1tenth_gym's own single-track model, with the same steering and speeds.

The model is that of its `vehicle_dynamics_st`, written anew from CommonRoad's equations with the gym's parameters, and
integrated by scipy. Its steering angle, speed and acceleration are those that the car had. In the gym no load moves
from the inner to the outer tires, nor to the rear ones by that part of the centripetal acceleration which is along the
car.
"""

import json
import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.race import race_table
from fg_mujoco.envs.gym_environment import F1TenthEnv
from fg_mujoco.envs.gym_vector import F1TenthVectorEnv
from fg_mujoco.vehicle.tire_slip import NO_PEAK

integrate = pytest.importorskip("scipy.integrate")

MU, C_F, C_R, LF, LR, H, MASS, INERTIA, G = 1.0489, 4.718, 5.4562, 0.15875, 0.17145, 0.074, 3.74, 0.04712, 9.81
LENGTH = LF + LR
STEP_AT, END = 0.5, 3.0  # [s]


def yaw_rates(time, steering, speed, acceleration):
    """The gym's yaw rate; its states are yaw rate and sideslip."""

    def motion(at, state):
        yaw_rate, sideslip = state
        angle, v, a = (np.interp(at, time, column) for column in (steering, speed, acceleration))
        front, rear = C_F * (G * LR - a * H), C_R * (G * LF + a * H)
        grip = MU / LENGTH
        turn = LR * rear - LF * front
        return (
            grip * MASS / INERTIA
            * (LF * front * angle + turn * sideslip - (LF**2 * front + LR**2 * rear) * yaw_rate / v),
            grip / v * (front * angle - (front + rear) * sideslip + turn * yaw_rate / v) - yaw_rate,
        )

    return integrate.solve_ivp(motion, (0.0, time[-1]), (0.0, 0.0), t_eval=time, rtol=1e-8, max_step=0.01).y[0]


def compared(height, speed, share):
    """Drive a step to a share of the limit; return the error of the yaw rate at the end, and rms over its greatest."""
    wanted = share * MU * G
    angle = LENGTH * wanted / speed**2 + (1.0 / C_F - 1.0 / C_R) / MU / G * wanted
    steps = [0.0, STEP_AT - 1e-6, STEP_AT, END]
    commands = fg.Commands(time=steps, steering_angle=[0.0, 0.0, angle, angle], speed=[speed] * 4)
    changes = fg.CarChanges(center_of_gravity_height=height)
    driven = fg.drive(commands, tires="f1tenth_gym", changes=changes)
    time, ours, ahead, left, steering = (
        driven.car.column(name) for name in ("time_s", "yaw_rate_rad_s", "vx_m_s", "vy_m_s", "steering_angle_rad")
    )
    v = np.hypot(ahead, left + LR * ours)
    theirs = yaw_rates(time, steering, v, np.gradient(v, time))
    assert theirs[-1] * v[-1] > 0.85 * wanted
    return ours[-1] / theirs[-1] - 1.0, np.sqrt(np.mean((ours - theirs) ** 2)) / theirs.max()


@each("speed", [2.0, 3.0, 4.0, 5.0, 6.0])
def test_the_yaw_rate_is_the_gyms_up_to_half_of_the_limit(speed):
    """With the centre of gravity on the ground, as no load moves in the gym: within 2 %, in a step and once steady."""
    for share in (0.125, 0.25, 0.375, 0.5):
        if LENGTH * share * MU * G / speed**2 < 0.36:
            off, rms = compared(0.002, speed, share)
            assert abs(off) < 0.02
            assert rms < 0.02


def test_sliding_is_not_measured_on_tires_without_a_peak(tmp_path, without_pictures):
    race = fg.race("oval", laps=1, time_limit=1.0, tires="f1tenth_gym")
    figures = (race.car.max_slide_m_s, race.car.max_lateral_slide_m_s, race.car.slide_time_fraction)
    assert all(map(math.isnan, figures)) and race.car.max_slide_place == ""
    assert np.isnan(race.car.column("slide_rear_left_m_s")).all() and np.isfinite(race.car.column("speed_m_s")).all()
    assert race_table(race, None).count(NO_PEAK) == 3
    fg.write_run(race, tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text("utf-8"))
    for row in (summary, summary["cars"][0]):
        assert row["max_slide_m_s"] is row["max_lateral_slide_m_s"] is row["slide_time_fraction"] is None
    report = fg.replay(tmp_path / "run")
    assert report.identical and not report.differences


def test_sliding_is_not_measured_in_rollouts_and_environments_on_tires_without_a_peak():
    rollout = fg.rollout("oval", n=1, laps=1, time_limit=1.0, tires="f1tenth_gym")
    assert rollout.summary()["max_slide_m_s"] is None and NO_PEAK in repr(rollout)
    assert ",,,," in rollout.as_csv()
    for env in (F1TenthEnv(tires="f1tenth_gym"), F1TenthVectorEnv(2, tires="f1tenth_gym")):
        env.reset(seed=0)
        _, reward, *_, info = env.step(np.zeros(env.action_space.shape, np.float32))
        assert np.isnan(info["sliding"]).all() and np.isfinite(reward).all()
