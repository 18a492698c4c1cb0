"""Base classes of planners: a kernel in, and out comes a planner that drives, alone or in a thousand worlds at once.

    class MyPlanner(GoalPlanner):
        Settings = MySettings  # of DrivingSettings

        @staticmethod
        @kernel
        def goal(scan, ranges, car, settings, shown):
            keep(shown.extended, extend_disparities(ranges, scan.angle_increment, 0.3, 0.5 * car.width))
            ...
            return bearing, distance

A `GoalPlanner` finds a goal in the scan. Steering to the goal, speed, safety and recovery are the same for all of
them (driving). A `Planner` whose reference is more than a goal in the scan has a kernel `reference` instead, which
also reads odometry, the planner's memory and a line through the map:

    def reference(scan, ranges, odometry, car, settings, memory, line):
        return steering_angle, speed, bearing

A tick has two compiled calls for all worlds of a batch: one by the planner, from scans to references, and one that all
planners share, from references to commands. An engine makes both from within its own compiled call (ControllerBatch).
A planner that is called alone is a batch of one.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from operator import attrgetter
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.addons.drivers.friction_learning import levels
from fg_mujoco.addons.drivers.known_line import REMEMBERED
from fg_mujoco.arguments import Remade
from fg_mujoco.compiled.array_table import ArrayTable, flags, matrix, read_only, rows, table_at
from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.messages import (
    ODOMETRY,
    CarParameters,
    DriveCommand,
    FloatArray,
    LaserScan,
    Odometry,
    Reading,
    ScanGeometry,
    require,
)

from ..perception.intermediate_scans import IntermediateScans, keep
from ..perception.scan_filters import valid_ranges
from ..perception.scan_geometry import SCAN, scan_values, sees
from ..safety.braking_trajectories import TRAJECTORIES, BrakingTrajectories, trajectories_of
from ..safety.friction_limiter import FrictionLimiter, evasive
from ..safety.guidance import motion_ahead
from ..safety.predictions import foresee
from ..safety.safety_filter import EVASIVE
from .driving import (
    DRIVEN,
    DRIVING_MEMORY,
    DrivingSettings,
    drive_worlds,
    driver_record,
    refer,
    refer_to_goal,
)
from .planner_settings import for_car, record_type, record_values
from .reasons import Reason, reasons_in

_NO_MEMORY = np.dtype([("unused", np.int8)])
_NO_LINE = np.empty((0, 0))
_ALL = slice(None)
_motion_of = attrgetter(*ODOMETRY.names or ())


class Planner(Remade):
    """A planner whose decision is compiled: a fg_mujoco.messages.Controller.

    A subclass names its `Settings` and has a kernel `reference`, which returns for one scan the reference steering
    angle [rad] (NaN: brake), the greatest speed [m/s], and the bearing [rad] that the car looks towards. Its
    arguments:

    scan       of the geometry of the scan, of type scan_geometry.SCAN
    ranges     (n,) [m], without NaN or inf
    odometry   of type messages.ODOMETRY
    car        fields of CarParameters
    settings   fields of `Settings`
    memory     of `memory_type`, kept from tick to tick, zero at the beginning
    line       (points, columns) the line through the map that was given to `__init__`; no points without one

    A subclass of a planner that decides by a `__call__` of its own has no batch, unless it makes its own. A copy of a
    planner is a new one of the same arguments.

    Args:
      car: parameters of the car.
      mu: friction coefficient that the planner assumes; inf: no friction limits, and so no stopping in sight either.
      max_speed: fastest that it commands [m/s].
      settings: parameters of the planner; None: the defaults.
      latency: from measuring a scan to its command reaching the servos [s].
      period: from one scan to the next [s].
      line: through the map, one row a point, (points, columns); None: it has no map.

    Attributes:
      settings: those of the planner; what they leave to the car is that of `car`.
      driver: what the shared kernels read of the planner, shape (1,), of type DRIVER.
      settings_row: what its own kernel reads of its settings, shape (1,).

    Raises:
      SettingsError: a value that is not a positive number, or settings of another planner.
    """

    Settings: ClassVar[type[DrivingSettings]]
    memory_type: ClassVar[np.dtype[np.void]] = _NO_MEMORY
    refer_worlds: ClassVar[Callable[..., None]]  # from scans to references; made from the planner's kernel
    hides_cars: ClassVar[bool] = False  # of two scans that `refer_worlds` writes, guidance has the one without cars

    def __init__(
        self,
        car: CarParameters,
        mu: float,
        max_speed: float = 8.0,
        settings: Any = None,
        *,
        latency: float = 0.0,
        period: float = 0.025,
        line: FloatArray | None = None,
    ) -> None:
        self.mu = mu
        self.max_speed = max_speed
        given = self.Settings() if settings is None else settings
        require(self, lambda value: value > 0.0, "a positive number, or inf", ("mu",), SettingsError)
        require(self, lambda value: 0.0 < value < math.inf, "a positive number", ("max_speed",), SettingsError)
        if type(given) is not self.Settings:
            accepted = self.Settings.__name__
            raise SettingsError(f"{type(self).__name__}.settings is {given!r}; accepted: a {accepted}")
        self.settings: Any = for_car(given, car)
        evades = self.settings.speed_law == "minimum"
        learns = self.settings.learn and math.isfinite(mu)
        frictions = tuple(levels().tolist()) if learns else (mu,)
        shares = tuple(evasive(EVASIVE, car, each) if evades and math.isfinite(mu) else None for each in frictions)
        limiter = FrictionLimiter(car, frictions[0], shares[0]) if math.isfinite(mu) else None
        late = round(max(latency - car.command_delay, 0.0) / period)
        self.driver = driver_record(car, max_speed, limiter, self.settings, late)
        self.settings_row = np.array([record_values(self.settings)], record_type(self.Settings))
        self.line = line
        stops = limiter is not None and self.driver["stopping"][0]
        self.trajectories = (
            BrakingTrajectories(car, limiter, max_speed).record if limiter is not None and stops else None
        )
        if limiter is not None and learns:
            self.trajectories = trajectories_of(car, frictions, shares, max_speed)
        self._alone = PlannerBatch(type(self), [self])
        self._ranges, self._odometry = np.empty((1, 0)), np.zeros(1, ODOMETRY)
        self._running = np.ones(1, np.bool_)
        self._commands = np.zeros((1, 2))

    def __init_subclass__(cls) -> None:
        if "reference" in vars(cls):
            cls.refer_worlds = staticmethod(_references_of_worlds(_own_kernel(cls, "reference", _REFERENCE)))
        if "__call__" in vars(cls) and "batch" not in vars(cls):
            cls.batch = None  # type: ignore[assignment, method-assign]

    @classmethod
    def batch(cls, planners: Sequence[Planner]) -> PlannerBatch:
        """Return planners of this class, one for each world, as new: they are decided together."""
        return PlannerBatch(cls, planners)

    @staticmethod
    def read(memory: Any, readings: Mapping[str, Reading]) -> None:
        """Put what the planner uses of the readings of its car's sensors into its memory, before each decision.

        Its kernels get no readings. Most planners use none.

        Args:
          memory: of `memory_type`, written to.
          readings: by the names of the sensors; never none.
        """

    def reset(self) -> None:
        """Forget everything seen so far."""
        self._alone.reset()

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Answer the command to hold until the next scan."""
        self._odometry[0] = _motion_of(odometry)
        if self._ranges.shape[1] != len(scan.ranges):
            self._ranges = np.empty((1, len(scan.ranges)))
        self._ranges[0] = scan.ranges
        if odometry.readings:
            self._alone.take_readings(0, odometry.readings)
        self._alone(scan, self._ranges, self._odometry, self._running, self._commands)
        steering_angle, speed = self._commands[0].tolist()
        return DriveCommand(steering_angle=steering_angle, speed=speed)

    def intermediate_scans(self, scan: LaserScan) -> dict[str, FloatArray]:
        """Return the intermediate scans by name, in the order of the work: ranges (n,) [m] of all beams.

        "raw" is what was measured, without NaN and inf; the others are those of IntermediateScans that it has.
        """
        return {"raw": valid_ranges(scan.ranges, scan.range_max)}

    def reasons(self) -> list[Reason]:
        """Return the change that each step made to the last command, in order; none before the first command."""
        return reasons_in(self._alone.memory[0]["reasons"])

    def motion(self) -> FloatArray:
        """Return the motion along which guidance led the car in the last decision; no points where the planner drove.

        Points are in the frame of the rear axle. Shape (m, 2) [m].
        """
        return motion_ahead(self._alone.memory[0]["guidance"])

    def known_line(self) -> FloatArray:
        """Return the closed line through the ground of its first lap; no points where it has none.

        Points are in the frame in which the first lap began. Shape (n, 2) [m].
        """
        if not (len(self._alone.remembered) and self._alone.remembered[0]["line"]["ready"]):
            return np.empty((0, 2))
        line = self._alone.remembered[0]["line"]
        return np.array(line["points"][: line["count"], :2])


