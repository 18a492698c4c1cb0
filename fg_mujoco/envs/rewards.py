"""Reward of a tick: a weighted sum of terms, each a function of the state of the cars after the tick.

    env = F1TenthEnv(rewards={"sliding": 20.0, "command_rate": 0.1})

A term is a function of a `TickState` that returns one number for each car: what the tick was worth. A term that costs
is negative. A rate is multiplied by `state.period`, so that its sum over an episode does not depend on the tick. Own
terms are registered with `@reward`, or given as `{"name": (function, weight)}`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SettingsError
from ..messages import FloatArray, shown
from ..registry import Registry
from .tick_state import TickState

RewardFunction = Callable[[TickState], ArrayLike]

REWARDS: Registry[RewardFunction] = Registry("reward term", SettingsError, "fg_mujoco.rewards")
"""The terms that are known by name."""

NEAR_WALL = 0.2
"""[m] Distance to a wall below which `near_wall` costs something."""


def reward(function: RewardFunction) -> RewardFunction:
    """Register a reward term by the name of its function, for use as a decorator.

    Raises:
      SettingsError: a bundled term has that name.
    """
    name = function.__name__
    if name in REWARDS and REWARDS.find(name).__module__ == __name__:
        raise SettingsError(f"reward term {name!r} is a bundled one; accepted: another name")
    REWARDS[name] = function
    return function


@reward
def progress(state: TickState) -> FloatArray:
    """Distance driven along the course, backward negative [m] (course progress of Wurman et al., Nature 602, 2022)."""
    return state.progress - state.before.progress


@reward
def collision(state: TickState) -> FloatArray:
    """-1 when the chassis touches a wall or an obstacle, or the car rolls over, which ends the episode."""
    return np.where(state.crashed | state.rolled_over, -1.0, 0.0)


@reward
def sliding(state: TickState) -> FloatArray:
    """Time in which a tire slides, negative [s] (tire slip of Wurman et al., 2022)."""
    return -state.period * state.sliding


@reward
def survival(state: TickState) -> FloatArray:
    """Duration of the tick [s] (the reward of f1tenth_gym)."""
    return np.full(len(state.time), state.period)


@reward
def time(state: TickState) -> FloatArray:
    """Duration of the tick, negative: the sum is the time that the episode takes [s]."""
    return np.full(len(state.time), -state.period)


@reward
def lap(state: TickState) -> FloatArray:
    """Laps completed in the tick."""
    return (state.laps - state.before.laps).astype(np.float64)


@reward
def speed(state: TickState) -> FloatArray:
    """Distance driven along the heading, whatever the direction of the course [m]."""
    return state.period * state.speed


@reward
def command_rate(state: TickState) -> FloatArray:
    """Squared change of the normalised command from tick to tick, negative (`action_rate_l2` of mjlab)."""
    car = state.car
    ranges = np.array((2.0 * car.max_steering_angle, car.max_speed - car.min_speed))
    change: FloatArray = 2.0 * (state.command - state.before.command) / ranges
    cost: FloatArray = change[:, 0] * change[:, 0] + change[:, 1] * change[:, 1]
    return -cost


@reward
def heading_error(state: TickState) -> FloatArray:
    """Angle between heading and course, times the period, negative [rad s] (Jaritz et al., ICRA 2018: its cosine)."""
    return -state.period * np.abs(state.heading_error)


@reward
def cross_track_error(state: TickState) -> FloatArray:
    """Distance from the line of the course, times the period, negative [m s] (Jaritz et al., ICRA 2018)."""
    return -state.period * np.abs(state.offset)


@reward
def near_wall(state: TickState) -> FloatArray:
    """Time closer than 0.2 m to a wall or an obstacle, negative [s]: all of it at the wall, none at 0.2 m."""
    return -state.period * np.maximum(1.0 - state.wall_distance / NEAR_WALL, 0.0)


@reward
def overtaking(state: TickState) -> FloatArray:
    """Positions gained among the cars of the world, lost ones negative (passing bonus of Wurman et al., 2022)."""
    return (state.before.position - state.position).astype(np.float64)


@reward
def car_contact(state: TickState) -> FloatArray:
    """Number of times that the car begins to touch another, negative (any-collision cost of Wurman et al., 2022)."""
    return (state.before.touches - state.touches).astype(np.float64)


_DEFAULTS: Mapping[str, float] = {
    "progress": 1.0,  # [1/m]
    "collision": 10.0,
    "sliding": 1.0,  # [1/s]
}


@dataclass(frozen=True, kw_only=True)
class RewardTerm:
    """A term of the reward, and its weight."""

    name: str
    function: RewardFunction
    weight: float  # from 0 on, per unit of the function


@dataclass(frozen=True, init=False, repr=False)
class Rewards:
    """Weights of the terms: by default `progress` 1 per metre, `collision` 10 and `sliding` 1 per second.

    A weight of 0 leaves one of these three out.

    Args:
      weights: of terms by name, or a function and its weight: `Rewards(sliding=20.0, mine=(function, 0.5))`.

    Attributes:
      terms: all of them, the three first.

    Raises:
      SettingsError: an unknown term, or a weight that is negative or not finite.
    """

    terms: tuple[RewardTerm, ...]

    def __init__(self, **weights: float | tuple[RewardFunction, float]) -> None:
        terms = tuple(_term(name, value) for name, value in ({**_DEFAULTS} | weights).items())
        object.__setattr__(self, "terms", terms)

    def __repr__(self) -> str:
        return f"Rewards({', '.join(f'{term.name}={term.weight!r}' for term in self.terms)})"

    def __getattr__(self, name: str) -> float:
        """Return the weight of a term."""
        for term in () if name == "terms" else self.terms:
            if term.name == name:
                return term.weight
        raise AttributeError(f"Rewards has no {name!r}")

    @classmethod
    def of(cls, given: Any) -> Rewards:
        """Return the Rewards of a mapping of weights, or those that are given.

        Raises:
          SettingsError: neither, or as the class.
        """
        if isinstance(given, Rewards):
            return given
        if not isinstance(given, Mapping):
            raise SettingsError(f"rewards is {shown(given)}; accepted: Rewards, or a mapping of weights by name")
        return cls(**{str(name): value for name, value in given.items()})

    @property
    def others(self) -> tuple[RewardTerm, ...]:
        """The terms besides the three that `reward_ticks` computes."""
        return self.terms[len(_DEFAULTS) :]

    def of_tick(self, period: float) -> FloatArray:
        """Return what `reward_ticks` multiplies with, of ticks of so many seconds. Shape (3,)."""
        made, hit, slid = (term.weight for term in self.terms[: len(_DEFAULTS)])
        return np.array((made, hit, slid * period))


def values_of(term: RewardTerm, state: TickState, driven: NDArray[np.bool_]) -> FloatArray:
    """Return what a term adds to the rewards of a tick, 0 for cars that were not driven. Shape (n,).

    Args:
      term: with its weight.
      state: after the tick.
      driven: whether each car was driven (n,).

    Raises:
      SettingsError: the function returned something else than one finite number for each car.
    """
    values = np.asarray(term.function(state))
    if values.shape != driven.shape or values.dtype.kind not in "biuf":
        raise SettingsError(
            f"reward term {term.name!r} returned {shown(values)} of shape {values.shape}; accepted: one number for "
            f"each car, shape {driven.shape}"
        )
    found: FloatArray = np.where(driven, term.weight * values, 0.0)
    finite = np.isfinite(found)
    if not finite.all():
        car = int(finite.argmin())
        raise SettingsError(
            f"reward term {term.name!r} is {values[car]} for car {car} of {len(values)}; accepted: finite numbers"
        )
    return found


def _term(name: str, value: Any) -> RewardTerm:
    """Return the term of a weight, or of a function and its weight.

    Raises:
      SettingsError: an unknown name, no weight, or a bundled name with a function of its own.
    """
    function, weight = value if isinstance(value, (tuple, list)) and len(value) == 2 else (None, value)
    if function is None:
        function = REWARDS.find(name, f", or {{{name!r}: (function, weight)}}")
    elif name in REWARDS and REWARDS.find(name) is not function:
        raise SettingsError(f"reward term {name!r} is registered; accepted: (function, weight) under another name")
    if not callable(function):
        raise SettingsError(f"reward term {name!r} is {shown(function)}; accepted: (function, weight)")
    real = isinstance(weight, (int, float, np.integer, np.floating)) and not isinstance(weight, bool)
    if not real or not 0.0 <= weight < math.inf:
        raise SettingsError(
            f"Rewards.{name} is {shown(weight)}; accepted: a finite number from 0 on; a cost is a term whose values "
            "are negative"
        )
    return RewardTerm(name=name, function=function, weight=float(weight))
