"""Base classes of planners: a function in, and out comes a planner that drives, alone or in a thousand worlds at once.

    class MyPlanner(GoalPlanner):
        Settings = MySettings  # of DrivingSettings

        @staticmethod
        def goal(geometry, ranges, car, settings, debug):
            debug.extended[:] = extend_disparities(ranges, geometry.angle_increment, 0.3, 0.5 * car.width)
            ...
            return bearing, distance

A `GoalPlanner` finds a goal in the scan. Steering to the goal, speed, safety and recovery are the same for all of
them (driving). A `Planner` whose reference is more than a goal in the scan has a function `reference` instead, which
also reads odometry, the planner's memory and a line through the map:

    def reference(geometry, ranges, odometry, car, settings, memory, line):
        return steering_angle, speed, bearing

The planners of many worlds are a batch, whose tick is a few native calls (planner_batch). A planner that is called
alone is a batch of one.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.arguments import Remade
from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.messages import (
    ODOMETRY,
    CarParameters,
    DriveCommand,
    FloatArray,
    LaserScan,
    Odometry,
    Reading,
    require,
    shown,
)

from ..perception.scan_filters import IntermediateScans, valid_ranges
from ..perception.scan_geometry import sees
from ..safety.braking_trajectories import BrakingTrajectories
from ..safety.friction_limiter import EVASIVE, FrictionLimiter, evasive
from ..safety.guidance import motion_ahead
from .driving import DrivingSettings, driver_record, refer, refer_to_goal
from .planner_batch import PlannerBatch
from .planner_settings import for_car, for_method, record_type, record_values
from .reasons import Reason
from .stages import ASSISTS, NO_MEMORY, STAGES, NativeStep, Stage, Step, Tick, names_in, stages_of

_motion_of = attrgetter(*ODOMETRY.names or ())


class Planner(Remade):
    """A planner that refers, and leaves the rest to its stages: a fg_mujoco.messages.Controller.

    A subclass names its `Settings` and has a function `reference`, which returns for one scan the reference steering
    angle [rad] (NaN: brake), the greatest speed [m/s], and the bearing [rad] that the car looks towards. Its
    arguments, whose fields are attributes:

    geometry   of the scan, fields of scan_geometry.SCAN_GEOMETRY
    ranges     (n,) [m], without NaN or inf; not all 0
    odometry   fields of messages.ODOMETRY
    car        fields of CarParameters
    settings   its `Settings`
    memory     fields of `memory_type`, kept from tick to tick, zero at the beginning
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
      assist: its stages, see control.stages, unless its settings name others.

    Attributes:
      settings: those of the planner; what they leave to the car is that of `car`, and what to the method its.
      driver: what driving reads of the planner, shape (1,), of type DRIVER.
      settings_row: the same of its settings, shape (1,), for planners in the native core.
      stages: its stages by name, in the order of their calls.
      driven_by: name of the stage that writes its command; empty: its reference is its command.

    Raises:
      SettingsError: a value that is not a positive number, settings of another planner, or an assist that it cannot
        have.
    """

    Settings: ClassVar[type[DrivingSettings]]
    source_laws: ClassVar[tuple[str, ...]] = ()  # names of the speed laws that its source has
    assists: ClassVar[Mapping[str, tuple[str, ...]]] = {}  # those of assist.ASSISTS that mean other stages for it
    memory_type: ClassVar[np.dtype[np.void]] = NO_MEMORY
    refer: Step  # writes the reference of a Tick, whose state is (settings, memory); made from `reference`
    hides_cars: ClassVar[bool] = False  # `refer` writes the scans without cars and without what moves, too

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
        assist: str = "full",
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
        self.assist = self.settings.assist or assist
        self.stages, sees_ahead = self._find_stages()
        self.settings = for_method(self.settings, given.method or ("refined" if sees_ahead else "source"))
        shares = evasive(EVASIVE, car, mu) if "sight" in self.stages and math.isfinite(mu) else None
        limiter = FrictionLimiter(car, mu, shares) if math.isfinite(mu) else None
        late = round(max(latency - car.command_delay, 0.0) / period)
        self.car, self.line = car, line
        self.settings_row = np.array([record_values(self.settings)], record_type(self.Settings))
        self.driver = driver_record(car, max_speed, limiter, self.settings_row, self.stages, late)
        self.trajectories: NDArray[np.void] | None = None
        if limiter is not None and "sight" in self.stages:
            self.trajectories = BrakingTrajectories(car, limiter, max_speed).record
        self.driven_by = next((name for name in reversed(self.stages) if self.stages[name].drive is not None), "")
        self._alone = PlannerBatch(type(self), [self])
        self._ranges, self._odometry = np.empty((1, 0)), np.zeros(1, ODOMETRY)
        self._running = np.ones(1, np.bool_)
        self._commands = np.zeros((1, 2))

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        foreign = cls._refers_of_other_records()
        if "reference" in vars(cls) or (foreign and hasattr(cls, "reference")):
            cls.refer = staticmethod(_refers_by(_own_function(cls, "reference", _REFERENCE)))
        elif foreign and not hasattr(cls, "goal"):
            said = f"{cls.__name__} has other Settings or another memory_type than its native `refer`"
            raise ControllerError(f"{said}; accepted: those of its base class, or its own `reference`")
        if "__call__" in vars(cls) and "batch" not in vars(cls):
            cls.batch = None  # type: ignore[assignment, method-assign]

    @classmethod
    def _refers_of_other_records(cls) -> bool:
        """Return whether its `refer` is a native one that reads records of other types than the class has."""
        owner = next((base for base in cls.__mro__ if "refer" in vars(base)), None)
        if owner is None or not isinstance(cls.refer, NativeStep):
            return False
        return (cls.Settings, cls.memory_type) != (owner.Settings, owner.memory_type)  # type: ignore[attr-defined]

    @classmethod
    def batch(cls, planners: Sequence[Planner]) -> PlannerBatch:
        """Return planners of this class, one for each world, as new: they are decided together."""
        return PlannerBatch(cls, planners)

    def own_stages(self) -> dict[str, Stage]:
        """Return stages that the planner has whatever its assist is, by name."""
        return {}

    def _find_stages(self) -> tuple[dict[str, Stage], bool]:
        """Return its stages by name, in the order of their calls, and whether its assist has sight.

        Raises:
          SettingsError: one that is not known, that lacks another, or that needs a friction limit and has none.
        """
        said = f"{type(self).__name__}: assist {self.assist!r}"
        try:
            names = stages_of(self.assist, self.source_laws, self.assists)
        except SettingsError as error:
            raise SettingsError(f"{type(self).__name__}: {error}") from error
        found: dict[str, Stage] = {name: cast(Stage, STAGES.find(name)) for name in names}
        if not math.isfinite(self.mu):
            chosen = [name for _, name in names_in(self.assist) if name in found and found[name].needs_friction]
            if chosen:
                accepted = "accepted: a friction that the planner assumes, or an assist without it"
                raise SettingsError(f"{said} has {chosen[0]}, which needs a friction limit, and mu is inf; {accepted}")
            found = {name: stage for name, stage in found.items() if not stage.needs_friction}
        for name, stage in found.items():
            lacking = [need for need in stage.needs if need not in found]
            if lacking:
                accepted = f"accepted: {self.assist}+{'+'.join(lacking)}"
                raise SettingsError(f"{said} has {name}, which needs {' and '.join(lacking)}; {accepted}")
        return self._checked_own_stages() | found, "sight" in names

    def _checked_own_stages(self) -> dict[str, Stage]:
        """Return what `own_stages` does.

        Raises:
          ControllerError: it is no dict of stages, or a name is that of another stage or of an assist.
        """
        own: Any = self.own_stages()
        said = f"{type(self).__name__}.own_stages() returned"
        accepted = "accepted: a dict of stages by names of letters, digits and _"
        if not isinstance(own, Mapping):
            raise ControllerError(f"{said} {shown(own)}; {accepted}")
        for name, stage in own.items():
            if not (isinstance(name, str) and name.isidentifier() and isinstance(stage, Stage)):
                raise ControllerError(f"{said} {shown(name)}: {shown(stage)}; {accepted}")
            if name in ASSISTS or (name in STAGES and STAGES.find(name) is not stage):
                raise ControllerError(f"{said} {name!r}, another name of `assist`; accepted: a name of its own")
        return dict(own)

    @staticmethod
    def read(memory: Any, readings: Mapping[str, Reading]) -> None:
        """Copy the sensor readings that the planner uses into its memory, before each decision.

        Its functions get no readings. Most planners use none.

        Args:
          memory: a row of `memory_type`, `memory["name"]`, written to.
          readings: by the names of the sensors; never none.
        """

    def reset(self) -> None:
        """Forget everything seen so far."""
        self._alone.reset()

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Return the command to hold until the next scan."""
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
        """Return the change that each step made to the last command, in order; none before the first command.

        What was proposed to the judge is among them, with what it would have met.
        """
        return self._alone.reasons(0)

    def motion(self) -> FloatArray:
        """Return the motion along which guidance led the car in the last decision; no points where the planner drove.

        Points are in the frame of the rear axle. Shape (m, 2) [m].
        """
        return motion_ahead(self._alone.memory[0]["guidance"])

    def stage_state(self, stage: str) -> Any:
        """Return the memory of a stage, by the stage's name.

        Raises:
          KeyError: the planner does not have this stage.
        """
        return self._alone.stage_states[stage][0]


