"""Measures the errors of a real LiDAR: recorded beams of drives beside those cast in the map that they were driven in.

    python benchmarks/lidar_errors.py DRIVE.csv ... --map MAP.yaml [--columns FILE.toml] [--out my_lidar.toml]

`--lidar-effects my_lidar.toml` gives a simulated LiDAR the noise, bias and dropouts that this finds.

Everything is shown on rows that it was not fitted on: the mount of the LiDAR and the errors of the map are those that
the other drives say; of a single drive the first half and the second half are two drives.

1. Each scan's pose is moved so that its beams agree with the map (`fit_poses`): an error of the pose is common to all
   beams of a scan. Differences of more than FURTHEST square to the wall are beams that do not see what is in the map.
2. The mean difference at each place of the walls, over the other drives, is the map's error there. It is subtracted,
   and the poses are fitted again.
3. The sensor's noise is what changes from one scan to the next where a beam meets the same place of the wall, within
   SAME_PLACE. A bias of all beams looks like walls that lie deeper than in the map, and is told as `wall_depth`.

A beam is taken at its own time: the mirror turns once in a period, and the pose belongs to the beam straight ahead.
Differences are measured square to the wall, `(recorded - cast) * cosine of incidence`. All fits weigh a difference e
with (1 + (e / SCALE)^2)^-2 (Geman and McClure 1987), so that beams that see what is not in the map hardly count.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from common import table
from numpy.typing import NDArray

from fg_mujoco.addons.realcar.drives.drive_recording import RecordedDrive
from fg_mujoco.addons.realcar.drives.reading import read_drives
from fg_mujoco.addons.realcar.measured_errors import MeasuredErrors
from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.course.maps.map_server import read_map_file
from fg_mujoco.course.maps.walls import outlines, trace
from fg_mujoco.errors import SettingsError, TrackError
from fg_mujoco.messages import FloatArray

BoolArray = NDArray[np.bool_]

_STEEPEST = 0.1  # least cosine of the angle of incidence by which a derivative divides
SCALE = 0.05
"""[m] square to the wall, from which on a difference counts less and less: the pixel of most maps."""

MOST_BEAMS = 60
"""Of a scan: neighbours see the same wall, and say nothing more of the pose."""

PERIOD = 0.025
"""[s] in which the mirror of a UST-10LX turns once."""

_MOUNT_ROUNDS, _POSE_ROUNDS = 12, 8  # in which the fits settle to below a millimetre
_MOUNT_ROWS = 300  # of a drive, evenly taken, are enough for five numbers
_POSE_SPREAD = np.array((0.3, 0.3, 0.1))  # [m, m, rad] of a weak prior, so that a scan of one wall has an answer

FURTHEST = 0.15
"""[m] square to the wall, after the pose is fitted: a beam that differs by more does not see what is in the map."""

POSE_JUMP, HEADING_JUMP = 0.15, 0.15
"""[m], [rad] by which a pose may differ from what speed and yaw rate make of the one before."""

MOST_MOVED, MOST_TURNED = 0.3, 0.15
"""[m], [rad] by which a pose may be moved to agree with the map; beyond it the pose is lost, and its row left out."""

SAME_PLACE = 0.02
"""[m] along the wall within which two scans meet the same place, so that what differs between them is noise."""

RANGE_EDGES = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0)
"""[m] of the cast range, of the tables."""

BEARING_EDGES = tuple(math.radians(each) for each in (-135, -90, -60, -30, -10, 10, 30, 60, 90, 135))
"""[rad] of the tables."""

_GRAZING = 0.5  # least cosine of incidence of a beam from which noise is read: beyond 60 degrees the map decides
_FEWEST = 100  # beams or pairs of a cell of the table; with fewer it takes the value of its range
_FEWEST_HERE = 10  # beams of other drives at a place of the walls that say how the map is off there
_ROUNDS = 2  # of the map's errors and the poses
_WRONG_MAP = 0.5  # [m] median difference as recorded, beyond which a drive is not in the map
_STANDS, _STILL = 0.02, 0.02  # [m/s], [rad/s] below which the car stands


@dataclass(frozen=True, kw_only=True, eq=False)
class RayHits:
    """Where rays meet walls first. Arrays have the shape (...) of the rays."""

    ranges: FloatArray  # [m]; inf: no wall
    cosines: FloatArray  # of the angle of incidence, 0 to 1; 0 without a wall
    along: FloatArray  # [m] arc length of the place along all walls
    derivatives: FloatArray  # (..., 3) of the range by x, y [-] and angle [m/rad] of the ray


@dataclass(frozen=True, kw_only=True, eq=False)
class MapWalls:
    """The walls of a map as segments from `starts` (k, 2) to `ends` (k, 2) [m]."""

    starts: FloatArray
    ends: FloatArray
    resolution: float  # [m] of a pixel of the map

    @classmethod
    def of(cls, path: str | Path) -> MapWalls:
        """Return the walls of a map_server YAML: the edges of its free ground.

        Raises:
          MissingExtraError: the extra `maps` is not installed.
          TrackError: a YAML or an image that cannot be read, or no wall in it.
        """
        occupancy = read_map_file(path)
        # the image's border is no wall: what is beyond it is free here, and ends no ray
        padded = replace(occupancy, free=np.pad(occupancy.free, 1, constant_values=True))
        loops = [trace(outline) - 1.0 for outline in outlines(~padded.free)]
        if not loops:
            raise TrackError(f"{path}: no wall in the map; accepted: a map with occupied pixels")
        walls = [occupancy.to_world(loop) for loop in loops]
        ends = np.concatenate([np.roll(wall, -1, axis=0) for wall in walls])
        return cls(starts=np.concatenate(walls), ends=ends, resolution=occupancy.resolution)

    def hits(self, origins: FloatArray, angles: FloatArray, *, reach: float = 30.0) -> RayHits:
        """Return where rays from `origins` (..., 2) [m] at `angles` (...) [rad] first meet walls, up to `reach` [m]."""
        flat = np.ascontiguousarray(angles, np.float64).ravel()
        places = np.ascontiguousarray(origins, np.float64).reshape(-1, 2)
        ranges, which = _first_hits(self.starts, self.ends, places, flat, reach)
        tangents = self.ends - self.starts
        lengths = np.hypot(*tangents.T)
        normals = np.stack((tangents[:, 1], -tangents[:, 0]), axis=1) / lengths[:, None]
        ahead = np.stack((np.cos(flat), np.sin(flat)), axis=1)
        hit = which >= 0
        normal = np.where(hit[:, None], normals[which], 0.0)
        cosine = np.sum(ahead * normal, axis=1)
        divisor = np.where(np.abs(cosine) < _STEEPEST, np.copysign(_STEEPEST, cosine), cosine)
        leftward = np.stack((-ahead[:, 1], ahead[:, 0]), axis=1)
        turned = -np.where(hit, ranges, 0.0) * np.sum(leftward * normal, axis=1) / divisor
        derivatives = np.column_stack((-normal / divisor[:, None], turned))
        ends = places + np.where(hit, ranges, 0.0)[:, None] * ahead
        begins = np.concatenate(([0.0], np.cumsum(lengths)))
        along = begins[which] + np.hypot(*(ends - self.starts[which]).T)
        shape = np.shape(angles)
        return RayHits(
            ranges=ranges.reshape(shape), cosines=np.abs(cosine).reshape(shape),
            along=np.where(hit, along, 0.0).reshape(shape), derivatives=derivatives.reshape(*shape, 3),
        )  # fmt: skip

    @property
    def length(self) -> float:
        """Length of all walls together [m]."""
        return float(np.hypot(*(self.ends - self.starts).T).sum())


@kernel
def _first_hits(
    starts: FloatArray, ends: FloatArray, origins: FloatArray, angles: FloatArray, reach: float
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return range [m] and segment of the first wall along each ray; inf and -1 where there is none within `reach`."""
    ranges, which = np.full(len(angles), np.inf), np.full(len(angles), -1)
    for ray in range(len(angles)):
        x, y = math.cos(angles[ray]), math.sin(angles[ray])
        nearest = reach
        for segment in range(len(starts)):
            from_x, from_y = starts[segment, 0] - origins[ray, 0], starts[segment, 1] - origins[ray, 1]
            along_x, along_y = ends[segment, 0] - starts[segment, 0], ends[segment, 1] - starts[segment, 1]
            before = x * from_y - y * from_x  # to which side of the ray the segment begins, and ends
            after = before + x * along_y - y * along_x
            if (before > 0.0) == (after > 0.0):
                continue
            distance = (from_x * along_y - from_y * along_x) / (after - before)
            if 0.0 < distance < nearest:
                nearest = distance
                ranges[ray], which[ray] = distance, segment
    return ranges, which


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


