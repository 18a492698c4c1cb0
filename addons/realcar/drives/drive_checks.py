"""Compares the sensors of a drive with each other: clock, gyro, delays, and where the steering is straight.

The poses are taken to be true, as they are measured against the surroundings. Over windows of WINDOW seconds

    path along the car (poses)   = clock scale * integral of the speed over the recorded time, the speed's delay later
    change of heading (poses)    = clock scale * gyro scale * integral of the yaw rate, the gyro's delay later

and over those rows in which the car goes nearly straight

    steering = offset + slope * yaw rate / speed

and over those in which it corners gently, to both sides

    direction of the path - heading = offset + a * lateral acceleration + b * curvature

of which the tires' slip is the second term, and a pose that is not the rear axle's the third. A wrong clock and a wrong
scale of the speed look the same in one drive: the clock is blamed, because it moves the gyro by as much.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.messages import FloatArray

from .channels import Channel

WINDOW = 0.6
"""[s] of the windows in which poses, speed and yaw rate are compared."""

_SLOWEST = 0.5  # [m/s] below which a window says nothing of the clock
_JUMP = 0.3  # [m] from a pose to the next beyond what the speed gives
_TURN_JUMP = 0.5  # [rad] likewise
_LATEST = 0.3  # [s] that a sensor may be late
_DELAYS = np.arange(-_LATEST, _LATEST + 1e-9, 0.01)
_FEWEST = 5  # windows
_MOST = 8192  # windows, or rows of a fit
_SEEN = 0.8  # of the residuals at delays of _FAR more or less: those at the delay, at most, if the drive says it
_FAR = 0.1  # [s]
_STRAIGHT = 0.35  # [1/m] greatest curvature of rows that tell the straight steering
_GENTLE = 3.0  # [m/s^2] greatest lateral acceleration of them
_ROBUST = 2.5  # times the median of the absolute residuals, beyond which a window is left out
_TOLD = 0.02  # [-] of a scale that is off by as much and by three standard errors
Rows = NDArray[np.int64]

_LIKELY = 1.5  # standard errors of a heading's offset that is corrected
_CHORD = 0.2  # [s] over which the direction of the path is measured
_TOLD_DELAY, _TOLD_OFFSET, _TOLD_BIAS = 0.02, 0.01, 0.02  # [s], [rad], [rad/s]


@dataclass(frozen=True, kw_only=True)
class Found:
    """A value that was found, and its standard error; NaN: the drive does not say it."""

    value: float = math.nan
    error: float = math.nan

    def __bool__(self) -> bool:
        return math.isfinite(self.value)

    def __str__(self) -> str:
        return f"{self.value:.3f} +- {self.error:.3f}" if self else "not seen"


@dataclass(frozen=True, kw_only=True)
class DriveChecks:
    """What the sensors of a drive say of each other, before any of it was used."""

    clock_scale: Found = Found()  # [-] true time for each recorded second
    gyro_scale: Found = Found()  # [-] true yaw rate for each one that was recorded
    gyro_bias: Found = Found()  # [rad/s] that the gyro says of a car that stands
    speed_delay: Found = Found()  # [s] of the speed after the poses
    yaw_rate_delay: Found = Found()  # [s] of the yaw rate after the poses
    steering_offset: Found = Found()  # [rad] of the steering at which the car goes straight
    steering_delay: Found = Found()  # [s] from the steering to the curvature, the gyro's delay included
    steering_slope: Found = Found()  # [m] steering for each 1/m of curvature: wheelbase over the steering's gain
    heading_offset: Found = Found()  # [rad] of where a car goes that goes straight, from the heading of the poses
    pose_jumps: int = 0  # of the position or the heading, from a row to the next
    gaps: int = 0  # times without a row for five periods
    period: float = math.nan  # [s] median of the recorded one
    used: tuple[str, ...] = ()  # names of the above that the drive was corrected by

    @property
    def turned_poses(self) -> float:
        """The angle that the heading of the poses is corrected by [rad]; 0 where the drive does not tell one."""
        found = self.heading_offset
        told = bool(found) and abs(found.value) > max(_TOLD_OFFSET, _LIKELY * found.error)
        return found.value if told else 0.0

    @property
    def lines(self) -> list[str]:
        """What is wrong, a sentence each; empty: nothing was found."""
        said = []
        for name, what, how in (
            ("clock_scale", "the clock", "of the path that the poses say, over that of the speed"),
            ("gyro_scale", "the gyro", "of the turn that the poses say, over that of the gyro"),
        ):
            found: Found = getattr(self, name)
            if found and abs(found.value - 1.0) > max(_TOLD, 3.0 * found.error):
                percent = 100.0 * (1.0 / found.value - 1.0)
                says = f"{abs(percent):.1f} % too {'much' if percent > 0.0 else 'little'}"
                said.append(f"{what} says {says}: {name} {found}, {how}{self._used(name)}")
        for name, what in (("speed_delay", "the speed"), ("yaw_rate_delay", "the yaw rate")):
            found = getattr(self, name)
            if found and abs(found.value) > max(_TOLD_DELAY, 3.0 * found.error):
                when = "late" if found.value > 0.0 else "early"
                said.append(f"{what} is {abs(found.value):.3f} s {when}, against the poses{self._used(name)}")
        if self.steering_offset and abs(self.steering_offset.value) > max(
            _TOLD_OFFSET, 3.0 * self.steering_offset.error
        ):
            said.append(
                f"the car goes straight at a steering of {self.steering_offset} rad{self._used('steering_offset')}"
            )
        if self.heading_offset and abs(self.heading_offset.value) > max(_TOLD_OFFSET, 3.0 * self.heading_offset.error):
            said.append(f"the car goes straight {self.heading_offset} rad off the heading of the poses")
        if self.gyro_bias and abs(self.gyro_bias.value) > max(_TOLD_BIAS, 3.0 * self.gyro_bias.error):
            said.append(f"the gyro says {self.gyro_bias} rad/s of a car that stands")
        if self.pose_jumps:
            said.append(f"the poses jump {self.pose_jumps} times")
        if self.gaps:
            said.append(f"no rows for more than {5.0 * self.period:.2g} s, {self.gaps} times")
        return said

    def __str__(self) -> str:
        return "; ".join(self.lines) or "nothing wrong was found"

    def _used(self, name: str) -> str:
        return " (corrected)" if name in self.used else ""


def check_drive(
    *, speed: Channel, yaw_rate: Channel, steering: Channel, commanded: bool, pose: Channel | None
) -> DriveChecks:
    """Return what the channels of a drive say of each other."""
    period = float(np.median(np.diff(speed.time))) if len(speed.time) > 1 else math.nan
    gaps = int(np.count_nonzero(np.diff(speed.time) > 5.0 * period))
    stands = np.abs(np.interp(yaw_rate.time, speed.time, speed.values[:, 0])) < 0.02
    still = yaw_rate.values[stands, 0]
    bias = Found()
    if len(still) >= 20 and np.ptp(still) < 0.2:
        bias = Found(value=float(np.median(still)), error=float(still.std() / math.sqrt(len(still))))
    clock, clock_delay, turn, turn_delay, jumps, heading = Found(), Found(), Found(), Found(), 0, Found()
    if pose is not None and len(pose.time) > 2:
        heading = _heading_offset(speed, yaw_rate, pose)
        clock, clock_delay, turn, turn_delay, jumps = _against_poses(speed, yaw_rate, pose)
    gyro = Found()
    if clock and turn:
        value = turn.value / clock.value
        gyro = Found(value=value, error=value * math.hypot(turn.error / turn.value, clock.error / clock.value))
    offset, slope, delay = _straight(speed, yaw_rate, steering, commanded)
    return DriveChecks(
        clock_scale=clock, gyro_scale=gyro, gyro_bias=bias, speed_delay=clock_delay, yaw_rate_delay=turn_delay,
        steering_offset=offset, steering_delay=delay, steering_slope=slope, pose_jumps=jumps, gaps=gaps, period=period,
        heading_offset=heading,
    )  # fmt: skip


def _against_poses(speed: Channel, yaw_rate: Channel, pose: Channel) -> tuple[Found, Found, Found, Found, int]:
    """Return scale and delay of the speed, those of the yaw rate, and how often the poses jump."""
    time, (x, y, heading) = pose.time, pose.values.T
    heading = np.unwrap(heading)
    middle = 0.5 * (heading[1:] + heading[:-1])
    along = np.diff(x) * np.cos(middle) + np.diff(y) * np.sin(middle)
    seconds = np.diff(time)
    by_speed = np.interp(0.5 * (time[1:] + time[:-1]), speed.time, speed.values[:, 0]) * seconds
    by_gyro = np.interp(0.5 * (time[1:] + time[:-1]), yaw_rate.time, yaw_rate.values[:, 0]) * seconds
    jumped = (np.abs(along - by_speed) > _JUMP) | (np.abs(np.diff(heading) - by_gyro) > _TURN_JUMP)
    jumped |= np.hypot(np.diff(x), np.diff(y)) > _JUMP + 1.5 * np.abs(by_speed)
    edges = _some(_windows(time, jumped))
    path, turned = np.concatenate(([0.0], np.cumsum(along))), heading
    moving = _change(_integral(speed), time, edges, 0.0) > _SLOWEST * WINDOW
    scale, delay = _scale_and_delay(path, speed, time, edges[moving])
    turn, turn_delay = _scale_and_delay(turned, yaw_rate, time, edges)
    return scale, delay, turn, turn_delay, int(np.count_nonzero(jumped))


def _windows(time: FloatArray, jumped: NDArray[np.bool_]) -> Rows:
    """Return the first and the last row of the windows in which the poses do not jump, (m, 2)."""
    bad, times = np.concatenate(([0], np.cumsum(jumped))), time.tolist()
    first = 0
    found: list[tuple[int, int]] = []
    while True:
        last = bisect_left(times, times[first] + WINDOW - 1e-9)
        if last >= len(times):
            return np.array(found, np.int64).reshape(-1, 2)
        if bad[last] == bad[first] and times[last] - times[first] < 2.0 * WINDOW:
            found.append((first, last))
        first = last


def _some(rows: NDArray[Any]) -> NDArray[Any]:
    """Return rows, or about _MOST of them, evenly spread, which say as much and take no time."""
    return rows[:: math.ceil(len(rows) / _MOST) or 1]


def _integral(channel: Channel) -> tuple[FloatArray, FloatArray]:
    values = channel.values[:, 0]
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(channel.time)
    return channel.time, np.concatenate(([0.0], np.cumsum(steps)))


def _change(integral: tuple[FloatArray, FloatArray], time: FloatArray, edges: Rows, delay: float) -> FloatArray:
    """Return the change of an integral over windows, of a signal that is late by a delay."""
    first, last = np.interp(time[edges] + delay, *integral).T
    return np.asarray(last - first)


def _scale_and_delay(true: FloatArray, channel: Channel, time: FloatArray, edges: Rows) -> tuple[Found, Found]:
    """Return by which scale and delay the integral of a channel agrees best with what the poses say."""
    if len(edges) < _FEWEST:
        return Found(), Found()
    edges = edges[(time[edges[:, 0]] > channel.time[0] + _LATEST) & (time[edges[:, 1]] < channel.time[-1] - _LATEST)]
    if len(edges) < _FEWEST:
        return Found(), Found()
    integral = _integral(channel)
    wanted = true[edges[:, 1]] - true[edges[:, 0]]
    tried = [_through_origin(_change(integral, time, edges, delay), wanted) for delay in _DELAYS]
    costs = np.array([cost for _, _, cost in tried])
    best = int(np.argmin(costs))
    far = round(_FAR / 0.01)
    around = [costs[place] for place in (best - far, best + far) if 0 <= place < len(costs)]
    if 0 < best < len(costs) - 1 and costs[best] < _SEEN * min(around):
        below, here, above = costs[best - 1 : best + 2]
        bend = below - 2.0 * here + above
        moved = 0.5 * (below - above) / bend if bend > 0.0 else 0.0
        error = 0.01 * math.sqrt(max(here, 0.0) / max(bend, 1e-12) * 2.0 / len(edges))
        delay = Found(value=float(_DELAYS[best] + 0.01 * moved), error=error)
    else:
        best, delay = int(np.argmin(np.abs(_DELAYS))), Found()
    scale, error, _ = tried[best]
    if not math.isfinite(scale) or abs(scale) < 1e-3 or error > 0.1 * abs(scale):
        return Found(), delay
    return Found(value=scale, error=error), delay


def _through_origin(given: FloatArray, wanted: FloatArray) -> tuple[float, float, float]:
    """Return the slope of a line through the origin, its standard error, and the mean of the trimmed squares."""
    kept = np.ones(len(given), np.bool_)
    slope, power, limit = math.nan, math.nan, math.inf
    residuals = np.abs(wanted)
    for _ in range(4):
        power = float(given[kept] @ given[kept])
        if power <= 1e-9:
            return math.nan, math.nan, math.inf
        slope = float(given[kept] @ wanted[kept]) / power
        residuals = np.abs(wanted - slope * given)
        limit = _ROBUST * 1.4826 * float(np.median(residuals))
        kept = residuals <= max(limit, 1e-9)
    cost = float(np.mean(np.minimum(residuals, max(limit, 1e-9)) ** 2))
    spread = float(np.sqrt(np.mean(residuals[kept] ** 2)))
    return slope, spread / math.sqrt(power), cost


def _heading_offset(speed: Channel, yaw_rate: Channel, pose: Channel) -> Found:
    """Return the direction of the path of a car that goes straight, from the heading of its poses [rad]."""
    time, (x, y, heading) = pose.time, pose.values.T
    heading = np.unwrap(heading)
    rows = max(round(_CHORD / float(np.median(np.diff(time)))) // 2, 1)
    middle = time[rows:-rows]
    if len(middle) < _FEWEST:
        return Found()
    dx, dy = x[2 * rows :] - x[: -2 * rows], y[2 * rows :] - y[: -2 * rows]
    speeds, turning = (np.interp(middle, each.time, each.values[:, 0]) for each in (speed, yaw_rate))
    # a chord has the direction of the circle in its middle, and so the heading there
    angle = np.remainder(np.arctan2(dy, dx) - heading[rows:-rows] + math.pi, 2.0 * math.pi) - math.pi
    seconds = time[2 * rows :] - time[: -2 * rows]
    whole = np.abs(np.hypot(dx, dy) - speeds * seconds) < _JUMP
    gentle = (speeds > 1.0) & (np.abs(speeds * turning) < _GENTLE) & whole & (np.abs(angle) < _TURN_JUMP)
    count = np.count_nonzero(gentle)
    gentle = _some(np.flatnonzero(gentle))
    sides = speeds[gentle] * turning[gentle]
    if count < 50 or min(np.mean(sides > 0.0), np.mean(sides < 0.0)) < 0.1:
        return Found()
    design = np.column_stack((np.ones(len(sides)), sides, turning[gentle] / speeds[gentle]))
    found, kept = _robust_line(design, angle[gentle])
    residuals = (angle[gentle] - design @ found)[kept]
    covariance = np.linalg.pinv(design[kept].T @ design[kept]) * float(np.mean(residuals**2))
    overlap = max(2 * rows * len(gentle) / count, 1.0)  # of chords
    return Found(value=float(found[0]), error=float(np.sqrt(covariance[0, 0] * overlap)))


def _robust_line(design: FloatArray, values: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the coefficients of a fit without outliers, and the rows that it is to."""
    kept = np.ones(len(values), np.bool_)
    for _ in range(4):
        found = np.asarray(np.linalg.lstsq(design[kept], values[kept], rcond=None)[0], np.float64)
        residuals: FloatArray = np.abs(values - design @ found)
        kept = residuals <= max(_ROBUST * 1.4826 * float(np.median(residuals)), 1e-9)
    return found, kept


