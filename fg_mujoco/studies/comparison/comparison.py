"""Drives every controller on every course with every seed, and writes tables and pictures of how they fared.

    comparison = compare(["gap_finder", "follow_the_gap[point=middle]"], track="oval", out="runs/compare")
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
from typing import TYPE_CHECKING, Any

from ...arguments import explain_class
from ...course.scenes.catalogue import PREFIX, scene_names
from ...course.writing import write_file
from ...display import Shown, brief, escaped, paragraph, quoted
from ...errors import SettingsError
from ...messages import FloatArray, require_whole, shown
from ...racing.opponents import Opponents
from ...racing.planner_choice import ControllerChoice
from ...racing.planner_files import files_sha256
from ...racing.planner_sources import controller_names
from ...racing.setup import Setup, StudyKeywords
from ...simulation.settings import FASTEST, renamed
from ...viz.pages.figures import require_matplotlib
from ...viz.pages.table import Table
from ..rollout.job import versions
from ..run_grid import as_axis, require_axes, time_left
from ..store import WRITABLE, blame, claimed
from ..workers import work_through
from .ground import check_course, course_ground, course_name, ground_sha256
from .pictures import table_picture, trace_pictures
from .run import ComparisonSettings, Run, RunKey, RunRow
from .run_store import ComparisonFolder
from .tables import DIFFERENCES, Cell, cells_csv, cells_table, make_cells, paired_differences, runs_csv

if TYPE_CHECKING:
    from typing_extensions import Unpack


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
        below = paragraph(f"{len(self.rows)} runs in {self.folder}")
        return escaped([*(each.notebook() for each in self._tables()), below])

    def _tables(self) -> list[Table]:
        return [each for each in (cells_table(self.cells), DIFFERENCES.table(self.differences)) if each]

    @property
    def differences(self) -> tuple[dict[str, Any], ...]:
        """How each two controllers differ in the runs that both drove, by the names in differences.csv."""
        return paired_differences(self.rows)

    def markdown(self) -> str:
        """Return the table, and that of the differences from the first controller, each with its legend."""
        return "\n".join(each.markdown() for each in self._tables())

    def summary(self) -> dict[str, Any]:
        """Return the figures, as JSON has them."""
        return {
            "runs": len(self.rows),
            "runs_driven": self.runs_driven,
            "wall_time_s": self.wall_time_s,
            "table": [cell.as_dict() for cell in self.cells],
            "differences": list(self.differences),
        }


@renamed(controllers="controller", tracks="track", seeds="seed", max_speeds="max_speed")
def compare(
    controller: str | Sequence[str] | None = None,
    *,
    track: str | Sequence[str] | None = None,
    max_speed: float | Sequence[float] | None = None,
    seed: int | Sequence[int] = DEFAULT_SEEDS,
    out: str | Path,
    workers: int | None = None,
    pictures: bool = True,
    setup: Setup | None = None,
    watch: Callable[[ComparisonProgress], None] | None = None,
    **keywords: Unpack[StudyKeywords],
) -> Comparison:
    """Drive every controller on every course at every speed with every seed, and write what became of them to a folder.

    A run in which the planner fails, or ends its worker process, is a row that says so; the others go on. Ctrl-C
    raises KeyboardInterrupt once the workers have stopped; finished runs are then in the folder, and the same call goes
    on with the others.

    Args:
      controller: one or more: bundled names or `path/to/file.py:ClassName`, each with settings that differ from its own
        in brackets where wanted, as `gap_finder[lookahead=8]`; None: that of `setup`, or all bundled ones.
      track: one or more, as `load_track` takes them; of scenes `scene:NAME`; None: that of `setup`, or all scenes.
      max_speed: one or more: fastest that the planner may command [m/s]; None: that of `setup`, or 8 m/s.
      seed: one or more: of a scene; on a track, of the obstacles and the LiDAR's noise. Where nothing depends on it, a
        course is driven once.
      out: a new or empty folder, or one of a comparison with the same setup.
      workers: processes; None: as many as there are cores; one: no other than this, which a planner can end.
      pictures: whether to draw them.
      setup: that all runs have in common.
      watch: called several times a second.
      keywords: of a Setup, see there, that change `setup`. `obstacles` is how many boxes, at places drawn from the
        seed. `opponents` race against the car of each run, and rows are that car's, with how it fared among them. Cars
        that touch are no failure: `contacts` counts them.

    Raises:
      SettingsError, TrackError, ControllerError, RunFolderError: what cannot be driven; nothing has run then.
      MissingExtraError: no matplotlib for the pictures.
      EngineError: a worker process could not be started.
    """
    require_whole("workers", workers, 1, optional=True)
    if pictures:
        require_matplotlib()
    base = Setup.of(setup, caller="compare", **keywords)
    base.require_usable("a comparison", "obstacle_seed", "name")
    alone = replace(base, entries=base.entries[:1], grid="staggered", rules="none")
    settings = ComparisonSettings(base=alone, opponents=Opponents.of(base), rules=base.rules)
    if setup is None:
        usual: tuple[Any, ...] = (controller_names(), [f"{PREFIX}{name}" for name in scene_names()], FASTEST)
    else:
        usual = (base.first.controller, base.track, base.first.max_speed)
    controllers, courses, speeds = (
        as_axis(given if given is not None else own)
        for given, own in zip((controller, track, max_speed), usual, strict=True)
    )
    chosen = [ControllerChoice.of(_by_name("controller", each)) for each in controllers]
    runs = plan_runs(chosen, [_by_name("track", each) for each in courses], speeds, as_axis(seed), settings)
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


def _by_name(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise SettingsError(f"{name} is {shown(value)}, an object, in a comparison; accepted: a name, or a file")
    return value


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
    car, placed = settings.car.parameters, settings.base.obstacles
    for course in courses:
        check_course(course, placed if isinstance(placed, int) else 0, car=car)
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
            run.setup()  # refuses cars that do not fit before the start
    return runs


def _seeds(course: str, seeds: Sequence[int], settings: ComparisonSettings) -> Sequence[int | None]:
    """Return the seeds that a course is driven with."""
    placed, effects = settings.base.obstacles, settings.base.first.effects
    random = course.startswith(PREFIX) or (isinstance(placed, int) and placed > 0) or settings.opponents.noisy
    random = random or effects.range_noise_std > 0.0 or effects.dropout_probability > 0.0
    return seeds if random else (None,)


def _write_report(comparison: Comparison, runs: Sequence[Run], folder: ComparisonFolder, *, pictures: bool) -> None:
    """Write the tables and pictures, in place of those of an earlier call."""
    out = folder.folder
    with blame(out, WRITABLE):
        for picture in (out / "table.png", *(out / "traces").glob("*.png")):
            picture.unlink(missing_ok=True)
        write_file(out / "runs.csv", runs_csv(comparison.rows).encode())
        write_file(out / "table.csv", cells_csv(comparison.cells).encode())
        write_file(out / "differences.csv", DIFFERENCES.csv(comparison.differences).encode())
        write_file(out / "table.md", comparison.markdown().encode())
        if pictures:
            table_picture(comparison.cells, out / "table.png")
            (out / "traces").mkdir(exist_ok=True)
            trace_pictures(runs, folder, out / "traces")