class GoalPlanner(Planner):
    """A planner that drives to a goal that it finds in the scan.

    A subclass names its `Settings` and has a kernel `goal`, which returns the goal's bearing [rad] (NaN: there is none,
    and the car brakes) and its distance from the LiDAR [m]. Its arguments:

    scan       of the geometry of the scan, of type scan_geometry.SCAN
    ranges     (n,) [m], without NaN or inf; of two beams or more, and not all 0
    car        fields of CarParameters
    settings   fields of `Settings`
    shown      IntermediateScans, to be written to

    Arguments and errors are those of Planner.
    """

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "goal" in vars(cls):
            cls.refer_worlds = staticmethod(_goals_of_worlds(_own_kernel(cls, "goal", _GOAL)))

    def find_goal(self, scan: LaserScan) -> tuple[float, float] | None:
        """Return the goal's bearing [rad] and its distance from the LiDAR [m]; None where there is none."""
        reference, _ = self._look(scan)
        bearing, distance = float(reference["bearing"]), float(reference["distance"])
        return None if math.isnan(bearing) else (bearing, distance)

    def intermediate_scans(self, scan: LaserScan) -> dict[str, FloatArray]:
        """Return the intermediate scans, see Planner."""
        _, shown = self._look(scan)
        made = {name: ranges for name, ranges in shown._asdict().items() if not np.isnan(ranges).all()}
        return super().intermediate_scans(scan) | made

    def _look(self, scan: LaserScan) -> tuple[Any, IntermediateScans]:
        """Return the reference at rest, a row of type REFERENCE, and the intermediate scans, NaN where not written."""
        batch = PlannerBatch(type(self), [self])
        batch.refer(scan, scan.ranges[np.newaxis], np.zeros(1, ODOMETRY), np.ones(1, np.bool_))
        return batch.references[0], IntermediateScans(*batch.shown)


