"""What planners whose decision is a kernel have in common: messages in, a command out, for one world or for many.

Such a planner is a class

    @kernel
    def decide(scan, ranges, odometry, planner, memory, paths):
        return steering_angle, speed

    class MyPlanner(CompiledPlanner):
        Settings = MySettings  # a frozen dataclass, of driving.DrivingSettings
        decide = staticmethod(decide)

`decide` names what it wants of these, in any order:

scan       of the geometry of the scans, of type scan_geometry.SCAN
ranges     (n,) [m], as in LaserScan
odometry   of type messages.ODOMETRY
planner    its `settings` and `driver` (of type driving.DRIVER), and `line`: which points of `lines` are its own
memory     what it keeps from tick to tick, of `memory_type`
paths      tables of stopping_paths.PATHS; `planner.driver.paths` is the place of its own
lines      (points, columns) lines through the map, for planners that have one

The loop over the worlds of a batch is written round it here. A planner that is called alone is a batch of one: it runs
the very same code.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.kernels import kernel
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

from ..perception.scan_filters import valid_ranges
from ..perception.scan_geometry import SCAN, scan_record, scan_values, sees
from ..safety.braking_trajectories import PATHS, StoppingPaths
from ..safety.friction_limiter import FrictionGuard
from ..safety.safety_filter import SWERVING
from .driving import DRIVER, DRIVING_MEMORY, DrivingSettings, driver_record
from .records import record_type, record_values

MEMORY = np.dtype([("driving", DRIVING_MEMORY)])
"""What a planner keeps from one tick to the next; zero in the beginning."""

LINE = np.dtype([("first", np.int64), ("end", np.int64)])
"""Which points of `lines` are a planner's own: the first, and the one behind the last."""

_motion_of = attrgetter(*ODOMETRY.names or ())
_NO_LINE = np.empty((0, 0))

_DECIDE_WORLDS = """
def around(decide):
    def {name}(scan, ranges, odometry, running, planners, memories, paths, lines, commands):
        for world in range(len(running)):
            if running[world]:
                commands[world, 0], commands[world, 1] = decide({arguments})
    return {name}
"""
_OF_A_WORLD = {
    "scan": "scan[0]", "ranges": "ranges[world]", "odometry": "odometry[world]", "planner": "planners[world]",
    "memory": "memories[world]", "paths": "paths", "lines": "lines",
}  # fmt: skip


