"""`env.track` of f1tenth_gym v1.0: the map, its centreline and its raceline, as planners read them.

The lines are those of the files in the map's folder, `NAME_centerline.csv` and `NAME_raceline.csv`. Without a
centreline the course's own is taken, and without a raceline the centreline.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fg_mujoco import portable
from fg_mujoco.course.course import Course
from fg_mujoco.course.files import is_file, read_text
from fg_mujoco.course.line_file import LineFile, raceline_columns, read_line_file
from fg_mujoco.course.maps.map_server import plain_yaml
from fg_mujoco.errors import TrackError
from fg_mujoco.messages import FloatArray
from fg_mujoco.simulation.course_loading import default_car, load_track

from .maps import find_file, find_map

_SPACING = 0.1  # [m] of the points of a line without a raceline's file, as in the gym
_LEAST_POINTS = 3
_MOST_POINTS = 100_000  # of such a line: that of open ground is some hundred kilometres long
_GUESS = 5.0  # [m] to either side of a guessed progress that is searched


class CubicSpline2D:
    """A closed cubic spline through points [m], by arc length. All else is accepted as in the gym, and worked out."""

    def __init__(self, x: ArrayLike, y: ArrayLike, **_: Any) -> None:
        from scipy.interpolate import CubicSpline

        points = np.column_stack((np.asarray(x, np.float64), np.asarray(y, np.float64)))
        if not np.array_equal(points[0], points[-1]):
            points = np.vstack((points, points[:1]))
        kept = np.append(True, np.hypot(*np.diff(points, axis=0).T) > 0.0)
        self.points: FloatArray = points[kept]
        self.s: FloatArray = np.append(0.0, np.cumsum(np.hypot(*np.diff(self.points, axis=0).T)))
        self.spline = CubicSpline(self.s, self.points, bc_type="periodic")

    @property
    def s_frame_max(self) -> float:
        """Length of the line [m]."""
        return float(self.s[-1])

    def calc_position(self, s: Any) -> Any:
        """Return x and y at a progress [m]."""
        return self.spline(s)

    def calc_yaw(self, s: Any) -> Any:
        """Return the heading at a progress, or at each of many [m], from 0 to 2 pi [rad]."""
        dx, dy = self.spline(s, 1).T
        headings = portable.arctan2(dy, dx) % math.tau
        return headings if np.ndim(s) else float(headings)

    def calc_curvature(self, s: Any) -> Any:
        """Return the curvature at a progress, or at each of many [1/m]."""
        (dx, dy), (ddx, ddy) = self.spline(s, 1).T, self.spline(s, 2).T
        squared = np.asarray(dx * dx + dy * dy)  # 0 where a line turns back on itself
        turned = np.asarray(ddy * dx - ddx * dy)
        curvatures = np.divide(turned, squared**1.5, out=np.zeros_like(squared), where=squared > 0.0)
        return curvatures if np.ndim(s) else float(curvatures)

    def find_curvature(self, s: Any) -> Any:
        """Return the curvature at a progress [1/m]."""
        return self.calc_curvature(s)

    def calc_arclength(self, x: float, y: float, s_guess: float | None = None) -> tuple[float, float]:
        """Return the progress [m] of the line's place nearest to a point, or to a guess, and how far that is [m]."""
        a, ahead = self.points[:-1], np.diff(self.points, axis=0)
        share = np.clip((((x, y) - a) * ahead).sum(axis=1) / (ahead * ahead).sum(axis=1), 0.0, 1.0)
        away = np.hypot(*(a + share[:, None] * ahead - (x, y)).T)
        if s_guess is not None:
            gap = (self.s[:-1] - s_guess + 0.5 * self.s[-1]) % self.s[-1] - 0.5 * self.s[-1]
            if (near := np.abs(gap) <= _GUESS).any():
                away = np.where(near, away, np.inf)
        best = int(np.argmin(away))
        return float(self.s[best] + share[best] * (self.s[best + 1] - self.s[best])), float(away[best])

    def calc_arclength_inaccurate(self, x: float, y: float, s_guess: float | None = None) -> tuple[float, float]:
        """As `calc_arclength`, with the distance to the left positive."""
        s, _ = self.calc_arclength(x, y, s_guess)
        (at_x, at_y), heading = self.spline(s), self.calc_yaw(s)
        return s, float((y - at_y) * math.cos(heading) - (x - at_x) * math.sin(heading))


