"""The environment of f1tenth_gym v1.0: Gymnasium's interface, five values a step, and a `config`.

Also as it was before, with Gymnasium under the name `f110_gym:f110-v0`. Written afresh from its documentation and its
interface.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike

from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.messages import FloatArray, shown
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.settings import FURTHEST
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import Vehicle

from .environment import RaceEnvironment, say_of_others, simulator_of
from .gym_config import (
    ACTUATION,
    RESETS,
    SCAN_ERRORS,
    AgentTerminationMode,
    EnvConfig,
    ReferenceLine,
    RewardMode,
    VehicleParameters,
    plain_config,
    plain_params,
)
from .gym_functions import deep_update
from .gym_observations import Observation
from .gym_track import Raceline
from .gym_world import BEAMS, FIELD_OF_VIEW
from .params import F1TENTH, mapping, number, whole
from .simulator import DynamicModel, Integrator, checked, say_of_model

_LONGITUDINAL, _STEERING = ("speed", "accl"), ("steering_angle", "steering_speed")
_BESIDES = {"speed": "steering_angle", "accl": "steering_speed", "steering_angle": "speed", "steering_speed": "accl"}
_NOT_HERE = ("integrator_timestep", "enable_scan", "control_delay_buffer_size", "compute_frenet",
             "render_fps", "normalize_obs", "normalize_act", "debug_frenet_projection")  # fmt: skip
_RESETS = [
    f"{line}_{where}_{order}"
    for line in ("rl", "cl", "map")
    for where in ("grid", "random")
    for order in ("static", "random")
]
_ROW = 1.0  # [m] of the line, from its start, in which the first car of a grid is put
_GAPS = (1.5, 2.5)  # [m] from a car to the next
_CHANGE = {"params", "control_input", "map", "scale", "max_laps", "reset_config"}  # what `configure` can


class CarAction:
    """Meaning of actions, steering first: `control_input` is one or two of _BESIDES; SettingsError: another name."""

    def __init__(self, control_input: Any, params: Mapping[str, Any]) -> None:
        names = [control_input] if isinstance(control_input, str) else control_input
        if not isinstance(names, (list, tuple)) or not all(isinstance(name, str) for name in names):
            accepted = f"one or two of {', '.join(_BESIDES)}"
            raise SettingsError(f"control_input is {shown(control_input)}; accepted: {accepted}")
        names = list(names)
        if len(names) == 1 and names[0] in _BESIDES:
            names.append(_BESIDES[names[0]])
        for name in names:
            if name not in _BESIDES:
                raise SettingsError(f"control_input is {name!r}; {accepted_names(name, _BESIDES)}")
        self.longitudinal = next((name for name in names if name in _LONGITUDINAL), "speed")
        self.steering = next((name for name in names if name in _STEERING), "steering_angle")
        limits = F1TENTH | mapping("params", params)
        self.limits = {
            "steering_angle": (limits["s_min"], limits["s_max"]),
            "steering_speed": (limits["sv_min"], limits["sv_max"]),
            "speed": (limits["v_min"], limits["v_max"]), "accl": (-limits["a_max"], limits["a_max"]),
        }  # fmt: skip

    @property
    def type(self) -> tuple[str, str]:
        """The steering action and the longitudinal action."""
        return self.steering, self.longitudinal

    @property
    def space(self) -> Any:
        """The space of one car's action."""
        return self.space_of(None)

    def space_of(self, agents: int | None) -> Any:
        """Return the space of so many cars' actions."""
        bounds = np.array([self.limits[self.steering], self.limits[self.longitudinal]], np.float32).T
        low, high = bounds if agents is None else np.repeat(bounds[:, None], agents, axis=1)
        return spaces.Box(low=low, high=high, shape=low.shape, dtype=np.float32)


