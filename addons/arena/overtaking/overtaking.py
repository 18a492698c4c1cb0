"""Drives planners behind slower opponents, and writes how often they overtake, and at what price.

    study = overtake("overtaker", track="oval", seed=range(10), out="runs/overtake")
    print(study.markdown())

A later call with the same folder drives only the duels that are missing. A script that calls it with several workers
needs `if __name__ == "__main__":`, as every script that starts processes does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from fg_mujoco.errors import SettingsError, TrackError
from fg_mujoco.messages import require_whole
from fg_mujoco.pictures.pages.figure_kit import require_matplotlib
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.racing.setup import OF_A_CAR, OF_A_CONTEXT, Setup
from fg_mujoco.racing.trust import check_planner, files_sha256
from fg_mujoco.simulation.course_loading import load_track

from ..grid_study import GridFolder, Study, StudyProgress, as_axis, drive_grid, require_axes
from .duel import Duel, DuelKey, DuelRow, DuelSettings
from .overtaking_tables import DIFFERENCES, DuelCell, cells_table, chosen_cells, make_cells, ratio_picture
from .slower_opponents import OPPONENTS

DEFAULT_TRACKS = ("oval", "l_corridor", "hairpins", "chicanes", "fast", "tight")
DEFAULT_SEEDS = range(50)
DEFAULT_RATIO = (0.3, 0.9)

USABLE = (*OF_A_CAR, *OF_A_CONTEXT)
"""Fields of a Setup that a duel uses, and `laps` besides."""


class Overtaking(Study[DuelRow, DuelCell]):
    """The results of all duels."""

    noun = "duels"
    paired = DIFFERENCES
    make_cells = staticmethod(make_cells)

    def _summed_up(self) -> str:
        return f"{sum(row.figures.outcome == 'overtaken' for row in self.rows)} overtakes"

    def _table(self, *, chosen: bool) -> Table:
        return cells_table(chosen_cells(self.cells) if chosen else self.cells)


def overtake(
    controller: str | Sequence[str] = "overtaker",
    *,
    track: str | Sequence[str] = DEFAULT_TRACKS,
    opponents: str | Sequence[str] = OPPONENTS,
    seed: int | Sequence[int] = DEFAULT_SEEDS,
    speed_ratio: tuple[float, float] = DEFAULT_RATIO,
    out: str | Path,
    workers: int | None = None,
    pictures: bool = True,
    setup: Setup | None = None,
    watch: Callable[[StudyProgress], None] | None = None,
    **keywords: Any,
) -> Overtaking:
    """Drive each planner behind each opponent on each track with each seed, and write what became of them to a folder.

    A duel in which the planner fails, or ends its worker process, is a row that says so; the others go on. Ctrl-C
    raises KeyboardInterrupt once the workers have stopped; the same call goes on with the duels that are missing.

    Args:
      controller: one or more: bundled names or `path/to/file.py:ClassName`, with settings in brackets where wanted.
      track: one or more: closed ones, as `load_track` takes them.
      opponents: one or more of OPPONENTS.
      seed: one or more: each draws where a duel starts, the distance and the ratio; the same for all planners.
      speed_ratio: least and greatest ratio of the opponent's speed to the planner's own at the same place, alone.
      out: a new or empty folder, or one of a study with the same settings.
      workers: processes; None: as many as there are cores; one: no other than this.
      pictures: whether to draw one.
      setup: that all duels have in common.
      watch: called several times a second.
      keywords: of a Setup, see there, that change `setup`: `laps` within which the planner is to overtake, by default
        2, `max_speed` and `planner_mu` of both cars, which car both are: `vehicle`, `tires`, `mu`, `changes`, and what
        the planner senses and `knows`.

    Raises:
      SettingsError, TrackError, ControllerError, RunFolderError: what cannot be driven; nothing has run then.
      MissingExtraError: no matplotlib for the picture.
      EngineError: a worker process could not be started.
    """
    require_whole("workers", workers, 1, optional=True)
    if pictures:
        require_matplotlib()
    base = Setup.of(setup, caller="overtake", **keywords)
    base.require_usable("overtake", *USABLE, "laps", alone=True)
    settings = DuelSettings(base=base, slowest=speed_ratio[0], fastest=speed_ratio[1])
    planners, tracks, opponents, seeds = map(as_axis, (controller, track, opponents, seed))
    duels = plan_duels([ControllerChoice.of(text) for text in planners], tracks, opponents, seeds, settings)
    folder = GridFolder(out, DuelRow.of, title="overtaking study", command="overtake", file="duels.jsonl")

    def draw(study: Overtaking) -> None:
        if pictures:
            ratio_picture(study.rows, settings.slowest, settings.fastest, study.folder / "table.png")

    return drive_grid(Overtaking, duels, folder, settings.manifest(), workers=workers, watch=watch, draw=draw)


def plan_duels(
    planners: Sequence[ControllerChoice],
    tracks: Sequence[str],
    opponents: Sequence[str],
    seeds: Sequence[int],
    settings: DuelSettings,
) -> list[Duel]:
    """Return the duels of a grid, in its order.

    Raises:
      SettingsError: an axis that is empty or has a value twice, another opponent, or a seed that is not accepted.
      TrackError, ControllerError: what cannot be loaded.
    """
    for seed in seeds:
        require_whole("seed", seed, 0)
    for opponent in opponents:
        if opponent not in OPPONENTS:
            raise SettingsError(f"opponent {opponent!r}; accepted: {', '.join(OPPONENTS)}")
    axes: tuple[tuple[str, Sequence[Any]], ...] = (
        ("planner", [choice.label for choice in planners]), ("track", tracks), ("opponent", opponents), ("seed", seeds),
    )  # fmt: skip
    require_axes(axes)
    courses = {track: load_track(track, car=settings.car) for track in tracks}
    for track, course in courses.items():
        if not course.closed:
            raise TrackError(f"track {track!r} is no circuit; accepted: a closed track")
    course, drive = courses[tracks[0]], settings.base.drive_settings
    files = {choice: files_sha256(check_planner(choice, course, drive)) for choice in planners}
    return [
        Duel(DuelKey(choice.label, choice.sha256, track, opponent, seed, files[choice]), choice, settings)
        for choice in planners
        for track in tracks
        for opponent in opponents
        for seed in seeds
    ]