@dataclass(frozen=True, kw_only=True)
class Band:
    """The errors of the beams of a band of ranges."""

    least: float  # [m]
    greatest: float
    noise: float  # [m] of the sensor, from pairs of scans
    pairs: int  # of beams that meet the same place in two scans
    bias: float  # [m] median of recorded less cast, after all fits
    nearer: float  # share of beams that see something before the map's wall
    farther: float  # share of beams that see through it
    dropouts: float  # share of beams without a return, though the map has a wall in reach


@dataclass(frozen=True, kw_only=True)
class BeamComparison:
    """Recorded and cast beams of drives."""

    mount: LidarMount  # mean of the drives
    mount_error: LidarMount  # standard error of that mean, from the spread of the drives
    by_range: list[Band]
    errors: MeasuredErrors  # of the LiDAR


@dataclass(eq=False)
class _Part:
    """A drive, or half of one, with what is found of it."""

    drive: RecordedBeams
    left_out: BoolArray  # (n,) rows whose pose jumps
    own_mount: LidarMount
    mount: LidarMount  # of the other parts
    fit: FittedPoses
    offsets: FloatArray  # (n, m) [m] the map's error where each beam ends
    known: BoolArray  # (n, m) whether other drives have seen that place

    @property
    def lost(self) -> BoolArray:
        """Rows whose pose had to be moved too far."""
        moved = np.hypot(self.fit.moves[:, 0], self.fit.moves[:, 1]) > MOST_MOVED
        return np.asarray(moved | (np.abs(self.fit.moves[:, 2]) > MOST_TURNED))

    @property
    def rows(self) -> BoolArray:
        """Rows that are not left out, as (n, 1)."""
        return np.asarray(~(self.left_out | self.lost)[:, None])

    @property
    def returns(self) -> BoolArray:
        """Beams that are a range, where the map has a wall in reach."""
        return np.asarray(np.isfinite(self.drive.ranges) & np.isfinite(self.fit.cast.hits.ranges))

    @property
    def rest(self) -> FloatArray:
        """What is left of the differences square to the wall [m]."""
        return self.fit.cast.differences - self.offsets

    @property
    def seen(self) -> BoolArray:
        """Beams that see what is in the map, of the rows that are not left out."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.rows & self.returns & (np.abs(self.rest) <= FURTHEST))


def compare_beams(drives: Sequence[RecordedBeams], walls: MapWalls, *, source: str = "") -> BeamComparison:
    """Return how far the recorded beams of drives in the frame of a map are from those cast in it.

    Raises:
      SettingsError: a drive without a return, or one that is not in the map.
    """
    parts = [_part(piece, walls) for piece in (drives if len(drives) > 1 else _halves(drives[0]))]
    mounts = np.array([part.own_mount.as_array() for part in parts])
    for index, part in enumerate(parts):
        part.mount = LidarMount.of(np.delete(mounts, index, axis=0).mean(axis=0))
        part.fit = fit_poses(part.drive, walls, part.mount)
    for _ in range(_ROUNDS):
        _learn_map(parts, walls)
        for part in parts:
            part.fit = fit_poses(part.drive, walls, part.mount, offsets=part.offsets)
    return BeamComparison(
        mount=LidarMount.of(mounts.mean(axis=0)),
        mount_error=LidarMount.of(mounts.std(axis=0, ddof=1) / math.sqrt(len(mounts))),
        by_range=_bands(parts), errors=_errors(parts, source),
    )  # fmt: skip


def _halves(drive: RecordedBeams) -> list[RecordedBeams]:
    middle = len(drive.time) // 2
    named = ((slice(None, middle), "first half"), (slice(middle, None), "second half"))
    return [drive.rows(part, f"{drive.name}, {name}") for part, name in named]


def _part(drive: RecordedBeams, walls: MapWalls) -> _Part:
    """Return a drive with the mount that it says itself."""
    jumps = pose_jumps(drive)
    moving = ~jumps & (np.abs(drive.speed) > _STANDS)
    if np.count_nonzero(moving) < _FEWEST or not np.isfinite(drive.ranges).any():
        said = f"{drive.name}: {np.count_nonzero(moving)} rows in which the car moves and its pose does not jump"
        raise SettingsError(f"{said}; accepted: {_FEWEST} or more, with beams that return")
    mount = fit_mount(drive.rows(moving), walls)
    fit = fit_poses(drive.rows(slice(0, 1)), walls, mount)  # stands for the one that follows
    cast = cast_beams(drive, walls, mount)
    away = np.abs(drive.ranges - cast.hits.ranges)[np.isfinite(drive.ranges) & np.isfinite(cast.hits.ranges)]
    if len(away) == 0 or np.median(away) > _WRONG_MAP:
        off = f"its beams are off by {np.median(away):.2f} m in the median" if len(away) else "no beam meets a wall"
        raise SettingsError(f"{drive.name} was not driven in this map: {off}; accepted: less than {_WRONG_MAP} m")
    none = np.zeros(drive.ranges.shape)
    return _Part(drive, jumps, mount, mount, fit, none, none > 0.0)


def pose_jumps(drive: RecordedBeams) -> BoolArray:
    """Return the rows (n,) beside which the pose is not what speed and yaw rate make of the one before."""
    seconds, (x, y, yaw) = np.diff(drive.time), drive.poses.T
    speed, turn = (0.5 * (each[1:] + each[:-1]) * seconds for each in (drive.speed, drive.yaw_rate))
    middle = yaw[:-1] + 0.5 * turn
    away = np.hypot(np.diff(x) - speed * np.cos(middle), np.diff(y) - speed * np.sin(middle))
    turned = np.abs((np.diff(yaw) - turn + math.pi) % math.tau - math.pi)
    jumped = (away > POSE_JUMP) | (turned > HEADING_JUMP)
    return np.asarray(np.append(jumped, False) | np.append(False, jumped))


def _learn_map(parts: list[_Part], walls: MapWalls) -> None:
    """Have each part know the mean difference at each place of the walls that the others see."""
    count = math.ceil(walls.length / walls.resolution) + 1
    places = [np.minimum((part.fit.cast.hits.along / walls.resolution).astype(np.int64), count - 1) for part in parts]
    sums, counts = np.zeros((len(parts), count)), np.zeros((len(parts), count))
    for index, (part, place) in enumerate(zip(parts, places, strict=True)):
        usable = part.seen & (part.fit.cast.hits.cosines > _GRAZING)
        sums[index] = np.bincount(place[usable], part.fit.cast.differences[usable], count)
        counts[index] = np.bincount(place[usable], minlength=count)
    for index, (part, place) in enumerate(zip(parts, places, strict=True)):
        others, seen = sums.sum(axis=0) - sums[index], counts.sum(axis=0) - counts[index]
        known = seen >= _FEWEST_HERE
        part.known = known[place]
        part.offsets = np.where(known, others / np.maximum(seen, 1.0), 0.0)[place]


def _deviation(values: FloatArray) -> float:
    """Return the robust standard deviation: half of the width that holds the middle 68.27 %."""
    if len(values) == 0:
        return math.nan
    low, high = np.quantile(values, (0.158655, 0.841345))
    return float(0.5 * (high - low))


def _along_beam(part: _Part) -> FloatArray:
    """Return what is left of the differences along the beam [m], with the freedom that the fitted pose took."""
    count = part.seen.sum(axis=1, keepdims=True)
    freedom = np.sqrt(count / np.maximum(count - 3.0, 1.0))
    rest = np.where(part.returns, part.rest, np.nan)
    return np.asarray(rest / np.maximum(part.fit.cast.hits.cosines, 0.1) * freedom)


def _pairs(part: _Part) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the noise of beams that meet the same place in two scans [m], their ranges [m] and bearings [rad]."""
    hits, usable = part.fit.cast.hits, _square_on(part)
    same = usable[1:] & usable[:-1] & (np.abs(np.diff(hits.along, axis=0)) < SAME_PLACE)
    left = np.where(usable, _along_beam(part), 0.0)
    bearings = np.broadcast_to(part.drive.bearings, hits.ranges.shape)
    return np.diff(left, axis=0)[same] / math.sqrt(2.0), hits.ranges[1:][same], bearings[1:][same]


