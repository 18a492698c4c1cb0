"""Patches of low friction: whether the friction that acts is the one that was set, and laps over some patches.

`friction_patches` says what a patch is, and why it is no geom; `patch_manoeuvres` has the manoeuvres. The laps are
driven by a planner that assumes the friction of the dry ground, and by one that assumes that of the patches.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..messages import FloatArray
from ..pictures.course_drawing import draw_course
from ..pictures.pages.figure_kit import COLOURS, column, finish, measured, span, theory
from ..simulation.course_loading import load_track
from ..simulation.world import World
from ..vehicle.car import WHEELS
from ..vehicle.friction_patches import Patch, random_patches, read_patches
from ..vehicle.tire_slip import slides_above
from ..vehicle.tires import IDEAL_TIRES
from ..vehicle.vehicle import Vehicle
from .experiment import Cell, Figure, LabSettings, Row, Section, Tables
from .lab_laps import LabLaps, drive_laps
from .patch_manoeuvres import WAYS, brake_onset, circle, edge_load, onset, sliding_sideways

if TYPE_CHECKING:
    import matplotlib.figure

_PATCH_MU = 0.5
_MUS, _QUICK_MUS = (0.2, 0.35, 0.5, 0.7), (0.5,)  # [-] asked for
_ASKED = 0.35  # [-] of each way to lay a patch
_RADIUS = 3.0  # [m] of the circle on a patch
_WIDTH, _QUICK_WIDTH = 0.004, 0.03  # of the fractions of closed forms that are found by bisection
_BEYOND = 1.1  # times the law's speed, where the lateral acceleration is all that friction gives
_TRACKS, _SEEDS, _COUNT, _LAPS = ("oval", "chicanes", "tight"), 3, 4, 2
_MAPPED = "tight"  # the circuit of the friction map


class PatchesExperiment:
    """Acting friction, and laps over patches."""

    name = "patches"
    title = "Patches of low friction"

    def cells(self, settings: LabSettings) -> list[Cell]:
        """Return a cell for each way, friction, and race."""
        mus, tracks, seeds = (_QUICK_MUS, ("oval",), 1) if settings.quick else (_MUS, _TRACKS, _SEEDS)
        laps: list[Cell] = [
            {"what": "laps", "track": track, "planner_mu": planner_mu, "seed": settings.seed + seed, "patches": count,
             "map": seed == 0 and track == (_MAPPED if _MAPPED in tracks else tracks[0]) and count > 0}
            for track in tracks
            for planner_mu in (Vehicle.load().greatest_mu(), _PATCH_MU)
            for seed, count in ((0, 0), *((seed, _COUNT) for seed in range(seeds)))
        ]  # fmt: skip
        ways: list[Cell] = [{"what": "way", "way": way, "mu": _ASKED} for way in WAYS]
        width = _QUICK_WIDTH if settings.quick else _WIDTH
        return [*ways, *({"what": "acting", "mu": mu, "width": width} for mu in mus), *laps]

    def measure(self, cell: Cell) -> Tables:
        """Measure what the cell asks for."""
        return {"way": _way, "acting": _acting, "laps": _laps}[cell["what"]](cell)

    def section(self, tables: Tables) -> Section:
        """Say how exactly the friction acts, and what patches do to laps."""
        acting, ways, laps = tables["acting"], tables["ways"], tables["laps"]
        wrong = ", ".join(f"{row['way']} {row['acting_mu']:.2f}" for row in ways if row["way"] != "site")
        ratio, from_k, beyond = (column(acting, name) for name in ("acting_ratio", "runs_wide_from_k", "lateral_ratio"))
        brake = column(acting, "brake_onset")
        sentences = [
            f"The friction that acts on a patch is {span(ratio)} times the one asked for (a car that slides sideways). "
            f"A car on a circle of {_RADIUS:g} m runs wide from {span(from_k)} times sqrt(g mu R) of the patch; its "
            f"lateral acceleration beyond is {span(beyond)} mu g. In braking the rear axle slides at {span(brake)} "
            "times its closed form.",
            f"No geom does that: where {ways[0]['asked_mu']:g} was asked for there acted {wrong}. A raised geom has "
            f"the right friction, and an edge that loads a tire {_of(ways, 'raised', 'edge_load_ratio'):.1f} times as "
            f"much; the patch here {_of(ways, 'site', 'edge_load_ratio'):.2f} times.",
            *_on_laps(laps),
        ]
        worst = max(abs(float(value) - 1.0) for value in (*ratio, *from_k, *brake))
        blind = [row for row in laps if row["patches"] and row["planner_mu"] != _PATCH_MU]
        wary = [row for row in laps if row["patches"] and row["planner_mu"] == _PATCH_MU]
        return Section(
            sentences=tuple(sentences),
            figures=(
                Figure(
                    name="acting",
                    caption="Left: friction that acts, over what was asked for. Right: each way to lay a patch; only "
                    "`site` has the friction asked for (line) and no edge.",
                    draw=lambda figure: _draw_acting(figure, acting, ways),
                    height=2.8,
                ),
                Figure(
                    name="map",
                    caption=f"Two laps over patches of mu {_PATCH_MU:g} (blue). The line is grey where all tires hold, "
                    "and else says how fast the fastest slides.",
                    draw=lambda figure: _draw_map(figure, tables["map"], tables["places"]),
                    height=3.6,
                ),
            ),
            columns={
                "acting": ("asked_mu", "acting_mu", "acting_ratio", "runs_wide_from_k", "slides_from_k",
                           "lateral_ratio", "brake_onset"),
                "ways": ("way", "asked_mu", "acting_mu", "edge_load_ratio"),
                "laps": ("track", "seed", "patches", "patch_mu", "planner_mu", "end_reason", "best_lap_s",
                         "max_slide_m_s", "sliding_share", "on_patch_share", "sliding_share_on_patch"),
            },
            expected=(
                ("friction that acts on a patch, over that asked for", "1", f"within {100.0 * worst:.1f} %"),
                ("laps over patches, planner knows them", "no expectation", _extremes(wary)),
                ("laps over patches, planner does not", "no expectation", _extremes(blind)),
            ),
        )  # fmt: skip


def _way(cell: Cell) -> Tables:
    way, mu = cell["way"], cell["mu"]
    acting = sliding_sideways(way, mu)
    edge = edge_load(way, mu)
    return {"ways": [{"way": way, "asked_mu": mu, "acting_mu": acting, "edge_load_ratio": edge, "reason": ""}]}


def _acting(cell: Cell) -> Tables:
    mu, width = cell["mu"], cell["width"]
    acting = sliding_sideways("site", mu)
    wide, slides = onset(mu, _RADIUS, tolerance=width)
    lateral = circle(mu, _RADIUS, _BEYOND)[2]
    braking = brake_onset(mu, tolerance=width)
    row: Row = {"asked_mu": mu, "acting_mu": acting, "acting_ratio": acting / mu, "runs_wide_from_k": wide,
                "slides_from_k": slides, "lateral_ratio": lateral, "brake_onset": braking, "reason": ""}  # fmt: skip
    if math.isnan(wide + slides + braking):
        row["reason"] = "not between 0.9 and 1.2 of the closed form"
    return {"acting": [row]}


def _laps(cell: Cell) -> Tables:
    track: Any = load_track(cell["track"])
    patches: tuple[Patch, ...] = ()
    if cell["patches"]:
        patches = random_patches(track, cell["patches"], np.random.default_rng(cell["seed"]), mu=_PATCH_MU)
    world = World(track, tires=IDEAL_TIRES, patches=patches)
    laps = drive_laps(world, laps=_LAPS, planner_mu=cell["planner_mu"])
    on_patch = (laps.floor_mu < world.car.mu).any(axis=1)
    sliding, steps = laps.column("sliding_steps")[on_patch].sum(), laps.column("steps")[on_patch].sum()
    key: Row = {"track": cell["track"], "seed": cell["seed"], "planner_mu": cell["planner_mu"]}
    row: Row = {
        **key, "patches": len(patches), "patch_mu": _PATCH_MU if patches else math.nan, "end_reason": laps.end_reason,
        "crashed": laps.crashed, "laps": len(laps.lap_times_s), "best_lap_s": laps.best_flying_lap_s,
        "max_slide_m_s": laps.max_slide_m_s, "sliding_share": laps.slide_time_fraction,
        "friction_utilisation_max": float(np.nanmax(_greatest(laps, "friction_utilisation_{}"))),
        "on_patch_share": float(on_patch.mean()),
        "sliding_share_on_patch": float(sliding / steps) if steps else math.nan,
        "reason": "" if len(laps.lap_times_s) > 1 else f"no flying lap: {laps.end_reason}",
    }  # fmt: skip
    tables: Tables = {"laps": [row]}
    if cell["map"]:
        x, y, slide = laps.column("x_m"), laps.column("y_m"), _greatest(laps, "slide_{}_m_s")
        least = laps.floor_mu.min(axis=1)
        use = _greatest(laps, "friction_utilisation_{}")
        points = np.column_stack((laps.column("time_s"), x, y, slide, use, least))
        names = ("time_s", "x_m", "y_m", "slide_m_s", "friction_utilisation", "floor_mu")
        tables["map"] = [{**key, **dict(zip(names, values, strict=True))} for values in points.tolist()]
        tables["places"] = [
            {
                **key,
                "x_m": p.x,
                "y_m": p.y,
                "length_m": p.length,
                "width_m": p.width,
                "heading_rad": p.heading,
                "mu": p.mu,
            }
            for p in read_patches(world.model)
        ]
    return tables


def _greatest(laps: LabLaps, name: str) -> FloatArray:
    """Return the greatest of the tires' columns at each tick. Shape (ticks,)."""
    return np.asarray(np.fmax.reduce([laps.column(name.format(wheel)) for wheel in WHEELS]))


