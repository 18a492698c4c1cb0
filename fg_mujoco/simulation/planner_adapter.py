"""Between a simulation and a planner: what the car senses goes one way, what the planner commands the other.

Any planner can be told in messages. One that decides for many worlds at once is told in arrays, as in a batch of one:
the same decision, bit for bit, for that is the contract of `batch`, without the messages in between.
"""

from __future__ import annotations

import math

import numpy as np

from ..errors import ControllerError
from ..messages import ODOMETRY, Controller, ControllerBatch, DriveCommand, LaserScan, Odometry
from ..vehicle.motion import read_odometry
from .simulation import Simulation


class MessagePilot:
    """Calls a planner with a scan and odometry.

    Args:
      planner: to be asked.
      simulation: of the car.
      sensed: by the car now.
    """

    def __init__(self, planner: Controller, simulation: Simulation, sensed: tuple[LaserScan, Odometry]) -> None:
        self._planner, self._simulation, self._sensed = planner, simulation, sensed

    def decide(self) -> tuple[float, float]:
        """Return the planner's command for what was sensed last: steering angle [rad] and speed [m/s].

        Raises:
          ControllerError: it raises, or answers something else than a DriveCommand.
        """
        command = plan(self._planner, *self._sensed)
        return command.steering_angle, command.speed

    def sense(self) -> None:
        """Take in what the car senses now; call it once a tick."""
        self._sensed = self._simulation.sense()


class ArrayPilot:
    """Has a planner decide as a batch of one. The simulation's LiDAR must have no effects.

    Args:
      planner: a ControllerBatch for one world.
      simulation: of the car.
    """

    def __init__(self, planner: ControllerBatch, simulation: Simulation) -> None:
        self._planner, self._simulation = planner, simulation
        self._geometry = simulation.lidar.beams.geometry
        self._odometry = np.zeros(1, ODOMETRY)
        self._running = np.ones(1, np.bool_)
        self._commands = np.zeros((1, 2))
        self.sense()

    def decide(self) -> tuple[float, float]:
        """Return the planner's command for what was sensed last: steering angle [rad] and speed [m/s].

        Raises:
          ControllerError: a command that is no number.
        """
        self._planner(self._geometry, self._ranges, self._odometry, self._running, self._commands)
        steering_angle, speed = self._commands[0].tolist()
        if not math.isfinite(steering_angle + speed):
            time = self._simulation.time
            raise ControllerError(
                f"the controller commanded {steering_angle} rad, {speed} m/s at t = {time:.3f} s; accepted: numbers"
            )
        return steering_angle, speed

    def sense(self) -> None:
        """Take in what the car senses now; call it once a tick."""
        simulation = self._simulation
        data = simulation.data
        self._ranges = simulation.lidar.ranges(data)[np.newaxis]
        self._ranges.setflags(write=False)
        read_odometry(
            data.time, data.qpos, data.qvel, data.sensordata, simulation.world.car.constants, self._odometry
        )  # fmt: skip


def make_pilot(
    planner: Controller, simulation: Simulation, sensed: tuple[LaserScan, Odometry], *, by_name: bool
) -> MessagePilot | ArrayPilot:
    """Return the pilot for a planner, as new, that was found `by_name`, or is the caller's own object."""
    batch = getattr(type(planner), "batch", None) if by_name else None
    if batch is None or simulation.has_effects:
        return MessagePilot(planner, simulation, sensed)
    return ArrayPilot(batch([planner]), simulation)


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
