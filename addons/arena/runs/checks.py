"""The kinds of checks of a lab: what is asked of a drive, what was measured, and whether that is enough.

    check = CHECKS["lap_time"](most_s=9.5)
    check.judge(drive)    # Verdict(passed=True, measured="best lap 9.20 s")

A check that a car would pass by standing still asks for some progress, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from fg_mujoco import portable
from fg_mujoco.course.clearance import least_clearance
from fg_mujoco.course.course import outline
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import FloatArray, require
from fg_mujoco.racing.entries import NO_FAULT
from fg_mujoco.racing.resolved import Ground
from fg_mujoco.racing.result import RaceResult
from fg_mujoco.vehicle.tire_slip import sliding_text

from .run import driven_poses

STANDS = 0.05
"""[m/s] below which a car stands."""

_WALLS, _OBSTACLE, _OTHERS = "a course with a left and a right wall", "an obstacle", "opponents"


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """A race that is checked; the figures are of car 0."""

    result: RaceResult
    ground: Ground

    @cached_property
    def poses(self) -> FloatArray:
        """Poses of the rear axle at the starts of ticks and the end: x [m], y [m], heading [rad]. Shape (n, 3)."""
        return driven_poses(self.result)

    @cached_property
    def times(self) -> FloatArray:
        """Times of the poses (n,) [s]."""
        return np.append(self.result.car.column("time_s"), self.result.sim_time_s)[: len(self.poses)]

    @cached_property
    def progress(self) -> float:
        """Greatest progress along the course's line [m]."""
        return float(self.result.car.column("progress_m").max(initial=0.0))

    @cached_property
    def speeds(self) -> FloatArray:
        """Speeds at the start of each tick (n,) [m/s]."""
        return self.result.car.column("speed_m_s")

    @property
    def end(self) -> str:
        """How it ended, in words."""
        car = self.result.car
        found = car.crash or car.wrong_way or car.rollover
        return car.end_reason.replace("_", " ") + (f": {found}" if found else "")


class Verdict(NamedTuple):
    """What a check says of a drive."""

    passed: bool
    measured: str


@dataclass(frozen=True, kw_only=True)
class Check:
    """Base of checks, whose fields that are numbers are from 0.

    Raises:
      SettingsError: a field that is no number from 0.
    """

    asks: ClassVar[str]  # in words, with fields in braces; of a share in per cent
    needs: ClassVar[str] = ""  # that a drive has it: one of _WALLS, _OBSTACLE, _OTHERS

    def __post_init__(self) -> None:
        numbers = tuple(each.name for each in fields(self) if each.type == "float")
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", numbers, SettingsError)

    @property
    def asked(self) -> str:
        """What is asked, in words."""
        texts = {name: value if isinstance(value, str) else f"{value:g}" for name, value in vars(self).items()}
        shares = {name: f"{100.0 * value:g} %" for name, value in vars(self).items() if name.endswith("_share")}
        return self.asks.format(**texts | shares)

    def lacks(self, ground: Ground, cars: int) -> str:
        """Return what a drive on a ground, of so many cars, lacks for this check; empty: nothing."""
        there = {_WALLS: len(ground.course.edges) > 1, _OBSTACLE: bool(ground.obstacles), _OTHERS: cars > 1, "": True}
        return "" if there[self.needs] else self.needs

    def judge(self, drive: Drive) -> Verdict:
        """Return whether a drive is good enough, and what was measured."""
        passed, measured = self._judge(drive)
        if passed and drive.progress < getattr(self, "least_progress_m", 0.0):
            return Verdict(False, f"{measured}, but only {drive.progress:.1f} m driven, {drive.end}")
        return Verdict(passed, measured)

    def _judge(self, drive: Drive) -> tuple[bool, str]:
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class OnTheWay(Check):
    """Base of checks that ask for some progress besides."""

    least_progress_m: float = 10.0  # [m]


@dataclass(frozen=True, kw_only=True)
class Finishes(Check):
    """The car drives all laps, or to the goal, before its time limit."""

    asks = "all laps"

    def _judge(self, drive: Drive) -> tuple[bool, str]:
        car, laps = drive.result.car, drive.result.laps_requested
        return car.finished, f"{car.laps_completed} of {laps} in {car.end_time_s:.2f} s, {drive.end}"


