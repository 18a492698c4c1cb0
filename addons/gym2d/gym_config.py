"""The configuration objects of the later releases of f1tenth_gym, `EnvConfig` and its parts, and what `config` is.

Written afresh from their interface.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, is_dataclass, replace
from enum import Enum
from functools import partial
from typing import Any

from fg_mujoco.arguments import unknown_argument
from fg_mujoco.errors import ArgumentError, SettingsError
from fg_mujoco.messages import require_whole, shown

from .gym_world import BEAMS, RANGE_MAX, SCAN_NOISE
from .params import F1FIFTH, F1TENTH, FULL_SCALE, number
from .simulator import DynamicModel, Integrator

_EDGE = 0.75 * math.pi  # bearing of the LiDAR's last beam [rad]
_MOUNT = (0.275, 0.0, 0.0)  # of the LiDAR [m, m, rad]

SCAN_ERRORS = {"range_min": 0.0, "range_max": RANGE_MAX, "dropout_prob": 0.0, "range_bias_std": 0.0}
"""Settings of the LiDAR that `gym_world.ScanErrors` has, and their defaults."""
ACTUATION = {"steer_delay_steps": 0, "throttle_delay_steps": 0, "steer_noise_std": 0.0, "accl_noise_std": 0.0}
"""Settings of the way of an action to its car, see `new_api.Actuation`, and their defaults."""
RESETS = ("min_dist", "max_dist", "shuffle", "move_laterally", "reference_line", "start_width")
"""Settings of a reset besides its strategy."""
_DYNAMIC = ("pose_x", "pose_y", "delta", "linear_vel_magnitude", "pose_theta", "ang_vel_z", "beta")

LongitudinalActionType = Enum("LongitudinalActionType", {"SPEED": "speed", "ACCL": "accl"})
"""Longitudinal actions."""

SteerActionType = Enum("SteerActionType", {"STEERING_ANGLE": "steering_angle", "STEERING_SPEED": "steering_speed"})
"""Steering actions."""

ObservationType = Enum("ObservationType", {
    "DIRECT": "direct", "DEFAULT": "default", "ORIGINAL": "original", "FEATURES": "features",
    "KINEMATIC_STATE": "kinematic_state", "DYNAMIC_STATE": "dynamic_state",
    "FRENET_DYNAMIC_STATE": "frenet_dynamic_state",
})  # fmt: skip
"""Types of observations."""

ResetStrategy = Enum("ResetStrategy", {
    "RL_GRID_STATIC": "rl_grid_static", "RL_GRID_RANDOM": "rl_grid_random", "RL_RANDOM_STATIC": "rl_random_static",
    "RL_RANDOM_RANDOM": "rl_random_random", "CL_GRID_STATIC": "cl_grid_static", "CL_GRID_RANDOM": "cl_grid_random",
    "CL_RANDOM_STATIC": "cl_random_static", "CL_RANDOM_RANDOM": "cl_random_random",
    "MAP_RANDOM_STATIC": "map_random_static",
})  # fmt: skip
"""Places of cars at a reset."""

ReferenceLine = Enum("ReferenceLine", {"RACELINE": 1, "CENTERLINE": 2})
"""Lines on which cars are put at a reset."""

LoopCounterMode = Enum("LoopCounterMode", {"TOGGLE": 1, "FRENET_BASED": 2, "WINDING_ANGLE": 3})
"""Ways to count laps; here they are counted by progress from where the car starts, whatever is asked for."""

CollisionCheckMode = Enum("CollisionCheckMode", {
    "LIDAR_SCAN": 1, "BOUNDING_BOX": 2, "FRENET": 3, "SEGMENT_CONTACT": 4, "NONE": 5,
})  # fmt: skip
"""Ways to find collisions; here they are MuJoCo's contacts, whatever is asked for."""

AgentTerminationMode = Enum("AgentTerminationMode", {"EGO": 0, "ANY": 1, "ALL": 2})
"""Whose end is that of the environment."""

RewardMode = Enum("RewardMode", {"SURVIVAL": 0, "PROGRESS": 1, "CUSTOM": 2})
"""Rewards of a step."""


