"""Residual policies: a policy corrects the commands of a planner, the base planner.

    env = F1TenthEnv(residual={"planner": "gap_finder[assist=safe]", "steering": 0.1, "speed": 1.0})

In each tick the base planner decides by the scan and the odometry, and the command is what it commands plus the
policy's action, within the limits of the car and `speed_range`. A policy that answers zero drives as the planner does,
bit for bit. So a training begins with a car that drives (Silver et al., "Residual Policy Learning", 2018; Johannink et
al., "Residual Reinforcement Learning for Robot Control", 2019; on racing cars Trumpp, Hoornaert and Caccamo, "Residual
Policy Learning for Vehicle Control of Autonomous Racing Cars", 2023).

The base planner is told the car as it is built, its usual latency, and a friction coefficient that is no world's own:
nothing that an episode draws. It knows no map, no pose and no sensors besides LiDAR and odometry. Its commands are
`planner_command` of an observation.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.controllers.control.planner import Planner
from fg_mujoco.controllers.control.planner_batch import PlannerBatch
from fg_mujoco.errors import ControllerError, SettingsError, accepted_names
from fg_mujoco.lidar.beams import Beams
from fg_mujoco.messages import Controller, FloatArray, PlannerContext, require, shown
from fg_mujoco.racing.planners import ControllerChoice, build_controller, controller_names, file_in
from fg_mujoco.simulation.planner_adapter import odometry_message, plan, wanted_sensors
from fg_mujoco.simulation.planner_adapter import start as start_planner
from fg_mujoco.simulation.settings import as_part

Mask = NDArray[np.bool_]

_EXAMPLE = "such as 'gap_finder[assist=safe]'"


@dataclass(frozen=True, kw_only=True)
class Residual:
    """A base planner, and by how much a policy may correct its commands.

    Raises:
      SettingsError: a value that is not accepted, or a planner that cannot be one.
    """

    planner: str  # a name with its settings, such as "gap_finder[assist=safe]"
    steering: float = 0.1  # [rad] greatest correction of the steering angle
    speed: float = 1.0  # [m/s] greatest correction of the speed
    slow: float = 0.0  # [m/s] that the planner commands, below which corrections are smaller in proportion; 0: nowhere
    mu: float = 0.5  # friction coefficient that the planner assumes
    latency: float | None = None  # [s] that it assumes; None: that of the environment's LiDAR and car, where not drawn

    def __post_init__(self) -> None:
        if not isinstance(self.planner, str):
            raise SettingsError(f"residual has the planner {self.planner!r}; accepted: a name, {_EXAMPLE}")
        positive = ("steering", "speed", "mu")
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", positive, SettingsError)
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", ("slow",), SettingsError)
        if self.latency is not None:
            require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", ("latency",), SettingsError)
        choice = ControllerChoice.of(self.planner, "residual's planner")
        names = () if file_in(choice.source) else controller_names()  # a package may register any name
        if choice.source not in names:  # nothing is loaded: whoever made a policy's file chose the planner
            said = f"residual has the planner {shown(choice.source)}, which is no registered one"
            raise SettingsError(f"{said}; {accepted_names(choice.source, controller_names())}")
        try:
            kind = choice.load()
        except ControllerError as error:
            raise SettingsError(f"residual: {error}") from error
        lacking = wanted_sensors(kind) or (("the pose of its car",) if hasattr(kind, "look_round") else ())
        if lacking:
            said = f"residual has the planner {self.planner!r}, which knows {', '.join(map(str, lacking))}"
            raise SettingsError(f"{said}; accepted: one that drives by LiDAR and odometry, {_EXAMPLE}")

    @classmethod
    def of(cls, given: Any) -> Residual | None:
        """Return what a setting says: None, a planner's text, the fields by name, or a Residual.

        Raises:
          SettingsError: it is none of them.
        """
        if given is None:
            return None
        return as_part({"planner": given} if isinstance(given, str) else given, cls, "residual")

    def with_latency(self, usual: float) -> Residual:
        """Return the same with a latency [s]: its own, or the usual one."""
        return replace(self, latency=usual if self.latency is None else self.latency)

    def described(self) -> dict[str, Any]:
        """Return the fields as JSON takes them."""
        return asdict(self)

    def planners(self, context: PlannerContext, beams: Beams, count: int) -> BasePlanners:
        """Return the base planners of so many cars, which decide beside a policy; arguments and errors as there."""
        return BasePlanners(self, context, beams, count)

    def make(self, context: PlannerContext) -> Controller:
        """Return a new base planner.

        Raises:
          SettingsError: it cannot be built, as one that drives by a map.
        """
        choice = ControllerChoice.of(self.planner, "residual's planner")
        try:
            return build_controller(choice.load(), choice.source, context, dict(choice.settings))
        except ControllerError as error:
            raise SettingsError(f"residual: {error}") from error


class BasePlanners:
    """The base planners of n cars, all alike: they decide beside the policy that drives.

    Args:
      residual: whose planner they are.
      context: what each is told.
      beams: of the LiDARs.
      count: of cars, n.

    Attributes:
      commands: of the last decisions (n, 2) [rad, m/s]; 0 before the first.

    Raises:
      SettingsError: they cannot be built.
    """

    def __init__(self, residual: Residual, context: PlannerContext, beams: Beams, count: int) -> None:
        first = residual.make(context)
        self.commands, self._beams = np.zeros((count, 2)), beams
        self._together: PlannerBatch | None = None
        self._each: list[Controller] = []
        if isinstance(first, Planner) and first.batch is not None:
            self._together = first.batch([first] * count)  # which lend their settings only
        else:
            self._each = [first, *(residual.make(context) for _ in range(count - 1))]

    def begin(self, which: Mask) -> None:
        """Begin anew for the cars `which` (n,), whose episodes begin."""
        self.commands[which] = 0.0
        if self._together is not None:
            self._together.reset(which)
            return
        for row in np.flatnonzero(which).tolist():
            start_planner(self._each[row])

    def decide(self, which: Mask, ranges: FloatArray, odometry: NDArray[np.void]) -> None:
        """Have the planners of the cars `which` (n,) decide in a tick.

        Args:
          which: (n,).
          ranges: of all beams (n, beams) [m], as in LaserScan.
          odometry: (n,) of ODOMETRY.

        Raises:
          PlannerError: a planner fails.
        """
        if self._together is not None:
            self._together(self._beams.geometry, ranges, odometry, which, self.commands)
            return
        for row in np.flatnonzero(which).tolist():
            sensed = odometry_message(odometry[row])
            command = plan(self._each[row], self._beams.to_scan(ranges[row], sensed.stamp), sensed)
            self.commands[row] = command.steering_angle, command.speed
