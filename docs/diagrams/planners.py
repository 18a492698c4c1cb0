"""What each planner makes of one and the same scan: the car before a box, at the entry of a bend.

To the left from above, to the right the range of each beam. Everything drawn is worked out by the planner itself:
intermediate scans, goal, and reference steering angle, before the safety filter and the friction limiter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from style import BUBBLE, CUT_OFF, FREE, GAP, GOAL, STYLE, WALL, WAY, arc, draw_car, save, seen, turn

import fg_mujoco as fg

TRACK, S, OFFSET, HEADING, SPEED = "chicanes", 16.4, -0.2, 0.2, 3.0
BOX_S, BOX_OFFSET = 19.6, -0.35  # [m] where it stands
WINDOW = ((-3.9, 2.5), (-1.2, 7.8))  # [m] to the right and ahead
FARTHEST = 9.0  # [m] of the picture of the ranges

Array = np.ndarray[Any, Any]


class Situation:
    """A pose on a track with a box before the car, and what the car senses there."""

    def __init__(self) -> None:
        self.track = fg.load_track(TRACK)
        x, y, heading = self.track.start_pose(BOX_S, BOX_OFFSET)
        self.box = fg.Box(x=x, y=y, length=0.4, width=0.4, heading=heading)
        self.world = fg.World(self.track, obstacles=(self.box,))
        self.car = self.world.parameters
        self.scan, self.odometry = fg.Simulation(self.world).reset(s=S, offset=OFFSET, heading=HEADING, speed=SPEED)

    def planner(self, name: str) -> Any:
        """Return a planner at its default settings, without friction limits, so that it commands its reference."""
        return fg.make_controller(name, car=self.car, mu=math.inf, max_speed=8.0, map_line=self.track.map_line)

    def in_car(self, points: Array) -> Array:
        """Return points of the map (n, 2) [m] in the car's frame."""
        x, y, heading = self.odometry.pose
        return np.asarray((points - (x, y)) @ turn(heading))

    def at(self, bearings: Array, ranges: Array) -> Array:
        """Return what the LiDAR sees at bearings (n,) [rad] and ranges (n,) [m], in the car's frame (n, 2) [m]."""
        return np.stack((self.car.lidar_offset + ranges * np.cos(bearings), ranges * np.sin(bearings)), axis=-1)


def draw(situation: Situation, name: str) -> None:
    """Write images/planners/`name`.png."""
    planner = situation.planner(name)
    command = planner(situation.scan, situation.odometry)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 3.9), layout="constrained")
        above, ranges = figure.subplots(1, 2, width_ratios=(1.0, 1.3))
        _draw_ground(above, situation)
        _draw_ranges(ranges, situation)
        work = planner.intermediate_scans(situation.scan)
        _draw_stages(above, ranges, situation, work)
        own = {"wall_follow": _wall_follow, "pure_pursuit": _pure_pursuit, "widest_gap": _widest_gap}
        own.get(name, _goal)(above, ranges, situation, planner)
        length = 2.2
        curvature = math.tan(command.steering_angle) / situation.car.wheelbase
        above.plot(*seen(arc(curvature, length)).T, color=WAY, linewidth=2.0, label="reference", zorder=4)
        draw_car(above, situation.car, command.steering_angle)
        side = "left" if command.steering_angle > 0.0 else "right"
        degrees = abs(math.degrees(command.steering_angle))
        figure.suptitle(f"{name}: steers {degrees:.1f}° to the {side}", fontsize=9.0, x=0.01, ha="left")
        handles = {label: handle for axes in (above, ranges) for handle, label in _labelled(axes)}
        ranges.legend(handles.values(), handles.keys(), loc="upper right", fontsize=7.0)
        save(figure, f"planners/{name}")


def _labelled(axes: Axes) -> list[tuple[Any, str]]:
    return list(zip(*axes.get_legend_handles_labels(), strict=True))


def _draw_ground(axes: Axes, situation: Situation) -> None:
    scan = situation.scan
    for wall in (situation.track.left_wall, situation.track.right_wall):
        closed = np.concatenate((wall, wall[:1]))
        axes.plot(*seen(situation.in_car(closed)).T, color=WALL, linewidth=1.4)
    box = seen(situation.in_car(situation.box.corners()))
    axes.add_patch(Polygon(box, facecolor="0.6", edgecolor=WALL, linewidth=1.2, zorder=3))
    fan = np.concatenate(([[situation.car.lidar_offset, 0.0]], situation.at(scan.bearings, scan.ranges)))
    axes.add_patch(Polygon(seen(fan), facecolor=FREE, linewidth=0))
    axes.set(xlim=WINDOW[0], ylim=WINDOW[1], aspect="equal", xlabel="to the right [m]", ylabel="ahead [m]")


def _draw_ranges(axes: Axes, situation: Situation) -> None:
    axes.plot(np.degrees(situation.scan.bearings), situation.scan.ranges, color="0.55", linewidth=0.9, label="scan")
    axes.set(xlim=(137, -137), ylim=(0.0, FARTHEST), xlabel="bearing [degrees], left positive", ylabel="range [m]")
    axes.set_xticks(range(-135, 136, 45))


