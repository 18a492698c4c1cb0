"""Laps, beside the least time that the laws of motion allow on the same line, and planners that are told a wrong mu.

Both take the planner and assist of the settings. Where another law is given, it limits the speed besides the assist,
which is then `mean_range`, the field's own law, unless the settings name one; a faster law changes nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..messages import CarParameters, Controller, DriveCommand, FloatArray, LaserScan, Odometry, PlannerContext
from ..pictures.pages import figure_kit as style
from ..pictures.pages.figure_kit import column
from ..racing.entries import Entry
from ..racing.planners import make_controller
from ..racing.race import race_setup
from ..racing.result import CarResult
from ..racing.setup import Setup
from ..vehicle.tire_slip import share_text
from .experiment import ONE_SET, Cell, Experiment, LabSettings, Row, Section, number
from .lap_time_bound import PointMass, fastest_speeds, lap_time, smooth_line
from .speed_laws import DEFAULT_LAW, SpeedLaw

if TYPE_CHECKING:
    import matplotlib.figure

TOLERANCE = 0.005
"""[m] The smoothed line, which the curvature is taken of, is this near to where the car was."""

_TRACKS = ("chicanes", "fast", "hairpins", "l_corridor", "oval", "tight")
_OF_MISMATCH = ("oval",)
_LAPS, _LAPS_OF_MISMATCH = 5, 2
_TOLD = (0.7, 0.85, 1.0, 1.15, 1.3)  # of the tires' friction, unless it is said what planners are told
_ALONE = "mean_range"  # assist of a planner whose speed a law limits
_USES = ("law", *ONE_SET, "track", "laps", "controller", "assist")


@dataclass(frozen=True)
class LawPlanner:
    """A planner whose speed a law limits: at the steering angle that it commands."""

    planner: Controller
    law: SpeedLaw
    context: PlannerContext

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        """Decide as the planner does, no faster than the law."""
        command = self.planner(scan, odometry)
        limit = self.law(command.steering_angle, odometry, self.context.car, self.context.mu)
        return replace(command, speed=min(command.speed, limit))

    def reset(self) -> None:
        """Forget all."""
        self.planner.reset()


def drive_laps(settings: LabSettings, track: str, mu: float, told: float, laps: int) -> tuple[CarResult, Any]:
    """Race alone on tires of `mu`, `told` to planner or law, or their greatest peak [-]; return result and car."""
    entry = replace(settings.entry, planner_mu=told)
    if settings.entry.set_mu is None:
        entry = replace(entry, mu=mu)
    if settings.law != DEFAULT_LAW:
        car = settings.ground(mu).car.parameters
        context = replace(entry.context(car, None), assist=_assist(entry, settings.law))
        planner = make_controller(entry.controller, context, settings=entry.planner_settings)
        entry = replace(entry, controller=LawPlanner(planner, settings.speed_law, context), planner_settings={})
    result = race_setup(Setup(track=track, entries=(entry,), laps=laps))
    return result.car, result.world.car


def best_flying_lap(laps: CarResult) -> int:
    """Return the number of the fastest lap, except the first, which is from a standing start."""
    return 2 + int(np.argmin(laps.lap_times_s[1:]))


def driven_lap(laps: CarResult, lap: int, car: CarParameters) -> FloatArray:
    """Return the centre of gravity in a lap from 2 on (n, 2) [m]; the gap of some mm is spread over the lap."""
    heading = laps.column("heading_rad")
    ahead = np.stack((np.cos(heading), np.sin(heading)))
    points = (np.stack((laps.column("x_m"), laps.column("y_m"))) + car.rear_axle_distance * ahead).T
    rows = np.flatnonzero(laps.column("lap") == lap)
    before = points[rows[0] - 2 : rows[0] + 1]  # across the start line, a lap ago
    last = points[rows[-1]]
    feet = [_foot(last, start, end) for start, end in pairwise(before)]
    gap = last - min(feet, key=lambda foot: float(np.hypot(*(last - foot))))
    return np.asarray(points[rows] - np.linspace(0.0, 1.0, len(rows))[:, np.newaxis] * gap)


def _foot(point: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the place of a segment that is nearest to a point. Shape (2,) [m]."""
    along = end - start
    share = float(np.clip((point - start) @ along / (along @ along), 0.0, 1.0))
    return np.asarray(start + share * along)