@dataclass(frozen=True)
class VehicleParameters:
    """The parameters of a car."""

    mu: float = F1TENTH["mu"]
    C_Sf: float = F1TENTH["C_Sf"]
    C_Sr: float = F1TENTH["C_Sr"]
    lf: float = F1TENTH["lf"]
    lr: float = F1TENTH["lr"]
    h: float = F1TENTH["h"]
    m: float = F1TENTH["m"]
    I: float = F1TENTH["I"]  # noqa: E741
    s_min: float = F1TENTH["s_min"]
    s_max: float = F1TENTH["s_max"]
    sv_min: float = F1TENTH["sv_min"]
    sv_max: float = F1TENTH["sv_max"]
    v_switch: float = F1TENTH["v_switch"]
    a_max: float = F1TENTH["a_max"]
    v_min: float = F1TENTH["v_min"]
    v_max: float = F1TENTH["v_max"]
    width: float = F1TENTH["width"]
    length: float = F1TENTH["length"]

    def with_updates(self, **changes: Any) -> VehicleParameters:
        """Return them with some changes."""
        return replace(self, **changes)


F1TENTH_VEHICLE_PARAMETERS = VehicleParameters()
F1FIFTH_VEHICLE_PARAMETERS = VehicleParameters(**F1FIFTH)
FULLSCALE_VEHICLE_PARAMETERS = VehicleParameters(**FULL_SCALE)


get_f1tenth_vehicle_parameters, get_f1fifth_vehicle_parameters, get_fullscale_vehicle_parameters = (
    partial(replace, params)
    for params in (F1TENTH_VEHICLE_PARAMETERS, F1FIFTH_VEHICLE_PARAMETERS, FULLSCALE_VEHICLE_PARAMETERS)
)


class Settings:
    """Settings by name, each with a default.

    Raises ArgumentError: none of these, SettingsError: one that has its default only.
    """

    defaults: Mapping[str, Any] = {}
    fixed: Mapping[str, Any] = {}  # that would change what is driven or seen, and cannot be had

    def __init__(self, **named: Any) -> None:
        parts, name = self.parts(), type(self).__name__
        vars(self).update({**self.defaults, **self.fixed})
        for part, kind in parts.items():
            setattr(self, part, kind())
        for given, value in named.items():
            setting = f"{given}_config" if f"{given}_config" in parts else given  # both are spelt in releases
            if setting not in vars(self):
                raise ArgumentError(unknown_argument(name, given, vars(self)))
            if setting in self.fixed and value != self.fixed[setting]:
                raise SettingsError(f"{name}.{given} is {shown(value)}; accepted: {self.fixed[setting]!r}")
            if setting in parts and not isinstance(value, parts[setting]):
                raise SettingsError(f"{name}.{given} is {shown(value)}; accepted: a {parts[setting].__name__}")
            setattr(self, setting, value)

    @classmethod
    def parts(cls) -> dict[str, type[Settings]]:
        """Return the settings of it that have settings of their own."""
        return {}

    def with_updates(self, **changes: Any) -> Any:
        """Return it with some changes."""
        return type(self)(**(vars(self) | changes))

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and vars(self) == vars(other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in vars(self).items())})"


