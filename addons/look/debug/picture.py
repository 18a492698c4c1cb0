"""One decision as a picture: what the page shows of it, on paper. Needs matplotlib."""

from __future__ import annotations

import math
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.pictures.pages.figure_kit import picture
from fg_mujoco.pictures.pages.page import writing

from .decision_colours import COMMAND, DRIVEN, GOAL, MOTION, hex_colour, law_colours, scan_colours
from .decisions import Decision
from .window import AHEAD, Moving, Window

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_AHEAD, _BEHIND, _ASIDE = 6.0, 2.0, 4.0  # [m] that are in the picture
_MOST_LINES = 14  # of a traceback


def debug_picture(seen: Window, path: Path) -> Path:
    """Draw the chosen decision of a run, and return the path of the picture.

    Raises:
      MissingExtraError: matplotlib is not installed.
      RunFolderError: it cannot be written.
    """
    decision = seen.chosen
    with writing(path), picture(path, 9.6, 6.6) as figure:
        grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.05), height_ratios=(1.0, 0.42))
        title = f"{seen.run.title}: t = {decision.time:.3f} s, decision {decision.tick + 1}"
        figure.suptitle(title, fontsize=10)
        _draw_top(figure.add_subplot(grid[0, 0]), seen, decision)
        _draw_ranges(figure.add_subplot(grid[1, 0]), seen, decision)
        _write_steps(figure.add_subplot(grid[:, 1]), seen, decision)
    return path


def _draw_top(axes: Axes, seen: Window, decision: Decision) -> None:
    """Draw what lies round the car, in the frame of its rear axle: ahead is up, left is left."""
    car, bearings = seen.run.car, decision.scan.bearings
    x, y, heading = decision.pose.tolist()
    turn = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
    place = seen.decisions.index(decision)
    for outlines, colour in ((seen.walls, "0.85"), (seen.moving[place], "#e8b48f")):
        for outline in outlines:
            local = (outline - (x, y)) @ turn
            axes.fill(-local[:, 1], local[:, 0], facecolor=colour, edgecolor=colour, linewidth=0.5, zorder=1)

    def ends(ranges: FloatArray) -> tuple[FloatArray, FloatArray]:
        return -ranges * np.sin(bearings), car.lidar_offset + ranges * np.cos(bearings)

    raw = decision.scans["raw"]
    for name, colour in scan_colours(list(decision.scans)).items():
        ranges = decision.scans[name]
        if name == "gap":
            edges = np.flatnonzero(np.diff(np.isfinite(ranges), prepend=False, append=False))
            for first, end in edges.reshape(-1, 2):
                across, ahead = (part[first:end] for part in ends(ranges))
                axes.fill([0.0, *across], [car.lidar_offset, *ahead], facecolor=colour, alpha=0.18, label=name)
        elif name in ("raw", "bubble"):
            kept = (raw > 0.0) & (raw < 0.999 * decision.scan.range_max)
            beams = kept if name == "raw" else kept & (ranges == 0.0)  # of the bubble: what it took away
            across, ahead = ends(raw)
            axes.scatter(across[beams], ahead[beams], s=3 if name == "raw" else 7, color=colour, label=name, zorder=3)
        elif name != "filtered":
            axes.plot(*ends(ranges), color=colour, linewidth=0.8, label=name, zorder=2)
    for drawn in decision.drawn:
        colour = hex_colour(drawn.colour)
        if drawn.points.ndim == 2:
            axes.scatter(-drawn.points[:, 1], drawn.points[:, 0], s=14, color=colour, label=drawn.name, zorder=5)
        else:  # pieces of lines, with a gap between each and the next
            joined = np.concatenate((drawn.points, np.full_like(drawn.points[:, :1], np.nan)), axis=1).reshape(-1, 2)
            axes.plot(-joined[:, 1], joined[:, 0], color=colour, linewidth=1.5, label=drawn.name, zorder=5)
    if len(decision.motion) > 1:
        axes.plot(-decision.motion[:, 1], decision.motion[:, 0], color=MOTION, linewidth=3.0, alpha=0.7,
                  label="motion of guidance", zorder=4)  # fmt: skip
    if decision.command is not None:
        speed = float(np.clip(decision.command.speed, car.min_speed, car.max_speed))
        way = math.copysign(max(AHEAD * abs(speed), 0.5), speed or 1.0)
        angle = float(np.clip(decision.command.steering_angle, -car.max_steering_angle, car.max_steering_angle))
        along = np.linspace(0.0, way, 25)
        turned = along * math.tan(angle) / car.wheelbase
        ahead, left = along * np.sinc(turned / np.pi), along * np.sinc(0.5 * turned / np.pi) * np.sin(0.5 * turned)
        axes.plot(-left, ahead, color=COMMAND, linewidth=2.5, label=f"command, {AHEAD} s", zorder=5)
    way = (seen.driven(decision, decision) - (x, y)) @ turn
    label = f"driven, {AHEAD} s before and after"
    axes.plot(-way[:, 1], way[:, 0], "--", color=DRIVEN, linewidth=1.8, label=label, zorder=5)
    back, front, side = -car.rear_overhang, car.length - car.rear_overhang, 0.5 * car.width
    axes.fill([side, side, -side, -side], [back, front, front, back], color="0.15", zorder=6)
    if decision.goal is not None:
        axes.plot([0.0, -decision.goal[1]], [car.lidar_offset, decision.goal[0]], ":", color=GOAL, zorder=4)
        axes.plot(-decision.goal[1], decision.goal[0], "o", color=GOAL, markersize=7, label="goal", zorder=7)
    ticks = [-4, -2, 0, 2, 4]
    axes.set(xlim=(-_ASIDE, _ASIDE), ylim=(-_BEHIND, _AHEAD), aspect="equal", xticks=ticks,
             xticklabels=[str(-tick) for tick in ticks], xlabel="to the left [m]", ylabel="ahead [m]")  # fmt: skip
    axes.grid(linewidth=0.3, alpha=0.5)
    axes.legend(*_once(axes), loc="upper right", fontsize=7, frameon=True, framealpha=0.85, edgecolor="none")


