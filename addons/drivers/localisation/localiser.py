"""From scans and odometry to the pose of now: the front of the methods, which a planner, a node or a study asks.

    localiser = Localiser.of(PoseSettings(pose="particle_filter"), map_line, car, seed=1)
    pose = localiser.locate(scan, odometry)     # x [m], y [m], heading [rad]; NaN while the car is not found
    localiser.covariance

A scan counts at its own stamp, which may lie some ticks before that of the odometry. The estimate is taken to there by
the odometry of the time between, corrected, and a copy of it is carried on to now. Each beam is taken from where the
LiDAR was when it measured.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.controllers.control.planner_settings import Accepted, Settings, setting
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters, FloatArray, LaserScan, MapLine, Odometry, read_only

from .distance_field import DistanceField
from .map_matching import ScanMatching
from .odometry import predicted, step_errors
from .particle_filter import LEAST, ParticleFilter

MOST_PARTICLES = 100_000
START = (0.1, 0.05)
"""[m] and [rad] standard deviations to which a start that is given is known; its error is drawn with them."""

_KEPT = 128  # readings of odometry: scans may be older than now by so many ticks
_NO_POSE = read_only((math.nan, math.nan, math.nan))
_UNKNOWN = read_only(np.full((3, 3), math.nan))


@dataclass(frozen=True, kw_only=True)
class PoseSettings(Settings):
    """Where a planner has its pose from: the same settings for every planner.

    Raises:
      SettingsError: another word, or a number of particles out of range.
    """

    pose: Literal["truth", "particle_filter", "scan_matching"] = setting(
        "truth", text="that the planner drives by: the true one, or one found on the map"
    )
    pose_start: Literal["given", "unknown"] = setting(
        "given", text="whether the start is known, to 0.1 m and 3 degrees, or has to be found"
    )
    pose_map: str = setting("", text="path of a map that the planner gets in place of the course")
    particles: int = setting(
        2000, "", "of the filter, at most, once the car is found",
        Accepted(f"a whole number from {LEAST} to {MOST_PARTICLES}", lambda value: LEAST <= value <= MOST_PARTICLES),
    )  # fmt: skip


class Method(Protocol):
    """A way to find a pose on a map."""

    found: bool
    state: FloatArray  # (5,) x [m], y [m], heading [rad], and the relative errors of odometry's speed and yaw rate
    covariance: FloatArray  # (5, 5) of it

    @property
    def beams(self) -> int:
        """Of a scan that it uses, evenly spread."""

    def start(self, pose: FloatArray | None, deviations: tuple[float, float]) -> None:
        """Begin anew at a pose (3,) known to so many m and rad; None: anywhere."""

    def move(self, way: float, turn: float) -> None:
        """Go on by a step of odometry: the way ahead [m] and the turn [rad]."""

    def see(self, ends: FloatArray) -> None:
        """Use the ends of beams in the frame of the rear axle (b, 2) [m]."""


@kernel
def driven(readings: FloatArray, begin: float, end: float) -> tuple[float, float]:
    """Return the way [m] and the turn [rad] from a time to another [s], between readings linear.

    `readings` (k, 3) have the time [s], the speed [m/s] and the yaw rate [rad/s]; before the first and after the last
    they stay the same.
    """
    way, turn, at = 0.0, 0.0, begin
    speed, rate = _reading_at(readings, begin)
    for k in range(len(readings) + 1):
        until = end if k == len(readings) else min(max(readings[k, 0], begin), end)
        if until > at:
            next_speed, next_rate = _reading_at(readings, until)
            way += 0.5 * (speed + next_speed) * (until - at)
            turn += 0.5 * (rate + next_rate) * (until - at)
            speed, rate, at = next_speed, next_rate, until
    return way, turn


@kernel
def _reading_at(readings: FloatArray, time: float) -> tuple[float, float]:
    last = len(readings) - 1
    if time >= readings[last, 0]:
        return readings[last, 1], readings[last, 2]
    for k in range(last, 0, -1):
        if readings[k - 1, 0] <= time:
            share = (time - readings[k - 1, 0]) / (readings[k, 0] - readings[k - 1, 0])
            return (
                readings[k - 1, 1] + share * (readings[k, 1] - readings[k - 1, 1]),
                readings[k - 1, 2] + share * (readings[k, 2] - readings[k - 1, 2]),
            )
    return readings[0, 1], readings[0, 2]


class Localiser:
    """Finds the pose of a car.

    Args:
      method: that is used.
      car: whose LiDAR is ahead of the rear axle.
      rng: of the error of a start that is given.
      knows_start: whether the first pose of the odometry is taken for the start.

    Attributes:
      method: as given.
    """

    def __init__(self, method: Method, car: CarParameters, rng: np.random.Generator, *, knows_start: bool) -> None:
        self.method, self._car, self._rng, self._knows_start = method, car, rng, knows_start
        self._drawn_from = rng.bit_generator.state
        self.reset()

    @classmethod
    def of(cls, settings: PoseSettings, map_line: MapLine | None, car: CarParameters, seed: int) -> Localiser:
        """Return the localiser of some settings on a map.

        Raises:
          SettingsError: settings with the true pose; no map, or one without walls or without free ground.
        """
        if settings.pose == "truth":
            raise SettingsError("pose is 'truth'; accepted: particle_filter, scan_matching")
        if map_line is None:
            raise SettingsError(f"pose is {settings.pose!r} and there is no map; accepted: a course with a map")
        field, rng = DistanceField.of(map_line), np.random.default_rng([seed, 0x706F7365])
        method: Any = ParticleFilter(field, rng, settings.particles)
        if settings.pose == "scan_matching":
            method = ScanMatching(field, method)
        return cls(method, car, rng, knows_start=settings.pose_start == "given")

    def reset(self) -> None:
        """Forget everything seen so far."""
        self._rng.bit_generator.state = self._drawn_from
        self._readings = np.empty((0, 3))
        self._at: float | None = None  # [s] of the estimate
        self.pose, self._covariance = _NO_POSE, _UNKNOWN

    @property
    def covariance(self) -> FloatArray:
        """Of the last pose (3, 3) [m^2, m rad, rad^2]; NaN while the car is not found."""
        return self._covariance

    def locate(self, scan: LaserScan, odometry: Odometry) -> FloatArray:
        """Return the pose at the odometry's stamp (3,): x [m], y [m], heading [rad]; NaN while it is not known."""
        now, method = odometry.stamp, self.method
        reading = now, odometry.speed, odometry.yaw_rate
        if not all(map(math.isfinite, reading)):
            self.pose, self._covariance = _NO_POSE, _UNKNOWN
            return self.pose
        if self._at is None or now < self._readings[-1, 0]:
            self._begin(scan, odometry)
        elif now > self._readings[-1, 0]:
            self._readings = np.vstack((self._readings[1 - _KEPT :], reading))
        assert self._at is not None
        if self._at < scan.stamp <= now:
            way, turn = driven(self._readings, self._at, scan.stamp)
            method.move(way, turn)
            self._at = scan.stamp
            ends = self._ends(scan)
            if len(ends) > 2:
                method.see(ends)
        if not method.found:
            self.pose, self._covariance = _NO_POSE, _UNKNOWN
            return self.pose
        state, covariance = method.state, method.covariance
        times = self._readings[self._readings[:, 0] > self._at, 0].tolist()
        for before, after in zip([self._at, *times], times, strict=False):
            way, turn = driven(self._readings, before, after)
            state, covariance = predicted(state, covariance, way, turn, *step_errors(way, turn), 0.0)
        self.pose = read_only((state[0], state[1], math.remainder(state[2], 2.0 * math.pi)))
        self._covariance = read_only(covariance[:3, :3])
        return self.pose

    def _begin(self, scan: LaserScan, odometry: Odometry) -> None:
        """Begin at the first tick, and where time goes back."""
        self._readings = np.array([(odometry.stamp, odometry.speed, odometry.yaw_rate)])
        self._at = min(scan.stamp, odometry.stamp)
        pose: FloatArray | None = None
        if self._knows_start and np.isfinite(odometry.pose).all():
            place, heading = START
            pose = odometry.pose + self._rng.normal(0.0, (place, place, heading))
        self.method.start(pose, START)
        self._at -= 1e-9  # the first scan counts

    def _ends(self, scan: LaserScan) -> FloatArray:
        """Return where beams ended (b, 2) [m], in the frame of the rear axle at the scan's stamp."""
        count = len(scan.ranges)
        if count == 0:
            return np.empty((0, 2))
        beams = np.unique(np.linspace(0, count - 1, min(self.method.beams, count)).round().astype(int))
        ranges = np.asarray(scan.ranges)[beams]
        known = np.isfinite(ranges) & (ranges > scan.range_min) & (ranges < scan.range_max)
        beams, ranges = beams[known], ranges[known]
        bearings = scan.bearings[beams]
        ends = np.column_stack((self._car.lidar_offset + ranges * np.cos(bearings), ranges * np.sin(bearings)))
        if scan.time_increment == 0.0:
            return ends
        before = scan.time_increment * (beams - (count - 1))  # [s], not positive
        _, speed, rate = self._readings[-1]
        turned, moved = rate * (1.0 + self.method.state[4]) * before, speed * (1.0 + self.method.state[3]) * before
        cos, sin = np.cos(turned), np.sin(turned)
        return np.column_stack(
            (
                cos * ends[:, 0] - sin * ends[:, 1] + moved * np.cos(0.5 * turned),
                sin * ends[:, 0] + cos * ends[:, 1] + moved * np.sin(0.5 * turned),
            )
        )