class LiDARConfig(Settings):
    """The LiDAR of each car; SettingsError: a field of view beside an angle, or angles to one side."""

    defaults = {  # noqa: RUF012
        "num_beams": BEAMS, "angle_min": -_EDGE, "angle_max": _EDGE, "noise_std": SCAN_NOISE,
        "base_link_to_lidar_tf": _MOUNT, "scan_device": "cpu", **SCAN_ERRORS,
    }  # fmt: skip
    fixed = {"enabled": True}  # noqa: RUF012

    def __init__(self, *, field_of_view: Any = None, **named: Any) -> None:
        if field_of_view is not None:
            if {"angle_min", "angle_max"} & set(named):
                raise SettingsError("LiDARConfig has field_of_view and an angle; accepted: one of them")
            half = 0.5 * number("field_of_view", field_of_view)
            named |= {"angle_min": -half, "angle_max": half}
        super().__init__(**named)
        least, most = (number(name, getattr(self, name)) for name in ("angle_min", "angle_max"))
        if not math.isclose(-least, most, rel_tol=1e-6):
            raise SettingsError(f"the LiDAR measures from {least:g} to {most:g} rad; accepted: as far to both sides")

    def with_updates(self, **changes: Any) -> LiDARConfig:
        """Return it with some changes."""
        angles = ("angle_min", "angle_max") if "field_of_view" in changes else ()
        return LiDARConfig(**({name: value for name, value in vars(self).items() if name not in angles} | changes))

    @property
    def field_of_view(self) -> float:
        """From the first beam to the last [rad]."""
        own: Any = self
        return float(own.angle_max - own.angle_min)

    @property
    def angle_increment(self) -> float:
        """From a beam to the next [rad]."""
        return self.field_of_view / max(int(vars(self)["num_beams"]) - 1, 1)

    @classmethod
    def from_fov(cls, fov: float, **named: Any) -> LiDARConfig:
        """Return one of a field of view [rad]."""
        return cls(field_of_view=fov, **named)

    @property
    def ahead(self) -> float | None:
        """Of the rear axle [m]; None: as on the vehicle. SettingsError: one that is turned, or to a side."""
        x, *others = vars(self)["base_link_to_lidar_tf"]
        if any(others):
            accepted = "a distance ahead [m], 0.0, 0.0"
            raise SettingsError(f"base_link_to_lidar_tf is {shown((x, *others))}; accepted: {accepted}")
        return None if (x, *others) == _MOUNT else float(x)


class ControlConfig(Settings):
    """Meaning of actions."""

    defaults = {  # noqa: RUF012
        "longitudinal_mode": LongitudinalActionType.SPEED, "steering_mode": SteerActionType.STEERING_ANGLE,
        **ACTUATION,
    }  # fmt: skip
    fixed = {"steer_kp": None}  # noqa: RUF012


class SimulationConfig(Settings):
    """Settings of the simulation."""

    defaults = {  # noqa: RUF012
        "timestep": 0.01, "integrator_timestep": 0.01, "integrator": Integrator.RK4, "dynamics_model": DynamicModel.ST,
        "loop_counter": LoopCounterMode.FRENET_BASED, "compute_frenet_frame": True, "max_laps": 1,
        "count_partial_first_lap": True,
    }  # fmt: skip


class ObservationConfig(Settings):
    """Types of observations."""

    defaults = {"type": ObservationType.DEFAULT, "features": None}  # noqa: RUF012


class ResetConfig(Settings):
    """Places of cars at a reset; what is None is as the strategy has it."""

    defaults = {  # noqa: RUF012
        "strategy": ResetStrategy.RL_GRID_STATIC, "min_dist": None, "max_dist": None, "shuffle": None,
        "move_laterally": None, "reference_line": None, "start_width": None,
    }  # fmt: skip


class RenderConfig(Settings):
    """Settings of the window, which change nothing here: it is MuJoCo's viewer."""

    defaults = {"render_fps": 60, "real_time_factor": 1.0} | dict.fromkeys((
        "frame_output_method", "window_size", "focus_on", "vehicle_palette", "show_wheels", "render_map_img",
        "car_thickness", "bigger_car_when_map_centered", "show_lap_info",
    ))  # fmt: skip


class TerminationConfig(Settings):
    """Ends of an episode: after so many steps, by a collision, and of which car; SettingsError: another value."""

    defaults = {  # noqa: RUF012
        "max_episode_steps": None, "terminate_on_collision": True, "agent_mode": AgentTerminationMode.EGO,
    }  # fmt: skip

    def __init__(self, **named: Any) -> None:
        super().__init__(**named)
        own: Any = self
        require_whole("max_episode_steps", own.max_episode_steps, 1, optional=True)
        if not isinstance(own.agent_mode, AgentTerminationMode):
            modes = ", ".join(map(str, AgentTerminationMode))
            raise SettingsError(f"agent_mode is {shown(own.agent_mode)}; accepted: {modes}")