def _square_on(part: _Part) -> BoolArray:
    """Return the beams from which the sensor's errors are read."""
    return np.asarray(part.seen & part.known & (part.fit.cast.hits.cosines > _GRAZING))


def _bands(parts: list[_Part]) -> list[Band]:
    """Return the errors of the beams of each range that beams have."""
    changes, far, _ = (np.concatenate(each) for each in zip(*(_pairs(part) for part in parts), strict=True))
    bands = []
    for least, greatest in pairwise(RANGE_EDGES):
        left, shares = [], np.zeros(5)
        for part in parts:
            ranges = part.fit.cast.hits.ranges
            here = (ranges >= least) & (ranges < greatest)
            counted = here & part.rows & part.returns
            with np.errstate(invalid="ignore"):
                beyond = counted & (np.abs(part.rest) > FURTHEST)
                shares += (
                    counted.sum(), (beyond & (part.rest < 0.0)).sum(), (beyond & (part.rest > 0.0)).sum(),
                    (here & part.rows).sum(), (here & part.rows & _failed(part)).sum(),
                )  # fmt: skip
            left.append(_along_beam(part)[here & _square_on(part)])
        rest, change = np.concatenate(left), changes[(far >= least) & (far < greatest)]
        if shares[0]:
            bands.append(
                Band(
                    least=least, greatest=greatest, noise=_deviation(change), pairs=len(change),
                    bias=float(np.median(rest)) if len(rest) else math.nan, nearer=float(shares[1] / shares[0]),
                    farther=float(shares[2] / shares[0]), dropouts=float(shares[4] / shares[3]),
                )
            )  # fmt: skip
    return bands