class Raceline:
    """A line with speeds: points [m], speeds [m/s], arc lengths [m], headings [rad], curvatures [1/m], each (n,)."""

    def __init__(
        self,
        xs: Any,
        ys: Any,
        velxs: Any,
        ss: Any = None,
        psis: Any = None,
        kappas: Any = None,
        accxs: Any = None,
        spline: CubicSpline2D | None = None,
        **_: Any,
    ) -> None:
        self.n = len(xs)
        self.xs, self.ys, self.vxs, self.ss = xs, ys, velxs, ss
        self.yaws, self.ks, self.axs = psis, kappas, accxs
        self.length = float(np.hypot(np.diff(xs), np.diff(ys)).sum())
        self.spline = spline or CubicSpline2D(xs, ys)
        self.waypoint_renderer: Any = None

    @classmethod
    def from_points(cls, points: FloatArray, speed: float = 1.0) -> Raceline:
        """Return the closed line of some points (n, 2) [m], driven at one speed [m/s], every 0.1 m."""
        spline = CubicSpline2D(*np.asarray(points).T)
        ss = np.arange(0.0, spline.s[-1], max(_SPACING, spline.s[-1] / _MOST_POINTS))
        xs, ys = spline.calc_position(ss).T
        headings, curvatures = spline.calc_yaw(ss), spline.calc_curvature(ss)
        ss, xs, ys, headings, curvatures = (
            values.astype(np.float32) for values in (ss, xs, ys, headings, curvatures)
        )  # fmt: skip
        return cls(xs, ys, np.full_like(xs, speed), ss, headings, curvatures, np.zeros_like(xs), spline)

    @classmethod
    def from_centerline_file(
        cls, filepath: str | Path, delimiter: str = ",", fixed_speed: float = 1.0, track_scale: float = 1.0, **_: Any
    ) -> Raceline:
        """Return the line of a centreline file, x, y and two widths [m]."""
        return cls.from_points(track_scale * _read_line(filepath, course=True).points, fixed_speed)

    @classmethod
    def from_raceline_file(
        cls, filepath: str | Path, delimiter: str = ";", skip_rows: int = 3, track_scale: float = 1.0, **_: Any
    ) -> Raceline:
        """Return the line of a raceline file: s, x, y, psi, kappa, vx, ax."""
        file, scale = _read_line(filepath, course=False), np.float32(track_scale)
        made = raceline_columns(file.points, None)
        zeros = np.zeros(len(file.points))
        x, y, speed, s, psi, kappa, acceleration = (
            column.astype(np.float32)
            for column in (
                *file.points.T, file.values.get("speed", zeros), file.values.get("s", made["s_m"]),
                file.values.get("psi", made["psi_rad"]), file.values.get("kappa", made["kappa_radpm"]),
                file.values.get("ax", zeros),
            )
        )  # fmt: skip
        return cls(scale * x, scale * y, speed, scale * s, psi, kappa / scale, acceleration)

    def render_waypoints(self, renderer: Any) -> None:
        """Draw the line with a renderer of the gym."""
        points = np.column_stack((self.xs, self.ys))
        if self.waypoint_renderer is None:
            self.waypoint_renderer = renderer.get_closed_lines_renderer(points, color=(0, 128, 0), size=2)
        else:
            self.waypoint_renderer.update(points)


@dataclass
class TrackSpec:
    """Contents of the map's YAML."""

    name: str
    image: str
    resolution: float
    origin: tuple[float, float, float]
    negate: int = 0
    occupied_thresh: float = 0.65
    free_thresh: float = 0.196