_REFERENCE = ("scan", "ranges", "odometry", "car", "settings", "memory", "line")
_GOAL = ("scan", "ranges", "car", "settings", "shown")


def _own_kernel(cls: type, name: str, accepted: tuple[str, ...]) -> Callable[..., Any]:
    """Return the kernel that a planner's class has under a name; a plain function is compiled.

    Raises:
      ControllerError: it does not take the accepted arguments.
    """
    function = getattr(cls, name)
    taken = tuple(inspect.signature(inspect.unwrap(getattr(function, "py_func", function))).parameters)
    if taken != accepted:
        raise ControllerError(f"{cls.__name__}.{name} takes ({', '.join(taken)}); accepted: ({', '.join(accepted)})")
    own: Callable[..., Any] = function if hasattr(function, "py_func") else kernel(function)
    return own


def _goals_of_worlds(goal: Callable[..., tuple[float, float]]) -> Callable[..., None]:
    """Return the kernel that writes the references of all running worlds for their goals."""

    @kernel
    def refer_worlds(  # type: ignore[no-untyped-def]
        scan, ranges, odometry, running, own, driven, lines, valid, shown
    ):
        scans = IntermediateScans(shown[0], shown[1], shown[2], shown[3])
        for world in range(len(running)):
            if running[world]:
                keep(valid[world], valid_ranges(ranges[world], scan[0].range_max))
                driver, bearing, distance = driven[world].driver, math.nan, 0.0
                clear, predictions = valid[len(valid) - len(running) + world], driven[world].memory.predictions
                foresee(scan[0], valid[world], clear, odometry[world], driver, predictions)
                if sees(scan[0], valid[world]):
                    keep(scans.filtered, valid[world])
                    bearing, distance = goal(scan[0], valid[world], driver.car, own[world].settings, scans)
                reference = driven[world].reference
                refer_to_goal(scan[0], scans.filtered, odometry[world], driver, bearing, distance, reference)

    made: Callable[..., None] = refer_worlds
    return made


