"""A recorded drive: the channels of a car's sensors and commands, and the same as rows at common times."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...display import brief
from ...messages import FloatArray, read_only
from .channels import Beams, Channel, Measured
from .drive_checks import DriveChecks


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveRows:
    """A recorded drive at common times: read-only arrays with a row each; None: it was not recorded."""

    time: FloatArray  # (n,) [s]
    speed: FloatArray  # (n,) [m/s] surface speed of the rear wheels
    yaw_rate: FloatArray  # (n,) [rad/s]
    steering: FloatArray  # (n,) [rad] the command that holds, or the measured angle
    speed_command: FloatArray | None  # (n,) [m/s] that holds
    acceleration_command: FloatArray | None  # (n,) [m/s^2] that holds, of a car that is sent accelerations
    pose: FloatArray | None  # (n, 3) x [m], y [m], heading [rad] of base_link, the heading without jumps
    acceleration: FloatArray | None  # (n, 2) [m/s^2] ahead and to the left
    beams: FloatArray | None  # (n, b) [m] of the last scan; inf: nothing was seen, NaN: the beam failed
    bearings: FloatArray | None  # (b,) [rad] of the beams, to the left of straight ahead


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class RecordedDrive(Measured):
    """A drive as a car recorded it. The frame is base_link's: rear axle, x forward, y left.

    Channels have their own times. `rows` has all at the times of the speed.
    """

    name: str  # of the file or folder
    sha256: str  # of what it was read from
    layout: str  # of its columns: of a known one the name, else the mapping's file; "bag", "run"
    steering: Channel  # [rad] commanded, or measured
    commanded: bool  # whether the steering is commands, which hold until the next one
    speed_command: Channel | None  # [m/s]
    speed: Channel  # [m/s] surface speed of the rear wheels
    yaw_rate: Channel  # [rad/s] of the gyro
    acceleration: Channel | None  # [m/s^2] ahead and to the left, in the centre of gravity
    pose: Channel | None  # x [m], y [m], heading [rad] of base_link, measured against the surroundings
    beams: Beams | None  # of the LiDAR
    checks: DriveChecks  # what its sensors say of each other
    acceleration_command: Channel | None = None  # [m/s^2], in place of a speed, of a car that is sent accelerations

    def __repr__(self) -> str:
        return brief(self, self.name, self.layout, f"{self.end - self.start:.3g} s")

    @property
    def sent_to_servo(self) -> bool:
        """Whether the steering is what a real servo was sent; a run of this simulator has the angles of its wheels."""
        return self.commanded and self.layout != "run"

    @property
    def lines(self) -> list[str]:
        """What it has, a line for each channel, and what its sensors say of each other."""
        channels = {
            "speed": self.speed, "yaw rate": self.yaw_rate,
            "steering, commanded" if self.commanded else "steering, measured": self.steering,
            "speed command": self.speed_command, "acceleration command": self.acceleration_command,
            "acceleration": self.acceleration, "pose": self.pose,
            "beams": self.beams,
        }  # fmt: skip
        made = [f"{self.name}: layout {self.layout}, {self.end - self.start:.1f} s"]
        for name, channel in channels.items():
            if channel is None:
                made.append(f"  {name:<20}-")
                continue
            count, lasts = len(channel.time), float(channel.time[-1] - channel.time[0])
            rate = f"{(count - 1) / lasts:.3g} Hz" if lasts > 0.0 else "once"
            values = channel.values if isinstance(channel, Channel) else channel.ranges
            seen = values[np.isfinite(values)]
            if name == "pose":
                seen = seen[:0]
            limits = f", {seen.min():.3g} to {seen.max():.3g}" if len(seen) else ""
            made.append(f"  {name:<20}{count} times, {rate}{limits}")
        return [*made, *(f"  {line}" for line in self.checks.lines)]

    @cached_property
    def rows(self) -> DriveRows:
        """All channels at the times of the speed at which all sensors measure."""
        return self.rows_at(self.speed.time[(self.speed.time >= self.start) & (self.speed.time <= self.end)])

    def rows_at(self, times: FloatArray) -> DriveRows:
        """Return all channels at some times (n,): measurements linear in between, commands and scans held."""

        def one(channel: Channel | None, *, held: bool = False) -> FloatArray | None:
            return None if channel is None else read_only((channel.held if held else channel.at)(times)[:, 0])

        def several(channel: Channel | None, *, turning: bool = False) -> FloatArray | None:
            if channel is None:
                return None
            if turning:
                x, y, heading = channel.values.T
                values = np.column_stack((x, y, np.unwrap(heading)))
                channel = Channel(name=channel.name, time=channel.time, values=values)
            return read_only(channel.at(times))

        seen = None
        if self.beams is not None:
            places = np.searchsorted(self.beams.time, times, side="right") - 1
            seen = read_only(self.beams.ranges[np.maximum(places, 0)])
        speed, yaw_rate = one(self.speed), one(self.yaw_rate)
        steering = one(self.steering, held=self.commanded)
        assert speed is not None and yaw_rate is not None and steering is not None
        return DriveRows(
            time=read_only(times), speed=speed, yaw_rate=yaw_rate, steering=steering,
            speed_command=one(self.speed_command, held=True),
            acceleration_command=one(self.acceleration_command, held=True), pose=several(self.pose, turning=True),
            acceleration=several(self.acceleration), beams=seen,
            bearings=None if self.beams is None else self.beams.bearings,
        )  # fmt: skip