class Track:
    """A map with its lines; `occupancy_map` is 0 where something is, 255 where nothing is, the upper row first."""

    def __init__(
        self,
        spec: TrackSpec | None = None,
        filepath: str | None = None,
        ext: str | None = None,
        occupancy_map: Any = None,
        centerline: Raceline | None = None,
        raceline: Raceline | None = None,
        course: Course | None = None,
    ) -> None:
        self.spec, self.filepath, self.ext = spec, filepath, ext
        if occupancy_map is not None:
            self.occupancy_map = occupancy_map
        self.course = course
        if centerline is not None:
            self.centerline = centerline
        if raceline is not None:
            self.raceline = raceline

    @staticmethod
    def from_track_name(track: str, track_scale: float = 1.0, folder: str | Path | None = None) -> Track:
        """Return the track of a name, as the environment's `map`."""
        course, file = find_map(track, None, folder=folder, scale=track_scale, car=default_car())
        return Track.of(course, file, track_scale)

    @staticmethod
    def from_track_path(path: str | Path, track_scale: float = 1.0) -> Track:
        """Return the track of a map_server YAML."""
        return Track.from_track_name(str(path), track_scale)

    @staticmethod
    def of(course: Course, file: Path | None, scale: float = 1.0) -> Track:
        """Return the track of a course that was found, and of its YAML."""
        track = Track(course=course)
        track._file, track._scale = file, scale
        if file is not None:
            keys = plain_yaml(read_text(file, 2**20))
            image = Path(str(keys["image"]))
            x, y, yaw = (float(value) for value in keys["origin"])
            track.spec = TrackSpec(
                name=file.stem.removesuffix("_map"), image=str(image), resolution=scale * float(keys["resolution"]),
                origin=(scale * x, scale * y, yaw), negate=int(keys.get("negate", 0)),
                occupied_thresh=float(keys.get("occupied_thresh", 0.65)),
                free_thresh=float(keys.get("free_thresh", 0.196)),
            )  # fmt: skip
            track.filepath, track.ext = str((file.parent / image).absolute().with_suffix("")), image.suffix
        return track

    @staticmethod
    def from_refline(x: ArrayLike, y: ArrayLike, velx: ArrayLike) -> Track:
        """Return ground without walls round a line."""
        points, speeds = np.column_stack((x, y)), np.asarray(velx, np.float64)
        line = Raceline.from_points(points)
        nearest = np.argmin(np.hypot(line.xs[:, None] - points[:, 0], line.ys[:, None] - points[:, 1]), axis=1)
        line.vxs = speeds[nearest].astype(np.float32)
        low, high = points.min(axis=0), points.max(axis=0)
        margin = 0.1 * (high - low)
        shape = np.ceil((high - low + 2.0 * margin) / 0.05).astype(int)
        spec = TrackSpec("", "", 0.05, (*(low - margin).tolist(), 0.0))
        return Track(
            spec, occupancy_map=np.full(shape[::-1], 255.0, np.float32), centerline=line, raceline=line,
            course=_open_ground(),
        )  # fmt: skip

    _file: Path | None = None
    _scale = 1.0

    @cached_property
    def centerline(self) -> Raceline:
        """The line of NAME_centerline.csv in the map's folder, or the course's own."""
        file = self._beside("centerline.csv")
        if file is not None:
            return Raceline.from_centerline_file(file, track_scale=self._scale)
        assert self.course is not None
        return Raceline.from_points(np.array(self.course.map_line.points))

    @cached_property
    def raceline(self) -> Raceline:
        """The line of NAME_raceline.csv in the map's folder, or the centreline."""
        file = self._beside("raceline.csv")
        return self.centerline if file is None else Raceline.from_raceline_file(file, track_scale=self._scale)

    @cached_property
    def occupancy_map(self) -> Any:
        """0 where something is, 255 where nothing is, the upper row first."""
        if self.filepath is None:
            raise TrackError("the track has no map; accepted: one of a map_server .yaml")
        from PIL import Image

        pixels = np.asarray(Image.open(f"{self.filepath}{self.ext}").convert("L"))
        return np.where(pixels > 128, 255.0, 0.0).astype(np.float32)

    @property
    def has_lines(self) -> bool:
        """Whether it has lines of its own, and not only those that are found in the map."""
        files = (self._beside("centerline.csv"), self._beside("raceline.csv"))
        return "centerline" in vars(self) or files != (None, None)

    def frenet_to_cartesian(self, s: float, ey: float, ephi: float) -> tuple[float, float, float]:
        """Return x, y and heading at a progress on the centreline, an offset to its left and a relative heading."""
        spline = self.centerline.spline
        (x, y), heading = spline.calc_position(s), spline.calc_yaw(s)
        return float(x - ey * math.sin(heading)), float(y + ey * math.cos(heading)), (heading + ephi) % math.tau

    def cartesian_to_frenet(
        self, x: float, y: float, phi: float, s_guess: float | None = None, **_: Any
    ) -> tuple[float, float, float]:
        """Return progress on the centreline, offset to its left and relative heading of a pose."""
        spline = self.centerline.spline
        s, offset = spline.calc_arclength_inaccurate(x, y, s_guess or None)
        return s, offset, math.remainder(phi - spline.calc_yaw(s), math.tau)

    def _beside(self, ending: str) -> Path | None:
        if self._file is None:
            return None
        stems = (self._file.stem, self._file.stem.removesuffix("_map"), self._file.parent.name)
        found = [self._file.parent / f"{stem}_{ending}" for stem in stems]
        return next((file for file in found if is_file(file)), None)


def _read_line(path: str | Path, *, course: bool) -> LineFile:
    """Return the line of a file, of three points at least."""
    file = read_line_file(path, course=course)
    if len(file.points) < _LEAST_POINTS:
        raise TrackError(f"{path}: {len(file.points)} points; accepted: at least {_LEAST_POINTS}")
    return file


def find_track_dir(track_name: str) -> Path:
    """Return the folder of a named map; FileNotFoundError: there is none."""
    file = find_file(track_name)
    if file is None:
        raise FileNotFoundError(f"no map {track_name!r}; accepted: one of the folder FG_MUJOCO_MAPS")
    return file.parent


def _open_ground() -> Course:
    from fg_mujoco.course.open_ground import OpenGround

    return load_track(OpenGround(seconds=1e6))
