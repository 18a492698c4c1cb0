"""Laps at the friction limit, and how much faster the same line could have been driven.

A planner that knows its tires drives five laps of each circuit. The time of the best lap is compared with the times
that the laws of motion allow on the same line (lap_time_bound): for a point mass on the friction circle, which is the
bound; for a car whose axles hold, which shows what no friction limiter could use; and for a car within the limiter's
shares of the grip ("limited"), which shows what these cost. The rest is due to the limited view and to transients:
`gap_finder` sees as far as its LiDAR, and `pure_pursuit`, with the same limiter, has a map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter, longitudinal_share

from ..messages import FloatArray
from ..pictures.pages.figure_kit import COLOURS, column, finish, limit, measured, span, theory
from ..racing.race import race
from ..vehicle.car import WHEELS
from ..vehicle.tire_slip import slides_above
from ..vehicle.tires import IDEAL_TIRES
from .experiment import Cell, Figure, LabSettings, Row, Section, Tables, no_number
from .lap_line import best_flying_lap, driven_lap
from .lap_time_bound import (
    HoldingCar,
    Line,
    PointMass,
    fastest_speeds,
    lap_time,
    motor_acceleration,
    smooth_line,
    step_times,
)

if TYPE_CHECKING:
    import matplotlib.figure

GREATEST_RATIO = 1.15
"""[-] Of a lap's time to the bound, as asked."""

TOLERANCE = 0.005
"""[m] The smoothed line, which the curvature is taken of, is this near to where the car was."""