class CompiledPlanner:
    """A planner whose decision is a kernel: a fg_mujoco.messages.Controller.

    A class that inherits from one and answers by a `__call__` of its own has no batch, unless it makes its own too.

    Args:
      car: parameters of the car.
      mu: friction coefficient that it believes in; inf: no friction limits, and so no stopping in sight either.
      max_speed: fastest that it commands [m/s].
      settings: parameters of the planner; None: the defaults.

      line: through the map, one row a point, (points, columns); None: it has no map.

    Attributes:
      record: what the kernel is told of the planner, shape (1,): fields `settings`, `driver` and `line`.

    Raises:
      SettingsError: a value that is not a positive number, or settings of another planner.
    """

    Settings: ClassVar[type[DrivingSettings]]
    memory_type: ClassVar[np.dtype[np.void]] = MEMORY  # a planner that keeps more has fields beside `driving`
    decide: ClassVar[Callable[..., tuple[float, float]]]
    decide_worlds: ClassVar[Callable[..., None]]  # made from `decide`

    def __init__(
        self,
        car: CarParameters,
        mu: float,
        max_speed: float = 8.0,
        settings: Any = None,
        *,
        line: FloatArray | None = None,
    ) -> None:
        self.mu = mu
        self.max_speed = max_speed
        self.settings: Any = self.Settings() if settings is None else settings
        require(self, lambda value: value > 0.0, "a positive number, or inf", ("mu",), SettingsError)
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", ("max_speed",), SettingsError)
        if type(self.settings) is not self.Settings:
            accepted = self.Settings.__name__
            raise SettingsError(f"{type(self).__name__}.settings is {settings!r}; accepted: a {accepted}")
        swerves = self.settings.speed_law == "minimum"
        guard = FrictionGuard(car, mu, SWERVING if swerves else None) if math.isfinite(mu) else None
        self.record = np.zeros(1, self._record_type())
        self.record["settings"] = record_values(self.settings)
        self.record["driver"] = driver_record(car, max_speed, guard, self.settings)
        self.record["line"]["end"] = 0 if line is None else len(line)
        self.line = line
        stops = guard is not None and self.record["driver"]["stopping"][0]
        self.paths = StoppingPaths(car, guard, max_speed).record if guard is not None and stops else None
        self._alone = CompiledBatch(type(self), [self])
        self._odometry = np.zeros(1, ODOMETRY)
        self._running = np.ones(1, np.bool_)
        self._commands = np.zeros((1, 2))

    def __init_subclass__(cls) -> None:
        if "decide" in vars(cls):
            cls.decide_worlds = staticmethod(_over_worlds(cls.decide, cls.__name__))
        if "__call__" in vars(cls) and "batch" not in vars(cls):
            cls.batch = None  # type: ignore[assignment, method-assign]

    @classmethod
    def _record_type(cls) -> np.dtype[np.void]:
        return np.dtype([("settings", record_type(cls.Settings)), ("driver", DRIVER), ("line", LINE)])

    @classmethod
    def batch(cls, planners: Sequence[CompiledPlanner]) -> CompiledBatch:
        """Return planners of this class, one for each world, as new: they are decided in one compiled call."""
        return CompiledBatch(cls, planners)

    def reset(self) -> None:
        """Forget everything seen so far."""
        self._alone.reset()

    def _goal_by(
        self, find: Callable[[Any, FloatArray, Any], tuple[float, float]], scan: LaserScan
    ) -> tuple[float, float] | None:
        """Return a goal's bearing [rad] and distance [m]; None without a scan to plan with, or without a goal.

        Args:
          find: takes a row of type SCAN, the readings without NaN or inf, and the planner's row; NaN: there is none.
          scan: to be looked at.
        """
        record, valid = scan_record(scan)[0], valid_ranges(scan.ranges, scan.range_max)
        if not sees(record, valid):
            return None
        bearing, distance = find(record, valid, self.record[0])
        return None if math.isnan(bearing) else (bearing, distance)

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Answer the command to hold until the next scan."""
        self._odometry[0] = _motion_of(odometry)
        self._alone(scan, scan.ranges[np.newaxis], self._odometry, self._running, self._commands)
        steering_angle, speed = self._commands[0].tolist()
        return DriveCommand(steering_angle=steering_angle, speed=speed)


def _over_worlds(decide: Callable[..., tuple[float, float]], name: str) -> Callable[..., None]:
    """Return the kernel that writes the commands of all running worlds, in which `decide` is compiled in.

    Raises:
      ControllerError: a `decide` that wants what there is not.
    """
    function = inspect.unwrap(getattr(decide, "py_func", decide))
    wanted = list(inspect.signature(function).parameters)
    unknown = [argument for argument in wanted if argument not in _OF_A_WORLD]
    if unknown:
        raise ControllerError(f"{name}.decide wants {', '.join(unknown)}; accepted: {', '.join(_OF_A_WORLD)}")
    name = f"decide_worlds_of_{name}"
    source = _DECIDE_WORLDS.format(name=name, arguments=", ".join(_OF_A_WORLD[argument] for argument in wanted))
    scope: dict[str, Any] = {"__name__": function.__module__}
    # In the name of the planner's file, so that it is compiled anew when that file changes, and as a closure over
    # `decide`, so that two planners made by one function are not taken for each other.
    exec(compile(source, function.__code__.co_filename, "exec"), scope)
    decide_worlds: Callable[..., None] = kernel(scope["around"](decide))
    return decide_worlds


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
        lines = {id(p.line): p.line for p in planners if p.line is not None}
        ends = dict(zip(lines, np.cumsum([len(line) for line in lines.values()]).tolist(), strict=True))
        self._decide_worlds = planner_class.decide_worlds
        self._planners = np.zeros(len(planners), planner_class._record_type())
        for world, planner in enumerate(planners):
            self._planners[world] = planner.record[0]
            self._planners[world]["driver"]["paths"] = places.get(id(planner.paths), 0)
            if planner.line is not None:
                end = ends[id(planner.line)]
                self._planners[world]["line"] = end - len(planner.line), end
        self._paths = _joined(list(tables.values()), np.zeros(0, PATHS))
        self._lines = _joined(list(lines.values()), _NO_LINE)
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
            self._scan, _read_only(ranges), odometry, running, self._planners, self._memories, self._paths,
            self._lines, commands,
        )  # fmt: skip


def _joined(tables: list[NDArray[Any]], none: NDArray[Any]) -> NDArray[Any]:
    """Return the tables as one, read-only; a single one as it is, and `none` where there is none."""
    if len(tables) == 1:
        return _read_only(tables[0])
    return _read_only(np.concatenate(tables) if tables else none)


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return a view that cannot be written to: numba compiles for both kinds, and one is enough."""
    if not array.flags.writeable:
        return array
    view = array.view()
    view.flags.writeable = False
    return view
