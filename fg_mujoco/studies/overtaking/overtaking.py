"""Drives planners behind slower opponents, and writes how often they overtake, and at what price.

    study = overtake("overtaker", track="oval", seed=range(10), out="runs/overtake")
    print(study.markdown())

A later call with the same folder drives only the duels that are missing. A script that calls it with several workers
needs `if __name__ == "__main__":`, as every script that starts processes does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...course.writing import write_file
from ...display import Shown, brief, escaped, paragraph, quoted
from ...errors import SettingsError, TrackError
from ...messages import require_whole
from ...racing.planner_choice import ControllerChoice
from ...racing.planner_files import files_sha256
from ...racing.setup import Setup
from ...simulation.course_loading import load_track
from ...simulation.settings import renamed
from ...viz.pages.figures import require_matplotlib
from ..rollout.job import versions
from ..run_grid import as_axis, require_axes, time_left
from ..store import WRITABLE, StudyFolder, blame, claimed
from ..workers import work_through
from .duel import Duel, DuelKey, DuelRow, DuelSettings
from .slower_opponents import OPPONENTS
from .tables import (
    DIFFERENCES,
    DuelCell,
    cells_csv,
    cells_table,
    chosen_cells,
    duels_csv,
    make_cells,
    paired_differences,
    ratio_picture,
)

DEFAULT_TRACKS = ("oval", "l_corridor", "hairpins", "chicanes", "fast", "tight")
DEFAULT_SEEDS = range(50)
DEFAULT_RATIO = (0.3, 0.9)

_UNUSABLE = (
    "track", "time_limit", "obstacles", "patches", "lidar", "rules", "decision_limit", "planner_settings", "start",
    "effects", "odometry_drift", "sensors", "seed", "name",
)  # fmt: skip
"""Keywords of a Setup that a duel cannot use."""


@dataclass(frozen=True, kw_only=True)
class OvertakingProgress:
    """Progress of a study, for `watch`."""

    duels: int
    duels_found: int  # in the folder, driven by an earlier call
    duels_driven: int  # by this call
    wall_time_s: float

    @property
    def remaining_s(self) -> float | None:
        """Expected time to the end [s]; None before the first duel is finished."""
        return time_left(self.duels, self.duels_found, self.duels_driven, self.wall_time_s)


@dataclass(frozen=True, kw_only=True, repr=False)
class Overtaking(Shown):
    """The results of all duels."""

    rows: tuple[DuelRow, ...]
    cells: tuple[DuelCell, ...]
    folder: Path
    duels_driven: int  # by this call
    wall_time_s: float

    def __repr__(self) -> str:
        overtaken = sum(row.figures.outcome == "overtaken" for row in self.rows)
        return brief(self, f"{len(self.rows)} duels, {overtaken} overtakes", f"in {quoted(self.folder)}")

    def _repr_html_(self) -> str:
        tables = (cells_table(self.cells), DIFFERENCES.table(self.differences))
        below = paragraph(f"{len(self.rows)} duels in {self.folder}")
        return escaped([*(each.notebook() for each in tables if each), below])

    @property
    def differences(self) -> tuple[dict[str, Any], ...]:
        """Differences of each two planners in the duels that both drove, by the names in differences.csv."""
        return paired_differences(self.rows)

    def markdown(self) -> str:
        """Return the table, and that of the differences from the first planner, each with its legend."""
        tables = (cells_table(chosen_cells(self.cells)), DIFFERENCES.table(self.differences))
        return "\n".join(each.markdown() for each in tables if each)

    def summary(self) -> dict[str, Any]:
        """Return the figures, as JSON has them."""
        return {
            "duels": len(self.rows),
            "duels_driven": self.duels_driven,
            "wall_time_s": self.wall_time_s,
            "table": [asdict(cell) for cell in self.cells],
            "differences": list(self.differences),
        }


@renamed(planners="controller", tracks="track", seeds="seed")
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
    watch: Callable[[OvertakingProgress], None] | None = None,
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
        2, `max_speed` of both cars, and which car both are: `vehicle`, `tires`, `mu`, `planner_mu`, `changes`.

    Raises:
      SettingsError, TrackError, ControllerError, RunFolderError: what cannot be driven; nothing has run then.
      MissingExtraError: no matplotlib for the picture.
      EngineError: a worker process could not be started.
    """
    require_whole("workers", workers, 1, optional=True)
    if pictures:
        require_matplotlib()
    base = Setup.of(setup, caller="overtake", **keywords)
    base.require_usable("overtake", *_UNUSABLE, alone=True)
    first, (slowest, fastest) = base.first, speed_ratio
    settings = DuelSettings(
        vehicle=first.vehicle, tires=first.tires, mu=first.mu, changes=first.changes, planner_mu=first.planner_mu,
        max_speed=first.max_speed, laps=2 if base.laps is None else base.laps, slowest=slowest, fastest=fastest,
    )  # fmt: skip
    planners, tracks, opponents, seeds = map(as_axis, (controller, track, opponents, seed))
    duels = plan_duels([ControllerChoice.of(text) for text in planners], tracks, opponents, seeds, settings)
    folder = StudyFolder(out, title="overtaking study", command="overtake")
    with claimed(folder):
        folder.open(settings.manifest(), versions())
        driven = folder.rows("duels.jsonl", DuelRow.read)
        missing = [duel for duel in duels if duel.key not in driven]

        def keep(_: Duel, row: DuelRow) -> None:
            driven.add(row.key, row, row.as_dict())

        def tell(count: int, elapsed: float) -> None:
            if watch is not None:
                found = len(duels) - len(missing)
                watch(OvertakingProgress(duels=len(duels), duels_found=found, duels_driven=count, wall_time_s=elapsed))

        taken = work_through(Duel.drive, missing, keep, workers=workers, watch=tell, died=Duel.died)
        rows = tuple(driven[duel.key] for duel in duels)
        driven.sort([duel.key for duel in duels])
        study = Overtaking(
            rows=rows, cells=make_cells(rows), folder=folder.folder, duels_driven=len(missing), wall_time_s=taken
        )  # fmt: skip
        with blame(folder.folder, WRITABLE):
            write_file(folder.folder / "duels.csv", duels_csv(rows).encode())
            write_file(folder.folder / "table.csv", cells_csv(study.cells).encode())
            write_file(folder.folder / "differences.csv", DIFFERENCES.csv(study.differences).encode())
            write_file(folder.folder / "table.md", study.markdown().encode())
            if pictures:
                ratio_picture(rows, settings.slowest, settings.fastest, folder.folder / "table.png")
        return study


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
    courses = {track: load_track(track, car=settings.car.parameters) for track in tracks}
    for track, course in courses.items():
        if not course.closed:
            raise TrackError(f"track {track!r} is no circuit; accepted: a closed track")
    files = {choice: files_sha256(choice.check(courses[tracks[0]], settings.drive())) for choice in planners}
    return [
        Duel(DuelKey(choice.label, choice.sha256, track, opponent, seed, files[choice]), choice, settings)
        for choice in planners
        for track in tracks
        for opponent in opponents
        for seed in seeds
    ]
