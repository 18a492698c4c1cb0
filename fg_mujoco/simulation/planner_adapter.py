"""Planner adapters: what the cars of an engine sense goes one way, what their planners command the other.

Any planner can be told in messages. One that decides for many worlds at once is told in arrays: the same decision, bit
for bit, for that is the contract of `batch`, without the messages in between.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import ControllerError
from ..lidar.beams import Beams
from ..messages import ODOMETRY, Controller, ControllerBatch, DriveCommand, FloatArray, LaserScan, Odometry
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
          ControllerError: a planner raises, or answers something else than a DriveCommand.
        """
        failed = np.zeros_like(cars.running)
        for row in map(int, np.flatnonzero(cars.running)):
            sensed = odometry_message(cars.odometry[row])
            scan = cars.scans.get(row) or cars.beams.to_scan(cars.ranges[row], sensed.stamp)
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
      raises: whether a command that is no number is raised, and not noted as a failure of its car.
    """

    def __init__(self, planners: ControllerBatch, *, raises: bool = False) -> None:
        self._planners, self._raises = planners, raises

    def __call__(self, cars: Cars) -> NDArray[np.bool_] | None:
        """See Planners.

        Raises:
          ControllerError: a command that is no number.
        """
        self._planners(cars.beams.geometry, cars.ranges, cars.odometry, cars.running, cars.commands)
        if np.isfinite(cars.commands).all():
            return None
        failed = not_finite(cars.running, cars.commands)
        if self._raises and failed.any():
            row = int(failed.argmax())
            steering_angle, speed = cars.commands[row].tolist()
            time = float(cars.odometry["stamp"][row])
            raise ControllerError(
                f"the controller commanded {steering_angle} rad, {speed} m/s at t = {time:.3f} s; accepted: numbers"
            )
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
    return BatchPlanners(batch(planners), raises=raises)


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
        raise ControllerError(f"controller {name} failed in reset(): {one_line(error)}") from error


def plan(controller: Controller, scan: LaserScan, odometry: Odometry) -> DriveCommand:
    """Return the controller's answer to a scan.

    Raises:
      ControllerError: it raises, or answers something else than a DriveCommand.
    """
    try:
        command = controller(scan, odometry)
    except (Exception, SystemExit) as error:
        name = type(controller).__name__
        raise ControllerError(f"controller {name} failed at t = {scan.stamp:.3f} s: {one_line(error)}") from error
    if not isinstance(command, DriveCommand):
        name = type(controller).__name__
        raise ControllerError(
            f"controller {name} answered {short(command)} at t = {scan.stamp:.3f} s; accepted: a DriveCommand"
        )
    return command


def one_line(error: BaseException) -> str:
    """Return the kind and the message of an error in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def short(value: object) -> str:
    """Return how Python writes a value, cut to 60 characters."""
    return short_text(repr(value))


def short_text(text: str) -> str:
    """Return a text in one line, cut to 60 characters."""
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."