def _once(axes: Axes) -> tuple[list[Any], list[str]]:
    """Return the entries of a legend, each name once."""
    entries = {name: handle for handle, name in zip(*axes.get_legend_handles_labels(), strict=True)}
    return list(entries.values()), list(entries)


def _draw_ranges(axes: Axes, seen: Window, decision: Decision) -> None:
    """Draw the scans over the bearing, left on the left."""
    bearings = np.degrees(decision.scan.bearings)
    for name, colour in scan_colours(list(decision.scans)).items():
        ranges = decision.scans[name]
        if name == "gap":
            axes.fill_between(bearings, 0.0, ranges, color=colour, alpha=0.18, linewidth=0.0)
        else:
            axes.plot(bearings, ranges, color=colour, linewidth=2.0 if name == "raw" else 0.9,
                      alpha=0.6 if name == "raw" else 1.0)  # fmt: skip
    if decision.goal is not None:
        bearing = math.atan2(decision.goal[1], decision.goal[0] - seen.run.car.lidar_offset)
        axes.axvline(math.degrees(bearing), color=GOAL, linestyle=":")
    returns = decision.scans["raw"][decision.scans["raw"] < 0.999 * decision.scan.range_max]
    top = min(1.08 * float(returns.max(initial=1.0)), decision.scan.range_max)
    axes.set(ylim=(0.0, top), xlabel="bearing [°]", ylabel="range [m]")
    if len(bearings) > 1:
        axes.set_xlim(float(bearings[-1]), float(bearings[0]))
    axes.grid(linewidth=0.3, alpha=0.5)


def _write_steps(axes: Axes, seen: Window, decision: Decision) -> None:
    """Write the command, why it is what it is, and the steps that led to it."""
    axes.axis("off")
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    command, y = decision.command, 0.97
    said = "no command" if command is None else ""
    if command is not None:
        said = f"{command.speed:.2f} m/s,  {math.degrees(command.steering_angle) + 0.0:+.1f}°"
    axes.text(0.0, y, said, fontsize=15, fontweight="bold", va="top")
    y -= 0.075
    told = [f"Speed: {decision.why_speed}", f"Steering angle: {decision.why_steering}"]
    if decision.failure:
        told = decision.failure.splitlines()[:_MOST_LINES]
    for line in (*told, *seen.notes):
        for part in textwrap.wrap(line, 78, subsequent_indent="    ") or [""]:
            axes.text(0.0, y, part, va="top", fontsize=7.5)
            y -= 0.03
        y -= 0.008
    y -= 0.02
    held, shaped = decision.speed_step, decision.steering_step
    colours = law_colours([step.name for step in decision.steps])
    for x, text in ((0.0, "step"), (0.76, "steering [°]"), (1.0, "speed [m/s]")):
        axes.text(x, y, text, color="0.4", va="top", ha="left" if x == 0.0 else "right")
    for step in decision.steps:
        y -= 0.042
        soft = "0.45" if step.on_the_way else "0.1"
        axes.text(0.0, y, step.name, va="top", color=soft)
        values = ((0.76, math.degrees(step.steering_angle), ".1f", shaped), (1.0, step.speed, ".2f", held))
        for x, value, form, holds in values:
            box = {"facecolor": colours[step.name], "edgecolor": "none", "pad": 1.5} if step is holds else None
            axes.text(x, y, "-" if math.isnan(value) else format(value + 0.0, form), va="top", ha="right",
                      color="white" if step is holds else soft, bbox=box)  # fmt: skip
    moving = seen.moving_at(decision)
    for name, text in () if moving is None else _told(decision, moving):
        y -= 0.042
        axes.text(0.0, y - 0.03, name, va="top")
        axes.text(1.0, y - 0.03, text, va="top", ha="right")
    if decision.numbers:
        y -= 0.105
        axes.text(0.0, y, "values that the planner shows", color="0.4", va="top")
    for name, value in decision.numbers.items():
        y -= 0.042
        axes.text(0.0, y, name, va="top")
        axes.text(1.0, y, f"{value:.4g}", va="top", ha="right")


def _told(decision: Decision, moving: Moving) -> list[tuple[str, str]]:
    """Return how the car moves, a name and a text for each line."""
    slides, use = (" ".join(f"{value:.2f}" for value in each) for each in (moving.slides, moving.friction_use))
    return [
        ("speed over the ground, of the odometry", f"{moving.ground_speed:.2f}, {decision.odometry.speed:.2f} m/s"),
        ("sideslip", f"{math.degrees(moving.sideslip):.1f}°"),
        ("tires slide, front and rear, left first", f"{slides} m/s"),
        ("friction utilisation of the tires", use),
    ]
