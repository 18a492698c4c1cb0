"""Base of the environments of both interfaces: a Simulator, its laps, its window, and attributes for scripts."""

from __future__ import annotations

import os
import traceback
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from fg_mujoco.arguments import Remade
from fg_mujoco.display import brief
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import FloatArray
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.planner_failure import one_line
from fg_mujoco.simulation.world import World
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import DEFAULT_VEHICLE, Vehicle

from .drawing import EnvRenderer, View, require_mode
from .gym_track import Track
from .gym_world import LAPS, Driving
from .params import F1FIFTH, F1TENTH, FULL_SCALE
from .simulator import Simulator

VEHICLE, TIRES = "FG_MUJOCO_VEHICLE", "FG_MUJOCO_TIRES"
"""Environment variables: the vehicle and the tires of environments that are not given any."""


class RaceEnvironment(Remade):
    """Cars on a map, driven by either interface of f1tenth_gym. A copy is a new one, to be reset.

    Attributes have the gym's names. `lap_times` (num_agents,) [s] run since the start, until the second lap is driven;
    with an EnvConfig they are of the lap that was driven last, and 0 before.
    """

    renderer: Any = None
    current_obs: Any = None
    _warned = False
    _times_each_lap = False

    def _begin(self, sim: Simulator, map: Any, map_ext: str | float | None) -> None:
        """Take a simulator, and put its cars on a map."""
        self.sim = sim
        self.params, self.num_agents, self.ego_idx = sim.params, sim.num_agents, sim.ego_idx
        self.timestep, self.seed, self.integrator, self.model = sim.time_step, sim.seed, sim.integrator, sim.model
        self.map_name = map if isinstance(map, str) else getattr(getattr(map, "spec", None), "name", "map")
        self.map_ext = map_ext if isinstance(map_ext, str) else ".png"
        self.start_thresh = 0.5
        self.render_callbacks: list[Callable[[Any], Any]] = []
        self._failing: list[Callable[[Any], Any]] = []  # of them, that was said of
        self.render_obs: dict[str, Any] | None = None
        self._view: View | None = None
        count = self.num_agents
        self.poses_x: Any = []
        self.poses_y: Any = []
        self.poses_theta: Any = []
        self.start_xs, self.start_ys, self.start_thetas = np.zeros((3, count))
        self.start_rot: FloatArray = np.eye(2)
        self._clear()
        self._set_map(map, map_ext)

    def __repr__(self) -> str:
        return brief(self, repr(self.sim))

    def __str__(self) -> str:
        return repr(self)

    @property
    def driving(self) -> Driving:
        """The world that is driven in, with its engine."""
        assert self.sim.driving is not None
        return self.sim.driving

    @property
    def num_beams(self) -> int:
        """Beams of a scan."""
        return self.sim.num_beams

    @property
    def toggle_list(self) -> FloatArray:
        """Number of times each car has left or come back to its start, as the gym counts, (num_agents,)."""
        return 2.0 * self.lap_counts

    @property
    def world(self) -> World:
        """The World; its LiDARs have the gym's beams."""
        return self.driving.world

    @property
    def data(self) -> mujoco.MjData:
        """The world's mujoco.MjData at the present state, which is written when it is asked for: one object."""
        return self.driving.data

    @property
    def track(self) -> Track:
        """The map with its lines."""
        return self.sim.track

    @staticmethod
    def f1tenth_vehicle_params() -> dict[str, float]:
        """Return the parameters of the gym's car of 1:10."""
        return dict(F1TENTH)

    @staticmethod
    def f1fifth_vehicle_params() -> dict[str, float]:
        """Return those of its car of 1:5."""
        return dict(F1FIFTH)

    @staticmethod
    def fullscale_vehicle_params() -> dict[str, float]:
        """Return those of its car of full size, without those of its multi-body model."""
        return dict(FULL_SCALE)

    def update_params(self, params: dict[str, Any], index: int = -1) -> None:
        """Take other parameters from the next reset on, of car `index` or, with -1, of all; or SettingsError."""
        self._close_view()
        self.sim.update_params(params, index)
        self.params = self.sim.params
        self._note_call("update_params", params, index, of=index)

    def add_render_callback(self, callback_func: Callable[[Any], Any]) -> None:
        """Take a callback that draws: it is called at each `render` with a stub of the gym's window."""
        self.render_callbacks.append(callback_func)
        self._note_call("add_render_callback", callback_func, of=len(self.render_callbacks))

    def close(self) -> None:
        """Close the window, if there is one."""
        self._close_view()

    def _set_map(self, map: Any, map_ext: str | float | None) -> None:
        self._close_view()
        self.sim.set_map(map, map_ext)
        file = self.sim.map_file
        self.map_path = str(file) if file is not None else self.map_name

    def _clear(self) -> None:
        """Set the counters back."""
        count = self.num_agents
        self.current_time, self.num_toggles, self.near_start = 0.0, 0, True
        self.collisions, self.near_starts = np.zeros(count), np.ones(count, np.bool_)
        self.lap_times, self.lap_counts = np.zeros((2, count))

    def _place(self, poses: ArrayLike) -> None:
        """Place the cars, and remember where."""
        self.sim.reset(poses)
        self._clear()
        placed = np.asarray(poses, np.float64)
        self.start_xs, self.start_ys, self.start_thetas = placed.T
        cos, sin = np.cos(placed[self.ego_idx, 2]), np.sin(placed[self.ego_idx, 2])
        self.start_rot = np.array([[cos, sin], [-sin, cos]])

    def _advance(self, action: ArrayLike) -> dict[str, Any]:
        """Drive a step, count laps, and return an observation of v0.2."""
        observation = self.sim.step(action)
        self.current_time += self.timestep
        laps = self.driving.laps
        self.lap_times = np.array([lap.last if self._times_each_lap else lap.time for lap in laps])
        self.lap_counts = np.array([float(lap.completed) for lap in laps])
        observation["lap_times"], observation["lap_counts"] = self.lap_times, self.lap_counts
        self.render_obs = observation
        self._update_state(observation)
        return observation

    def _update_state(self, observation: dict[str, Any]) -> None:
        self.poses_x, self.poses_y = observation["poses_x"], observation["poses_y"]
        self.poses_theta, self.collisions = observation["poses_theta"], observation["collisions"]

    def _check_done(self) -> tuple[bool, Any]:
        """Return whether the ego has collided or all cars have driven two laps, and which cars have."""
        finished = self.lap_counts >= LAPS
        return bool(self.collisions[self.ego_idx]) or bool(finished.all()), finished

    def _grid(self) -> FloatArray:
        """Return poses at the start of the course, the ego first, the others 1.5 m behind each other."""
        track, ego = self.driving.world.track, self.ego_idx
        order = [ego, *(agent for agent in range(self.num_agents) if agent != ego)]
        poses = np.zeros((self.num_agents, 3))
        for place, agent in enumerate(order):
            poses[agent] = track.start_pose(-1.5 * place, 0.0)
        return poses

    def _draw(self, mode: str) -> Any:
        """Call the callbacks, and show the world."""
        require_mode(mode)
        if "renderer" not in vars(self):
            self.renderer = RaceEnvironment.renderer = self._make_renderer()  # of the class, too, as v0.2 has it
        if self.render_obs is not None:
            self.renderer.update_obs(self.render_obs)
        for callback in (*self.render_callbacks, *self.renderer.callbacks):
            try:
                callback(self.renderer)
            except Exception as error:  # nothing that it draws is shown anyway
                self._tell_of_callback(callback, error)
        if self._view is None:
            self._view = View(self.driving, warned=self._warned)
        if mode == "rgb_array":
            return self._view.picture(self.ego_idx)
        self._view.show(paced=mode == "human")
        return None

    def _tell_of_callback(self, callback: Callable[[Any], Any], error: Exception) -> None:
        """Say once of a callback that it fails, and where."""
        if callback in self._failing:
            return
        self._failing.append(callback)
        where = traceback.extract_tb(error.__traceback__)[:2][-1]  # in the callback, if it is a function of Python
        name = getattr(callback, "__name__", type(callback).__name__)
        warnings.warn(
            f"the render callback {name!r} fails at {where.filename}:{where.lineno}: {one_line(error)}; the run goes "
            "on, and nothing that callbacks draw is shown here",
            stacklevel=4,
        )

    def _make_renderer(self) -> EnvRenderer:
        ids = [f"agent_{agent}" for agent in range(self.num_agents)]
        return EnvRenderer(params=self.params, agent_ids=ids, env=self)

    def _close_view(self) -> None:
        view = getattr(self, "_view", None)
        if view is not None:
            self._warned = view.warned
            view.close()
            self._view = None


def simulator_of(
    *,
    setup: Setup | None,
    vehicle: Vehicle | str | Path | None,
    tires: Tires | str | Path | None,
    **settings: Any,
) -> Simulator:
    """Return the Simulator of an environment; vehicle and tires that are None are those of the environment variables.

    Raises SettingsError: as of Simulator; a setup that says more than which car drives, or besides vehicle and tires.
    """
    if setup is not None:
        setup.require_usable("an environment of f1tenth_gym", "vehicle", "tires", alone=True)
        if vehicle is not None or tires is not None:
            raise SettingsError("setup and vehicle or tires are both given; accepted: one of them")
        vehicle, tires = setup.first.vehicle, setup.first.tires
    return Simulator(
        vehicle=(os.environ.get(VEHICLE) or DEFAULT_VEHICLE) if vehicle is None else vehicle,
        tires=(os.environ.get(TIRES) or None) if tires is None else tires,
        **settings,
    )  # fmt: skip


def say_of_others(names: Iterable[str]) -> None:
    """Warn of settings that are not here."""
    said = ", ".join(map(str, names))
    if said:
        warnings.warn(f"settings that are not here: {said}; the others are", stacklevel=3)
