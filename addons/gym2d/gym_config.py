"""The configuration objects of the later releases of f1tenth_gym, `EnvConfig` and its parts, and what `config` is.

    env = gym.make("f1tenth_gym:f1tenth-v0", config=EnvConfig(map_name="Spielberg", num_agents=1))

Written afresh from their interface.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, is_dataclass, replace
from enum import Enum
from typing import Any

from fg_mujoco.arguments import unknown_argument
from fg_mujoco.errors import ArgumentError, SettingsError
from fg_mujoco.messages import require_whole, shown

from .gym_world import BEAMS, FIELD_OF_VIEW
from .params import F1FIFTH, F1TENTH, FULL_SCALE, number
from .simulator import DynamicModel, Integrator

_MOUNT = (0.275, 0.0, 0.0)  # of the LiDAR [m, m, rad]


class LongitudinalActionType(Enum):
    """Longitudinal actions."""

    SPEED = "speed"
    ACCL = "accl"


class SteerActionType(Enum):
    """Steering actions."""

    STEERING_ANGLE = "steering_angle"
    STEERING_SPEED = "steering_speed"


class ObservationType(Enum):
    """Types of observations."""

    DIRECT = "direct"
    DEFAULT = "default"
    ORIGINAL = "original"
    FEATURES = "features"
    KINEMATIC_STATE = "kinematic_state"
    DYNAMIC_STATE = "dynamic_state"
    FRENET_DYNAMIC_STATE = "frenet_dynamic_state"


class ResetStrategy(Enum):
    """Places of cars at a reset."""

    RL_GRID_STATIC = "rl_grid_static"
    RL_GRID_RANDOM = "rl_grid_random"
    RL_RANDOM_STATIC = "rl_random_static"
    RL_RANDOM_RANDOM = "rl_random_random"
    CL_GRID_STATIC = "cl_grid_static"
    CL_GRID_RANDOM = "cl_grid_random"
    CL_RANDOM_STATIC = "cl_random_static"
    CL_RANDOM_RANDOM = "cl_random_random"
    MAP_RANDOM_STATIC = "map_random_static"


class LoopCounterMode(Enum):
    """Ways to count laps; here they are counted by progress, whatever is asked for."""

    TOGGLE = 1
    FRENET_BASED = 2
    WINDING_ANGLE = 3


class CollisionCheckMode(Enum):
    """Ways to find collisions; here they are MuJoCo's contacts, whatever is asked for."""

    LIDAR_SCAN = 1
    BOUNDING_BOX = 2
    FRENET = 3
    SEGMENT_CONTACT = 4
    NONE = 5


class AgentTerminationMode(Enum):
    """Whose end is that of the environment."""

    EGO = 0
    ANY = 1
    ALL = 2


class RewardMode(Enum):
    """Rewards of a step."""

    SURVIVAL = 0
    PROGRESS = 1
    CUSTOM = 2


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


class Settings:
    """Settings by name, each with a default.

    Raises:
      ArgumentError: a setting that is not here.
      SettingsError: another value of a setting that can have its default only.
    """

    defaults: Mapping[str, Any] = {}
    fixed: Mapping[str, Any] = {}  # that would change what is driven or seen, and cannot be had
    optional: Collection[str] = ()  # without a default

    def __init__(self, **named: Any) -> None:
        parts, name = self.parts(), type(self).__name__
        vars(self).update({**self.defaults, **self.fixed})
        for part, kind in parts.items():
            setattr(self, part, kind())
        for given, value in named.items():
            setting = f"{given}_config" if f"{given}_config" in parts else given  # both are spelt in releases
            if setting not in vars(self) and setting not in self.optional:
                raise ArgumentError(unknown_argument(name, given, [*vars(self), *self.optional]))
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
    """The LiDAR of each car."""

    defaults = {"num_beams": BEAMS, "field_of_view": FIELD_OF_VIEW, "base_link_to_lidar_tf": _MOUNT}  # noqa: RUF012
    fixed = {"enabled": True, "range_min": 0.0, "range_max": 30.0, "noise_std": 0.01}  # noqa: RUF012
    optional = ("angle_min", "angle_max")

    @property
    def span(self) -> float:
        """From the first beam to the last [rad]."""
        named = vars(self)
        if "angle_min" in named and "angle_max" in named:
            return float(named["angle_max"] - named["angle_min"])
        return float(named["field_of_view"])

    @classmethod
    def from_fov(cls, fov: float, **named: Any) -> LiDARConfig:
        """Return one of a field of view [rad]."""
        return cls(field_of_view=fov, **named)

    @property
    def ahead(self) -> float | None:
        """Of the rear axle [m]; None: where the vehicle has its LiDAR.

        Raises:
          SettingsError: one that is turned, or to a side.
        """
        x, *others = vars(self)["base_link_to_lidar_tf"]
        if any(others):
            accepted = "a distance ahead [m], 0.0, 0.0"
            raise SettingsError(f"base_link_to_lidar_tf is {shown((x, *others))}; accepted: {accepted}")
        return None if (x, *others) == _MOUNT else float(x)