class RewardConfig(Settings):
    """Reward of a step: its duration, a weighted sum of metres, speed and duration, less collisions, or a function."""

    defaults = {  # noqa: RUF012
        "mode": RewardMode.SURVIVAL, "progress_weight": 1.0, "velocity_weight": 0.0, "timestep_weight": 0.0,
        "collision_penalty": 0.0, "reward_fn": None,
    }  # fmt: skip

    def __init__(self, **named: Any) -> None:
        super().__init__(**named)
        own: Any = self
        if not isinstance(own.mode, RewardMode):
            raise SettingsError(f"mode is {shown(own.mode)}; accepted: {', '.join(map(str, RewardMode))}")
        for name in ("progress_weight", "velocity_weight", "timestep_weight"):
            number(name, getattr(self, name))
        number("collision_penalty", own.collision_penalty, 0.0)
        if own.mode is RewardMode.CUSTOM and not callable(own.reward_fn):
            raise SettingsError(f"reward_fn is {shown(own.reward_fn)}; accepted: a function, with RewardMode.CUSTOM")


class DomainRandomizationConfig(Settings):
    """Ranges of what each episode draws, which are not here: `update_params` before a reset changes a car."""

    defaults = {"low": None, "high": None}  # noqa: RUF012
    fixed = {"enabled": False}  # noqa: RUF012


class ContactConfig(Settings):
    """Settings of contacts: there are none here, as these are MuJoCo's."""


class EnvConfig(Settings):
    """All settings of an environment; SettingsError: cars that go through walls."""

    defaults = {  # noqa: RUF012
        "seed": 12345, "map_name": "Spielberg", "map_scale": 1.0, "params": F1TENTH_VEHICLE_PARAMETERS,
        "num_agents": 1, "ego_index": 0, "collision_check": CollisionCheckMode.LIDAR_SCAN, "render_enabled": True,
    }  # fmt: skip

    @classmethod
    def parts(cls) -> dict[str, type[Settings]]:
        """Return the settings of it that have settings of their own."""
        return {
            "control_config": ControlConfig, "simulation_config": SimulationConfig,
            "observation_config": ObservationConfig, "reset_config": ResetConfig, "lidar_config": LiDARConfig,
            "render_config": RenderConfig, "termination_config": TerminationConfig, "reward_config": RewardConfig,
            "domain_randomization_config": DomainRandomizationConfig, "contact_config": ContactConfig,
        }  # fmt: skip

    def __init__(self, **named: Any) -> None:
        super().__init__(**named)
        if vars(self)["collision_check"] in (CollisionCheckMode.NONE, CollisionCheckMode.NONE.value):
            accepted = "another one; TerminationConfig(terminate_on_collision=False) drives on after a touch"
            raise SettingsError(f"collision_check is NONE, and walls are solid here; accepted: {accepted}")


def plain_params(params: Any) -> Any:
    """Return parameters of a car, VehicleParameters or others, by name."""
    return asdict(params) if is_dataclass(params) and not isinstance(params, type) else params


def plain_config(config: Any) -> dict[str, Any]:
    """Return the settings of a `config`, a dictionary or an EnvConfig, by the names of v1.0; else SettingsError."""
    if config is None:
        return {}
    if isinstance(config, Mapping):
        return dict(config) | ({"params": plain_params(config["params"])} if "params" in config else {})
    if not isinstance(config, EnvConfig):
        raise SettingsError(f"config is {config!r}; accepted: a dictionary of settings, or an EnvConfig")
    own: Any = config
    seen = own.observation_config
    features = _DYNAMIC if seen.type is ObservationType.DYNAMIC_STATE else seen.features
    simulation, control, lidar, reset = own.simulation_config, own.control_config, own.lidar_config, own.reset_config
    return {
        "seed": own.seed, "map": own.map_name, "scale": own.map_scale, "params": plain_params(own.params),
        "num_agents": own.num_agents, "ego_idx": own.ego_index, "timestep": simulation.timestep,
        "integrator": simulation.integrator, "model": simulation.dynamics_model, "max_laps": simulation.max_laps,
        "control_input": [getattr(m, "value", m) for m in (control.longitudinal_mode, control.steering_mode)],
        "observation_config": {"type": seen.type, "features": features},
        "reset_config": {"type": reset.strategy} | {name: getattr(reset, name) for name in RESETS},
        "num_beams": lidar.num_beams, "fov": lidar.field_of_view, "lidar_dist": lidar.ahead,
        "noise_std": lidar.noise_std, "enable_rendering": own.render_enabled,
        **{name: getattr(lidar, name) for name in SCAN_ERRORS}, **{name: getattr(control, name) for name in ACTUATION},
    }  # fmt: skip