_TOLERANCES = (0.001, 0.002, 0.005, 0.010, 0.020)  # [m]
_RANDOM = 10  # seeds of random circuits
_LAPS, _QUICK_LAPS = 5, 2
_TRACKS = ("chicanes", "fast", "hairpins", "l_corridor", "oval", "tight")
_QUICK_TRACKS = ("oval", "l_corridor")
_SHOWN, _QUICK_SHOWN = "tight", "oval"  # the circuit whose speeds are drawn
_CONTROLLERS = ("gap_finder", "pure_pursuit")
_SAMPLING = 0.1  # [m] of the rows of speeds
_NEAR = 0.99  # of a corner's speed, from which on it is the corner that holds the car back
_CAUSES = ("top_speed", "cornering", "accelerating", "braking")
_NUMBERS = (
    "first_lap_s", "best_lap_s", "max_slide_m_s", "sliding_share", "friction_utilisation_max",
    "friction_utilisation_mean", "line_m",
    "gap_mm", "bound_s", "ratio", "holding_bound_s", "holding_ratio", "limited_bound_s", "limited_ratio",
    *(f"lost_{cause}_s" for cause in _CAUSES),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class LimitedCar(PointMass):
    """The car that keeps within the friction limiter's shares of the grip, as if it knew the whole line."""

    limiter: FrictionLimiter

    def corner_speed(self, curvature: float) -> float:
        """Return the speed of the limiter's lateral acceleration."""
        return math.sqrt(self.limiter.lateral / max(abs(curvature), 1e-12))

    def acceleration(self, curvature: float, squared_speed: float) -> float:
        """Return the lesser of the limiter's and the motor's greatest acceleration."""
        share = self._share(curvature, squared_speed, self.limiter.exponent)
        return min(float(self.limiter.accelerating * share), motor_acceleration(self.car, squared_speed))

    def braking(self, curvature: float, squared_speed: float) -> float:
        """Return the lesser of the limiter's and the motor's greatest deceleration."""
        share = self._share(curvature, squared_speed, self.limiter.braking_exponent)
        return min(float(self.limiter.braking * share), self.car.max_acceleration)

    def _share(self, curvature: float, squared_speed: float, exponent: float) -> float:
        lateral_use = abs(curvature) * squared_speed / (self.mu * self.car.gravity)
        return float(longitudinal_share(lateral_use, exponent))


class LapsExperiment:
    """Sliding and lap times on all circuits."""

    name = "laps"
    title = "Laps at the limit, and their lower bound"

    def cells(self, settings: LabSettings) -> list[Cell]:
        """Return a cell for each circuit and planner."""
        if settings.quick:
            return [_cell(track, _CONTROLLERS[0], _QUICK_LAPS, _QUICK_SHOWN) for track in _QUICK_TRACKS]
        tracks = [*_TRACKS, *(f"random:{seed}" for seed in range(_RANDOM))]
        return [_cell(track, controller, _LAPS, _SHOWN) for controller in _CONTROLLERS for track in tracks]

    def measure(self, cell: Cell) -> Tables:
        """Race, and bound the best lap."""
        track, controller = cell["track"], cell["controller"]
        result = race(track, controller, tires=IDEAL_TIRES, laps=cell["laps"])
        own = result.car
        uses = np.fmax.reduce([own.column(f"friction_utilisation_{wheel}") for wheel in WHEELS])
        row: Row = {"track": track, "controller": controller, "laps": own.laps_completed}
        row |= {"end_reason": own.end_reason, **no_number(f"{own.laps_completed} laps: no flying one", *_NUMBERS)}
        row["max_slide_m_s"], row["sliding_share"] = own.max_slide_m_s, own.slide_time_fraction
        row["friction_utilisation_max"] = float(np.nanmax(uses))
        if len(own.lap_times_s) < 2:
            return {"laps": [row]}
        car, mu, max_speed = result.world.car.parameters, own.mu, own.speed_limit_m_s
        lap = best_flying_lap(own)
        driven, best = driven_lap(own, lap, car), own.lap_times_s[lap - 1]
        point_mass = PointMass(mu=mu, car=car, max_speed=max_speed)
        holding_car = HoldingCar(mu=mu, car=car, max_speed=max_speed)
        limited_car = LimitedCar(mu=mu, car=car, max_speed=max_speed, limiter=FrictionLimiter(car, own.planner_mu))
        tolerances: list[Row] = []
        for tolerance in _TOLERANCES:
            smoothed = smooth_line(driven.points, tolerance)
            bound = lap_time(smoothed, fastest_speeds(smoothed, point_mass))
            tolerances.append(
                {"track": track, "controller": controller, "tolerance_mm": 1e3 * tolerance, "bound_s": bound,
                 "ratio": best / bound, "tightest_radius_m": 1.0 / float(np.abs(smoothed.curvature).max())}
            )  # fmt: skip
        line = smooth_line(driven.points, TOLERANCE)
        fastest, holding, limited = (fastest_speeds(line, car) for car in (point_mass, holding_car, limited_car))
        actual = driven.speed_at(len(fastest))
        bound, holding_bound, limited_bound = (lap_time(line, speeds) for speeds in (fastest, holding, limited))
        row |= {
            "first_lap_s": own.lap_times_s[0], "best_lap_s": best, "line_m": line.length,
            "friction_utilisation_mean": float(np.nanmean(uses[own.column("lap") == lap])), "gap_mm": 1e3 * driven.gap,
            "bound_s": bound, "ratio": best / bound, "holding_bound_s": holding_bound,
            "holding_ratio": best / holding_bound, "limited_bound_s": limited_bound,
            "limited_ratio": best / limited_bound, "reason": "",
        }  # fmt: skip
        for cause, seconds in _lost(line, actual, fastest, point_mass).items():
            row[f"lost_{cause}_s"] = seconds
        tables: Tables = {"laps": [row], "tolerance": tolerances}
        if cell["speeds"]:
            tables["speeds"] = _speed_rows(track, controller, line, actual, fastest, holding, limited)
        return tables

    def section(self, tables: Tables) -> Section:
        """Say how near the laps come to the bound, and what is lost where."""
        laps = tables["laps"]
        planners = [name for name in _CONTROLLERS if any(row["controller"] == name for row in laps)]
        sentences, expected = [], []
        for planner in planners:
            rows = [row for row in laps if row["controller"] == planner]
            ratios = column(rows, "ratio")
            within, slide = int((ratios <= GREATEST_RATIO).sum()), float(np.nanmax(column(rows, "max_slide_m_s")))
            finished = sum(row["end_reason"] == "finished" for row in rows)
            spread = span(ratios)
            sentences.append(
                f"{planner}: {finished} of {len(rows)} races finished without a crash, greatest slide {slide:.3f} m/s; "
                f"best lap {spread} times the lower bound of its own line (median {np.nanmedian(ratios):.3f}), at most "
                f"{GREATEST_RATIO} on {within} of {len(rows)} circuits. {_parts(rows)} {_where(rows)}"
            )
            expected += [
                (f"lap over its lower bound, {planner}", f"<= {GREATEST_RATIO}",
                 f"{spread}; {within} of {len(rows)} circuits within"),
                (f"greatest slide in these laps, {planner}", f"<= {slides_above(IDEAL_TIRES)} m/s",
                 f"{slide:.3f} m/s"),
            ]  # fmt: skip
        if len(planners) > 1:
            sentences.append(_with_a_map(laps))
        sentences.append(_on_tolerance(tables["tolerance"]))
        shown = (
            "track", "controller", "laps", "end_reason", "best_lap_s", "bound_s", "ratio", "holding_ratio",
            "limited_ratio", "max_slide_m_s", "friction_utilisation_mean", *(f"lost_{cause}_s" for cause in _CAUSES),
        )  # fmt: skip
        return Section(
            sentences=tuple(sentences),
            figures=(
                Figure(
                    name="ratios",
                    caption="Best flying lap over the lower bound of the same line: filled, the point mass on the "
                    "friction circle; open, the car that keeps the friction limiter's shares of the grip, and "
                    "knows the whole line.",
                    draw=lambda figure: _draw_ratios(figure, laps),
                    height=0.6 + 0.22 * len({row["track"] for row in laps}),
                ),
                Figure(
                    name="speeds",
                    caption="Speed along one lap: as driven, and the fastest that its line allows.",
                    draw=lambda figure: _draw_speeds(figure, tables["speeds"]),
                    height=3.8,
                ),
            ),
            columns={"laps": shown, "tolerance": ("track", "controller", "tolerance_mm", "bound_s", "ratio",
                                                  "tightest_radius_m")},
            expected=tuple(expected),
        )  # fmt: skip


def _cell(track: str, controller: str, laps: int, shown: str) -> Cell:
    return {"track": track, "controller": controller, "laps": laps, "speeds": track == shown}


def _lost(line: Line, actual: FloatArray, fastest: FloatArray, limits: PointMass) -> dict[str, float]:
    """Return the time that a lap at speeds `actual` (n,) [m/s] takes longer, by what the fastest does there [s]."""
    lost = step_times(line, actual) - step_times(line, fastest)
    corner = np.array([limits.corner_speed(curvature) for curvature in line.curvature.tolist()])
    at_top = fastest > (1.0 - 1e-6) * limits.max_speed
    cornering = ~at_top & (fastest > _NEAR * corner)
    accelerating = ~at_top & ~cornering & (np.roll(fastest, -1) > fastest)
    braking = ~(at_top | cornering | accelerating)
    places = (at_top, cornering, accelerating, braking)
    return {cause: float(lost[there].sum()) for cause, there in zip(_CAUSES, places, strict=True)}


def _speed_rows(track: str, controller: str, line: Line, *speeds: FloatArray) -> list[Row]:
    distance = np.concatenate(([0.0], np.cumsum(line.steps)[:-1]))
    every = max(1, round(_SAMPLING / float(line.steps.mean())))
    values = np.column_stack((distance, *line.points.T, line.curvature, *speeds))[::every].tolist()
    names = ("distance_m", "x_m", "y_m", "curvature_1_m", "speed_m_s", "bound_m_s", "holding_m_s",
             "limited_m_s")  # fmt: skip
    return [{"track": track, "controller": controller, **dict(zip(names, row, strict=True))} for row in values]


def _parts(rows: list[Row]) -> str:
    """Say what each step from the bound to the lap costs on average: what no limiter can use, the limiter, rest."""
    bound, holding, limited, driven = (
        column(rows, name) for name in ("bound_s", "holding_bound_s", "limited_bound_s", "best_lap_s")
    )
    steps = [100.0 * float(np.nanmean(after / before) - 1.0)
             for before, after in ((bound, holding), (holding, limited), (limited, driven))]  # fmt: skip
    return (
        f"In the mean {steps[0]:.1f} % are lost because loads move and differentials are open, {steps[1]:.1f} % are "
        f"due to the shares of the grip that the friction limiter keeps, and {steps[2]:.1f} % to view and transients."
    )


def _where(rows: list[Row]) -> str:
    """Say where the time is lost on the circuits that miss the ratio."""
    missed = [row for row in rows if float(row["ratio"] or 0.0) > GREATEST_RATIO]
    if not missed:
        return "No circuit misses it."
    lost = {cause: sum(float(row[f"lost_{cause}_s"] or 0.0) for row in missed) for cause in _CAUSES}
    whole = sum(lost.values())
    shares = ", ".join(f"{100.0 * seconds / whole:.0f} % {_WORDS[cause]}" for cause, seconds in lost.items())
    return f"Where it misses it, the time is lost {shares}."


_WORDS = {
    "top_speed": "where the bound is at top speed",
    "cornering": "in corners",
    "accelerating": "where it accelerates",
    "braking": "where it brakes",
}


def _with_a_map(laps: list[Row]) -> str:
    """Compare the planner that sees with the one that has a map, on the circuits where both have a ratio."""
    by = {name: {row["track"]: float(row["ratio"] or math.nan) for row in laps if row["controller"] == name}
          for name in _CONTROLLERS}  # fmt: skip
    sees, knows = (np.array([by[name].get(track, math.nan) for track in by[_CONTROLLERS[0]]]) for name in _CONTROLLERS)
    return (
        f"In the mean a lap takes {100.0 * (np.nanmean(sees) - 1.0):.0f} % longer than the bound of its line with "
        f"{_CONTROLLERS[0]}, which sees as far as its LiDAR, and {100.0 * (np.nanmean(knows) - 1.0):.0f} % with "
        f"{_CONTROLLERS[1]}, which knows the centreline and has the same friction limiter."
    )


def _on_tolerance(rows: list[Row]) -> str:
    ratio = column(rows, "ratio").reshape(-1, len(_TOLERANCES))
    change = 100.0 * float(np.nanmax(np.abs(ratio / ratio[:, [_TOLERANCES.index(TOLERANCE)]] - 1.0)))
    return (
        f"The curvature is that of a smoothing spline that stays within {1e3 * TOLERANCE:g} mm of where the car was; "
        f"with {1e3 * _TOLERANCES[0]:g} to {1e3 * _TOLERANCES[-1]:g} mm the ratios change by {change:.1f} % at most."
    )


def _draw_ratios(figure: matplotlib.figure.Figure, laps: list[Row]) -> None:
    axes: Any = figure.add_subplot()
    tracks = list(dict.fromkeys(str(row["track"]) for row in laps))
    for index, name in enumerate(_CONTROLLERS):
        rows = [row for row in laps if row["controller"] == name]
        if not rows:
            continue
        at = np.array([tracks.index(str(row["track"])) for row in rows]) + 0.18 * (2 * index - 1)
        measured(axes, column(rows, "ratio"), at, name, colour=COLOURS[index])
        measured(axes, column(rows, "limited_ratio"), at, f"{name}, over\nthe limiter's shares", colour=COLOURS[index],
                 markerfacecolor="white")  # fmt: skip
    axes.axvline(GREATEST_RATIO, color="0.25", linewidth=0.8, linestyle=(0, (4, 2)), zorder=1.5)
    axes.set_yticks(range(len(tracks)), tracks)
    axes.set_ylim(len(tracks) - 0.5, -0.5)
    axes.set_xlim(left=1.0)
    finish(axes, "lap time over its lower bound [-]", "", legend=False)
    axes.text(
        GREATEST_RATIO, 1.0, f"{GREATEST_RATIO:g}", transform=axes.get_xaxis_transform(), ha="center", va="bottom"
    )
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_speeds(figure: matplotlib.figure.Figure, rows: list[Row]) -> None:
    planners = list(dict.fromkeys(str(row["controller"]) for row in rows))
    panels: Any = figure.subplots(len(planners), 1, squeeze=False)[:, 0]
    for axes, name in zip(panels, planners, strict=True):
        own = [row for row in rows if row["controller"] == name]
        distance = column(own, "distance_m")
        theory(axes, distance, column(own, "bound_m_s"), "bound: point mass")
        axes.plot(distance, column(own, "holding_m_s"), color="0.6", linewidth=0.9, label="axles hold")
        axes.plot(distance, column(own, "limited_m_s"), color=COLOURS[4], linewidth=0.9, label="the limiter's shares")
        axes.plot(distance, column(own, "speed_m_s"), color=COLOURS[0], linewidth=1.3, label="as driven")
        axes.set_ylim(0.0, 8.6)
        axes.set_xlim(0.0, float(distance[-1]))
        axes.set_title(f"{own[0]['track']}, {name}", fontsize=8.0, loc="left")
        finish(axes, "distance [m]" if name == planners[-1] else "", "speed [m/s]", legend=False)
    panels[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4)
    limit(panels[0], 8.0)


EXPERIMENT = LapsExperiment()