def _failed(part: _Part) -> BoolArray:
    """Return the beams without a return, where the map has a wall in reach."""
    return np.asarray(~np.isfinite(part.drive.ranges) & np.isfinite(part.fit.cast.hits.ranges))


def _errors(parts: list[_Part], where: str) -> MeasuredErrors:
    """Return noise, bias and dropouts by range and bearing; a cell of few beams takes those of its range."""
    rest = np.concatenate([_along_beam(part)[_square_on(part)] for part in parts])
    changes, far, beside = (np.concatenate(each) for each in zip(*(_pairs(part) for part in parts), strict=True))
    ranges, bearings, failed_ranges, failed_bearings, all_ranges, all_bearings = (
        np.concatenate(each)
        for each in zip(*(_places(part) for part in parts), strict=True)
    )  # fmt: skip
    bands = [
        (low, high)
        for low, high in pairwise(RANGE_EDGES)
        if np.count_nonzero((far >= low) & (far < high)) >= _FEWEST
    ]
    if not bands:
        said = f"{where}: {len(rest)} beams see the map, and {len(far)} the same place twice"
        raise SettingsError(f"{said}; accepted: {_FEWEST} of one range, or more")
    sides = [
        (low, high)
        for low, high in pairwise(BEARING_EDGES)
        if np.count_nonzero((bearings >= low) & (bearings < high))
    ]
    noise, bias, dropout = (np.zeros((len(sides), len(bands))) for _ in range(3))
    for column, (near, end) in enumerate(bands):
        in_range = (ranges >= near) & (ranges < end)
        for row, (right, left) in enumerate(sides):
            here = in_range & (bearings >= right) & (bearings < left)
            bias[row, column] = np.median(rest[here if np.count_nonzero(here) >= _FEWEST else in_range])
            pairs = (far >= near) & (far < end)
            both = pairs & (beside >= right) & (beside < left)
            noise[row, column] = _deviation(changes[both if np.count_nonzero(both) >= _FEWEST else pairs])
            counted = (all_ranges >= near) & (all_ranges < end)
            failed = (failed_ranges >= near) & (failed_ranges < end)
            of_cell = counted & (all_bearings >= right) & (all_bearings < left)
            if np.count_nonzero(of_cell) >= _FEWEST:
                counted, failed = of_cell, failed & (failed_bearings >= right) & (failed_bearings < left)
            dropout[row, column] = int(np.count_nonzero(failed)) / max(1, int(np.count_nonzero(counted)))
    tables = {
        name: tuple(tuple(round(float(value), digits) for value in row) for row in table)
        for name, table, digits in (("noise", noise, 4), ("bias", bias, 4), ("dropout", dropout, 6))
    }
    return MeasuredErrors(
        ranges=tuple(0.5 * (low + high) for low, high in bands),
        bearings=tuple(round(0.5 * (low + high), 4) for low, high in sides),
        source=f"benchmarks/lidar_errors.py: {where}; noise is what changes of recorded less cast range between two "
        "scans in which a beam meets the same place; a bias of all beams together is not told",
        **tables,
    )  # fmt: skip


