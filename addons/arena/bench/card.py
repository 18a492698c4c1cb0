"""The card of a planner: what it does in each group of a suite, with each assist, as numbers that others can reproduce.

A run's completion is 1 if the car finished without a touch, else the share of its way that it drove. The score of a
group is the mean completion of its runs, and that of a card the mean of its groups, in percent. The same planner,
suite and versions give the same numbers, but for the times of decisions.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fg_mujoco.course.documents import read_json
from fg_mujoco.errors import SettingsError
from fg_mujoco.racing.planners import ControllerChoice, only_planner
from fg_mujoco.simulation.settings import FASTEST

from ..study.functions import drive_suite
from ..study.store import StudyProgress
from ..study.suite import Suite

REACTIVE = Path(__file__).parent / "reactive.toml"
"""The bundled suite."""

RECORDED = Path(__file__).parent / "cards.json"
"""Cards of the bundled planners and baselines by the bundled suite: made by `make cards`."""


@dataclass(frozen=True, kw_only=True)
class Card:
    """The runs of a planner by assist, and their scores."""

    planner: str
    planner_sha256: str | None  # of a user's file
    suite: str  # its name and version
    suite_sha256: str
    version: str  # of fg_mujoco
    rows: Mapping[str, list[dict[str, Any]]]  # by assist: the lines of its runs, see `RunRow.lines`

    def groups(self, assist: str) -> list[str]:
        """Return the names of the groups, in their order."""
        return list(dict.fromkeys(row["group"] for row in self.rows[assist]))

    def of(self, assist: str, group: str) -> list[dict[str, Any]]:
        """Return the rows of a group."""
        return [row for row in self.rows[assist] if row["group"] == group]

    def score(self, assist: str, group: str | None = None) -> float:
        """Return the mean completion of a group, or of all groups, in percent."""
        groups = self.groups(assist) if group is None else [group]
        return 100.0 * statistics.fmean(
            statistics.fmean(row["completion"] for row in self.of(assist, each)) for each in groups
        )

    def figures(self, assist: str, group: str) -> dict[str, Any]:
        """Return the figures of a group: score, finished runs, lap times, touches, sliding, clearance, decisions."""
        rows = self.of(assist, group)
        slides, clear, bounds = (
            [row[name] for row in rows if row[name] is not None]
            for name in ("slide_time_fraction", "least_clearance_m", "bound_s")
        )
        laps = [row["best_lap_s"] for row in rows if row["success"] and row["best_lap_s"] is not None]
        return {
            "score": round(self.score(assist, group), 1),
            "finished": f"{sum(row['success'] for row in rows)} of {len(rows)}",
            "lap_s": round(statistics.fmean(laps), 2) if len(laps) == len(rows) else None,  # else of easier ones
            "bound_s": round(statistics.fmean(bounds), 2) if len(bounds) == len(rows) else None,
            "touches": sum(row["collisions"] for row in rows),
            "sliding_percent": round(100.0 * statistics.fmean(slides), 2) if slides else None,
            "least_clearance_m": round(min(clear), 3) if clear else None,
        }

    def decision_ms(self, assist: str) -> float | None:
        """Return the slowest of the runs' decision times at 99 % [ms], which is of the machine."""
        return max((row["decision_ms"] for row in self.rows[assist] if row["decision_ms"] is not None), default=None)

    @property
    def failed(self) -> bool:
        """Whether a run could not be driven."""
        return any(row["trajectory_sha256"] is None for rows in self.rows.values() for row in rows)

    def described(self) -> dict[str, Any]:
        """Return the card as JSON has it."""
        scores = {
            assist: {
                "score": round(self.score(assist), 1),
                "groups": {group: self.figures(assist, group) for group in self.groups(assist)},
            }
            for assist in self.rows
        }
        own = {name: value for name, value in vars(self).items() if name != "rows"}
        return own | {"scores": scores, "rows": dict(self.rows)}


def bench(
    planner: str,
    suite: Suite,
    *,
    workers: int | None = None,
    watch: Callable[[StudyProgress], None] = lambda progress: None,
) -> Card:
    """Drive a planner through a suite and return its card.

    A planner that decides by itself has no stages: it is driven once, with the assist `none`.

    Args:
      planner: as `race` takes it; of a file with one planner the file is enough.
      suite: what is driven, with its assists.
      workers: processes; None: as many as there are cores.
      watch: called several times a second.

    Raises:
      SettingsError: a suite without assists, or of other runs than of planners alone.
      ControllerError: there is no such planner, or it cannot be built.
      EngineError: a worker could not start.
    """
    source = only_planner(planner)
    choice = ControllerChoice.of(source)
    if any(name == "assist" for name, _ in choice.settings):
        raise SettingsError(f"planner {planner!r} has an assist; accepted: without one, as the suite says it")
    if suite.kind != "alone" or not suite.assists:
        said = f"suite {suite.name} is of {suite.kind}, with {len(suite.assists)} assists"
        raise SettingsError(f"{said}; accepted: one of planners alone, with assists")
    staged = hasattr(choice.load(), "source_laws")
    with TemporaryDirectory(prefix="fg_mujoco-card-") as folder:
        found = drive_suite(
            suite if staged else replace(suite, assists=("none",)), [source], out=folder, workers=workers, watch=watch,
            timed=True,
        )  # fmt: skip
    rows: dict[str, list[dict[str, Any]]] = {}
    for row in found.rows:
        (line,) = row.lines()
        bound = recorded()["bounds"].get(bound_key(row.setup))
        rows.setdefault(line["assist"], []).append(line | {"bound_s": bound})
    return Card(
        planner=choice.label, planner_sha256=choice.sha256, suite=f"{suite.name} {suite.version}",
        suite_sha256=suite.sha256, version=version("fg-mujoco"), rows=rows,
    )  # fmt: skip


def bound_key(settings: Mapping[str, Any]) -> str:
    """Return the name of the bound of a run's lap time: its track, friction and greatest speed."""
    return f"{settings['track']}, mu {settings.get('mu', 'as published')}, {settings.get('max_speed', FASTEST):g} m/s"


@cache
def recorded() -> Mapping[str, Any]:
    """Return what is recorded by the bundled suite, by `make cards`.

    `cards` has the scores of the bundled planners by assist, `score` and each group's; `bounds` the lap times of the
    racelines [s], by `bound_key`.
    """
    if not RECORDED.exists():
        return {"cards": {}, "bounds": {}}
    return dict(read_json(RECORDED.read_bytes(), "recorded cards"))