def _references_of_worlds(reference: Callable[..., tuple[float, float, float]]) -> Callable[..., None]:
    """Return the kernel that writes the references of all running worlds."""

    @kernel
    def refer_worlds(  # type: ignore[no-untyped-def]
        scan, ranges, odometry, running, own, driven, lines, valid, shown
    ):
        for world in range(len(running)):
            if running[world]:
                keep(valid[world], valid_ranges(ranges[world], scan[0].range_max))
                driver, planner = driven[world].driver, own[world]
                steering_angle, speed, bearing = math.nan, 0.0, math.nan
                clear, predictions = valid[len(valid) - len(running) + world], driven[world].memory.predictions
                foresee(scan[0], valid[world], clear, odometry[world], driver, predictions)
                if sees(scan[0], valid[world]):
                    line = lines[driver.line_first : driver.line_end]
                    steering_angle, speed, bearing = reference(
                        scan[0], valid[world], odometry[world], driver.car, planner.settings, planner.memory, line
                    )
                reference_row = driven[world].reference
                refer(scan[0], valid[world], driver, steering_angle, speed, bearing, math.nan, reference_row)

    made: Callable[..., None] = refer_worlds
    return made


_ARRAYS = (
    "scan", "ranges", "odometry", "running", "own", "driven", "lines", "trajectories", "remembered", "valid", "guiding",
    "shown", "commands",
)  # fmt: skip
_COUNT = len(_ARRAYS)
(
    _SCAN, _RANGES, _ODOMETRY, _RUNNING, _OWN, _DRIVEN, _LINES, _TRAJECTORIES, _REMEMBERED, _VALID, _GUIDING, _SHOWN,
    _COMMANDS,
) = range(_COUNT)  # fmt: skip


@cache
def _refer_at(refer_worlds: Callable[..., None], own: np.dtype[np.void]) -> Callable[[int], None]:
    """Return the kernel that calls `refer_worlds` with the arrays of the table at an address.

    Args:
      refer_worlds: of a planner's class.
      own: type of what it reads and keeps of each world.
    """

    @kernel
    def refer_at(address):  # type: ignore[no-untyped-def]
        table = table_at(address, _COUNT)
        refer_worlds(
            rows(table[_SCAN], SCAN), read_only(matrix(table[_RANGES])), rows(table[_ODOMETRY], ODOMETRY),
            flags(table[_RUNNING]), rows(table[_OWN], own), rows(table[_DRIVEN], DRIVEN),
            read_only(matrix(table[_LINES])), matrix(table[_VALID]), matrix(table[_SHOWN]),
        )  # fmt: skip

    made: Callable[[int], None] = refer_at
    return made


