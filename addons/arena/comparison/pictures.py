"""Pictures of a comparison: the table in colours, and the driven lines on each course. They need matplotlib."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fg_mujoco.messages import FloatArray
from fg_mujoco.pictures.course_drawing import draw_course, draw_obstacles, extent
from fg_mujoco.pictures.pages.figure_kit import ALERT, COLOURS, picture
from fg_mujoco.racing.resolved import Ground
from fg_mujoco.simulation.cars import footprint

from ..intervals import per_cent
from .comparison_tables import Cell, course_title
from .run import Run, RunKey, RunRow
from .run_store import ComparisonFolder

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CELL = (0.82, 0.5)  # [in] width and height
_PANELS_WIDTH = 10.0  # [in]
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
    rows = list(dict.fromkeys(cell.controller for cell in cells))
    columns = list(dict.fromkeys(course_title(cell, cells) for cell in cells))
    with picture(path, 2.7 + len(columns) * _CELL[0], 1.5 + len(rows) * _CELL[1]) as figure:
        axes = figure.add_subplot()
        shares, laps = np.full((2, len(rows), len(columns)), math.nan)
        by_lap = all(cell.successes == cell.runs and cell.best_lap_s is not None for cell in cells)
        for cell in cells:
            row, column = rows.index(cell.controller), columns.index(course_title(cell, cells))
            shares[row, column], laps[row, column] = cell.success_share, cell.best_lap_s or math.nan
            interval = per_cent(cell.success_low, cell.success_high)
            lap = "" if cell.best_lap_s is None else f"{cell.best_lap_s:.2f} s"
            text = (
                f"{cell.best_lap_s:.2f} s\nmean {cell.mean_lap_s:.2f}\nn = {cell.runs_with_laps}"
                if by_lap
                else "\n".join(filter(None, (f"{cell.successes}/{cell.runs}", interval, lap)))
            )
            dark = not by_lap and abs(cell.success_share - 0.5) > 0.35  # both ends of the scale
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


def trace_pictures(runs: Sequence[Run], folder: ComparisonFolder, out: Path) -> None:
    """Draw, for each course at each speed, where every controller drove: the first run that failed, else the first.

    Args:
      runs: of the comparison.
      folder: has their rows and traces.
      out: folder of the pictures, each named after its course.

    Raises:
      MissingExtraError: matplotlib is not installed.
      OSError: a file cannot be written.
    """
    groups: dict[tuple[str, float], dict[str, list[Run]]] = {}
    for run in runs:
        group = groups.setdefault((run.key.course, run.key.max_speed_m_s), {})
        group.setdefault(run.key.controller, []).append(run)
    several = len({speed for _, speed in groups}) > 1
    for (course, speed), by_controller in groups.items():
        title = f"{course.removeprefix('scene:')}, {speed:g} m/s" if several else course.removeprefix("scene:")
        name = title.replace(":", "_").replace("/", "p").replace(", ", "_").replace(" ", "")
        _trace_picture(title, by_controller, folder.runs, folder, out / f"{name}.png")


def _trace_picture(
    title: str,
    by_controller: Mapping[str, Sequence[Run]],
    rows: Mapping[RunKey, RunRow],
    folder: ComparisonFolder,
    path: Path,
) -> None:
    shown = [_most_telling(runs, rows) for runs in by_controller.values()]
    grounds = {run.key.seed: run.ground() for run in shown}
    extents = np.array([extent(ground.course) for ground in grounds.values()])
    (left, bottom), (right, top) = extents[:, 0].min(axis=0), extents[:, 1].max(axis=0)
    shape = (right - left) / (top - bottom)
    across = min(next(count for least, count in _COLUMNS if shape >= least), len(shown))
    down = math.ceil(len(shown) / across)
    with picture(path, _PANELS_WIDTH, (_PANELS_WIDTH / across / shape + 0.42) * down + 0.35) as figure:
        figure.suptitle(title)
        for place, (run, runs) in enumerate(zip(shown, by_controller.values(), strict=True)):
            axes = figure.add_subplot(down, across, place + 1)
            _draw_run(axes, run, grounds[run.key.seed], rows[run.key], folder.trace(run.key))
            axes.set(xlim=(left, right), ylim=(bottom, top), xticks=[], yticks=[], xlabel="", ylabel="")
            successes = sum(rows[other.key].figures.success for other in runs)
            axes.set_title(f"{run.key.controller}\n{successes}/{len(runs)}; {_ending(rows[run.key])}", fontsize=7.0)


def _most_telling(runs: Sequence[Run], rows: Mapping[RunKey, RunRow]) -> Run:
    return next((run for run in runs if not rows[run.key].figures.success), runs[0])


def _ending(row: RunRow) -> str:
    figures = row.figures
    seed = "" if row.key.seed is None else f"seed {row.key.seed}: "
    if figures.sim_time_s is None:
        return f"{seed}failed"
    return f"{seed}{figures.end_reason.replace('_', ' ')} at {figures.sim_time_s:.1f} s"


def _draw_run(axes: Axes, run: Run, ground: Ground, row: RunRow, trace: FloatArray) -> None:
    """Draw the course, the driven line, and the car and the moving obstacles where they were at the end."""
    draw_course(axes, ground.course)
    draw_obstacles(axes, ground.obstacles, ground.course.moving, row.figures.sim_time_s or 0.0)
    if len(trace):
        axes.plot(*trace[:, :2].T, color=COLOURS[0], linewidth=0.8)
        axes.plot(*trace[0, :2], ".", color=COLOURS[0], markersize=4.0)
        axes.fill(
            *footprint(trace[-1], run.settings.car.parameters).T,
            facecolor="none",
            edgecolor=ALERT if row.figures.collisions else "black",
        )
