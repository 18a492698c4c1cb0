"""Compares planners over courses and coefficients of friction, in one table: a comparison for each coefficient.

    evaluation = evaluate(["first", "gap_finder"], track=["oval", "random:900"], mu=[0.5, 0.8, 1.1], out="table")
    print(evaluation.markdown())

It is meant for trained policies, and takes any planner. Planners are told the coefficient unless `planner_mu` says
otherwise; a policy does not know it. The folder has the comparison of each coefficient (`mu_0.5`), `evaluation.csv` and
`evaluation.md`. The same call with more planners, courses or coefficients drives only the runs that are missing.
"""

from __future__ import annotations

import csv
import io
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from fg_mujoco.course.writing import write_file
from fg_mujoco.display import brief, quoted
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import shown
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.setup import Setup
from fg_mujoco.rollouts.rollout_result import wilson
from fg_mujoco.simulation.settings import FASTEST

from .comparison.comparison import USABLE, Comparison, compare
from .comparison.run import RunRow
from .grid_study import StudyProgress, as_axis
from .intervals import per_cent, varied

EVERY_MU = "all"
"""Of the rows over all coefficients."""

_LEGEND = (
    "A run has succeeded if the car drove all laps and touched nothing. The lap is the median of the mean laps of the "
    "runs that succeeded. The ratio is the median of lap times divided by those of {reference}, over the runs in which "
    "both succeeded, and how many these are. Sliding is the share of the time in which any tire slid."
)


@dataclass(frozen=True, kw_only=True)
class EvaluationRow:
    """How a planner fared with a coefficient of friction, over all courses. None: no run has such a figure."""

    controller: str
    mu: float | None  # None: over all coefficients
    runs: int
    successes: int  # all laps, and touched nothing
    success_low: float | None  # ends of Wilson's interval of their share, at 95 %; None: all runs are alike
    success_high: float | None
    laps_completed: int
    laps_requested: int
    lap_s: float | None  # median of the mean laps of the successes
    lap_ratio: float | None  # median of the mean laps divided by the reference's, where both succeeded
    pairs: int  # of runs in which both succeeded
    faster: int  # of these, in which it is faster
    slide_time_fraction: float | None  # mean
    max_slide_m_s: float | None  # greatest


@dataclass(frozen=True, kw_only=True, repr=False)
class Evaluation:
    """How planners fared; the reference is the last of them."""

    folder: Path
    reference: str
    rows: tuple[EvaluationRow, ...]
    comparisons: Mapping[float, Comparison]  # by coefficient

    def __repr__(self) -> str:
        names = ", ".join(dict.fromkeys(row.controller for row in self.rows))
        return brief(self, quoted(self.folder), names, f"mu {', '.join(f'{mu:g}' for mu in self.comparisons)}")

    def markdown(self) -> str:
        """Return the table for people."""
        header = ("controller", "mu", "success", "95 % interval", "laps", "lap [s]", "ratio", "of runs", "faster",
                  "sliding", "greatest slide [m/s]")  # fmt: skip
        rows = [
            (
                row.controller, EVERY_MU if row.mu is None else f"{row.mu:g}", f"{row.successes}/{row.runs}",
                per_cent(row.success_low, row.success_high), f"{row.laps_completed}/{row.laps_requested}",
                _text(row.lap_s, ".2f"), _text(row.lap_ratio, ".3f"), row.pairs, row.faster,
                None if row.slide_time_fraction is None else f"{100.0 * row.slide_time_fraction:.2f} %",
                _text(row.max_slide_m_s, ".2f"),
            )
            for row in self.rows
        ]  # fmt: skip
        return Table(
            header=header, rows=rows, left=("controller", "mu"), legend=_LEGEND.format(reference=self.reference)
        ).markdown()

    def csv(self) -> str:
        """Return the table as CSV, with all figures."""
        file = io.StringIO()
        writer = csv.DictWriter(file, [f.name for f in fields(EvaluationRow)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) | ({"mu": EVERY_MU} if row.mu is None else {}) for row in self.rows)
        return file.getvalue()


