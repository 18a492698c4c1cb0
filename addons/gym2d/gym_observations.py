"""The observations of f1tenth_gym v1.0: which there are, what each has, and its space.

| type | what |
| --- | --- |
| `original`, None | a dictionary of arrays, one entry a car, float32 |
| `kinematic_state`, `dynamic_state`, `frenet_dynamic_state`, `features` | of each car a dictionary of some features |
| `direct` | of each car scan, state, collision, lap time and count, frenet pose |
| `rl` | the ego's scan as one array |
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from fg_mujoco.errors import SettingsError, accepted_names

_LARGE = 1e30  # of a number without limits, as in the gym
_OF_CARS = ("poses_x", "poses_y", "poses_theta", "linear_vels_x", "linear_vels_y", "ang_vels_z", "collisions",
            "lap_times", "lap_counts")  # fmt: skip
_KINEMATIC = ("pose_x", "pose_y", "delta", "linear_vel_x", "pose_theta")
_STATES = {
    "kinematic_state": _KINEMATIC,
    "dynamic_state": (*_KINEMATIC, "ang_vel_z", "beta"),
    "frenet_dynamic_state": (
        "pose_x", "pose_y", "delta", "linear_vel_x", "linear_vel_y", "pose_theta", "ang_vel_z", "beta",
    ),
    "direct": ("scan", "std_state", "state", "collision", "lap_time", "lap_count", "sim_time", "frenet_pose"),
}  # fmt: skip
_SHAPES = {"std_state": (7,), "state": (7,), "frenet_pose": (3,)}
FEATURES = (
    "scan", "pose_x", "pose_y", "pose_theta", "linear_vel_x", "linear_vel_y", "linear_vel_magnitude", "ang_vel_z",
    "delta", "beta", "collision", "lap_time", "lap_count", "sim_time", "std_state", "state", "frenet_pose",
)  # fmt: skip
"""Names of the observations of each car."""

TYPES = ("original", "features", *_STATES, "rl")


class Observation:
    """Observation of an environment's cars after a step; SettingsError: another type, or another feature."""

    def __init__(self, env: Any, type: Any = None, features: Sequence[str] | None = None, **_: Any) -> None:
        self._env = env
        self.type = str(getattr(type, "value", type) or "original").lower()
        if self.type == "default":
            self.type = "direct"
        if self.type not in TYPES:
            raise SettingsError(f"observation type {self.type!r}; {accepted_names(self.type, TYPES)}")
        self.features = tuple(features or _STATES.get(self.type, FEATURES))
        for feature in self.features:
            if feature not in FEATURES:
                raise SettingsError(f"observation has feature {feature!r}; {accepted_names(feature, FEATURES)}")

    def space(self) -> Any:
        """Return the space of it."""
        env, box = self._env, spaces.Box
        beams, reach = env.sim.num_beams, float(env.driving.engine.beams.range_max) + 0.5
        if self.type == "rl":
            return box(low=0.0, high=reach, shape=(beams,), dtype=np.float32)
        if self.type == "original":
            found: dict[str, spaces.Space[Any]] = {"ego_idx": spaces.Discrete(env.num_agents)}
            found["scans"] = box(low=0.0, high=reach, shape=(env.num_agents, beams), dtype=np.float32)
            for name in _OF_CARS:
                found[name] = box(low=-_LARGE, high=_LARGE, shape=(env.num_agents,), dtype=np.float32)
            return spaces.Dict(found)
        parts: dict[str, spaces.Space[Any]] = {
            name: box(low=0.0, high=reach, shape=(beams,), dtype=np.float32)
            if name == "scan"
            else box(low=-_LARGE, high=_LARGE, shape=_SHAPES.get(name, ()), dtype=np.float32)
            for name in self.features
        }
        return spaces.Dict({agent: spaces.Dict(parts) for agent in env.agent_ids})

    def observe(self) -> Any:
        """Return it, of the present state."""
        env = self._env
        seen = env.render_obs
        if self.type == "rl":
            return seen["scans"][env.ego_idx].astype(np.float32)
        if self.type == "original":
            found = {"ego_idx": seen["ego_idx"], "scans": np.array(seen["scans"], np.float32)}
            return found | {name: np.array(seen[name], np.float32) for name in _OF_CARS}
        return {agent: self._of_car(index) for index, agent in enumerate(env.agent_ids)}

    def _of_car(self, index: int) -> dict[str, Any]:
        return {feature: np.asarray(self._feature(feature, index), np.float32)[()] for feature in self.features}

    def _feature(self, feature: str, index: int) -> Any:
        env = self._env
        seen = env.render_obs
        if feature in ("delta", "beta", "std_state", "state"):
            state = env.driving.state(index)
            return {"delta": state[2], "beta": state[6]}.get(feature, state)
        if feature == "frenet_pose":
            x, y, heading = (seen[name][index] for name in ("poses_x", "poses_y", "poses_theta"))
            return np.array(env.track.cartesian_to_frenet(x, y, heading))
        if feature == "sim_time":
            return env.current_time
        if feature == "linear_vel_magnitude":
            return np.hypot(seen["linear_vels_x"][index], seen["linear_vels_y"][index])
        names = {
            "scan": "scans", "pose_x": "poses_x", "pose_y": "poses_y", "pose_theta": "poses_theta",
            "linear_vel_x": "linear_vels_x", "linear_vel_y": "linear_vels_y", "ang_vel_z": "ang_vels_z",
            "collision": "collisions", "lap_time": "lap_times", "lap_count": "lap_counts",
        }  # fmt: skip
        return seen[names[feature]][index]