class Actuation:
    """The way of actions to their cars: noise first, then a delay of whole steps, in which a car first gets zeros."""

    def __init__(self, settings: Mapping[str, Any], agents: int) -> None:
        self._agents = agents
        self._delays = [whole(name, settings[name], 0, 1000) for name in ("steer_delay_steps", "throttle_delay_steps")]
        self._stds = [number(name, settings[name], 0.0, 100.0) for name in ("steer_noise_std", "accl_noise_std")]
        self._waiting: list[deque[FloatArray]] = []

    def reset(self, generator: np.random.Generator) -> None:
        """Begin an episode; the seed of the noise is drawn, where there is any."""
        self._waiting = [deque([np.zeros(self._agents)] * delay) for delay in self._delays]
        self._rng = np.random.default_rng(generator.integers(2**63) if any(self._stds) else 0)

    def __call__(self, action: ArrayLike) -> ArrayLike:
        """Return what reaches the cars in a step, of what they are sent. Shapes (agents, 2)."""
        if not any((*self._delays, *self._stds)):
            return action
        taken = np.array(checked(action, self._agents, 2, "action", "steering, longitudinal"))
        for column, (std, waiting) in enumerate(zip(self._stds, self._waiting, strict=True)):
            waiting.append(taken[:, column] + (self._rng.normal(0.0, std, self._agents) if std > 0.0 else 0.0))
            taken[:, column] = waiting.popleft()
        return taken


