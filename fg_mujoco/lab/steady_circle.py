"""A car held on a circle: constant steering, and the speed brought slowly to k times the law's.

The state settles at each k: it is reached from the nearest slower one that was settled before, gaining 6 % of mu g of
speed at most. A slow ramp of the speed without settling is up to 12 % off: its acceleration moves load to the rear
axle, and a car that is about to spin takes its time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.controllers.control.speed import friction_speed

from ..course.ground import Ground
from ..errors import SettingsError
from ..messages import DriveCommand, FloatArray, Odometry
from ..vehicle.car import WHEELS
from ..vehicle.changes import CarChanges
from ..vehicle.tires import Tires
from ..vehicle.vehicle import DEFAULT_VEHICLE, Vehicle
from .lab_ground import LabGround, Trace, join

PERIOD = 0.02
"""[s] Of the control of the speed: whole steps of 0.25 to 5 ms."""

_GAIN = 3.0  # [1/s] of the command's rate, per missing speed: slower than the speed servo, so that it does not swing
_GENTLE = 0.06  # of mu g, for gaining speed: sqrt(1 - .06^2) of the grip is left
_SETTLING = 0.5  # [s] after the speed is there: several times what yaw (.1 s) and springs (.2 s) take
_WINDOW = 0.3  # [s] that is measured on level ground
_STEADY, _WINDOWS = 3e-4, 60  # change of speed and yaw rate from one window to the next; and how many
_SLIDES_ON = 3  # windows in which a tire slides, after which it does so for good
_AT_ONCE = 0.1  # [s] between a wheel that slides and one that lifts for the same reason
_START = 0.8  # of the law's speed
_STRIDE = 0.1  # of the law's speed, upwards to where a bisection begins
_SHORT = 0.02  # of the law's speed, by which a car may fall behind what was asked for
_UPRIGHT = 0.9  # cosine of the car's lean, below which it is falling over


class UnreachableError(Exception):
    """A speed that the car does not reach on the circle; the text is the reason for a table."""


class NeverError(UnreachableError):
    """Nothing happens up to the greatest speed that is looked at."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CircleReading:
    """A settled car on a circle: means over the last 0.3 s, where nothing else is said."""

    asked: float  # [-] k that was asked for
    k: float  # [-] speed of the rear axle over the law's
    speed: float  # [m/s]
    curvature: float  # [-] of the rear axle's path, over that of the steering angle, tan(d) / b
    sliding: NDArray[np.bool_]  # (4,) whether each tire slides, as `TireSlip.slides` says, at any time
    first_tire: str  # name of the one that slid first on the way here and in it; "": none
    lost: bool  # whether tires slid, and the car did not keep its speed
    acceleration: float  # [m/s^2] of the centre of gravity along the ground
    lifts: bool  # whether a wheel leaves the ground; of a car that is lost, before a tire slides
    odometry: Odometry  # at the end