class ControlConfig(Settings):
    """Meaning of actions."""

    defaults = {  # noqa: RUF012
        "longitudinal_mode": LongitudinalActionType.SPEED, "steering_mode": SteerActionType.STEERING_ANGLE,
    }  # fmt: skip
    fixed = {"steer_delay_steps": 0}  # noqa: RUF012


class SimulationConfig(Settings):
    """Settings of the simulation."""

    defaults = {  # noqa: RUF012
        "timestep": 0.01, "integrator_timestep": 0.01, "integrator": Integrator.RK4, "dynamics_model": DynamicModel.ST,
        "loop_counter": LoopCounterMode.FRENET_BASED, "compute_frenet_frame": True, "max_laps": 1,
    }  # fmt: skip


class ObservationConfig(Settings):
    """Types of observations."""

    defaults = {"type": ObservationType.DIRECT, "features": None}  # noqa: RUF012


class ResetConfig(Settings):
    """Places of cars at a reset."""

    defaults = {"strategy": ResetStrategy.RL_GRID_STATIC}  # noqa: RUF012


class RenderConfig(Settings):
    """Settings of the window; here it is MuJoCo's viewer."""

    defaults = {"render_fps": 60, "real_time_factor": 1.0, "frame_output_method": "auto"}  # noqa: RUF012


class TerminationConfig(Settings):
    """Ends of an episode: after so many steps, by a collision, and of which car.

    Raises:
      SettingsError: another value.
    """

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
    """Reward of a step: its duration; a weighted sum of metres, speed and duration, less collisions; or a function.

    Raises:
      SettingsError: another mode, a weight that is no number, or no function where one is needed.
    """

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


class OtherConfig(Settings):
    """Settings of what is not here: contacts, randomization; an EnvConfig refuses them."""

    def __init__(self, **named: Any) -> None:
        vars(self).update(named)


class EnvConfig(Settings):
    """All settings of an environment."""

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
        }  # fmt: skip


def plain_config(config: Any) -> dict[str, Any]:
    """Return the settings of a `config`, a dictionary or an EnvConfig, by the names of v1.0.

    Raises:
      SettingsError: neither of them.
    """
    if config is None:
        return {}
    if isinstance(config, Mapping):
        found = dict(config)
        if is_dataclass(found.get("params")):
            found["params"] = asdict(found["params"])
        return found
    if not isinstance(config, EnvConfig):
        raise SettingsError(f"config is {config!r}; accepted: a dictionary of settings, or an EnvConfig")
    own: Any = config
    simulation, control, lidar = own.simulation_config, own.control_config, own.lidar_config
    return {
        "seed": own.seed, "map": own.map_name, "scale": own.map_scale,
        "params": asdict(own.params) if is_dataclass(own.params) and not isinstance(own.params, type) else own.params,
        "num_agents": own.num_agents, "ego_idx": own.ego_index, "timestep": simulation.timestep,
        "integrator": simulation.integrator, "model": simulation.dynamics_model, "max_laps": simulation.max_laps,
        "control_input": [getattr(m, "value", m) for m in (control.longitudinal_mode, control.steering_mode)],
        "observation_config": {"type": own.observation_config.type, "features": own.observation_config.features},
        "reset_config": {"type": own.reset_config.strategy}, "num_beams": lidar.num_beams, "fov": lidar.span,
        "lidar_dist": lidar.ahead,
    }  # fmt: skip