def _draw_stages(above: Axes, axes: Axes, situation: Situation, work: dict[str, Array]) -> None:
    bearings, raw = situation.scan.bearings, work["raw"]
    degrees, lidar = np.degrees(bearings), [[situation.car.lidar_offset, 0.0]]
    before = raw
    if "extended" in work:
        before = work["extended"]
        # several beams share an edge: one outline, out along what was measured and back along what is left
        outline = np.concatenate((situation.at(bearings, raw), situation.at(bearings, before)[::-1]))
        above.add_patch(Polygon(seen(outline), facecolor=CUT_OFF, alpha=0.45, linewidth=0, label="cut off"))
        axes.fill_between(degrees, before, raw, color=CUT_OFF, alpha=0.45, linewidth=0)
    if "bubble" in work:
        for first, end in _runs(work["bubble"] <= 0.0):
            sector = np.concatenate((lidar, situation.at(bearings[first:end], before[first:end])))
            above.add_patch(Polygon(seen(sector), facecolor=BUBBLE, alpha=0.45, linewidth=0, label="bubble"))
            axes.fill_between(degrees[first:end], before[first:end], color=BUBBLE, alpha=0.45, linewidth=0)
    if "gap" in work:
        for first, end in _runs(np.isfinite(work["gap"])):
            sector = np.concatenate((lidar, situation.at(bearings[first:end], work["gap"][first:end])))
            above.add_patch(Polygon(seen(sector), facecolor=GAP, alpha=0.4, linewidth=0, label="gap"))
            axes.fill_between(degrees[first:end], work["gap"][first:end], color=GAP, alpha=0.4, linewidth=0)


def _runs(mask: Array) -> list[tuple[int, int]]:
    """Return where a mask (n,) is true: first, and last + 1, of each run."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]


def _goal(above: Axes, axes: Axes, situation: Situation, planner: Any) -> None:
    bearing, distance = planner.find_goal(situation.scan)
    _mark(above, axes, situation, bearing, distance, f"goal, {distance:.1f} m away")


def _mark(above: Axes, axes: Axes, situation: Situation, bearing: float, distance: float, label: str) -> None:
    point = seen(situation.at(np.array([bearing]), np.array([distance])))
    lidar = seen(np.array([[situation.car.lidar_offset, 0.0]]))
    above.plot(*np.concatenate((lidar, point)).T, color=GOAL, linewidth=1.0)
    above.plot(*point.T, "o", color=GOAL, ms=6.0, mec="black", mew=0.5, label=label, zorder=8)
    axes.plot([math.degrees(bearing)], [distance], "o", color=GOAL, ms=6.0, mec="black", mew=0.5, zorder=8)


def _widest_gap(above: Axes, axes: Axes, situation: Situation, planner: Any) -> None:
    centre = planner.find_centre(situation.scan)
    if centre is not None:
        x, y = centre
        above.plot(
            *seen(np.array([[x, y]])).T, "D", color=GAP, ms=5.5, mec="black", mew=0.5, label="centre C", zorder=8
        )
        bearing, distance = math.atan2(y, x - situation.car.lidar_offset), math.hypot(x - situation.car.lidar_offset, y)
        axes.plot([math.degrees(bearing)], [distance], "D", color=GAP, ms=5.5, mec="black", mew=0.5, zorder=8)
        beam = int(np.argmin(np.abs(situation.scan.bearings - bearing)))
        ends = slice(beam - 1, beam + 2)
        points = situation.at(situation.scan.bearings[ends], situation.scan.ranges[ends])
        above.plot(*seen(points).T, color=GAP, linewidth=2.5, label="widest gap", zorder=7)
    half = math.degrees(0.5 * planner.settings.field_of_view)
    axes.axvspan(-half, half, color="0.96", zorder=0)
    _goal(above, axes, situation, planner)


def _wall_follow(above: Axes, axes: Axes, situation: Situation, planner: Any) -> None:
    scan, theta = situation.scan, planner.settings.beam_angle
    lidar = np.array([[situation.car.lidar_offset, 0.0]])
    for side in (1.0, -1.0):
        ends = []
        for name, bearing in (("b", side * 0.5 * math.pi), ("a", side * (0.5 * math.pi - theta))):
            reading = float(scan.ranges[np.argmin(np.abs(scan.bearings - bearing))])
            point = situation.at(np.array([bearing]), np.array([reading]))
            label = "beams a and b" if side > 0.0 and name == "b" else None
            above.plot(*seen(np.concatenate((lidar, point))).T, color=GAP, linewidth=1.3, marker=".", label=label)
            above.annotate(
                name, seen(0.5 * (lidar + point))[0], fontsize=8.0, xytext=(2, 2), textcoords="offset points"
            )
            axes.plot([math.degrees(bearing)] * 2, [0.0, reading], color=GAP, linewidth=1.3, marker=".")
            axes.annotate(name, (math.degrees(bearing), reading), xytext=(3, 3), textcoords="offset points")
            ends.append(point[0])
        b, a = ends
        along = (a - b) / np.hypot(*(a - b))
        label = "the wall as they see it" if side > 0.0 else None
        above.plot(*seen(np.stack((b - along, a + along))).T, "--", color=GOAL, linewidth=1.4, label=label, zorder=4)


def _pure_pursuit(above: Axes, axes: Axes, situation: Situation, planner: Any) -> None:
    line = situation.in_car(planner.speed_profile()[:, :2])
    above.plot(*seen(line).T, "--", color=GAP, linewidth=1.0, label="the line")
    x, y = situation.in_car(np.array([planner.find_goal(situation.odometry)]))[0]
    above.add_patch(Circle((0.0, 0.0), math.hypot(x, y), fill=False, color=GOAL, linewidth=0.8, label="lookahead"))
    above.plot([0.0, -y], [0.0, x], color=GOAL, linewidth=1.0)
    above.plot([-y], [x], "o", color=GOAL, ms=6.0, mec="black", mew=0.5, label="goal", zorder=8)
    axes.text(130, 0.25, "it steers by the line, and does not look at these", color="0.4", fontsize=7.5)


def main(names: Sequence[str] = ()) -> None:
    """Draw planners; without a name, all that are bundled."""
    situation = Situation()
    for name in names or fg.controller_names():
        draw(situation, name)
