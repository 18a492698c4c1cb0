"""Turns sensor_msgs/LaserScan, as robots record it, into the scan that a planner reads: rightmost beam first, REP 117.

Conventions of LiDAR drivers, and how they are read:

- 0 or less for a beam that failed (urg_node, sllidar): NaN. NaN, +inf and -inf stay.
- 65.533, or another of the last numbers of 16 bits in mm, with which Hokuyo's say that they see nothing: +inf.
- below `range_min`: -inf, too close. From `range_max` on: +inf, nothing there.
- beams from left to right, or a LiDAR that hangs upside down: the other way round.
- bearings of 0 to 2 pi, or a LiDAR that looks backwards: bearings of -pi to pi, straight ahead in the middle; where the
  beams of less than a full turn have their gap in the middle of that, it is filled with NaN.
- any number of beams.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fg_mujoco.errors import BagError
from fg_mujoco.messages import FloatArray, LaserScan

from .bag_frames import FrameTree
from .bag_messages import MAP_FRAME, nanoseconds, stamp_of

_FLAT = math.cos(math.radians(5.0))  # of a mount that counts as level
_NOTHING = (65.5325, 65.5355)  # [m] from 65533 to 65535 mm, as Hokuyo's codes are
_NUMBERS = ("angle_min", "angle_increment", "range_min", "range_max")


@dataclass(frozen=True, kw_only=True)
class Mount:
    """The mount of a LiDAR on the car."""

    yaw: float = 0.0  # [rad] from straight ahead, left positive
    upside_down: bool = False

    @classmethod
    def of(cls, rotation: FloatArray, frame: str) -> Mount:
        """Return the mount of a LiDAR of axes (3, 3), columns in the car's frame; BagError: beyond 5 degrees."""
        if abs(rotation[2, 2]) < _FLAT:
            tilt = math.degrees(math.acos(min(1.0, abs(float(rotation[2, 2])))))
            raise BagError(f"frame {frame!r} is tilted by {tilt:.0f} deg on the car; accepted: a level LiDAR")
        yaw = math.atan2(rotation[1, 0], rotation[0, 0])
        return cls(yaw=yaw, upside_down=bool(rotation[2, 2] < 0.0))


def mount_of(frames: FrameTree, sensor: str, stated: str = "") -> Mount:
    """Return the mount of a frame's LiDAR, level and straight ahead without transforms; BagError: beyond 5 degrees."""
    base = frames.base_of(sensor, stated)
    worlds = {MAP_FRAME, "odom", "world", "earth"}
    found = None if base is None else frames.find(sensor, base, worlds)
    return Mount() if found is None else Mount.of(found[:3, :3], sensor)


def to_scan(message: Any, mount: Mount | None = None, *, period: float = 0.025) -> LaserScan:
    """Return the scan of a sensor_msgs/LaserScan, with a period [s] where it has none; BagError: angles of no LiDAR."""
    mount = mount or Mount()
    _check(message)
    ranges = _readings(np.asarray(message.ranges, np.float64), float(message.range_min), float(message.range_max))
    first, step = float(message.angle_min), float(message.angle_increment)
    delay = float(message.time_increment) if math.isfinite(message.time_increment) else 0.0
    stamp = (stamp_of(message) + nanoseconds(delay * max(len(ranges) - 1, 0))) / 1e9  # of the last beam
    if mount.upside_down:
        first, step = -first, -step
    first += mount.yaw
    if step < 0.0:
        first, step, delay, ranges = first + step * (len(ranges) - 1), -step, -delay, ranges[::-1]
    first, ranges = _ahead(first, step, ranges)
    scan_time = float(message.scan_time)
    return LaserScan(
        stamp=stamp,
        angle_min=first,
        angle_max=first + step * max(len(ranges) - 1, 0),
        angle_increment=step,
        range_min=float(message.range_min),
        range_max=float(message.range_max),
        ranges=ranges,
        time_increment=delay,
        scan_time=scan_time if 0.0 < scan_time < math.inf else period,
    )


def disagreement(message: Any) -> float:
    """Return by how many beams `angle_max` differs from what `angle_min`, the increment and the beams say."""
    step = float(message.angle_increment)
    last = float(message.angle_min) + step * (len(message.ranges) - 1)
    return abs(float(message.angle_max) - last) / abs(step) if step and len(message.ranges) else 0.0


def beyond(message: Any) -> float:
    """Return the share of readings far beyond `range_max`: a LiDAR that measures them states too low a `range_max`."""
    ranges = np.asarray(message.ranges)
    limit = 1.02 * float(message.range_max)
    return float(np.mean((ranges > limit) & (ranges < _NOTHING[0]))) if len(ranges) else 0.0


def _check(message: Any) -> None:
    for name in _NUMBERS:
        if not math.isfinite(getattr(message, name)):
            raise BagError(f"LaserScan.{name} is {getattr(message, name)}; accepted: a finite number")
    if not 0.0 <= message.range_min < message.range_max:
        raise BagError(
            f"LaserScan.range_min is {message.range_min:g} and range_max {message.range_max:g}; accepted: from 0 on, "
            "range_max the greater"
        )
    beams, step = len(message.ranges), float(message.angle_increment)
    if beams > 1 and (step == 0.0 or abs(step) * (beams - 1) > math.tau * (1.0 + 1e-4)):
        raise BagError(
            f"LaserScan.angle_increment is {step:g} rad with {beams} beams; accepted: beams apart, a full turn at most"
        )
    first, last = float(message.angle_min), float(message.angle_max)
    if beams > 2 and step and abs(step * (beams - 1) + last - first) < 0.5 * abs(last - first):
        raise BagError(
            f"LaserScan.angle_increment is {step:g} rad, and its beams go from {first:g} to {last:g} rad; accepted: an "
            "increment of the sign of the turn"
        )


def _readings(ranges: FloatArray, range_min: float, range_max: float) -> FloatArray:
    """Return ranges as REP 117 has them."""
    close = (ranges < range_min) & (ranges > 0.0)
    readings = np.where(close | (ranges == -math.inf), -math.inf, ranges)
    readings[(ranges <= 0.0) & (ranges > -math.inf)] = math.nan
    readings[(ranges >= range_max) | ((ranges > _NOTHING[0]) & (ranges < _NOTHING[1]))] = math.inf
    return readings


def _ahead(first: float, step: float, ranges: FloatArray) -> tuple[float, FloatArray]:
    """Return the first bearing and the ranges with all bearings within half a turn of straight ahead."""
    last = first + step * max(len(ranges) - 1, 0)
    turn = math.tau * round(0.5 * (first + last) / math.tau)
    first, last = first - turn, last - turn
    slack = 0.5 * step + 1e-4  # float32's rounding of pi, over a thousand beams
    if first >= -math.pi - slack and last <= math.pi + slack:
        return first, ranges
    # no shift by full turns does: each beam goes to its place in a circle of beams
    count = max(round(math.tau / step), 1)
    skipped = math.ceil((-math.pi - first) / step - 1e-6)  # steps from the first beam to the first of the circle
    circle = np.full(count, math.nan)
    np.fmin.at(circle, (np.arange(len(ranges)) - skipped) % count, ranges)  # two beams at one bearing: the nearer
    return first + step * skipped, circle
