"""A map from driving: a planner drives laps of a course, and what its LiDAR and its odometry said becomes a map.

    driven = map_course(Setup(track="oval", laps=2))
    write_map(driven.made, "my_map.yaml")     # and my_map.png
    fg.race("my_map.yaml", "pure_pursuit[pose=particle_filter]")

The scans are those that the planner was given, late and noisy as set. Where the LiDAR was is known from the wheels'
speed and the yaw rate alone, which drift, and from the start, which is told: so the map's frame is the course's. Scan
matching and loop closure correct that. The true course and the true poses serve for the score only, after the map was
shifted and turned to where it fits the true walls best: a map that is turned as a whole is as good.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from fg_mujoco.course.course import Course, wall_outlines
from fg_mujoco.course.maps.map_server import FREE, OCCUPIED, RESOLUTION
from fg_mujoco.errors import TrackError
from fg_mujoco.messages import CarParameters, Controller, DriveCommand, FloatArray, LaserScan, Odometry
from fg_mujoco.racing.race import RaceProgress, race_setup
from fg_mujoco.racing.resolved import Resolved

from .pose_graph import PoseGraph
from .recorded_map import RecordedMap, make_map, require_resolution
from .sweeps import Sweeps, interpolated

if TYPE_CHECKING:
    from fg_mujoco.racing.result import RaceResult
    from fg_mujoco.racing.setup import Setup

_SEEN = 0.1  # [m] from a mapped wall, within which a true one counts as mapped
_SPACING = 0.05  # [m] of points along the true walls


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenMap:
    """A map that was made by driving, and how well it agrees with the course. Arrays are read-only."""

    made: RecordedMap
    race: RaceResult
    wall_errors: FloatArray  # (n,) [m] of the mapped walls' cells from the true walls
    pose_errors: FloatArray  # (m,) [m] of the LiDAR's corrected poses from the true ones
    odometry_errors: FloatArray  # (m,) [m] of its poses by odometry alone
    seen: float  # share of the true walls' length that has a mapped wall near
    shift: tuple[float, float, float]  # x [m], y [m] and turn [rad] by which the map was laid on the true walls

    @property
    def graph(self) -> PoseGraph:
        """The poses and the steps between them."""
        assert self.made.graph is not None
        return self.made.graph

    def table(self) -> str:
        """Return the score, one line a figure."""
        rows = [
            ("walls from the true ones", _spread(self.wall_errors)),
            ("true walls that are mapped", f"{100.0 * self.seen:.1f} %, within {100.0 * _SEEN:.0f} cm"),
            ("poses from the true ones", _spread(self.pose_errors)),
            ("by odometry alone", _spread(self.odometry_errors)),
            ("poses, steps, loops closed", f"{len(self.graph.poses)}, {len(self.graph.steps)}, {self.graph.loops}"),
            ("laid on the true walls by", f"{100.0 * math.hypot(*self.shift[:2]):.1f} cm, "
             f"{math.degrees(self.shift[2]):.2f} deg"),
        ]  # fmt: skip
        return "\n".join(f"  {name:<27} {value}" for name, value in rows)


def _spread(errors: FloatArray) -> str:
    return f"median {100.0 * np.median(errors):.1f} cm, 95 % {100.0 * np.quantile(errors, 0.95):.1f} cm"


class Recorder:
    """Drives as a planner does, and keeps what it was given."""

    def __init__(self, planner: Controller) -> None:
        self._planner, self.given = planner, list[tuple[LaserScan, Odometry]]()

    def reset(self) -> None:
        """Begin anew."""
        self._planner.reset()
        self.given = []

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Answer what the planner answers."""
        self.given.append((scan, odometry))
        return self._planner(scan, odometry)


def map_course(
    setup: Setup,
    *,
    resolution: float = RESOLUTION,
    watch: Callable[[RaceProgress], None] | None = None,
    watch_scans: Callable[[int, int], None] | None = None,
) -> DrivenMap:
    """Return the map of a drive.

    Args:
      setup: of a race of one car.
      resolution: side of a cell [m].
      watch: called once a tick of the race.
      watch_scans: called with how many scans are added to the map, and of how many.

    Raises:
      TrackError: the car saw or drove too little for a map.
      SettingsError, ControllerError, TrackError: as of a race, and of `make_map`.
    """
    require_resolution(resolution)
    raced = Resolved.of(setup)
    course, car = raced.ground.course, raced.world.parameters
    recorder = Recorder(raced.build_planners()[0])
    result = race_setup(setup.replace(controller=recorder, planner_settings={}), watch=watch)
    given = recorder.given
    if len(given) < 2:
        raise TrackError(f"the drive on {course.name!r} lasted {len(given)} ticks; accepted: one that sees the course")
    sweeps = _sweeps(given, car)
    made = make_map(sweeps, resolution=resolution, match=True, close=True, watch=watch_scans)
    return _scored(made, result, course, sweeps, given, car)


