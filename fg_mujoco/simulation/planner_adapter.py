"""Planner adapters: what the cars of an engine sense goes one way, what their planners command the other.

Any planner can be told in messages. One that decides for many worlds at once is told in arrays: the same decision, bit
for bit, for that is the contract of `batch`, without the messages in between.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import ControllerError, PlannerError
from ..lidar.beams import Beams
from ..messages import ODOMETRY, Controller, ControllerBatch, DriveCommand, FloatArray, LaserScan, Odometry
from .planner_failure import failure_of, file_of, place, told, wrong_answer
from .tick import not_finite

_ODOMETRY = ODOMETRY.names or ()


class Cars(Protocol):
    """What planners want of an cars."""

    beams: Beams  # of the LiDARs
    odometry: NDArray[np.void]  # (r,) of ODOMETRY
    ranges: FloatArray  # (r, beams) [m]
    scans: dict[int, LaserScan]  # of the cars whose LiDAR has effects, by row
    commands: FloatArray  # (r, 2) [rad, m/s], written to

    @property
    def running(self) -> NDArray[np.bool_]:
        """Which cars race. Shape (r,)."""


class Planners(Protocol):
    """The planners of the cars of an cars."""

    def __call__(self, cars: Cars) -> NDArray[np.bool_] | None:
        """Write the commands of the cars that race; return whose planner failed, (r,), or None: nobody's."""


class MessagePlanners:
    """Planners that are called with messages, one after the other.

    Args:
      planners: in the order of the cars.
      raises: whether what a planner raises is raised, and not noted as a failure of its car.
    """

    def __init__(self, planners: Sequence[Controller], *, raises: bool = False) -> None:
        self._planners, self._raises = planners, raises

    def __call__(self, cars: Cars) -> NDArray[np.bool_] | None:
        """See Planners.

        Raises:
          PlannerError: a planner raises, or answers something else than a DriveCommand.
        """
        failed = np.zeros_like(cars.running)
        for row in map(int, np.flatnonzero(cars.running)):
            scan, sensed = _told(cars, row)
            try:
                command = plan(self._planners[row], scan, sensed)
            except ControllerError:
                if self._raises:
                    raise
                failed[row] = True
            else:
                cars.commands[row] = command.steering_angle, command.speed
        return failed


class BatchPlanners:
    """Planners of a class that decides for many worlds at once.

    Args:
      planners: in the order of the cars.
      kind: their class.
      raises: whether a command that is no number is raised, and not noted as a failure of its car.
    """

    def __init__(self, planners: ControllerBatch, kind: type, *, raises: bool = False) -> None:
        self._planners, self._kind, self._raises = planners, kind, raises

    def __call__(self, cars: Cars) -> NDArray[np.bool_] | None:
        """See Planners.

        Raises:
          PlannerError: the planners raise, or a command is no number.
        """
        try:
            self._planners(cars.beams.geometry, cars.ranges, cars.odometry, cars.running, cars.commands)
        except Exception as error:
            if not self._raises:
                raise
            raise _failed(error, self._kind, *_told(cars, int(cars.running.argmax()))) from error
        if np.isfinite(cars.commands).all():
            return None
        failed = not_finite(cars.running, cars.commands)
        if self._raises and failed.any():
            row = int(failed.argmax())
            steering_angle, speed = cars.commands[row].tolist()
            said = f"commanded {steering_angle} rad, {speed} m/s"
            raise _answered(said, "numbers", self._kind, *_told(cars, row))
        return failed


def adapt(planners: Sequence[Controller], *, arrays: bool = True, raises: bool = False) -> Planners:
    """Return the adapter for some planners, as new.

    Args:
      planners: in the order of the cars.
      arrays: whether planners that can decide together are told in arrays; False where a planner is the caller's own
        object, which may have been used before.
      raises: whether the failure of a planner is raised.
    """
    kind = type(planners[0])
    batch = getattr(kind, "batch", None) if arrays else None
    if batch is None or any(type(planner) is not kind for planner in planners):
        return MessagePlanners(planners, raises=raises)
    return BatchPlanners(batch(planners), kind, raises=raises)


def odometry_message(row: Any) -> Odometry:
    """Return the message of a row of ODOMETRY."""
    values: dict[str, Any] = {name: row[name] if row[name].ndim else float(row[name]) for name in _ODOMETRY}
    return Odometry(**values)


def start(controller: Controller) -> None:
    """Reset the controller for a new race.

    Raises:
      ControllerError: its `reset` raises.
    """
    try:
        controller.reset()
    except (Exception, SystemExit) as error:
        name = type(controller).__name__
        raise ControllerError(
            f"controller {name} failed in reset(): {told(error, file_of(type(controller)))}"
        ) from error


def plan(controller: Controller, scan: LaserScan, odometry: Odometry) -> DriveCommand:
    """Return the controller's answer to a scan.

    Raises:
      PlannerError: it raises, or answers something else than a DriveCommand.
    """
    try:
        command = controller(scan, odometry)
    except (Exception, SystemExit) as error:
        raise _failed(error, type(controller), scan, odometry) from error
    if not isinstance(command, DriveCommand):
        raise _answered(f"answered {short(command)}", "a DriveCommand", type(controller), scan, odometry)
    return command


def _told(cars: Cars, row: int) -> tuple[LaserScan, Odometry]:
    """Return what a car senses, as messages."""
    sensed = odometry_message(cars.odometry[row])
    return cars.scans.get(row) or cars.beams.to_scan(cars.ranges[row], sensed.stamp), sensed


def _failed(error: BaseException, kind: type, scan: LaserScan, odometry: Odometry) -> PlannerError:
    failure = failure_of(error, kind, scan, odometry)
    where = place(failure.file, failure.line)
    return PlannerError(
        f"controller {kind.__name__} failed at t = {scan.stamp:.3f} s: {failure.error}{where}", failure
    )  # fmt: skip


def _answered(said: str, accepted: str, kind: type, scan: LaserScan, odometry: Odometry) -> PlannerError:
    failure = wrong_answer(f"{said}; accepted: {accepted}", kind, scan, odometry)
    where = place(failure.file, failure.line)
    message = f"controller {kind.__name__} {said} at t = {scan.stamp:.3f} s{where}; accepted: {accepted}"
    return PlannerError(message, failure)


def short(value: object) -> str:
    """Return how Python writes a value, cut to 60 characters."""
    return short_text(repr(value))


def short_text(text: str) -> str:
    """Return a text in one line, cut to 60 characters."""
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."
