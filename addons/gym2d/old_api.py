"""The environment of f1tenth_gym v0.2, which is `f110-gym` on PyPI: gym's old interface, four values a step.

Written afresh from its documentation and its interface.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fg_mujoco.racing.setup import Setup
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import Vehicle

from .environment import RaceEnvironment, say_of_others, simulator_of
from .gym_world import BEAMS, FIELD_OF_VIEW
from .old_gym import base_of_gym
from .simulator import DynamicModel, Integrator, say_of_model


class F110Env(RaceEnvironment, base_of_gym()):  # type: ignore[misc]
    """Some cars on a map, one on the oval by default, by the interface of f1tenth_gym v0.2.

    `map` is the path of a map_server YAML with or without `.yaml`, the name of a track in the folder `maps`, by default
    FG_MUJOCO_MAPS, or whatever `load_track` takes, as `oval` or `random:7`; `map_ext` is of its image, as `.png`, None
    that of the YAML. `params` are the car's physical parameters by the gym's names, built into the model; what is not
    is named in a warning. There are 1 to 8 cars; the collision of `ego_idx` ends an episode. `timestep` [s] is of a
    step, `seed` of the scans' noise, `lidar_dist` [m] ahead of the rear axle (None: .275 m, as on the car), `fov` [rad]
    of a scan. `integrator`, `model` and `render_mode` are kept as attributes. Not in the gym are `vehicle`, a bundled
    name, an MJCF file or a Vehicle, `tires`, a bundled set, a TOML file or Tires (None: the vehicle's), or `setup`, a
    Setup that says both.
    Raises SettingsError: no such number of cars, no such ego; a timestep that is not positive; TrackError: a map that
    cannot be read.
    """

    metadata = {"render.modes": ["human", "human_fast"], "render_modes": ["human", "human_fast", "rgb_array"]}  # noqa: RUF012

    def __init__(
        self,
        *,
        map: str = "oval",
        map_ext: str | None = None,
        params: dict[str, float] | None = None,
        num_agents: int = 1,
        timestep: float = 0.01,
        ego_idx: int = 0,
        seed: int = 12345,
        integrator: Any = Integrator.RK4,
        model: Any = DynamicModel.ST,
        lidar_dist: float | None = None,
        num_beams: int = BEAMS,
        fov: float = FIELD_OF_VIEW,
        vehicle: Vehicle | str | Path | None = None,
        tires: Tires | str | Path | None = None,
        setup: Setup | None = None,
        maps: str | Path | None = None,
        render_mode: str | None = None,
        **others: Any,
    ) -> None:
        self.render_mode = render_mode
        self.lidar_dist = 0.0 if lidar_dist is None else lidar_dist
        model = DynamicModel.of(model)
        say_of_model(model)
        say_of_others(others)
        sim = simulator_of(
            params=params, num_agents=num_agents, seed=seed, integrator=integrator, model=model, time_step=timestep,
            ego_idx=ego_idx, lidar_dist=lidar_dist, num_beams=num_beams, fov=fov, vehicle=vehicle, tires=tires,
            setup=setup, maps=maps,
        )  # fmt: skip
        self._begin(sim, map, map_ext)

    @property
    def unwrapped(self) -> F110Env:
        """Itself."""
        return self

    def update_map(self, map_path: str, map_ext: str | None = None) -> None:
        """Drive on another map from the next reset on; arguments as `map` and `map_ext`."""
        self.map_name, self.map_ext = map_path, map_ext or ".png"
        self._set_map(map_path, map_ext)
        self._note_call("update_map", map_path, map_ext)

    def reset(self, poses: ArrayLike | None = None, **_: Any) -> tuple[dict[str, Any], float, bool, dict[str, Any]]:
        """Place the cars at poses of the rear axles (num_agents, 3), x [m], y [m], heading [rad]; return as `step`.

        They stand for a step; None is the course's start. Raises SettingsError: another shape, or no finite number.
        """
        self._place(self._grid() if poses is None else poses)
        return self.step(np.zeros((self.num_agents, 2)))

    def step(self, action: ArrayLike) -> tuple[dict[str, Any], float, bool, dict[str, Any]]:
        """Hold steering angle [rad] and speed [m/s] of each car (num_agents, 2), within its limits, for a timestep.

        Returns the observation, the reward, which is the timestep [s], whether the ego has collided or all cars have
        driven two laps, and `checkpoint_done`, whether each car has. Raises SettingsError: another shape, or a number
        that is not finite.
        """
        observation = self._advance(action)
        self.current_obs = observation
        done, finished = self._check_done()
        return observation, self.timestep, done, {"checkpoint_done": finished}

    def render(self, mode: str = "human", **_: Any) -> Any:
        """Show the world: "human", "human_fast" in MuJoCo's viewer, "rgb_array" as a picture (480, 640, 3)."""
        return self._draw(mode)


class GymEnv(F110Env):
    """The same with the gym's own defaults: two cars on the map vegas. Scripts have it from `f110_gym`."""

    def __init__(self, **settings: Any) -> None:
        own: dict[str, Any] = {"map": "vegas", "num_agents": 2}
        super().__init__(**(own | settings))
