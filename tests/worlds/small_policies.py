"""Small policies of random weights, for the tests of policy files."""

from functools import cache

import numpy as np

import fg_mujoco as fg
from fg_mujoco.addons.learn.perceptron import Layer, Normaliser, Perceptron
from fg_mujoco.addons.learn.policy_shapes import observed_shapes
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.envs.policy_interface import PolicyInterface

FLAT = {
    "observation": "beams:54:max=10,speed,steering,previous_action,history:2,normalised,flat",
    "normalised_actions": True, "action": "steering_rate,acceleration", "speed_range": (0.5, 6.0), "action_repeat": 2,
    "smoothing": 0.05,
}  # fmt: skip
PARTS = {"observation": "speed,beams:54,yaw_rate", "speed_range": (0.5, 6.0)}


@cache
def _world():
    return fg.World("oval")


def interface_of(**settings):
    beams = _world().vehicle.lidar.beams
    return PolicyInterface.of(EnvironmentSettings.of(settings), _world().parameters, beams, beams.period)


def network_for(interface, *, hidden=8, activation="tanh", seed=0, normalised=False, estimates=0):
    """A network of two layers that takes the interface's observation; it turns to and fro and drives slowly."""
    rng = np.random.default_rng(seed)
    width = sum(int(np.prod(shape)) for shape in observed_shapes(interface).values())
    weights = rng.normal(size=(hidden, width + estimates)) / width**0.5
    first = Layer(weights=weights, bias=np.zeros(hidden), activation=activation)
    second = Layer(weights=0.1 * rng.normal(size=(2, hidden)), bias=(0.05, 0.1))
    mean, std = rng.normal(size=width), rng.uniform(0.5, 2.0, width)
    count = max(estimates, 1)
    guess = Layer(weights=rng.normal(size=(count, width)), bias=np.ones(count), activation="tanh")
    return Perceptron(
        layers=(first, second), normaliser=Normaliser(mean=mean, std=std, clip=3.0) if normalised else None,
        estimator=Perceptron(layers=(guess,)) if estimates else None,
    )  # fmt: skip
