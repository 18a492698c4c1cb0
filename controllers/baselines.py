"""Baselines: planners that look at nothing. What a car reaches with one is the work of its stages, not of a planner.

A planner is worth what it reaches beyond them. They have no speed law of their own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fg_mujoco.messages import CarParameters

from .control.driving import DrivingSettings
from .control.planner import GoalPlanner, Planner
from .control.planner_settings import Accepted, setting
from .control.steering import saturate

_FAR = 3.0  # [m] to the goal
_MOST = 1.0  # [rad] to either side, of what is drawn
_MODULUS, _FACTOR, _DISCARDED = 2**31 - 1, 16807, 3  # S. Park and K. Miller, Random number generators, 1988


def _always(bearing: float) -> Any:
    """Return the function `goal` of a planner whose goal has always the same bearing [rad]."""

    def goal(geometry, ranges, car, settings, debug):  # type: ignore[no-untyped-def]
        return bearing, _FAR

    return staticmethod(goal)


class Straight(GoalPlanner):
    """Baseline: always straight ahead."""

    Settings = DrivingSettings
    source_laws = ()
    goal = _always(0.0)


class HardLeft(GoalPlanner):
    """Baseline: always to the left, as sharply as the wheels turn."""

    Settings = DrivingSettings
    source_laws = ()
    goal = _always(1.0)


@dataclass(frozen=True, kw_only=True)
class RandomSettings(DrivingSettings):
    """The seed of the draws."""

    seed: int = setting(
        0, "", "of the draws, besides that of the race",
        Accepted("a whole number from 0 to 1e9", lambda n: 0.0 <= n <= 1e9 and n.is_integer()),
    )  # fmt: skip


class Random(Planner):
    """Baseline: in each tick another bearing, drawn from -1 to 1 rad. Its draws are those of its own seed and tick."""

    Settings = RandomSettings
    memory_type = np.dtype([("state", np.int64)])

    def __init__(
        self, car: CarParameters, mu: float, max_speed: float = 8.0, settings: RandomSettings | None = None, *,
        latency: float = 0.0, period: float = 0.025, seed: int = 0, assist: str = "full",
    ) -> None:  # fmt: skip
        given = RandomSettings() if settings is None else settings
        if isinstance(given, RandomSettings):
            given = replace(given, seed=(given.seed + seed) % 10**9)
        super().__init__(car, mu, max_speed, given, latency=latency, period=period, assist=assist)

    @staticmethod
    def reference(  # type: ignore[no-untyped-def]
        geometry, ranges, odometry, car, settings, memory, line
    ):
        """Return the steering angle [rad] of the drawn bearing, no limit to the speed, and the bearing [rad]."""
        state, draws = memory.state, 1
        if state == 0:  # of a new drive, or of one after a reset
            state, draws = 1 + settings.seed, 1 + _DISCARDED
        for _ in range(draws):
            state = state * _FACTOR % _MODULUS
        memory.state = state
        bearing = _MOST * (2.0 * state / _MODULUS - 1.0)
        return saturate(bearing, car.max_steering_angle), math.inf, bearing