def _row(own: CarResult, laps: int) -> Row:
    flying = own.lap_times_s[1:]
    return {
        "laps": own.laps_completed, "finished": own.laps_completed >= laps, "end_reason": own.end_reason,
        "best_lap_s": min(flying, default=math.nan), "max_slide_m_s": own.max_slide_m_s,
        "sliding_share": own.slide_time_fraction,
    }  # fmt: skip


class Laps:
    """Lap times beside their lower bound."""

    name = "laps"
    title = "Laps, and the least time on the same line"
    uses = _USES

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each friction and circuit."""
        settings.try_law(0.0)
        return [{"mu": mu, "track": track} for mu in settings.frictions for track in settings.tracks or _TRACKS]

    def measure(self, cell: Cell, settings: LabSettings) -> list[Row]:
        """Race, and bound the best lap."""
        mu, laps = cell["mu"], settings.laps or _LAPS
        told = settings.told(mu)
        own, car = drive_laps(settings, cell["track"], mu, told, laps)
        row: Row = {"track": cell["track"], "mu": mu, **_row(own, laps), "bound_s": math.nan, "ratio": math.nan}
        if len(own.lap_times_s) < 2:
            return [row | {"reason": f"no flying lap: {own.end_reason}"}]
        limits = PointMass(mu=told, car=car.parameters, max_speed=own.speed_limit_m_s)
        line = smooth_line(driven_lap(own, best_flying_lap(own), car.parameters), TOLERANCE)
        bound = lap_time(line, fastest_speeds(line, limits))
        return [row | {"bound_s": bound, "ratio": number(row, "best_lap_s") / bound, "reason": ""}]

    def section(self, rows: list[Row], settings: LabSettings) -> Section:
        """Say how near the laps come to the bound."""
        finished, ratios = sum(bool(row["finished"]) for row in rows), column(rows, "ratio")
        slid = float(np.fmax.reduce(column(rows, "sliding_share")))
        return Section(
            sentences=(
                f"{_who(settings)}: {finished} of {len(rows)} races finished; the best lap takes {style.span(ratios)} "
                f"of the least time on its own line; time sliding: {share_text(slid)}.",
            ),
            columns={
                "track": "track", "mu": "mu", "end": "end_reason", "best lap s": "best_lap_s", "bound s": "bound_s",
                "ratio": "ratio", "greatest slide m/s": "max_slide_m_s",
            },
            draw=lambda figure: _draw_laps(figure, rows),
            height=1.2 + 0.25 * len({row["track"] for row in rows}),
        )  # fmt: skip


class Mismatch:
    """Laps of a planner that is told another friction than that of the tires."""

    name = "mismatch"
    title = "A planner that is told a wrong friction"
    uses = (*_USES, "planner_mu")

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each circuit, friction of the tires, and friction that is told."""
        settings.try_law(0.0)
        return [
            {"track": track, "mu": mu, "told": told}
            for track in settings.tracks or _OF_MISMATCH
            for mu in settings.frictions
            for told in settings.planner_mus or [round(share * settings.told(mu), 4) for share in _TOLD]
        ]

    def measure(self, cell: Cell, settings: LabSettings) -> list[Row]:
        """Drive the laps."""
        laps = settings.laps or _LAPS_OF_MISMATCH
        own, _ = drive_laps(settings, cell["track"], cell["mu"], cell["told"], laps)
        row: Row = {"track": cell["track"], "mu": cell["mu"], "planner_mu": cell["told"]}
        return [row | {"ratio": cell["told"] / settings.told(cell["mu"]), **_row(own, laps)}]

    def section(self, rows: list[Row], settings: LabSettings) -> Section:
        """Say up to which ratio every race finishes, and up to which none slides."""
        ratios, finished = column(rows, "ratio"), np.array([bool(row["finished"]) for row in rows])
        slid = column(rows, "sliding_share") > 0.0
        said = [f"{_who(settings)}: {finished.sum()} of {len(rows)} races finished."]
        for words, bad in (("a race does not finish", ~finished), ("a tire slides", slid)):
            said.append(f"{words[0].upper()}{words[1:]} from a ratio of {ratios[bad].min():.2f} on." if bad.any()
                        else f"At no ratio up to {ratios.max():.2f} {words}.")  # fmt: skip
        if not settings.tires.slides:
            said[-1] = share_text(math.nan)
        return Section(
            sentences=(" ".join(said),),
            columns={
                "track": "track", "mu": "mu", "planner's mu": "planner_mu", "ratio": "ratio", "end": "end_reason",
                "best lap s": "best_lap_s", "greatest slide m/s": "max_slide_m_s", "time sliding": "sliding_share",
            },
            draw=lambda figure: _draw_mismatch(figure, rows),
        )  # fmt: skip