class GoalPlanner(Planner):
    """A planner that drives to a goal that it finds in the scan.

    A subclass names its `Settings` and has a function `goal`, which returns the goal's bearing [rad] (NaN: there is
    none, and the car brakes) and its distance from the LiDAR [m]. Its arguments, whose fields are attributes:

    geometry   of the scan, fields of scan_geometry.SCAN_GEOMETRY
    ranges     (n,) [m], without NaN or inf; of two beams or more, and not all 0
    car        fields of CarParameters
    settings   its `Settings`
    debug      IntermediateScans, to be written to: for pictures, no command depends on them

    Arguments and errors are those of Planner.
    """

    source_laws: ClassVar[tuple[str, ...]] = ("mean_range", "distance_ahead")

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "refer" not in vars(cls) and ("goal" in vars(cls) or cls._refers_of_other_records()):
            cls.refer = staticmethod(_refers_to(_own_function(cls, "goal", _GOAL)))

    def find_goal(self, scan: LaserScan) -> tuple[float, float] | None:
        """Return the goal's bearing [rad] and its distance from the LiDAR [m]; None where there is none."""
        reference, _ = self._look(scan)
        bearing, distance = float(reference["bearing"]), float(reference["distance"])
        return None if math.isnan(bearing) else (bearing, distance)

    def intermediate_scans(self, scan: LaserScan) -> dict[str, FloatArray]:
        """Return the intermediate scans, see Planner."""
        _, debug = self._look(scan)
        made = {name: ranges for name, ranges in debug._asdict().items() if not np.isnan(ranges).all()}
        return super().intermediate_scans(scan) | made

    def _look(self, scan: LaserScan) -> tuple[Any, IntermediateScans]:
        """Return the reference at rest, a row of type REFERENCE, and the intermediate scans, NaN where not written."""
        batch = PlannerBatch(type(self), [self])
        batch.refer(scan, scan.ranges[np.newaxis], np.zeros(1, ODOMETRY), np.ones(1, np.bool_))
        return batch.references[0], IntermediateScans(*batch.debug)


