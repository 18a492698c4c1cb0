"""Pictures of a study: the table in colours, the driven lines, overtakes by the speed. They need matplotlib."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.pictures.course_drawing import draw_course, draw_obstacles, extent
from fg_mujoco.pictures.pages.figure_kit import ALERT, COLOURS, picture
from fg_mujoco.racing.resolved import Ground, ground_of
from fg_mujoco.rollouts.shares import wilson
from fg_mujoco.simulation.cars import footprint

from ..runs.run import Run, RunRow
from .tables import Cell, Line, conditions, interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CELL = (0.82, 0.5)  # [in] width and height
_PANELS_WIDTH = 10.0  # [in]
_BANDS = 5  # of ratios
_COLUMNS = ((5.0, 1), (2.5, 2), (0.0, 3))  # from this width over height on, so many panels side by side


def table_picture(cells: Sequence[Cell], path: Path) -> None:
    """Draw the table: controllers down, courses across, each cell in the colour of its share of successes.

    In a cell are the successes of the runs, Wilson's interval of their share at 95 % where runs differ, and the median
    of the successes' best laps [s], of a scene of the times to its goal. Where all runs succeed, cells have the best
    and the mean lap [s] and the number of runs, and the colour of the best one over that of the course's fastest
    controller.

    Raises:
      MissingExtraError: matplotlib is not installed.
      OSError: the file cannot be written.
    """
    rows = list(dict.fromkeys(cell["planner"] for cell in cells))
    columns = list(dict.fromkeys(_column(cell) for cell in cells))
    with picture(path, 2.7 + len(columns) * _CELL[0], 1.5 + len(rows) * _CELL[1]) as figure:
        axes = figure.add_subplot()
        shares, laps = np.full((2, len(rows), len(columns)), math.nan)
        by_lap = all(cell["successes"] == cell["runs"] and cell["best_lap_s"] is not None for cell in cells)
        for cell in cells:
            row, column = rows.index(cell["planner"]), columns.index(_column(cell))
            shares[row, column], laps[row, column] = cell["successes"] / cell["runs"], cell["best_lap_s"] or math.nan
            said = interval("successes")(cell)
            lap = "" if cell["best_lap_s"] is None else f"{cell['best_lap_s']:.2f} s"
            text = (
                f"{cell['best_lap_s']:.2f} s\nmean {cell['mean_lap_s']:.2f}\nn = {cell['best_lap_s_of']}"
                if by_lap
                else "\n".join(filter(None, (f"{cell['successes']}/{cell['runs']}", said, lap)))
            )
            dark = not by_lap and abs(cell["successes"] / cell["runs"] - 0.5) > 0.35  # both ends of the scale
            axes.text(column, row, text, ha="center", va="center", color="white" if dark else "black")
        if by_lap:
            ratios = laps / np.nanmin(laps, axis=0)
            slowest = max(float(np.nanmax(ratios)), 1.05)
            image = axes.imshow(ratios, cmap="YlGnBu", vmin=1.0, vmax=1.0 + 1.6 * (slowest - 1.0), aspect="auto")
        else:
            image = axes.imshow(shares, cmap="RdBu", vmin=0.0, vmax=1.0, aspect="auto")
        axes.set_xticks(range(len(columns)), columns, rotation=35.0, ha="left", rotation_mode="anchor")
        axes.set_yticks(range(len(rows)), rows)
        axes.tick_params(top=True, labeltop=True, bottom=False, labelbottom=False, length=0.0)
        axes.set_xticks(np.arange(len(columns) - 1) + 0.5, minor=True)
        axes.set_yticks(np.arange(len(rows) - 1) + 0.5, minor=True)
        axes.grid(False)
        axes.grid(which="minor", color="white", linewidth=1.5)
        axes.tick_params(which="minor", length=0.0, top=False)
        axes.spines[:].set_visible(False)
        label = "best lap over the course's fastest" if by_lap else "share of successes"
        said = "" if by_lap else "successes of the runs, 95 % interval of their share,\n"
        figure.supxlabel(f"{said}median of the successes' best laps", fontsize=7.0)
        scale = figure.colorbar(image, ax=axes, label=label, pad=0.01)
        if by_lap:
            scale.ax.set_ylim(1.0, slowest)
        scale.outline.set_visible(False)


def _column(cell: Cell) -> str:
    """Return what a cell is of besides its planner."""
    names = list(cell)[1 : list(cell).index("runs")]
    values = [str(cell[name]).removeprefix("scene:") for name in names if name == "course"]
    return ", ".join(values + [f"{name.replace('_', ' ')} {cell[name]}" for name in names if name != "course"])


def trace_pictures(runs: Sequence[Run], rows: Sequence[RunRow], out: Path) -> None:
    """Draw, for each course and condition, where every planner drove: the first run that failed, else the first.

    Args:
      runs: of the study.
      rows: theirs.
      out: folder of the pictures, each named after its course.

    Raises:
      MissingExtraError: matplotlib is not installed.
      OSError: a file cannot be written.
    """
    several = conditions(rows, but=("course",))
    groups: dict[str, dict[str, list[tuple[Run, RunRow]]]] = {}
    for run, row in zip(runs, rows, strict=True):
        words = [row.place["course"].removeprefix("scene:"), *(f"{name} {row.place[name]}" for name in several)]
        groups.setdefault(", ".join(words), {}).setdefault(row.car.planner, []).append((run, row))
    for title, by_planner in groups.items():
        name = title.replace(":", "_").replace("/", "p").replace(", ", "_").replace(" ", "")
        _trace_picture(title, by_planner, out / f"{name}.png")


def _trace_picture(title: str, by_planner: dict[str, list[tuple[Run, RunRow]]], path: Path) -> None:
    shown = [next((each for each in runs if not each[1].car.success), runs[0]) for runs in by_planner.values()]
    grounds = {run.key: ground_of(run.setup) for run, _ in shown}
    extents = np.array([extent(ground.course) for ground in grounds.values()])
    (left, bottom), (right, top) = extents[:, 0].min(axis=0), extents[:, 1].max(axis=0)
    shape = (right - left) / (top - bottom)
    across = min(next(count for least, count in _COLUMNS if shape >= least), len(shown))
    down = math.ceil(len(shown) / across)
    with picture(path, _PANELS_WIDTH, (_PANELS_WIDTH / across / shape + 0.42) * down + 0.35) as figure:
        figure.suptitle(title)
        for place, ((run, row), runs) in enumerate(zip(shown, by_planner.values(), strict=True)):
            axes = figure.add_subplot(down, across, place + 1)
            _draw_run(axes, run, grounds[run.key], row, row.poses)
            axes.set(xlim=(left, right), ylim=(bottom, top), xticks=[], yticks=[], xlabel="", ylabel="")
            successes = sum(other.car.success for _, other in runs)
            axes.set_title(f"{row.car.planner}\n{successes}/{len(runs)}; {_ending(row)}", fontsize=7.0)


def _ending(row: RunRow) -> str:
    seed = "" if row.place.get("seed") is None else f"seed {row.place['seed']}: "
    if row.sim_time_s is None:
        return f"{seed}failed"
    return f"{seed}{row.car.end_reason.replace('_', ' ')} at {row.sim_time_s:.1f} s"


def _draw_run(axes: Axes, run: Run, ground: Ground, row: RunRow, trace: FloatArray) -> None:
    """Draw the course, the driven line, and the car and the moving obstacles where they were at the end."""
    draw_course(axes, ground.course)
    draw_obstacles(axes, ground.obstacles, ground.course.moving, row.sim_time_s or 0.0)
    if len(trace):
        axes.plot(*trace[:, :2].T, color=COLOURS[0], linewidth=0.8)
        axes.plot(*trace[0, :2], ".", color=COLOURS[0], markersize=4.0)
        axes.fill(
            *footprint(trace[-1], run.setup.first.car.parameters).T,
            facecolor="none",
            edgecolor=ALERT if row.car.collisions else "black",
        )


def ratio_picture(lines: Sequence[Line], path: Path) -> None:
    """Draw the share of overtakes by the share of the opponent's speed: a panel a planner, a line an opponent.

    Raises:
      MissingExtraError: matplotlib is not installed.
      OSError: the file cannot be written.
    """
    driven = [line for line in lines if line.get("share") is not None]
    planners, opponents = (list(dict.fromkeys(line[name] for line in driven)) for name in ("planner", "opponent"))
    shares = np.array([line["share"] for line in driven] or [0.0])
    width = max(float(np.ptp(shares)), 1e-6) / _BANDS
    bands = np.minimum((shares - shares.min()) / width, _BANDS - 1).astype(int)
    with picture(path, 3.6 * max(len(planners), 1), 2.8) as figure:
        panels = figure.subplots(1, max(len(planners), 1), squeeze=False, sharey=True)[0]
        for axes, planner in zip(panels, planners, strict=False):
            for place, opponent in enumerate(opponents):
                points = []
                for band in range(_BANDS):
                    own = [line["outcome"] == "overtaken" for line, its in zip(driven, bands, strict=True)
                           if its == band and (line["planner"], line["opponent"]) == (planner, opponent)]  # fmt: skip
                    if own:
                        share = sum(own) / len(own)
                        low, high = wilson(sum(own), len(own))
                        aside = 0.5 + 0.08 * (place - 0.5 * (len(opponents) - 1))
                        points.append((shares.min() + (band + aside) * width, share, share - low, high - share))
                if points:
                    x, found, below, above = zip(*points, strict=True)
                    axes.errorbar(
                        x, found, yerr=(below, above), label=opponent, color=COLOURS[place % len(COLOURS)], marker="o",
                        markersize=3.0, capsize=1.5, elinewidth=0.6,
                    )  # fmt: skip
            axes.set(title=planner, xlabel="speed of the opponent, share", ylim=(0.0, 1.03))
        panels[0].set_ylabel("overtaken, no touch")
        if driven:
            panels[0].legend(loc="lower left")