@dataclass(frozen=True, kw_only=True)
class NoCrash(OnTheWay):
    """The car touches no wall and no obstacle, and does not roll over."""

    asks = "no crash in {least_progress_m} m or more"

    def _judge(self, drive: Drive) -> tuple[bool, str]:
        crashed = drive.result.car.collisions_wall > 0 or drive.result.car.end_reason in ("crash", "rolled_over")
        return not crashed, drive.end if crashed else f"no crash in {drive.progress:.1f} m"


@dataclass(frozen=True, kw_only=True)
class NoSlide(OnTheWay):
    """No tire slides for more than a share of the time."""

    asks = "sliding for at most {most_share} of the time"
    most_share: float = 0.0

    def _judge(self, drive: Drive) -> tuple[bool, str]:
        car = drive.result.car
        share = car.slide_time_fraction
        more = f" at most, {100.0 * share:.2f} % of the time"
        return share <= self.most_share, sliding_text(car.max_slide_m_s, 2, more)  # not passed where not measured


@dataclass(frozen=True, kw_only=True)
class LapTime(Check):
    """The best lap is quick enough."""

    asks = "a lap in at most {most_s} s"
    most_s: float  # [s]

    def _judge(self, drive: Drive) -> tuple[bool, str]:
        best = min(drive.result.car.lap_times_s, default=math.inf)
        return best <= self.most_s, f"best lap {best:.2f} s" if best < math.inf else f"no lap, {drive.end}"


@dataclass(frozen=True, kw_only=True)
class MeanSpeed(OnTheWay):
    """The car drives fast enough on average."""

    asks = "{least_m_s} m/s or more on average"
    least_m_s: float  # [m/s]

    def _judge(self, drive: Drive) -> tuple[bool, str]:
        mean = drive.result.car.mean_speed_m_s
        return mean >= self.least_m_s, f"{mean:.2f} m/s"


@dataclass(frozen=True, kw_only=True)
class KeepsClear(OnTheWay):
    """The car's footprint keeps a distance from walls and obstacles."""

    asks = "{least_m} m or more from everything"
    least_m: float  # [m]

    def _judge(self, drive: Drive) -> tuple[bool, str]:
        car, touched = drive.result.world.parameters, drive.result.car.collisions_wall
        nearest = 0.0 if touched else drive.ground.least_clearance(drive.times, drive.poses, car)
        return nearest >= self.least_m, f"{nearest:.3f} m at the nearest"


@dataclass(frozen=True, kw_only=True)
class FollowsWall(OnTheWay):
    """The LiDAR keeps a distance from the wall of one side, within a band, for a share of the time.

    The distance is to the nearest point of that wall, from where the first `after_m` are driven.
    """

    asks = "{distance_m} m from the {side} wall, within {within_m} m, for {least_share} of the time"
    needs = _WALLS
    side: str = "left"  # or "right"
    distance_m: float  # [m]
    within_m: float  # [m] on either side of the distance
    least_share: float = 0.9
    after_m: float = 3.0  # [m]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.side not in ("left", "right"):
            raise SettingsError(f"FollowsWall.side is {self.side!r}; accepted: left, right")

    def _judge(self, drive: Drive) -> tuple[bool, str]:
        edges = drive.ground.course.edges
        driven = drive.result.car.column("progress_m")[: len(drive.poses)] >= self.after_m
        poses = drive.poses[: len(driven)][driven]
        if not len(poses):
            return False, f"only {drive.progress:.1f} m driven"
        ahead = drive.result.world.parameters.lidar_offset
        lidar = poses[:, :2] + ahead * np.stack((portable.cos(poses[:, 2]), portable.sin(poses[:, 2])), axis=1)
        found = nearest_distances(lidar, outline(edges[0 if self.side == "left" else 1]))
        share = float(np.mean(np.abs(found - self.distance_m) <= self.within_m))
        low, high = np.quantile(found, (0.05, 0.95)).tolist()
        return share >= self.least_share, f"{100.0 * share:.0f} % of the time, mostly {low:.2f} to {high:.2f} m"


