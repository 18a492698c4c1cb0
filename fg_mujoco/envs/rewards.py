"""Reward of a tick: a weighted sum of terms, each a function of the state of the cars after the tick.

    env = F1TenthEnv(rewards={"sliding": 20.0, "command_rate": 0.1})
    env = F1TenthEnv(rewards="no_slide")  # or {"preset": "no_slide", "sliding": 5.0}

Costs that grow with time (RUNNING_COSTS) are bounded: in a tick all of them together take at most nine tenths of what
the other terms gain in it. So a policy that explores, and slides all the while, still gains by driving on, whatever the
weights; a crash, which ends all costs, gains nothing. `{"bounded": False}` leaves the plain sum.

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
from numpy.typing import ArrayLike

from .. import portable
from ..errors import SettingsError, accepted_names
from ..messages import FloatArray, shown
from ..registry import Registry
from .tick_state import TickState

RewardFunction = Callable[[TickState], ArrayLike]

REWARDS: Registry[RewardFunction] = Registry("reward term", SettingsError, "fg_mujoco.rewards")
"""The terms that are known by name."""

NEAR_WALL = 0.2
"""[m] Distance to a wall below which `near_wall` costs something."""

DRIFT_ANGLES, DRIFT_SPEEDS = (0.25, 0.6, 1.2), (0.5, 2.0)
"""[rad] Sideslip angles at which `drift` begins to count, counts in full, and begins to count less; and the [m/s] at
which it begins to count, and counts in full."""


def reward(function: RewardFunction) -> RewardFunction:
    """Register a term by its function's name, for use as a decorator; SettingsError: a bundled term has that name."""
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
def impact(state: TickState) -> FloatArray:
    """Speed at the start of the tick in which `collision` is -1, negative [m/s]: a slower crash costs less."""
    speed = portable.hypot(state.before.velocity[:, 0], state.before.velocity[:, 1])
    return np.where(state.crashed | state.rolled_over, -speed, 0.0)


@reward
def sliding(state: TickState) -> FloatArray:
    """Time in which a tire slides, negative [s] (tire slip of Wurman et al., 2022)."""
    return -state.period * state.sliding


@reward
def slip(state: TickState) -> FloatArray:
    """Distance over which the axles are pushed across their wheels, the mean of both, negative [m = m/s s]."""
    return -state.period * state.slip_speed


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
def drift(state: TickState) -> FloatArray:
    """Time in a drift [s], from 0 to the duration of the tick: the sideslip's share times the speed's.

    Sideslip of the centre of gravity counts from 0.25 rad, a little more than any car has in a bend without sliding, in
    full from 0.6 to 1.2 rad, no more from 1.57 rad on, backward; speed from 0.5 m/s, in full from 2 m/s.
    """
    ahead, left = state.speed, state.lateral_speed + state.car.rear_axle_distance * state.yaw_rate
    angle = np.abs(portable.arctan2(left, ahead))
    least, full, most = DRIFT_ANGLES
    rising, falling = (angle - least) / (full - least), (0.5 * math.pi - angle) / (0.5 * math.pi - most)
    sideslip = np.clip(np.minimum(rising, falling), 0.0, 1.0)
    slow, fast = DRIFT_SPEEDS
    pace = np.clip((portable.hypot(ahead, left) - slow) / (fast - slow), 0.0, 1.0)
    found: FloatArray = state.period * sideslip * pace
    return found


@reward
def command_rate(state: TickState) -> FloatArray:
    """Squared change of the normalised command from tick to tick, negative (`action_rate_l2` of mjlab)."""
    car = state.car
    ranges = np.array((2.0 * car.max_steering_angle, car.max_speed - car.min_speed))
    change: FloatArray = 2.0 * (state.command - state.before.command) / ranges
    cost: FloatArray = change[:, 0] * change[:, 0] + change[:, 1] * change[:, 1]
    return -cost


@reward
def action_rate(state: TickState) -> FloatArray:
    """Squared change of the policy's own action, its parts from -1 to 1, from tick to tick, negative."""
    change: FloatArray = state.action - state.before.action
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
    "impact": 1.0,  # [s/m]
}
"""Weights of the terms that `reward_ticks` computes, in its order."""


PRESETS: Mapping[str, Mapping[str, float]] = {
    "progress": {"sliding": 0.0},
    "no_slide": {"sliding": 10.0, "slip": 1.0, "impact": 0.5},
    "smooth": {"action_rate": 0.05},
    "drift": {"progress": 0.0, "sliding": 0.0, "drift": 1.0},
    "race": {"overtaking": 1.0, "car_contact": 1.0},
}
"""Weights in which a preset differs from the default."""

RUNNING_COSTS = (
    "sliding", "slip", "time", "command_rate", "action_rate", "heading_error", "cross_track_error", "near_wall",
)  # fmt: skip
"""Terms that cost something as long as an episode goes on. Others are events, or may be gained back."""