_REFERENCE = ("geometry", "ranges", "odometry", "car", "settings", "memory", "line")
_GOAL = ("geometry", "ranges", "car", "settings", "debug")


def _own_function(cls: type, name: str, accepted: tuple[str, ...]) -> Callable[..., Any]:
    """Return the function that a planner's class has under a name.

    Raises:
      ControllerError: it does not take the accepted arguments.
    """
    function: Callable[..., Any] = getattr(cls, name)
    taken = tuple(inspect.signature(function).parameters)
    if taken != accepted:
        raise ControllerError(f"{cls.__name__}.{name} takes ({', '.join(taken)}); accepted: ({', '.join(accepted)})")
    return function


def _refers_to(goal: Callable[..., tuple[float, float]]) -> Callable[[Tick], None]:
    """Return the step that writes the reference to the goal that a function finds."""

    def refer_to(tick: Tick) -> None:
        bearing, distance = math.nan, 0.0
        if sees(tick.geometry, tick.ranges):
            tick.debug.filtered[:] = tick.ranges
            bearing, distance = goal(tick.geometry, tick.ranges, tick.driver.car, tick.state.settings, tick.debug)
        refer_to_goal(tick.record, tick.debug.filtered, bearing, distance)

    return refer_to


def _refers_by(reference: Callable[..., tuple[float, float, float]]) -> Callable[[Tick], None]:
    """Return the step that writes the reference that a function returns."""

    def refer_by(tick: Tick) -> None:
        steering_angle, speed, bearing = math.nan, 0.0, math.nan
        if sees(tick.geometry, tick.ranges):
            steering_angle, speed, bearing = reference(
                tick.geometry, tick.ranges, tick.odometry, tick.driver.car, tick.state.settings, tick.state.memory,
                tick.line,
            )  # fmt: skip
        refer(tick.record, tick.ranges, steering_angle, speed, bearing, math.nan)

    return refer_by