@dataclass(frozen=True, kw_only=True)
class StopsBefore(Check):
    """The car has driven fast, and comes to stand before an obstacle, neither in it nor far from it."""

    asks = "stands {least_m} to {most_m} m before the obstacle, after {least_speed_m_s} m/s"
    needs = _OBSTACLE
    least_speed_m_s: float  # [m/s] that it reached before
    least_m: float = 0.05  # [m] between the car and the nearest obstacle, where it stands
    most_m: float = 1.0

    def _judge(self, drive: Drive) -> tuple[bool, str]:
        fastest, last = float(drive.speeds.max(initial=0.0)), float(drive.speeds[-1])
        if drive.result.car.collisions_wall or abs(last) > STANDS:
            return False, f"does not stand: {drive.end} at {abs(last):.1f} m/s"
        solids = np.concatenate([outline(each.corners()) for each in drive.ground.obstacles])
        gap = least_clearance(drive.poses[-1:], solids, drive.result.world.parameters)
        passed = fastest >= self.least_speed_m_s and self.least_m <= gap <= self.most_m
        return passed, f"stands {gap:.2f} m before it, after {fastest:.2f} m/s"


@dataclass(frozen=True, kw_only=True)
class StoppingDistance(Check):
    """The car needs no longer than some way to stop, from where it was last as fast as a speed."""

    asks = "stops from {from_m_s} m/s in at most {most_m} m"
    from_m_s: float  # [m/s]
    most_m: float  # [m]

    def _judge(self, drive: Drive) -> tuple[bool, str]:
        speeds = drive.speeds
        fast = np.flatnonzero(speeds >= self.from_m_s)
        if not len(fast):
            return False, f"at most {float(speeds.max(initial=0.0)):.2f} m/s"
        after = np.flatnonzero(np.abs(speeds[fast[-1] :]) <= STANDS)
        if not len(after) or drive.result.car.collisions_wall:
            return False, f"does not stop: {drive.end}"
        way = drive.poses[fast[-1] : fast[-1] + after[0] + 1, :2]
        distance = float(np.hypot(*np.diff(way, axis=0).T).sum())
        return distance <= self.most_m, f"{distance:.2f} m"


@dataclass(frozen=True, kw_only=True)
class Wins(Check):
    """The car finishes before all others."""

    asks, needs = "first of all cars", _OTHERS

    def _judge(self, drive: Drive) -> tuple[bool, str]:
        car, count = drive.result.car, len(drive.result.cars)
        return count > 1 and car.finished and car.position == 1, f"place {car.position} of {count}, {drive.end}"


@dataclass(frozen=True, kw_only=True)
class NoFault(OnTheWay):
    """Race control blames the car for no contact with another car."""

    asks, needs = "no contact by its own fault", _OTHERS

    def _judge(self, drive: Drive) -> tuple[bool, str]:
        car = drive.result.car
        blamed = [each for each in drive.result.contacts if each.at_fault != NO_FAULT and each.blames(car.name)]
        reasons = ": " + ", ".join(f"{each.reason} at {each.time_s:.1f} s" for each in blamed[:3]) if blamed else ""
        return not blamed, f"{len(blamed)} of {car.collisions_car} contacts{reasons}"


@dataclass(frozen=True, kw_only=True)
class SuiteCheck:
    """A check of a suite, and its points."""

    number: int  # in the suite, from 0
    name: str
    points: float
    check: Check


CHECKS: dict[str, type[Check]] = {
    "finishes": Finishes, "no_crash": NoCrash, "no_slide": NoSlide, "lap_time": LapTime, "mean_speed": MeanSpeed,
    "keeps_clear": KeepsClear, "follows_wall": FollowsWall, "stops_before": StopsBefore,
    "stopping_distance": StoppingDistance, "wins": Wins, "no_fault": NoFault,
}  # fmt: skip
"""By the name in a lab's file."""


def nearest_distances(points: FloatArray, segments: FloatArray) -> FloatArray:
    """Return the distance of each point (n, 2) to the nearest of some segments (m, 4) [m]. Shape (n,) [m]."""
    found = np.full(len(points), math.inf)
    for x, y, to_x, to_y in segments.tolist():
        along = np.array([to_x - x, to_y - y])
        length = float(along @ along)
        share = ((points - (x, y)) @ along / length).clip(0.0, 1.0) if length > 0.0 else np.zeros(len(points))
        away = points - (x, y) - share[:, np.newaxis] * along
        found = np.minimum(found, np.hypot(away[:, 0], away[:, 1]))
    return found