def evaluate(
    controller: str | Sequence[str],
    *,
    track: str | Sequence[str] = "oval",
    mu: float | Sequence[float] = (0.5, 0.8, 1.1),
    max_speed: float = FASTEST,
    seed: int | Sequence[int] = 0,
    out: str | Path,
    workers: int | None = None,
    setup: Setup | None = None,
    watch: Callable[[StudyProgress], None] | None = None,
    **keywords: Any,
) -> Evaluation:
    """Drive every planner on every course with every coefficient of friction, and write one table.

    Args:
      controller: the planners; lap times are compared with those of the last.
      track: courses, as `load_track` takes them.
      mu: coefficients of friction of the tires.
      max_speed: fastest that a planner may command [m/s].
      seed: as in `compare`.
      out: a new or empty folder, or one of an evaluation with the same setup.
      workers: processes; None: as many as there are cores.
      setup: that all runs have in common.
      watch: called several times a second, with the progress of one coefficient's runs.
      keywords: of a Setup, besides `mu`.

    Raises:
      SettingsError, TrackError, ControllerError, RunFolderError: what cannot be driven; nothing has run then.
      EngineError: a worker process could not be started.
    """
    controllers, coefficients, folder = [str(each) for each in as_axis(controller)], as_axis(mu), Path(out)
    if len(set(coefficients)) != len(coefficients) or not coefficients:
        raise SettingsError(f"mu is {shown(mu)}; accepted: coefficients, each once")
    base = Setup.of(setup, caller="evaluate", **keywords)
    base.require_usable("an evaluation", *(name for name in USABLE if name not in ("controller", "track", "mu")))
    comparisons = {
        float(each): compare(
            controllers, track=track, max_speed=max_speed, seed=seed, out=folder / f"mu_{each:g}", workers=workers,
            pictures=False, setup=base.replace(mu=float(each)), watch=watch,
        )
        for each in coefficients
    }  # fmt: skip
    found = [(each, row) for each, comparison in comparisons.items() for row in comparison.rows]
    labels = list(dict.fromkeys(row.key.controller for _, row in found))
    reference = labels[-1]
    best = {_place(each, row): row.figures.mean_lap_s for each, row in found
            if row.key.controller == reference and row.figures.success}  # fmt: skip
    groups: list[float | None] = [*comparisons, *([None] if len(comparisons) > 1 else [])]
    rows = tuple(
        _row(label, each, [(m, row) for m, row in found if row.key.controller == label and each in (None, m)], best)
        for label in labels
        for each in groups
    )
    evaluation = Evaluation(folder=folder, reference=reference, rows=rows, comparisons=comparisons)
    write_file(folder / "evaluation.csv", evaluation.csv().encode())
    write_file(folder / "evaluation.md", (evaluation.markdown() + "\n").encode())
    return evaluation


def _place(mu: float, row: RunRow) -> tuple[Any, ...]:
    key = row.key
    return mu, key.course, key.course_sha256, key.max_speed_m_s, key.seed


def _row(
    label: str, mu: float | None, rows: Sequence[tuple[float, RunRow]], best: Mapping[tuple[Any, ...], float | None]
) -> EvaluationRow:
    """Return the row of a planner's runs; `best` has the laps of the reference."""
    runs = [row.figures for _, row in rows]
    laps = {_place(each, row): row.figures.mean_lap_s for each, row in rows if row.figures.success}
    ratios = [lap / other for place, lap in laps.items() if lap and (other := best.get(place))]
    successes = sum(run.success for run in runs)
    low, high = wilson(successes, len(runs)) if varied(run.trajectory_sha256 for run in runs) else (None, None)
    slides = [run.slide_time_fraction for run in runs if run.slide_time_fraction is not None]
    return EvaluationRow(
        controller=label, mu=mu, runs=len(runs), successes=successes, success_low=low, success_high=high,
        laps_completed=sum(run.laps_completed for run in runs), laps_requested=sum(run.laps_requested for run in runs),
        lap_s=statistics.median(known) if (known := [lap for lap in laps.values() if lap]) else None,
        lap_ratio=statistics.median(ratios) if ratios else None, pairs=len(ratios),
        faster=sum(ratio < 1.0 for ratio in ratios),
        slide_time_fraction=statistics.fmean(slides) if slides else None,
        max_slide_m_s=max((run.max_slide_m_s for run in runs if run.max_slide_m_s is not None), default=None),
    )  # fmt: skip


def _text(value: float | None, form: str) -> str | None:
    return None if value is None else format(value, form)
