"""The cars that are to be overtaken: each is, at each place of the course, slower than the planner is there alone.

The planner first drives alone, two laps from a standing start. What it did in the second is its pace. An opponent of
the speed ratio .6 drives no faster than .6 of the pace at the place where it is. So its lap takes about 1/.6 of the
planner's, however the course winds, which a limit of .6 of the greatest speed does not say.

centreline   pure_pursuit on the centreline
raceline     pure_pursuit on a line of least curvature between the walls
reactive     gap_finder, which sees the course and the planner's car
blocking     pure_pursuit off the centreline: on the side on which the planner's car comes up behind it

`blocking` is a test instrument. It is told where the planner's car is, and moves aside by half of the room that it has,
no faster than BLOCKING_RATE. It goes on to do so until the planner's car is next to it.

Those on a lane are pure_pursuit on the line of least curvature in a part of the course, and drive a share of the speed
that it would drive there.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from fg_mujoco.course.projection import follow
from fg_mujoco.course.track import Track
from fg_mujoco.errors import Note
from fg_mujoco.messages import (
    CarParameters,
    Controller,
    DriveCommand,
    FloatArray,
    LaserScan,
    Odometry,
    PlannerContext,
    read_only,
)
from fg_mujoco.racing.planners import make_controller
from fg_mujoco.simulation.settings import Start

OPPONENTS = ("centreline", "raceline", "reactive", "blocking")
"""Kinds of opponents."""

LANES = {
    "right": (-1.0, -1.0 / 3.0), "middle": (-1.0 / 3.0, 1.0 / 3.0), "left": (1.0 / 3.0, 1.0), "raceline": (-1.0, 1.0)
}  # fmt: skip
"""Lanes of a course, by name: the part of the room between the walls that the opponent's line may use."""

BLOCKING_RATE = 0.5  # [m/s] sideways
BLOCKING_FROM = 6.0  # [m] ahead of the planner's car: further on it keeps to the centreline
_BLOCKING_SHARE = 0.5  # of the room between the car on the centreline and the nearer wall
_LEAST_SPEED = 0.3  # [m/s] of an opponent, so that one behind a planner that stands still in its lap does not stop
_SPACING = 0.5  # [m] of the points of the line of least curvature
_CLEARANCE = 0.15  # [m] of that line's car to the walls
_ROUNDS = 4000  # of the descent


@dataclass(frozen=True, eq=False)
class Pace:
    """Speed of a planner at each place of a course, alone."""

    s: FloatArray  # (n,) [m] along the centreline, increasing
    speed: FloatArray  # (n,) [m/s]
    length: float  # [m] of a lap

    def at(self, s: float) -> float:
        """Return the speed [m/s] at a place [m], any number of laps on."""
        return float(np.interp(s % self.length, self.s, self.speed, period=self.length))


class Slowed:
    """A planner that drives no faster than a share of a pace.

    Args:
      planner: that drives.
      track: of the pace.
      pace: of the planner that is to overtake.
      ratio: of the speeds.
    """

    def __init__(self, planner: Controller, track: Track, pace: Pace, ratio: float) -> None:
        self._planner, self._track, self._pace, self._ratio = planner, track, pace, ratio
        self.reset()

    def reset(self) -> None:
        """Forget everything seen so far."""
        self._planner.reset()
        self._s = math.nan

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Answer the planner's command, slower if need be."""
        s, _ = self.place(odometry)
        command = self._planner(scan, self.sensed(odometry))
        most = max(self._ratio * self._pace.at(s), _LEAST_SPEED)
        return replace(command, speed=min(command.speed, most))

    def place(self, odometry: Odometry) -> tuple[float, float]:
        """Return the distance of the car along the centreline, and to the left of it [m]."""
        x, y, _ = odometry.pose.tolist()
        if math.isnan(self._s):
            self._s = float(self._track.project([[x, y]])[0][0])
        self._s, offset = follow(x, y, self._s, self._track.table, self._track.length)
        return self._s, offset

    def sensed(self, odometry: Odometry) -> Odometry:
        """Return the odometry for its planner."""
        return odometry


class Blocking(Slowed):
    """Drives off the centreline, on the side of a follower.

    Arguments are those of Slowed, and:

    Args:
      car: its parameters.
    """

    def __init__(self, planner: Controller, track: Track, pace: Pace, ratio: float, car: CarParameters) -> None:
        super().__init__(planner, track, pace, ratio)
        self._width, self._length = car.width, car.length

    def reset(self) -> None:
        """Forget everything seen so far."""
        super().reset()
        self._aside, self._other_s = 0.0, math.nan

    def sensed(self, odometry: Odometry) -> Odometry:
        """Return odometry whose pose is as far to the other side as the car is to keep from its line."""
        s, _ = self.place(odometry)
        behind, offset = self._follower(s, odometry)
        wanted = 0.0
        if self._length < behind < BLOCKING_FROM:
            wanted = math.copysign(_BLOCKING_SHARE * self._room(s), offset)
        elif -self._length <= behind <= self._length:
            wanted = self._aside  # it does not turn into a car next to it
        step = BLOCKING_RATE * 0.025
        self._aside += max(-step, min(step, wanted - self._aside))
        x, y, heading = odometry.pose.tolist()
        along = self._track.start_pose(s)[2]
        moved = read_only((x + self._aside * math.sin(along), y - self._aside * math.cos(along), heading))
        return replace(odometry, pose=moved)

    def _follower(self, s: float, odometry: Odometry) -> tuple[float, float]:
        """Return how far the other car is behind along the centreline [m], negative ahead, and its offset [m]."""
        x, y = odometry.readings["opponents"].values[:2].tolist()
        if math.isnan(self._other_s):
            self._other_s = float(self._track.project([[x, y]])[0][0])
        self._other_s, offset = follow(x, y, self._other_s, self._track.table, self._track.length)
        return math.remainder(s - self._other_s, self._track.length), offset

    def _room(self, s: float) -> float:
        """Return the room of the car to either side of the centreline [m]."""
        track = self._track
        sides = (track.corridor_right, track.corridor_left)
        room = min(float(np.interp(s, track.arc_length, side, period=track.length)) for side in sides)
        return max(room - 0.5 * self._width - _CLEARANCE, 0.0)


