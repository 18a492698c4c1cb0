"""The packets of AutoDRIVE's bridge: a car's readings as the simulator sends them, and the commands of a DevKit.

Both are dictionaries of texts, whose keys begin with the vehicle's number: "V1 Throttle". Sources: the technical guide
of 2026 of the RoboRacer Sim Racing League, for units and ranges, and public DevKits, for the keys.
"""

from __future__ import annotations

import base64
import gzip
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fg_mujoco.addons.ros.composed_topics import RANGE_MAX, RANGE_MIN, STEERING, THROTTLE
from fg_mujoco.errors import MessageError
from fg_mujoco.messages import DriveCommand, FloatArray, LaserScan, Odometry, shown

EVENT = "Bridge"

BEAMS, FIRST_BEARING, INCREMENT = 1081, math.radians(-135.0), math.radians(0.25)
_RATE = 40.0  # [Hz]
_TICKS = 1920  # of an encoder in a turn of the wheel: 16 pulses, and the gears of 120 that DevKits reckon with
_SAME_BEARING = 0.5 * INCREMENT  # [rad] by which a beam may be off; where there is none, nothing is seen

@dataclass(frozen=True, kw_only=True)
class LapTimes:
    """The laps of a car, as the simulator tells them."""

    count: int  # completed
    time: float  # [s] of the present lap
    last: float  # [s] 0: there is none
    best: float  # [s] likewise


@dataclass(frozen=True, kw_only=True)
class Answer:
    """The commands of a DevKit for one car."""

    throttle: float  # -1 to 1
    steering: float  # -1 to 1, left positive
    reset: bool  # the simulation is to begin anew

    @property
    def command(self) -> DriveCommand:
        """The same for a car here: full throttle is the speed that the simulator's car reaches with it."""
        return DriveCommand(steering_angle=self.steering * STEERING, speed=self.throttle * THROTTLE)


def packet(
    scan: LaserScan,
    odometry: Odometry,
    *,
    throttle: float,
    encoders: FloatArray,
    laps: LapTimes,
    collisions: int,
    image: str,
    vehicle: int = 1,
    classic: bool = False,
) -> dict[str, str]:
    """Return what the simulator tells of a car.

    `throttle`, -1 to 1, was commanded last, `encoders` (2,) [rad] are how far the rear wheels have turned, `image` is a
    JPEG in base64. `classic` is for AutoDRIVE's own DevKits of 2021 to 2023, which read ranges as text, intensities,
    and encoder ticks.
    """
    x, y, heading = odometry.pose.tolist()
    own = {
        "Throttle": _text(throttle),
        "Steering": _text(odometry.steering_angle / STEERING),
        "Speed": _text(odometry.speed),
        "Encoder Angles": _texts(encoders),
        "Position": _texts((x, y, 0.0)),
        "Orientation Quaternion": _texts((0.0, 0.0, math.sin(0.5 * heading), math.cos(0.5 * heading))),
        "Orientation Euler Angles": _texts((0.0, 0.0, heading % math.tau)),
        "Linear Velocity": _texts((odometry.speed, 0.0, 0.0)),
        "Angular Velocity": _texts(odometry.angular_velocity),
        "Linear Acceleration": _texts(odometry.linear_acceleration),
        "LIDAR Scan Rate": _text(_RATE),
        "LIDAR Range Array": " ".join(_ranges(scan)) if classic else _compressed(_ranges(scan)),
        "Front Camera Image": image,
        "Lap Count": str(laps.count),
        "Lap Time": _text(laps.time),
        "Last Lap Time": _text(laps.last),
        "Best Lap Time": _text(laps.best),
        "Collisions": str(collisions),
    }
    if classic:
        own["Encoder Ticks"] = " ".join(f"{math.floor(angle / math.tau * _TICKS)}" for angle in encoders.tolist())
        own["LIDAR Intensity Array"] = " ".join(["0"] * BEAMS)
    return {f"V{vehicle} {name}": value for name, value in own.items()}


def read_answer(data: Any, vehicle: int = 1) -> Answer:
    """Return what a DevKit has answered, clipped to -1 to 1, as the simulator does; MessageError: no commands."""
    if not isinstance(data, Mapping):
        raise MessageError(f"the DevKit has answered {shown(data)}; accepted: a dictionary of commands")
    numbers = []
    for name in ("Throttle", "Steering"):
        key = f"V{vehicle} {name}"
        given = data.get(key)
        try:
            number = float(given)  # type: ignore[arg-type]
        except (TypeError, ValueError, OverflowError):
            number = math.nan
        if not math.isfinite(number):
            has = f"{key!r} {shown(given)}" if key in data else f"no {key!r}"
            raise MessageError(f"the DevKit has answered {has}; accepted: a number from -1 to 1, as text")
        numbers.append(min(max(number, -1.0), 1.0))
    reset = str(data.get("Reset", data.get(f"V{vehicle} Reset", "False"))).strip().casefold() in ("true", "1")
    return Answer(throttle=numbers[0], steering=numbers[1], reset=reset)


def _ranges(scan: LaserScan) -> list[str]:
    """Return the ranges of the simulator's beams [m]; what it does not measure is inf."""
    bearings = FIRST_BEARING + INCREMENT * np.arange(BEAMS)
    nearest = np.rint((bearings - scan.angle_min) / scan.angle_increment)
    chosen = np.clip(nearest, 0, len(scan.ranges) - 1).astype(np.int64)
    ranges = scan.ranges[chosen].astype(float)
    off = np.abs(scan.angle_min + scan.angle_increment * chosen - bearings) > _SAME_BEARING
    ranges[off | ~(ranges >= RANGE_MIN) | (ranges > RANGE_MAX)] = math.inf
    return [f"{distance:.4f}" for distance in ranges.tolist()]


def _compressed(ranges: list[str]) -> str:
    return base64.b64encode(gzip.compress("\n".join(ranges).encode(), compresslevel=1, mtime=0)).decode("ascii")


def _text(value: float) -> str:
    return f"{value:.4f}"


def _texts(values: Any) -> str:
    return " ".join(_text(value) for value in values)
