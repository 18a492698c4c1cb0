"""A recorded drive: the channels of a car's sensors and commands, and the same as rows at common times."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from fg_mujoco.display import brief
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import FloatArray, read_only

from .channels import LONGEST, LONGEST_PAUSE, MOST, PART, PAUSE, SHORTEST, Beams, Channel, Measured
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
    """A drive as recorded, in base_link's frame, x forward, y left; `rows` has all at the times of the speed."""

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
    part_of: str | None = None  # name of the drive that it is a part of

    def __post_init__(self) -> None:
        for name in ("name", "layout"):  # pages and tables are UTF-8, whatever the names of files are
            object.__setattr__(self, name, getattr(self, name).encode(errors="replace").decode())
        for name in ("steering", "speed_command", "speed", "yaw_rate", "acceleration_command"):
            channel: Channel | None = getattr(self, name)
            if channel is not None:
                channel.require_bounded(MOST[name])
        if self.acceleration is not None:
            self.acceleration.require_bounded(MOST["acceleration"], MOST["acceleration"])
        if self.pose is not None:
            self.pose.require_bounded(MOST["place"], MOST["place"], MOST["yaw"])

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
        cut = [f"is cut at {self._pauses}, where its motion is needed"] if self.pauses else []
        return [*made, *(f"  {line}" for line in [*self.checks.lines, *cut])]

    @property
    def _pauses(self) -> str:
        longest = max(first - last for last, first in self.pauses)
        return f"pauses of more than {PAUSE:g} s: {len(self.pauses)}, the longest {longest:.6g} s"

    def parts(self) -> list[RecordedDrive]:
        """Return it as drives without a pause, the only one itself; a warning says where it was cut.

        Of a drive that measures for more than LONGEST these are parts of PART, evenly spread, LONGEST in all. Raises
        SettingsError: no part lasts for SHORTEST, or its clock jumps by more than LONGEST_PAUSE.
        """
        pauses, said = self.pauses, list[str]()
        if not pauses and self.end - self.start <= LONGEST:
            return [self]
        for last, first in pauses:
            if first - last > LONGEST_PAUSE:
                jump = f"its clock jumps from {last:.9g} to {first:.9g} s"
                raise SettingsError(f"{self.name}: {jump}; accepted: pauses of up to {LONGEST_PAUSE:g} s")
        stretches, begin = [], self.start
        for last, first in [*pauses, (self.end, self.end)]:
            stretches += [(begin, last)] if last > begin else []
            begin = max(begin, first)
        whole = [each for each in stretches if each[1] - each[0] >= SHORTEST]
        seconds = sum(end - begin for begin, end in whole)
        if pauses:
            left_out = len(stretches) - len(whole)
            short = f"; {left_out} parts of less than {SHORTEST:g} s are left out" if left_out else ""
            said.append(f"is cut at {self._pauses}{short}")
        if seconds > LONGEST:
            edges = [np.linspace(*each, math.ceil((each[1] - each[0]) / PART) + 1).tolist() for each in whole]
            pieces = [pair for each in edges for pair in pairwise(each)]
            most = min(round(LONGEST / PART), len(pieces))
            whole = [pieces[place] for place in np.linspace(0, len(pieces) - 1, most).round().astype(int).tolist()]
            said.append(
                f"lasts {seconds:.0f} s, of which {most} parts of up to {PART:g} s are taken, evenly spread; a "
                f"file of up to {LONGEST:g} s is taken as a whole"
            )
        found = [part for each in whole if (part := self._part(*each)) is not None]
        if len(found) < len(whole):
            said.append(f"{len(whole) - len(found)} parts lack a channel, and are left out")
        if not found:
            accepted = f"{SHORTEST:g} s or more of all channels without a pause of {PAUSE:g} s"
            raise SettingsError(f"{self.name}: {'; '.join(said)}; accepted: {accepted}")
        warnings.warn(f"{self.name}: {'; '.join(said)}", stacklevel=2)
        return found

    def _part(self, begin: float, end: float) -> RecordedDrive | None:
        """Return the drive from one time to another; None: a channel has no measurement there."""
        names = ("steering", "speed_command", "speed", "yaw_rate", "acceleration", "pose", "acceleration_command")
        cut = {name: channel.between(begin, end) for name in names if (channel := getattr(self, name)) is not None}
        if None in cut.values():
            return None
        beams = self.beams
        if beams is not None:
            rows = (beams.time >= begin) & (beams.time <= end)
            beams = replace(beams, time=beams.time[rows], ranges=beams.ranges[rows]) if rows.any() else None
        name = f"{self.name}, {begin - self.start:.4g} to {end - self.start:.4g} s"
        return replace(self, name=name, beams=beams, part_of=self.name, **cut)

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
