"""Planner adapters: what the cars of an engine sense goes one way, what their planners command the other.

Any planner can be given messages. One that decides for many worlds at once is given arrays: the same decision, bit
for bit, for that is the contract of `batch`, without the messages in between.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..course.files import kept_folder
from ..errors import ControllerError, DecisionLimitReached, PlannerError, is_of_planner
from ..lidar.beams import Beams
from ..messages import (
    A_COMMAND,
    NO_READINGS,
    ODOMETRY,
    Controller,
    ControllerBatch,
    DriveCommand,
    FloatArray,
    LaserScan,
    Odometry,
    Reading,
)
from ..native_arrays import ArrayTable
from .termination import END_REASONS
from .world import World

_ODOMETRY = ODOMETRY.names or ()
_FAILED, _LATE = END_REASONS.index("planner_failed"), END_REASONS.index("decision_limit")

Reasons = NDArray[np.int64]
"""Why races end by their planners, (r,): a number in END_REASONS, 0 where the planner has answered."""

Calls = NDArray[np.int64]
"""Calls of compiled code that decide, (k, 2), see ControllerBatch."""

Decide = Callable[[], DriveCommand]


class Clock(Protocol):
    """Times decisions."""

    limit: float  # of a decision [s]; inf: none

    def time(self, decide: Callable[[], None]) -> None:
        """Call what decides, and note how long it took."""

    def note(self, seconds: float) -> None:
        """Note how long a decision took; raise where that is longer than the limit."""


class Keeper(Protocol):
    """Keeps ticks."""

    def append(self) -> None:
        """Keep the tick that was driven."""

    def room(self, ticks: int) -> ArrayTable:
        """Return a table of compiled_tick.KEPT with room for so many more ticks."""


@dataclass(frozen=True, kw_only=True)
class OtherCar:
    """The true pose of another car of the same world."""

    pose: tuple[float, float, float]  # x [m], y [m], heading [rad] of base_link in the map frame
    speed: float  # [m/s] along its heading, over ground
    yaw_rate: float  # [rad/s]


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """Knowledge beyond the car's sensors, for planners with `look_round`, called with this before each decision."""

    world: World
    pose: tuple[float, float, float]  # true x [m], y [m] and heading [rad] of its own rear axle
    others: tuple[OtherCar, ...]  # in the order of the cars of the world, without its own
    contact: bool = False  # whether the car has touched something in the last tick
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)  # the vertical, in the car's frame, which rolls and pitches


def up_of(turn: FloatArray) -> tuple[float, float, float]:
    """Return the world's z axis in the frame of a body whose orientation is a quaternion wxyz (4,)."""
    w, x, y, z = turn.tolist()
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


class Cars(Protocol):
    """The members of an engine that planners need."""

    beams: Beams  # of the LiDARs
    odometry: NDArray[np.void]  # (r,) of ODOMETRY
    ranges: FloatArray  # (r, beams) [m]
    commands: FloatArray  # (r, 2) [rad, m/s], written to

    @property
    def scans(self) -> dict[int, LaserScan]:
        """The scans of the cars whose LiDAR has effects, by row."""

    @property
    def running(self) -> NDArray[np.bool_]:
        """Which cars race. Shape (r,)."""

    def readings(self, row: int) -> Mapping[str, Reading]:
        """Return what the sensors of a car have delivered, by their names."""

    def surroundings(self, row: int) -> Surroundings:
        """Return the surroundings of a car."""


class Planners(Protocol):
    """The planners of some cars."""

    @property
    def failures(self) -> dict[int, PlannerError]:
        """The errors of the planners that failed, by row."""

    def __call__(self, cars: Cars) -> Reasons | None:
        """Write the commands of the cars that they drive; return whose planner failed, or None: nobody's."""


class DecisionStep(NamedTuple):
    """What one step made of a planner's command, as its `reasons()` tells it."""

    name: str
    steering_angle_rad: float | None  # after it; None: there is none
    speed_m_s: float | None
    text: str  # what the step does, or what a proposal would have met


