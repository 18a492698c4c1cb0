"""The values that a planner shows in a decision, collected: numbers, points, polygons, and arrays of a scan's length.

The debug page, the live view and `export` collect them so. Each thread has a collector of its own, and cars and worlds
that run in parallel do not see each other's values.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.messages import FloatArray, LaserScan, Sketch, read_only, shown
from fg_mujoco.simulation.showing import LASER, heard_by

NUMBER, SCAN, POINTS = "number", "scan", "points"
"""Kinds of values."""
DRAWN_AS = ("points", "line", "polygon")
"""Ways to draw points: each by itself, joined by a line, or joined by a closed line."""
BASE, MAP = "base_link", "map"
"""Frames of points, as in ROS: the LiDAR, the rear axle, both x ahead and y to the left (REP 103), and the map."""
FRAMES = (LASER, BASE, MAP)

SHOWS_NOTHING = (
    "The planner shows no values. In a planner of your own, fg.show(name, value) shows a number, points or ranges here."
)
"""What the live view and the debug page say then."""

FARTHEST = 1e6
"""[m] Points that are farther, or not finite, are left out."""

_MOST_NAMES = 60  # of a planner
_LONGEST_NAME = 60  # characters
_LONGEST_REMARK = 300  # characters
_MOST_NUMBERS = 8000  # of one value, two a point
_HEIGHT = 0.08  # [m] above the ground at which values are drawn in the world
_LINE, _POINT = 0.03, 0.08  # [m] width of a line, size of a point
COLOURS = (
    (204, 61, 153), (139, 90, 43), (140, 140, 0), (0, 95, 95), (215, 190, 20), (110, 40, 90), (240, 140, 160),
    (120, 200, 60),
)  # fmt: skip
"""Of values, by the order of their names: none looks like a thing that the live view or the debug page draws itself."""


@dataclass(frozen=True, kw_only=True, eq=False)
class IntermediateValue:
    """One value that a planner has shown in a decision."""

    name: str
    kind: str  # NUMBER, SCAN or POINTS
    array: FloatArray  # number (), ranges (n,) [m], or points (m, 2) [m]; read-only
    draw: str  # points: one of DRAWN_AS; a scan is a line
    frame: str  # points: one of FRAMES; a scan is in the frame of the LiDAR
    colour: tuple[int, int, int]  # red, green, blue in 0..255; the same in all decisions

    def drawing(self, scan: LaserScan) -> FloatArray:
        """Return its points (k, 2), or ends of pieces (k, 2, 2), in its frame [m], in a scan's decision."""
        if self.kind == NUMBER:
            return np.empty((0, 2))
        points = self.array
        if self.kind == SCAN:
            points = self.array[:, np.newaxis] * np.column_stack((np.cos(scan.bearings), np.sin(scan.bearings)))
        if self.draw == "points" or len(points) < 2:
            return points
        ends = np.roll(points, -1, axis=0) if self.draw == "polygon" and len(points) > 2 else points[1:]
        pieces: FloatArray = np.stack((points[: len(ends)], ends), axis=1)
        return pieces[(np.abs(pieces) <= FARTHEST).all(axis=(1, 2))]

    def sketch(self, scan: LaserScan, pose: FloatArray, lidar_offset: float) -> Sketch | None:
        """Return it as drawn in the map, by the rear axle's pose (3,) [m, m, rad]; None: it has no place."""
        points = moved(self.drawing(scan), self.frame, MAP, pose, lidar_offset)
        if not points.size or not (np.abs(points) <= FARTHEST).all():
            return None
        raised = np.concatenate((points, np.full((*points.shape[:-1], 1), _HEIGHT)), axis=-1)
        size = _LINE if points.ndim == 3 else _POINT
        return Sketch(points=raised, colour=self.colour, size=size, name=self.name)


def moved(points: FloatArray, frame: str, to: str, pose: FloatArray, lidar_offset: float) -> FloatArray:
    """Return points (..., 2) [m] of one of FRAMES in another one, by the rear axle's pose (3,) on the map [m, m, rad].

    NaN is NaN between the map and the car; `lidar_offset` [m] is the LiDAR's ahead of the rear axle.
    """
    if frame == to:
        return points
    x, y, heading = (float(each) for each in pose)
    turn = np.array(((math.cos(heading), math.sin(heading)), (-math.sin(heading), math.cos(heading))))
    mount = np.array((lidar_offset, 0.0))
    of_axle = points + mount if frame == LASER else (points - (x, y)) @ turn.T if frame == MAP else points
    found: FloatArray = of_axle - mount if to == LASER else of_axle @ turn + (x, y) if to == MAP else of_axle
    return found


