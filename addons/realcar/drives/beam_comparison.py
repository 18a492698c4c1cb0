"""How far recorded LiDAR beams are from those cast in a map, and which errors of the LiDAR that leaves.

    found = compare_beams(drives, MapWalls.of("hall.yaml"))
    print(comparison_text(found))            # of beam_text
    Path("my_lidar.toml").write_text(found.errors.toml)

Everything is shown on rows that it was not fitted on: the mount of the LiDAR and the errors of the map are those that
the other drives say; of a single drive the first half and the second half are two drives.

Steps, with the spread of the differences after each:

1. As recorded: cast from the recorded poses, with the mount of the other drives.
2. Each scan's pose is moved so that its beams agree with the map (`fit_poses`): an error of the pose is common to all
   beams of a scan. Differences of more than FURTHEST square to the wall are beams that do not see what is in the map.
3. The mean difference at each place of the walls, over the other drives, is the map's error there. It is subtracted,
   and the poses are fitted again.

The differences that are left hold the sensor's noise, and what no step takes out: walls that were moved, or a map of
pixels. The sensor's noise is what changes from one scan to the next where a beam meets the same place of the wall,
within SAME_PLACE: all the rest is the same in both. Where the car stands, it is the change of the beams as recorded,
without a map or a pose; that is told beside, with its number of pairs.

A bias that all beams share at all ranges looks like walls that lie deeper than in the map, and is told as `wall_depth`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.display import brief
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import FloatArray

from ..measured_errors import MeasuredErrors
from .recorded_beams import FittedPoses, LidarMount, RecordedBeams, cast_beams, fit_mount, fit_poses

if TYPE_CHECKING:
    from .wall_rays import MapWalls

BoolArray = NDArray[np.bool_]

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


@dataclass(frozen=True, kw_only=True)
class Spread:
    """How large differences are."""

    count: int
    median: float  # [m] of the absolute differences
    most: float  # [m] below which 95 % of them are
    bias: float  # [m] median of recorded less cast


@dataclass(frozen=True, kw_only=True)
class Band:
    """The differences of the beams of a band of ranges or bearings, recorded less cast along the beam."""

    least: float  # [m] or [rad]
    greatest: float
    recorded: Spread  # from the recorded poses, all beams with a return
    fitted: Spread  # from the fitted poses and walls of the mount's depth, beams that see the map
    left: float  # [m] robust standard deviation of what is left after step 3
    noise: float  # [m] of the sensor, from pairs of scans
    pairs: int  # of beams that meet the same place in two scans
    bias: float  # [m] median of what is left
    nearer: float  # share of beams that see something before the map's wall
    farther: float  # share of beams that see through it
    dropouts: float  # share of beams without a return, though the map has a wall in reach


@dataclass(frozen=True, kw_only=True)
class DriveBeams:
    """What the beams of one drive say, with what the other drives were fitted to."""

    name: str
    rows: int
    jumps: float  # share of rows left out because the pose jumps
    lost: float  # share of rows left out because no pose near the recorded one agrees with the map
    not_in_map: float  # share of the beams left, that do not see what is in the map
    own_mount: LidarMount  # that this drive alone says
    recorded: Spread  # of all beams with a return, from the recorded poses
    kept: Spread  # of the beams that are not left out, from the recorded poses
    fitted: Spread  # of the same beams, from the fitted poses and walls of the mount's depth
    spreads: tuple[float, float, float]  # [m] robust standard deviation square to the wall after steps 1, 2 and 3


@dataclass(frozen=True, kw_only=True)
class StillBeams:
    """The noise of beams of a car that stands: the change from scan to scan over the square root of two."""

    least: float  # [m]
    greatest: float
    pairs: int
    noise: float  # [m] robust standard deviation


@dataclass(frozen=True, kw_only=True, repr=False)
class BeamComparison:
    """Recorded and cast beams of drives."""

    map_name: str
    drives: tuple[DriveBeams, ...]
    mount: LidarMount  # mean of the drives
    mount_error: LidarMount  # standard error of that mean, from the spread of the drives
    by_range: tuple[Band, ...]
    by_bearing: tuple[Band, ...]
    still: tuple[StillBeams, ...]
    errors: MeasuredErrors = field(compare=False)  # of the LiDAR

    def __repr__(self) -> str:
        return brief(self, self.map_name, f"{len(self.drives)} drives")


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


def compare_beams(
    drives: Sequence[RecordedBeams],
    walls: MapWalls,
    *,
    map_name: str = "map",
    watch: Callable[[str], object] | None = None,
) -> BeamComparison:
    """Return how far the recorded beams of drives are from those cast in a map.

    Args:
      drives: with poses in the map's frame.
      walls: of the map.
      map_name: for texts.
      watch: called with what is done, in words.

    Raises:
      SettingsError: no drive, one without a return, or one that is not in the map.
    """
    if not drives:
        raise SettingsError("no drive with beams and poses; accepted: one or more")
    pieces = list(drives) if len(drives) > 1 else _halves(drives[0])
    tell = watch or str
    parts = []
    for number, piece in enumerate(pieces, start=1):
        tell(f"the mount of the LiDAR, {number} of {len(pieces)}")
        parts.append(_part(piece, walls))
    mounts = np.array([part.own_mount.as_array() for part in parts])
    for index, part in enumerate(parts):
        part.mount = LidarMount.of(np.delete(mounts, index, axis=0).mean(axis=0))
        part.fit = fit_poses(part.drive, walls, part.mount)
    for turn in range(1, _ROUNDS + 1):
        _learn_map(parts, walls)
        for number, part in enumerate(parts, start=1):
            tell(f"poses and the map, round {turn} of {_ROUNDS}, {number} of {len(parts)}")
            part.fit = fit_poses(part.drive, walls, part.mount, offsets=part.offsets)
    by_range = _bands(parts, walls, RANGE_EDGES, of_range=True)
    by_bearing = _bands(parts, walls, BEARING_EDGES, of_range=False)
    spread = mounts.std(axis=0, ddof=1) / math.sqrt(len(mounts))
    return BeamComparison(
        map_name=map_name, drives=tuple(_of_drive(part, walls) for part in parts),
        mount=LidarMount.of(mounts.mean(axis=0)), mount_error=LidarMount.of(spread), by_range=by_range,
        by_bearing=by_bearing, still=_still(drives),
        errors=_errors(parts, f"{map_name}, {', '.join(drive.name for drive in drives)}"),
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


def _spread(values: FloatArray) -> Spread:
    if len(values) == 0:
        return Spread(count=0, median=math.nan, most=math.nan, bias=math.nan)
    away = np.abs(values)
    return Spread(
        count=len(values), median=float(np.median(away)), most=float(np.quantile(away, 0.95)),
        bias=float(np.median(values)),
    )  # fmt: skip


def _deviation(values: FloatArray) -> float:
    """Return the robust standard deviation: half of the width that holds the middle 68.27 %."""
    if len(values) == 0:
        return math.nan
    low, high = np.quantile(values, (0.158655, 0.841345))
    return float(0.5 * (high - low))


def _moved(part: _Part) -> FloatArray:
    """Return recorded less cast range from the fitted poses [m], the walls as deep as the mount says."""
    return np.asarray(part.fit.cast.differences / np.maximum(part.fit.cast.hits.cosines, 0.1))


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


def _of_drive(part: _Part, walls: MapWalls) -> DriveBeams:
    plain = cast_beams(part.drive, walls, part.mount)
    hits = plain.hits.ranges
    with np.errstate(invalid="ignore"):
        away = part.drive.ranges - hits
    seen, square = part.seen, _square_on(part)
    before_map = fit_poses(part.drive, walls, part.mount).cast.differences
    counted = part.rows & part.returns
    finite = square & np.isfinite(plain.differences)
    return DriveBeams(
        name=part.drive.name, rows=len(part.drive.time), jumps=float(np.mean(part.left_out)),
        lost=float(np.mean(part.lost & ~part.left_out)),
        not_in_map=1.0 - int(np.count_nonzero(seen)) / max(1, int(np.count_nonzero(counted))), own_mount=part.own_mount,
        recorded=_spread(away[np.isfinite(away)]), kept=_spread(away[seen & np.isfinite(away)]),
        fitted=_spread(_moved(part)[seen]),
        spreads=(
            _deviation(plain.differences[finite]), _deviation(before_map[finite & np.isfinite(before_map)]),
            _deviation(part.rest[square]),
        ),
    )  # fmt: skip


def _bands(parts: list[_Part], walls: MapWalls, edges: Sequence[float], *, of_range: bool) -> tuple[Band, ...]:
    plain = [cast_beams(part.drive, walls, part.mount).hits.ranges for part in parts]
    changes, far, beside = (np.concatenate(each) for each in zip(*(_pairs(part) for part in parts), strict=True))
    bands = []
    for least, greatest in pairwise(edges):
        place = far if of_range else beside
        change = changes[(place >= least) & (place < greatest)]
        recorded, fitted, left, shares = [], [], [], np.zeros(5)
        for part, cast in zip(parts, plain, strict=True):
            ranges, measured = part.fit.cast.hits.ranges, part.drive.ranges
            bearings = np.broadcast_to(part.drive.bearings, ranges.shape)
            of_cast, of_fit = ((cast, ranges) if of_range else (bearings, bearings))
            there, here = ((each >= least) & (each < greatest) for each in (of_cast, of_fit))
            with np.errstate(invalid="ignore"):
                recorded.append((measured - cast)[there & np.isfinite(cast) & np.isfinite(measured)])
                fitted.append(_moved(part)[here & part.seen])
                counted = here & part.rows & part.returns
                beyond = counted & (np.abs(part.rest) > FURTHEST)
                shares += (
                    counted.sum(), (beyond & (part.rest < 0.0)).sum(), (beyond & (part.rest > 0.0)).sum(),
                    (here & part.rows & np.isfinite(ranges)).sum(), (here & part.rows & _failed(part)).sum(),
                )  # fmt: skip
            left.append(_along_beam(part)[here & _square_on(part)])
        rest = np.concatenate(left)
        bands.append(
            Band(
                least=least, greatest=greatest, recorded=_spread(np.concatenate(recorded)),
                fitted=_spread(np.concatenate(fitted)), left=_deviation(rest), noise=_deviation(change),
                pairs=len(change), bias=float(np.median(rest)) if len(rest) else math.nan,
                nearer=float(shares[1] / max(1.0, shares[0])), farther=float(shares[2] / max(1.0, shares[0])),
                dropouts=float(shares[4] / max(1.0, shares[3])),
            )
        )  # fmt: skip
    return tuple(band for band in bands if band.recorded.count)


def _failed(part: _Part) -> BoolArray:
    """Return the beams without a return, where the map has a wall in reach."""
    return np.asarray(~np.isfinite(part.drive.ranges) & np.isfinite(part.fit.cast.hits.ranges))


def _still(drives: Sequence[RecordedBeams]) -> tuple[StillBeams, ...]:
    """Return the noise of beams while the car stands."""
    changes, ranges = [np.empty(0)], [np.empty(0)]
    for drive in drives:
        stands = (np.abs(drive.speed) < _STANDS) & (np.abs(drive.yaw_rate) < _STILL)
        pairs = np.flatnonzero(stands[1:] & stands[:-1])
        with np.errstate(invalid="ignore"):
            change = drive.ranges[pairs + 1] - drive.ranges[pairs]
        usable = np.isfinite(change) & (np.abs(change) < FURTHEST)
        changes.append(change[usable])
        ranges.append(drive.ranges[pairs][usable])
    change, distance = np.concatenate(changes), np.concatenate(ranges)
    found = []
    for least, greatest in pairwise(RANGE_EDGES):
        here = change[(distance >= least) & (distance < greatest)]
        if len(here):
            noise = _deviation(here) / math.sqrt(2.0)
            found.append(StillBeams(least=least, greatest=greatest, pairs=len(here), noise=noise))
    return tuple(found)


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
        source=f"fg-mujoco validate --beams: {where}; noise is what changes of recorded less cast range between two "
        "scans in which a beam meets the same place; a bias of all beams together is not told",
        **tables,
    )  # fmt: skip


def _places(part: _Part) -> tuple[FloatArray, ...]:
    """Return range and bearing of the beams that errors are read from, of those that failed, and of all."""
    ranges = part.fit.cast.hits.ranges
    bearings = np.broadcast_to(part.drive.bearings, ranges.shape)
    square, failed, every = _square_on(part), part.rows & _failed(part), part.rows & np.isfinite(ranges)
    return ranges[square], bearings[square], ranges[failed], bearings[failed], ranges[every], bearings[every]