def _places(part: _Part) -> tuple[FloatArray, ...]:
    """Return range and bearing of the beams that errors are read from, of those that failed, and of all."""
    ranges = part.fit.cast.hits.ranges
    bearings = np.broadcast_to(part.drive.bearings, ranges.shape)
    square, failed, every = _square_on(part), part.rows & _failed(part), part.rows & np.isfinite(ranges)
    return ranges[square], bearings[square], ranges[failed], bearings[failed], ranges[every], bearings[every]


def main() -> None:
    """Compare the beams of drives with a map, print the tables, and write the errors where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drives", nargs="+", help="with beams, and with poses in the frame of the map")
    parser.add_argument("--map", type=Path, required=True, help="map_server YAML")
    parser.add_argument("--columns", help="of CSV files, as `fg-mujoco validate` takes them")
    parser.add_argument("--out", type=Path, help="a TOML file for --lidar-effects")
    options = parser.parse_args()
    drives = [part for drive in read_drives(*options.drives, columns=options.columns) for part in drive.parts()]
    recorded = [RecordedBeams.of(drive) for drive in drives]
    source = f"{options.map.stem}, {', '.join(drive.name for drive in recorded)}"
    found = compare_beams(recorded, MapWalls.of(options.map), source=source)
    mount = zip(("ahead [m]", "left [m]", "yaw [rad]", "delay [s]", "wall depth [m]"), found.mount.as_array(),
                found.mount_error.as_array(), strict=True)  # fmt: skip
    print(table(("LiDAR", "mean", "+-"), [(name, f"{value:.4f}", f"{error:.4f}") for name, value, error in mount]))
    rows = [
        (
            f"{each.least:g} to {each.greatest:g}", f"{100 * each.noise:.2f}", each.pairs, f"{100 * each.bias:.1f}",
            f"{100 * each.nearer:.1f}, {100 * each.farther:.1f}", f"{100 * each.dropouts:.3f}",
        )
        for each in found.by_range
    ]  # fmt: skip
    head = ("range [m]", "noise [cm]", "pairs", "bias [cm]", "nearer, farther [%]", "dropouts [%]")
    print("\n" + table(head, rows))
    if options.out is not None:
        options.out.write_text(found.errors.toml, encoding="utf-8")


if __name__ == "__main__":
    main()
