"""The page of one run: one HTML file that loads nothing else.

Its plots are bokeh's, whose JavaScript is in the page too.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from fg_mujoco.display import html
from fg_mujoco.pictures.pages.bokeh_plots import embed, require_bokeh
from fg_mujoco.pictures.pages.page import resource, switch, write_page
from fg_mujoco.racing.result import RaceResult
from fg_mujoco.racing.run_folder import Run

from . import sections
from .clip import clip_of_several, clip_start, make_clip
from .field import Field, cars_table, contacts_table, field_plots, overtakes_table, said
from .laps_and_slides import lap_length, lap_table, slide_events
from .map_plot import colour_scales, map_plot
from .recorded import SPEED_FAR_ABOVE, map_shapes, read_recorded, tick_columns
from .time_plots import cursor_source, gg_plot, tick_source, time_plots

CLIP_SECONDS = 8.0

_COLOURS = (("speed_m_s", "speed"), ("friction_utilisation", "friction utilisation"), ("slide_m_s", "sliding"))
_AXES = (("distance_m", "over distance"), ("time_s", "over time"))

_READOUT = (
    ("t", "time_s", 3, "s"), ("lap", "lap", 0, ""), ("progress", "progress_m", 1, "m"),
    ("speed", "speed_m_s", 2, "m/s"), ("limit", "limit_speed_m_s", 2, "m/s"),
    ("steering", "steering_angle_rad", 3, "rad"), ("friction utilisation", "friction_utilisation", 2, ""),
    ("sliding", "slide_m_s", 3, "m/s"), ("ahead", "acceleration_ahead_m_s2", 1, "m/s²"),
    ("left", "acceleration_left_m_s2", 1, "m/s²"),
)  # fmt: skip

_OF_SEVERAL = """{cars}
<h2>Gaps and positions</h2><div class="plots">{plots}</div>
<div class="columns"><div>{overtakes}</div><div class="grow">{contacts}</div></div>
<h2>{name}</h2><p class="note">The rest of the page is of car 0. The map has the lines of the others, too.</p>
"""
_BODY = """{head}
{of_several}{colour}
<div id="map" class="plots">{map}</div>
<div id="readout" class="readout"><span>move over a plot: the values of that moment, here and in all plots</span></div>
<div class="columns"><div class="grow"><h2>Laps</h2>{laps}</div>{clip}</div>
<h2>Along the drive</h2>
{across}
<div class="plots">{time}</div>
<div class="columns"><div><h2>g-g diagram</h2><p class="note">In the circle of μ g = {grip} m/s².</p>{gg}</div>
<div class="grow"><h2>Sliding</h2>{slides}</div></div>
{decision}
<h2>Settings, versions, hashes</h2>{settings}"""


def write_report(
    source: RaceResult | Run | str | Path,
    path: str | Path,
    *,
    clip_seconds: float | None = CLIP_SECONDS,
    watch: Callable[[int, int, str], None] | None = None,
) -> Path:
    """Write the report of a run folder, a Run or a RaceResult, in place of one that may be there, and return its path.

    `notes` are lines of HTML under the result, and with `share_library` bokeh's JavaScript is a file beside the page.
    Its video is of `clip_seconds` [s], None for none; `watch` is told how many of its frames are done, of how many, and
    the word "frame". Raises RunFolderError: a folder that is none of `race --out`, lacks a file, or is of another
    version; or the page cannot be written; MissingExtraError: bokeh is not installed.
    """
    require_bokeh()
    run = read_recorded(source)
    columns = tick_columns(run)
    summary, lap_times = run.summary, run.lap_times
    length = lap_length(columns["time_s"], columns["progress_m"], lap_times)
    unfinished = len(lap_times) < int(summary["laps_requested"])
    laps = lap_table(columns, lap_times, length, end=run.end if unfinished else None)
    events = slide_events(columns, length, model=run.tires_model)
    field = Field.of(run)
    film, whose = None, ""
    if clip_seconds is not None:
        start = clip_start(clip_seconds, run.end, lap_times, events, bool(summary["collisions"]))
        shown = None if field is None else clip_of_several(clip_seconds, run.end, field.contacts, field.overtakes)
        if shown is not None:
            start, whose = shown
        car = 0 if field is None else field.index(whose)
        film = make_clip(source, start, min(start + clip_seconds, run.end), watch, car=car)

    ticks, cursor = tick_source(columns), cursor_source()
    grip = run.mu * run.car.gravity
    plots = {
        "map": map_plot(
            map_shapes(run.model, run.end), columns, events, cursor, run.wrong_way, run.crash or run.rollover,
            others=[] if field is None else list(enumerate(field.lines))[1:],
            contacts=[] if field is None else field.contacts,
        ),
        "time": time_plots(ticks, columns, lap_times, run.tires_model),
        "gg": gg_plot(ticks, columns, grip, cursor),
    }  # fmt: skip
    if field is not None:
        plots["field"] = field_plots(field)
    plots_script, places = embed(plots)
    told: list[object] = []
    of_several = None
    if field is not None:
        told.append(said(field, summary.get("winner")))
        of_several = html(
            _OF_SEVERAL, cars=cars_table(field), plots=places["field"], overtakes=overtakes_table(field),
            contacts=contacts_table(field), name=field.rows[0]["name"],
        )  # fmt: skip
    body = html(
        _BODY, head=sections.head(run, told), of_several=of_several, colour=switch("colour", _COLOURS),
        map=places["map"], laps=sections.laps(laps, summary), clip=sections.clip(film, whose),
        across=switch("across", _AXES), time=places["time"], grip=f"{grip:.2f}", gg=places["gg"],
        slides=sections.events(events, run.tires_model, measured=summary["max_slide_m_s"] is not None),
        decision=sections.last_decision(summary.get("last_decision")), settings=sections.settings(run),
    )  # fmt: skip
    data = {
        "readout": _READOUT,
        "free": SPEED_FAR_ABOVE,
        "colours": colour_scales(columns),
        "axes": {"distance_m": "distance driven [m]", "time_s": "time [s]"},
        "clip_start": film.start if film else 0.0,
    }
    script = resource(__package__, "report.js")
    return write_page(path, run.title, body, plots=plots_script, script=script, data=data)
