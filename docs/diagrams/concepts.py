"""Pictures of the concepts: what flows where, a tick, the frames, a track's coordinates, the friction law."""

from __future__ import annotations

import math
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, FancyBboxPatch, Polygon
from style import BUBBLE, CUT_OFF, FREE, GAP, GOAL, STYLE, WALL, WAY, draw_car, save, seen

import fg_mujoco as fg

_ARROW: dict[str, Any] = {"arrowstyle": "-|>", "color": "0.25", "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
_MEASURE = _ARROW | {"arrowstyle": "<|-|>"}
_STEEPEST = 0.4189  # [rad] of the picture of the law
_MU = (1.0489, 0.7, 0.4)


def flow() -> None:
    """Write images/concepts/flow.png: who gives what to whom."""
    figure, axes = _bare((7.2, 3.2), (0.0, 10.8), (0.0, 4.8))
    boxes = {
        "Course": (0.15, 3.45, 1.3, WALL),
        "Vehicle": (0.15, 2.45, 1.3, WALL),
        "LiDAR": (0.15, 1.45, 1.3, WALL),
        "World": (2.25, 2.45, 1.3, WALL),
        "planner": (4.75, 0.15, 2.4, GAP),
        "RaceResult": (8.6, 2.45, 1.6, CUT_OFF),
        "run folder": (8.6, 1.15, 1.6, CUT_OFF),
    }
    for name, (x, y, width, colour) in boxes.items():
        _box(axes, (x, y), (width, 0.7), colour)
        axes.text(x + 0.5 * width, y + 0.35, name, ha="center", va="center", fontsize=9.0)
    for y in (3.8, 2.8, 1.8):
        _arrow(axes, (1.5, y), (2.2, 2.8 + 0.2 * (y - 2.8)))
    _box(axes, (4.3, 1.75), (3.3, 2.3), WAY)
    axes.text(5.95, 3.82, "Engine: n worlds of m cars", ha="center", va="center", fontsize=9.0)
    verbs = {"place": 3.42, "sense": 3.04, "decide": 2.66, "drive": 2.28, "judge": 1.9}
    meaning = ("cars at their starts", "scans, odometry", "planners command", "one tick of physics", "laps, race ends")
    for (verb, y), text in zip(verbs.items(), meaning, strict=True):
        axes.text(4.55, y, verb, va="center", fontsize=8.5, color=WAY)
        axes.text(5.4, y, text, va="center", fontsize=7.5, color="0.4")
    axes.plot([7.28, 7.42, 7.42], [1.9, 1.9, 3.04], color=WAY, linewidth=0.9)
    _arrow(axes, (7.42, 3.04), (7.15, 3.04), WAY)
    _arrow(axes, (3.6, 2.8), (4.25, 2.8))
    _arrow(axes, (7.65, 2.8), (8.55, 2.8))
    _arrow(axes, (9.4, 2.4), (9.4, 1.9))
    _arrow(axes, (5.4, 1.7), (5.4, 0.9))
    _arrow(axes, (6.5, 0.9), (6.5, 1.7))
    axes.text(5.3, 1.3, "LaserScan\nOdometry", ha="right", va="center", fontsize=8.0)
    axes.text(6.6, 1.3, "DriveCommand", va="center", fontsize=8.0)
    axes.text(2.25, 2.3, "one MjModel", fontsize=7.5, color="0.4", va="top")
    axes.text(4.3, 4.2, "stepped by race, rollout, environments, live view, Simulation", fontsize=7.5, color="0.4")
    axes.text(8.6, 3.3, "telemetry and states,\none row a tick", fontsize=7.5, color="0.4", va="bottom")
    axes.text(8.6, 1.03, "replay: the same bits", fontsize=7.5, color="0.4", va="top")
    axes.text(7.8, 0.5, "reset() and\n__call__(scan, odometry)", fontsize=7.5, color="0.4", va="center")
    save(figure, "concepts/flow")


def tick() -> None:
    """Write images/concepts/tick.png: what happens in the 25 ms between two scans."""
    figure, axes = _bare((7.2, 1.9), (-9.0, 63.0), (-1.9, 2.4))
    axes.plot([-4.0, 58.0], [0.0, 0.0], color="0.25", linewidth=0.9)
    for step in range(11):
        axes.plot([5 * step] * 2, [-0.12, 0.12], color="0.25", linewidth=0.9)
    verbs = ("sense\ndecide", "judge, sense\ndecide", "judge, sense\n...")
    for k, text in enumerate(verbs):
        axes.plot([25 * k] * 2, [-0.45, 0.45], color=WAY, linewidth=1.6)
        axes.text(25 * k, -0.6, text, ha="center", va="top", fontsize=8.0, color=WAY)
        axes.text(25 * k, -1.75, f"stamp {25 * k} ms", ha="center", fontsize=7.5, color="0.4")
    for k in range(2):
        axes.annotate("", xy=(25 * k + 24.4, 0.75), xytext=(25 * k + 0.6, 0.75), arrowprops=_MEASURE)
        axes.text(25 * k + 12.5, 0.92, "drive: five physics steps of 5 ms", ha="center", fontsize=8.0, color=WAY)
        axes.text(25 * k + 12.5, -0.35, f"command {k + 1} is held", ha="center", va="top", fontsize=7.5)
    text = "The slip of each tire is measured, and hooks act, at each physics step."
    axes.text(25.0, 1.7, text, ha="center", fontsize=7.5, color="0.4")
    axes.text(59.0, 0.0, "time", va="center", fontsize=8.0)
    save(figure, "concepts/tick")


def frames() -> None:
    """Write images/concepts/frames.png: the car's frame, the beams, the steering angle."""
    car = fg.World("oval").parameters
    figure, axes = _bare((5.0, 4.6), (-0.78, 0.78), (-0.36, 1.08))
    lidar = np.array([car.lidar_offset, 0.0])
    for name, bearing in (("beam 0: -135°", -135.0), ("beam 540: 0°", 0.0), ("beam 1080: 135°", 135.0)):
        end = lidar + 0.62 * np.array([math.cos(math.radians(bearing)), math.sin(math.radians(bearing))])
        axes.plot(*seen(np.stack((lidar, end))).T, color=GOAL, linewidth=1.0)
        (x, y), above = seen(end), bearing == 0.0
        axes.text(x, y + (0.03 if above else -0.05), name, ha="center", fontsize=7.5, color=GOAL)
    fan = np.radians(np.linspace(-135.0, 135.0, 100))
    points = lidar + 0.62 * np.stack((np.cos(fan), np.sin(fan)), axis=1)
    axes.add_patch(Polygon(seen(np.concatenate((lidar[None], points))), facecolor=FREE, linewidth=0, zorder=0))
    draw_car(axes, car, 0.3)
    axes.annotate("", xy=(0.0, 0.2), xytext=(0.0, 0.0), arrowprops=_ARROW | {"color": BUBBLE}, zorder=9)
    axes.annotate("", xy=(-0.2, 0.0), xytext=(0.0, 0.0), arrowprops=_ARROW | {"color": BUBBLE}, zorder=9)
    axes.text(0.015, 0.17, "x", color=BUBBLE, fontsize=9.0, zorder=9)
    axes.text(-0.2, 0.02, "y", color=BUBBLE, fontsize=9.0, zorder=9)
    axes.text(0.0, -0.24, "base_link: the middle of the rear axle", fontsize=7.5, color=BUBBLE, ha="center", va="top")
    axes.annotate("", xy=(0.3, car.wheelbase), xytext=(0.3, 0.0), arrowprops=_MEASURE)
    for x in (0.0, car.wheelbase):
        axes.plot([0.17, 0.32], [x, x], ":", color="0.4", linewidth=0.7)
    axes.text(0.32, 0.5 * car.wheelbase, f"wheelbase\n{car.wheelbase:.4f} m", fontsize=7.5, va="center")
    axes.text(-0.17, car.lidar_offset, f"LiDAR, {car.lidar_offset:.3f} m\nahead", ha="right", va="center", fontsize=7.5)
    axes.plot([0.118, 0.118], [car.wheelbase, 0.56], "--", color="0.4", linewidth=0.7)
    tip = (0.118 - 0.23 * math.sin(0.3), car.wheelbase + 0.23 * math.cos(0.3))
    axes.plot([0.118, tip[0]], [car.wheelbase, tip[1]], "--", color="0.4", linewidth=0.7)
    axes.add_patch(Arc((0.118, car.wheelbase), 0.38, 0.38, theta1=90.0, theta2=90.0 + math.degrees(0.3), color="0.25"))
    axes.text(0.135, 0.55, "steering angle, left positive", fontsize=7.5)
    save(figure, "concepts/frames")


def track() -> None:
    """Write images/concepts/track.png: progress and offset, walls, widths."""
    course = fg.load_track("chicanes")
    figure, axes = _bare((6.4, 2.4), None, None)
    for wall in (course.left_wall, course.right_wall):
        axes.plot(*np.concatenate((wall, wall[:1])).T, color=WALL, linewidth=1.4)
    line = np.concatenate((course.centreline, course.centreline[:1]))
    axes.plot(*line.T, "--", color="0.55", linewidth=0.9)
    s, offset = 19.0, -0.55
    x, y, heading = course.start_pose(0.0)
    side = np.array([-math.sin(heading), math.cos(heading)])
    axes.plot(*np.stack(((x, y) + 1.1 * side, (x, y) - 1.1 * side)).T, color="black", linewidth=2.0)
    driven = np.array([course.start_pose(float(a))[:2] for a in np.linspace(0.0, s, 120)])
    axes.plot(*driven.T, color=WAY, linewidth=2.0)
    foot, point = driven[-1], np.array(course.start_pose(s, offset)[:2])
    axes.plot(*np.stack((foot, point)).T, color=BUBBLE, linewidth=2.0)
    axes.plot(*point, "o", color="black", ms=4.5, zorder=5)
    axes.text(*(driven[60] - (0.0, 0.4)), "progress s", color=WAY, fontsize=9.0, ha="center", va="top")
    pointer = {"arrowstyle": "-", "color": BUBBLE, "linewidth": 0.6}
    where: dict[str, Any] = {"xytext": (-75, -36), "textcoords": "offset points"}
    text, middle = "offset n, left positive", 0.5 * (foot + point)
    axes.annotate(text, middle, **where, fontsize=9.0, color=BUBBLE, arrowprops=pointer)
    axes.text(x, y - 1.7, "start: s = 0", ha="center", fontsize=8.0)
    (left, bottom), (right, top) = driven.min(axis=0), driven.max(axis=0)
    axes.set(xlim=(left - 2.4, right + 2.4), ylim=(bottom - 2.2, top + 1.4))
    save(figure, "concepts/track")


def friction() -> None:
    """Write images/concepts/friction.png: the law over the steering angle, and a tire's friction circle."""
    car = fg.World("oval").parameters
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 2.9), layout="constrained")
        law, circle = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
        angle = np.linspace(0.008, _STEEPEST, 300)
        for mu, colour in zip(_MU, (WAY, GAP, CUT_OFF), strict=True):
            speed = np.sqrt(car.gravity * mu * car.wheelbase / np.tan(angle))
            law.plot(np.degrees(angle), speed, color=colour, label=f"mu = {mu}")
        law.fill_between(np.degrees(angle), np.sqrt(car.gravity * _MU[0] * car.wheelbase / np.tan(angle)), 20.0,
                         color=BUBBLE, alpha=0.12, linewidth=0)  # fmt: skip
        law.text(12.0, 6.3, "the tires slide", color=BUBBLE)
        law.set(xlim=(0, 24), ylim=(0, 10), xlabel="steering angle [degrees]", ylabel="speed [m/s]")
        law.legend(loc="upper right")
        law.set_title("v = sqrt(g mu b / tan d)", fontsize=8.0)
        circle.add_patch(Circle((0, 0), 1.0, fill=False, color="0.25", linewidth=1.2))
        force = np.array([0.62, 0.5])
        circle.annotate("", xy=force, xytext=(0, 0), arrowprops=_ARROW | {"color": WAY, "linewidth": 1.8})
        circle.plot([force[0]] * 2, [0, force[1]], ":", color="0.5")
        circle.plot([0, force[0]], [force[1]] * 2, ":", color="0.5")
        circle.plot([-1.15, 1.15], [0, 0], color="0.8", linewidth=0.6, zorder=0)
        circle.plot([0, 0], [-1.15, 1.15], color="0.8", linewidth=0.6, zorder=0)
        circle.text(0.66, 0.04, "cornering", fontsize=7.5)
        circle.text(0.03, 0.56, "driving", fontsize=7.5)
        circle.text(0.0, -0.72, f"friction utilisation {np.hypot(*force):.1f}", ha="center", fontsize=7.5, color=WAY)
        circle.text(0.0, 1.06, "mu times the tire's load", ha="center", fontsize=7.5)
        circle.set(xlim=(-1.2, 1.2), ylim=(-1.2, 1.25), aspect="equal")
        circle.axis("off")
        save(figure, "concepts/friction")


def _bare(
    size: tuple[float, float], x: tuple[float, float] | None, y: tuple[float, float] | None
) -> tuple[Figure, Axes]:
    """Return a figure [in] with axes that fill it, of equal scale unless it is wide, without a frame."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=size)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.axis("off")
        if x is not None and y is not None:
            axes.set(xlim=x, ylim=y)
        if size[0] < 7.0:
            axes.set_aspect("equal")
        return figure, axes


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], colour: str = "0.25") -> None:
    axes.annotate("", xy=end, xytext=start, arrowprops=_ARROW | {"color": colour})


def _box(axes: Axes, corner: tuple[float, float], size: tuple[float, float], colour: str) -> None:
    """Draw a box with round corners."""
    shape = "round,pad=0.03,rounding_size=0.12"
    axes.add_patch(FancyBboxPatch(corner, *size, boxstyle=shape, ec=colour, fc="white"))


def main() -> None:
    """Draw all concepts."""
    for draw in (flow, tick, frames, track, friction):
        draw()