def _steps_of(planners: object, *row: int) -> tuple[DecisionStep, ...]:
    """Return the steps that planners tell by a method `reasons`; none, if they do not, or in another form."""
    tell = getattr(planners, "reasons", None)
    try:
        return () if tell is None else tuple(_step(*told) for told in tell(*row))
    except BaseException as error:
        if not is_of_planner(error):
            raise
        return ()


def _step(name: str, steering_angle: float, speed: float, text: str = "", *_: object) -> DecisionStep:
    """Return a step of a decision, whose numbers are None where they are not finite."""
    angle, speed_m_s = (float(value) if math.isfinite(value) else None for value in (steering_angle, speed))
    return DecisionStep(str(name), angle, speed_m_s, str(text))


class MessagePlanners:
    """Planners that are called with messages in turn; an error is noted; `timed`, where it is given, decides."""

    def __init__(self, planners: Sequence[Controller], *, timed: Callable[[Decide], DriveCommand] | None) -> None:
        self._planners, self._timed = planners, timed
        self._asking = [hasattr(type(planner), "look_round") for planner in planners]
        self.failures: dict[int, PlannerError] = {}

    def last_decision(self, row: int) -> tuple[DecisionStep, ...]:
        """Return what each step made of a car's last command; none of a planner that does not say so."""
        return _steps_of(self._planners[row])

    def __call__(self, cars: Cars) -> Reasons | None:
        """See Planners; PlannerError: a planner raises, or answers something else than a DriveCommand."""
        reasons = np.zeros(len(cars.running), np.int64)
        for row in map(int, np.flatnonzero(cars.running)):
            scan, sensed = _scan_and_odometry(cars, row)
            if self._asking[row]:
                self._planners[row].look_round(cars.surroundings(row))  # type: ignore[attr-defined]
            decide = partial(plan, self._planners[row], scan, sensed)
            try:
                command = decide() if self._timed is None else self._timed(decide)
            except ControllerError as error:
                reasons[row] = _FAILED
                if isinstance(error, PlannerError):
                    error.__cause__ = error.__context__ = None  # their frames, and its own, hold the whole world
                    self.failures[row] = error.with_traceback(None)
            except DecisionLimitReached:
                if self._timed is None:  # it is the caller's
                    raise
                reasons[row] = _LATE
            else:
                cars.commands[row] = command.steering_angle, command.speed
        return reasons


class BatchPlanners:
    """Planners of a class that decides for many worlds at once."""

    def __init__(self, planners: ControllerBatch, kind: type) -> None:
        self._planners, self._kind = planners, kind
        self._take_readings = getattr(planners, "take_readings", None)
        self.failures: dict[int, PlannerError] = {}

    def __call__(self, cars: Cars) -> Reasons | None:
        """See Planners; PlannerError: it is not known whose failure it is."""
        try:
            if self._take_readings is not None:
                for row in np.flatnonzero(cars.running).tolist():
                    if readings := cars.readings(row):
                        self._take_readings(row, readings)
            self._planners(cars.beams.geometry, cars.ranges, cars.odometry, cars.running, cars.commands)
        except BaseException as error:
            if not is_of_planner(error):
                raise
            return self.failed(error, cars)
        return None if np.isfinite(cars.commands).all() else self.refused(cars)

    def last_decision(self, row: int) -> tuple[DecisionStep, ...]:
        """Return what each step made of a car's last command; none of planners that do not say so."""
        return _steps_of(self._planners, row)

    def compiled_calls(self, cars: Cars) -> Calls | None:
        """Return the calls that decide for these cars, see ControllerBatch; None: there are none."""
        calls = getattr(self._planners, "compiled_calls", None)
        if calls is None:
            return None
        try:
            found = calls(cars.beams.geometry, cars.ranges, cars.odometry, cars.running, cars.commands)
        except BaseException as error:
            if not is_of_planner(error):
                raise
            return None  # a call of the planners says why
        return found if isinstance(found, np.ndarray) and found.dtype == np.int64 and found.ndim == 2 else None

    def failed(self, error: BaseException, cars: Cars) -> Reasons:
        """Return the cars whose planner has failed, after the planners have raised; PlannerError: as a call does."""
        row = int(cars.running.argmax())
        failed_one = _failed(error, self._kind, *_scan_and_odometry(cars, row))
        if cars.running.sum() > 1:
            raise failed_one from error
        self.failures[row] = failed_one
        return np.where(cars.running, _FAILED, 0)

    def refused(self, cars: Cars) -> Reasons:
        """Return the cars whose planner has failed, after a command that is no number."""
        failed = cars.running & ~np.isfinite(cars.commands).all(axis=1)
        for row in map(int, np.flatnonzero(failed)):
            steering_angle, speed = cars.commands[row].tolist()
            said = f"commanded {steering_angle} rad, {speed} m/s"
            self.failures[row] = _answered(said, "numbers", self._kind, *_scan_and_odometry(cars, row))
        return np.where(failed, _FAILED, 0)