EVENT_COSTS = ("collision", "impact", "car_contact")
"""Terms that cost something when it happens, and never gain."""

SHARE = 0.9
"""Of what a tick gains, the most that its running costs take."""


@dataclass(frozen=True, kw_only=True)
class RewardTerm:
    """A term of the reward, and its weight."""

    name: str
    function: RewardFunction
    weight: float  # from 0 on, per unit of the function

    @property
    def running_cost(self) -> bool:
        """Whether its function is one of RUNNING_COSTS."""
        return any(self.function is REWARDS.find(name) for name in RUNNING_COSTS)

    @property
    def gains(self) -> bool:
        """Whether it may be positive."""
        costs = (*RUNNING_COSTS, *EVENT_COSTS)
        return self.weight > 0.0 and not any(self.function is REWARDS.find(name) for name in costs)


@dataclass(frozen=True, init=False, repr=False)
class Rewards:
    """Weights of the terms, of which `terms` are all, the four first.

    By default `progress` is 1 per metre, `collision` 10, `sliding` 1 per second and `impact` 1 per m/s. A weight of 0
    leaves one of these four out.

    Args:
      preset: one of PRESETS, from which the weights differ; None: from the default ones.
      bounded: whether the running costs of a tick take at most nine tenths of what it gains. Where no term can gain
        anything, nothing bounds them.
      weights: of terms by name, or a function and its weight: `Rewards(sliding=20.0, mine=(function, 0.5))`.

    Raises:
      SettingsError: an unknown term or preset, or a weight that is negative or not finite.
    """

    terms: tuple[RewardTerm, ...]
    bounded: bool

    def __init__(
        self, *, preset: str | None = None, bounded: bool = True, **weights: float | tuple[RewardFunction, float]
    ) -> None:
        if preset is not None and (not isinstance(preset, str) or preset not in PRESETS):
            raise SettingsError(f"rewards has the preset {shown(preset)}; {accepted_names(preset, PRESETS)}")
        if not isinstance(bounded, bool):
            raise SettingsError(f"rewards has bounded {shown(bounded)}; accepted: True, False")
        of_preset = PRESETS[preset] if preset else {}
        terms = tuple(_term(name, value) for name, value in ({**_DEFAULTS} | {**of_preset} | weights).items())
        object.__setattr__(self, "terms", terms)
        object.__setattr__(self, "bounded", bounded)

    def __repr__(self) -> str:
        plain = "" if self.bounded else ", bounded=False"
        return f"Rewards({', '.join(f'{term.name}={term.weight!r}' for term in self.terms)}{plain})"

    def __getattr__(self, name: str) -> float:
        """Return the weight of a term."""
        for term in () if name == "terms" else self.terms:
            if term.name == name:
                return term.weight
        raise AttributeError(f"Rewards has no {name!r}")

    @classmethod
    def of(cls, given: Any) -> Rewards:
        """Return the Rewards of a preset's name or of a mapping of weights, or those that are given.

        Raises:
          SettingsError: none of these, or as the class.
        """
        if isinstance(given, Rewards):
            return given
        if isinstance(given, str):
            return cls(preset=given)
        if not isinstance(given, Mapping):
            accepted = f"{', '.join(PRESETS)}, a mapping of weights by name, or Rewards"
            raise SettingsError(f"rewards is {shown(given)}; accepted: {accepted}")
        return cls(**{str(name): value for name, value in given.items()})

    @property
    def others(self) -> tuple[RewardTerm, ...]:
        """The terms besides the four that `reward_ticks` computes."""
        return self.terms[len(_DEFAULTS) :]

    @property
    def share(self) -> float:
        """Greatest share of a tick's gain that its running costs take; inf: they are not bounded."""
        return SHARE if self.bounded and any(term.gains for term in self.terms) else math.inf

    def of_tick(self, period: float) -> FloatArray:
        """Return what `reward_ticks` multiplies with, of ticks of so many seconds. Shape (4,)."""
        made, hit, slid, fast = (term.weight for term in self.terms[: len(_DEFAULTS)])
        return np.array((made, hit, slid * period, fast))


def write_values(term: RewardTerm, state: TickState, found: FloatArray) -> None:
    """Write what a term adds to a tick's rewards to `found` (n,); SettingsError: it returned no number for each car."""
    values = np.asarray(term.function(state))
    if values.shape != found.shape or values.dtype.kind not in "biuf":
        raise SettingsError(
            f"reward term {term.name!r} returned {shown(values)} of shape {values.shape}; accepted: one number for "
            f"each car, shape {found.shape}"
        )
    np.multiply(values, term.weight, out=found)


def _term(name: str, value: Any) -> RewardTerm:
    """Return the term of a weight, or of a function and its weight."""
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