LAPS: Experiment = Laps()
MISMATCH: Experiment = Mismatch()


def _who(settings: LabSettings) -> str:
    law = "" if settings.law == DEFAULT_LAW else f" by the law {settings.law!r}"
    return f"{settings.entry.controller}{law}, assist {_assist(settings.entry, settings.law)}"


def _assist(entry: Entry, law: str) -> str:
    return _ALONE if law != DEFAULT_LAW and entry.assist == "full" else entry.assist


def _draw_laps(figure: matplotlib.figure.Figure, rows: list[Row]) -> None:
    axes: Any = figure.add_subplot()
    tracks = list(dict.fromkeys(str(row["track"]) for row in rows))
    for index, mu in enumerate(dict.fromkeys(number(row, "mu") for row in rows)):
        own = [row for row in rows if number(row, "mu") == mu]
        at = [tracks.index(str(row["track"])) for row in own]
        colour = style.COLOURS[index % len(style.COLOURS)]
        style.measured(axes, column(own, "ratio"), at, f"mu {mu:.3g}", colour=colour)
    axes.set_yticks(range(len(tracks)), tracks)
    axes.set_ylim(len(tracks) - 0.5, -0.5)
    axes.set_xlim(left=1.0)
    style.finish(axes, "best lap over the least time on its line [-]", "")


def _draw_mismatch(figure: matplotlib.figure.Figure, rows: list[Row]) -> None:
    panels: Any = figure.subplots(1, 2)
    for axes, name, label in zip(
        panels, ("best_lap_s", "sliding_share"), ("best lap [s]", "share of the time sliding [-]"), strict=True
    ):
        kinds = dict.fromkeys((str(row["track"]), number(row, "mu")) for row in rows)
        for index, (track, mu) in enumerate(kinds):
            own = [row for row in rows if row["track"] == track and number(row, "mu") == mu]
            colour = style.COLOURS[index % len(style.COLOURS)]
            style.measured(axes, column(own, "ratio"), column(own, name), f"{track}, mu {mu:.3g}", colour=colour,
                           linestyle="-", linewidth=0.6)  # fmt: skip
            crashed = [row for row in own if not row["finished"]]
            foot = 0.03 + 0.0 * column(crashed, "ratio")  # of the picture
            axes.plot(column(crashed, "ratio"), foot, "x", color=colour, ms=6.0, transform=axes.get_xaxis_transform())
        axes.plot([], [], "x", color="0.25", markersize=6.0, label="did not finish")
        axes.axvline(1.0, color="0.6", linewidth=0.8)
        style.finish(axes, "planner's mu over the tires' [-]", label, legend=axes is panels[0])