class PlannersOfEach:
    """Planners of cars that have different ones: each group, of rows (k,) and planners, is asked by itself."""

    def __init__(self, groups: Sequence[tuple[NDArray[np.int64], Planners]]) -> None:
        self._groups = [(rows, planners, _SomeCars()) for rows, planners in groups]

    @property
    def failures(self) -> dict[int, PlannerError]:
        """The errors of the planners that failed, by row."""
        return {int(rows[own]): error for rows, planners, _ in self._groups for own, error in planners.failures.items()}

    def __call__(self, cars: Cars) -> Reasons | None:
        """See Planners."""
        running = cars.running
        reasons: Reasons | None = None
        for rows, planners, part in self._groups:
            if not (running[rows[0]] if len(rows) == 1 else running[rows].any()):
                continue
            part.take(cars, rows)
            found = planners(part)
            part.give_back(cars, rows)
            if found is not None and found.any():
                reasons = np.zeros(len(running), np.int64) if reasons is None else reasons
                reasons[rows] = found
        return reasons


class _SomeCars:
    """Scans and odometry of some of an engine's cars, in row order: of one car views, of several copies."""

    def __init__(self) -> None:
        self._viewed: FloatArray | None = None

    def take(self, cars: Cars, rows: NDArray[np.int64]) -> None:
        self._whole, self._rows = cars, rows
        one = len(rows) == 1
        if not one or self._viewed is not cars.ranges:
            which: Any = slice(int(rows[0]), int(rows[0]) + 1) if one else rows
            self.beams, self.running = cars.beams, cars.running[which]
            self.odometry, self.ranges = cars.odometry[which], cars.ranges[which]
            self.commands = cars.commands[which]
            self._viewed = cars.ranges if one else None
        scans = cars.scans
        self.scans = {own: scans[row] for own, row in enumerate(rows.tolist()) if row in scans} if scans else {}

    def readings(self, row: int) -> Mapping[str, Reading]:
        """See Cars."""
        return self._whole.readings(int(self._rows[row]))

    def surroundings(self, row: int) -> Surroundings:
        """See Cars."""
        return self._whole.surroundings(int(self._rows[row]))

    def give_back(self, cars: Cars, rows: NDArray[np.int64]) -> None:
        if self._viewed is None:
            cars.commands[rows] = self.commands


def adapt(
    planners: Sequence[Controller],
    *,
    arrays: bool = True,
    timed: Callable[[Decide], DriveCommand] | None = None,
) -> MessagePlanners | BatchPlanners:
    """Return the adapter for some planners, as new, in the order of the cars.

    Args:
      arrays: whether planners that can decide together are given arrays; False where a planner is the caller's own
        object, which may have been used before.
      timed: as MessagePlanners takes it; planners then decide one after the other.

    Raises:
      ControllerError: their class's `batch` raises.
    """
    kind = type(planners[0])
    batch = getattr(kind, "batch", None) if arrays and timed is None and not wanted_sensors(kind) else None
    if batch is None or any(type(planner) is not kind for planner in planners):
        return MessagePlanners(planners, timed=timed)
    try:
        together = batch(planners)
    except BaseException as error:
        if not is_of_planner(error):
            raise
        from .planner_failure import failed_in

        raise ControllerError(failed_in("batch()", error, kind)) from error
    return BatchPlanners(together, kind)