def _of(rows: list[Row], way: str, name: str) -> float:
    return next((float(row[name] or math.nan) for row in rows if row["way"] == way), math.nan)


def _on_laps(laps: list[Row]) -> list[str]:
    """Say what patches do to a planner that does not know them, and to one that does."""
    sentences = []
    for planner_mu in dict.fromkeys(row["planner_mu"] for row in laps):
        rows = [row for row in laps if row["planner_mu"] == planner_mu and row["patches"]]
        crashes = sum(bool(row["crashed"]) for row in rows)
        share = column(rows, "sliding_share_on_patch")
        plain = {row["track"]: float(row["best_lap_s"] or math.nan) for row in laps
                 if row["planner_mu"] == Vehicle.load().greatest_mu() and not row["patches"]}  # fmt: skip
        change = [float(row["best_lap_s"] or math.nan) / plain.get(row["track"], math.nan) - 1.0 for row in rows]
        sentences.append(
            f"A planner that assumes mu {planner_mu:g}, over patches of mu {_PATCH_MU:g}: {crashes} of {len(rows)} "
            f"races crash, greatest slide {column(rows, 'max_slide_m_s').max():.2f} m/s, a tire slides in "
            f"{100.0 * np.nanmean(share):.0f} % of the time on patches in the mean; against dry "
            f"ground, which it knows, the best lap changes by {100.0 * np.nanmin(change):+.0f} to "
            f"{100.0 * np.nanmax(change):+.0f} %."
        )
    return sentences


