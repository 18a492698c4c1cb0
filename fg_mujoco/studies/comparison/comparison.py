"""Drives every controller on every course with every seed, and writes tables and pictures of how they fared.

    comparison = compare(["gap_finder", "follow_the_gap[point=middle]"], tracks=["oval"], out="runs/compare")
    print(comparison.markdown())

A later call with the same folder drives only the runs that are missing. A script that calls it with several workers
needs `if __name__ == "__main__":`, as every script that starts processes does.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...arguments import explain_class
from ...course.scenes.catalogue import PREFIX
from ...course.writing import write_file
from ...display import Shown, brief, paragraph, quoted, table
from ...messages import FloatArray, require_whole
from ...racing.entries import Entry
from ...racing.opponents import Opponents, entry_of
from ...racing.planner_choice import ControllerChoice
from ...racing.planner_files import files_sha256
from ...racing.planner_sources import controller_names
from ...simulation.settings import FASTEST
from ...vehicle.changes import CarChanges
from ...vehicle.friction_patches import Patch
from ...vehicle.tires import Tires
from ...vehicle.vehicle import DEFAULT_VEHICLE, Vehicle
from ...viz.plots import require_matplotlib
from ..rollout.job import versions
from ..run_grid import require_axes, time_left
from ..store import WRITABLE, blame, claimed
from ..workers import work_through
from .differences import HEADER as DIFFERENCES
from .differences import LEGEND as DIFFERENCES_LEGEND
from .differences import (
    PairedDifference,
    difference_rows,
    differences_csv,
    differences_markdown,
    paired_differences,
    shown_differences,
)
from .ground import check_course, course_ground, course_name, ground_sha256
from .pictures import table_picture, trace_pictures
from .run import ComparisonSettings, Run, RunKey, RunRow
from .run_store import ComparisonFolder
from .tables import LEGEND, Cell, cells_csv, header_of, make_cells, markdown, runs_csv, table_rows

DEFAULT_SEEDS = range(10)


@explain_class
@dataclass(frozen=True, kw_only=True)
class ComparisonProgress:
    """What a comparison tells whoever watches it."""

    runs: int
    runs_found: int  # in the folder, driven by an earlier call
    runs_driven: int  # by this call
    wall_time_s: float

    @property
    def remaining_s(self) -> float | None:
        """What it will still take, if it goes on like this [s]; None before the first run is finished."""
        return time_left(self.runs, self.runs_found, self.runs_driven, self.wall_time_s)


@explain_class
@dataclass(frozen=True, kw_only=True, repr=False)
class Comparison(Shown):
    """How all runs went."""

    rows: tuple[RunRow, ...]  # of each controller, on each course, at each speed, with each seed
    cells: tuple[Cell, ...]  # of each controller on each course at each speed
    folder: Path
    runs_driven: int  # by this call
    wall_time_s: float

    def __repr__(self) -> str:
        controllers, courses = ({getattr(cell, name) for cell in self.cells} for name in ("controller", "course"))
        ends = Counter(row.figures.end_reason for row in self.rows)
        found = ", ".join(f"{count} {reason}" for reason, count in sorted(ends.items()))
        grid = f"{len(self.rows)} runs, {len(controllers)} controllers on {len(courses)} courses: {found}"
        return brief(self, grid, f"in {quoted(self.folder)}")

    def _repr_html_(self) -> str:
        cells = table(header_of(self.cells), table_rows(self.cells)) + paragraph(LEGEND)
        shown = shown_differences(self.differences) if self.differences else []
        pairs = table(DIFFERENCES, difference_rows(shown)) + paragraph(DIFFERENCES_LEGEND) if shown else ""
        return cells + pairs + paragraph(f"{len(self.rows)} runs in {self.folder}")

    @property
    def differences(self) -> tuple[PairedDifference, ...]:
        """How each two controllers differ in the runs that both drove."""
        return paired_differences(self.rows)

    def markdown(self) -> str:
        """Return the table, and that of the differences from the first controller, each with its legend."""
        pairs = differences_markdown(self.differences)
        return f"{markdown(self.cells)}\n{LEGEND}\n" + (f"\n{pairs}" if pairs else "")

    def summary(self) -> dict[str, Any]:
        """Return the figures, as JSON has them."""
        return {
            "runs": len(self.rows),
            "runs_driven": self.runs_driven,
            "wall_time_s": self.wall_time_s,
            "table": [cell.as_dict() for cell in self.cells],
            "differences": [difference.as_dict() for difference in self.differences],
        }


def compare(
    controllers: Sequence[str] | None = None,
    *,
    tracks: Sequence[str] = (),
    scenes: Sequence[str] = (),
    seeds: Sequence[int] = DEFAULT_SEEDS,
    max_speeds: Sequence[float] = (FASTEST,),
    laps: int = 5,
    obstacles: int = 0,
    lidar_noise: float = 0.0,
    vehicle: Vehicle | str | Path = DEFAULT_VEHICLE,
    tires: Tires | str | Path | None = None,
    mu: float | None = None,
    changes: CarChanges | None = None,
    planner_mu: float | None = None,
    patches: Sequence[Patch] = (),
    time_limit: float | None = None,
    decision_limit: float | None = None,
    opponents: Sequence[Entry | str] = (),
    grid: str = "staggered",
    workers: int | None = None,
    out: str | Path,
    pictures: bool = True,
    watch: Callable[[ComparisonProgress], None] | None = None,
) -> Comparison:
    """Drive every controller on every course at every speed with every seed, and write what became of them to a folder.

    A run in which the planner fails, or ends its worker process, is a row that says so; the others go on. Ctrl-C
    raises KeyboardInterrupt once the workers have stopped; finished runs are then in the folder, and the same call goes
    on with the others.

    Args:
      controllers: bundled names or `path/to/file.py:ClassName`, each with settings that differ from its own in brackets
        where wanted, as `gap_finder[lookahead=8]`; None: all bundled ones.
      tracks: as `load_track` takes them.
      scenes: names of scenes.
      seeds: of a scene; on a track, of the obstacles and the LiDAR's noise. Where nothing depends on it, a course is
        driven once.
      max_speeds: fastest that the planner may command, one after the other [m/s].
      laps: on tracks; a scene is driven once.
      obstacles: boxes on each track, with a way past each.
      lidar_noise: standard deviation of each range [m].
      vehicle: a bundled name, the path of a vehicle's MJCF file, or a Vehicle.
      tires: a bundled set, the path of a TOML file, or Tires; None: the vehicle's.
      mu: friction coefficient of the tires, or the greatest peak of those with a curve; None: as in their file.
      changes: what else differs from the vehicle's MJCF.
      planner_mu: friction coefficient that planners assume; None: the least peak of the tires, as `mu` sets it; inf: no
        friction limits.
      patches: of the floor, on which the tires have another friction.
      time_limit: of simulated time of each run [s]; None: as `race` has it.
      decision_limit: of wall time that a planner may take for one decision [s]; None: any; as of `race`.
      opponents: that the car of each run races against: entries as of `race`, or names of planners, each in a car
        that is set as that of the runs, at 8 m/s at most. Rows are the car's, with how it fared among the others. A run
        goes on until each of its cars has finished or cannot go on. Cars that touch are no failure: `contacts` counts
        them.
      grid: "staggered" or "side_by_side": where opponents without a start of their own stand, behind the car.
      workers: processes; None: as many as there are cores; one: no other than this, which a planner can end.
      out: a new or empty folder, or one of a comparison with the same settings, from `laps` to `grid`.
      pictures: whether to draw them.
      watch: called several times a second.

    Raises:
      SettingsError, TrackError, ControllerError, RunFolderError: what cannot be driven; nothing has run then.
      MissingExtraError: no matplotlib for the pictures.
      EngineError: a worker process could not be started.
    """
    require_whole("workers", workers, 1, optional=True)
    if pictures:
        require_matplotlib()
    settings = ComparisonSettings(
        laps=laps, obstacles=obstacles, lidar_noise=lidar_noise, vehicle=vehicle, tires=tires, mu=mu,
        changes=changes or CarChanges(), planner_mu=planner_mu, patches=patches, time_limit=time_limit,
        decision_limit=decision_limit,
    )  # fmt: skip
    if opponents or grid != Opponents.grid:
        like = entry_of(settings.drive(), "gap_finder")
        settings = replace(settings, opponents=Opponents.of(opponents, first=like, grid=grid))
    chosen = [ControllerChoice.of(text) for text in (controller_names() if controllers is None else controllers)]
    runs = plan_runs(chosen, [*tracks, *(f"{PREFIX}{name}" for name in scenes)], max_speeds, seeds, settings)
    folder = ComparisonFolder(out)
    with claimed(folder):
        folder.open(runs[0].settings.manifest(), versions())
        folder.read(repair=True)
        missing = [run for run in runs if run.key not in folder.runs]

        def keep(run: Run, driven: tuple[RunRow, FloatArray]) -> None:
            row, trace = driven
            folder.add(row, trace)
            if row.figures.end_reason == "worker_died":
                warnings.warn(f"{run}: {row.figures.message}", UserWarning, stacklevel=2)

        def tell(driven: int, elapsed: float) -> None:
            if watch is not None:
                found = len(runs) - len(missing)
                watch(ComparisonProgress(runs=len(runs), runs_found=found, runs_driven=driven, wall_time_s=elapsed))

        taken = work_through(Run.drive, missing, keep, workers=workers, watch=tell, died=Run.died)
        rows = tuple(folder.runs[run.key] for run in runs)
        comparison = Comparison(
            rows=rows, cells=make_cells(rows), folder=folder.folder, runs_driven=len(missing), wall_time_s=taken
        )  # fmt: skip
        folder.runs.sort([run.key for run in runs])
        _write_report(comparison, runs, folder, pictures=pictures)
        return comparison


def plan_runs(
    controllers: Sequence[ControllerChoice],
    courses: Sequence[str],
    max_speeds: Sequence[float],
    seeds: Sequence[int],
    settings: ComparisonSettings,
) -> list[Run]:
    """Return the runs of a grid, in its order; their settings have the files that the opponents' planners read.

    Args:
      controllers: which.
      courses: tracks as `load_track` takes them, or `scene:NAME`.
      max_speeds: [m/s].
      seeds: whole numbers.
      settings: what all runs have in common.

    Raises:
      SettingsError: an axis that is empty or has a value twice, a speed or seed that is not accepted, or more obstacles
        than a track has room for; cars that do not fit on a course before the start.
      TrackError, ControllerError: what cannot be loaded.
    """
    for seed in seeds:
        require_whole("seed", seed, 0)
    for speed in max_speeds:
        settings.drive(max_speed=speed)  # refuses what it cannot be
    names = {course: course_name(course) for course in courses}
    axes: tuple[tuple[str, Sequence[Any]], ...] = (
        ("controller", [choice.label for choice in controllers]), ("course", [names[course] for course in courses]),
        ("max_speed", max_speeds), ("seed", seeds),
    )  # fmt: skip
    require_axes(axes)
    car = settings.car.parameters
    for course in courses:
        check_course(course, settings.obstacles, car=car)
        if settings.opponents.entries:
            checked = settings.opponents.checked(course_ground(course, seeds[0], car=car).course)
            settings = replace(settings, opponents=checked)
    first = course_ground(courses[0], seeds[0], car=car).course
    files = {
        choice: files_sha256(choice.check(first, settings.drive(max_speed=max_speeds[0]))) for choice in controllers
    }
    axis: dict[str, Sequence[int | None]] = {course: _seeds(course, seeds, settings) for course in courses}
    runs = [
        Run(
            RunKey(
                choice.label, choice.sha256, names[course], ground_sha256(course, seed, car=car), float(speed), seed,
                files[choice],
            ),
            choice, course, settings,
        )
        for choice in controllers
        for course in courses
        for speed in max_speeds
        for seed in axis[course]
    ]  # fmt: skip
    for run in runs if settings.opponents.entries else ():
        if run.controller is controllers[0] and run.key.max_speed_m_s == float(max_speeds[0]):
            run.line_up()  # refuses cars that do not fit before the start
    return runs


def _seeds(course: str, seeds: Sequence[int], settings: ComparisonSettings) -> Sequence[int | None]:
    """Return the seeds that a course is driven with."""
    random = course.startswith(PREFIX) or settings.obstacles > 0 or settings.lidar_noise > 0.0
    random = random or settings.opponents.noisy
    return seeds if random else (None,)


def _write_report(comparison: Comparison, runs: Sequence[Run], folder: ComparisonFolder, *, pictures: bool) -> None:
    """Write the tables and pictures, in place of those of an earlier call."""
    out = folder.folder
    with blame(out, WRITABLE):
        for picture in (out / "table.png", *(out / "traces").glob("*.png")):
            picture.unlink(missing_ok=True)
        write_file(out / "runs.csv", runs_csv(comparison.rows).encode())
        write_file(out / "table.csv", cells_csv(comparison.cells).encode())
        write_file(out / "differences.csv", differences_csv(comparison.differences).encode())
        write_file(out / "table.md", comparison.markdown().encode())
        if pictures:
            table_picture(comparison.cells, out / "table.png")
            (out / "traces").mkdir(exist_ok=True)
            trace_pictures(runs, folder, out / "traces")