@kernel
def _drive_at(address: int) -> None:
    """Call `drive_worlds` with the arrays of a table at an address."""
    table = table_at(address, _COUNT)
    drive_worlds(
        rows(table[_SCAN], SCAN), matrix(table[_VALID]), matrix(table[_GUIDING]), rows(table[_ODOMETRY], ODOMETRY),
        flags(table[_RUNNING]), rows(table[_DRIVEN], DRIVEN), read_only(rows(table[_TRAJECTORIES], TRAJECTORIES)),
        rows(table[_REMEMBERED], REMEMBERED), matrix(table[_COMMANDS]),
    )  # fmt: skip


class PlannerBatch:
    """Planners of one class, one for each world: a fg_mujoco.messages.ControllerBatch.

    One batch is for one thread at a time; others may decide at the same time.

    Args:
      planner_class: of the planners.
      planners: in the order of their worlds; they lend their settings and keep their memory to themselves.

    Attributes:
      references: of the last tick, (n,) of type REFERENCE.
      memory: what driving keeps from tick to tick, (n,) of type DRIVING_MEMORY.
      remembered: what it keeps of the first lap, (n,) of type REMEMBERED; (0,) where no planner remembers.
      shown: intermediate scans of the last world that was decided, (4, beams) [m], in the order of IntermediateScans.

    Raises:
      ControllerError: a planner of another class.
    """

    def __init__(self, planner_class: type[Planner], planners: Sequence[Planner]) -> None:
        for planner in planners:
            if type(planner) is not planner_class:
                raise ControllerError(
                    f"a batch of {planner_class.__name__} was given a {type(planner).__name__}; accepted: its own class"
                )
        count, self._read = len(planners), planner_class.read
        tables = {id(p.trajectories): p.trajectories for p in planners if p.trajectories is not None}
        ends_of_tables = np.cumsum([len(table) for table in tables.values()]).tolist()
        places = {table: end - len(tables[table]) for table, end in zip(tables, ends_of_tables, strict=True)}
        lines = {id(p.line): p.line for p in planners if p.line is not None}
        ends = dict(zip(lines, np.cumsum([len(line) for line in lines.values()]).tolist(), strict=True))
        self._guided = 1 if planner_class.hides_cars else 0  # which of the scans guidance has; the last is `clear`
        self._driven = np.zeros(count, DRIVEN)
        own = [("settings", record_type(planner_class.Settings)), ("memory", planner_class.memory_type)]
        self._own = np.zeros(count, np.dtype(own))
        self._refer_at = _refer_at(planner_class.refer_worlds, self._own.dtype)
        for world, planner in enumerate(planners):
            self._driven["driver"][world], self._own["settings"][world] = planner.driver[0], planner.settings_row[0]
            driver = self._driven["driver"][world]
            driver["trajectories"] = places.get(id(planner.trajectories), 0)
            if planner.line is not None:
                end = ends[id(planner.line)]
                driver["line_first"], driver["line_end"] = end - len(planner.line), end
        remembers = bool(self._driven["driver"]["remembers"].any())
        self.remembered = np.zeros(count if remembers else 0, REMEMBERED)
        self._trajectories = _joined(list(tables.values()), np.zeros(0, TRAJECTORIES))
        self._lines = _joined(list(lines.values()), _NO_LINE)
        self._geometry, self._given = cast(Any, None), cast(tuple[Any, ...], ())
        self._table = ArrayTable(_ARRAYS, {})
        self._lent: list[ArrayTable] = []
        self._arrays: dict[str, Any] = {
            "scan": np.zeros(1, SCAN), "own": self._own, "driven": self._driven, "lines": self._lines,
            "trajectories": self._trajectories, "remembered": self.remembered,
        }  # fmt: skip
        self.shown = np.empty((len(IntermediateScans._fields), 0))
        self.references, self.memory = self._driven["reference"], self._driven["memory"]

    def reset(self, which: NDArray[np.bool_] | slice = _ALL) -> None:
        """Forget everything seen so far, in all worlds or in those `which` (n,)."""
        self._own["memory"][which] = np.zeros((), self._own.dtype["memory"])
        self._driven["memory"][which] = np.zeros((), DRIVING_MEMORY)
        if len(self.remembered):
            self.remembered[which] = np.zeros((), REMEMBERED)

    def __call__(
        self,
        geometry: ScanGeometry | LaserScan,
        ranges: FloatArray,
        odometry: NDArray[np.void],
        running: NDArray[np.bool_],
        commands: FloatArray,
    ) -> None:
        """Write the command of each running world into `commands`; see ControllerBatch."""
        written = np.ascontiguousarray(commands, np.float64)
        self._take(geometry, ranges, odometry, running, written)
        self._refer_at(self._table.address)
        _drive_at(self._table.address)
        if written is not commands:
            commands[:] = written

    def take_readings(self, world: int, readings: Mapping[str, Reading]) -> None:
        """Take the readings of the sensors of a world's car; see ControllerBatch."""
        self._read(self._own["memory"][world], readings)

    def refer(
        self,
        geometry: ScanGeometry | LaserScan,
        ranges: FloatArray,
        odometry: NDArray[np.void],
        running: NDArray[np.bool_],
    ) -> None:
        """Write the reference of each running world into `references`; arguments as of a call."""
        self._take(geometry, ranges, odometry, running, np.empty((len(running), 2)))
        self._refer_at(self._table.address)

    def compiled_calls(
        self,
        geometry: ScanGeometry | LaserScan,
        ranges: FloatArray,
        odometry: NDArray[np.void],
        running: NDArray[np.bool_],
        commands: FloatArray,
    ) -> NDArray[np.int64]:
        """Return the kernel's function that replaces this, see ControllerBatch."""
        self._take(geometry, ranges, odometry, running, commands)
        table, self._given = self._table, ()  # from now on nobody puts anything else into this table
        self._arrays["scan"] = self._arrays["scan"].copy()
        self._lent.append(table)
        kernels: tuple[Any, ...] = self._refer_at, _drive_at
        return np.array([(each.address(table.address), table.address) for each in kernels], np.int64)

    def _take(
        self,
        geometry: ScanGeometry | LaserScan,
        ranges: FloatArray,
        odometry: NDArray[np.void],
        running: NDArray[np.bool_],
        commands: FloatArray,
    ) -> None:
        """Put what a call is given into the table of all arrays, where it is not what the last one was given."""
        if geometry is not self._geometry:  # neither a scan nor a geometry changes
            self._arrays["scan"][0], self._geometry = scan_values(geometry), geometry
        ranges, running = np.ascontiguousarray(ranges, np.float64), np.ascontiguousarray(running, np.bool_)
        odometry, given = np.ascontiguousarray(odometry, ODOMETRY), self._given
        if given and given[0] is ranges and given[1] is odometry and given[2] is running and given[3] is commands:
            return
        beams = ranges.shape[1]
        if "valid" not in self._arrays or beams != self.shown.shape[1]:
            count = len(running)
            valid = np.empty(((2 + self._guided) * count, beams))
            guiding = valid[self._guided * count : (1 + self._guided) * count]
            self.shown = np.full((len(self.shown), beams), math.nan)
            self._arrays |= {"valid": valid, "guiding": guiding, "shown": self.shown}
            given = ()
        new = {"ranges": ranges, "odometry": odometry, "running": running, "commands": commands}
        self._arrays |= new
        if given:
            for name, array in new.items():
                self._table.put(name, array)
        else:
            self._table = ArrayTable(_ARRAYS, self._arrays)
        self._given = ranges, odometry, running, commands


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
