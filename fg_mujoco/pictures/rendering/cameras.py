"""Cameras: chase, onboard, top, track and orbit.

A camera is a function of a moment of a drive, so a frame is the same alone and in a video. It returns a View, which
also projects points of the world onto the picture.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...errors import SettingsError, accepted_names
from ...messages import FloatArray

_UP = np.array([0.0, 0.0, 1.0])
_MIDDLE = 0.165  # [m] of the car, ahead of its rear axle
_ON_MAST, _ON_BOX = (-0.075, 0.0, 0.185), (0.19, 0.0, 0.275)  # [m] of the camera on board, from base_link


@dataclass(frozen=True, kw_only=True, eq=False)
class Moment:
    """The input of a camera: the car at one time of a drive, and the drive up to then."""

    time: float  # [s]
    position: FloatArray  # (3,) [m] of base_link
    rotation: FloatArray  # (3, 3) of base_link, columns x ahead, y left, z up
    times: FloatArray  # (n,) [s] of the whole drive
    headings: FloatArray  # (n,) [rad] unwrapped
    bounds: FloatArray  # (2, 2) [m] least and greatest x and y of the course
    carries_box: bool = False  # that makes it visible to others

    @property
    def heading(self) -> float:
        """Heading of the car [rad]."""
        return math.atan2(self.rotation[1, 0], self.rotation[0, 0])

    def smooth_heading(self, span: float) -> float:
        """Return the mean heading of the last `span` seconds, the middle of them counting most [rad]."""
        if len(self.times) < 2:
            return self.heading
        times = self.time - np.linspace(0.0, span, 25)
        weights = np.hanning(27)[1:-1]
        return float(np.average(np.interp(times, self.times, self.headings), weights=weights))


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """A camera's place and lens. Either `fovy` or `height` counts: perspective, or parallel rays."""

    position: FloatArray  # (3,) [m]
    forward: FloatArray  # (3,) unit
    up: FloatArray  # (3,) unit, square to `forward`
    fovy: float = 0.0  # [rad] angle of view from the lower to the upper edge
    height: float = 0.0  # [m] from the lower to the upper edge
    near: float = 0.02  # [m]
    far: float = 300.0  # [m]
    focus: FloatArray  # (3,) [m] what is looked at; shadows are sharp round it
    shadow_radius: float = 3.0  # [m]

    @property
    def is_parallel(self) -> bool:
        """Whether its rays are parallel."""
        return self.height > 0.0

    def with_margin_below(self, factor: float) -> View:
        """Return a view of a picture that is so many times as high, with what this one shows in its upper part."""
        if not self.is_parallel:
            return self  # what is far ahead is what it looks at, and the road below is no loss
        lower = 0.5 * self.height * (factor - 1.0) * self.up
        return replace(self, height=factor * self.height, position=self.position - lower)

    def project(self, points: ArrayLike, size: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
        """Return the places of points (n, 3) [m] in a picture of `size` (width, height) [px].

        Columns and rows (n, 2) [px] from the upper left corner, and the depth of each (n,) [m], negative behind.
        """
        relative = np.atleast_2d(np.asarray(points, dtype=np.float64)) - self.position
        depth = relative @ self.forward
        right = np.cross(self.forward, self.up)
        x, y = relative @ right, relative @ self.up
        width, height = size
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = height / self.height if self.is_parallel else 0.5 * height / math.tan(0.5 * self.fovy) / depth
        return np.column_stack((0.5 * width + scale * x, 0.5 * height - scale * y)), depth


Camera = Callable[[Moment, float], View]
"""Takes a moment and the picture's width over its height."""


def _looking(position: FloatArray, target: FloatArray, **lens: float) -> View:
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, _UP)
    right /= np.linalg.norm(right)
    return View(position=position, forward=forward, up=np.cross(right, forward), focus=target, **lens)


def _from_above(x: float, y: float, height: float, shadow_radius: float) -> View:
    return View(
        position=np.array([x, y, 20.0]), forward=-_UP, up=np.array([0.0, 1.0, 0.0]), height=height, near=1.0, far=30.0,
        focus=np.array([x, y, 0.0]), shadow_radius=shadow_radius,
    )  # fmt: skip


def _direction(heading: float) -> FloatArray:
    return np.array([math.cos(heading), math.sin(heading), 0.0])


def chase(moment: Moment, aspect: float) -> View:
    """From behind and above; it swings round with the car a quarter of a second late."""
    ahead = _direction(moment.smooth_heading(0.5))
    middle = moment.position + _MIDDLE * moment.rotation[:, 0]
    eye = middle - 1.12 * ahead + 0.56 * _UP
    return _looking(eye, middle + 0.36 * ahead, fovy=math.radians(46.0), shadow_radius=5.0)


def onboard(moment: Moment, aspect: float) -> View:
    """From a mast over the rear axle, or from on top of the car's box; it pitches and rolls with the car."""
    tilt = math.radians(-11.0)
    x, z = moment.rotation[:, 0], moment.rotation[:, 2]
    position = moment.position + moment.rotation @ np.array(_ON_BOX if moment.carries_box else _ON_MAST)
    forward, up = math.cos(tilt) * x + math.sin(tilt) * z, math.cos(tilt) * z - math.sin(tilt) * x
    focus = moment.position + 1.0 * x
    return View(position=position, forward=forward, up=up, fovy=math.radians(62.0), focus=focus, shadow_radius=5.0)


def top(moment: Moment, aspect: float) -> View:
    """From straight above, over what lies ahead of the car; y is up in the picture."""
    x, y, _ = moment.position + 1.6 * _direction(moment.smooth_heading(1.0))
    return _from_above(x, y, 7.2, 5.0 * max(aspect, 1.0))


def track(moment: Moment, aspect: float) -> View:
    """The whole course from above, fitted into the picture; y is up."""
    low, high = moment.bounds
    width, height = (high - low) * 1.06 + 0.6
    x, y = 0.5 * (low + high)
    height = max(height, width / aspect)
    return _from_above(float(x), float(y), float(height), 0.5 * float(height) * max(aspect, 1.0))


def orbit(moment: Moment, aspect: float) -> View:
    """Round the car, once in 18 seconds."""
    angle = math.radians(140.0 + 20.0 * moment.time)
    middle = moment.position + _MIDDLE * moment.rotation[:, 0]
    eye = middle + 0.86 * _direction(angle) + 0.88 * _UP
    return _looking(eye, middle, fovy=math.radians(42.0), shadow_radius=2.5)


CAMERAS: dict[str, Camera] = {camera.__name__: camera for camera in (chase, onboard, top, track, orbit)}
"""By name."""


def find_camera(name: str) -> Camera:
    """Return a camera; raise SettingsError for an unknown one."""
    if name not in CAMERAS:
        raise SettingsError(f"camera is {name!r}; {accepted_names(name, CAMERAS)}")
    return CAMERAS[name]
