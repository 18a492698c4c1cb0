"""Lap times of `gym2d` beside those of f1tenth_gym's model, which is written here from what is published.

The model is the single-track one of CommonRoad's vehicle models (Althoff and Wuersching), with f1tenth_gym's parameters
and controller: steering goes at its greatest rate towards the angle commanded two steps before, and an acceleration is
a gain times what the speed lacks. Below 0.5 m/s it is the kinematic model. Both cars follow the same line by the same
pure pursuit, and their laps are timed alike.
"""

import math
from functools import cache

import numpy as np
import pytest
from test_f110 import WaypointFollower

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons import gym2d as f110
from fg_mujoco.addons.gym2d.speed_controller import SpeedController
from fg_mujoco.course.projection import follow
from fg_mujoco.vehicle.vehicle import Vehicle

STEP = 0.01  # [s]
MU, C_F, C_R, LF, LR, H, MASS, INERTIA, G = 1.0489, 4.718, 5.4562, 0.15875, 0.17145, 0.074, 3.74, 0.04712, 9.81
LENGTH = LF + LR
MOST_ANGLE, STEERING_RATE, SWITCH, MOST_ACCELERATION, LEAST_SPEED, MOST_SPEED = 0.4189, 3.2, 7.319, 9.51, -5.0, 20.0
LOOKAHEAD = 0.82461887897713965  # [m] of the published example


class SingleTrack:
    """The model: x, y of the centre of gravity, steering angle, speed, heading, yaw rate, sideslip angle."""

    def reset(self, poses):
        ((x, y, heading),) = poses
        self.state, self.delayed = np.array((x, y, 0.0, 0.0, heading, 0.0, 0.0)), [0.0, 0.0]
        return self.step([[0.0, 0.0]])

    def step(self, action):
        ((angle, speed),) = action
        self.delayed.append(angle)
        lacking, missing = self.delayed.pop(0) - self.state[2], speed - self.state[3]
        rate = math.copysign(STEERING_RATE, lacking) if abs(lacking) > 1e-4 else 0.0
        gain = (10.0 if self.state[3] > 0.0 else 2.0) * MOST_ACCELERATION
        inputs = (rate, gain / (MOST_SPEED if missing > 0.0 else -LEAST_SPEED) * missing)
        x = self.state
        one = self.motion(x, *inputs)
        two = self.motion(x + 0.5 * STEP * one, *inputs)
        three = self.motion(x + 0.5 * STEP * two, *inputs)
        four = self.motion(x + STEP * three, *inputs)
        self.state = x + STEP / 6.0 * (one + 2.0 * two + 2.0 * three + four)
        return {"poses_x": [self.state[0]], "poses_y": [self.state[1]], "poses_theta": [self.state[4]]}

    @staticmethod
    def motion(state, rate, a):
        _, _, angle, v, heading, yaw_rate, slip = state
        a = min(max(a, -MOST_ACCELERATION), MOST_ACCELERATION * min(1.0, SWITCH / max(v, SWITCH)))
        if (angle <= -MOST_ANGLE and rate < 0.0) or (angle >= MOST_ANGLE and rate > 0.0):
            rate = 0.0
        if abs(v) < 0.5:
            turn = a / LENGTH * math.tan(angle) + v * rate / (LENGTH * math.cos(angle) ** 2)
            way = (v * math.cos(heading), v * math.sin(heading), rate, a, v / LENGTH * math.tan(angle))
            return np.array((*way, turn, 0.0))
        front, rear = C_F * (G * LR - a * H), C_R * (G * LF + a * H)
        grip = MU / LENGTH
        return np.array(
            (
                v * math.cos(heading + slip), v * math.sin(heading + slip), rate, a, yaw_rate,
                grip * MASS / INERTIA * (
                    LF * front * angle + (LR * rear - LF * front) * slip
                    - (LF**2 * front + LR**2 * rear) * yaw_rate / v
                ),
                grip / v * (front * angle - (front + rear) * slip + (LR * rear - LF * front) * yaw_rate / v)
                - yaw_rate,
            )
        )  # fmt: skip


def lap_times(course, reset, step, speed, laps=2):
    """Follow the centreline at one speed from a standing start; return the time of each lap."""
    line, passed, time, progress = course.centreline, [0.0], 0.0, 0.0
    pose = np.array([[*line[0], math.atan2(*(line[1] - line[0])[::-1])]])
    observed, place = reset(pose), float(course.project(line[:1])[0][0])
    follower = WaypointFollower(line, speed=speed, lookahead=LOOKAHEAD, wheelbase=LENGTH)
    while len(passed) <= laps:
        observed = step(follower.plan(observed))
        time += STEP
        now, _ = follow(observed["poses_x"][0], observed["poses_y"][0], place, course.table, course.modulus)
        gone, place = math.remainder(now - place, course.length), now
        progress += gone
        if progress >= len(passed) * course.length:
            passed.append(time - STEP * (progress - len(passed) * course.length) / gone)
        assert not np.any(observed.get("collisions", 0.0)) and time < 120.0
    return np.diff(passed)