def _sweeps(given: list[tuple[LaserScan, Odometry]], car: CarParameters) -> Sweeps:
    """Return the scans with the poses that odometry says, from the first pose on."""
    track = [np.array((given[0][1].stamp, *given[0][1].pose))]
    for (_, before), (_, now) in pairwise(given):
        _, x, y, heading = track[-1]
        seconds = now.stamp - before.stamp
        way, turn = 0.5 * (before.speed + now.speed) * seconds, 0.5 * (before.yaw_rate + now.yaw_rate) * seconds
        middle = heading + 0.5 * turn
        track.append(np.array((now.stamp, x + way * math.cos(middle), y + way * math.sin(middle), heading + turn)))
    lidar = _of_lidar(np.array(track), car)
    scans = [scan for k, (scan, _) in enumerate(given) if k == 0 or scan.stamp > given[k - 1][0].stamp]
    times = np.array([scan.stamp for scan in scans])
    return Sweeps(
        scans=scans, times=times, poses=interpolated(lidar, times),
        offset=(car.lidar_offset, 0.0), source="odometry", drifts=True, track=lidar,
    )  # fmt: skip


def _of_lidar(track: FloatArray, car: CarParameters) -> FloatArray:
    """Return times and poses of the LiDAR, (n, 4), for those of the rear axle."""
    found = track.copy()
    found[:, 1] += car.lidar_offset * np.cos(track[:, 3])
    found[:, 2] += car.lidar_offset * np.sin(track[:, 3])
    return found


def _scored(
    made: RecordedMap,
    result: RaceResult,
    course: Course,
    sweeps: Sweeps,
    given: list[tuple[LaserScan, Odometry]],
    car: CarParameters,
) -> DrivenMap:
    """Return the map with its score."""
    from scipy.spatial import cKDTree

    walls = np.concatenate([_along(outline) for outline in wall_outlines(course)])
    cells, pose = mapped_walls(made), np.zeros(3)
    tree = cKDTree(walls)
    for _ in range(30):  # lay the cells on the true walls: iterated closest points
        moved = _placed(cells, pose)
        distances, nearest = tree.query(moved)
        near = distances < 0.5
        middle, target = moved[near].mean(axis=0), walls[nearest[near]].mean(axis=0)
        a, b = moved[near] - middle, walls[nearest[near]] - target
        turn = math.atan2(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a * b))
        cos, sin = math.cos(turn), math.sin(turn)
        about = pose[:2] - middle
        pose = np.array(
            (
                target[0] + cos * about[0] - sin * about[1], target[1] + sin * about[0] + cos * about[1],
                pose[2] + turn,
            )
        )  # fmt: skip
    moved, shift = _placed(cells, pose), (float(pose[0]), float(pose[1]), float(pose[2]))
    track = np.array([(odometry.stamp, *odometry.pose) for _, odometry in given])
    track[:, 3] = np.unwrap(track[:, 3])
    times = sweeps.times[list(made.numbers)]
    true = interpolated(_of_lidar(track, car), times)[:, :2]
    by_odometry = interpolated(sweeps.track, times)[:, :2]
    return DrivenMap(
        made=made, race=result, wall_errors=tree.query(moved)[0],
        pose_errors=np.hypot(*(_placed(made.path[:, :2], pose) - true).T),
        odometry_errors=np.hypot(*(by_odometry - true).T),
        seen=float(np.mean(cKDTree(moved).query(walls)[0] < _SEEN)), shift=shift,
    )  # fmt: skip


def mapped_walls(made: RecordedMap) -> FloatArray:
    """Return the middles of the occupied cells that are next to free ones (n, 2) [m]."""
    free = np.pad(made.cells == FREE, 1)
    beside = free[:-2, 1:-1] | free[2:, 1:-1] | free[1:-1, :-2] | free[1:-1, 2:]
    row, column = np.nonzero((made.cells == OCCUPIED) & beside)
    if not len(row):
        raise TrackError("the drive saw no walls; accepted: a course whose walls are near")
    return np.asarray(made.origin + made.resolution * (np.column_stack((column, row)) + 0.5), np.float64)


def _placed(points: FloatArray, pose: FloatArray) -> FloatArray:
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]) + pose[:2])


def _along(outline: FloatArray) -> FloatArray:
    """Return points along a closed polyline (n, 2) [m]."""
    steps = np.roll(outline, -1, axis=0) - outline
    counts = np.maximum(np.ceil(np.hypot(*steps.T) / _SPACING).astype(int), 1)
    start = np.repeat(np.arange(len(outline)), counts)
    share = (np.arange(len(start)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[start]
    return np.asarray(outline[start] + share[:, None] * steps[start])
