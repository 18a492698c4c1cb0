"""Recorded beams of a LiDAR beside those cast from the recorded poses, and where the LiDAR sits on the car.

    mount = fit_mount(recorded, walls)
    fitted = fit_poses(recorded, walls, mount)

A beam k of a sweep is taken at its own time: the mirror turns once in a period, so a car at 3 m/s moves by 5 cm from
the first beam to the last. The pose belongs to the beam that looks straight ahead.

Differences are measured square to the wall, `(recorded - cast) * cosine of incidence`, where a pose that is 3 cm off
makes 3 cm at any angle. All fits weigh a difference e with (1 + (e / SCALE)^2)^-2 (Geman and McClure 1987), so that
beams that see what is not in the map hardly count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import FloatArray

if TYPE_CHECKING:
    from .drive_recording import RecordedDrive
    from .wall_rays import MapWalls, RayHits

BoolArray = NDArray[np.bool_]

SCALE = 0.05
"""[m] square to the wall, from which on a difference counts less and less: the pixel of most maps."""

MOST_BEAMS = 60
"""Of a scan: neighbours see the same wall, and say nothing more of the pose."""

PERIOD = 0.025
"""[s] in which the mirror of a UST-10LX turns once."""

_MOUNT_ROUNDS, _POSE_ROUNDS = 12, 8  # in which the fits settle to below a millimetre
_MOUNT_ROWS = 300  # of a drive, evenly taken, are enough for five numbers
_POSE_SPREAD = np.array((0.3, 0.3, 0.1))  # [m, m, rad] of a weak prior, so that a scan of one wall has an answer


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedBeams:
    """A drive with beams, as recorded. Arrays of the same length; beams are nan where they failed."""

    name: str
    time: FloatArray  # (n,) [s]
    poses: FloatArray  # (n, 3) x, y [m], yaw [rad] in the map's frame
    speed: FloatArray  # (n,) [m/s]
    yaw_rate: FloatArray  # (n,) [rad/s]
    ranges: FloatArray  # (n, m) [m]; inf: no return
    bearings: FloatArray  # (m,) [rad] from straight ahead, left positive

    @classmethod
    def of(cls, drive: RecordedDrive) -> RecordedBeams:
        """Return the beams of a drive, at most MOST_BEAMS of each scan, evenly taken.

        Raises:
          SettingsError: it has no beams, or no poses.
        """
        lacking = [name for name in ("beams", "pose") if getattr(drive, name) is None]
        if drive.beams is None or drive.pose is None:
            what = " and no ".join(lacking)
            raise SettingsError(f"{drive.name}: has no {what}; accepted: drives with beams of a LiDAR and with poses")
        time = drive.beams.time
        within = (time >= drive.start) & (time <= drive.end)
        if not within.any():
            raise SettingsError(f"{drive.name}: has no scan while all else was measured; accepted: clocks that agree")
        rows = drive.rows_at(time[within])
        assert rows.pose is not None
        step = math.ceil(len(drive.beams.bearings) / MOST_BEAMS)
        source = drive.part_of or drive.name
        return cls(
            name=Path(source).stem + drive.name.removeprefix(source), time=rows.time, poses=np.array(rows.pose),
            speed=rows.speed, yaw_rate=rows.yaw_rate, ranges=np.array(drive.beams.ranges[within][:, ::step]),
            bearings=drive.beams.bearings[::step],
        )  # fmt: skip

    def rows(self, which: NDArray[np.intp] | BoolArray | slice, name: str | None = None) -> RecordedBeams:
        """Return some of its rows as a drive."""
        taken = {key: getattr(self, key)[which] for key in ("time", "poses", "speed", "yaw_rate", "ranges")}
        return replace(self, name=name or self.name, **taken)


@dataclass(frozen=True, kw_only=True)
class LidarMount:
    """Where a LiDAR sits relative to the recorded pose, and what all walls of the map are off by."""

    ahead: float  # [m] of the pose
    left: float  # [m]
    yaw: float  # [rad] left positive
    delay: float  # [s] by which the beams are later than the pose of their row
    wall_depth: float  # [m] by which the walls lie behind where the map has them, square to them

    def as_array(self) -> FloatArray:
        """Return the five numbers in the order of the fields."""
        return np.array((self.ahead, self.left, self.yaw, self.delay, self.wall_depth))

    @classmethod
    def of(cls, values: FloatArray) -> LidarMount:
        """Return the mount of five numbers in the order of the fields."""
        ahead, left, yaw, delay, depth = map(float, values)
        return cls(ahead=ahead, left=left, yaw=yaw, delay=delay, wall_depth=depth)


@dataclass(frozen=True, kw_only=True, eq=False)
class CastBeams:
    """The beams of a drive, cast from its poses."""

    hits: RayHits  # (n, m)
    differences: FloatArray  # (n, m) [m] recorded less cast, square to the wall, less the walls' depth
    headings: FloatArray  # (n, m) [rad] of the car when each beam was taken


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedPoses:
    """The poses of a drive, each moved so that its beams agree with the map, and the beams cast from there."""

    moves: FloatArray  # (n, 3) [m, m, rad] from the recorded pose, in the map's frame
    cast: CastBeams


def cast_beams(
    recorded: RecordedBeams, walls: MapWalls, mount: LidarMount, *, moves: FloatArray | None = None
) -> CastBeams:
    """Return the beams of a drive as cast from its poses, each at its own time in the sweep.

    Args:
      recorded: the drive.
      walls: of the map.
      mount: of the LiDAR.
      moves: (n, 3) to add to the poses [m, m, rad]; None: none.
    """
    poses = recorded.poses if moves is None else recorded.poses + moves
    late = mount.delay + PERIOD * recorded.bearings / math.tau  # (m,) [s] from the pose to each beam
    speed, yaw_rate = recorded.speed[:, None], recorded.yaw_rate[:, None]
    headings = poses[:, 2:] + yaw_rate * late
    middle = poses[:, 2:] + 0.5 * yaw_rate * late
    cosines, sines = np.cos(headings), np.sin(headings)
    x = poses[:, :1] + speed * late * np.cos(middle) + mount.ahead * cosines - mount.left * sines
    y = poses[:, 1:2] + speed * late * np.sin(middle) + mount.ahead * sines + mount.left * cosines
    hits = walls.hits(np.stack((x, y), axis=-1), headings + mount.yaw + recorded.bearings)
    with np.errstate(invalid="ignore"):  # inf - inf of a beam without a return into a gap
        differences = (recorded.ranges - hits.ranges) * hits.cosines - mount.wall_depth
    return CastBeams(hits=hits, differences=differences, headings=headings)


def fit_mount(recorded: RecordedBeams, walls: MapWalls) -> LidarMount:
    """Return where the LiDAR sits, from the rows of one drive; its poses are taken to be right in the mean.

    Method: Gauss-Newton with robust weights, from .25 m ahead.
    """
    step = max(1, len(recorded.time) // _MOUNT_ROWS)
    some = recorded.rows(slice(None, None, step))
    values = LidarMount(ahead=0.25, left=0.0, yaw=0.0, delay=0.0, wall_depth=0.5 * walls.resolution).as_array()
    for _ in range(_MOUNT_ROUNDS):
        cast = cast_beams(some, walls, LidarMount.of(values))
        by_x, by_y, by_angle = np.moveaxis(cast.hits.derivatives, -1, 0)
        cosines, sines = np.cos(cast.headings), np.sin(cast.headings)
        by_ahead, by_left = by_x * cosines + by_y * sines, by_y * cosines - by_x * sines
        by_delay = by_ahead * some.speed[:, None] + by_angle * some.yaw_rate[:, None]
        columns = [column * cast.hits.cosines for column in (by_ahead, by_left, by_angle, by_delay)]
        slopes = np.stack((*columns, np.ones_like(by_x)), axis=-1)
        usable = np.isfinite(cast.differences)
        slopes, differences = slopes[usable], cast.differences[usable]
        weighted = slopes * _weights(differences)[:, None]
        values += np.linalg.lstsq(weighted.T @ slopes, weighted.T @ differences, rcond=None)[0]
    return LidarMount.of(values)


def fit_poses(
    recorded: RecordedBeams, walls: MapWalls, mount: LidarMount, *, offsets: FloatArray | None = None
) -> FittedPoses:
    """Return the poses at which the beams of each row agree best with the map.

    Args:
      recorded: the drive.
      walls: of the map.
      mount: of the LiDAR.
      offsets: (n, m) [m] by which the wall that each beam meets lies behind where the map has it, besides the mount's
        `wall_depth`; None: 0.
    """
    moves = np.zeros((len(recorded.time), 3))
    prior = (SCALE / _POSE_SPREAD) ** 2
    for _ in range(_POSE_ROUNDS):
        cast = cast_beams(recorded, walls, mount, moves=moves)
        slopes = cast.hits.derivatives * cast.hits.cosines[..., None]
        found = cast.differences if offsets is None else cast.differences - offsets
        usable = np.isfinite(found)
        differences = np.where(usable, found, 0.0)
        weights = np.where(usable, _weights(differences), 0.0)
        matrices = np.einsum("kb,kbi,kbj->kij", weights, slopes, slopes) + np.diag(prior)
        right = np.einsum("kb,kbi,kb->ki", weights, slopes, differences) - moves * prior
        moves = moves + np.linalg.solve(matrices, right[..., None])[..., 0]
    return FittedPoses(moves=moves, cast=cast_beams(recorded, walls, mount, moves=moves))


def _weights(differences: FloatArray) -> FloatArray:
    return np.asarray((1.0 + (differences / SCALE) ** 2) ** -2)
