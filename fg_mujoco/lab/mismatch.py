"""A planner that assumes a wrong friction: its mu over the tires' mu, from one half to twice.

Each ratio is driven for two laps at the lab's timestep, because many of these runs slide. The knee is the ratio at
which a tire first slides, found by bisection. It lies above 1, because the friction limiter keeps back shares of the
grip (controllers/safety/friction_limiter.py).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..messages import FloatArray
from ..pictures.pages.figure_kit import COLOURS, column, finish, limit, log_from_zero, measured, span
from ..simulation.world import World
from ..vehicle.car import WHEELS
from ..vehicle.tire_slip import slides_above
from ..vehicle.tires import IDEAL_TIRES
from ..vehicle.vehicle import Vehicle
from .experiment import Cell, Figure, LabSettings, Row, Section, Tables
from .lab_laps import LabLaps, drive_laps

if TYPE_CHECKING:
    import matplotlib.figure

_TRACKS = ("oval", "chicanes", "tight")
_RATIOS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.05, 1.1, 1.2, 1.3, 1.4, 1.5, 1.75, 2.0)
_WET_RATIOS = (0.5, 0.75, 1.0, 1.1, 1.2, 1.35, 1.5, 2.0)
_WET = 0.6  # [-] slippery tires
_QUICK_RATIOS = (0.7, 1.0, 1.3)
_LAPS = 2
_WIDTH = 0.02  # of the ratio, to which the knee is found
_KNEE_BETWEEN = (0.9, 1.5)
_SHOWN_UP_TO = 1.5  # the sentences compare lap times up to there


class MismatchExperiment:
    """Sliding and lap time over how wrong the planner is."""

    name = "mismatch"
    title = "A planner that is wrong about the friction"

    def cells(self, settings: LabSettings) -> list[Cell]:
        """Return a cell for each circuit, friction and ratio, and one for each knee."""
        if settings.quick:
            return [{"track": "oval", "mu": Vehicle.load().greatest_mu(), "ratio": ratio} for ratio in _QUICK_RATIOS]
        kinds = [(track, mu) for mu in (Vehicle.load().greatest_mu(), _WET) for track in _TRACKS]
        grid: list[Cell] = [
            {"track": track, "mu": mu, "ratio": ratio}
            for track, mu in kinds
            for ratio in (_WET_RATIOS if mu == _WET else _RATIOS)
        ]
        return [*grid, *({"track": track, "mu": mu, "ratio": None} for track, mu in kinds)]

    def measure(self, cell: Cell) -> Tables:
        """Drive, or find the knee."""
        track, mu = cell["track"], cell["mu"]
        if cell["ratio"] is None:
            return {"knee": [_knee(track, mu)]}
        laps = drive_believing(track, mu, cell["ratio"])
        uses = np.fmax.reduce([laps.column(f"friction_utilisation_{wheel}") for wheel in WHEELS])
        row: Row = {
            "track": track, "mu": mu, "ratio": cell["ratio"], "planner_mu": mu * cell["ratio"],
            "end_reason": laps.end_reason, "crashed": laps.crashed, "laps": len(laps.lap_times_s),
            "first_lap_s": laps.lap_times_s[0] if laps.lap_times_s else math.nan, "best_lap_s": laps.best_flying_lap_s,
            "max_slide_m_s": laps.max_slide_m_s, "sliding_share": laps.slide_time_fraction,
            "friction_utilisation_mean": float(np.nanmean(uses)),
            "reason": "" if len(laps.lap_times_s) > 1 else f"no flying lap: {laps.end_reason}",
        }  # fmt: skip
        return {"laps": [row]}

    def section(self, tables: Tables) -> Section:
        """Say where the knee is, and which margin would be safe."""
        laps, knees = tables["laps"], tables.get("knee", [])
        sentences, expected = _sentences(laps, knees)
        return Section(
            sentences=tuple(sentences),
            figures=(
                Figure(
                    name="knee",
                    caption="Best flying lap over that of a planner with the right friction, greatest sliding speed, "
                    "share of the time in which a tire slides, over the ratio of the planner's friction to the tires'. "
                    f"Dashed line: limit of sliding, {slides_above(IDEAL_TIRES)} m/s. A cross is a crash.",
                    draw=lambda figure: _draw(figure, laps),
                    height=4.6,
                ),
            ),
            columns={
                "laps": ("track", "mu", "ratio", "end_reason", "best_lap_s", "max_slide_m_s", "sliding_share"),
                "knee": ("track", "mu", "sliding_from", "holds_at", "slides_at", "reason"),
            },
            expected=tuple(expected),
        )


def drive_believing(track: str, mu: float, ratio: float) -> LabLaps:
    """Drive laps on tires of `mu` with a planner that assumes `ratio` times as much."""
    return drive_laps(World(track, mu=mu, tires=IDEAL_TIRES), laps=_LAPS, planner_mu=mu * ratio)


def _knee(track: str, mu: float) -> Row:
    """Find the ratio from which on a tire slides, by bisection."""
    low, high = _KNEE_BETWEEN
    row: Row = {"track": track, "mu": mu, "sliding_from": math.nan, "holds_at": low, "slides_at": high}
    slides = [drive_believing(track, mu, ratio).slide_time_fraction > 0.0 for ratio in _KNEE_BETWEEN]
    if slides[0]:
        return {**row, "holds_at": math.nan, "slides_at": low, "reason": f"slides at {low:g}"}
    if not slides[1]:
        return {**row, "holds_at": high, "slides_at": math.nan, "reason": f"slides at no ratio up to {high:g}"}
    while high - low > _WIDTH:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if drive_believing(track, mu, middle).slide_time_fraction > 0.0 else (middle, high)
    return {**row, "sliding_from": 0.5 * (low + high), "holds_at": low, "slides_at": high, "reason": ""}


def _sentences(laps: list[Row], knees: list[Row]) -> tuple[list[str], list[tuple[str, str, str]]]:
    sentences: list[str] = []
    expected: list[tuple[str, str, str]] = []
    begins, holds = column(knees, "sliding_from"), column(knees, "holds_at")
    if np.isfinite(begins).any():
        spread = span(begins, ".2f")
        first = knees[int(np.nanargmin(begins))]
        safe = (
            f"Up to {holds.min():.2f} nothing slid anywhere: on such tracks, and with sensors as good as these, a "
            f"planner is safe that assumes no more than {holds.min():.2f} times the least friction that it may "
            "meet."
            if np.isfinite(holds).all()
            else "Somewhere tires slide already at the least ratio that was tried: no margin is safe."
        )
        sentences.append(
            f"Tires begin to slide when the planner assumes {spread} times their friction, first on "
            f"{first['track']} at mu {first['mu']:g}. {safe}"
        )
        expected.append(("knee: planner-mu over tire-mu where a tire first slides", "above 1", spread))
    for mu in dict.fromkeys(row["mu"] for row in laps):
        rows = [row for row in laps if row["mu"] == mu]
        ratios = column(rows, "ratio")
        most = float(ratios[ratios <= _SHOWN_UP_TO].max())
        crashed = ratios[[bool(row["crashed"]) for row in rows]]
        said = (
            f"first crash at a ratio of {crashed.min():g}"
            if len(crashed)
            else f"no crash up to a ratio of {ratios.max():g}"
        )
        relative = np.array([_relative(rows, row) for row in rows])
        worst = 100.0 * column(rows, "sliding_share")[ratios == most].max()
        sentences.append(
            f"Tires of mu {mu:g}: {said}. Laps take {_change(relative[ratios == ratios.min()])} at a ratio of "
            f"{ratios.min():g}, and {_change(relative[ratios == most])} at {most:g}, where a tire slides for up to "
            f"{worst:.0f} % of the time."
        )
        expected.append((f"first crash, tires of mu {mu:g}", "no expectation", said))
    return sentences, expected


def _relative(rows: list[Row], row: Row) -> float:
    """Return the lap time over that of a planner that assumes the right friction, on the same circuit."""
    right = [r for r in rows if r["track"] == row["track"] and r["mu"] == row["mu"] and r["ratio"] == 1.0]
    return float(row["best_lap_s"] or math.nan) / float(right[0]["best_lap_s"] or math.nan) if right else math.nan


def _change(relative: FloatArray) -> str:
    changes = np.round(100.0 * (relative - 1.0)) + 0.0  # which makes -0 a 0
    return f"{span(changes, '+.0f')} %" if np.isfinite(changes).any() else "no lap"


def _draw(figure: matplotlib.figure.Figure, laps: list[Row]) -> None:
    mus = list(dict.fromkeys(row["mu"] for row in laps))
    panels: Any = figure.subplots(3, len(mus), squeeze=False, sharex=True, sharey="row")
    for axes_of_mu, mu in zip(panels.T, mus, strict=True):
        times, slides, shares = axes_of_mu
        tracks = dict.fromkeys(str(row["track"]) for row in laps if row["mu"] == mu)
        for colour, track in zip(COLOURS, tracks, strict=False):
            rows = [row for row in laps if row["track"] == track and row["mu"] == mu]
            ratio = column(rows, "ratio")
            relative = np.array([_relative(laps, row) for row in rows])
            joined: dict[str, Any] = {"linestyle": "-", "linewidth": 0.6}
            measured(times, ratio, relative, track, colour=colour, **joined)
            measured(slides, ratio, column(rows, "max_slide_m_s"), colour=colour, **joined)
            measured(shares, ratio, 100.0 * column(rows, "sliding_share"), colour=colour, **joined)
            crashed = np.array([bool(row["crashed"]) for row in rows])
            slides.plot(ratio[crashed], column(rows, "max_slide_m_s")[crashed], "x", color="black", markersize=6.0)
        times.set_title(f"tires of mu {mu:g}", fontsize=8.0)
        log_from_zero(slides, 1e-3)
        limit(slides, slides_above(IDEAL_TIRES))
        for axes in axes_of_mu:
            axes.axvline(1.0, color="0.25", linewidth=0.6, zorder=1.0)
        shares.set_xlabel("planner's mu over tires' mu [-]")
    for axes, label in zip(panels[:, 0], ("lap time over that\nat 1 [-]", "greatest slide\n[m/s]", "time sliding\n[%]"),
                           strict=True):  # fmt: skip
        axes.set_ylabel(label)
    finish(panels[0, 0], "", "lap time over that\nat 1 [-]")


EXPERIMENT = MismatchExperiment()
