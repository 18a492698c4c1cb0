"""The interfaces of f1tenth_gym round this simulator, so that scripts written for the 2D gym run in 3D.

    from fg_mujoco.addons import gym2d as gym

    env = gym.make("f110_gym:f110-v0", map="maps/aut", map_ext=".png", num_agents=1)
    obs, reward, done, info = env.reset(np.array([[0.0, 0.0, 0.0]]))
    while not done:
        obs, reward, done, info = env.step(np.array([[steering_angle, speed]]))

A script that nobody edits runs by `python -m fg_mujoco.addons.gym2d script.py`, or after `gym2d.install()`.

What is as there: names, shapes, units and order of actions, observations and results; 1080 beams over 4.7 rad, with
noise of 10 mm; a step of 10 ms, after each of which there is a scan; `done` on a collision or after two laps,
`lap_times` that run until then; `map` without its extension; with more cars than one, whose the rows of poses and
actions are, `done` when the ego has collided or all cars have driven two laps, and collisions with other cars.

What is not: this is a car with tires and a suspension. `linear_vels_y` is its lateral velocity, which there is zero.
Poses and velocities are those of the rear axle, and the LiDAR is where it is on the car, 0.275 m ahead of it. Steering
follows its command as the servo lets it; speed follows by the gains of the 2D gym's controller. With linear tires, as
`tires="f1tenth_gym"` puts them on, the car resembles the gym's single-track model, and poses and scans are those of the
centre of gravity. The map's thresholds are honoured. Cars that touch push each other and drive on; each carries the box
that makes it visible.

Needs the extra `gym`. Written afresh from the documentation of f1tenth_gym.
"""

from __future__ import annotations

from typing import Any

from fg_mujoco.errors import SettingsError, missing_extra

try:
    from .installing import install
    from .old_api import F110Env, GymEnv
except ModuleNotFoundError as error:
    if error.name != "gymnasium":
        raise
    raise missing_extra("environments of f1tenth_gym need Gymnasium", "gym") from error

__all__ = ["F110Env", "install", "make"]


def make(name: str = "f110_gym:f110-v0", **settings: Any) -> Any:
    """Return an environment of `f110-v0`, or by `f1tenth-v0` or a `config` of v1.0; SettingsError: another name."""
    id = name.rpartition(":")[2]
    if id == "f1tenth-v0":
        return _new(**settings)
    if id != "f110-v0":
        raise SettingsError(f"environment {name!r}; accepted: f110_gym:f110-v0, f1tenth_gym:f1tenth-v0")
    return _new(**settings) if "config" in settings else F110Env(**settings)


def environment_of_gym(**settings: Any) -> Any:
    """Return gym's `f110-v0`: the environment of v0.2, or, with a `config`, the one of v1.0."""
    return _new(**settings) if "config" in settings else GymEnv(**settings)


def _new(**settings: Any) -> Any:
    from .new_api import F110Env as Environment

    return Environment(**settings)