def driven(course, speed, **settings):
    """Return the lap times here and of the model."""
    env, track = f110.make(map=course, **settings), fg.load_track(course)
    ours = lap_times(track, lambda pose: env.reset(pose)[0], lambda action: env.step(action)[0], speed)
    return ours, driven_by_the_model(course, speed)


@cache
def driven_by_the_model(course, speed):
    model = SingleTrack()
    return lap_times(fg.load_track(course), model.reset, model.step, speed)


def lateral(course, speed):
    """Return the greatest lateral acceleration that a course asks for, over that which mu gives."""
    line = fg.load_track(course).centreline
    ahead = np.roll(line, -1, axis=0) - line
    turned = np.angle(np.exp(1j * np.diff(np.unwrap(np.arctan2(*ahead.T[::-1])), append=np.nan)))
    return float(np.nanmax(np.abs(turned) / np.hypot(*ahead.T)) * speed**2 / (MU * G))


@pytest.mark.slow
@each("course, tires, slack", [("oval", "f1tenth_gym", 0.005), ("chicanes", "coulomb", 0.005), ("oval", None, 0.007)])
def test_within_grip_a_planner_laps_in_the_time_of_the_gym(course, tires, slack):
    assert lateral(course, 3.0) < 0.5
    ours, theirs = driven(course, 3.0, tires=tires)
    np.testing.assert_allclose(ours, theirs, rtol=slack)


@pytest.mark.slow
@each("course, speed", [("oval", 7.5), ("chicanes", 6.0)])
def test_beyond_grip_linear_tires_lap_in_the_time_of_the_gym(course, speed):
    assert lateral(course, speed) > 1.35
    ours, theirs = driven(course, speed, tires="f1tenth_gym")
    np.testing.assert_allclose(ours, theirs, rtol=0.01)


def test_poses_are_of_the_centre_of_gravity_with_linear_tires_only():
    for tires, ahead in ((None, 0.0), ("f1tenth_gym", LR)):
        env = f110.make(map="oval", tires=tires)
        obs, *_ = env.reset(np.array([[1.0, 0.2, 0.3]]))
        assert (obs["poses_x"][0], obs["poses_y"][0]) == pytest.approx((1.0, 0.2), abs=1e-3)
        at = env.data.body("car/base_link").xpos[:2]
        assert np.hypot(*(at - (1.0, 0.2))) == pytest.approx(ahead, abs=2e-3)
        for _ in range(60):
            obs, *_ = env.step(np.array([[0.3, 2.0]]))
        at, turn = env.data.body("car/base_link").xpos, env.data.body("car/base_link").xmat.reshape(3, 3)
        there = (at + ahead * turn[:, 0])[:2]
        assert (obs["poses_x"][0], obs["poses_y"][0]) == pytest.approx(tuple(there), abs=1e-4)


@each("change, gain", [(0.2, MOST_ACCELERATION * 10 / 20), (-0.2, MOST_ACCELERATION * 10 / 5)])
@each("tires, slack", [("coulomb", 0.08), ("f1tenth_gym", 0.17)])
def test_a_speed_is_approached_by_the_gains_of_the_gym(tires, slack, change, gain):
    env = f110.make(map="fast", tires=tires)
    env.reset(np.array([fg.load_track("fast").start_pose(0.0)]))

    def speed_after(steps, wanted):
        for _ in range(steps):
            obs, *_ = env.step(np.array([[0.0, wanted]]))
        return obs["linear_vels_x"][0]

    before = speed_after(150, 3.0)
    assert before == pytest.approx(3.0, abs=0.02)
    share = (speed_after(5, 3.0 + change) - before) / (3.0 + change - before)  # of the way, in 50 ms
    assert share == pytest.approx(1.0 - math.exp(-0.05 * gain), abs=slack)


def held(car):
    """Time that turns a mean acceleration over a step into what the motor is told beyond its speed [s]."""
    return STEP / (1.0 - math.exp(-STEP / car.speed_time_constant))


def test_drag_is_made_up_for_and_forgotten():
    """A car that gathers 1 m/s^2 less than it is asked for is soon asked for 1 m/s^2 more."""
    car = Vehicle.load("f1tenth").parameters
    controller = SpeedController(car, over_ground=True, timestep=STEP)
    speed = 3.0
    for _ in range(100):
        asked = (controller.set_point(3.0, speed, speed) - speed) / held(car)
        speed += STEP * (asked - 1.0)
    assert asked == pytest.approx(1.0, abs=0.02)
    assert speed == pytest.approx(3.0, abs=0.02)
    controller.reset()
    assert controller.set_point(3.0, 3.0, 3.0) == pytest.approx(3.0)
