"""A map from the scans of a bag: the files that map_server, and `--track`, load.

    made = make_map(sweeps)
    write_map(made, "my_map.yaml")         # and my_map.png
    fg.race("my_map.yaml")

Free is what beams went through and the LiDAR can have come to; all else is a wall or unknown. The YAML has the place
and the heading at which the car began, so that a race on the map begins there and goes the way it went.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.course.documents import comment
from fg_mujoco.course.maps.map_server import FREE, OCCUPIED, RESOLUTION, UNKNOWN, image_line
from fg_mujoco.course.writing import write_files
from fg_mujoco.errors import BagError, SettingsError
from fg_mujoco.messages import FloatArray

from .pose_graph import PoseGraph, close_loops
from .ray_model import LogOdds
from .scan_matching import match_scans, standing
from .sweeps import Sweeps

REACH = 15.0
"""[m] of beams that count; further ones are too far apart, and a small error of the heading moves their ends."""
SUFFIXES = (".yaml", ".yml")

_MOVED, _TURNED = 0.05, 0.02  # [m], [rad] after which the next scan counts
_ANYWAY = 1.0  # [s] after which it counts all the same
_CAR = 0.12  # [m] round the LiDAR's path that is free: the car went there
_MOTE = 0.008  # [m^2] of something amid the free that nothing, or one cell alone, was seen of
_MARGIN = 10  # [cells] round the map
_LEVELS = {FREE: 254, OCCUPIED: 0, UNKNOWN: 205}  # of the image, as map_saver writes them


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedMap:
    """A map that was made, and how."""

    cells: NDArray[np.int8]  # (rows, columns) FREE, OCCUPIED or UNKNOWN, row 0 below
    resolution: float  # [m]
    origin: tuple[float, float]  # [m] lower left corner
    start: tuple[float, float, float]  # x [m], y [m], heading [rad] of the LiDAR at its first scan
    path: FloatArray  # (n, 3) poses of the LiDAR, of the scans that count
    numbers: tuple[int, ...]  # of those scans
    source: str  # of the poses
    matched: bool  # whether they were corrected by the scans
    left_out: Mapping[str, int]  # how many scans of the bag do not count, by the reason
    graph: PoseGraph | None = None  # of the poses, where loops were closed

    @property
    def text(self) -> str:
        """The scans of the map, in words: their number, their poses, and why the others were left out."""
        every, used = len(self.numbers) + sum(self.left_out.values()), len(self.numbers)
        by = ", corrected by the scans" if self.matched else ""
        said = f"{used if used == every else f'{used} of {every}'} scans at {self.source}{by}"
        why = ", ".join(f"{count} {reason}" for reason, count in self.left_out.items())
        return f"{said}; left out: {why}" if why else said


def make_map(
    sweeps: Sweeps,
    *,
    resolution: float = RESOLUTION,
    match: bool | None = None,
    close: bool = False,
    watch: Callable[[int, int], None] | None = None,
) -> RecordedMap:
    """Return the map of scans.

    Args:
      sweeps: the scans with their poses.
      resolution: side of a cell [m].
      match: whether poses are corrected by the scans; None: where they drift.
      close: whether loops are closed, where poses are corrected.
      watch: called with how many scans are added, and of how many.

    Raises:
      SettingsError: a resolution outside of 0.01 to 1 m.
      BagError: scans that see nothing; a map of too many cells.
    """
    require_resolution(resolution)
    matched = sweeps.drifts if match is None else match
    graph = None
    if matched:
        numbers, poses, idle = match_scans(sweeps, chain=close)
        if close and numbers:
            graph = close_loops(sweeps, numbers, poses)
            poses = graph.corrected
    else:
        numbers = _apart(sweeps)
        poses = sweeps.poses[numbers]
        idle = {standing(_MOVED, _TURNED): len(sweeps.scans) - len(numbers)}
    if not numbers or not any(np.isfinite(sweeps.scans[number].ranges).any() for number in numbers):
        raise BagError("its scans see nothing; accepted: scans with readings within their range limits")
    grid = LogOdds.around(poses, reach=REACH, resolution=resolution)
    for count, (number, pose) in enumerate(zip(numbers, poses, strict=True), start=1):
        scan = sweeps.scans[number]
        grid.add(sweeps.beam_poses(number, pose), scan.bearings, scan.ranges)
        if watch is not None:
            watch(count, len(numbers))
    cells = _cleaned(grid, poses)
    rows, columns = (np.flatnonzero((cells != UNKNOWN).any(axis=axis)) for axis in (1, 0))
    low, left = rows[0] - _MARGIN, columns[0] - _MARGIN
    cells = np.pad(cells, _MARGIN, constant_values=UNKNOWN)[
        rows[0] : rows[-1] + 2 * _MARGIN + 1, columns[0] : columns[-1] + 2 * _MARGIN + 1
    ]
    x, y = grid.origin + resolution * np.array((left, low))
    return RecordedMap(
        cells=cells,
        resolution=resolution,
        origin=(float(x), float(y)),
        start=(float(poses[0, 0]), float(poses[0, 1]), math.remainder(float(poses[0, 2]), math.tau)),
        path=poses,
        numbers=tuple(numbers),
        source=sweeps.source,
        matched=matched,
        graph=graph,
        left_out={why: count for why, count in {**sweeps.left_out, **idle}.items() if count},
    )


def require_resolution(resolution: float) -> None:
    """Raise SettingsError for a side of a cell [m] that no map can have."""
    if not 0.01 <= resolution <= 1.0:
        raise SettingsError(f"resolution is {resolution!r} m; accepted: from 0.01 to 1")


def map_files(path: str | Path) -> tuple[Path, Path]:
    """Return the YAML and the image that a map is written to; a name without a suffix is that of a YAML.

    Raises:
      SettingsError: a suffix that is not one of SUFFIXES.
    """
    path = Path(path)
    path = path if path.suffix else path.with_suffix(SUFFIXES[0])
    if path.suffix.lower() not in SUFFIXES:
        raise SettingsError(f"{path}: is no name for a map; accepted: one that ends in {' or '.join(SUFFIXES)}")
    return path, path.with_suffix(".png")


def write_map(made: RecordedMap, path: str | Path, heading: str = "") -> tuple[Path, Path]:
    """Write a map as a YAML of map_server and a PNG in the same folder; files that exist are replaced.

    Raises:
      SettingsError: another suffix.
      BagError: files that cannot be written.
      MissingExtraError: the extra `maps` is not installed.
    """
    from fg_mujoco.course.maps.map_server import require_maps_extra

    require_maps_extra()
    from PIL import Image

    files = map_files(path)
    levels = np.zeros(made.cells.shape, np.uint8)
    for cell, level in _LEVELS.items():
        levels[made.cells == cell] = level
    picture = io.BytesIO()
    Image.fromarray(levels[::-1]).save(picture, "PNG", optimize=True)
    (x, y), start = made.origin, made.start
    poses = f"{made.source}{', corrected by the scans' if made.matched else ''}"
    text = (
        f"# {comment(heading or 'made from a bag')}; poses: {comment(poses)}\n{image_line(files[1].name)}"
        f"resolution: {made.resolution!r}\norigin: [{x!r}, {y!r}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\nmode: trinary\n"
        f"starting_positions: [[{start[0]:.3f}, {start[1]:.3f}, {start[2]:.4f}]]\n"
    )
    try:
        write_files(dict(zip(files, (text.encode(), picture.getvalue()), strict=True)))
    except OSError as error:
        raise BagError(f"{path}: cannot be written: {error.strerror or error}; accepted: a file that can be") from error
    return files


def _apart(sweeps: Sweeps) -> list[int]:
    """Return the numbers of the scans that count: those from places apart."""
    numbers: list[int] = []
    for number, pose in enumerate(sweeps.poses):
        if numbers:
            last = sweeps.poses[numbers[-1]]
            still = math.hypot(*(pose[:2] - last[:2])) < _MOVED and abs(pose[2] - last[2]) < _TURNED
            if still and sweeps.times[number] - sweeps.times[numbers[-1]] < _ANYWAY:
                continue
        numbers.append(number)
    return numbers


def _cleaned(grid: LogOdds, poses: FloatArray) -> NDArray[np.int8]:
    """Return the cells, with free only what the LiDAR can have come to, and motes amid the free gone."""
    from scipy import ndimage

    cells = grid.cells()
    path = _along(poses, grid.resolution)
    column, row = np.floor((path - grid.origin) / grid.resolution).astype(int).T
    away = np.ones(cells.shape, np.bool_)
    away[row, column] = False
    cells[ndimage.distance_transform_edt(away) * grid.resolution <= _CAR] = FREE
    regions, _ = ndimage.label(cells == FREE)
    reached = np.isin(regions, np.unique(regions[row, column]))
    solid, count = ndimage.label(~reached, np.ones((3, 3)))
    sizes = np.bincount(solid.ravel(), minlength=count + 1)
    hits = np.bincount(solid.ravel(), weights=(cells == OCCUPIED).ravel(), minlength=count + 1)
    mote = (sizes * grid.resolution**2 <= _MOTE) & (hits <= 1)
    mote[0] = False
    reached |= mote[solid]
    cells[reached] = FREE
    cells[~reached & (cells == FREE)] = UNKNOWN
    return cells


def _along(poses: FloatArray, step: float) -> FloatArray:
    """Return points of the LiDAR's path, no more than a step apart where scans are close to each other, (n, 2) [m]."""
    points = [poses[:1, :2]]
    for before, after in zip(poses[:-1, :2], poses[1:, :2], strict=True):
        length = float(math.hypot(*(after - before)))
        count = max(1, math.ceil(length / step)) if length < 1.0 else 1
        points.append(before + (after - before) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(points)