class IntermediateValues:
    """Collects what one planner shows: `now` by name, in order, and `remarks`, why values are left out."""

    def __init__(self) -> None:
        self.now: dict[str, IntermediateValue] = {}
        self.remarks: list[str] = []
        self._kinds: dict[str, tuple[str, tuple[int, int, int]]] = {}  # of each name that was shown
        self._refused: set[str] = set()

    @contextmanager
    def of(self, scan: LaserScan) -> Iterator[None]:
        """Collect while a planner decides on a scan."""
        found: dict[str, IntermediateValue] = {}
        try:
            with heard_by(partial(self._take, found, len(scan.ranges))):
                yield
        finally:
            self.now = dict(found)  # threads of the planner may still write to the other

    def sketches(self, scan: LaserScan, pose: FloatArray, lidar_offset: float) -> list[Sketch]:
        """Return the last decision's points and scans as drawn in the map; arguments as of IntermediateValue.sketch."""
        found = (value.sketch(scan, pose, lidar_offset) for value in self.now.values())
        return [sketch for sketch in found if sketch is not None]

    def _take(
        self, found: dict[str, IntermediateValue], beams: int, name: Any, value: Any, draw: Any, frame: Any
    ) -> None:
        try:
            read = self._read(beams, name, value, draw, frame)
        except Exception as error:  # the value is a planner's: anything may be wrong with it, its repr too
            key = str.__str__(name)[:_LONGEST_NAME] if isinstance(name, str) else ""
            if key not in self._refused and len(self._refused) < _MOST_NAMES:
                self._refused.add(key)
                why = str(error) if type(error) is SettingsError else f"reading it raised {type(error).__name__}"
                self.remarks.append(f"value {key!r} is not shown: {' '.join(why.split())[:_LONGEST_REMARK]}")
            return
        if read is not None:
            found[read.name] = read

    def _read(self, beams: int, name: Any, value: Any, draw: Any, frame: Any) -> IntermediateValue | None:
        """Return a value as it is shown; None where there is nothing to show."""
        if not isinstance(name, str) or not 0 < len(str.__str__(name)) <= _LONGEST_NAME:
            raise SettingsError(f"its name is {shown(name)}; accepted: a text of 1 to {_LONGEST_NAME} characters")
        name = str.__str__(name).encode(errors="backslashreplace").decode()  # half a pair of UTF-16 is no text
        if draw is not None and draw not in DRAWN_AS:
            raise SettingsError(f"draw is {shown(draw)}; {accepted_names(draw, DRAWN_AS)}")
        if frame not in FRAMES:
            raise SettingsError(f"frame is {shown(frame)}; {accepted_names(frame, FRAMES)}")
        if value is None:
            return None
        array = np.asarray(value)
        accepted = f"accepted: a number, a point (2,), points (m, 2), or ranges ({beams},) as the scan has them"
        if array.dtype.kind not in "biuf":
            raise SettingsError(f"it is of type {type(value).__name__}; {accepted}")
        if array.size > _MOST_NUMBERS:
            raise SettingsError(f"it has shape {array.shape}; accepted: at most {_MOST_NUMBERS} numbers")
        if array.shape == () and draw is None:
            kind = NUMBER
        elif array.shape == (beams,) != (2,) and draw is None:
            kind, frame, draw = SCAN, LASER, "line"
        elif array.shape == (2,) or (array.ndim == 2 and array.shape[1] == 2):
            kind, array = POINTS, array.reshape(-1, 2)
            array = array[(np.abs(array) <= FARTHEST).all(axis=1)]
        elif array.size == 0:
            return None
        else:
            raise SettingsError(f"it has shape {array.shape}; {accepted}")
        before = self._kinds.get(name)
        if before is None:
            if len(self._kinds) >= _MOST_NAMES:
                raise SettingsError(f"the planner has shown {_MOST_NAMES} others; accepted: that many names")
            before = self._kinds[name] = kind, COLOURS[len(self._kinds) % len(COLOURS)]
        if before[0] != kind:
            raise SettingsError(f"it is of kind {kind}, and was {before[0]} before; accepted: one kind for a name")
        return IntermediateValue(
            name=name, kind=kind, array=read_only(array), draw=draw or "polygon", frame=frame, colour=before[1]
        )
