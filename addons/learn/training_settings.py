"""The settings of a training, and how far it is."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from fg_mujoco.course.files import is_file
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.messages import require, require_whole, shown
from fg_mujoco.simulation.settings import as_part

SETTINGS, PROGRESS, CHECKPOINTS, LOG = "training.json", "progress.jsonl", "checkpoints", "log"
"""Files and folders of a training."""
SCHEMA = 1
"""Of a training's folder; another is refused."""

USUAL_ENVIRONMENT: Mapping[str, Any] = {
    "track": ["random:0:100", "random:0:100:tight"], "randomize": {"mu": (0.5, 1.1)}, "rewards": "no_slide",
    "privileged": "mu,slip",
    "observation": "beams:108,speed,yaw_rate,acceleration,steering,previous_action,history:3,normalised,flat",
    "action": "steering_rate,acceleration", "normalised_actions": True, "speed_range": (0.5, 8.0), "time_limit": 40.0,
    "laps": 100,
}  # fmt: skip
"""Settings of the environment that differ from its own, unless they are given."""

USUAL_RESIDUAL: Mapping[str, Any] = {
    "observation": "beams:72,planner_command:history=3,speed:history=3,wheel_speeds,yaw_rate:history=3,"
    "acceleration:history=3,steering:history=3,previous_action:history=3,normalised,flat",
    "action": "steering,speed", "speed_range": (-5.0, 8.0),
}  # fmt: skip
"""Further ones, where the policy corrects a planner."""

_MOST_STEPS = 2**26  # that are kept at once: 2^26 numbers are half a gigabyte
_MOST_WORLDS, _WIDEST = 2**16, 2**14
_ACTIVATIONS = ("tanh", "relu", "elu", "silu")
MAY_CHANGE = ("steps", "threads", "checkpoints")
"""Settings that may be others when training goes on."""


@dataclass(frozen=True, kw_only=True)
class PPO:
    """Settings of PPO, with the names of Stable-Baselines3 where it has one.

    Raises:
      SettingsError: a value that is not accepted.
    """

    n_steps: int = 128  # of each world in an iteration
    minibatches: int = 8  # of an iteration's steps
    n_epochs: int = 5
    learning_rate: float = 4e-4  # falls in a line to a twentieth at the end
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    ent_coef: float = 0.0
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5
    target_kl: float = 0.03  # from which on an iteration's updates end
    net: tuple[int, ...] = (128, 128)  # widths of the hidden layers
    activation: str = "tanh"
    log_std: float | None = None  # of the actions, at the beginning; None: as start_from has it, else -0.7
    normalise_reward: bool = True  # divide rewards by the running standard deviation of the discounted return
    normalise_observation: bool = False  # by running statistics, which are then part of the policy

    def __post_init__(self) -> None:
        object.__setattr__(self, "net", tuple(self.net) if isinstance(self.net, (list, tuple)) else (self.net,))
        for name in ("n_steps", "minibatches", "n_epochs"):
            require_whole(name, getattr(self, name), 1, _MOST_STEPS)
        for width in self.net:
            require_whole("net", width, 1, _WIDEST)
        positive = ("learning_rate", "clip_range", "max_grad_norm", "target_kl")
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", positive, SettingsError)
        require(self, lambda value: 0.0 <= value <= 1.0, "a number from 0 to 1", ("gamma", "gae_lambda"), SettingsError)
        costs = ("ent_coef", "vf_coef")
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0 on", costs, SettingsError)
        if self.log_std is not None:
            require(self, math.isfinite, "a finite number", ("log_std",), SettingsError)
        if self.activation not in _ACTIVATIONS:
            said = f"activation is {shown(self.activation)}"
            raise SettingsError(f"{said}; {accepted_names(self.activation, _ACTIVATIONS)}")
        for name in ("normalise_reward", "normalise_observation"):
            if not isinstance(getattr(self, name), bool):
                raise SettingsError(f"{name} is {shown(getattr(self, name))}; accepted: True, False")


@dataclass(frozen=True, kw_only=True)
class TrainingSettings:
    """What a training is.

    Raises:
      SettingsError: a value that is not accepted.
    """

    environment: Mapping[str, Any] = field(default_factory=dict)  # by name; others as USUAL_ENVIRONMENT has them
    steps: int = 1_000_000  # of all worlds together
    worlds: int = 32
    seed: int = 0  # of the worlds and of the network
    threads: int = 1  # that step the worlds, and that torch computes with
    checkpoints: int = 20  # how many are written, evenly
    ppo: PPO = field(default_factory=PPO)
    start_from: str | None = None  # folder of another training, or a policy.zip, whose weights are the first ones

    def __post_init__(self) -> None:
        if not isinstance(self.environment, Mapping):
            raise SettingsError(f"environment is {shown(self.environment)}; accepted: settings by name")
        object.__setattr__(self, "ppo", as_part(self.ppo, PPO, "ppo"))
        usual = dict(USUAL_ENVIRONMENT)
        if self.environment.get("residual") is not None:
            usual |= USUAL_RESIDUAL
        object.__setattr__(self, "environment", usual | dict(self.environment))
        require_whole("steps", self.steps, 1)
        for name in ("worlds", "threads", "checkpoints"):
            require_whole(name, getattr(self, name), 1, _MOST_WORLDS)
        if self.worlds * self.ppo.n_steps > _MOST_STEPS:
            said = f"{self.worlds} worlds with n_steps {self.ppo.n_steps}"
            raise SettingsError(f"{said}; accepted: {_MOST_STEPS} steps at most in an iteration")
        require_whole("seed", self.seed, 0)
        if self.start_from is not None:
            object.__setattr__(self, "start_from", str(self.start_from))
            self.first_weights()  # refuses what has none
        if self.worlds * self.ppo.n_steps % self.ppo.minibatches:
            said = f"minibatches is {self.ppo.minibatches}, of {self.worlds} worlds times {self.ppo.n_steps} steps"
            raise SettingsError(f"{said}; accepted: a divisor of that")
        EnvironmentSettings.of(self.environment).make_world()  # refuses what cannot be driven before torch is imported

    def first_weights(self) -> Path | None:
        """Return the file of `start_from`: of a training's folder its last checkpoint; None: weights are drawn.

        Raises:
          SettingsError: there is none.
        """
        if self.start_from is None or is_file(self.start_from):
            return None if self.start_from is None else Path(self.start_from)
        found = sorted((Path(self.start_from) / CHECKPOINTS).glob("*.zip"))
        if not found:
            said = f"start_from is {shown(self.start_from)}, where no checkpoint is"
            raise SettingsError(f"{said}; accepted: the folder of a training, or a policy.zip")
        return found[-1]

    def described(self) -> dict[str, Any]:
        """Return the settings as JSON takes them."""
        found: dict[str, Any] = json.loads(json.dumps(asdict(self), default=repr))
        return found


@dataclass(frozen=True, kw_only=True)
class TrainingProgress:
    """How far a training is."""

    steps: int
    total: int
    rate: float  # steps per second of wall time, since it was called
    figures: Mapping[str, float]  # of the last iteration, as progress.jsonl has them

    @property
    def remaining_s(self) -> float | None:
        """Wall time that is left [s]; None: not known."""
        return (self.total - self.steps) / self.rate if self.rate else None
