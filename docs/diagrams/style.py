"""The one style of the documentation's diagrams, and how they are saved: small, and the same from the same sources."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from PIL import Image

import fg_mujoco as fg

IMAGES = Path(__file__).parent.parent / "images"
GREATEST_SIZE = 60_000  # [bytes] of a picture

STYLE: Any = {"font.size": 8.0, "axes.linewidth": 0.6, "lines.linewidth": 1.0, "legend.frameon": False}
CUT_OFF, BUBBLE, GAP, GOAL, WAY = "#e69f00", "#d55e00", "#009e73", "#cc79a7", "#0072b2"  # Okabe and Ito
WALL, FREE, CAR = "0.35", "0.93", "#1a4f9c"

_COLOURS = 256  # of a palette


def save(figure: Figure, name: str) -> None:
    """Write a figure as docs/images/`name`.png, with a palette.

    Raises:
      ValueError: it is larger than GREATEST_SIZE.
    """
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=150)
    picture = Image.open(drawn).convert("RGB").quantize(_COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    path = IMAGES / f"{name}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    picture.save(path, optimize=True)
    if path.stat().st_size > GREATEST_SIZE:
        raise ValueError(f"{path} has {path.stat().st_size} bytes; accepted: at most {GREATEST_SIZE}")


def draw_car(axes: Axes, car: fg.CarParameters, steering_angle: float = 0.0, *, alpha: float = 1.0) -> None:
    """Draw the car from above in its own frame, x ahead upwards and y to the left: chassis, wheels, LiDAR."""
    back, front, half = -car.rear_overhang, car.length - car.rear_overhang, 0.5 * car.width
    body = np.array([[back, -half], [front, -half], [front, half], [back, half]])
    axes.add_patch(Polygon(seen(body), facecolor=CAR, alpha=0.25 * alpha, edgecolor=CAR, linewidth=0.8, zorder=5))
    for x, angle in ((0.0, 0.0), (car.wheelbase, steering_angle)):
        for y in (-0.5 * car.track_width, 0.5 * car.track_width):
            r = car.wheel_radius
            wheel = np.array([[-r, -0.025], [r, -0.025], [r, 0.025], [-r, 0.025]]) @ turn(angle).T + (x, y)
            axes.add_patch(Polygon(seen(wheel), facecolor="0.1", alpha=alpha, linewidth=0, zorder=6))
    axes.plot(*seen(np.array([[car.lidar_offset, 0.0]])).T, "o", color="white", mec="0.1", ms=3.5, mew=0.7, zorder=7)


def turn(angle: float) -> np.ndarray[Any, Any]:
    """Return the matrix that turns a point by an angle [rad]. Shape (2, 2)."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def seen(points: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return points of the car's frame (n, 2) [m] as they are drawn: ahead is up, left is left."""
    return np.stack((-points[..., 1], points[..., 0]), axis=-1)


def arc(curvature: float, length: float) -> np.ndarray[Any, Any]:
    """Return points of the rear axle's way at a curvature [1/m], in the car's frame. Shape (50, 2) [m]."""
    s = np.linspace(0.0, length, 50)
    if abs(curvature) < 1e-6:
        return np.stack((s, 0.0 * s), axis=1)
    return np.stack((np.sin(curvature * s), 1.0 - np.cos(curvature * s)), axis=1) / curvature
