"""Drives every controller on every course with every seed, and writes tables and pictures of how they fared.

    comparison = compare(["gap_finder", "follow_the_gap[point=middle]"], track="oval", out="runs/compare")
    print(comparison.markdown())

A later call with the same folder drives only the runs that are missing. A script that calls it with several workers
needs `if __name__ == "__main__":`, as every script that starts processes does.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fg_mujoco.arguments import explain_class
from fg_mujoco.course.scenes import PREFIX, scene_names
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import require_whole, shown
from fg_mujoco.pictures.pages.figure_kit import require_matplotlib
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.opponents import Opponents
from fg_mujoco.racing.planners import ControllerChoice, controller_names
from fg_mujoco.racing.setup import OF_A_CAR, OF_A_CONTEXT, Setup, StudyKeywords
from fg_mujoco.racing.trust import check_planner, files_sha256
from fg_mujoco.simulation.settings import FASTEST

from ..grid_study import Study, StudyProgress, as_axis, drive_grid, require_axes
from .comparison_tables import DIFFERENCES, Cell, cells_table, make_cells
from .ground import check_course, course_ground, course_name, ground_sha256
from .pictures import table_picture, trace_pictures
from .run import ComparisonSettings, Run, RunKey, RunRow
from .run_store import ComparisonFolder

if TYPE_CHECKING:
    from typing_extensions import Unpack


DEFAULT_SEEDS = range(10)


@explain_class
class Comparison(Study[RunRow, Cell]):
    """How all runs went."""

    paired = DIFFERENCES
    make_cells = staticmethod(make_cells)

    def _summed_up(self) -> str:
        controllers, courses = ({getattr(cell, name) for cell in self.cells} for name in ("controller", "course"))
        ends = Counter(row.figures.end_reason for row in self.rows)
        found = ", ".join(f"{count} {reason}" for reason, count in sorted(ends.items()))
        return f"{len(controllers)} controllers on {len(courses)} courses: {found}"

    def _table(self, *, chosen: bool) -> Table:
        return cells_table(self.cells)


USABLE = (
    *OF_A_CAR, *OF_A_CONTEXT, "controller", "track", "obstacles", "moving", "patches", "start", "laps", "time_limit",
    "lidar", "grid", "rules", "decision_limit",
)  # fmt: skip
"""Fields of a Setup that all runs may have in common."""


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
    watch: Callable[[StudyProgress], None] | None = None,
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
    base.require_usable("a comparison", *USABLE)
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

    def draw(comparison: Comparison) -> None:
        out = comparison.folder
        for picture in (out / "table.png", *(out / "traces").glob("*.png")):
            picture.unlink(missing_ok=True)
        if pictures:
            table_picture(comparison.cells, out / "table.png")
            (out / "traces").mkdir(exist_ok=True)
            trace_pictures(runs, folder, out / "traces")

    return drive_grid(
        Comparison, runs, folder, runs[0].settings.manifest(), workers=workers, watch=watch, draw=draw
    )  # fmt: skip


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
        choice: files_sha256(check_planner(choice, first, settings.drive(max_speed=max_speeds[0])))
        for choice in controllers
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
    random = random or (isinstance(settings.base.moving, str) and settings.base.moving != "")
    random = random or effects.range_noise_std > 0.0 or effects.dropout_probability > 0.0
    return seeds if random else (None,)