class SteadyCircle:
    """A car on a circle, for any k, on its `ground`; `law` is the law's speed at this mu and steering [m/s].

    Args:
      mu: friction coefficient of the tires [-]; of those with a curve the least peak, which planners are told.
      steering: angle [rad], left positive.
      timestep: of the physics [s]; None: at which the tires are right when they slide.
      tires: that the car stands on; None: its own.
      surface: of the ground, see LabGround.

    Raises:
      SettingsError: a friction coefficient that the lab does not accept, no steering, or more than the car's lock.
    """

    def __init__(
        self,
        mu: float,
        steering: float,
        timestep: float | None = None,
        tires: Tires | None = None,
        vehicle: str | Vehicle = DEFAULT_VEHICLE,
        changes: CarChanges | None = None,
        surface: Ground | None = None,
    ) -> None:
        self.tires = tires or Vehicle.load(vehicle).tires
        self.ground = LabGround(greatest_peak(self.tires, mu), timestep, self.tires, vehicle, changes, surface)
        self.car = self.ground.car.parameters
        self.mu, self.steering = mu, steering
        lock = self.car.max_steering_angle
        if not 0.0 < abs(steering) <= lock:
            raise SettingsError(
                f"steering is {steering!r} rad; accepted: a number other than 0, at which the law's speed is infinite, "
                f"and up to the car's lock, {lock:g} rad, to either side"
            )
        self.law = friction_speed(steering, mu, self.car.wheelbase, self.car.gravity)
        self._settled: dict[float, tuple[FloatArray, float, CircleReading]] = {}  # by k: state, command, reading

    def at(self, k: float) -> CircleReading:
        """Return how the car runs at `k` times the law's speed; UnreachableError: it never gets there."""
        if k not in self._settled:
            self._settle(k)
        return self._settled[k][2]

    @property
    def readings(self) -> list[CircleReading]:
        """All readings so far, in the order of their speeds."""
        return [self._settled[k][2] for k in sorted(self._settled)]

    def bisect(
        self, happens: Callable[[CircleReading], bool], *, low: float = 0.85, high: float = 1.3, width: float = 0.002
    ) -> tuple[CircleReading, CircleReading]:
        """Return the last reading before something `happens` and the first after, no farther than `width` apart in k.

        From `low` it goes up in steps. UnreachableError: it happens at `low`, or not up to `high`, or k is not reached.
        """
        if happens(self.at(low)):
            raise UnreachableError(f"it happens at {low:g} of the law's speed already")
        upper = low
        while not happens(self.at(upper)):
            if upper >= high:
                raise NeverError(f"it does not happen up to {high:g} of the law's speed")
            low, upper = upper, min(upper + _STRIDE, high)
        while upper - low > width:
            middle = 0.5 * (low + upper)
            low, upper = (low, middle) if happens(self.at(middle)) else (middle, upper)
        return self.at(low), self.at(upper)

    def _settle(self, k: float) -> None:
        target = k * self.law
        if target > self.car.max_speed:
            raise UnreachableError(f"{target:.1f} m/s is above the car's greatest speed, {self.car.max_speed:g} m/s")
        slower = [settled for settled in self._settled if settled < k]
        if slower:
            state, command, _ = self._settled[max(slower)]
            self.ground.state = state
            gained = (k - max(slower)) * self.law
        else:
            command = min(_START, 0.9 * k) * self.law
            self._place(command)
            gained = target - command
        ramp = gained / (_GENTLE * self.mu * self.car.gravity)
        traces: list[Trace] = []
        window = self._window(target)
        for _ in range(round((ramp + _SETTLING + window) / PERIOD)):
            command = self._next_command(command, target)
            traces.append(self.ground.hold(self._drive(command), PERIOD))
        slid = 0
        for _ in range(_WINDOWS):
            last = join(traces[-2 * round(window / PERIOD) :])
            slid = slid + 1 if last.last(window).slip.slides.any() else 0
            if slid >= _SLIDES_ON or (not slid and self._steady(last, target)):
                break
            for _ in range(round(window / PERIOD)):
                command = self._next_command(command, target)
                traces.append(self.ground.hold(self._drive(command), PERIOD))
        reading = self._read(join(traces), k)
        if reading.k < k - _SHORT and not reading.lost:
            raise UnreachableError(f"the motor gives no more at {reading.speed:.2f} m/s; {target:.2f} were asked for")
        self._settled[k] = self.ground.state, command, reading

    def _place(self, speed: float) -> None:
        self.ground.place(speed)

    def _window(self, speed: float) -> float:
        """Return for how long a car at a speed [m/s] is measured [s]."""
        return _WINDOW

    def _drive(self, command: float) -> DriveCommand:
        turned_in = min(1.0, self.ground.data.time / 0.5)
        return DriveCommand(steering_angle=self.steering * turned_in, speed=command)

    def _next_command(self, command: float, target: float) -> float:
        """Return the set point [m/s] that brings the rear axle gently to `target` [m/s], by integration."""
        data = self.ground.data
        if 1.0 - 2.0 * (data.qpos[4] ** 2 + data.qpos[5] ** 2) < _UPRIGHT:
            raise UnreachableError("the car tips over first")
        gentle = _GENTLE * self.mu * self.car.gravity
        rate = _GAIN * (target - math.hypot(data.qvel[0], data.qvel[1]))
        return command + PERIOD * max(-gentle, min(gentle, rate))

    @staticmethod
    def _lifts(trace: Trace, lost: bool) -> bool:
        """Return whether a wheel leaves the ground; of a car that is lost whether it does so before a tire slides."""
        airborne, sliding = np.isnan(trace.slip.normal_force).any(axis=1), trace.slip.slides.any(axis=1)
        soon = round(_AT_ONCE / trace.timestep)  # a wheel spins at once when it carries next to nothing
        return bool(airborne.any()) and (not lost or int(airborne.argmax()) <= int(sliding.argmax()) + soon)

    def _steady(self, trace: Trace, target: float) -> bool:
        """Return whether the car runs steadily: near the speed at which it would spin it leaves its circle slowly."""
        half = len(trace.records) // 2
        before, last = trace[:half], trace[half:]
        moved = abs(float(last.yaw_rate.mean()) / float(before.yaw_rate.mean()) - 1.0)
        return moved < _STEADY and abs(float(last.speed.mean()) / target - 1.0) < _STEADY

    def _read(self, whole: Trace, k: float) -> CircleReading:
        trace = whole.last(self._window(k * self.law))
        slip, speed, sliding = trace.slip, float(trace.speed.mean()), whole.slip.slides
        lost = speed < (k - _SHORT) * self.law and bool(sliding.any())
        first = np.argwhere(sliding)
        return CircleReading(
            asked=k,
            k=speed / self.law,
            speed=speed,
            curvature=float(trace.yaw_rate.mean()) / speed * self.car.wheelbase / math.tan(self.steering),
            sliding=np.asarray((sliding if lost else slip.slides).any(axis=0)),
            first_tire=WHEELS[first[0, 1]] if len(first) else "",
            lost=lost,
            acceleration=float(np.hypot(*trace.acceleration.T).mean()),
            lifts=self._lifts(whole if lost else trace, lost),
            odometry=self.ground.car.odometry(self.ground.data),
        )


def greatest_peak(tires: Tires, mu: float) -> float:
    """Return the greatest peak that gives tires the least peak `mu` [-]."""
    return mu / tires.least_share