class F110Env(RaceEnvironment, gymnasium.Env[Any, Any]):
    """Some cars on a map, two by default, by the interface of f1tenth_gym v1.0.

    `config` are settings over `default_config`, each a keyword, too, or an EnvConfig of the later releases.
    `render_mode` is human, human_fast, rgb_array, or None, with which `render` does nothing. Not in the gym are
    vehicle, tires, setup and maps, as of the environment of v0.2. Raises SettingsError: a setting out of its range;
    TrackError: a map that cannot be read.
    """

    metadata = {"render_modes": ["human", "human_fast", "unlimited", "rgb_array"], "render_fps": 100}  # noqa: RUF012

    def __init__(
        self,
        config: Any = None,
        render_mode: str | None = None,
        *,
        vehicle: Vehicle | str | Path | None = None,
        tires: Tires | str | Path | None = None,
        setup: Setup | None = None,
        maps: str | Path | None = None,
        **settings: Any,
    ) -> None:
        given = deep_update(plain_config(config), settings)
        self._times_each_lap = isinstance(config, EnvConfig)
        self._take_later(config if isinstance(config, EnvConfig) else EnvConfig())
        defaults = self.default_config()
        say_of_others(name for name in given if name not in defaults and name not in _NOT_HERE)
        self.config: dict[str, Any] = deep_update(defaults, given)
        setting = self.config
        self.render_mode = (render_mode or setting.get("render_mode")) if setting["enable_rendering"] else None
        if setting["seed"] is None:
            setting["seed"] = int(np.random.SeedSequence().generate_state(1)[0])
        if setting["max_laps"] is not None:
            number("max_laps", setting["max_laps"])
        integrator, model = setting["integrator"], setting["model"]
        model = DynamicModel.of(model)
        say_of_model(model)
        self.observation_config = mapping("observation_config", setting["observation_config"])
        sim = simulator_of(
            params=given.get("params"), num_agents=setting["num_agents"], seed=setting["seed"],
            integrator=Integrator.from_string(integrator) if isinstance(integrator, str) else integrator, model=model,
            time_step=setting["timestep"], ego_idx=setting["ego_idx"], lidar_dist=setting["lidar_dist"],
            num_beams=setting["num_beams"], fov=setting["fov"], noise_std=setting["noise_std"],
            errors={name: setting[name] for name in SCAN_ERRORS}, vehicle=vehicle, tires=tires, setup=setup, maps=maps,
        )  # fmt: skip
        extension = setting["map_ext"]
        if extension is None or (isinstance(extension, str) and not extension):
            extension = number("scale", setting["scale"], 0.01, 100.0)
        self._begin(sim, setting["map"], extension)
        self.map = setting["map"]
        self.agent_ids = [f"agent_{agent}" for agent in range(self.num_agents)]
        self._take_actions()
        self.observation_type = Observation(self, **self.observation_config)
        self.observation_space = self.observation_type.space()
        self.metadata = {**type(self).metadata, "render_fps": round(1.0 / self.timestep)}
        self.renderer = self._make_renderer()
        self._steering, self._steps, self._along = np.zeros(self.num_agents), 0, np.zeros(self.num_agents)
        self.terminated_agents = np.zeros(self.num_agents, np.bool_)
        # the gym draws places by NumPy's own generator, which nobody seeds, and has the seed for the noise alone
        own_seed = None if self.seed == self.default_config()["seed"] else self.seed
        self._generator = np.random.default_rng(own_seed)
        self._actuation = Actuation(setting, self.num_agents)

    @classmethod
    def default_config(cls) -> dict[str, Any]:
        """Return all settings with their defaults."""
        return {
            "seed": 12345, "map": "Spielberg", "map_ext": None, "scale": 1.0, "params": dict(F1TENTH),
            "num_agents": 2, "timestep": 0.01, "ego_idx": 0, "integrator": "rk4", "model": "st",
            "control_input": ["speed", "steering_angle"], "observation_config": {"type": None},
            "reset_config": {"type": None}, "num_beams": BEAMS, "fov": FIELD_OF_VIEW, "lidar_dist": None,
            "noise_std": None, "max_laps": 2, "enable_rendering": True, **SCAN_ERRORS, **ACTUATION,
        }  # fmt: skip

    @property
    def sim_time(self) -> float:
        """Simulated since the reset [s]."""
        return self.current_time

    @property
    def vehicle_params(self) -> VehicleParameters:
        """The parameters of the cars, as the later releases have them."""
        return VehicleParameters(**{each.name: self.params[each.name] for each in fields(VehicleParameters)})

    def configure(self, config: Any) -> None:
        """Take other settings from the next reset on; SettingsError: one that a new environment can have only."""
        given, known = plain_config(config), self.config
        changed = {name for name, value in given.items() if name not in known or not _same(value, known[name])}
        if changed - _CHANGE:
            said = f"configure changes {', '.join(sorted(changed - _CHANGE))}"
            raise SettingsError(f"{said}; accepted: {', '.join(sorted(_CHANGE))}; a new environment has any")
        self.config = deep_update(known, given)
        if isinstance(config, EnvConfig):
            self._take_later(config)
        if "params" in changed:
            self.update_params(self.config["params"])
        if changed & {"map", "scale"}:
            self.update_map(self.config["map"], self.config["scale"])
        self._take_actions()
        self._note_call("configure", config, of=len(self._calls_since))

    def update_params(self, params: Any, index: int = -1) -> None:
        """Take other parameters from the next reset on, by name or as VehicleParameters; see RaceEnvironment."""
        super().update_params(plain_params(params), index)

    def update_map(self, map_name: Any, map_ext: str | float | None = None) -> None:
        """Drive on another map from the next reset on."""
        self.map = self.map_name = map_name
        self._set_map(map_name, map_ext)
        self._note_call("update_map", map_name, map_ext)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None, **_: Any
    ) -> tuple[Any, dict[str, Any]]:
        """Place the cars, let them stand for one step, and return an observation and the info of `step`.

        `seed` is of the places that are drawn; None: they go on as drawn so far. Without any seed, or with the config's
        default one, each environment draws others. `options` may have `poses` of the rear axles (num_agents, 3), x [m],
        y [m], heading [rad], or `states` (num_agents, 7), as `sim.agents` have them; else poses are drawn as
        `reset_config` says. Raises SettingsError: poses or states of another shape, or another option.
        """
        super().reset(seed=seed)
        if seed is not None:
            self._generator = np.random.default_rng(seed)
        said = {} if options is None else mapping("options", options)
        for name in said.keys() - {"poses", "states"}:
            raise SettingsError(f"options has {name!r}; {accepted_names(name, ('poses', 'states'))}")
        states = np.zeros((self.num_agents, 7))
        if said.get("states") is not None:
            meaning = "x, y, steering angle, speed, heading, yaw rate, slip angle"
            states = np.array(checked(said["states"], self.num_agents, 7, "states", meaning, most=FURTHEST))
            self._place(states[:, [0, 1, 4]])
            for agent, state in zip(self.sim.agents, states, strict=True):
                agent.state = state
        else:
            poses = said.get("poses")
            self._place(self._drawn_poses() if poses is None else poses)
        self._actuation.reset(self._generator)
        self._steering, self._steps = states[:, 2].copy(), -1  # the step that the cars stand is not counted
        self._along, self.terminated_agents = np.zeros(self.num_agents), np.zeros(self.num_agents, np.bool_)
        kinds = [name in ("steering_angle", "speed") for name in self.action_type.type]
        first = self.step(states[:, 2:4] * kinds)
        return first[0], first[4]

    def step(self, action: ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Hold steering and speed of each car (num_agents, 2), as `control_input` says, within limits, for a timestep.

        Returns the observation, the reward, which is the timestep [s], whether the ego has collided or all cars, with
        an EnvConfig those that its TerminationConfig says, have driven `max_laps`, whether it is truncated, which it is
        by `max_episode_steps` only, and an info: `checkpoint_done`, whether each car has, `lap_times`, `lap_counts` and
        `sim_time`; with an EnvConfig `terminated_agents`, and `collisions` and `progress` [m] of the step. Raises
        SettingsError: another shape, or a number that is not finite.
        """
        self.sim.write_back()  # before accelerations become speeds
        self._advance(self._commands(action if self._steps < 0 else self._actuation(action)))
        done, finished = self._check_done()
        info = {
            "checkpoint_done": finished, "lap_times": self.lap_times, "lap_counts": self.lap_counts,
            "sim_time": self.current_time,
        }  # fmt: skip
        observation, self._steps = self.observation_type.observe(), self._steps + 1
        if not self._times_each_lap:
            return observation, self.timestep, done, False, info
        along, self._along = self._along, np.array([lap.along for lap in self.driving.laps])
        info |= {"collisions": self.collisions.copy(), "progress": self._along - along}
        info["terminated_agents"] = self.terminated_agents.copy()
        most = self._ends.max_episode_steps
        late = most is not None and self._steps >= most and not done
        return observation, self._reward(observation, action, info, done, late), done, late, info

    def _reward(self, observation: Any, action: ArrayLike, info: dict[str, Any], done: bool, late: bool) -> float:
        """Return the reward of a step as the RewardConfig says."""
        of, ego = self._rewards, self.ego_idx
        if of.mode is RewardMode.SURVIVAL or self._steps == 0:  # at a reset nobody asks for it
            return self.timestep
        if of.mode is RewardMode.CUSTOM:
            return float(of.reward_fn(observation, action, info, done, late))
        gained = of.progress_weight * info["progress"][ego] + of.velocity_weight * self.driving.state(ego)[3]
        return float(gained + of.timestep_weight * self.timestep - of.collision_penalty * self.collisions[ego])

    def render(self, mode: str | None = None) -> Any:
        """Show the world as `render_mode` says: in MuJoCo's viewer, or as a picture (480, 640, 3); see View."""
        mode = mode or self.render_mode
        return None if mode is None else self._draw(mode)

    def _check_done(self) -> tuple[bool, Any]:
        most = self.config["max_laps"]
        _, finished = super()._check_done()
        finished = np.zeros_like(finished) if most is None else self.lap_counts >= number("max_laps", most)
        if not self._times_each_lap:
            return bool(self.collisions[self.ego_idx]) or bool(finished.all()), finished
        collided = (self.collisions > 0.0) & self._ends.terminate_on_collision
        self.terminated_agents = self.terminated_agents | finished | collided
        over = {
            AgentTerminationMode.EGO: self.terminated_agents[self.ego_idx],
            AgentTerminationMode.ANY: self.terminated_agents.any(),
            AgentTerminationMode.ALL: self.terminated_agents.all(),
        }  # fmt: skip
        return bool(over[self._ends.agent_mode]), finished

    def _take_later(self, config: Any) -> None:
        """Take what an EnvConfig has and the settings of v1.0 have not."""
        self.env_config, self._ends, self._rewards = config, config.termination_config, config.reward_config

    def _take_actions(self) -> None:
        self.action_type = CarAction(self.config["control_input"], self.config["params"])
        self.action_space = self.action_type.space_of(self.num_agents)

    def _commands(self, action: ArrayLike) -> ArrayLike:
        """Return steering angles and speeds that an action asks for."""
        kind = self.action_type
        if kind.type == ("steering_angle", "speed"):
            return action
        commands = np.array(checked(action, self.num_agents, 2, "action", f"{kind.steering} and {kind.longitudinal}"))
        if kind.steering == "steering_speed":
            low, high = kind.limits["steering_angle"]
            turned = self._steering + np.clip(commands[:, 0], *kind.limits["steering_speed"]) * self.timestep
            commands[:, 0] = self._steering = np.clip(turned, low, high)
        if kind.longitudinal == "accl":
            for agent in range(self.num_agents):
                wanted = float(np.clip(commands[agent, 1], *kind.limits["accl"]))
                commands[agent, 1] = self.driving.speed_for(agent, wanted)
        return commands

    def _drawn_poses(self) -> FloatArray:
        """Return poses drawn as `reset_config` says."""
        asked = mapping("reset_config", self.config["reset_config"])
        for name in asked.keys() - {"type", *RESETS}:
            raise SettingsError(f"reset_config has {name!r}; {accepted_names(name, ('type', *RESETS))}")
        kind = asked.get("type")
        kind = str(getattr(kind, "value", kind) or "rl_grid_static").lower()
        if kind not in _RESETS:
            raise SettingsError(f"reset_config has type {kind!r}; {accepted_names(kind, _RESETS)}")
        token, where, order = kind.split("_")
        if not (self.driving.world.track.closed or self.track.has_lines):
            return self._grid()
        wanted = asked.get("reference_line") or (ReferenceLine.RACELINE if token == "rl" else ReferenceLine.CENTERLINE)
        if not isinstance(wanted, ReferenceLine):
            raise SettingsError(f"reference_line is {shown(wanted)}; accepted: {', '.join(map(str, ReferenceLine))}")
        line = self.track.raceline if wanted is ReferenceLine.RACELINE else self.track.centerline
        row = math.inf if where == "random" or token == "map" else _given(asked, "start_width", _ROW)
        gaps = _given(asked, "min_dist", _GAPS[0]), _given(asked, "max_dist", _GAPS[1])
        if gaps[0] > gaps[1]:
            raise SettingsError(f"cars stand {gaps[0]:g} to {gaps[1]:g} m apart; accepted: min_dist, then max_dist")
        poses = self._poses_on(line, row, gaps, aside=asked.get("move_laterally") is not False)
        shuffled = order == "random" if asked.get("shuffle") is None else asked["shuffle"]
        return self._generator.permutation(poses) if shuffled else poses

    def _poses_on(self, line: Raceline, row: float, gaps: tuple[float, float], *, aside: bool) -> FloatArray:
        """Return poses on a line, one behind the other, the first in a row at its start."""
        draw, spline = self._generator, line.spline
        length = float(spline.s[-1])
        s = draw.uniform(0.0, min(row, length))
        poses = np.empty((self.num_agents, 3))
        side = float(draw.choice([-1.0, 1.0])) if self.num_agents > 1 else 0.0
        width = 0.5 * float(min(1.0, self._room(line))) * aside
        for agent in range(self.num_agents):
            (x, y), heading = spline.calc_position(s % length), spline.calc_yaw(s % length)
            offset = side * (-1.0) ** agent * width / self.num_agents
            poses[agent] = (x - offset * math.sin(heading), y + offset * math.cos(heading), heading)
            s += draw.uniform(*gaps)
        return poses

    def _room(self, line: Raceline) -> float:
        """Return the greatest distance to the side of a line at which a car can be put [m]: none off the centreline."""
        track = self.driving.world.track
        widths = getattr(track, "width_left", None)
        if line is not self.track.centerline or widths is None:
            return 0.0
        return max(0.0, float(np.minimum(widths, track.width_right).min()) - 0.4)  # type: ignore[attr-defined]


def _given(settings: Mapping[str, Any], name: str, otherwise: float) -> float:
    """Return a setting from 0 on, or another number where it is None."""
    return otherwise if settings.get(name) is None else number(name, settings[name], 0.0)


def _same(value: Any, known: Any) -> bool:
    """Return whether two settings are the same; of one with parts those that are named."""
    if isinstance(value, Mapping) and isinstance(known, Mapping):
        return all(name in known and _same(each, known[name]) for name, each in value.items())
    return value is known or bool(np.all(value == known))