def odometry_message(row: Any, readings: Mapping[str, Reading] = NO_READINGS) -> Odometry:
    """Return the message of a row of ODOMETRY, with the readings of the car's sensors."""
    values: dict[str, Any] = {name: row[name] if row[name].ndim else float(row[name]) for name in _ODOMETRY}
    return Odometry(**values, readings=readings)


def wanted_sensors(kind: type) -> tuple[str, ...]:
    """Return the sensors that planners of a class read, its attribute `sensors`; ControllerError: no names."""
    names = getattr(kind, "sensors", ())
    if not isinstance(names, (tuple, list)) or not all(isinstance(name, str) for name in names):
        said = f"controller {kind.__name__} has sensors = {short(names)}"
        raise ControllerError(f"{said}; accepted: the names of those that it reads, such as ('imu',)")
    return tuple(names)


@kept_folder()
def start(controller: Controller) -> None:
    """Reset the controller for a new race; ControllerError: its `reset` raises."""
    try:
        controller.reset()
    except BaseException as error:
        if not is_of_planner(error):
            raise
        from .planner_failure import failed_in

        raise ControllerError(failed_in("reset()", error, type(controller))) from error


def plan(controller: Controller, scan: LaserScan, odometry: Odometry) -> DriveCommand:
    """Return the controller's answer to a scan; PlannerError: it raises, or answers no DriveCommand."""
    values: tuple[Any, Any] | None = None
    try:
        answer = controller(scan, odometry)
        if issubclass(type(answer), DriveCommand):
            values = answer.steering_angle, answer.speed  # once: they may be worked out
    except BaseException as error:
        if not is_of_planner(error):
            raise
        raise _failed(error, type(controller), scan, odometry) from error
    if values is None:
        raise _answered(f"answered {short(answer)}", A_COMMAND, type(controller), scan, odometry)
    if type(answer) is DriveCommand and {*map(type, values)} == {float} and math.isfinite(sum(values)):
        return answer
    try:
        return DriveCommand(steering_angle=values[0], speed=values[1])
    except BaseException as error:
        if not is_of_planner(error):
            raise
        said = f"answered a DriveCommand of {short(values)}"
        raise _answered(said, "finite numbers", type(controller), scan, odometry) from error


def _scan_and_odometry(cars: Cars, row: int) -> tuple[LaserScan, Odometry]:
    """Return the scan and the odometry of a car, as messages."""
    sensed = odometry_message(cars.odometry[row], cars.readings(row))
    return cars.scans.get(row) or cars.beams.to_scan(cars.ranges[row], sensed.stamp), sensed


def _failed(error: BaseException, kind: type, scan: LaserScan, odometry: Odometry) -> PlannerError:
    from .planner_failure import failure_of, place

    failure = failure_of(error, kind, scan, odometry)
    where = place(failure.file, failure.line)
    return PlannerError(
        f"controller {kind.__name__} failed at t = {scan.stamp:.3f} s: {failure.error}{where}", failure
    )  # fmt: skip


def _answered(said: str, accepted: str, kind: type, scan: LaserScan, odometry: Odometry) -> PlannerError:
    from .planner_failure import failure_of, place

    failure = failure_of(f"{said}; accepted: {accepted}", kind, scan, odometry)
    where = place(failure.file, failure.line)
    message = f"controller {kind.__name__} {said} at t = {scan.stamp:.3f} s{where}; accepted: {accepted}"
    return PlannerError(message, failure)


def short(value: object) -> str:
    """Return the repr of a value, cut to 60 characters; where it has none, its class."""
    try:
        return short_text(str.__str__(repr(value)))
    except BaseException as error:
        return f"an object of {type(value).__name__} whose __repr__ raises {type(error).__name__}"


def short_text(text: str) -> str:
    """Return a text in one line, cut to 60 characters."""
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."