def _straight(
    speed: Channel, yaw_rate: Channel, steering: Channel, commanded: bool
) -> tuple[Found, Found, Found]:  # fmt: skip
    """Return offset, slope and delay of the steering, from rows in which the car goes nearly straight."""
    time, turning = yaw_rate.time, yaw_rate.values[:, 0]
    speeds = np.interp(time, speed.time, speed.values[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        curvature = np.where(speeds > 1.0, turning / speeds, np.nan)
    gentle = (np.abs(curvature) < _STRAIGHT) & (np.abs(turning * speeds) < _GENTLE)
    gentle &= (time > steering.time[0] + 0.5) & (time < steering.time[-1])
    nothing = Found(), Found(), Found()
    count = np.count_nonzero(gentle)
    gentle = _some(np.flatnonzero(gentle))
    if count < 50 or min(np.mean(curvature[gentle] > 0.0), np.mean(curvature[gentle] < 0.0)) < 0.1:
        return nothing
    best: tuple[float, float, FloatArray, FloatArray] | None = None
    design = np.column_stack((np.ones(len(gentle)), curvature[gentle]))
    for delay in np.arange(0.0, 0.4 + 1e-9, 0.02):
        before = time[gentle] - delay
        angles = (steering.held(before) if commanded else steering.at(before))[:, 0]
        found, kept = _robust_line(design, angles)
        residuals = np.abs(angles - design @ found)
        limit = _ROBUST * 1.4826 * float(np.median(residuals))
        cost = float(np.mean(np.minimum(residuals, max(limit, 1e-9)) ** 2))
        if best is None or cost < best[0]:
            covariance = np.linalg.inv(design[kept].T @ design[kept]) * float(np.mean(residuals[kept] ** 2))
            best = cost, float(delay), found, np.sqrt(np.diag(covariance))
    assert best is not None
    _, delay, (offset, slope), errors = best
    period = float(np.median(np.diff(time))) * count / len(gentle)
    errors = errors * math.sqrt(max(1.0, 0.5 / period))  # rows within half a second are no further evidence
    if not 0.1 < slope < 1.5:  # [m] no car of this size: the steering and the turning do not belong together
        return nothing
    return (
        Found(value=float(offset), error=float(errors[0])),
        Found(value=float(slope), error=float(errors[1])),
        Found(value=delay, error=0.02),
    )