class Scaled:
    """A planner whose commanded speeds are multiplied by a share."""

    def __init__(self, planner: Controller, share: float) -> None:
        self._planner, self._share = planner, share

    def reset(self) -> None:
        """Forget everything seen so far."""
        self._planner.reset()

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Answer the planner's command, slower."""
        command = self._planner(scan, odometry)
        return replace(command, speed=self._share * command.speed)


def make_opponent(
    kind: str, track: Track, pace: Pace | None, share: float, context: PlannerContext, lines: Path
) -> Controller:
    """Return an opponent.

    Args:
      kind: one of OPPONENTS; without a pace, of LANES.
      track: that it drives on.
      pace: of the planner that is to overtake it; None: the share is of its own speed.
      share: of the speed.
      context: of its planner.
      lines: folder to which the line that it follows is written.
    """
    if kind == "reactive" and pace is not None:
        return Slowed(make_controller("gap_finder", context), track, pace, share)
    settings = {}
    if pace is None or kind == "raceline":
        path = lines / "line.csv"
        write_line(path, lane_line(track, context.car, kind))
        settings = {"line": str(path)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Note)  # the file is none of the user's
        planner = make_controller("pure_pursuit", context, settings=settings)
    if pace is None:
        return Scaled(planner, share)
    if kind == "blocking":
        return Blocking(planner, track, pace, share, context.car)
    return Slowed(planner, track, pace, share)


@lru_cache(maxsize=32)
def lane_line(track: Track, car: CarParameters, lane: str) -> FloatArray:
    """Return the line of least curvature in a lane of a course. Shape (n, 2) [m]."""
    return least_curvature(track, car, LANES[lane])


def start_on(track: Track, car: CarParameters, lane: str, s: float) -> Start:
    """Return the start on a lane's line that is nearest to a place along the centreline [m]."""
    places, offsets = track.project(lane_line(track, car, lane))
    apart = np.abs((places - s + 0.5 * track.length) % track.length - 0.5 * track.length)
    nearest = int(apart.argmin())
    return Start(s=float(places[nearest]), offset=float(offsets[nearest]))


def write_line(path: Path, points: FloatArray) -> None:
    """Write a line (n, 2) [m] as pure_pursuit reads one."""
    rows = "".join(f"{x!r}, {y!r}\n" for x, y in points.tolist())
    path.write_text(f"# x_m, y_m\n{rows}", encoding="utf-8")


def least_curvature(track: Track, car: CarParameters, lane: tuple[float, float] = (-1.0, 1.0)) -> FloatArray:
    """Return a closed line between the walls whose bends are as wide as they can be. Shape (n, 2) [m].

    The points move square to the centreline, and the sum of the squares of their second differences falls: projected
    gradient descent with Nesterov's momentum.

    Args:
      track: that it is on.
      car: whose middle moves on it.
      lane: of the room between the walls, from -1 at the right one to 1 at the left one.
    """
    count = max(round(track.length / _SPACING), 8)
    stations = np.arange(count) * (track.length / count)
    middle, left = track.position(stations, 0.0), track.position(stations, 1.0)
    normal = left - middle
    room = [
        np.maximum(np.interp(stations, track.arc_length, side, period=track.length) - 0.5 * car.width - _CLEARANCE, 0.0)
        for side in (track.corridor_right, track.corridor_left)
    ]
    low, high = (np.where(share < 0.0, room[0], room[1]) * share for share in lane)
    offset = ahead = np.clip(np.zeros(count), low, high)
    momentum = 1.0
    for _ in range(_ROUNDS):
        bend = _second_difference(middle + ahead[:, np.newaxis] * normal)
        slope = np.sum(_second_difference(bend) * normal, axis=1)
        moved = np.clip(ahead - slope / 16.0, low, high)  # 16 is the greatest eigenvalue
        grown = 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * momentum * momentum))
        ahead = moved + (momentum - 1.0) / grown * (moved - offset)
        offset, momentum = moved, grown
    return read_only(middle + offset[:, np.newaxis] * normal)


def _second_difference(points: FloatArray) -> FloatArray:
    """Return the curvature vectors of a closed line at its points, (n, 2)."""
    closed = np.concatenate((points[-1:], points, points[:1]))
    bend: FloatArray = closed[:-2] - 2.0 * points + closed[2:]
    return bend
