"""One world to be driven: which track, which car, which start, what the planner is told, which seed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..course.course import Course
from ..course.obstacles import Obstacle
from ..errors import SettingsError
from ..lidar.effects import LidarEffects
from ..messages import require
from ..vehicle.changes import CarChanges


@dataclass(frozen=True, kw_only=True)
class Start:
    """Where a race starts, along the centreline.

    Raises:
      SettingsError: a value that is not finite.
    """

    s: float = 0.0  # [m] progress
    offset: float = 0.0  # [m] left positive
    heading: float = 0.0  # [rad] from the centreline's, left positive
    speed: float = 0.0  # [m/s] wheels rolling

    def __post_init__(self) -> None:
        require(self, math.isfinite, "a finite number", ("s", "offset", "heading", "speed"), SettingsError)


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Everything that a world's result depends on, but for the controller and when to end.

    Raises:
      SettingsError: a value out of its range.
    """

    track: Course | str = "oval"  # as `load_track` takes it
    seed: int = 0  # of the LiDAR's noise and dropouts
    car: CarChanges = field(default_factory=CarChanges)
    start: Start = field(default_factory=Start)
    effects: LidarEffects = field(default_factory=LidarEffects)
    obstacles: tuple[Obstacle, ...] = ()
    planner_mu: float | None = None  # what the planner believes; None: as in the car's MJCF; inf: no friction limits
    max_speed: float = 8.0  # [m/s] fastest that the planner may command
    planner: Mapping[str, Any] = field(default_factory=dict)  # settings of the planner that differ from its own

    def __post_init__(self) -> None:
        if not isinstance(self.seed, int) or isinstance(self.seed, bool) or self.seed < 0:
            raise SettingsError(f"seed is {self.seed!r}; accepted: a whole number from 0")
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", ("max_speed",), SettingsError)
        if self.planner_mu is not None:
            require(self, lambda value: value > 0.0, "a positive number, or inf", ("planner_mu",), SettingsError)
