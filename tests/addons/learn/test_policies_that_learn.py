"""Policies that learn the friction as gap_finder does."""

import json
from dataclasses import astuple

import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.addons.drivers.friction_learning import LEARNED, learn, learning_row
from fg_mujoco.controllers.control.planner_settings import CAR
from fg_mujoco.envs.gym_vector import F1TenthVectorEnv
from fg_mujoco.envs.policy_interface import PolicyInterface

PARAMETERS = fg.Vehicle.load("f1tenth").parameters


def test_what_a_car_learns_of_the_friction_is_what_gap_finder_would_learn():
    """Of the odometry of each tick, also of those between the steps; and it is forgotten at the end of an episode."""
    env = F1TenthVectorEnv(2, track="oval", observation="friction", action_repeat=2, start="line", mu=0.7)
    car = env.episodes.worlds.world.parameters
    learning, parameters = learning_row(car), np.zeros(1, CAR)
    parameters[0] = astuple(car)
    seen_by, ticks = env.episodes.observer.seen, []
    env.episodes.observer.seen = lambda which, scan, numbers, odometry, *rest, **more: (ticks.append(odometry.copy()),
        seen_by(which, scan, numbers, odometry, *rest, **more))[1]  # fmt: skip
    seen, _ = env.reset(seed=0)
    for step in range(30):
        seen = env.step(np.tile((0.02 * (-1) ** step, 1.0 + 0.1 * step), (2, 1)).astype(np.float32))[0]
    learned = np.zeros(2, LEARNED)
    for odometry in ticks:
        for car_of_it in range(2):
            learn(learning[0], learned[car_of_it], parameters[0], odometry[car_of_it], 0.025)
    expected = np.stack([learned[name] for name in ("mu", "mean", "deviation", "held")], axis=1)
    assert len(ticks) == 61 and (learned["mean"] > 0.0).all() and (learned["held"] > 0.05).all()
    np.testing.assert_array_equal(seen["friction"], expected.astype(np.float32))
    seen, _ = env.reset(options={"reset_mask": np.array([True, False])})
    assert seen["friction"][0].tolist() == [np.float32(0.4), 0.0, 0.0, 0.0]
    assert seen["friction"][1, 1] > 0.0


def test_the_car_that_learns_is_in_the_interface():
    interface = F1TenthVectorEnv(1, observation="friction,speed").policy_interface
    described = json.loads(json.dumps(interface.described(), allow_nan=False))
    assert PolicyInterface.read(described) == interface and interface.parameters.mass == PARAMETERS.mass
    assert "parameters" not in F1TenthVectorEnv(1).policy_interface.described()
    del described["parameters"]
    with pytest.raises(fg.SettingsError, match="accepted: the car's parameters where friction is observed"):
        PolicyInterface.read(described)