def _extremes(rows: list[Row]) -> str:
    crashes, slide = sum(bool(row["crashed"]) for row in rows), column(rows, "max_slide_m_s")
    return f"{crashes} of {len(rows)} crash; greatest slide {span(slide)} m/s"


def _draw_acting(figure: matplotlib.figure.Figure, acting: list[Row], ways: list[Row]) -> None:
    left, right = figure.subplots(1, 2)
    asked = column(acting, "asked_mu")
    theory(left, [asked.min() - 0.1, asked.max() + 0.1], [1.0, 1.0], "as asked for")
    measured(left, asked, column(acting, "acting_ratio"), "sliding sideways", colour=COLOURS[0])
    measured(left, asked, column(acting, "runs_wide_from_k") ** 2, "circle: onset, k²", colour=COLOURS[1])
    measured(left, asked, column(acting, "lateral_ratio"), f"circle at k = {_BEYOND:g}: v²/R", colour=COLOURS[2])
    measured(left, asked, column(acting, "brake_onset"), "braking: rear axle slides", colour=COLOURS[3])
    left.set_ylim(0.9, 1.1)
    finish(left, "friction asked for [-]", "acting, over asked for [-]")
    names = [str(row["way"]) for row in ways]
    theory(right, [-0.5, len(names) - 0.5], column(ways, "asked_mu")[:2], "asked for")
    measured(right, range(len(names)), column(ways, "acting_mu"), "friction that acts", colour=COLOURS[0])
    measured(right, range(len(names)), column(ways, "edge_load_ratio"), "load at the edge, over before",
             colour=COLOURS[1])  # fmt: skip
    right.set_xticks(range(len(names)), names)
    right.set_ylim(0.0, 1.5 * float(np.nanmax(column(ways, "edge_load_ratio"))))
    finish(right, "", "[-]")


def _draw_map(figure: matplotlib.figure.Figure, ticks: list[Row], places: list[Row]) -> None:
    import matplotlib as mpl
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LogNorm

    colours = mpl.colormaps["YlOrRd"].with_extremes(under="0.55")
    assumed = sorted({float(row["planner_mu"] or 0.0) for row in ticks}, reverse=True)
    panels: Any = figure.subplots(1, len(assumed), squeeze=False, sharey=True)[0]
    for axes, planner_mu in zip(panels, assumed, strict=True):
        own = [row for row in ticks if row["planner_mu"] == planner_mu]
        draw_course(axes, load_track(str(own[0]["track"])))
        for place in [row for row in places if row["planner_mu"] == planner_mu]:
            size = {name: float(place[f"{name}_m"] or 0.0) for name in ("x", "y", "length", "width")}
            patch = Patch(**size, heading=float(place["heading_rad"] or 0.0), mu=float(place["mu"] or 0.0))
            axes.fill(*patch.corners().T, color=COLOURS[5], alpha=0.5, linewidth=0.0)
        points = np.column_stack((column(own, "x_m"), column(own, "y_m")))
        line = LineCollection(
            list(np.stack((points[:-1], points[1:]), axis=1)), array=column(own, "slide_m_s")[:-1],
            cmap=colours, norm=LogNorm(slides_above(IDEAL_TIRES), 5.0), linewidth=1.4, capstyle="round",
        )  # fmt: skip
        axes.add_collection(line)
        axes.set_title(f"planner assumes mu {planner_mu:g}", fontsize=8.0)
        axes.grid(visible=False)
        axes.label_outer()
    figure.colorbar(line, ax=list(panels), label="greatest slide of a tire [m/s]", extend="min", shrink=0.9)


EXPERIMENT = PatchesExperiment()
