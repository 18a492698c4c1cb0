"""What planners whose decision is a kernel have in common: messages in, a command out, for one world or for many.

Such a planner is a class

    class MyPlanner(CompiledPlanner):
        Settings = MySettings  # a frozen dataclass of numbers
        decide_worlds = staticmethod(decide_worlds)

and a kernel, a loop over the worlds round what it decides in one of them:

    @kernel
    def decide_worlds(scan, ranges, odometry, running, planners, memories, paths, commands):
        for world in range(len(running)):
            if running[world]:
                commands[world, 0], commands[world, 1] = decide(...)

A planner that is called alone is a batch of one: it runs the very same code.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import astuple
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.messages import (
    ODOMETRY,
    CarParameters,
    DriveCommand,
    FloatArray,
    LaserScan,
    Odometry,
    ScanGeometry,
    require,
)

from .driving import DRIVER, SCAN, driver_record, scan_values
from .friction_guard import GUARD_MEMORY, FrictionGuard
from .records import record_type
from .stopping_paths import PATHS, StoppingPaths

MEMORY = np.dtype([("guard", GUARD_MEMORY)])
"""What a planner keeps from one tick to the next; zero in the beginning."""

_motion_of = attrgetter(*ODOMETRY.names or ())


class CompiledPlanner:
    """A planner whose decision is a kernel: a fg_mujoco.messages.Controller.

    A class that inherits from one and answers by a `__call__` of its own has no batch, unless it makes its own too.

    Args:
      car: parameters of the car.
      mu: friction coefficient that it believes in; inf: no friction limits, and so no stopping in sight either.
      max_speed: fastest that it commands [m/s].
      settings: parameters of the planner; None: the defaults.

    Attributes:
      record: what the kernel is told of the planner, shape (1,): fields `settings`, and `driver` of type DRIVER.

    Raises:
      SettingsError: a value that is not a positive number, or settings of another planner.
    """

    Settings: ClassVar[type[Any]]
    memory_type: ClassVar[np.dtype[np.void]] = MEMORY  # a planner that keeps more has fields beside `guard`
    decide_worlds: ClassVar[Callable[..., None]]

    def __init__(self, car: CarParameters, mu: float, max_speed: float = 8.0, settings: Any = None) -> None:
        self.mu = mu
        self.max_speed = max_speed
        self.settings: Any = self.Settings() if settings is None else settings
        require(self, lambda value: value > 0.0, "a positive number, or inf", ("mu",), SettingsError)
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", ("max_speed",), SettingsError)
        if type(self.settings) is not self.Settings:
            accepted = self.Settings.__name__
            raise SettingsError(f"{type(self).__name__}.settings is {settings!r}; accepted: a {accepted}")
        guard = FrictionGuard(car, mu) if math.isfinite(mu) else None
        self.paths = StoppingPaths(car, guard, max_speed).record if guard else None
        self.record = np.zeros(1, self._record_type())
        self.record["settings"] = astuple(self.settings)
        self.record["driver"] = driver_record(car, max_speed, guard)
        self._alone = CompiledBatch(type(self), [self])
        self._odometry = np.zeros(1, ODOMETRY)
        self._running = np.ones(1, np.bool_)
        self._commands = np.zeros((1, 2))

    def __init_subclass__(cls) -> None:
        if "__call__" in vars(cls) and "batch" not in vars(cls):
            cls.batch = None  # type: ignore[assignment, method-assign]

    @classmethod
    def _record_type(cls) -> np.dtype[np.void]:
        return np.dtype([("settings", record_type(cls.Settings)), ("driver", DRIVER)])

    @classmethod
    def batch(cls, planners: Sequence[CompiledPlanner]) -> CompiledBatch:
        """Return planners of this class, one for each world, as new: they are decided in one compiled call."""
        return CompiledBatch(cls, planners)

    def reset(self) -> None:
        """Forget everything seen so far."""
        self._alone.reset()

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Answer the command to hold until the next scan."""
        self._odometry[0] = _motion_of(odometry)
        self._alone(scan, scan.ranges[np.newaxis], self._odometry, self._running, self._commands)
        steering_angle, speed = self._commands[0].tolist()
        return DriveCommand(steering_angle=steering_angle, speed=speed)


class CompiledBatch:
    """Planners of one class, one for each world: a fg_mujoco.messages.ControllerBatch.

    One batch is for one thread at a time; others may decide at the same time.

    Args:
      planner_class: of the planners.
      planners: in the order of their worlds; they lend their settings and keep their memory to themselves.

    Raises:
      ControllerError: a planner of another class.
    """

    def __init__(self, planner_class: type[CompiledPlanner], planners: Sequence[CompiledPlanner]) -> None:
        for planner in planners:
            if type(planner) is not planner_class:
                raise ControllerError(
                    f"a batch of {planner_class.__name__} was given a {type(planner).__name__}; accepted: its own class"
                )
        tables = {id(p.paths): p.paths for p in planners if p.paths is not None}
        places = {table: place for place, table in enumerate(tables)}
        self._decide_worlds = planner_class.decide_worlds
        self._planners = np.zeros(len(planners), planner_class._record_type())
        for world, planner in enumerate(planners):
            self._planners[world] = planner.record[0]
            self._planners[world]["driver"]["paths"] = places.get(id(planner.paths), 0)
        self._paths = _joined(list(tables.values()))
        self._memories = np.zeros(len(planners), planner_class.memory_type)
        self._scan = np.zeros(1, SCAN)

    def reset(self) -> None:
        """Forget everything seen so far, in all worlds."""
        self._memories.fill(0)

    def __call__(
        self,
        geometry: ScanGeometry | LaserScan,
        ranges: FloatArray,
        odometry: NDArray[np.void],
        running: NDArray[np.bool_],
        commands: FloatArray,
    ) -> None:
        """Write the command of each running world into `commands`; see ControllerBatch."""
        self._scan[0] = scan_values(geometry)
        self._decide_worlds(
            self._scan, _read_only(ranges), odometry, running, self._planners, self._memories, self._paths, commands
        )


def _joined(tables: list[NDArray[np.void]]) -> NDArray[np.void]:
    """Return the tables (1,) as one (n,), read-only; a single one as it is."""
    if len(tables) == 1:
        return tables[0]
    joined = np.concatenate(tables) if tables else np.zeros(0, PATHS)
    joined.flags.writeable = False
    return joined


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return a view that cannot be written to: numba compiles for both kinds, and one is enough."""
    if not array.flags.writeable:
        return array
    view = array.view()
    view.flags.writeable = False
    return view
